//! The contact problem of one stage: selection of the candidate pairs, the coefficients from their
//! laws, and the solution.

mod candidates;
mod entries;

use self::entries::refine;
use super::Quality;
use super::contact_pair::Contact;
use super::laws::{Laws, Overlap, Span};
use super::memory::ContactMemory;
use super::problem::ProblemSolver;
use super::problem::dense_system::DenseSystem;
use super::problem::sparse_system::{SparseSystem, SparseSystemView};
use super::problem::statement::{Forces, Problem};
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::model::PressureKind;
use crate::space::{IncidentFlow, Layer};

pub(crate) use super::problem::statement::AppliedForces;

/// Input of the contact problem at one stage.
#[derive(Clone, Copy)]
pub(crate) struct StageInput<'a, S: Fluid> {
    /// Hydrodynamic resistance, factored.
    pub resistance: &'a Resistance<S>,
    /// The incident flow.
    pub flow: &'a IncidentFlow<S>,
    /// Contact laws.
    pub laws: &'a Laws,
    /// Time span over which forces are implicit.
    pub span: Span<'a>,
    /// Velocities that random forces would cause without contacts; empty without them.
    pub random_motion: &'a [f64],
}

/// The successive solves of one stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SolvePass {
    /// The first solve, which selects the candidates.
    First,
    /// A later solve with the same candidates, in which the set of contacts with active friction is
    /// updated.
    Repeat,
    /// A later solve in which friction stays active on the same contacts, whatever their loads.
    FixedActivation,
    /// A later solve with the friction bounds of the last solution that was not one of these: the
    /// solution is unique and depends continuously on the applied forces.
    FixedBounds,
}

/// Linear algebra of the contact problem.
enum Backend<S: Fluid> {
    /// Dense matrices of the contacts, for few spheres.
    Dense(Box<DenseSystem>),
    /// A sparse factor of all spheres, for large ones.
    Sparse(Box<SparseSystem<S>>),
}

/// An imposed pressure: that which the forces of the pairs together bear in the mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ImposedPressure {
    /// Pressure P, in mu·rate.
    pub(crate) pressure: f64,
    /// Volume that stresses are means over, in a³.
    pub(crate) volume: f64,
    /// Resistance κ_V of the volume to its rate of change, in mu.
    pub(crate) resistance: f64,
    /// The normal stress that it is.
    pub(crate) kind: PressureKind,
}

/// The contact problem with its workspace. It allocates only when there are more contacts than ever
/// before.
pub struct ContactSolver<S: Fluid = Layer> {
    /// Candidate pairs, ordered by (i, j), with the forces and velocities of the last solution.
    pub list: Vec<Contact<S>>,
    overlaps: Vec<Overlap>,
    problem: Problem<S>,
    solver: ProblemSolver<S>,
    held_loads: Vec<f64>,
    /// Whether each pair in range, if it is no candidate, closes in the solution.
    closing: Vec<bool>,
    backend: Backend<S>,
    /// The imposed pressure; `None` where the volume is imposed.
    pub(crate) pressure: Option<ImposedPressure>,
    /// `Σ r f/d` of the pairs that repel and attract each other without contact, in mu·a³·rate, and
    /// by how much it decreases per rate of dilation.
    pub(crate) distant_work: [f64; 2],
    /// Rate of dilation e of the last solution; 0 where the volume is imposed.
    pub(crate) dilation: f64,
}

impl<S: Fluid> ContactSolver<S> {
    /// A workspace for the form of the resistance.
    pub fn new(resistance: &Resistance<S>) -> Self {
        Self {
            list: Vec::new(),
            overlaps: Vec::new(),
            problem: Problem::default(),
            solver: ProblemSolver::default(),
            held_loads: Vec::new(),
            closing: Vec::new(),
            pressure: None,
            distant_work: [0.0; 2],
            dilation: 0.0,
            backend: if resistance.pairwise().is_some() {
                Backend::Sparse(Box::default())
            } else {
                Backend::Dense(Box::default())
            },
        }
    }

    /// How the cell dilates.
    pub(crate) fn dilates(&self) -> PressureKind {
        self.pressure.map_or_else(PressureKind::default, |p| p.kind)
    }

    /// Starts a step: discards the motion of earlier stages, so that results depend only on
    /// positions and [`ContactMemory`].
    pub(crate) fn begin_step(&mut self) {
        if let Backend::Sparse(system) = &mut self.backend {
            system.clear_motion();
        }
    }

    /// Starts a stage at new positions, or with other forces that depend on them.
    pub(crate) fn begin_stage(&mut self) {
        if let Backend::Sparse(system) = &mut self.backend {
            system.begin_stage();
        }
    }

