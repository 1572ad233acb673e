//! All forces of a contact problem at once, by guessing what each contact does and mending what the guess contradicts.
//!
//! Once each contact is known to be open, to stick or to slide to either side, the problem is linear. A semismooth Newton method
//! (Alart & Curnier 1991) solves it for the states at hand and mends those that its solution contradicts; started from the last states it
//! mostly needs a few systems. Where it cycles, [`super::path`] finds the solution, or that there is none. What is accepted is measured:
//! [`Merit`] vanishes exactly at a solution.
//!
//! On which contacts friction acts (f > F_crit) is decided anew for every solution until the set agrees with itself, or has been decided
//! often enough: the law jumps there, and such a set need not exist. Where the law does not jump there is nothing to decide.

use super::path::{Begin, PathEnd};
use super::problem::{Forces, Grip, Noise, Problem, States, System};
use super::tableau::Tableau;

/// Systems before another way is tried.
const MOST_SYSTEMS: u32 = 40;
/// Linear systems for the same states: iterations may stop early.
const MOST_CALLS: u32 = 8;
/// Times that it is decided anew on which contacts friction acts.
const DECISIONS: u32 = 10;
/// How exact forces must be for that, over the critical load.
const CLOSE: f64 = 1e-3;
/// Systems without fewer contradictions after which another way is tried.
const PATIENCE: u32 = 10;

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
enum Ended {
    /// No state is contradicted.
    Solved,
    /// A candidate needs a tangential row.
    Admit,
    /// It cycled, or the states had no solution.
    Failed,
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
    /// Whether the set may still change at all, where the law jumps.
    pub(crate) deciding: bool,
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
    /// Forces to begin with, and on which rows friction acted.
    start: Forces,
    acts: Vec<bool>,
    /// Times that the set of contacts with friction may still be decided.
    deciding: u32,
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
        self.deciding = if onset.deciding && !onset.smooth {
            DECISIONS
        } else {
            0
        };
        let (mut ended, mut systems) = self.newton(problem, system, onset, &mut refine);
        let mut jammed = false;
        if ended == Ended::Solved && self.is_unbounded() {
            ended = Ended::Failed;
        }
        if ended == Ended::Failed {
            // States that cycled say nothing about loads.
            for (row, &acts) in problem.tangential.iter_mut().zip(&self.acts) {
                row.acts = acts;
            }
            self.forces.copy_from(&self.start);
            if onset.admits && self.lacks_row(problem, f64::NEG_INFINITY) {
                return Outcome::Admit { systems, all: true };
            }
            // From here on it is decided between paths.
            let decisions = std::mem::take(&mut self.deciding);
            for decision in 0..=decisions {
                let (end, more) = self.find_path(problem, system);
                systems += more;
                jammed = end == PathEnd::Ray;
                if end != PathEnd::Solved {
                    break;
                }
                let more;
                (ended, more) = self.newton(problem, system, onset, &mut refine);
                systems += more;
                if ended == Ended::Failed
                    || decision == decisions
                    || self.decide(problem, onset.critical_load, 0.0) == 0
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

    /// Follows paths, the shortest first, until one leads to the solution or shows that there is none.
    fn find_path(&mut self, problem: &mut Problem, system: &mut impl System) -> (PathEnd, u32) {
        let (mut end, mut systems) = (PathEnd::Lost, 0);
        for begin in [Begin::Here, Begin::Open] {
            let more;
            (end, more) = self.follow_path(problem, system, begin);
            systems += more;
            // The ray of a path that does not begin without forces says nothing.
            let at_end = match end {
                PathEnd::Solved => true,
                PathEnd::Ray => begin == Begin::Open,
                PathEnd::Lost => false,
            };
            if at_end {
                break;
            }
        }
        (end, systems)
    }

    /// Newton steps until no state is contradicted, and how many.
    fn newton(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        onset: Onset,
        refine: &mut impl FnMut(&mut Problem, &Forces) -> usize,
    ) -> (Ended, u32) {
        let (mut fewest, mut patience) = (usize::MAX, PATIENCE);
        let mut last = false;
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
            let mut found = refine(problem, &self.forces) + self.mend(problem, noise);
            if found == 0 && deciding && (noise.exact || noise.force < CLOSE * onset.critical_load)
            {
                // Only now, as forces of states that are contradicted say nothing about loads.
                let changes = self.decide(problem, onset.critical_load, noise.force);
                self.deciding -= u32::from(changes > 0);
                found += changes;
            }
            if found == 0 && noise.exact {
                return (Ended::Solved, count);
            }
            last = found == 0;
            if found > 0 && found < fewest {
                (fewest, patience) = (found, PATIENCE);
            } else if found > 0 {
                patience -= 1;
                if patience == 0 {
                    return (Ended::Failed, count);
                }
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
    fn decide(&mut self, problem: &mut Problem, critical_load: f64, noise: f64) -> usize {
        let mut changes = 0;
        for (m, row) in problem.tangential.iter_mut().enumerate() {
            let excess = self.forces.normal[row.contact] - critical_load;
            let acts = excess > 0.0;
            // What is within the noise of the load stays as it is; open contacts bear exactly nothing.
            if row.acts != acts && (excess.abs() > noise || !self.states.closed[row.contact]) {
                row.acts = acts;
                if self.states.closed[row.contact] {
                    changes += 1;
                    self.states.grip[m] = if acts { Grip::Stick } else { Grip::Off };
                }
            }
        }
        changes
    }

    /// Forces of either sign that the states at hand give; whether there are any, and how many systems they took.
    pub(crate) fn solve_states(
        &mut self,
        problem: &Problem,
        system: &mut impl System,
    ) -> (bool, u32) {
        for count in 1..=MOST_CALLS {
            match system.solve(problem, &self.states, true, &mut self.forces) {
                Some(noise) if noise.exact => return (true, count),
                Some(_) => {}
                None => return (false, count),
            }
        }
        (false, MOST_CALLS)
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
    fn merit(&self, problem: &Problem, system: &impl System) -> Merit {
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

    /// Counts the states that the forces at hand contradict, and changes them, all or some.
    fn mend(&mut self, problem: &Problem, noise: Noise) -> usize {
        let (forces, states) = (&self.forces, &mut self.states);
        let mut found = 0;
        for (k, closed) in states.closed.iter_mut().enumerate() {
            let f = forces.normal[k];
            let wrong = if *closed {
                // What has no bound needs a load to hold on to.
                f < -noise.force || f <= 0.0 && problem.friction.is_infinite()
            } else {
                forces.slack[k] < -noise.velocity
            };
            if wrong {
                found += 1;
                *closed ^= true;
            }
        }
        for (m, row) in problem.tangential.iter().enumerate() {
            let load = forces.normal[row.contact] - problem.offset;
            let (t, grip) = (forces.tangential[m], states.grip[m]);
            let z = forces.slip[m];
            let gripped = row.acts && states.closed[row.contact];
            let limited = problem.friction.is_finite();
            let below_offset = problem.offset > 0.0 && load <= noise.force;
            let next = match grip {
                _ if !gripped => Grip::Off,
                // A contact that has just closed grips; one whose load came over the offset slides as it did.
                Grip::Off if below_offset => Grip::Off,
                Grip::Off if problem.offset > 0.0 && limited => Grip::sliding(z),
                Grip::Off => Grip::Stick,
                _ if problem.offset > 0.0 && load < -noise.force => Grip::Off,
                Grip::Stick if limited && t.abs() > problem.friction * load + noise.force => {
                    Grip::sliding(t)
                }
                Grip::Plus if z < -noise.velocity => Grip::Stick,
                Grip::Minus if z > noise.velocity => Grip::Stick,
                same => same,
            };
            if next != grip {
                found += 1;
                states.grip[m] = next;
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
