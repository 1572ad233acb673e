//! A path from given forces to the solution of a problem in a layer.
//!
//! Forces within their bounds solve the problem with other constants, by which their slack and slip
//! are off. These differences are reduced from their full amount, θ = 1, to nothing:
//!
//! ```text
//! w = C v + b + κ f + θ β          z = D v + d − μ t + θ γ
//! ```
//!
//! In a layer the problem is piecewise linear, so forces depend on θ along a chain of straight
//! pieces. Each piece ends where one condition of the active set becomes an equality; that state
//! changes, and the next piece begins. Where θ would have to increase, it does: the path passes
//! folds, at which Newton's method cycles between states (Lemke, Manag. Sci. 11, 681 (1965)).

use super::ProblemSolver;
use super::statement::{
    FORCE_ROUNDOFF, Forces, FrictionState, Problem, Slide, States, System, largest,
};
use crate::space::Space;

/// Maximum number of pieces while friction is active on the same contacts. Paths that are longer
/// often return to their start: with 60 instead of 20, 50 spheres at c = 0.76 and 0.80 require a
/// quarter more linear systems.
const MAX_PIECES: u32 = 20;
/// Maximum number of changes of the set of contacts with active friction.
const MAX_ACTIVATIONS: u32 = 12;
/// Largest θ.
const MAX_SHARE: f64 = 1e3;

/// The differences β and γ.
#[derive(Default)]
pub(super) struct Differences {
    normal: Vec<f64>,
    friction: Vec<f64>,
}

/// A condition of the active set.
#[derive(Clone, Copy, PartialEq)]
enum Condition {
    /// A closed candidate has a force, an open one a gap that opens.
    Normal(usize),
    /// Friction is below its bound in the direction of this sign, or slips in its own direction.
    Friction(usize, f64),
    /// A bound with an intercept is positive where there is friction, negative where there is none.
    Bound(usize),
}

impl<S: Space> ProblemSolver<S> {
    /// Follows the path from the current forces, which are within their bounds, and the active set
    /// inferred from them. Returns whether it ended at a solution, and the number of linear
    /// systems.
    pub(super) fn follow_path(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
    ) -> (bool, u32) {
        let mut differences = std::mem::take(&mut self.differences);
        let (mut systems, mut solved) = (0, false);
        for _ in 0..MAX_ACTIVATIONS {
            differences.set(&self.forces, &self.states);
            let (reached, more) = self.follow(problem, system, &differences);
            systems += more;
            if !reached {
                break;
            }
            if !self.reactivate(problem, system) {
                solved = true;
                break;
            }
        }
        self.differences = differences;
        (solved, systems)
    }

    /// Activates and deactivates friction by the current loads, so that the forces satisfy the
    /// conditions of friction; returns whether any changed.
    fn reactivate(&mut self, problem: &mut Problem<S>, system: &mut impl System<S>) -> bool {
        let roundoff = FORCE_ROUNDOFF * largest(&self.forces.normal);
        if self.update_activation(problem, system, roundoff) == 0 {
            return false;
        }
        let mut vanishes = false;
        let states = self.states.friction.iter_mut().zip(&problem.friction);
        for ((state, entry), t) in states.zip(&mut self.forces.tangential) {
            let has_force = t[0] != 0.0;
            if !entry.active {
                vanishes |= has_force;
                *t = S::each_tangent(0.0);
            } else if !has_force && matches!(state, FrictionState::Slip(_)) {
                *state = FrictionState::Stick;
            }
        }
        if vanishes {
            system.measure(problem, &mut self.forces);
        }
        true
    }

    /// Follows the path while friction is active on the same contacts.
    fn follow(
        &mut self,
        problem: &Problem<S>,
        system: &mut impl System<S>,
        differences: &Differences,
    ) -> (bool, u32) {
        let (mut share, mut entering) = (1.0, None);
        for count in 1..=MAX_PIECES {
            self.previous.copy_from(&self.forces);
            if system
                .solve(problem, &self.states, false, &mut self.forces)
                .is_none()
            {
                return (false, count);
            }
            let value = |condition: Condition| {
                let [from, to] = [(&self.previous, share), (&self.forces, 0.0)];
                [from, to].map(|(forces, share)| {
                    value(condition, problem, forces, &self.states, share, differences)
                })
            };
            // The condition of the state that has just changed must come to hold.
            let sense = entering.map_or(1.0, |condition| {
                let [from, to] = value(condition);
                if to >= from { 1.0 } else { -1.0 }
            });
            let (mut first, mut steepest, mut next) = (f64::INFINITY, 0.0, None);
            for_each_condition(problem, &self.states, |condition| {
                let [from, to] = value(condition);
                let rate = sense * (to - from);
                if rate < 0.0 && entering != Some(condition) {
                    let step = from.max(0.0) / -rate;
                    if step < first || step == first && -rate > steepest {
                        (first, steepest, next) = (step, -rate, Some(condition));
                    }
                }
            });
            if sense > 0.0 && first >= 1.0 {
                return (true, count);
            }
            let Some(next) = next else {
                return (false, count);
            };
            self.forces.scale_step(&self.previous, sense * first);
            share *= 1.0 - sense * first;
            if share > MAX_SHARE {
                return (false, count);
            }
            entering = Some(self.cross(problem, next, share, differences));
        }
        (false, MAX_PIECES)
    }

