//! A semismooth Newton method for the coupled contact problem.
//!
//! For a given active set (which contacts are closed, which stick, and in which direction the
//! others slip) the problem is linear. Each iteration solves this linear problem and updates the
//! active set where the solution contradicts it (Alart & Curnier, Comput. Methods Appl. Mech. Eng.
//! 92, 353 (1991); primal-dual active set: Hintermüller, Ito & Kunisch, SIAM J. Optim. 13, 865
//! (2002)). Started from the active set of the preceding stage, the method usually requires two to
//! eight linear systems. The set of contacts with active friction is part of the active set.
//! Convergence is local and superlinear; far from a solution the method can cycle.
//!
//! In a suspension, steps are shortened after a step without progress, until the violation of the
//! conditions decreases (a line search on the natural map). This ends nearly all cycles: of 320
//! stages of 500 spheres at φ = 0.50 and ν = 0.5 none fails, where 131 fail without it. In a layer,
//! where slip has only two directions, it does not reduce the number of failures. There, two kinds
//! of failure are typical: two contacts that stick and slip in turn, each because the other one
//! changes too; and a few changes that together make the next system nearly singular, after which
//! most states change. A selective iteration therefore changes only the states with the largest
//! contradictions after an iteration without progress. Where the method fails, [`super::proximal`]
//! takes over.

use super::ProblemSolver;
use super::statement::{
    Forces, Friction, FrictionState, Problem, RoundoffThresholds, Slide, System, trial_force,
};
use crate::space::Space;

/// Maximum number of linear systems of one call, in a layer and in a suspension. With 60 instead of
/// 25, 200 spheres at φ = 0.54 take 1.5 times as long: what has not converged by then rarely does.
const fn max_systems<S: Space>() -> u32 {
    if S::TANGENTS == 1 { 60 } else { 25 }
}
/// Maximum number of linear systems of the first call where rigid contacts in a layer have
/// tangential springs. With 60 instead of 12, and paths of up to 60 pieces, 50 spheres at c = 0.76
/// and 0.80 require a quarter more.
const MAX_FIRST_SYSTEMS: u32 = 12;
/// Number of iterations without progress after which the method has failed; progress is a new
/// minimum of changes to the active set. With 8 instead of 4, flowing layers of 1000 spheres
/// require 4 % fewer linear systems, but layers of 100 at c = 0.76 and ν = 1 take a third longer.
const MAX_STALLED: u32 = 4;
/// In a selective iteration without progress, states change whose contradiction is at least this
/// share of the largest one. With 0.3 or 0.7 instead of 0.5 the number of systems of 50 spheres at
/// c = 0.76 changes by one per cent.
const LEAST_SHARE: f64 = 0.5;

/// Largest fraction of the violation that may remain after a step that counts as progress. With 0.5
/// instead of 0.9, 200 spheres at φ = 0.54 require 16 % more linear systems.
const VIOLATION_REDUCTION: f64 = 0.9;
/// Minimum fraction of a step: smaller fractions hardly reduce the violation.
const MIN_STEP_FRACTION: f64 = 1.0 / 64.0;

/// Angle, in radians, below which a change of slip direction is accepted: the error of the next
/// system is proportional to its square.
const ANGLE_TOLERANCE: f64 = 1e-7;
/// Angle below which the next linear system is expected to be the last.
const NEAR_CONVERGENCE_ANGLE: f64 = 1e-2;
/// Factor by which the largest angle must decrease in one iteration.
const ANGLE_REDUCTION: f64 = 0.5;

/// How far the iteration is carried.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    /// Maximum number of linear systems.
    max_systems: u32,
    /// Whether only the largest contradictions are changed after an iteration without progress;
    /// only where slip has one component.
    is_selective: bool,
}

impl Effort {
    /// For a problem whose softened forms can be solved along a path.
    pub(super) const FIRST: Self = Self {
        max_systems: MAX_FIRST_SYSTEMS,
        is_selective: false,
    };

    pub(super) const fn full<S: Space>() -> Self {
        Self {
            max_systems: max_systems::<S>(),
            is_selective: false,
        }
    }

    pub(super) const fn selective<S: Space>() -> Self {
        Self {
            is_selective: true,
            ..Self::full::<S>()
        }
    }
}

