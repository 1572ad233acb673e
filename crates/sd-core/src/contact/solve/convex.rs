//! The one fallback: a sequence of convex problems, whose bounds of friction follow the load.
//!
//! With the bounds ρ of friction given, friction is that of Tresca, and the problem is the minimum over the
//! velocities v of a strictly convex function, so that it has one solution (Kunisch & Stadler, ESAIM: M2AN 39, 41
//! (2005)). [`ConvexSolver`] keeps the bounds; each problem is solved in one of two ways:
//!
//! 1. by the active-set iteration of [`super::newton`], which mostly ends after a few systems, and exactly;
//! 2. where that cycles, with a penalty S in place of the rigid contacts, as the minimum of
//!
//! ```text
//! 1/2 v'R v − F'v + Σ max(0, u_k)²/(2 S) + Σ envelope of the interval ±ρ_m at s_m
//! u_k = f^_k − S (C v + b)_k      f_k = max(0, u_k)               trial force of candidate k
//! s_m = t^_m + S (D v + d)_m      t_m = clamp(s_m, −ρ_m, ρ_m)     trial friction of row m
//! ```
//!
//! whose gradient is piecewise linear: Newton's method with an exact line search ends from any start.
//! Springs have their own compliance in place of 1/S. The multipliers f^ and t^ are the forces of
//! the convex problem before (augmented Lagrangian): they make the gaps hold.
//!
//! The solution of each convex problem is a guess of the active set of the coupled one, from which
//! [`super::newton`] is tried again whenever the guess is a new one; that mostly ends the sequence
//! after a few problems. The bounds follow the load from one convex problem to the next. A bound whose
//! error changes sign without halving goes back and forth: its moves are damped, each contact by
//! itself. After [`BOUND_UPDATES`] problems the bounds stay as they are, so that the gaps hold,
//! and how far friction is from the law is measured. If no motion keeps the gaps, forces grow
//! without bound instead.
//!
//! Where friction reads the motion that normal forces alone leave, there is no such function: Newton's
//! method then goes without a line search, in the same loop.

use super::newton::FrictionActivation;
use super::problem::{Forces, FrictionState, Problem, States, System, Tangential, largest};
use super::{Outcome, ProblemSolver};
use crate::contact::laws::COMPLIANCE;
use crate::contact::{Quality, Status};

/// Convex problems in which the bounds follow the load.
const BOUND_UPDATES: u32 = 40;
/// Convex problems after that, for the multipliers alone.
const MULTIPLIER_UPDATES: u32 = 30;
/// First 1/S of rigid contacts, in a/(mu·a²·rate). A problem that is solved is followed by one with a tenth, one that is not by one
/// with ten times as much: soft contacts are found quickly, hard ones need few multipliers.
const PENALTY_COMPLIANCE: f64 = 1e-4;
/// The smallest 1/S: single precision, in which sparse factors are held, allows no smaller one.
const HARDEST: f64 = 1e-6;
/// Newton iterations for one problem with penalties; one that takes more is given up, and its forces with it.
const NEWTON_ITERATIONS: u32 = 30;
/// What the move of a bound that goes back and forth is multiplied by, and by what it recovers in each iteration where it does not.
const DAMPING: f64 = 0.5;
const RECOVERY: f64 = 1.1;
/// Share of a Newton step below which it counts as rounding: the linear system is then solved to the end. Near jamming shorter steps
/// occur far from the minimum too, which is why rolling friction there is not solved (`docs/contacts.md`).
const SMALLEST_STEP: f64 = 1e-3;
/// Largest coefficient of a bound: an infinite one is no bound with a load, and 0 without.
const LARGEST_COEFFICIENT: f64 = 100.0;
/// Where bounds are given, no load decides where friction is active.
const GIVEN: FrictionActivation = FrictionActivation {
    critical_load: 0.0,
    updates: false,
};

