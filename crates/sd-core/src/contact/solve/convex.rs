//! The one fallback: a sequence of convex problems, each of which Newton's method solves from any start.
//!
//! With the bounds ρ of friction given, the problem is the minimum over the velocities v of
//!
//! ```text
//! 1/2 v'R v − F'v + Σ max(0, u_k)²/(2 S) + Σ envelope of the interval ±ρ_m at s_m
//! u_k = f^_k − S (C v + b)_k      f_k = max(0, u_k)               trial force of candidate k
//! s_m = t^_m + S (D v + d)_m      t_m = clamp(s_m, −ρ_m, ρ_m)     trial friction of row m
//! ```
//!
//! which is strictly convex, with a gradient that is piecewise linear, so that Newton's method with an
//! exact line search ends from any start (Kunisch & Stadler, ESAIM: M2AN 39, 41 (2005)). Springs
//! have their own compliance in place of 1/S. For rigid contacts f^ and t^ are multipliers, the
//! forces of the solution before (augmented Lagrangian): they make the gaps hold.
//!
//! The bounds follow the load from one convex problem to the next. A bound whose error changes sign
//! without halving goes back and forth: its moves are damped, each contact by itself. After
//! [`BOUND_UPDATES`] iterations the bounds stay as they are, and the multipliers alone go on until the
//! gaps hold. If no motion keeps the gaps, the multipliers grow without bound instead.
//!
//! Where friction reads the motion that normal forces alone leave, there is no such function: Newton's
//! method then goes without a line search, in the same loop.

use super::newton::FrictionActivation;
use super::problem::{Forces, FrictionState, Problem, States, System, Tangential, largest};
use super::{Outcome, ProblemSolver};
use crate::contact::laws::COMPLIANCE;
use crate::contact::{Quality, Status};

/// Convex problems in which the bounds follow the load.
///
/// Recorded problems at ν = 1: of those that come here, friction is off by more than 1e-3 in 10 of 28 after
/// 15, in 4 after 40 and in none after 100 (c = 0.693).
const BOUND_UPDATES: u32 = 100;
/// Convex problems after that, for the multipliers alone. Each takes one or two digits off the residual.
const MULTIPLIER_UPDATES: u32 = 30;
/// 1/S of rigid contacts, in a/(mu·a²·rate). A larger one takes less time for a problem but leaves bounds that do
/// not settle: at c = 0.76, ν = 1, friction is off by more than 1e-3 in 6 of 51 problems, in 33 of 70
/// with 1e-5; single precision, in which sparse factors are held, allows no smaller one.
const PENALTY_COMPLIANCE: f64 = 1e-6;
/// Residual at which the multipliers are exact, in a·rate.
const EXACT_RESIDUAL: f64 = 1e-8;
/// Newton iterations for one convex problem; the next one goes on from where they end.
const NEWTON_ITERATIONS: u32 = 30;
/// What the move of a bound that goes back and forth is multiplied by, and by what it recovers in each iteration where it does not.
const DAMPING: f64 = 0.5;
const RECOVERY: f64 = 1.1;
/// How much smaller the friction error must have become since Newton's method last failed on the coupled problem for it to
/// be tried again: near the solution it takes two systems in place of some twenty convex problems.
const NEAR: f64 = 0.1;
/// Share of a Newton step below which it is rounding: the linear system is then solved to the end.
const SMALLEST_STEP: f64 = 1e-3;
/// Largest coefficient of a bound: an infinite one is no bound with a load, and 0 without.
const LARGEST_COEFFICIENT: f64 = 100.0;

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
    /// The convex problem: entries with penalties, and bounds that are given.
    problem: Problem,
    /// 1/S of each candidate and of each row; 0 for springs.
    penalties: [Vec<f64>; 2],
    /// f^ and t^.
    multipliers: [Vec<f64>; 2],
    /// ρ of each row.
    bounds: Vec<f64>,
    /// The bound at the present load, less that: now, and in the iteration before.
    errors: [Vec<f64>; 2],
    /// Share of the error by which each row moves.
    damping: Vec<f64>,
    /// The present velocities, and those of the linear system.
    iterates: [Iterate; 2],
    /// The active set of the next linear system, and that of the last one.
    states: States,
    before: States,
}

