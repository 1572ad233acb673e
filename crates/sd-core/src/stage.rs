//! One stage: velocities from positions, including contact forces. Only here do contacts and the
//! far field meet.

mod method;

pub use method::{Method, memory_bytes};

use crate::contact::contact_solver::{AppliedForces, StageInput};
use crate::contact::distant_forces::DistantForces;
use crate::contact::laws::{Laws, Span};
use crate::contact::{ContactMemory, ContactSolver, Quality, SolvePass, Status, Surface};
use crate::error::Error;
use crate::hydrodynamics::far_field::far_operator::FarOperator;
use crate::hydrodynamics::far_field::pressure::far_pressure_moment;
use crate::hydrodynamics::iterative::IterativeFarField;
use crate::hydrodynamics::iterative::fixed_point::{FixedPointMap, Progress};
use crate::hydrodynamics::resistance::{Fluid, PressureWork, RandomStress, Resistance};
use crate::procedure::{ContactList, ProcedureInput, ProcedureSolver};
use crate::space::cell::Cell;
use crate::space::pair::Neighbours;
use crate::space::{IncidentFlow, Layer, Strains};
use std::f64::consts::PI;

/// Contact problems are solved to this fraction of the far field's relative residual, so that the
/// differences between iterates, from which the acceleration extrapolates, are not noise.
const CONTACT_TOLERANCE: f64 = 2e-3;
/// Factor of that tolerance once a solution to it has violated the conditions of contacts, which
/// also hold where forces of any size balance each other.
const STRICT: f64 = 1e-2;
/// Residual of the motion under random forces alone, over the norm of the forces. It does not enter
/// the motion of the spheres, only reflections and the Brownian stress.
const FREE_TOLERANCE: f64 = 1e-6;
/// Relative residual assumed for the tolerance of the first evaluation.
const INITIAL_RESIDUAL: f64 = 1e-2;
/// Factor by which the residual must have decreased since the last update of friction activation
/// before the next one.
const ACTIVATION_REDUCTION: f64 = 0.1;
/// Number of changes of friction activation in one solve after which it stays fixed.
const MAX_ACTIVATION_CHANGES: u32 = 8;

/// The contacts of a stage, with their memory.
pub enum StageContacts<'a, S: Fluid = Layer> {
    /// No contacts: hydrodynamics only.
    None,
    /// Contact laws, which define one contact problem: see `contact::laws`.
    Laws {
        /// The laws.
        laws: &'a Laws,
        /// Time span over which contact forces are implicit.
        span: Span<'a>,
        /// State of the contacts.
        memory: &'a mut ContactMemory<S>,
    },
    /// The paper's steps: see `procedure`.
    Procedure {
        /// Roughness and friction.
        surface: Surface,
        /// Pairs in contact.
        contact_list: &'a mut ContactList,
    },
}

/// Solver for the motion of a set of spheres, with its workspace.
pub struct StageSolver<S: Fluid = Layer> {
    /// Hydrodynamic resistance.
    pub resistance: Resistance<S>,
    /// Contact solver with the last solution; its list is empty without contact.
    pub contacts: ContactSolver<S>,
    /// Pairs with a repulsion or adhesion.
    pub distant: DistantForces<S>,
    /// External and background forces.
    forces: Vec<f64>,
    /// Disturbance velocities of the last solve.
    velocities: Vec<f64>,
    /// Random forces of Brownian motion, and the velocities that they would cause without
    /// contacts; empty without them.
    random_forces: Vec<f64>,
    random_motion: Vec<f64>,
    /// Where the spheres are.
    cell: Cell<S>,
    centres: Vec<S::Vector>,
    /// Total applied forces in one evaluation of the far-field iteration.
    applied: Vec<f64>,
    /// Iterative far field in addition to a pairwise Ball-Melrose resistance.
    far: Option<Box<IterativeFarField<S>>>,
    /// Solver of the paper's steps, created at their first stage.
    procedure: Option<Box<ProcedureSolver<S>>>,
}

impl<S: Fluid> StageSolver<S> {
    /// A solver for the spheres of the resistance.
    pub fn new(resistance: Resistance<S>) -> Self {
        let n = S::MODES * resistance.radii().len();
        Self {
            contacts: ContactSolver::new(&resistance),
            resistance,
            distant: DistantForces::default(),
            forces: vec![0.0; n],
            velocities: vec![0.0; n],
            random_forces: Vec::new(),
            random_motion: Vec::new(),
            cell: Cell::Unbounded,
            centres: Vec::new(),
            applied: Vec::with_capacity(n),
            far: None,
            procedure: None,
        }
    }

