//! The coupled contact problem by a semismooth Newton method.
//!
//! Once it is known which contacts are closed, which stick and which slip to either side, the problem
//! is linear. Each iteration solves the linear problem of the present active set and changes what
//! the solution contradicts (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92, 353 (1991);
//! primal-dual active set: Hintermüller, Ito & Kunisch, SIAM J. Optim. 13, 865 (2002)). Started from
//! the active set of the stage before it mostly takes two to eight systems. On which contacts friction
//! is active is part of the active set. The method converges locally and superlinearly, and can cycle
//! far from a solution.
//!
//! In a suspension steps that follow one without progress are shortened until the conditions are violated
//! less than before (line search on the natural map), which ends nearly all cycles: of 320 stages of
//! 500 spheres at φ = 0.50, ν = 0.5 none fails, where 131 did. In a layer, where a slip has two
//! directions only, as many stages fail with it as without. Where the method fails,
//! [`super::proximal`] takes over.

use super::ProblemSolver;
use super::problem::{Forces, FrictionState, Problem, RoundoffThresholds, Slide, System};
use crate::space::Space;

/// Most linear systems of one call, in a layer and in a suspension. With 60 in place of 25, 200
/// spheres at φ = 0.54 take half as much time again: what has not converged by then rarely does.
const fn max_systems<S: Space>() -> u32 {
    if S::TANGENTS == 1 { 60 } else { 25 }
}
/// Iterations without fewer changes of the active set than ever before after which it has failed. With 8 in its place layers of 1000 that flow
/// take 4 % fewer linear systems, and layers of 100 at c = 0.76, ν = 1 a third more time.
const PATIENCE: u32 = 4;

/// What is to be left of the violation after a step that may be shortened. With 0.5 in its place 200
/// spheres at φ = 0.54 take 16 % more linear systems.
const PROGRESS: f64 = 0.9;
/// The least share of a step: smaller ones hardly lower the violation.
const MIN_SHARE: f64 = 1.0 / 64.0;

/// Angle by which a slip may turn once more: as the error of the next system goes with its square.
const TURNED: f64 = 1e-7;
/// Angle below which one more system is expected to be the last.
const NEARLY_TURNED: f64 = 1e-2;
/// By how much the largest angle is to fall in one system.
const TURNING: f64 = 0.5;

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

impl<S: Space> ProblemSolver<S> {
    /// Iterates from the present active set; whether it converged, and the number of systems.
    pub(super) fn newton(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        activation: FrictionActivation,
        refine: &mut impl FnMut(&mut Problem<S>, &Forces) -> usize,
    ) -> (bool, u32) {
        let (mut fewest, mut stalled, mut last) = (usize::MAX, 0, false);
        let (mut least_turn, mut before, mut shortens) = (f64::INFINITY, None, false);
        for count in 1..=max_systems::<S>() {
            shortens |= S::TANGENTS > 1 && stalled > 0;
            if shortens {
                self.previous.copy_from(&self.forces);
            }
            let solved = system.solve(problem, &self.states, last, &mut self.forces);
            let Some(roundoff) = solved else {
                return (false, count);
            };
            let least = before.filter(|_| !last && shortens);
            let (violation, is_whole) = self.shorten(problem, system, least);
            let refined = refine(problem, &self.forces);
            let (changed, turn) = self.update_states(problem, system, roundoff, is_whole);
            let activated = if activation.updates {
                self.update_activation(problem, system, activation, roundoff.force)
            } else {
                0
            };
            let contradicted = refined + changed;
            let changes = contradicted + activated;
            last = changes == 0 && turn < NEARLY_TURNED && is_whole;
            // Refined entries and other friction make it another problem.
            before = (refined + activated == 0).then_some(violation);
            if contradicted == 0 && activated > 0 {
                // That is another problem.
                (fewest, stalled, least_turn) = (usize::MAX, 0, f64::INFINITY);
            } else if changes > 0 || turn > 0.0 || !is_whole {
                let fewer = changes < fewest || changes == 0 && turn < TURNING * least_turn;
                let lowered = least.is_some_and(|least| violation < PROGRESS * least);
                stalled = if fewer || lowered { 0 } else { stalled + 1 };
                fewest = fewest.min(changes);
                least_turn = least_turn.min(turn);
                if stalled == PATIENCE {
                    return (false, count);
                }
            } else if roundoff.exact {
                return (true, count);
            }
        }
        (false, max_systems::<S>())
    }

    /// Shortens the last step to the largest of the shares 1, ½, ¼, … that leaves a smaller violation than `least`.
    ///
    /// In a layer it stays whole. Returns the violation, and whether the step is whole.
    fn shorten(
        &mut self,
        problem: &Problem<S>,
        system: &impl System<S>,
        least: Option<f64>,
    ) -> (f64, bool) {
        if S::TANGENTS == 1 {
            return (0.0, true);
        }
        let mut violation = self.forces.square_violation(problem, system);
        let mut share = 1.0;
        while least.is_some_and(|least| violation >= least) && share > MIN_SHARE {
            share *= 0.5;
            self.forces.halve_step(&self.previous);
            violation = self.forces.square_violation(problem, system);
        }
        (violation, share == 1.0)
    }

