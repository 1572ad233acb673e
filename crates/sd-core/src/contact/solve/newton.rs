//! All forces of a contact problem at once, by guessing what each contact does and mending what the guess contradicts.
//!
//! Once each contact is known to be open, to stick or to slide to either side, the problem is linear. A semismooth Newton method
//! (Alart & Curnier 1991) solves it for the states at hand and mends those that its solution contradicts; started from the last states it
//! mostly needs a few systems. Where it cycles, [`super::path`] finds the solution, or that there is none. What is accepted is measured:
//! [`Merit`] vanishes exactly at a solution.
//!
//! On which contacts friction acts (f > F_crit) is decided anew for every solution until the set agrees with itself. The law jumps there,
//! and such a set need not exist: a load can be above F_crit without friction and below it with friction, which then stays. Where the law
//! does not jump there is nothing to decide. In large layers, whose linear systems are dear, it is decided from the first systems on.

use super::cone::Cones;
use super::path::Effort;
use super::problem::{Forces, Grip, Noise, Problem, States, System};
use super::tableau::Tableau;

/// Systems before another way is tried.
const MOST_SYSTEMS: u32 = 100;
/// Systems for the same states, none of them exact, after which another way is tried where friction is steep: their forces grow without bound.
const MOST_REPEATS: u32 = 8;
/// Times that it is decided anew on which contacts friction acts.
const DECISIONS: u32 = 10;
/// The same from systems whose forces still contradict the states, where systems are dear.
const EARLY_DECISIONS: u32 = 6;
/// The same between paths, each of which takes long.
const DECISIONS_BETWEEN_PATHS: u32 = 1;
/// How exact forces must be for that, over the critical load.
const CLOSE: f64 = 1e-3;
/// Systems without fewer contradictions after which another way is tried; and the same where those are quick and mostly needed: for contacts
/// that do not give way, in layers that are not too large.
pub(super) const PATIENCE: u32 = 10;
const LITTLE_PATIENCE: u32 = 3;
/// Systems without fewer contradictions after which contacts change one by one, and contradictions at most for that: contacts that change
/// at once can go back and forth (Júdice & Pires, Comput. Oper. Res. 21, 1994).
const TOGETHER: u32 = 2;
const FEW: usize = 40;

/// How well forces solve a problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Merit {
    /// `max |min(G f, w)|` and `max |G (t − clamp(t + z/G, −ρ, ρ))|`, G the mobility of the contact; whichever is larger, in a·rate.
    pub(crate) residual: f64,
    /// `max |t − clamp(t + z/G, −ρ, ρ)|` over the largest normal force.
    pub(crate) friction_error: f64,
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// The forces at hand are the best found.
    Solved {
        /// How well.
        merit: Merit,
        /// Whether there is no solution: the forces at hand are those of contacts that give way a little.
        jammed: bool,
        /// Linear systems solved.
        systems: u32,
    },
    /// Candidates without a tangential row have come above the critical load, and need one.
    Admit {
        /// Linear systems solved.
        systems: u32,
        /// Whether all candidates had better have one: the problem is hard.
        all: bool,
    },
}

/// How a row of Newton steps ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ended {
    /// No state is contradicted.
    Solved,
    /// A candidate needs a tangential row.
    Admit,
    /// It cycled, or the states had no solution.
    Failed,
}

/// How far Newton's method has come.
struct Progress {
    /// Fewest contradictions so far.
    fewest: usize,
    /// Fewest since contacts change one by one, where they do.
    alone: Option<usize>,
    /// Systems since there were fewer.
    stalled: u32,
}

impl Progress {
    const NEW: Self = Self {
        fewest: usize::MAX,
        alone: None,
        stalled: 0,
    };

    /// Counts a system with that many contradictions; whether another is worth while.
    fn goes_on(&mut self, found: usize, patience: u32) -> bool {
        let one_by_one = self.alone.is_some();
        if one_by_one && found > FEW {
            return false;
        }
        self.stalled += 1;
        if found < self.fewest {
            *self = Self {
                fewest: found,
                ..Self::NEW
            };
        } else if self.alone.is_some_and(|fewest| found < fewest)
            || !one_by_one && self.stalled >= TOGETHER && found <= FEW
        {
            (self.alone, self.stalled) = (Some(found), 0);
        }
        self.stalled < patience
    }
}