    /// Full Stokesian Dynamics of many spheres: an iterative far field in addition to a pairwise
    /// Ball-Melrose resistance.
    pub fn with_far_field(pairwise: Resistance<S>, far: IterativeFarField<S>) -> Self {
        Self {
            far: Some(Box::new(far)),
            ..Self::new(pairwise)
        }
    }

    /// Starts a step: discards the results of earlier stages except [`ContactMemory`] and
    /// [`StageSolver::far_field`]. Results then depend only on these and on positions, so that a
    /// resumed run has the same bits.
    pub fn begin_step(&mut self) {
        self.contacts.begin_step();
        self.random_motion.fill(0.0);
        if let Some(far) = &mut self.far {
            far.split.round();
            far.clear_free_motion();
        }
    }

    /// Keeps what a step changes beside [`ContactMemory`]: the initial far field and the pattern of
    /// sparse matrices, on which the bits of results depend.
    pub(crate) fn save(&mut self) {
        if let Some(far) = &mut self.far {
            far.split.save();
        }
        if let Some(pairwise) = self.resistance.pairwise_mut() {
            pairwise.save_pattern();
        }
    }

    /// Restores what [`StageSolver::save`] kept.
    pub(crate) fn restore(&mut self) {
        if let Some(far) = &mut self.far {
            far.split.restore();
        }
        if let Some(pairwise) = self.resistance.pairwise_mut() {
            pairwise.restore_pattern();
        }
    }

    /// Initial far field of the next solve, if it is iterated: see [`crate::Snapshot::far_field`].
    pub fn far_field(&self) -> Vec<f32> {
        self.far
            .as_ref()
            .map_or_else(Vec::new, |far| far.split.warm_start())
    }

    /// Sets the initial far field of the next solve to the value of [`StageSolver::far_field`];
    /// zero if that is empty.
    pub fn start_far_field_from(&mut self, far_field: &[f32]) {
        if let Some(far) = &mut self.far {
            far.split.start_from(far_field);
        }
    }

    /// Refuses a last solve whose far field did not converge.
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    pub(crate) fn check_far_field(&self) -> Result<(), Error> {
        self.far
            .as_ref()
            .map_or(Ok(()), |far| far.check_converged())
    }

    /// The iterated far field, to limit its evaluations.
    #[cfg(test)]
    pub(crate) fn far_mut(&mut self) -> Option<&mut IterativeFarField<S>> {
        self.far.as_deref_mut()
    }

    /// Products with the mobility of the far field at the current positions, if it is iterated.
    pub(crate) fn far_operator(&mut self) -> Option<&mut FarOperator<S>> {
        self.far.as_mut().map(|far| far.operator())
    }

    /// Forces and stresslets of the fluid in the last solve, as in [`Resistance::apply`]; `work` is
    /// workspace.
    pub fn counterforces(
        &self,
        strains: Strains<'_, S>,
        work: &mut Vec<f64>,
        forces: &mut Vec<f64>,
        stresslets: &mut Vec<S::Strain>,
    ) {
        self.resistance
            .apply(&self.velocities, strains, work, forces, stresslets);
        if let Some(far) = &self.far {
            far.correct(forces, stresslets);
        }
    }

