//! The coupled contact problem by a semismooth Newton method.
//!
//! Once it is known which contacts are closed, which stick and which slip to either side, the problem
//! is linear. Each iteration solves the linear problem of the present active set and changes what
//! the solution contradicts (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92, 353 (1991);
//! primal-dual active set: Hintermüller, Ito & Kunisch, SIAM J. Optim. 13, 865 (2002)). Started from
//! the active set of the stage before it mostly takes two to eight systems. It converges locally
//! and superlinearly, and can cycle far from a solution: then [`super::proximal`] takes over.

use super::ProblemSolver;
use super::problem::{Forces, FrictionState, Problem, RoundoffThresholds, System};

/// Iterations at most.
const MAX_SYSTEMS: u32 = 60;
/// Iterations without fewer changes of the active set than ever before after which it has failed.
const PATIENCE: u32 = 4;

/// When friction becomes active.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FrictionActivation {
    /// Load above which friction is active.
    pub(crate) critical_load: f64,
    /// Whether the set of contacts with active friction may change. Where the law does not jump at
    /// the critical load it never does: friction is active on all, and the bound says how much.
    pub(crate) updates: bool,
}

impl FrictionActivation {
    /// Where bounds are given, no load decides.
    pub(crate) const GIVEN: Self = Self {
        critical_load: 0.0,
        updates: false,
    };
}

impl ProblemSolver {
    /// Iterates from the present active set; whether it converged, and the number of systems.
    pub(super) fn newton(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        activation: FrictionActivation,
        refine: &mut impl FnMut(&mut Problem, &Forces) -> usize,
    ) -> (bool, u32) {
        let (mut fewest, mut stalled, mut last) = (usize::MAX, 0, false);
        for count in 1..=MAX_SYSTEMS {
            let solved = system.solve(problem, &self.states, last, &mut self.forces);
            let Some(roundoff) = solved else {
                return (false, count);
            };
            let changes = refine(problem, &self.forces) + self.update_states(problem, roundoff);
            last = changes == 0;
            if !last {
                stalled = if changes < fewest { 0 } else { stalled + 1 };
                fewest = fewest.min(changes);
                if stalled == PATIENCE {
                    return (false, count);
                }
                continue;
            }
            if !roundoff.exact {
                continue;
            }
            if !activation.updates
                || self.update_activation(problem, activation, roundoff.force) == 0
            {
                return (true, count);
            }
            // That is another problem.
            (fewest, stalled, last) = (usize::MAX, 0, false);
        }
        (false, MAX_SYSTEMS)
    }

    /// Changes the states that the present forces contradict; how many.
    fn update_states(&mut self, problem: &Problem, roundoff: RoundoffThresholds) -> usize {
        let (forces, states) = (&self.forces, &mut self.states);
        let mut changes = 0;
        for (k, closed) in states.closed.iter_mut().enumerate() {
            let contradicted = if *closed {
                forces.normal[k] < -roundoff.force
            } else {
                forces.slack[k] < -roundoff.velocity
            };
            changes += usize::from(contradicted);
            *closed ^= contradicted;
        }
        for (m, state) in states.friction.iter_mut().enumerate() {
            let row = &problem.tangential[m];
            // A bound that is given holds whether the contact is closed or not.
            let next = if states.closed[row.contact] || !row.follows_load() {
                next_state(problem, forces, m, *state, roundoff)
            } else {
                FrictionState::Inactive
            };
            changes += usize::from(next != *state);
            *state = next;
        }
        changes
    }

    /// Makes friction active where the load is above the critical one by more than `roundoff`, and
    /// inactive where it is below; the number of changes.
    pub(super) fn update_activation(
        &mut self,
        problem: &mut Problem,
        activation: FrictionActivation,
        roundoff: f64,
    ) -> usize {
        let mut changes = 0;
        for (m, row) in problem.tangential.iter_mut().enumerate() {
            let excess = self.forces.normal[row.contact] - activation.critical_load;
            let active = excess > 0.0;
            let closed = self.states.closed[row.contact];
            let keeps = closed && (excess.abs() <= roundoff || row.was_deactivated && !active);
            if row.active == active || keeps {
                continue;
            }
            row.active = active;
            if closed {
                row.was_deactivated |= !active;
                changes += 1;
                self.states.friction[m] = if active {
                    FrictionState::Stick
                } else {
                    FrictionState::Inactive
                };
            }
        }
        changes
    }
}

/// What row `m` of a closed candidate does next, by the forces of its present state.
fn next_state(
    problem: &Problem,
    forces: &Forces,
    m: usize,
    state: FrictionState,
    roundoff: RoundoffThresholds,
) -> FrictionState {
    use FrictionState::{Inactive, SlipNegative, SlipPositive, Stick};
    let row = &problem.tangential[m];
    if !row.active {
        return Inactive;
    }
    let (t, z) = (forces.tangential[m], forces.slip[m]);
    let load = forces.normal[row.contact];
    let bound = row.slipping_force(SlipPositive, load);
    let jumps = row.intercept == 0.0;
    match state {
        // Without an intercept a contact that has just closed sticks; with one it slips as it did.
        Inactive if jumps => Stick,
        Inactive if bound > roundoff.force => FrictionState::slipping(z),
        Inactive => Inactive,
        _ if !jumps && bound < -roundoff.force => Inactive,
        Stick if t.abs() > bound + roundoff.force => FrictionState::slipping(t),
        SlipPositive if z < -roundoff.velocity => Stick,
        SlipNegative if z > roundoff.velocity => Stick,
        same => same,
    }
}