/// Velocities of the spheres by what they do to contacts. All parts are linear in the velocities.
#[derive(Debug, Default)]
struct Iterate {
    /// Forces f and t with which the spheres move so.
    normal: Vec<f64>,
    tangential: Vec<f64>,
    /// u of each candidate and s of each row: the forces of springs, and of the penalty of rigid
    /// contacts, before they are brought into their bounds.
    trial_normal: Vec<f64>,
    trial_tangential: Vec<f64>,
}

impl Iterate {
    /// The velocities of a linear system's solution.
    fn take(&mut self, problem: &Problem, states: &States, forces: &Forces) {
        self.normal.clone_from(&forces.normal);
        self.tangential.clone_from(&forces.tangential);
        self.trial_normal.clear();
        for (k, entry) in problem.normal.iter().enumerate() {
            self.trial_normal.push(if states.closed[k] {
                forces.normal[k]
            } else {
                -forces.slack[k] / entry.compliance
            });
        }
        self.trial_tangential.clear();
        for (m, row) in problem.tangential.iter().enumerate() {
            let t = forces.tangential[m];
            self.trial_tangential.push(match states.friction[m] {
                FrictionState::Stick => t,
                _ => t + forces.slip[m] / row.compliance,
            });
        }
    }

    /// The velocities under forces that are the multipliers of the problem.
    fn start(&mut self, problem: &Problem, forces: &Forces) {
        self.normal.clone_from(&forces.normal);
        self.tangential.clone_from(&forces.tangential);
        self.trial_normal.clear();
        for (k, entry) in problem.normal.iter().enumerate() {
            let trial = forces.normal[k] - forces.slack[k] / entry.compliance;
            self.trial_normal.push(trial);
        }
        self.trial_tangential.clear();
        for (m, row) in problem.tangential.iter().enumerate() {
            let trial = forces.tangential[m] + forces.slip[m] / row.compliance;
            self.trial_tangential.push(trial);
        }
    }

    /// The active set of these velocities.
    fn show_states(&self, problem: &Problem, states: &mut States) {
        states.closed.clear();
        states
            .closed
            .extend(self.trial_normal.iter().map(|&u| u > 0.0));
        states.friction.clear();
        for (row, &s) in problem.tangential.iter().zip(&self.trial_tangential) {
            states.friction.push(if row.intercept == 0.0 {
                FrictionState::Inactive
            } else if s.abs() < row.intercept {
                FrictionState::Stick
            } else {
                FrictionState::slipping(s)
            });
        }
    }

    /// Moves towards others by a share of the way.
    fn move_towards(&mut self, next: &Self, share: f64) {
        let parts = [
            (&mut self.normal, &next.normal),
            (&mut self.tangential, &next.tangential),
            (&mut self.trial_normal, &next.trial_normal),
            (&mut self.trial_tangential, &next.trial_tangential),
        ];
        for (from, to) in parts {
            for (x, y) in from.iter_mut().zip(to) {
                *x += share * (y - *x);
            }
        }
    }

    /// Slope of the convex function towards others, at a share of the way to them.
    fn slope(&self, next: &Self, problem: &Problem, share: f64) -> f64 {
        let at = |from: f64, to: f64| from + share * (to - from);
        let mut slope = 0.0;
        for (k, entry) in problem.normal.iter().enumerate() {
            let (from, to) = (self.trial_normal[k], next.trial_normal[k]);
            let excess = at(from, to).max(0.0) - at(self.normal[k], next.normal[k]);
            slope += entry.compliance * (to - from) * excess;
        }
        for (m, row) in problem.tangential.iter().enumerate() {
            let (from, to) = (self.trial_tangential[m], next.trial_tangential[m]);
            let force = at(from, to).clamp(-row.intercept, row.intercept);
            let excess = force - at(self.tangential[m], next.tangential[m]);
            slope += row.compliance * (to - from) * excess;
        }
        slope
    }