    /// The isotropic part of the hydrodynamic stress in the last solve, as a pressure times the
    /// volume, in mu·a³·rate: a third of the pressure moments of all spheres.
    ///
    /// It is relative to the pressure far above and below a layer, or far away in unbounded fluid;
    /// in a periodic suspension to the mean pressure of the fluid between the spheres. There, with
    /// Π_far of a pressure without a mean over the cell, and Π_near of pairs alone,
    ///
    /// ```text
    /// Π = (Π_far + Π_near − φ m)/(1 − φ)
    /// ```
    /// since a pressure field whose mean over the cell is zero has the mean −Π over the fluid times
    /// 1 − φ; m, the virial of the near forces, is the mean over the cell of a pair's own field.
    pub(crate) fn hydrodynamic_pressure(
        &self,
        strains: Strains<'_, S>,
        work: &mut PressureWork<S>,
    ) -> f64 {
        let (resistance, velocities) = (&self.resistance, &self.velocities);
        let [mut moment, of_forces] = resistance.pressure_moments(velocities, strains, work);
        let has_far_field = match &self.far {
            Some(far) => {
                far.force_modes(velocities, strains, work);
                true
            }
            None => resistance.far_modes(velocities, strains, work),
        };
        let radii = resistance.radii();
        if has_far_field {
            let (modes, sources) = (S::all_modes(&work.modes), &mut work.sources);
            moment += far_pressure_moment(&self.cell, &self.centres, radii, modes, sources);
        }
        if let (3, Some(volume)) = (S::DIMENSIONS, self.cell.content()) {
            let spheres: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
            let fraction = spheres / volume;
            moment = (moment - fraction * of_forces) / (1.0 - fraction);
        }
        moment / 3.0
    }

    /// Draws the random forces of the next stages at the current positions, which replace the
    /// former, and that on the rate of a flow of these rates of strain, where it is free: see
    /// [`Resistance::add_random_forces`].
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    pub(crate) fn draw_random_forces(
        &mut self,
        scale: f64,
        mut normal: impl FnMut() -> f64,
        flow: Option<&S::Strain>,
    ) -> Result<RandomStress, Error> {
        for list in [&mut self.random_forces, &mut self.random_motion] {
            list.clear();
            list.resize(self.velocities.len(), 0.0);
        }
        let forces = &mut self.random_forces;
        let resistance = &mut self.resistance;
        let mut stress = resistance.add_random_forces(scale, &mut normal, flow, forces);
        if let Some(far) = &mut self.far {
            let (of_far, _) = far.add_random_forces(scale, normal, flow, forces)?;
            stress.force += of_far;
        }
        Ok(stress)
    }

    pub(crate) fn has_random_forces(&self) -> bool {
        !self.random_forces.is_empty()
    }

    /// Sets the stresslets of the motion that random forces alone would cause in the last solve.
    ///
    /// `work`: scratch.
    pub(crate) fn random_stresslets(
        &self,
        [work, forces]: [&mut Vec<f64>; 2],
        stresslets: &mut Vec<S::Strain>,
    ) {
        let (motion, at_rest) = (&self.random_motion, Strains::none());
        self.resistance
            .apply(motion, at_rest, work, forces, stresslets);
        if let Some(far) = &self.far {
            far.correct_free(forces, stresslets);
        }
    }

    /// Disturbance velocities `(U − u∞, Ω − Ω∞)` of the last solve.
    pub fn velocities(&self) -> &[f64] {
        &self.velocities
    }

    /// The pair with the smallest gap, if any pair is in lubrication range.
    pub fn closest(&self) -> Option<&Neighbours<S>> {
        let pairs = self.resistance.neighbours().iter();
        pairs.min_by(|a, b| a.gap.total_cmp(&b.gap))
    }

    /// Sets positions: finds pairs and assembles the resistance. It is not factored, since a
    /// repulsion is added to it later.
    ///
    /// # Errors
    /// Overlaps, an indefinite mobility, memory.
    pub fn assemble(&mut self, cell: &Cell<S>, centres: &[S::Vector]) -> Result<(), Error> {
        self.resistance.assemble(cell, centres)?;
        self.cell = *cell;
        self.centres.clear();
        self.centres.extend_from_slice(centres);
        match &mut self.far {
            Some(far) => far.update(cell, centres),
            None => Ok(()),
        }
    }

