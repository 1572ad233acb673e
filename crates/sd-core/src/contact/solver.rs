//! The contact problem of one stage: which pairs take part, what their laws ask for, and the forces that answer.

mod candidates;
mod entries;

use self::candidates::parting_velocity;
use self::entries::refine;
use super::laws::{Laws, Overlap, Span};
use super::pair::Contact;
use super::solve::dense::DenseSystem;
use super::solve::newton::FrictionActivation;
use super::solve::problem::{Forces, Problem, System};
use super::solve::sparse::{OnNetwork, SparseSystem};
use super::solve::{Outcome, ProblemSolver};
use super::springs::Stretches;
use super::warm_start::{SpringForces, WarmStart};
use super::{Quality, Status, most_contacts};
use crate::error::Error;
use crate::hydrodynamics::resistance::Resistance;
use crate::space::modes::Background;

pub use super::solve::problem::AppliedForces;

/// Rounds of adding pairs that turned out to close after all.
const MOST_ROUNDS: u32 = 20;

/// What a contact problem is input in.
#[derive(Clone, Copy)]
pub struct StageInput<'a> {
    /// Hydrodynamics, factored where they are.
    pub resistance: &'a Resistance,
    /// Imposed flow.
    pub background: &'a Background,
    /// Laws.
    pub laws: &'a Laws,
    /// Time ahead.
    pub span: Span<'a>,
}

/// What contacts remember from stage to stage and from step to step.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactMemory {
    /// Forces of the stage before: where the next begins.
    pub warm_start: WarmStart,
    /// Forces of tangential springs; none under laws without.
    pub springs: SpringForces,
    /// The same of the springs of rolling friction.
    #[serde(default)]
    pub rolling_springs: SpringForces,
}

impl ContactMemory {
    /// Becomes equal to the other, without allocating once there is room.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.warm_start.copy_from(&other.warm_start);
        self.springs.0.clone_from(&other.springs.0);
        self.rolling_springs.0.clone_from(&other.rolling_springs.0);
    }

    /// Room for that many contacts.
    pub(crate) fn reserve(&mut self, contacts: usize) {
        self.warm_start.forces.reserve(contacts);
        self.warm_start.rolling.0.reserve(contacts);
        self.springs.0.reserve(contacts);
        self.rolling_springs.0.reserve(contacts);
    }
}

/// Whether the set of contacts with active friction may change in a solve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ActivationUpdate {
    /// It follows the loads.
    Update,
    /// It stays as it is.
    Hold,
}

/// The linear algebra behind the problem.
pub(super) enum Backend {
    /// Small dense matrices of contacts.
    Dense(Box<DenseSystem>),
    /// A sparse factor of all spheres.
    Sparse(Box<SparseSystem>),
}

/// The contact problem with its workspace. Reused, it allocates only when the layer has more contacts than ever before.
pub struct ContactSolver {
    /// Candidate pairs, ordered by (i, j), with the forces and velocities of the last solution.
    pub list: Vec<Contact>,
    /// Their overlaps.
    overlaps: Vec<Overlap>,
    /// Entries.
    pub(super) problem: Problem,
    /// States and forces.
    solver: ProblemSolver,
    /// Linear algebra.
    pub(super) backend: Backend,
    /// Tangential springs within a step.
    stretches: Stretches,
    /// Those of rolling friction.
    rolling_stretches: Stretches,
}