/// When friction begins to act.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Onset {
    /// Load above which friction acts.
    pub(crate) critical_load: f64,
    /// Whether it acts on every row, and the bound says how much: where the law does not jump.
    pub(crate) smooth: bool,
    /// Whether contacts without a tangential row get one once they are loaded.
    pub(crate) admits: bool,
    /// When that is decided, where the law jumps.
    pub(crate) deciding: Deciding,
}

/// From which solutions it is decided on which contacts friction acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Deciding {
    /// From none: it stays as it is.
    Held,
    /// From those whose states and forces agree.
    Late,
    /// From unfinished ones too: where linear systems are dear.
    Early,
    /// The same, in a problem solved again with more candidates: friction acts at first where it did.
    Again,
}

impl Deciding {
    /// Whether from unfinished solutions too.
    fn is_early(self) -> bool {
        matches!(self, Self::Early | Self::Again)
    }
}

/// States, forces and workspace.
#[derive(Debug, Default)]
pub(crate) struct BoxSolver {
    /// What each contact does.
    pub(crate) states: States,
    /// Forces at hand.
    pub(crate) forces: Forces,
    /// Where a path has come to: forces, slack and slip of a problem on the way.
    pub(super) point: Forces,
    /// The problem in the form of the states of a path.
    pub(super) tableau: Tableau,
    /// What tells a jammed layer where paths end nowhere; made when it is first asked.
    pub(super) cones: Option<Box<Cones>>,
    /// How much is done for a solution.
    pub(crate) effort: Effort,
    /// Forces to begin with, and on which rows friction acted.
    start: Forces,
    acts: Vec<bool>,
    /// Times that the set of contacts with friction may still be decided.
    deciding: u32,
    /// Times that it may be before states and forces agree.
    early: u32,
}

impl BoxSolver {
    /// Room for that many candidates; with `paths`, for paths among them too.
    pub(crate) fn reserve(&mut self, candidates: usize, paths: bool) {
        if paths {
            self.tableau.reserve(2 * candidates);
        }
        self.states.closed.reserve(candidates);
        self.states.grip.reserve(2 * candidates);
        self.acts.reserve(2 * candidates);
        for forces in [&mut self.forces, &mut self.point, &mut self.start] {
            forces.normal.reserve(candidates);
            forces.slack.reserve(candidates);
            forces.tangential.reserve(2 * candidates);
            forces.slip.reserve(2 * candidates);
        }
    }

    /// Takes up the problem with more candidates: where friction is steep, with the usual effort again.
    pub(crate) fn relax(&mut self, problem: &Problem) {
        if problem.is_steep() {
            self.effort = Effort::Usual;
        }
    }

    /// Solves from the states and forces at hand, which are then those of the solution or of the best found.
    ///
    /// `refine`: called after every system with problem and forces, for entries that depend on the solution; how many changed.
    pub(crate) fn solve(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        onset: Onset,
        mut refine: impl FnMut(&mut Problem, &Forces) -> usize,
    ) -> Outcome {
        self.start.copy_from(&self.forces);
        self.tableau.clear();
        self.acts.clear();
        self.acts
            .extend(problem.tangential.iter().map(|row| row.acts));
        self.deciding = if onset.deciding != Deciding::Held && !onset.smooth {
            DECISIONS
        } else {
            0
        };
        self.early = if onset.deciding.is_early() {
            EARLY_DECISIONS
        } else {
            0
        };
        let patience = if problem.can_jam() && system.has_matrix(problem) {
            LITTLE_PATIENCE
        } else {
            PATIENCE
        };
        let (mut ended, mut systems) = match self.effort {
            Effort::Usual => self.newton(problem, system, onset, patience, &mut refine),
            Effort::Last => (Ended::Failed, 0),
        };
        let mut jammed = false;
        if ended == Ended::Solved && self.is_unbounded() {
            ended = Ended::Failed;
        }
        if ended == Ended::Failed {
            // States that cycled say nothing about loads.
            for (row, &acts) in problem.tangential.iter_mut().zip(&self.acts) {
                row.acts = acts;
                row.ceased = false;
            }
            self.forces.copy_from(&self.start);
            if onset.admits && self.lacks_row(problem, f64::NEG_INFINITY) {
                return Outcome::Admit { systems, all: true };
            }
            // From here on it is decided between paths.
            let decisions = std::mem::take(&mut self.deciding).min(DECISIONS_BETWEEN_PATHS);
            for decision in 0..=decisions {
                let more;
                (ended, jammed, more) = self.find_out(problem, system, onset, &mut refine);
                systems += more;
                if ended != Ended::Solved
                    || decision == decisions
                    || self.decide(problem, system, onset, 0.0) == 0
                {
                    break;
                }
            }
        }
        if ended == Ended::Admit {
            return Outcome::Admit {
                systems,
                all: false,
            };
        }
        if ended == Ended::Solved {
            self.clip(problem);
        }
        Outcome::Solved {
            merit: self.merit(problem, system),
            jammed,
            systems,
        }
    }

