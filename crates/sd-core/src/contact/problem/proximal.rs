//! The fallback: the proximal point method, a sequence of problems with softened contacts.
//!
//! ```text
//! w = C v + b + κ f + ε (f − f̂)          z = D v + d − μ t − ε (t − t̂)
//! ```
//!
//! Here f̂ and t̂ are the forces of the preceding problem. Where f = f̂ and t = t̂, the solution is
//! that of the original problem for any ε (augmented Lagrangian: Rockafellar, SIAM J. Control
//! Optim. 14, 877 (1976)). If contacts are soft enough, their own compliance exceeds their
//! interaction: the solution is unique, and [`super::newton`] finds it. Stiffer contacts require
//! fewer problems. Therefore ε is divided by ten after a problem that was solved, and multiplied by
//! ten after one that was not.
//!
//! Where rigid contacts in a layer have tangential springs, ε changes in smaller steps, a problem
//! at which Newton's method fails is solved along a [`super::path`] if that is short, and the
//! original problem is solved as soon as the active set is known.
//!
//! Where these methods fail, the friction bounds are fixed for one problem at the current loads.
//! This is Tresca friction: the problem is the minimisation of a convex function of the velocities,
//! with a unique solution (Kunisch & Stadler, ESAIM: M2AN 39, 41 (2005)).
//!
//! With Coulomb's law the sequence usually converges after a few problems, but a solution need not
//! exist, and there can be several. The sequence is started from the current forces, and then from
//! zero. If neither converges, the bounds are fixed at the last loads. The method then converges
//! whenever an admissible motion exists, and the violation of the friction law is measured. If
//! there is no admissible motion, forces grow without bound.

use super::ProblemSolver;
use super::newton::Effort;
use super::statement::{Forces, Problem, System, largest, trial_force};
use crate::contact::laws::COMPLIANCE;
use crate::contact::{Quality, Status};
use crate::space::Space;

/// Maximum number of problems in a sequence. In layers of 100 spheres at c = 0.76 with ν = 0.3 and
/// 1, friction stays inexact in 2 % of the stages; with 30 problems in 9 %, with 15 in 20 %.
const MAX_PROBLEMS: u32 = 60;
/// The first ε, in a/(mu·a²·rate). Neither a factor of ten in it nor a factor of 4 or 30 for
/// [`SOFTNESS_RATIO`] changes the number of inexact stages of such layers beyond its scatter.
const FIRST_SOFTNESS: f64 = 1e-4;
/// The largest ε, at which contacts are much softer than the motions of their spheres. Beyond it
/// the sequence starts again from the first ε.
const MAX_SOFTNESS: f64 = 1.0;
/// Residual, in a·rate, and friction error below which a solution may be final.
const FINAL_ERROR: f64 = 1e-8;
/// Factor between successive values of ε.
const SOFTNESS_RATIO: f64 = 10.0;
/// The first ε where rigid contacts in a layer have tangential springs. With 1e-2 instead of 1e-3,
/// 50 spheres at c = 0.76 and ν = 1 require 4 % more linear systems.
const FIRST_SOFTNESS_WITH_SPRINGS: f64 = 1e-3;
/// Factor between successive values of ε there. With 10 instead of 3, 50 spheres at c = 0.76 and
/// ν = 10 require a third more linear systems.
const SOFTNESS_RATIO_WITH_SPRINGS: f64 = 3.0;
/// Number of linear systems up to which a problem was so easy that the next ε is divided by
/// [`SOFTNESS_RATIO`] there too.
const FEW_SYSTEMS: u32 = 3;
/// Residual, in a·rate, and friction error below which the active set of a softened problem is
/// expected to be that of the original one.
const IDENTIFIED_ERROR: f64 = 1e-2;
/// Factor by which the error must decrease before the original problem is tried again.
const IDENTIFIED_REDUCTION: f64 = 0.1;
/// Largest coefficient of a fixed bound: with an infinite one, the bound would be infinite or zero.
const MAX_COEFFICIENT: f64 = 100.0;

