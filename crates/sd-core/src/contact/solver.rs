//! The contact problem of one stage: which pairs take part, what their laws ask for, and the forces that answer.

mod candidates;
mod entries;
mod protocol;

use self::candidates::parting_velocity;
use self::entries::refine;
use super::laws::{Laws, Overlap, Span};
use super::pair::Contact;
use super::solve::dense::DenseSystem;
use super::solve::newton::{BoxSolver, Deciding, Onset, Outcome};
use super::solve::path::Effort;
use super::solve::problem::{Forces, Problem, System};
use super::solve::sparse::{OnNetwork, SparseSystem, has_products};
use super::springs::Stretches;
use super::warm_start::{SpringForces, WarmStart};
use super::{Quality, most_contacts};
use crate::error::Error;
use crate::geometry::modes::Background;
use crate::hydrodynamics::resistance::Resistance;

pub use super::solve::problem::Driving;

/// Rounds of adding pairs that turned out to close after all.
const MOST_ROUNDS: u32 = 20;

/// What a contact problem is posed in.
#[derive(Clone, Copy)]
pub struct Posed<'a> {
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
}

impl ContactMemory {
    /// Becomes equal to the other, without allocating once there is room.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.warm_start.copy_from(&other.warm_start);
        self.springs.0.clone_from(&other.springs.0);
    }

    /// Room for that many contacts.
    pub(crate) fn reserve(&mut self, contacts: usize) {
        self.warm_start.forces.reserve(contacts);
        self.springs.0.reserve(contacts);
    }
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
    pub(super) solver: BoxSolver,
    /// Linear algebra.
    pub(super) backend: Backend,
    /// Tangential springs within a step.
    stretches: Stretches,
    /// Whether linear systems are dear and candidates cost nearly nothing: in layers held pair by pair whose far field is not iterated.
    has_dear_systems: bool,
    /// What was known before the stage, and whether the stage is solved anew from there, since at first it seemed jammed.
    known_before: WarmStart,
    is_anew: bool,
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
            solver: BoxSolver::default(),
            backend,
            stretches: Stretches::default(),
            has_dear_systems: resistance.pairwise().is_some() && !resistance.is_iterated_on(),
            known_before: WarmStart::default(),
            is_anew: false,
        };
        solver.problem.normal.reserve(most);
        solver.problem.tangential.reserve(2 * most);
        let dense = matches!(solver.backend, Backend::Dense(_));
        solver.solver.reserve(most, dense);
        solver.stretches.reserve(most);
        solver.known_before.forces.reserve(most);
        solver
    }

    /// Whether linear systems are saved, by candidates and decisions that may turn out not to be needed.
    fn saves_systems(&self) -> bool {
        self.has_dear_systems && !self.is_anew
    }

    /// Begins a step: what is known of the motion from stages before is forgotten.
    pub fn begin_step(&mut self) {
        if let Backend::Sparse(system) = &mut self.backend {
            system.forget();
        }
    }

    /// Solves one stage. `velocities`: disturbances `[3N]` that come out.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub fn solve(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &mut ContactMemory,
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        self.begin(posed, memory);
        self.solve_begun(posed, driving, memory, true, velocities)
    }

    /// Solves the stage that was solved last once more, under laws with other numbers: friction acts where it did then.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn solve_held(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &mut ContactMemory,
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        self.solve_begun(posed, driving, memory, false, velocities)
    }

    /// Solves the stage whose candidates are chosen, and keeps its springs. `deciding`: as in [`ContactSolver::evaluate`].
    fn solve_begun(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &mut ContactMemory,
        deciding: bool,
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        let (quality, _) = self.evaluate(posed, driving, memory, deciding, velocities)?;
        self.keep_springs(posed, &mut memory.springs);
        Ok(quality)
    }

    /// Whether friction would act on the same contacts above another critical load.
    pub(crate) fn acts_alike(&self, load: f64) -> bool {
        self.list
            .iter()
            .all(|contact| contact.friction_acts == (contact.normal_force > load))
    }

    /// Brings the forces of tangential springs into another unit.
    pub(crate) fn rescale_springs(&mut self, springs: &mut SpringForces, factor: f64) {
        springs.rescale(factor);
        self.stretches.rescale(factor);
    }

    /// Takes the positions of a stage, and its first candidates.
    pub(crate) fn begin(&mut self, posed: &Posed<'_>, memory: &ContactMemory) {
        if let Backend::Sparse(system) = &mut self.backend {
            system.start();
        }
        self.known_before.copy_from(&memory.warm_start);
        self.choose(posed, &memory.warm_start);
    }

    /// Solves the problem of the stage once, from the forces of the last time: under other driving forces than before, if need be.
    ///
    /// What saves linear systems lets friction act on more contacts than it has to, and a layer can be jammed by that alone where friction
    /// answers the motion. A stage that seems jammed is therefore solved anew without, as in small layers, before it counts as such.
    ///
    /// `deciding`: whether it may still change on which contacts friction acts. Returns with the quality whether it did.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn evaluate(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &mut ContactMemory,
        deciding: bool,
        velocities: &mut [f64],
    ) -> Result<(Quality, bool), Error> {
        let first = self.solve_rounds(posed, driving, memory, deciding, velocities)?;
        let is_solved = first.0.converged() && !first.0.jammed;
        if is_solved || !deciding || !self.may_jam_by_haste(posed) {
            return Ok(first);
        }
        self.is_anew = true;
        memory.warm_start.copy_from(&self.known_before);
        self.choose(posed, &memory.warm_start);
        let anew = self.solve_rounds(posed, driving, memory, deciding, velocities);
        self.is_anew = false;
        let (mut quality, changed) = anew?;
        // Where no solution was found this time either, the first verdict stands.
        quality.jammed |= first.0.jammed && !quality.converged();
        quality.systems += first.0.systems;
        Ok((quality, changed))
    }

    /// Solves the problem of the stage with ever more candidates, until none of the others closes.
    fn solve_rounds(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &mut ContactMemory,
        deciding: bool,
        velocities: &mut [f64],
    ) -> Result<(Quality, bool), Error> {
        let mut quality = Quality::default();
        let mut changed = false;
        self.solver.effort = Effort::Usual;
        for round in 0..MOST_ROUNDS {
            let deciding = match deciding {
                false => Deciding::Held,
                true if !self.saves_systems() => Deciding::Late,
                true if round == 0 => Deciding::Early,
                true => Deciding::Again,
            };
            let (found, decided) =
                self.solve_candidates(posed, driving, memory, deciding, velocities)?;
            changed |= decided;
            quality = Quality {
                systems: quality.systems + found.systems,
                ..found
            };
            if quality.jammed && deciding != Deciding::Held && self.may_jam_by_haste(posed) {
                return Ok((quality, changed));
            }
            if self.add_closing(posed, velocities, &mut memory.warm_start, quality.jammed) {
                changed = true;
                self.solver.relax(&self.problem);
            } else if quality.converged() || driving.enough > 0.0 || !self.try_harder(posed) {
                return Ok((quality, changed));
            }
        }
        // By how much pairs still close counts as a violation.
        let closing = self.list.iter().filter(|c| c.normal_force == 0.0);
        let closing = closing.map(|c| parting_velocity(posed, c) - c.normal_velocity);
        quality.residual = closing.fold(quality.residual, f64::max);
        Ok((quality, changed))
    }

    /// Whether the problem at hand has a matrix, in which paths are followed.
    fn has_paths(&self, posed: &Posed<'_>) -> bool {
        let network = posed.resistance.pairwise();
        network.is_none_or(|network| has_products(network, &self.problem))
    }

    /// Whether the problem at hand could seem jammed only because linear systems are saved.
    fn may_jam_by_haste(&self, posed: &Posed<'_>) -> bool {
        self.saves_systems() && self.problem.can_jam() && self.has_paths(posed)
    }

    /// Whether there is more to try for the problem at hand, which is then tried from now on.
    fn try_harder(&mut self, posed: &Posed<'_>) -> bool {
        let harder = self.has_paths(posed) && self.solver.effort == Effort::Usual && !self.is_anew;
        if harder {
            self.solver.effort = Effort::Last;
        }
        harder
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
        self.problem.isolated = false;
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
                    OnNetwork::begin(resistance, system, problem, Driving::by(forces))?;
                solver.forces.clear();
                on_network.measure(problem, &mut solver.forces);
                velocities.copy_from_slice(system.velocities()[0]);
            }
        }
        Ok(())
    }

    /// The motion `[3N]` that normal forces alone leave, where the law reads it.
    pub(crate) fn isolated_motion(&self, posed: &Posed<'_>) -> Option<&[f64]> {
        match (&self.backend, posed.laws.reads_isolated_motion()) {
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
    pub(crate) fn keep_springs(&mut self, posed: &Posed<'_>, springs: &mut SpringForces) {
        if posed.laws.tangential.has_spring() {
            self.stretches.take(&self.list, springs, posed.span.phase);
        }
    }

    /// Forces of the candidates at hand, put into `list`, and the motion.
    fn solve_candidates(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &ContactMemory,
        deciding: Deciding,
        velocities: &mut [f64],
    ) -> Result<(Quality, bool), Error> {
        self.pose(posed);
        let (laws, resistance) = (posed.laws, posed.resistance);
        let friction = laws.surface.has_friction();
        let load = laws.surface.critical_load;
        // Rows cost a dense system much: the solution says who needs one.
        let admits = matches!(self.backend, Backend::Dense(_)) || self.is_anew;
        let onset = Onset {
            critical_load: load,
            smooth: laws.is_smooth(),
            admits: friction && admits,
            deciding,
        };
        if friction {
            let loaded = self.list.iter().filter(|c| c.normal_force > load).count();
            // The few others cost less now than later.
            let all = !admits || 10 * loaded >= 9 * self.list.len();
            self.add_rows(posed, memory, deciding, |_, contact| {
                all || contact.normal_force > load
                    || contact.friction_acts && deciding == Deciding::Held
            });
        }
        let solver = &mut self.solver;
        solver.forces.normal.clear();
        solver
            .forces
            .normal
            .extend(self.list.iter().map(|contact| contact.normal_force));
        self.take_rows();
        let mut systems = 0;
        let mut begun = false;
        loop {
            let (problem, solver) = (&mut self.problem, &mut self.solver);
            let overlaps = &mut self.overlaps;
            let refine = |problem: &mut Problem, forces: &Forces| {
                refine(posed, problem, overlaps, forces, driving.enough)
            };
            let outcome = match &mut self.backend {
                Backend::Dense(system) => {
                    if begun {
                        system.begin_rows(resistance, problem);
                    } else {
                        system.begin(resistance, problem, driving.all);
                    }
                    solver.solve(problem, &mut **system, onset, refine)
                }
                Backend::Sparse(system) => {
                    let mut on_network = OnNetwork::begin(resistance, system, problem, driving)?;
                    solver.solve(problem, &mut on_network, onset, refine)
                }
            };
            begun = true;
            match outcome {
                Outcome::Admit { systems: more, all } => {
                    systems += more;
                    self.keep_forces();
                    let normal = std::mem::take(&mut self.solver.forces.normal);
                    self.add_rows(posed, memory, deciding, |k, contact| {
                        all || normal[k] > load || contact.slip_resistance > 0.0
                    });
                    self.solver.forces.normal = normal;
                    self.take_rows();
                }
                Outcome::Solved {
                    merit,
                    jammed,
                    systems: more,
                } => {
                    self.keep_forces();
                    match &mut self.backend {
                        Backend::Dense(system) => {
                            system.finish(resistance, &self.solver.forces, velocities);
                        }
                        Backend::Sparse(system) => {
                            velocities.copy_from_slice(system.velocities()[0]);
                        }
                    }
                    self.take_motion(velocities);
                    let quality = Quality {
                        residual: merit.residual,
                        friction_error: merit.friction_error,
                        jammed,
                        systems: systems + more,
                    };
                    return Ok((quality, self.keep_activity() && !onset.smooth));
                }
            }
        }
    }
}