    /// The share of the way to others at which the convex function is least, at most 1.
    fn line_search(&self, next: &Self, problem: &Problem) -> f64 {
        let first = self.slope(next, problem, 0.0);
        if self.slope(next, problem, 1.0) <= 1e-10 * first.abs() {
            return 1.0;
        }
        // The slope grows along the way: bisection to 2⁻⁴⁰.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if self.slope(next, problem, middle) > 0.0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        high
    }
}

/// The convex problem under way, with its workspace.
#[derive(Debug, Default)]
pub(super) struct ConvexSolver {
    /// The problem with bounds that are given.
    problem: Problem,
    /// ρ of each row.
    bounds: Vec<f64>,
    /// The bound at the present load, less that: now, and in the iteration before.
    errors: [Vec<f64>; 2],
    /// Share of the error by which each row moves.
    damping: Vec<f64>,
    /// The active set of its last solution.
    states: States,
    /// That from which Newton's method on the coupled problem was tried last.
    tried: States,
    /// The same problem with penalties.
    penalised: Penalised,
}

impl ConvexSolver {
    /// Room for that many candidates.
    pub(super) fn reserve(&mut self, candidates: usize) {
        self.problem.reserve(candidates);
        self.states.reserve(candidates);
        self.tried.reserve(candidates);
        let [errors, errors_before] = &mut self.errors;
        for values in [&mut self.bounds, &mut self.damping, errors, errors_before] {
            values.reserve(2 * candidates);
        }
        self.penalised.reserve(candidates);
    }

    /// Starts from an active set, and from the bounds of the present loads.
    fn start(&mut self, problem: &Problem, states: &States, forces: &Forces) {
        self.states.copy_from(states);
        let rows = problem.tangential.iter();
        self.bounds.clear();
        self.bounds
            .extend(rows.map(|row| finite_bound(row, forces.normal[row.contact])));
        self.damping.clear();
        self.damping.resize(self.bounds.len(), 1.0);
        self.errors[1].clear();
        self.errors[1].resize(self.bounds.len(), 0.0);
        self.penalised.penalty = PENALTY_COMPLIANCE;
        self.tried.closed.clear();
        self.tried.friction.clear();
    }

    /// Poses the convex problem of the present bounds, with an active set to start from.
    fn pose(&mut self, problem: &Problem) {
        self.problem.copy_from(problem);
        for (m, row) in self.problem.tangential.iter_mut().enumerate() {
            let bound = self.bounds[m];
            (row.active, row.coefficient, row.intercept) = (bound > 0.0, 0.0, bound);
            let state = &mut self.states.friction[m];
            *state = match *state {
                _ if bound == 0.0 => FrictionState::Inactive,
                FrictionState::Inactive => FrictionState::Stick,
                same => same,
            };
        }
    }

    /// Moves the bounds towards those of the present loads.
    fn follow_loads(&mut self, problem: &Problem, forces: &Forces) {
        let [errors, before] = &mut self.errors;
        errors.clear();
        for (m, row) in problem.tangential.iter().enumerate() {
            let error = finite_bound(row, forces.normal[row.contact]) - self.bounds[m];
            errors.push(error);
            let damping = &mut self.damping[m];
            if error * before[m] < 0.0 && error.abs() > 0.5 * before[m].abs() {
                *damping *= DAMPING;
            } else {
                *damping = (RECOVERY * *damping).min(1.0);
            }
            self.bounds[m] += *damping * error;
        }
        std::mem::swap(errors, before);
    }

    /// Whether an active set is another than that tried last; it is then the one tried last.
    fn is_new(&mut self, states: &States) -> bool {
        let new = self.tried != *states;
        self.tried.copy_from(states);
        new
    }
}

/// Bound of a row at a load, finite also where there is none.
fn finite_bound(row: &Tangential, load: f64) -> f64 {
    let coefficient = row.coefficient.min(LARGEST_COEFFICIENT);
    Tangential {
        coefficient,
        ..*row
    }
    .bound(load)
}