impl ContactSolver {
    /// Workspace with room for all contacts of the spheres. Pages never written to cost no memory.
    pub fn new(resistance: &Resistance) -> Self {
        let spheres = resistance.radii().len();
        let most = most_contacts(spheres);
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
            stretches: Stretches::default(),
            rolling_stretches: Stretches::default(),
        };
        solver.problem.normal.reserve(most);
        solver.problem.tangential.reserve(2 * most);
        solver.solver.reserve(most);
        solver.stretches.reserve(most);
        solver.rolling_stretches.reserve(most);
        solver
    }

    /// Begins a step: what is known of the motion from stages before is forgotten.
    pub fn begin_step(&mut self) {
        if let Backend::Sparse(system) = &mut self.backend {
            system.forget();
        }
    }

    /// Takes the positions of a stage, and its first candidates.
    pub(crate) fn begin(&mut self, input: &StageInput<'_>, memory: &ContactMemory) {
        if let Backend::Sparse(system) = &mut self.backend {
            system.start();
        }
        self.choose(input, &memory.warm_start);
    }

    /// Solves the problem of the stage from the forces of the last solution, with ever more candidates until none of
    /// the others closes.
    ///
    /// # Arguments
    /// - `update`: whether the set of contacts with active friction may change.
    /// - `velocities`: disturbances `[3N]` that come out.
    ///
    /// # Returns
    /// How well it was solved, and whether that set has changed.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn solve(
        &mut self,
        input: &StageInput<'_>,
        applied: AppliedForces<'_>,
        memory: &mut ContactMemory,
        update: ActivationUpdate,
        velocities: &mut [f64],
    ) -> Result<(Quality, bool), Error> {
        let (mut systems, mut changed) = (0, false);
        for round in 1..=MOST_ROUNDS {
            let outcome = self.solve_candidates(input, applied, memory, update, velocities)?;
            systems += outcome.systems;
            changed |= self.keep_activation() && !input.laws.is_smooth();
            let mut quality = Quality {
                status: outcome.status,
                residual: outcome.violation.residual,
                friction_error: outcome.violation.friction_error,
                systems,
            };
            let closes = self.add_closing(input, velocities, &mut memory.warm_start);
            // With more contacts a jammed layer has no motion either.
            if !closes || quality.jammed() {
                return Ok((quality, changed));
            }
            changed = true;
            if round == MOST_ROUNDS {
                // By how much pairs still close counts as a violation.
                let closing = self.list.iter().filter(|c| c.normal_force == 0.0);
                let closing = closing.map(|c| parting_velocity(input, c) - c.normal_velocity);
                quality.residual = closing.fold(quality.residual, f64::max);
                quality.status = Status::Failed;
                return Ok((quality, changed));
            }
        }
        unreachable!("the last round returns")
    }

    /// Whether friction would act on the same contacts above another critical load.
    pub(crate) fn acts_alike(&self, load: f64) -> bool {
        self.list
            .iter()
            .all(|contact| contact.friction_acts == (contact.normal_force > load))
    }

    /// Brings the forces of all springs of friction into another unit.
    pub(crate) fn rescale_springs(&mut self, memory: &mut ContactMemory, factor: f64) {
        memory.springs.rescale(factor);
        memory.rolling_springs.rescale(factor);
        self.stretches.rescale(factor);
        self.rolling_stretches.rescale(factor);
    }

    /// Velocities `[3N]` of the spheres without contacts.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn solve_free(
        &mut self,
        resistance: &Resistance,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<(), Error> {
        self.list.clear();
        self.problem.normal.clear();
        self.problem.tangential.clear();
        self.problem.uses_frictionless_slip = false;
        let (problem, solver) = (&mut self.problem, &mut self.solver);
        match &mut self.backend {
            Backend::Dense(system) => {
                system.begin(resistance, problem, forces);
                solver.forces.clear();
                system.finish(resistance, &solver.forces, velocities);
            }
            Backend::Sparse(system) => {
                system.start();
                let mut on_network =
                    OnNetwork::begin(resistance, system, problem, AppliedForces::both(forces))?;
                solver.forces.clear();
                on_network.measure(problem, &mut solver.forces);
                velocities.copy_from_slice(system.velocities()[0]);
            }
        }
        Ok(())
    }

    /// The motion `[3N]` that normal forces alone leave, where the law reads it.
    pub(crate) fn isolated_motion(&self, input: &StageInput<'_>) -> Option<&[f64]> {
        match (&self.backend, input.laws.reads_isolated_motion()) {
            (Backend::Sparse(system), true) => Some(system.velocities()[1]),
            _ => None,
        }
    }

    /// Takes the velocities of the contacts in a motion with disturbances `[3N]`.
    pub(crate) fn take_motion(&mut self, velocities: &[f64]) {
        for contact in &mut self.list {
            contact.take_velocities(velocities);
        }
    }

    /// Keeps the springs of a solved stage.
    pub(crate) fn keep_springs(&mut self, input: &StageInput<'_>, memory: &mut ContactMemory) {
        if !input.laws.tangential.has_spring() {
            return;
        }
        let (list, phase) = (&self.list, input.span.phase);
        self.stretches
            .take(list, &mut memory.springs, phase, |c| c.tangential_force);
        if input.laws.rolling_friction > 0.0 {
            self.rolling_stretches
                .take(list, &mut memory.rolling_springs, phase, |c| {
                    c.rolling_force
                });
        }
    }

    /// Forces of the present candidates, put into `list`, and the motion.
    fn solve_candidates(
        &mut self,
        input: &StageInput<'_>,
        applied: AppliedForces<'_>,
        memory: &ContactMemory,
        update: ActivationUpdate,
        velocities: &mut [f64],
    ) -> Result<Outcome, Error> {
        self.pose(input, memory, update);
        let laws = input.laws;
        let activation = FrictionActivation {
            critical_load: laws.surface.critical_load,
            updates: update == ActivationUpdate::Update && !laws.is_smooth(),
        };
        let (problem, solver) = (&mut self.problem, &mut self.solver);
        let (overlaps, tolerance) = (&mut self.overlaps, applied.relative_tolerance);
        let refine = |problem: &mut Problem, forces: &Forces| {
            refine(input, problem, overlaps, forces, tolerance)
        };
        let outcome = match &mut self.backend {
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
        };
        self.keep_forces(laws);
        self.take_motion(velocities);
        Ok(outcome)
    }
}