impl<S: Space> ProblemSolver<S> {
    /// Iterates from the current active set. Returns whether it converged, and the number of linear
    /// systems.
    pub(super) fn newton(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        effort: Effort,
        refine: &mut impl FnMut(&mut Problem<S>, &Forces<S>) -> usize,
    ) -> (bool, u32) {
        let (mut fewest, mut stalled, mut last) = (usize::MAX, 0, false);
        let mut fewest_activated = usize::MAX;
        let (mut smallest_rotation, mut comparable, mut shortens) = (f64::INFINITY, None, false);
        for count in 1..=effort.max_systems {
            shortens |= S::TANGENTS > 1 && stalled > 0;
            if shortens {
                self.previous.copy_from(&self.forces);
            }
            let solved = system.solve(problem, &self.states, last, &mut self.forces);
            let Some(roundoff) = solved else {
                return (false, count);
            };
            let previous_violation = comparable.filter(|_| !last && shortens);
            let (violation, is_full_step) = self.backtrack(problem, system, previous_violation);
            let refined = refine(problem, &self.forces);
            let least = if effort.is_selective && stalled > 0 {
                LEAST_SHARE * self.largest_excess(problem, system, roundoff)
            } else {
                0.0
            };
            let (changed, rotation) =
                self.update_states(problem, system, roundoff, is_full_step, least);
            let activated = self.update_activation(problem, system, roundoff.force);
            let contradicted = refined + changed;
            let changes = contradicted + activated;
            last = changes == 0 && rotation < NEAR_CONVERGENCE_ANGLE && is_full_step;
            // Changed coefficients or activation define a different problem, whose violations
            // cannot be compared.
            comparable = (refined + activated == 0).then_some(violation);
            let settles = !effort.is_selective || activated < fewest_activated;
            if contradicted == 0 && activated > 0 && settles {
                fewest_activated = activated;
                // A changed activation defines a different problem: progress is reset. Contacts can
                // gain and lose friction in turn, so a selective iteration resets it only while
                // fewer of them do.
                (fewest, stalled, smallest_rotation) = (usize::MAX, 0, f64::INFINITY);
            } else if changes > 0 || rotation > 0.0 || !is_full_step {
                let fewer = changes < fewest
                    || changes == 0 && rotation < ANGLE_REDUCTION * smallest_rotation;
                let lowered = previous_violation
                    .is_some_and(|previous| violation < VIOLATION_REDUCTION * previous);
                stalled = if fewer || lowered { 0 } else { stalled + 1 };
                fewest = fewest.min(changes);
                smallest_rotation = smallest_rotation.min(rotation);
                if stalled == MAX_STALLED {
                    return (false, count);
                }
            } else if roundoff.exact {
                return (true, count);
            }
        }
        (false, effort.max_systems)
    }

    /// Shortens the last step to the largest of the fractions 1, ½, ¼, … at which the violation is
    /// below `previous_violation`.
    ///
    /// Where slip has one component the step is not shortened. Returns the violation, and whether
    /// the step is complete.
    fn backtrack(
        &mut self,
        problem: &Problem<S>,
        system: &impl System<S>,
        previous_violation: Option<f64>,
    ) -> (f64, bool) {
        if S::TANGENTS == 1 {
            return (0.0, true);
        }
        let mut violation = self.forces.square_violation(problem, system);
        let mut fraction = 1.0;
        while previous_violation.is_some_and(|previous| violation >= previous)
            && fraction > MIN_STEP_FRACTION
        {
            fraction *= 0.5;
            self.forces.halve_step(&self.previous);
            violation = self.forces.square_violation(problem, system);
        }
        (violation, fraction == 1.0)
    }