/// A convex problem with penalties, as a contact problem whose rigid contacts have the compliance 1/S.
#[derive(Debug, Default)]
struct Penalised {
    problem: Problem,
    /// 1/S of rigid contacts.
    penalty: f64,
    /// The present velocities, and those of the linear system.
    iterates: [Iterate; 2],
    /// The active set of the last system, as its velocities show it.
    found: States,
}

impl Penalised {
    /// Room for that many candidates.
    fn reserve(&mut self, candidates: usize) {
        self.problem.reserve(candidates);
        self.found.reserve(candidates);
        for iterate in &mut self.iterates {
            iterate.normal.reserve(candidates);
            iterate.trial_normal.reserve(candidates);
            iterate.tangential.reserve(2 * candidates);
            iterate.trial_tangential.reserve(2 * candidates);
        }
    }

    /// Poses a convex problem with the forces f^ and t^ as multipliers, and with the velocities under these to start from.
    fn pose(&mut self, convex: &Problem, multipliers: &Forces) {
        let penalty = |compliance: f64| {
            if compliance > COMPLIANCE {
                0.0
            } else {
                self.penalty
            }
        };
        self.problem.copy_from(convex);
        for (entry, f) in self.problem.normal.iter_mut().zip(&multipliers.normal) {
            let e = penalty(entry.compliance);
            entry.bias -= e * f;
            entry.compliance += e;
        }
        for (row, t) in self
            .problem
            .tangential
            .iter_mut()
            .zip(&multipliers.tangential)
        {
            let e = penalty(row.compliance);
            row.shift += e * t;
            row.compliance += e;
        }
        self.iterates[0].start(&self.problem, multipliers);
    }

    /// Solves the problem from the velocities posed, with the active set of the solution; whether it is solved, and the number of systems.
    fn minimise(
        &mut self,
        system: &mut impl System,
        states: &mut States,
        forces: &mut Forces,
    ) -> (bool, u32) {
        self.iterates[0].show_states(&self.problem, states);
        let mut last = false;
        for count in 1..=NEWTON_ITERATIONS {
            let Some(roundoff) = system.solve(&self.problem, states, last, forces) else {
                return (false, count);
            };
            let [now, next] = &mut self.iterates;
            next.take(&self.problem, states, forces);
            let share = if self.problem.uses_frictionless_slip {
                1.0
            } else {
                now.line_search(next, &self.problem)
            };
            if share < 1.0 {
                now.move_towards(next, share);
            } else {
                std::mem::swap(now, next);
            }
            self.iterates[0].show_states(&self.problem, &mut self.found);
            let ends = if share < 1.0 {
                share < SMALLEST_STEP
            } else {
                self.agrees(states, roundoff.force)
            };
            if ends && roundoff.exact {
                return (true, count);
            }
            last = ends;
            if !ends {
                states.copy_from(&self.found);
            }
        }
        (false, NEWTON_ITERATIONS)
    }

    /// Whether the active set of the last system is that of its solution, up to the rounding of forces.
    fn agrees(&self, states: &States, roundoff: f64) -> bool {
        let (now, found) = (&self.iterates[0], &self.found);
        let mut closed = states.closed.iter().zip(&found.closed).enumerate();
        let mut friction = states.friction.iter().zip(&found.friction).enumerate();
        closed.all(|(k, (a, b))| a == b || now.trial_normal[k].abs() <= roundoff)
            && friction.all(|(m, (a, b))| {
                let beyond = now.trial_tangential[m].abs() - self.problem.tangential[m].intercept;
                a == b || beyond.abs() <= roundoff
            })
    }

    /// The forces of the velocities found, within their bounds.
    fn show_forces(&self, forces: &mut Forces) {
        let now = &self.iterates[0];
        for (f, &u) in forces.normal.iter_mut().zip(&now.trial_normal) {
            *f = u.max(0.0);
        }
        let rows = self.problem.tangential.iter();
        for ((t, &s), row) in forces
            .tangential
            .iter_mut()
            .zip(&now.trial_tangential)
            .zip(rows)
        {
            *t = s.clamp(-row.intercept, row.intercept);
        }
    }
}