    /// Solves for the velocities at the current positions under external forces and torques (empty:
    /// none).
    ///
    /// `pass`: [`SolvePass::First`] first after every [`StageSolver::assemble`], and again under
    /// other external forces if no repulsion acts; later passes solve again under the same external
    /// forces, possibly with another contact law without repulsion or adhesion.
    ///
    /// # Errors
    /// An indefinite matrix, a far field that does not converge, velocities that are not finite.
    pub fn solve(
        &mut self,
        flow: &IncidentFlow<S>,
        external: &[f64],
        contact: StageContacts<'_, S>,
        pass: SolvePass,
    ) -> Result<Quality, Error> {
        if pass == SolvePass::First {
            self.begin(flow, external, &contact)?;
        }
        let (resistance, contacts) = (&self.resistance, &mut self.contacts);
        let (forces, velocities) = (&self.forces, &mut self.velocities);
        let (no_laws, mut no_memory) = (Laws::none(), ContactMemory::default());
        let is_free = matches!(contact, StageContacts::None);
        let contact = match contact {
            StageContacts::None => StageContacts::Laws {
                laws: &no_laws,
                span: Span::single(1.0),
                memory: &mut no_memory,
            },
            other => other,
        };
        let quality = match contact {
            StageContacts::None => unreachable!("replaced by no laws"),
            StageContacts::Laws { laws, span, memory } => {
                let input = StageInput {
                    resistance,
                    flow,
                    laws,
                    span,
                    random_motion: &self.random_motion,
                };
                if let Some(far) = &mut self.far {
                    let mut map = ContactMap {
                        input,
                        contacts,
                        memory,
                        applied: &mut self.applied,
                        pass,
                        is_free,
                        quality: Quality::default(),
                        changes: 0,
                        residual_at_update: f64::INFINITY,
                        is_strict: false,
                    };
                    let solution = far.solve_fixed_point(
                        resistance,
                        &mut map,
                        flow.strains(),
                        forces,
                        velocities,
                    )?;
                    let mut quality = map.quality;
                    if is_free {
                        far.check_converged()?;
                    }
                    if !solution.converged {
                        // The residual is a spurious flow in addition to the background.
                        quality.residual = quality.residual.max(solution.residual);
                        if !quality.jammed() {
                            quality.status = Status::Failed;
                        }
                    }
                    quality
                } else {
                    let applied = AppliedForces::both(forces);
                    contacts.solve(&input, applied, memory, pass, velocities)?.0
                }
            }
            StageContacts::Procedure {
                surface,
                contact_list,
            } => {
                let input = ProcedureInput {
                    resistance,
                    flow,
                    surface: &surface,
                    forces,
                };
                self.procedure.get_or_insert_default().solve(
                    &input,
                    contact_list,
                    &mut contacts.list,
                    velocities,
                )?
            }
        };
        let (dilation, kind) = (self.contacts.dilation, self.contacts.dilates());
        self.distant.finish(&self.velocities, kind, dilation);
        for contact in &mut self.contacts.list {
            contact.set_velocities(&self.velocities);
            contact.dilate(kind, dilation);
        }
        match self.velocities.iter().position(|v| !v.is_finite()) {
            Some(at) => Err(Error::NotFinite {
                quantity: "the velocity",
                sphere: at / S::MODES,
            }),
            None => Ok(quality),
        }
    }

    /// Has the next solve, at the positions of the last one and with its candidates, be in another
    /// flow, without forces of pairs that do not touch.
    pub(crate) fn change_flow(&mut self, flow: &IncidentFlow<S>, external: &[f64]) {
        let forces = &mut self.forces;
        self.resistance.background_forces(flow.strains(), forces);
        for other in [external, &self.random_forces[..]] {
            for (force, x) in forces.iter_mut().zip(other) {
                *force += x;
            }
        }
        self.contacts.change_flow(&self.resistance, flow);
    }

    /// Computes the forces on the spheres other than contact forces, and factors the resistance,
    /// including a repulsion.
    fn begin(
        &mut self,
        flow: &IncidentFlow<S>,
        external: &[f64],
        contact: &StageContacts<'_, S>,
    ) -> Result<(), Error> {
        let (resistance, forces) = (&mut self.resistance, &mut self.forces);
        resistance.background_forces(flow.strains(), forces);
        for (force, x) in forces.iter_mut().zip(external) {
            *force += x;
        }
        self.distant.clear();
        if let StageContacts::Laws { laws, span, .. } = contact {
            self.distant.add(laws, resistance, flow, span, forces);
        }
        self.contacts.distant_work = self.distant.work(self.contacts.dilates());
        resistance.factor()?;
        self.contacts.begin_stage();
        if !self.random_forces.is_empty() {
            let (random, motion) = (&self.random_forces, &mut self.random_motion);
            let contacts = &mut self.contacts;
            if let Some(far) = &mut self.far {
                let mut map = FreeMap {
                    resistance,
                    contacts,
                };
                far.free_motion(resistance, &mut map, random, motion)?;
            } else {
                let forces = AppliedForces {
                    relative_tolerance: FREE_TOLERANCE,
                    ..AppliedForces::both(random)
                };
                contacts.free_motion(resistance, forces, motion)?;
            }
            for (force, x) in self.forces.iter_mut().zip(random) {
                *force += x;
            }
        }
        Ok(())
    }
}

