//! All forces of a contact problem at once, by guessing what each contact does and mending what the guess contradicts.
//!
//! Once each contact is known to be open, to stick or to slide to either side, the problem is linear. A semismooth Newton method
//! (Alart & Curnier 1991) solves it for the states at hand and mends those that its solution contradicts; started from the last states it
//! mostly needs one or two systems. Where it cycles, some contradictions are mended by chance, which ends most cycles. Where that fails too,
//! all contacts get compliance, which makes the problem an easy one, and lose it again step by step. What is accepted is measured: [`Merit`]
//! vanishes exactly at a solution.
//!
//! Coulomb's problem need not have a solution: it is not the gradient of anything. There are then forces within the bounds that balance on
//! every sphere and that the flow works against: as compliance falls they grow like its inverse, while contacts give way at a velocity that
//! does not fall. The way ends, and the layer is jammed at that instant.
//!
//! On which contacts friction acts (f > F_crit) is decided anew for every solution until the set agrees with itself, or has been decided
//! often enough: the law jumps there, and such a set need not exist. Where the law does not jump it is decided along with the states.

use super::problem::{Forces, Grip, Noise, Problem, States, System, largest};
use crate::contact::Quality;
use crate::contact::laws::COMPLIANCE;

/// Systems before other ways are tried.
const FIRST_SYSTEMS: u32 = 40;
/// Systems of a problem on the way to the one asked for.
const PATH_SYSTEMS: u32 = 20;
/// Times that it is decided anew on which contacts friction acts.
const DECISIONS: u32 = 10;
/// How exact forces must be for that, over the critical load.
const CLOSE: f64 = 1e-3;
/// Systems without fewer contradictions after which only some are mended at a time, chosen by chance.
const PATIENCE: u32 = 3;
/// Problems on the way, after which the stiffest that was solved has to do.
const MOST_PROBLEMS: u32 = 60;
/// Compliance of the first problem on the way, over the largest mobility of a contact.
const FIRST_COMPLIANCE: f64 = 3.0;
/// What compliance is divided by: at first, at most, and at least before the way counts as ended.
const FIRST_RATIO: f64 = 10.0;
const MOST_RATIO: f64 = 100.0;
const LEAST_RATIO: f64 = 1.1;
/// Compliance after which comes none, in a/(mu·a²·rate).
const LAST_COMPLIANCE: f64 = 1e-11;
/// Power of the inverse of the compliance with which forces grow at least where there is no solution.
const INVERSE: f64 = 0.7;
/// Velocity at which contacts give way under compliance, in a·rate, above which the end of the way means that the layer is jammed.
const JAMMED_APPROACH: f64 = 1e-3;

/// Residual above which a problem counts as unsolved, in a·rate.
const UNSOLVED: f64 = Quality::RESIDUAL_LIMIT;

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
    },
}

/// Which contradictions are mended: all, or where that goes in circles some at random.
struct Pace {
    /// Fewest contradictions so far.
    fewest: usize,
    /// Systems without fewer ones that are still waited for.
    patience: u32,
    /// State of a generator whose numbers are the same on every machine, once chance decides.
    chance: Option<u64>,
}

impl Pace {
    /// Begins with all.
    fn new() -> Self {
        Self {
            fewest: usize::MAX,
            patience: PATIENCE,
            chance: None,
        }
    }

    /// Whether the next contradiction is mended: even chances, once chance decides.
    fn draw(&mut self) -> bool {
        self.chance.as_mut().is_none_or(|state| {
            // Knuth's MMIX generator; its high bits are the good ones.
            *state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            *state >> 63 == 1
        })
    }

    /// After a system with so many contradictions.
    fn after(&mut self, system: u32, contradictions: usize) {
        if contradictions < self.fewest {
            *self = Self {
                fewest: contradictions,
                ..Self::new()
            };
        } else {
            self.patience = self.patience.saturating_sub(1);
            if self.patience == 0 && self.chance.is_none() {
                self.chance = Some(u64::from(system));
            }
        }
    }
}

/// How the largest force grows as compliance falls.
#[derive(Debug, Default)]
struct Growth {
    /// Compliance and force of the last problem, and of the last one with at least twice its compliance.
    last: Option<[f64; 2]>,
    before: Option<[f64; 2]>,
}

impl Growth {
    /// Takes a problem that was solved.
    fn add(&mut self, compliance: f64, force: f64) {
        let far = |old: &[f64; 2]| old[0] > 2.0 * compliance;
        self.before = self.last.filter(far).or(self.before.filter(far));
        self.last = Some([compliance, force]);
    }