    /// Changes the state whose condition is an equality. Returns the condition of the new one.
    fn cross(
        &mut self,
        problem: &Problem<S>,
        condition: Condition,
        share: f64,
        differences: &Differences,
    ) -> Condition {
        let slip = |k: usize| self.forces.slip[k][0] + share * differences.friction[k];
        match condition {
            Condition::Normal(k) => {
                let closed = &mut self.states.closed[k];
                *closed = !*closed;
                for (m, entry) in problem.friction.iter().enumerate() {
                    if entry.contact == k && entry.active && entry.intercept == 0.0 {
                        self.states.friction[m] = if *closed {
                            slide(slip(m))
                        } else {
                            FrictionState::Inactive
                        };
                    }
                }
                condition
            }
            Condition::Friction(m, sign) => {
                let state = &mut self.states.friction[m];
                if let FrictionState::Slip(slide) = state {
                    let sign = slide.direction[0];
                    *state = FrictionState::Stick;
                    Condition::Friction(m, sign)
                } else {
                    *state = slide(sign);
                    condition
                }
            }
            Condition::Bound(m) => {
                let state = &mut self.states.friction[m];
                *state = if matches!(state, FrictionState::Inactive) {
                    slide(slip(m))
                } else {
                    FrictionState::Inactive
                };
                condition
            }
        }
    }
}

/// A slide towards a sign.
fn slide<S: Space>(sign: f64) -> FrictionState<S> {
    let direction = S::each_tangent(if sign < 0.0 { -1.0 } else { 1.0 });
    FrictionState::Slip(Slide {
        direction,
        compliance: 0.0,
    })
}

impl Differences {
    /// Those by which the conditions of the active set are not satisfied.
    fn set<S: Space>(&mut self, forces: &Forces<S>, states: &States<S>) {
        self.normal.clear();
        let slack = forces.slack.iter().zip(&states.closed);
        self.normal
            .extend(slack.map(|(w, closed)| if *closed { -w } else { (-w).max(0.0) }));
        self.friction.clear();
        let slip = forces.slip.iter().zip(&states.friction);
        self.friction.extend(slip.map(|(z, state)| match state {
            FrictionState::Inactive => 0.0,
            FrictionState::Stick => -z[0],
            FrictionState::Slip(slide) => slide.direction[0] * (-slide.rotate(z)[0]).max(0.0),
        }));
    }
}

/// How far a condition is from an equality; positive where it holds.
fn value<S: Space>(
    condition: Condition,
    problem: &Problem<S>,
    forces: &Forces<S>,
    states: &States<S>,
    share: f64,
    differences: &Differences,
) -> f64 {
    let bound = |m: usize| {
        let entry = &problem.friction[m];
        entry.slipping_force(forces.normal[entry.contact])
    };
    match condition {
        Condition::Normal(k) if states.closed[k] => forces.normal[k],
        Condition::Normal(k) => forces.slack[k] + share * differences.normal[k],
        Condition::Friction(m, sign) => match &states.friction[m] {
            FrictionState::Slip(slide) => {
                slide.direction[0] * (forces.slip[m][0] + share * differences.friction[m])
            }
            _ => bound(m) - sign * forces.tangential[m][0],
        },
        Condition::Bound(m) => match &states.friction[m] {
            FrictionState::Inactive => -bound(m),
            _ => bound(m),
        },
    }
}

/// Calls `visit` with all conditions of the active set.
fn for_each_condition<S: Space>(
    problem: &Problem<S>,
    states: &States<S>,
    mut visit: impl FnMut(Condition),
) {
    for k in 0..states.closed.len() {
        visit(Condition::Normal(k));
    }
    for (m, (entry, state)) in problem.friction.iter().zip(&states.friction).enumerate() {
        if !entry.active || !states.closed[entry.contact] {
            continue;
        }
        match state {
            FrictionState::Inactive => {}
            FrictionState::Stick => {
                visit(Condition::Friction(m, 1.0));
                visit(Condition::Friction(m, -1.0));
            }
            FrictionState::Slip(_) => visit(Condition::Friction(m, 1.0)),
        }
        if entry.intercept != 0.0 {
            visit(Condition::Bound(m));
        }
    }
}