impl ConvexSolver {
    /// Room for that many candidates.
    pub(super) fn reserve(&mut self, candidates: usize) {
        self.problem.normal.reserve(candidates);
        self.problem.tangential.reserve(2 * candidates);
        self.states.reserve(candidates);
        self.before.reserve(candidates);
        for [of_candidates, of_rows] in [&mut self.penalties, &mut self.multipliers] {
            of_candidates.reserve(candidates);
            of_rows.reserve(2 * candidates);
        }
        let [errors, errors_before] = &mut self.errors;
        for values in [&mut self.bounds, &mut self.damping, errors, errors_before] {
            values.reserve(2 * candidates);
        }
        for iterate in &mut self.iterates {
            iterate.normal.reserve(candidates);
            iterate.trial_normal.reserve(candidates);
            iterate.tangential.reserve(2 * candidates);
            iterate.trial_tangential.reserve(2 * candidates);
        }
    }

    /// Starts from forces within their bounds.
    fn start(&mut self, problem: &Problem, states: &States, forces: &Forces) {
        self.multipliers[0].clone_from(&forces.normal);
        self.multipliers[1].clone_from(&forces.tangential);
        self.states.copy_from(states);
        self.bounds.clear();
        for row in &problem.tangential {
            self.bounds
                .push(finite_bound(row, forces.normal[row.contact]));
        }
        self.damping.clear();
        self.damping.resize(self.bounds.len(), 1.0);
        self.errors[1].clear();
        self.errors[1].resize(self.bounds.len(), 0.0);
    }

    /// Poses the convex problem of the present multipliers and bounds.
    fn pose(&mut self, problem: &Problem) {
        let penalty = |compliance: f64| {
            if compliance > COMPLIANCE {
                0.0
            } else {
                PENALTY_COMPLIANCE
            }
        };
        let [normal_penalties, row_penalties] = &mut self.penalties;
        self.problem.uses_frictionless_slip = problem.uses_frictionless_slip;
        self.problem.normal.clone_from(&problem.normal);
        normal_penalties.clear();
        for (entry, f) in self.problem.normal.iter_mut().zip(&self.multipliers[0]) {
            let e = penalty(entry.compliance);
            entry.bias -= e * f;
            entry.compliance += e;
            normal_penalties.push(e);
        }
        self.problem.tangential.clone_from(&problem.tangential);
        row_penalties.clear();
        for (m, row) in self.problem.tangential.iter_mut().enumerate() {
            (row.active, row.coefficient) = (true, 0.0);
            row.intercept = self.bounds[m];
            let e = penalty(row.compliance);
            row.shift += e * self.multipliers[1][m];
            row.compliance += e;
            row_penalties.push(e);
            let state = &mut self.states.friction[m];
            *state = match *state {
                _ if row.intercept == 0.0 => FrictionState::Inactive,
                FrictionState::Inactive => FrictionState::Stick,
                same => same,
            };
        }
    }

    /// Solves the convex problem from the present active set; the number of systems, and whether it is solved.
    fn minimise(&mut self, system: &mut impl System, forces: &mut Forces) -> (u32, bool) {
        let mut last = false;
        for count in 1..=NEWTON_ITERATIONS {
            let Some(roundoff) = system.solve(&self.problem, &self.states, last, forces) else {
                return (count, false);
            };
            let [now, next] = &mut self.iterates;
            next.take(&self.problem, &self.states, forces);
            let share = if count == 1 || self.problem.uses_frictionless_slip {
                1.0
            } else {
                now.line_search(next, &self.problem)
            };
            if share < 1.0 {
                now.move_towards(next, share);
            } else {
                std::mem::swap(now, next);
            }
            let ends = if share < 1.0 {
                share < SMALLEST_STEP
            } else {
                self.agrees(roundoff.force)
            };
            if ends && roundoff.exact {
                return (count, true);
            }
            last = ends;
            if !ends {
                self.read_states();
            }
        }
        (NEWTON_ITERATIONS, false)
    }