    /// Has the candidates be in another flow.
    pub(crate) fn change_flow(&mut self, resistance: &Resistance<S>, flow: &IncidentFlow<S>) {
        for contact in &mut self.list {
            let moved = Contact::new(contact.pair, resistance.radii(), flow);
            contact.background_approach = moved.background_approach;
            contact.background_slip = moved.background_slip;
            contact.background_spin = moved.background_spin;
        }
    }

    /// Solves the problem of the stage, starting from the forces of the last solution. Pairs that
    /// close in the solution are added as candidates, and the problem is solved again, until no
    /// other pair closes.
    ///
    /// `velocities`: set to the disturbance velocities.
    ///
    /// # Returns
    /// The quality of the solution, and whether the set of contacts with active friction changed.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn solve(
        &mut self,
        input: &StageInput<'_, S>,
        applied: AppliedForces<'_>,
        memory: &mut ContactMemory<S>,
        pass: SolvePass,
        velocities: &mut [f64],
    ) -> Result<(Quality, bool), Error> {
        let laws = input.laws;
        if pass == SolvePass::First {
            self.choose_candidates(input, &memory.warm_start);
        }
        let (mut systems, mut changed) = (0, false);
        loop {
            self.set_up_problem(input, memory, pass);
            let holds_bounds = pass == SolvePass::FixedBounds;
            self.held_loads.clear();
            if holds_bounds {
                self.held_loads
                    .extend(self.list.iter().map(|contact| contact.held_load));
            }
            let loads = holds_bounds.then_some(&self.held_loads[..]);
            let (problem, solver) = (&mut self.problem, &mut self.solver);
            let (overlaps, tolerance) = (&mut self.overlaps, applied.relative_tolerance);
            let refine = |problem: &mut Problem<S>, forces: &Forces<S>| {
                refine(input, problem, overlaps, forces, tolerance)
            };
            let solved = match &mut self.backend {
                Backend::Dense(system) => {
                    system.set_up(input.resistance, problem, applied.all);
                    let solved = solver.solve(problem, &mut **system, loads, refine);
                    system.finish(input.resistance, &solver.forces, velocities);
                    solved
                }
                Backend::Sparse(system) => {
                    let mut view =
                        SparseSystemView::begin(input.resistance, system, problem, applied)?;
                    let solved = solver.solve(problem, &mut view, loads, refine);
                    view.finish(velocities);
                    solved
                }
            };
            systems += solved.systems;
            self.dilation = self.problem.dilation.rate(&self.solver.forces);
            self.store_forces(laws);
            if !holds_bounds {
                for contact in &mut self.list {
                    contact.held_load = contact.normal_force;
                }
            }
            changed |= self.store_activation() && !laws.is_smooth();
            let quality = Quality { systems, ..solved };
            let closes = self.add_closing_pairs(input, velocities, &mut memory.warm_start);
            // Additional contacts cannot make a jammed system movable.
            if !closes || quality.jammed() {
                self.update_springs(input, memory);
                return Ok((quality, changed));
            }
            changed = true;
        }
    }

    /// Solves for the velocities under given forces without contacts, at the positions of a stage
    /// whose contact problem is not yet solved. In sparse form they start from the given ones.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn free_motion(
        &mut self,
        resistance: &Resistance<S>,
        forces: AppliedForces<'_>,
        velocities: &mut [f64],
    ) -> Result<(), Error> {
        match &mut self.backend {
            Backend::Dense(_) => {
                velocities.copy_from_slice(forces.all);
                resistance.solver().solve(velocities);
                Ok(())
            }
            Backend::Sparse(system) => {
                SparseSystemView::free_motion(resistance, system, forces, velocities)
            }
        }
    }

    /// The motion under normal forces alone, if the law depends on it.
    pub(crate) fn frictionless_motion(&self) -> Option<&[f64]> {
        match (&self.backend, self.problem.uses_frictionless_slip) {
            (Backend::Sparse(system), true) => Some(system.velocities()[1]),
            _ => None,
        }
    }

    fn update_springs(&self, input: &StageInput<'_, S>, memory: &mut ContactMemory<S>) {
        let (list, kind, laws) = (&self.list, input.span.kind, input.laws);
        if laws.tangential.has_spring() {
            let [slides, rolls] = laws.friction_coefficients();
            let springs = &mut memory.springs;
            let bound = |coefficient| move |c: &Contact<S>| laws.bound(coefficient, c);
            springs.record(list, kind, |c| c.tangential_force, bound(slides));
            if laws.rolling_friction > 0.0 {
                let springs = &mut memory.rolling_springs;
                springs.record(list, kind, |c| c.rolling_force, bound(rolls));
            }
        }
    }
}