impl<S: Space> Problem<S> {
    /// Becomes a copy of `other` with its contacts softened by ε about the forces `reference`.
    fn soften(&mut self, other: &Self, softness: f64, reference: &Forces<S>) {
        self.copy_from(other);
        for (entry, f) in self.normal.iter_mut().zip(&reference.normal) {
            entry.bias -= softness * f;
            entry.compliance += softness;
        }
        for (entry, t) in self.friction.iter_mut().zip(&reference.tangential) {
            for k in 0..S::TANGENTS {
                entry.shift[k] += softness * t[k];
            }
            entry.compliance += softness;
        }
    }

    /// Copies where friction is active.
    fn copy_activation(&mut self, copy: &Self) {
        for (entry, copied) in self.friction.iter_mut().zip(&copy.friction) {
            (entry.active, entry.was_deactivated) = (copied.active, copied.was_deactivated);
        }
    }

    /// Fixes the friction bounds at given loads.
    fn fix_bounds(&mut self, loads: &[f64]) {
        self.critical_load = None;
        for entry in &mut self.friction {
            entry.coefficient = entry.coefficient.min(MAX_COEFFICIENT);
            entry.intercept = entry.bound(loads[entry.contact]);
            entry.coefficient = 0.0;
            entry.active = entry.intercept > 0.0;
        }
    }
}

impl<S: Space> ProblemSolver<S> {
    /// Solves the problem from the current forces, which become those of the solution.
    pub(super) fn solve_proximal(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        refine: &mut impl FnMut(&mut Problem<S>, &Forces<S>) -> usize,
    ) -> Quality {
        let mut quality = self.iterate(problem, system, false, refine);
        let mut systems = quality.systems;
        if quality.status != Status::Solved {
            self.restore_activation(problem);
            self.forces.normal.fill(0.0);
            self.forces.tangential.fill(S::each_tangent(0.0));
            quality = self.iterate(problem, system, false, refine);
            systems += quality.systems;
        }
        if quality.status != Status::Solved {
            if quality.status == Status::NoAdmissibleMotion {
                self.forces.copy_from(&self.initial);
            }
            self.initial.copy_from(&self.forces);
            let loads = std::mem::take(&mut self.initial.normal);
            quality = self.solve_bounded(problem, system, &loads, refine);
            self.initial.normal = loads;
            systems += quality.systems;
        }
        if quality.status == Status::Solved {
            // The active set is that of the original problem, which Newton's method then solves to
            // full accuracy.
            let effort = Effort::full::<S>();
            let (converged, more) = self.solve_exactly(problem, system, effort, refine);
            systems += more;
            if converged {
                quality = self.accept(problem, systems);
            }
        }
        Quality { systems, ..quality }
    }

    /// Solves the problem itself by Newton's method, from the active set of the current forces,
    /// which stay if that fails. Returns whether it converged, and the number of linear systems.
    fn solve_exactly(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        effort: Effort,
        refine: &mut impl FnMut(&mut Problem<S>, &Forces<S>) -> usize,
    ) -> (bool, u32) {
        self.initial.copy_from(&self.forces);
        self.save_activation(problem);
        self.infer_states(problem);
        let (converged, systems) = self.newton(problem, system, effort, refine);
        if !converged {
            self.restore_activation(problem);
            self.forces.copy_from(&self.initial);
            system.measure(problem, &mut self.forces);
        }
        (converged, systems)
    }

    /// Solves the problem with friction bounds held at given loads, from the current forces. The
    /// violation is that of the problem itself.
    pub(super) fn solve_bounded(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        loads: &[f64],
        refine: &mut impl FnMut(&mut Problem<S>, &Forces<S>) -> usize,
    ) -> Quality {
        let mut bounded = std::mem::take(&mut self.bounded);
        bounded.copy_from(problem);
        bounded.fix_bounds(loads);
        let found = self.iterate(&mut bounded, system, true, refine);
        problem.normal.clone_from(&bounded.normal);
        self.bounded = bounded;
        let quality = self.forces.quality(problem);
        let status = match found.status {
            Status::Solved => quality.status,
            other => other,
        };
        Quality {
            status,
            systems: found.systems,
            ..quality
        }
    }