    /// Updates the states that the current forces contradict. Returns their number, and the largest
    /// angle by which the direction of a slide changed.
    ///
    /// `is_full_step`: whether the forces solve the linear problem of the current states, i.e. the
    /// step was not shortened. `least`: the smallest contradiction, as a force, that changes a
    /// state in a selective iteration; smaller ones are counted.
    pub(super) fn update_states(
        &mut self,
        problem: &Problem<S>,
        system: &impl System<S>,
        roundoff: RoundoffThresholds,
        is_full_step: bool,
        least: f64,
    ) -> (usize, f64) {
        let (forces, states) = (&self.forces, &mut self.states);
        let (mut changes, mut rotation) = (0, 0.0_f64);
        for (k, closed) in states.closed.iter_mut().enumerate() {
            let contradicted = if !is_full_step {
                *closed != (system.mobility(k) * forces.normal[k] > forces.slack[k])
            } else if *closed {
                forces.normal[k] < -roundoff.force
            } else {
                forces.slack[k] < -roundoff.velocity
            };
            changes += usize::from(contradicted);
            let waits = least > 0.0 && normal_excess(forces, k, *closed, system) < least;
            *closed ^= contradicted && !waits;
        }
        let entries = problem.friction.iter().zip(&mut states.friction);
        for (k, (entry, state)) in entries.enumerate() {
            // A fixed bound applies whether the contact is closed or open.
            let next = if !states.closed[entry.contact] && entry.follows_load() {
                FrictionState::Inactive
            } else if S::TANGENTS == 1 {
                next_state(entry, forces, k, *state, roundoff)
            } else {
                let mobility = system.mobility(entry.contact);
                let (next, angle) = next_slide(entry, forces, k, *state, mobility, roundoff);
                rotation = rotation.max(angle);
                next
            };
            let differs = next.differs_from(state);
            changes += usize::from(differs);
            let waits = differs
                && least > 0.0
                && friction_excess(entry, forces, k, [state, &next], system) < least;
            if !waits {
                *state = next;
            }
        }
        (changes, rotation)
    }

    /// The largest contradiction of a state that need not change at once, as a force, in a layer.
    fn largest_excess(
        &self,
        problem: &Problem<S>,
        system: &impl System<S>,
        roundoff: RoundoffThresholds,
    ) -> f64 {
        let (forces, states) = (&self.forces, &self.states);
        let closed = states.closed.iter().enumerate();
        let normal = closed.map(|(k, closed)| normal_excess(forces, k, *closed, system));
        let entries = problem.friction.iter().zip(&states.friction).enumerate();
        let friction = entries.map(|(k, (entry, state))| {
            let next = next_state(entry, forces, k, *state, roundoff);
            if next.differs_from(state) {
                friction_excess(entry, forces, k, [state, &next], system)
            } else {
                0.0
            }
        });
        let excesses = normal.chain(friction.filter(|excess| excess.is_finite()));
        excesses.fold(0.0, f64::max)
    }

    /// Activates friction where the load exceeds the critical load by more than `roundoff`, and
    /// deactivates it where the load is below; returns the number of changes. A fixed activation is
    /// left as it is.
    pub(super) fn update_activation(
        &mut self,
        problem: &mut Problem<S>,
        system: &impl System<S>,
        roundoff: f64,
    ) -> usize {
        let Some(critical_load) = problem.critical_load else {
            return 0;
        };
        let mut changes = 0;
        let states = self.states.friction.iter_mut().zip(&self.forces.slip);
        for (entry, (state, slip)) in problem.friction.iter_mut().zip(states) {
            let load = self.forces.normal[entry.contact];
            let excess = load - critical_load;
            let active = excess > 0.0;
            let closed = self.states.closed[entry.contact];
            let keeps = closed && (excess.abs() <= roundoff || entry.was_deactivated && !active);
            if entry.active == active || keeps {
                continue;
            }
            entry.active = active;
            entry.was_deactivated |= closed && !active;
            if closed {
                changes += 1;
                *state = if active {
                    let self_mobility = system.mobility(entry.contact) + entry.compliance;
                    activated(slip, self_mobility, entry.bound(load))
                } else {
                    FrictionState::Inactive
                };
            }
        }
        changes
    }
}

/// By how much a candidate's state is contradicted, as a force.
fn normal_excess<S: Space>(
    forces: &Forces<S>,
    k: usize,
    closed: bool,
    system: &impl System<S>,
) -> f64 {
    if closed {
        -forces.normal[k]
    } else {
        -forces.slack[k] / system.mobility(k)
    }
}

/// By how much the state of friction force `k` in a layer is contradicted, as a force; infinite
/// where there can be no friction, or was none.
fn friction_excess<S: Space>(
    entry: &Friction<S>,
    forces: &Forces<S>,
    k: usize,
    [state, next]: [&FrictionState<S>; 2],
    system: &impl System<S>,
) -> f64 {
    match (state, next) {
        (FrictionState::Stick, FrictionState::Slip(_)) => {
            S::length(&forces.tangential[k]) - entry.slipping_force(forces.normal[entry.contact])
        }
        (FrictionState::Slip(slide), FrictionState::Stick) => {
            let self_mobility = system.mobility(entry.contact) + entry.compliance;
            -slide.rotate(&forces.slip[k])[0] / self_mobility
        }
        _ => f64::INFINITY,
    }
}