    /// Newton steps until no state is contradicted, and how many; given up after `patience` of them without fewer contradictions.
    pub(super) fn newton(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        onset: Onset,
        patience: u32,
        refine: &mut impl FnMut(&mut Problem, &Forces) -> usize,
    ) -> (Ended, u32) {
        let mut progress = Progress::NEW;
        let (mut last, mut repeats) = (false, 0);
        for count in 1..=MOST_SYSTEMS {
            let Some(noise) = system.solve(problem, &self.states, last, &mut self.forces) else {
                return (Ended::Failed, count);
            };
            let deciding = self.deciding > 0;
            if (deciding || onset.smooth)
                && onset.admits
                && self.lacks_row(problem, onset.critical_load)
            {
                return (Ended::Admit, count);
            }
            let refined = refine(problem, &self.forces);
            let alone = progress.alone.is_some();
            let mut found = refined + self.mend(problem, noise, alone);
            if found > 0 && self.early > 0 && deciding && !alone {
                let changes = self.decide(problem, system, onset, noise.force);
                self.early -= u32::from(changes > 0);
                found += changes;
            }
            last = found == 0;
            if last && deciding && (noise.exact || noise.force < CLOSE * onset.critical_load) {
                // The last word, as forces of states that are contradicted say little about loads.
                if self.decide(problem, system, onset, noise.force) > 0 {
                    self.deciding -= 1;
                    // That is another problem.
                    progress = Progress::NEW;
                    last = false;
                    continue;
                }
            }
            if last && noise.exact {
                return (Ended::Solved, count);
            }
            repeats = if last { repeats + 1 } else { 0 };
            let in_vain = repeats == MOST_REPEATS && problem.is_steep();
            if in_vain || !last && !progress.goes_on(found, patience) {
                return (Ended::Failed, count);
            }
        }
        (Ended::Failed, MOST_SYSTEMS)
    }

    /// Whether a candidate above the critical load has no tangential row.
    fn lacks_row(&self, problem: &Problem, critical_load: f64) -> bool {
        let mut rows = problem.tangential.iter().peekable();
        self.forces.normal.iter().enumerate().any(|(k, &f)| {
            let mut has_row = false;
            while rows.next_if(|row| row.contact == k).is_some() {
                has_row = true;
            }
            f > critical_load && !has_row
        })
    }

    /// Lets friction act where the load is above the critical one, by more than `noise`; the number of changes.
    ///
    /// A contact on which it begins to act sticks, or slides at once where systems are dear and its own mobility says that it will.
    fn decide(
        &mut self,
        problem: &mut Problem,
        system: &impl System,
        onset: Onset,
        noise: f64,
    ) -> usize {
        let mut changes = 0;
        let guesses = onset.deciding.is_early() && problem.friction.is_finite();
        for (m, row) in problem.tangential.iter_mut().enumerate() {
            let load = self.forces.normal[row.contact];
            let excess = load - onset.critical_load;
            let acts = excess > 0.0;
            let closed = self.states.closed[row.contact];
            if closed && row.ceased && !acts {
                continue;
            }
            // What is within the noise of the load stays as it is; open contacts bear exactly nothing.
            if row.acts != acts && (excess.abs() > noise || !closed) {
                row.acts = acts;
                if closed {
                    row.ceased |= !acts;
                    changes += 1;
                    let slip = self.forces.slip[m];
                    let halted = (system.mobility(row.contact) + row.compliance)
                        * problem.friction
                        * (load - problem.offset);
                    self.states.grip[m] = match acts {
                        false => Grip::Off,
                        true if guesses && slip.abs() > halted => Grip::sliding(slip),
                        true => Grip::Stick,
                    };
                }
            }
        }
        changes
    }