    /// Changes the states that the present forces contradict; how many, and by what angle at most slips turn that slide as before.
    ///
    /// `is_whole`: whether the forces are those of the present states, not of a shortened step.
    pub(super) fn update_states(
        &mut self,
        problem: &Problem<S>,
        system: &impl System<S>,
        roundoff: RoundoffThresholds,
        is_whole: bool,
    ) -> (usize, f64) {
        let (forces, states) = (&self.forces, &mut self.states);
        let (mut changes, mut turn) = (0, 0.0_f64);
        for (k, closed) in states.closed.iter_mut().enumerate() {
            let contradicted = if !is_whole {
                *closed != (system.mobility(k) * forces.normal[k] > forces.slack[k])
            } else if *closed {
                forces.normal[k] < -roundoff.force
            } else {
                forces.slack[k] < -roundoff.velocity
            };
            changes += usize::from(contradicted);
            *closed ^= contradicted;
        }
        for m in (0..states.friction.len()).step_by(S::TANGENTS) {
            let (row, state) = (&problem.tangential[m], states.friction[m]);
            // A bound that is given holds whether the contact is closed or not.
            let next = if !states.closed[row.contact] && row.follows_load() {
                FrictionState::Inactive
            } else if S::TANGENTS == 1 {
                next_state(problem, forces, m, state, roundoff)
            } else {
                let mobility = system.mobility(row.contact);
                let slide = (state, &mut states.slides[m / 2]);
                let (next, angle) = next_slide(problem, forces, m, slide, mobility, roundoff);
                turn = turn.max(angle);
                next
            };
            changes += usize::from(next != state);
            states.friction[m..m + S::TANGENTS].fill(next);
        }
        (changes, turn)
    }

    /// Makes friction active where the load is above the critical one by more than `roundoff`, and
    /// inactive where it is below; the number of changes.
    pub(super) fn update_activation(
        &mut self,
        problem: &mut Problem<S>,
        system: &impl System<S>,
        activation: FrictionActivation,
        roundoff: f64,
    ) -> usize {
        let mut changes = 0;
        for (k, rows) in problem.tangential.chunks_exact_mut(S::TANGENTS).enumerate() {
            let row = rows[0];
            let load = self.forces.normal[row.contact];
            let excess = load - activation.critical_load;
            let active = excess > 0.0;
            let closed = self.states.closed[row.contact];
            let keeps = closed && (excess.abs() <= roundoff || row.was_deactivated && !active);
            if row.active == active || keeps {
                continue;
            }
            for row in &mut *rows {
                row.active = active;
                row.was_deactivated |= closed && !active;
            }
            if closed {
                changes += 1;
                if active {
                    let own = system.mobility(row.contact) + row.compliance;
                    self.begin_friction(k, own, rows[0].bound(load));
                } else {
                    let m = S::TANGENTS * k;
                    self.states.friction[m..m + S::TANGENTS].fill(FrictionState::Inactive);
                }
            }
        }
        changes
    }

    /// Lets friction `k` begin to act: it slips where friction at its bound does not halt the contact, and sticks elsewhere.
    ///
    /// `own`: mobility and compliance of the contact.
    fn begin_friction(&mut self, k: usize, own: f64, bound: f64) {
        let m = S::TANGENTS * k;
        let slip = S::by_slip(&self.forces.slip)[k].as_ref();
        let trial = slip.iter().fold(0.0_f64, |sum, z| sum.hypot(*z)) / own;
        let state = match *slip {
            _ if bound <= 0.0 || trial <= bound => FrictionState::Stick,
            [x, y] => {
                self.states.slides[k] = Slide::under([x / own, y / own], trial, bound, own);
                FrictionState::SlipPositive
            }
            _ => FrictionState::slipping(slip[0]),
        };
        self.states.friction[m..m + S::TANGENTS].fill(state);
    }
}

/// What row `m` of a closed candidate does next, by the forces of its present state.
fn next_state<S: Space>(
    problem: &Problem<S>,
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

/// The same for the slip of rows `m` and `m + 1` in a suspension, by its trial force:
///
/// ```text
/// p = t + z/G       it sticks where |p| ≤ ρ, and slips along p elsewhere
/// ```
///
/// Also the angle by which the direction of a slip has turned, 0 if that is rounding.
///
/// `mobility`: G of the contact without the compliance of its friction.
fn next_slide<S: Space>(
    problem: &Problem<S>,
    forces: &Forces,
    m: usize,
    (state, slide): (FrictionState, &mut Slide),
    mobility: f64,
    roundoff: RoundoffThresholds,
) -> (FrictionState, f64) {
    use FrictionState::{Inactive, SlipPositive, Stick};
    let row = &problem.tangential[m];
    if !row.active {
        return (Inactive, 0.0);
    }
    if row.coefficient.is_infinite() {
        return (Stick, 0.0);
    }
    let own = mobility + row.compliance;
    // A contact that has just closed bears no force yet. Were it to stick at once, it could lift off again in the next
    // system, and so on.
    let load = forces.normal[row.contact].max(-forces.slack[row.contact] / mobility);
    let bound = row.slipping_force(SlipPositive, load);
    let jumps = row.intercept == 0.0;
    if !jumps && bound < -roundoff.force || state == Inactive && !jumps && bound <= roundoff.force {
        return (Inactive, 0.0);
    }
    let [t, z] = [&forces.tangential, &forces.slip].map(|list| [list[m], list[m + 1]]);
    let trial = [0, 1].map(|k| t[k] + z[k] / own);
    let length = trial[0].hypot(trial[1]);
    let rounding = roundoff.force + roundoff.velocity / own;
    let sticks = match state {
        SlipPositive => length <= bound - roundoff.velocity / own,
        _ => length <= bound + rounding,
    };
    if sticks || length == 0.0 {
        return (Stick, 0.0);
    }
    let before = *slide;
    *slide = Slide::under(trial, length, bound, own);
    if state != SlipPositive {
        return (SlipPositive, 0.0);
    }
    let [along, across] = before.turned(slide.direction);
    let angle = across.atan2(along).abs();
    let is_rounding = angle <= TURNED || angle * length <= rounding;
    if is_rounding {
        *slide = before;
    }
    (SlipPositive, if is_rounding { 0.0 } else { angle })
}