/// The state of friction that becomes active: it slips where friction at its bound does not stop
/// the slip, and sticks elsewhere.
///
/// `self_mobility`: mobility plus compliance of the contact.
fn activated<S: Space>(
    slip: &S::PerTangent<f64>,
    self_mobility: f64,
    bound: f64,
) -> FrictionState<S> {
    let length = S::length(slip) / self_mobility;
    if bound <= 0.0 || length <= bound {
        return FrictionState::Stick;
    }
    let trial = trial_force::<S>(&S::each_tangent(0.0), slip, self_mobility);
    FrictionState::Slip(Slide::from_trial(&trial, length, bound, self_mobility))
}

/// The next state of friction force `k` of a closed candidate in a layer, from the forces of its
/// current state.
fn next_state<S: Space>(
    entry: &Friction<S>,
    forces: &Forces<S>,
    k: usize,
    state: FrictionState<S>,
    roundoff: RoundoffThresholds,
) -> FrictionState<S> {
    use FrictionState::{Inactive, Slip, Stick};
    if !entry.active {
        return Inactive;
    }
    let (t, z) = (&forces.tangential[k], &forces.slip[k]);
    let bound = entry.slipping_force(forces.normal[entry.contact]);
    let slips = |towards: &S::PerTangent<f64>| {
        Slip(Slide::from_trial(towards, S::length(towards), bound, 0.0))
    };
    let jumps = entry.intercept == 0.0;
    match state {
        // Without an intercept a contact that has just closed sticks first; with one it slips in
        // its current direction.
        Inactive if jumps => Stick,
        Inactive if bound > roundoff.force => slips(z),
        Inactive => Inactive,
        _ if !jumps && bound < -roundoff.force => Inactive,
        Stick if S::length(t) > bound + roundoff.force => slips(t),
        Slip(slide) if slide.rotate(z)[0] < -roundoff.velocity => Stick,
        same => same,
    }
}

/// The next state of friction force `k` in a suspension, from its trial force:
///
/// ```text
/// p = t + z/G       sticks where |p| ≤ ρ, slips along p elsewhere
/// ```
///
/// Also returns the angle by which the direction of a slide changed, 0 if it is rounding error.
///
/// `mobility`: G of the contact without the compliance of its friction.
fn next_slide<S: Space>(
    entry: &Friction<S>,
    forces: &Forces<S>,
    k: usize,
    state: FrictionState<S>,
    mobility: f64,
    roundoff: RoundoffThresholds,
) -> (FrictionState<S>, f64) {
    use FrictionState::{Inactive, Slip, Stick};
    if !entry.active {
        return (Inactive, 0.0);
    }
    if entry.coefficient.is_infinite() {
        return (Stick, 0.0);
    }
    let self_mobility = mobility + entry.compliance;
    // A contact that has just closed has no force yet. If it stuck at once, it could open again in
    // the next system, and the method could cycle.
    let load = forces.normal[entry.contact].max(-forces.slack[entry.contact] / mobility);
    let bound = entry.slipping_force(load);
    let vanishes = match state {
        Inactive => bound <= roundoff.force,
        _ => bound < -roundoff.force,
    };
    if entry.intercept != 0.0 && vanishes {
        return (Inactive, 0.0);
    }
    let trial = trial_force::<S>(&forces.tangential[k], &forces.slip[k], self_mobility);
    let length = S::length(&trial);
    let rounding = roundoff.force + roundoff.velocity / self_mobility;
    let sticks = match state {
        Slip(_) => length <= bound - roundoff.velocity / self_mobility,
        _ => length <= bound + rounding,
    };
    if sticks || length == 0.0 {
        return (Stick, 0.0);
    }
    let slide = Slide::from_trial(&trial, length, bound, self_mobility);
    let Slip(before) = state else {
        return (Slip(slide), 0.0);
    };
    let rotated = before.rotate(&slide.direction);
    let [along, across] = *rotated.as_ref() else {
        return (Slip(slide), 0.0);
    };
    let angle = across.atan2(along).abs();
    if angle <= ANGLE_TOLERANCE || angle * length <= rounding {
        (state, 0.0)
    } else {
        (Slip(slide), angle)
    }
}