    /// Brings forces that are out of their bounds back.
    pub(super) fn clip(&mut self, problem: &Problem) {
        for f in &mut self.forces.normal {
            *f = f.max(0.0);
        }
        for (t, row) in self.forces.tangential.iter_mut().zip(&problem.tangential) {
            let bound = problem.bound(row, &self.forces.normal);
            *t = t.clamp(-bound, bound);
        }
    }

    /// Merit of the forces at hand, whose slack and slip are known.
    pub(super) fn merit(&self, problem: &Problem, system: &impl System) -> Merit {
        let (mut residual, mut error, mut most) = (0.0_f64, 0.0_f64, f64::MIN_POSITIVE);
        let mut count = |violation: f64| {
            residual = if violation.is_nan() {
                f64::INFINITY
            } else {
                residual.max(violation)
            };
        };
        for (k, &f) in self.forces.normal.iter().enumerate() {
            count((system.mobility(k) * f).min(self.forces.slack[k]).abs());
            most = most.max(f);
        }
        for (m, row) in problem.tangential.iter().enumerate() {
            let (t, z) = (self.forces.tangential[m], self.forces.slip[m]);
            let bound = problem.bound(row, &self.forces.normal);
            let own = system.mobility(row.contact) + row.compliance;
            let off = (t - (t + z / own).clamp(-bound, bound)).abs();
            count(own * off);
            error = error.max(off);
        }
        Merit {
            residual,
            friction_error: error / most,
        }
    }

    /// Counts the states that the forces at hand contradict, and changes them: all, or those of the first contact alone.
    fn mend(&mut self, problem: &Problem, noise: Noise, alone: bool) -> usize {
        let (forces, states) = (&self.forces, &mut self.states);
        let mut rows = problem.tangential.iter().enumerate().peekable();
        let mut found = 0;
        for (k, closed) in states.closed.iter_mut().enumerate() {
            let f = forces.normal[k];
            let changes = !alone || found == 0;
            let wrong = if *closed {
                // What has no bound needs a load to hold on to.
                f < -noise.force || f <= 0.0 && problem.friction.is_infinite()
            } else {
                forces.slack[k] < -noise.velocity
            };
            found += usize::from(wrong);
            let closes = *closed ^ wrong;
            while let Some((m, row)) = rows.next_if(|(_, row)| row.contact == k) {
                let grip = &mut states.grip[m];
                let next = if row.acts && closes {
                    next_grip(problem, forces, m, *grip, alone, noise)
                } else {
                    Grip::Off
                };
                found += usize::from(next != *grip);
                if changes {
                    *grip = next;
                }
            }
            if changes {
                *closed = closes;
            }
        }
        found
    }

    /// States that the forces at hand show.
    pub(crate) fn read_states(&mut self, problem: &Problem) {
        let (forces, states) = (&self.forces, &mut self.states);
        states.closed.clear();
        states.closed.extend(forces.normal.iter().map(|&f| f > 0.0));
        states.grip.clear();
        for (&t, row) in forces.tangential.iter().zip(&problem.tangential) {
            let bound = problem.bound(row, &forces.normal);
            states.grip.push(if bound == 0.0 {
                Grip::Off
            } else if t.abs() < bound * (1.0 - 1e-12) {
                Grip::Stick
            } else {
                Grip::sliding(t)
            });
        }
    }
}

/// What row `m`, of a closed candidate on which friction acts, does next, by the forces that its present state gives; `alone`: where contacts
/// change one by one.
fn next_grip(
    problem: &Problem,
    forces: &Forces,
    m: usize,
    grip: Grip,
    alone: bool,
    noise: Noise,
) -> Grip {
    let load = forces.normal[problem.tangential[m].contact] - problem.offset;
    let (t, z) = (forces.tangential[m], forces.slip[m]);
    let limited = problem.friction.is_finite();
    let below_offset = problem.offset > 0.0 && load <= noise.force;
    match grip {
        // A contact that has just closed grips; one whose load came over the offset slides as it did.
        Grip::Off if below_offset => Grip::Off,
        Grip::Off if limited && (alone || problem.offset > 0.0) => Grip::sliding(z),
        Grip::Off => Grip::Stick,
        _ if problem.offset > 0.0 && load < -noise.force => Grip::Off,
        Grip::Stick if limited && t.abs() > problem.friction * load + noise.force => {
            Grip::sliding(t)
        }
        Grip::Plus if z < -noise.velocity => Grip::Stick,
        Grip::Minus if z > noise.velocity => Grip::Stick,
        same => same,
    }
}
