//! The contact problem of one stage: which pairs take part, what their laws ask for, and the forces that answer.

mod candidates;
mod entries;

use self::entries::refine;
use super::laws::{Laws, Overlap, Span};
use super::memory::ContactMemory;
use super::pair::Contact;
use super::solve::dense::DenseSystem;
use super::solve::newton::FrictionActivation;
use super::solve::problem::{Forces, Problem};
use super::solve::sparse::{OnNetwork, SparseSystem};
use super::solve::{Outcome, ProblemSolver};
use super::{Quality, most_contacts};
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::space::Layer;

pub(crate) use super::solve::problem::AppliedForces;

/// What a contact problem is input in.
#[derive(Clone, Copy)]
pub(crate) struct StageInput<'a, S: Fluid> {
    /// Hydrodynamics, factored where they are.
    pub resistance: &'a Resistance<S>,
    /// Imposed flow.
    pub background: &'a S::Background,
    /// Laws.
    pub laws: &'a Laws,
    /// Time ahead.
    pub span: Span<'a>,
}

/// Which solve of a stage it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pass {
    /// The first: the candidates are chosen.
    First,
    /// Another, of the same candidates.
    Again,
    /// Another, in which friction acts on the same contacts as before, whatever their loads.
    Held,
}

/// The linear algebra behind the problem.
enum Backend<S: Fluid> {
    /// Small dense matrices of contacts.
    Dense(Box<DenseSystem<S>>),
    /// A sparse factor of all spheres.
    Sparse(Box<SparseSystem<S>>),
}

/// The contact problem with its workspace. Reused, it allocates only when the layer has more contacts than ever before.
pub struct ContactSolver<S: Fluid = Layer> {
    /// Candidate pairs, ordered by (i, j), with the forces and velocities of the last solution.
    pub list: Vec<Contact<S>>,
    /// Their overlaps.
    overlaps: Vec<Overlap>,
    /// Entries.
    problem: Problem<S>,
    /// States and forces.
    solver: ProblemSolver<S>,
    /// Linear algebra.
    backend: Backend<S>,
}

impl<S: Fluid> ContactSolver<S> {
    /// Workspace with room for all contacts of the spheres. Pages never written to cost no memory.
    pub fn new(resistance: &Resistance<S>) -> Self {
        let spheres = resistance.radii().len();
        let most = most_contacts::<S>(spheres);
        let backend = if resistance.pairwise().is_some() {
            Backend::Sparse(Box::default())
        } else {
            Backend::Dense(Box::new(DenseSystem::new(spheres, most)))
        };
        let mut solver = Self {
            list: Vec::with_capacity(most),
            overlaps: Vec::with_capacity(most),
            problem: Problem::default(),
            solver: ProblemSolver::default(),
            backend,
        };
        solver.problem.normal.reserve(most);
        solver.problem.tangential.reserve(2 * S::TANGENTS * most);
        solver.solver.reserve(most);
        solver
    }

    /// Begins a step: what is known of the motion from stages before is forgotten.
    pub(crate) fn begin_step(&mut self) {
        if let Backend::Sparse(system) = &mut self.backend {
            system.forget();
        }
    }

    /// Solves the problem of the stage from the forces of the last solution, with ever more candidates until none of
    /// the others closes.
    ///
    /// `velocities`: disturbances that come out.
    ///
    /// # Returns
    /// How well it was solved, and whether friction acts on other contacts than before.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn solve(
        &mut self,
        input: &StageInput<'_, S>,
        applied: AppliedForces<'_>,
        memory: &mut ContactMemory<S>,
        pass: Pass,
        velocities: &mut [f64],
    ) -> Result<(Quality, bool), Error> {
        let laws = input.laws;
        let activation = FrictionActivation {
            critical_load: laws.surface.critical_load,
            updates: pass != Pass::Held && !laws.is_smooth(),
        };
        if pass == Pass::First {
            if let Backend::Sparse(system) = &mut self.backend {
                system.start();
            }
            self.choose(input, &memory.warm_start);
        }
        let (mut systems, mut changed) = (0, false);
        loop {
            self.pose(input, memory, pass);
            let outcome = self.solve_posed(input, applied, activation, velocities)?;
            systems += outcome.systems;
            self.keep_forces(laws);
            for contact in &mut self.list {
                contact.take_velocities(velocities);
            }
            changed |= self.keep_activation() && !laws.is_smooth();
            let quality = Quality {
                status: outcome.status,
                residual: outcome.violation.residual,
                friction_error: outcome.violation.friction_error,
                systems,
            };
            let closes = self.add_closing(input, velocities, &mut memory.warm_start);
            // With more contacts a jammed layer has no motion either.
            if !closes || quality.jammed() {
                self.keep_springs(input, memory);
                return Ok((quality, changed));
            }
            changed = true;
        }
    }

    /// The motion that normal forces alone leave, where the law reads it.
    pub(crate) fn isolated_motion(&self, input: &StageInput<'_, S>) -> Option<&[f64]> {
        match (&self.backend, input.laws.reads_isolated_motion()) {
            (Backend::Sparse(system), true) => Some(system.velocities()[1]),
            _ => None,
        }
    }

    /// Keeps the springs of a solved stage.
    fn keep_springs(&self, input: &StageInput<'_, S>, memory: &mut ContactMemory<S>) {
        let (list, phase, laws) = (&self.list, input.span.phase, input.laws);
        if laws.tangential.has_spring() {
            memory.springs.take(list, phase, |c| c.tangential_force);
            if laws.rolling_friction > 0.0 {
                memory
                    .rolling_springs
                    .take(list, phase, |c| c.rolling_force);
            }
        }
    }

    /// Forces of the problem that was posed, and the motion.
    fn solve_posed(
        &mut self,
        input: &StageInput<'_, S>,
        applied: AppliedForces<'_>,
        activation: FrictionActivation,
        velocities: &mut [f64],
    ) -> Result<Outcome, Error> {
        let (problem, solver) = (&mut self.problem, &mut self.solver);
        let (overlaps, tolerance) = (&mut self.overlaps, applied.relative_tolerance);
        let refine = |problem: &mut Problem<S>, forces: &Forces| {
            refine(input, problem, overlaps, forces, tolerance)
        };
        Ok(match &mut self.backend {
            Backend::Dense(system) => {
                system.begin(input.resistance, problem, applied.all);
                let solved = solver.solve(problem, &mut **system, activation, refine);
                system.finish(input.resistance, &solver.forces, velocities);
                solved
            }
            Backend::Sparse(system) => {
                let mut on_network = OnNetwork::begin(input.resistance, system, problem, applied)?;
                let solved = solver.solve(problem, &mut on_network, activation, refine);
                velocities.copy_from_slice(system.velocities()[0]);
                solved
            }
        })
    }
}