/// The motion without contacts as a map of the far-field iteration.
struct FreeMap<'a, S: Fluid> {
    resistance: &'a Resistance<S>,
    contacts: &'a mut ContactSolver<S>,
}

impl<S: Fluid> FixedPointMap for FreeMap<'_, S> {
    fn evaluate(
        &mut self,
        forces: &[f64],
        progress: Progress,
        velocities: &mut [f64],
    ) -> Result<bool, Error> {
        let half = velocities.len() / 2;
        let (v, v_t) = velocities.split_at_mut(half);
        v_t.fill(0.0);
        if progress.evaluations == 0 {
            // What is left there is of no meaning, and an interrupted run has nothing.
            v.fill(0.0);
        }
        let forces = AppliedForces {
            relative_tolerance: CONTACT_TOLERANCE * progress.residual.min(INITIAL_RESIDUAL),
            ..AppliedForces::both(&forces[..half])
        };
        self.contacts.free_motion(self.resistance, forces, v)?;
        Ok(false)
    }
}

/// The contact problem as a map of the far-field iteration.
struct ContactMap<'a, S: Fluid> {
    /// Input of the contact problem.
    input: StageInput<'a, S>,
    /// Contact solver.
    contacts: &'a mut ContactSolver<S>,
    /// State of the contacts.
    memory: &'a mut ContactMemory<S>,
    /// Total applied forces of both parts.
    applied: &'a mut Vec<f64>,
    /// Pass of the stage.
    pass: SolvePass,
    /// Whether there are no contacts.
    is_free: bool,
    /// Quality of the last solution.
    quality: Quality,
    /// Number of changes of friction activation.
    changes: u32,
    /// Relative residual at the last update of friction activation.
    residual_at_update: f64,
    /// Whether a solution was too inexact.
    is_strict: bool,
}

impl<S: Fluid> FixedPointMap for ContactMap<'_, S> {
    fn evaluate(
        &mut self,
        forces: &[f64],
        progress: Progress,
        velocities: &mut [f64],
    ) -> Result<bool, Error> {
        let half = velocities.len() / 2;
        let (normal, by_friction) = forces.split_at(half);
        self.applied.clear();
        self.applied
            .extend(normal.iter().zip(by_friction).map(|(n, t)| n + t));
        let applied = AppliedForces {
            all: self.applied,
            frictionless: normal,
            // Without contacts the balance of forces is as accurate as the near part's solver: the
            // far field of the last evaluation enters it without error.
            relative_tolerance: if self.is_free {
                0.0
            } else {
                let strict = if self.is_strict { STRICT } else { 1.0 };
                strict * CONTACT_TOLERANCE * progress.residual.min(INITIAL_RESIDUAL)
            },
        };
        let (v, v_t) = velocities.split_at_mut(half);
        let first = progress.evaluations == 0;
        let reduced = progress.residual < ACTIVATION_REDUCTION * self.residual_at_update;
        let updates = self.changes < MAX_ACTIVATION_CHANGES && (first || reduced);
        if reduced {
            self.residual_at_update = progress.residual;
        }
        let pass = match self.pass {
            pass if first => pass,
            _ if progress.holds_bounds => SolvePass::FixedBounds,
            SolvePass::First | SolvePass::Repeat if updates => SolvePass::Repeat,
            _ => SolvePass::FixedActivation,
        };
        let (quality, changed) = self
            .contacts
            .solve(&self.input, applied, self.memory, pass, v)?;
        self.changes += u32::from(changed && !first);
        self.quality = Quality {
            systems: self.quality.systems + quality.systems,
            ..quality
        };
        // The frictional part is separate where friction depends on the motion without it.
        match self.contacts.frictionless_motion() {
            Some(isolated) => {
                for ((v, v_t), v_n) in v.iter_mut().zip(v_t).zip(isolated) {
                    *v_t = *v - v_n;
                    *v = *v_n;
                }
            }
            None => v_t.fill(0.0),
        }
        Ok(changed)
    }

    fn accepts(&mut self) -> bool {
        let accepts = self.is_strict || self.quality.converged() || self.quality.jammed();
        self.is_strict |= !accepts;
        accepts
    }
}
