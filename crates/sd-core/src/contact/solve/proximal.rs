//! The one fallback: the proximal point method, a sequence of problems whose contacts are softer.
//!
//! ```text
//! w = C v + b + κ f + ε (f − f̂)          z = D v + d − μ t − ε (t − t̂)
//! ```
//!
//! with the forces f̂ and t̂ of the problem before. Where f = f̂ and t = t̂ the solution is that of the
//! problem itself, for any ε (augmented Lagrangian: Rockafellar, SIAM J. Control Optim. 14, 877 (1976)).
//! Contacts that are soft enough have one solution, which [`super::newton`] finds: their own
//! compliance outweighs what they do to each other. Hard ones take fewer problems. So a problem that is
//! solved is followed by one a tenth as soft, one that is not by one ten times as soft.
//!
//! Where Newton's method fails, the bounds of friction are held for one problem, at the present loads:
//! friction is then that of Tresca, and the problem is the minimum of a convex function of
//! the velocities, with one solution (Kunisch & Stadler, ESAIM: M2AN 39, 41 (2005)).
//!
//! With Coulomb's law the sequence mostly ends after a few problems, but a solution need not
//! exist, and there can be several: it starts from the present forces, then from none. If it
//! settles from neither, the bounds stay as the last loads have them. The method then
//! converges wherever a motion keeps the gaps, and how far friction is from the law is measured. If no
//! motion keeps the gaps, forces grow without bound.

use super::newton::FrictionActivation;
use super::problem::{Forces, Problem, System, largest};
use super::{Outcome, ProblemSolver};
use crate::contact::laws::COMPLIANCE;
use crate::contact::{Quality, Status};
use crate::space::Space;

/// Problems of one sequence at most. With 30 in its place friction stays inexact in 9 % instead of 2 % of the stages of layers of 100 at
/// c = 0.76, ν = 0.3 and 1 together, with 15 in 20 %.
const MAX_PROBLEMS: u32 = 60;
/// The first ε, in a/(mu·a²·rate). Ten times more or less, like a factor of 4 or 30 for [`SOFTENING`], changes which hard stages of such
/// layers stay inexact, and not how many within their scatter.
const FIRST_SOFTNESS: f64 = 1e-4;
/// The largest ε: contacts are then softer than the motions of their spheres by far. The sequence starts over from the first.
const MAX_SOFTNESS: f64 = 1.0;
/// Residual, in a·rate, and friction error from which on a solution may be final.
const EXACT: f64 = 1e-8;
/// By what ε changes from one problem to the next.
const SOFTENING: f64 = 10.0;
/// Largest coefficient of a bound that is held: an infinite one is no bound with a load, and 0 without.
const MAX_COEFFICIENT: f64 = 100.0;

impl<S: Space> Problem<S> {
    /// Becomes another problem whose contacts are softer by ε about given forces.
    fn soften(&mut self, other: &Self, softness: f64, about: &Forces) {
        self.copy_from(other);
        for (entry, f) in self.normal.iter_mut().zip(&about.normal) {
            entry.bias -= softness * f;
            entry.compliance += softness;
        }
        for (row, t) in self.tangential.iter_mut().zip(&about.tangential) {
            row.shift += softness * t;
            row.compliance += softness;
        }
    }

    /// Makes friction active where it is in a copy.
    fn copy_activation(&mut self, copy: &Self) {
        for (row, copied) in self.tangential.iter_mut().zip(&copy.tangential) {
            (row.active, row.was_deactivated) = (copied.active, copied.was_deactivated);
        }
    }

    /// Holds the bounds of friction at given loads.
    fn hold_bounds(&mut self, loads: &[f64]) {
        for row in &mut self.tangential {
            row.coefficient = row.coefficient.min(MAX_COEFFICIENT);
            row.intercept = row.bound(loads[row.contact]);
            row.coefficient = 0.0;
            row.active = row.intercept > 0.0;
        }
    }
}

impl<S: Space> ProblemSolver<S> {
    /// Solves the problem from the present forces, which are then those found.
    pub(super) fn solve_proximal(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        activation: FrictionActivation,
        refine: &mut impl FnMut(&mut Problem<S>, &Forces) -> usize,
    ) -> Outcome {
        let mut outcome = self.iterate(problem, system, Some(activation), refine);
        let mut systems = outcome.systems;
        if outcome.status != Status::Solved {
            self.restore_activation(problem);
            self.forces.normal.fill(0.0);
            self.forces.tangential.fill(0.0);
            outcome = self.iterate(problem, system, Some(activation), refine);
            systems += outcome.systems;
        }
        if outcome.status != Status::Solved {
            if outcome.status == Status::NoAdmissibleMotion {
                self.forces.copy_from(&self.start);
            }
            let mut held = std::mem::take(&mut self.held);
            held.copy_from(problem);
            held.hold_bounds(&self.forces.normal);
            outcome = self.iterate(&mut held, system, None, refine);
            systems += outcome.systems;
            problem.normal.clone_from(&held.normal);
            self.held = held;
            outcome.violation = self.forces.violation(problem, system);
            if outcome.status == Status::Solved {
                outcome.status = outcome.violation.status();
            }
        }
        if outcome.status == Status::Solved {
            // Its active set is that of the problem itself, which Newton's method then solves as exactly as any.
            self.start.copy_from(&self.forces);
            self.read_states(problem);
            let (converged, more) = self.newton(problem, system, activation, refine);
            systems += more;
            if converged {
                outcome = self.accept(problem, system, systems);
            } else {
                self.forces.copy_from(&self.start);
                system.measure(problem, &mut self.forces);
            }
        }
        Outcome { systems, ..outcome }
    }