    /// Solves the sequence of softened problems, from the current forces.
    ///
    /// `is_bounded`: whether the friction bounds are fixed.
    fn iterate(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        is_bounded: bool,
        refine: &mut impl FnMut(&mut Problem<S>, &Forces<S>) -> usize,
    ) -> Quality {
        self.forces.project_onto_bounds(problem);
        system.measure(problem, &mut self.forces);
        let mut softened = std::mem::take(&mut self.softened);
        let has_path = !is_bounded && problem.has_path();
        let (first, ratio, effort) = if has_path {
            let effort = Effort::selective::<S>();
            (
                FIRST_SOFTNESS_WITH_SPRINGS,
                SOFTNESS_RATIO_WITH_SPRINGS,
                effort,
            )
        } else {
            (FIRST_SOFTNESS, SOFTNESS_RATIO, Effort::full::<S>())
        };
        let (mut softness, mut systems, mut failed) = (first, 0, false);
        let mut identified = IDENTIFIED_ERROR;
        let mut before = f64::INFINITY;
        for count in 1.. {
            self.reference.copy_from(&self.forces);
            softened.soften(problem, softness, &self.reference);
            if failed {
                self.infer_states_of_motion(&softened);
            } else {
                self.infer_states(problem);
            }
            let (mut solved, mut more) = self.newton(&mut softened, system, effort, &mut |_, _| 0);
            systems += more;
            if !solved && has_path {
                softened.soften(problem, softness, &self.reference);
                self.forces.copy_from(&self.reference);
                self.infer_states(problem);
                (solved, more) = self.follow_path(&mut softened, system);
                systems += more;
            }
            failed = !solved;
            if solved {
                problem.copy_activation(&softened);
            } else if !is_bounded {
                softened.soften(problem, softness, &self.reference);
                softened.fix_bounds(&self.reference.normal);
                self.forces.copy_from(&self.reference);
                self.forces.project_onto_bounds(&softened);
                self.infer_states(&softened);
                let effort = Effort::full::<S>();
                (solved, more) = self.newton(&mut softened, system, effort, &mut |_, _| 0);
                systems += more;
            }
            if solved {
                self.forces.project_onto_bounds(&softened);
                if failed {
                    self.update_activation(problem, system, 0.0);
                }
            } else {
                self.forces.copy_from(&self.reference);
            }
            system.measure(problem, &mut self.forces);
            let is_linearised = refine(problem, &self.forces) == 0;
            let quality = self.forces.quality(problem);
            let is_unbounded = largest(&self.forces.normal) > Quality::UNBOUNDED;
            let status = match quality.status {
                Status::Solved if is_linearised => Status::Solved,
                Status::Solved => Status::Failed,
                _ if is_unbounded => Status::NoAdmissibleMotion,
                other => other,
            };
            let error = quality.residual.max(quality.friction_error);
            let gives_up = count == MAX_PROBLEMS || !solved && softness >= MAX_SOFTNESS;
            // A solution is final once the next problem does not improve it.
            let is_exact = status == Status::Solved && error < FINAL_ERROR;
            let is_final = is_exact && !failed && error >= before || is_unbounded;
            before = error;
            if has_path && !failed && error < identified {
                let (exact, extra) = self.solve_exactly(problem, system, effort, refine);
                systems += extra;
                if exact {
                    self.softened = softened;
                    return self.accept(problem, systems);
                }
                identified = IDENTIFIED_REDUCTION * error;
            }
            if is_final || gives_up {
                self.softened = softened;
                return Quality {
                    status,
                    systems,
                    ..quality
                };
            }
            softness = if !failed {
                let is_easy = more <= FEW_SYSTEMS;
                COMPLIANCE.max(softness / if is_easy { SOFTNESS_RATIO } else { ratio })
            } else if softness < MAX_SOFTNESS {
                ratio * softness
            } else {
                first
            };
        }
        unreachable!("the last problem ends the sequence")
    }

    /// Infers the active set from the current motion, with contacts as compliant as in `softened`.
    fn infer_states_of_motion(&mut self, softened: &Problem<S>) {
        let forces = &self.forces;
        let load = |k: usize| forces.normal[k] - forces.slack[k] / softened.normal[k].compliance;
        self.states.infer(softened, load, |k, entry| {
            trial_force::<S>(&forces.tangential[k], &forces.slip[k], entry.compliance)
        });
    }
}