    /// The active set of the present velocities.
    fn read_states(&mut self) {
        let now = &self.iterates[0];
        for (closed, &u) in self.states.closed.iter_mut().zip(&now.trial_normal) {
            *closed = u > 0.0;
        }
        for (m, row) in self.problem.tangential.iter().enumerate() {
            let s = now.trial_tangential[m];
            if row.intercept > 0.0 {
                self.states.friction[m] = if s.abs() < row.intercept {
                    FrictionState::Stick
                } else {
                    FrictionState::slipping(s)
                };
            }
        }
    }

    /// Whether the active set of the last system is that of its solution, up to the rounding of forces.
    fn agrees(&mut self, roundoff: f64) -> bool {
        self.before.copy_from(&self.states);
        self.read_states();
        std::mem::swap(&mut self.before, &mut self.states);
        let (now, found) = (&self.iterates[0], &self.before);
        let mut closed = self.states.closed.iter().zip(&found.closed).enumerate();
        let mut friction = self.states.friction.iter().zip(&found.friction).enumerate();
        closed.all(|(k, (a, b))| a == b || now.trial_normal[k].abs() <= roundoff)
            && friction.all(|(m, (a, b))| {
                let beyond = now.trial_tangential[m].abs() - self.problem.tangential[m].intercept;
                a == b || beyond.abs() <= roundoff
            })
    }

    /// Takes the forces of a solution as multipliers, and its slack and slip back to those of the problem itself.
    fn take_multipliers(&mut self, forces: &mut Forces) {
        let [multipliers, friction_multipliers] = &mut self.multipliers;
        for (k, e) in self.penalties[0].iter().enumerate() {
            let f = &mut forces.normal[k];
            *f = f.max(0.0);
            forces.slack[k] += e * (multipliers[k] - *f);
            multipliers[k] = *f;
        }
        for (m, e) in self.penalties[1].iter().enumerate() {
            let t = forces.tangential[m];
            forces.slip[m] -= e * (friction_multipliers[m] - t);
            friction_multipliers[m] = t;
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
        let (mut systems, mut iteration, mut tried) = (0, 1, 1.0);
        let mut residual = f64::INFINITY;
        loop {
            self.convex.pose(problem);
            let (more, minimised) = self.convex.minimise(system, &mut self.forces);
            systems += more;
            self.convex.take_multipliers(&mut self.forces);
            self.states.copy_from(&self.convex.states);
            let refined = refine(problem, &self.forces);
            if activation.updates && iteration <= BOUND_UPDATES {
                self.update_activation(problem, activation, 0.0);
            }
            let violation = self.forces.violation(problem, system);
            let error = violation.friction_error;
            let follows = iteration <= BOUND_UPDATES;
            // A network with more contacts than motions may hold gaps that agree no better.
            let settled =
                violation.residual <= EXACT_RESIDUAL || violation.residual > 0.5 * residual;
            residual = violation.residual;
            let gaps_hold = minimised
                && refined == 0
                && residual <= Quality::RESIDUAL_LIMIT
                && (settled || follows && error > Quality::FRICTION_LIMIT);
            let is_unbounded = largest(&self.forces.normal) > Quality::UNBOUNDED;
            let ends = iteration == BOUND_UPDATES + MULTIPLIER_UPDATES;
            if gaps_hold && (error <= Quality::FRICTION_LIMIT || !follows) || is_unbounded || ends {
                let status = match violation.status() {
                    // The multipliers of a convex problem that has a solution converge.
                    Status::Failed if is_unbounded || minimised && refined == 0 => {
                        Status::NoAdmissibleMotion
                    }
                    other => other,
                };
                return Outcome {
                    status,
                    violation,
                    systems,
                };
            }
            if follows {
                self.convex.follow_loads(problem, &self.forces);
                if error <= NEAR * tried {
                    tried = error;
                    self.keep_activation(problem);
                    let (converged, more) = self.newton(problem, system, activation, refine);
                    systems += more;
                    if converged {
                        return self.accept(problem, system, systems);
                    }
                    self.restore_activation(problem);
                }
            }
            iteration += 1;
        }
    }
}