impl ProblemSolver {
    /// Solves the problem by convex ones from the present forces, which are then the best found.
    pub(super) fn solve_convex(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        activation: FrictionActivation,
        refine: &mut impl FnMut(&mut Problem, &Forces) -> usize,
    ) -> Outcome {
        self.forces.project_onto_bounds(problem);
        self.convex.start(problem, &self.states, &self.forces);
        let mut systems = 0;
        for iteration in 1..=BOUND_UPDATES + MULTIPLIER_UPDATES {
            let (solved, more) = self.solve_with_given_bounds(problem, system, refine);
            systems += more;
            let follows = iteration <= BOUND_UPDATES;
            if activation.updates && follows {
                self.update_activation(problem, activation, 0.0);
            }
            let violation = self.forces.violation(problem, system);
            let gaps_hold = solved && violation.residual <= Quality::RESIDUAL_LIMIT;
            let is_unbounded = largest(&self.forces.normal) > Quality::UNBOUNDED;
            let is_exact = violation.friction_error <= Quality::FRICTION_LIMIT;
            let ends = iteration == BOUND_UPDATES + MULTIPLIER_UPDATES;
            if gaps_hold && (is_exact || !follows) || is_unbounded || ends {
                let status = match violation.status() {
                    Status::Solved => Status::Solved,
                    // The multipliers of a convex problem that has a solution converge.
                    Status::Failed if solved => Status::NoAdmissibleMotion,
                    _ if is_unbounded => Status::NoAdmissibleMotion,
                    other => other,
                };
                return Outcome {
                    status,
                    violation,
                    systems,
                };
            }
            if follows {
                self.states.release_open_contacts(problem);
                if self.convex.is_new(&self.states) {
                    self.start.copy_from(&self.forces);
                    self.keep_activation(problem);
                    let (converged, more) = self.newton(problem, system, activation, refine);
                    systems += more;
                    if converged {
                        return self.accept(problem, system, systems);
                    }
                    self.restore_activation(problem);
                    self.forces.copy_from(&self.start);
                }
                self.convex.follow_loads(problem, &self.forces);
            }
        }
        unreachable!("the last iteration returns")
    }

    /// Solves the problem with the present bounds; whether it is solved, and the number of systems.
    fn solve_with_given_bounds(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        refine: &mut impl FnMut(&mut Problem, &Forces) -> usize,
    ) -> (bool, u32) {
        self.convex.pose(problem);
        let mut convex = std::mem::take(&mut self.convex.problem);
        self.forces.project_onto_bounds(&convex);
        self.start.copy_from(&self.forces);
        self.states.copy_from(&self.convex.states);
        let (mut solved, mut systems) = self.newton(&mut convex, system, GIVEN, refine);
        if solved {
            self.forces.project_onto_bounds(&convex);
        } else {
            let mut penalised = std::mem::take(&mut self.convex.penalised);
            system.measure(&convex, &mut self.start);
            penalised.pose(&convex, &self.start);
            let (minimised, more) = penalised.minimise(system, &mut self.states, &mut self.forces);
            if minimised {
                penalised.show_forces(&mut self.forces);
                penalised.penalty = HARDEST.max(0.1 * penalised.penalty);
            } else {
                self.forces.copy_from(&self.start);
                penalised.penalty *= 10.0;
            }
            // The motion that the linear algebra holds is then that of these forces.
            system.measure(&convex, &mut self.forces);
            solved = minimised && refine(&mut convex, &self.forces) == 0;
            systems += more;
            self.convex.penalised = penalised;
        }
        self.convex.states.copy_from(&self.states);
        problem.normal.clone_from(&convex.normal);
        self.convex.problem = convex;
        (solved, systems)
    }
}