    /// Whether it grows like the inverse of the compliance, or nearly.
    fn is_inverse(&self) -> bool {
        let (Some(last), Some(before)) = (self.last, self.before) else {
            return false;
        };
        (last[1] / before[1]).ln() > INVERSE * (before[0] / last[0]).ln()
    }
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
    /// Whether the set of contacts on which it acts follows the loads to the end: where the law does not jump there.
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
    /// Forces of the last problem solved, and whether friction acted on each row.
    best: Forces,
    acts: Vec<bool>,
    /// Compliance of all contacts and rows, besides their own.
    compliance: f64,
    /// Times that the set of contacts with friction may still be decided.
    deciding: u32,
}

impl BoxSolver {
    /// Room for that many candidates.
    pub(crate) fn reserve(&mut self, candidates: usize) {
        self.states.closed.reserve(candidates);
        self.states.grip.reserve(2 * candidates);
        self.acts.reserve(2 * candidates);
        for forces in [&mut self.forces, &mut self.best] {
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
        self.deciding = if onset.deciding { DECISIONS } else { 0 };
        self.compliance = 0.0;
        let (mut ended, mut systems) =
            self.newton(problem, system, onset, &mut refine, FIRST_SYSTEMS);
        if ended == Ended::Failed {
            // Once more from no forces at all.
            self.forces.normal.fill(0.0);
            self.forces.tangential.fill(0.0);
            self.read_states(problem);
            self.deciding = if onset.deciding { DECISIONS } else { 0 };
            let more;
            (ended, more) = self.newton(problem, system, onset, &mut refine, FIRST_SYSTEMS);
            systems += more;
        }
        match ended {
            Ended::Admit => Outcome::Admit { systems },
            Ended::Solved => {
                self.clip(problem);
                let merit = self.merit(problem, system);
                Outcome::Solved {
                    merit,
                    jammed: self.is_jammed(merit, 0.0),
                    systems,
                }
            }
            Ended::Failed => match self.stiffen(problem, system, onset, &mut refine) {
                Outcome::Admit { systems: more } => Outcome::Admit {
                    systems: systems + more,
                },
                Outcome::Solved {
                    merit,
                    jammed,
                    systems: more,
                } => Outcome::Solved {
                    merit,
                    jammed,
                    systems: systems + more,
                },
            },
        }
    }

    /// Newton steps until no state is contradicted, and how many.
    fn newton(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        onset: Onset,
        refine: &mut impl FnMut(&mut Problem, &Forces) -> usize,
        most: u32,
    ) -> (Ended, u32) {
        let mut pace = Pace::new();
        let mut last = false;
        for count in 1..=most {
            let (states, compliance) = (&self.states, self.compliance);
            let Some(noise) = system.solve(problem, states, compliance, last, &mut self.forces)
            else {
                return (Ended::Failed, count);
            };
            let deciding = self.deciding > 0 || onset.smooth;
            if deciding && onset.admits && self.lacks_row(problem, onset.critical_load) {
                return (Ended::Admit, count);
            }
            let mut found = refine(problem, &self.forces) + self.mend(problem, noise, &mut pace);
            if onset.smooth {
                found += self.decide(problem, onset.critical_load, noise.force);
            } else if found == 0
                && deciding
                && (noise.exact || noise.force < CLOSE * onset.critical_load)
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
            if found > 0 {
                pace.after(count, found);
            }
        }
        (Ended::Failed, most)
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
        for row in &mut problem.tangential {
            let excess = self.forces.normal[row.contact] - critical_load;
            let acts = excess > 0.0;
            // What is within the noise of the load stays as it is; open contacts bear exactly nothing.
            if row.acts != acts && (excess.abs() > noise || !self.states.closed[row.contact]) {
                changes += usize::from(self.states.closed[row.contact]);
                row.acts = acts;
            }
        }
        changes
    }

    /// Forces of either sign that the states at hand give; whether there are any.
    pub(crate) fn solve_states(&mut self, problem: &Problem, system: &mut impl System) -> bool {
        self.compliance = 0.0;
        for _ in 0..FIRST_SYSTEMS {
            match system.solve(
                problem,
                &self.states,
                self.compliance,
                true,
                &mut self.forces,
            ) {
                Some(noise) if noise.exact => return true,
                Some(_) => {}
                None => return false,
            }
        }
        false
    }

    /// Follows the solution from an easy problem, with compliance, as far towards the problem itself as it goes.
    fn stiffen(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        onset: Onset,
        refine: &mut impl FnMut(&mut Problem, &Forces) -> usize,
    ) -> Outcome {
        let mobility = (0..problem.normal.len()).map(|k| system.mobility(k));
        let mut compliance = FIRST_COMPLIANCE * mobility.fold(0.0, f64::max);
        let (mut solved, mut ratio, mut systems) = (None, FIRST_RATIO, 0);
        let mut growth = Growth::default();
        self.keep(problem);
        for _ in 0..MOST_PROBLEMS {
            self.compliance = compliance;
            // Loads on the way say nothing about where friction acts.
            self.deciding = 0;
            let (ended, more) = self.newton(problem, system, onset, refine, PATH_SYSTEMS);
            systems += more;
            if ended == Ended::Admit {
                self.compliance = 0.0;
                return Outcome::Admit { systems };
            }
            if ended == Ended::Solved {
                self.clip(problem);
                self.keep(problem);
                solved = Some(compliance);
                growth.add(compliance, largest(&self.forces.normal));
                if compliance == 0.0 {
                    break;
                }
                ratio = (ratio * ratio).min(MOST_RATIO);
            } else if solved.is_none() {
                compliance *= FIRST_RATIO;
                continue;
            } else {
                ratio = ratio.sqrt();
                if ratio < LEAST_RATIO {
                    break;
                }
                self.restore(problem);
            }
            compliance = solved.map_or(compliance, |last| last / ratio);
            if compliance < LAST_COMPLIANCE {
                compliance = 0.0;
            }
        }
        self.restore(problem);
        if solved == Some(0.0) && onset.deciding && !onset.smooth {
            self.deciding = DECISIONS;
            let (ended, more) = self.newton(problem, system, onset, refine, FIRST_SYSTEMS);
            systems += more;
            match ended {
                Ended::Admit => return Outcome::Admit { systems },
                Ended::Solved => self.clip(problem),
                Ended::Failed => self.restore(problem),
            }
        }
        self.compliance = 0.0;
        if solved != Some(0.0) {
            // From here it may be near enough; where a contact opens under friction and closes without, friction stays where it acted.
            let held = Onset {
                smooth: false,
                deciding: false,
                ..onset
            };
            let (ended, more) = self.newton(problem, system, held, refine, FIRST_SYSTEMS);
            systems += more;
            if ended == Ended::Solved {
                self.clip(problem);
                solved = Some(0.0);
            } else {
                self.restore(problem);
            }
        }
        system.measure(problem, &mut self.forces);
        let merit = self.merit(problem, system);
        let compliance = solved.unwrap_or(0.0);
        let jammed =
            self.is_jammed(merit, compliance) && (compliance == 0.0 || growth.is_inverse());
        Outcome::Solved {
            merit,
            jammed,
            systems,
        }
    }

    /// Whether a problem that was solved with compliance, or only as well as rounding lets it, shows that there is no solution.
    fn is_jammed(&self, merit: Merit, compliance: f64) -> bool {
        (compliance > 0.0 || merit.residual > UNSOLVED)
            && self.approach(compliance) > JAMMED_APPROACH
    }

    /// Fastest velocity at which contacts give way under compliance.
    fn approach(&self, compliance: f64) -> f64 {
        (compliance + COMPLIANCE) * largest(&self.forces.normal)
    }

    /// Keeps the forces at hand, and on which contacts friction acts.
    fn keep(&mut self, problem: &Problem) {
        self.best.copy_from(&self.forces);
        self.acts.clear();
        self.acts
            .extend(problem.tangential.iter().map(|row| row.acts));
    }

    /// Goes back to what was kept.
    fn restore(&mut self, problem: &mut Problem) {
        self.forces.copy_from(&self.best);
        for (row, &acts) in problem.tangential.iter_mut().zip(&self.acts) {
            row.acts = acts;
        }
        self.read_states(problem);
    }

    /// Brings forces that rounding left out of their bounds back.
    fn clip(&mut self, problem: &Problem) {
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
    fn mend(&mut self, problem: &Problem, noise: Noise, pace: &mut Pace) -> usize {
        let (forces, states) = (&self.forces, &mut self.states);
        let mut found = 0;
        for (k, closed) in states.closed.iter_mut().enumerate() {
            let f = forces.normal[k];
            let wrong = if *closed {
                // What has no bound needs a load to hold on to.
                f < -noise.force || f <= 0.0 && problem.friction.is_infinite()
            } else {
                forces.slack[k] + self.compliance * f < -noise.velocity
            };
            if wrong {
                found += 1;
                *closed ^= pace.draw();
            }
        }
        for (m, row) in problem.tangential.iter().enumerate() {
            let load = forces.normal[row.contact] - problem.offset;
            let (t, grip) = (forces.tangential[m], states.grip[m]);
            let z = forces.slip[m] - self.compliance * t;
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
                if pace.draw() {
                    states.grip[m] = next;
                }
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