    /// The sequence of softer problems, from the present forces.
    ///
    /// `activation`: none where the bounds of friction are held.
    fn iterate(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        activation: Option<FrictionActivation>,
        refine: &mut impl FnMut(&mut Problem<S>, &Forces) -> usize,
    ) -> Outcome {
        self.forces.project_onto_bounds(problem);
        system.measure(problem, &mut self.forces);
        let given = FrictionActivation::GIVEN;
        let first = activation.unwrap_or(given);
        let mut softer = std::mem::take(&mut self.softer);
        let (mut softness, mut systems, mut failed) = (FIRST_SOFTNESS, 0, false);
        let mut before = f64::INFINITY;
        for count in 1.. {
            self.about.copy_from(&self.forces);
            softer.soften(problem, softness, &self.about);
            if failed {
                self.read_states_of_motion(&softer);
            } else {
                self.read_states(problem);
            }
            let (mut solved, mut more) = self.newton(&mut softer, system, first, &mut |_, _| 0);
            systems += more;
            failed = !solved;
            if solved {
                problem.copy_activation(&softer);
            } else if activation.is_some() {
                softer.soften(problem, softness, &self.about);
                softer.hold_bounds(&self.about.normal);
                self.forces.copy_from(&self.about);
                self.forces.project_onto_bounds(&softer);
                self.read_states(&softer);
                (solved, more) = self.newton(&mut softer, system, given, &mut |_, _| 0);
                systems += more;
            }
            if solved {
                self.forces.project_onto_bounds(&softer);
                if failed && first.updates {
                    self.update_activation(problem, system, first, 0.0);
                }
            } else {
                self.forces.copy_from(&self.about);
            }
            system.measure(problem, &mut self.forces);
            let is_linearised = refine(problem, &self.forces) == 0;
            let violation = self.forces.violation(problem, system);
            let is_unbounded = largest(&self.forces.normal) > Quality::UNBOUNDED;
            let status = match violation.status() {
                Status::Solved if is_linearised => Status::Solved,
                Status::Solved => Status::Failed,
                _ if is_unbounded => Status::NoAdmissibleMotion,
                other => other,
            };
            let error = violation.residual.max(violation.friction_error);
            let gives_up = count == MAX_PROBLEMS || !solved && softness >= MAX_SOFTNESS;
            // A solution is final once the next problem does not make it better.
            let is_exact = status == Status::Solved && error < EXACT;
            let is_final = is_exact && !failed && error >= before || is_unbounded;
            before = error;
            if is_final || gives_up {
                self.softer = softer;
                return Outcome {
                    status,
                    violation,
                    systems,
                };
            }
            softness = if !failed {
                COMPLIANCE.max(softness / SOFTENING)
            } else if softness < MAX_SOFTNESS {
                SOFTENING * softness
            } else {
                FIRST_SOFTNESS
            };
        }
        unreachable!("the last problem ends the sequence")
    }

    /// The active set that the present motion shows where contacts are as soft as those of a problem.
    fn read_states_of_motion(&mut self, softer: &Problem<S>) {
        let (forces, states) = (&self.forces, &mut self.states);
        let normal = softer.normal.iter().enumerate();
        let loads = normal.map(|(k, entry)| forces.normal[k] - forces.slack[k] / entry.compliance);
        states.closed.clear();
        states.closed.extend(loads.map(|load| load > 0.0));
        states.clear_friction();
        let slips = S::by_slip(&forces.tangential)
            .iter()
            .zip(S::by_slip(&forces.slip));
        for ((t, z), rows) in slips.zip(softer.tangential.chunks_exact(S::TANGENTS)) {
            let (row, mut trial) = (&rows[0], *t);
            let k = row.contact;
            let load = forces.normal[k] - forces.slack[k] / softer.normal[k].compliance;
            for (trial, z) in trial.as_mut().iter_mut().zip(z.as_ref()) {
                *trial += z / row.compliance;
            }
            let bound = row.bound(load.max(0.0));
            states.push_friction::<S>(&trial, bound);
        }
    }
}
