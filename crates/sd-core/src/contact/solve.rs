//! The one contact problem, and its solution.
//!
//! Unknown are the velocities v, the normal forces f and the friction t of the candidate pairs; C and D
//! are the rows that read v_n and u_t off v, b and d what the background, gaps and springs add:
//!
//! ```text
//! R_FU v = F + Cᵀ f − Dᵀ t
//! normal      f ≥ 0,  w = C v + b + κ f ≥ 0,  f·w = 0
//! tangential  |t| ≤ ρ(f);   z = D v + d − μ t;   z = 0 inside the bound,  z > 0 only where t = ρ,  z < 0 only where t = −ρ
//! ```
//!
//! | law | κ | μ | ρ(f) |
//! | --- | --- | --- | --- |
//! | rigid | 0 | | |
//! | spring of stiffness k, over the time ahead s | 1/(k s); Hertz: its slope, iterated | | |
//! | roll-slip | | 1/K, D reads the motion that normal forces alone leave | ν f |
//! | coulomb | | 0 | ν f |
//! | stick-slide with springs k_t | | 1/(k_t s), d holds the stretch | ν f |
//! | stick-rotate | | 0, a second row for the spin | no bound |
//!
//! In a suspension slip and friction are vectors across the line of centres, |t| their length, and z = λ t with λ ≥ 0 at the bound.
//!
//! with f − F_crit in place of f for the reduced onset, and ρ = 0 where friction is not active.
//!
//! Two steps solve it: [`newton`] on the coupled problem, and where that does not converge [`proximal`]. The linear
//! algebra behind both is [`dense`] in small layers and [`sparse`] in large ones.

pub(crate) mod dense;
pub(crate) mod newton;
pub(crate) mod problem;
pub(crate) mod proximal;
pub(crate) mod sparse;

#[cfg(test)]
mod tests;

use super::Status;
use crate::space::{Layer, Space};
use newton::FrictionActivation;
use problem::{Forces, Problem, RoundoffThresholds, States, System, Violation};

/// What came of a contact problem.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Outcome {
    pub(crate) status: Status,
    /// By how much the present forces violate the conditions.
    pub(crate) violation: Violation,
    /// Linear systems solved.
    pub(crate) systems: u32,
}

/// Active set, forces and workspace of a contact problem.
#[derive(Default)]
pub(crate) struct ProblemSolver<S: Space = Layer> {
    /// The active set.
    pub(crate) states: States,
    /// The present forces.
    pub(crate) forces: Forces,
    /// Forces to start from; of each row whether friction was active, and whether it had been deactivated.
    start: Forces,
    /// Forces before the last step of Newton's method.
    previous: Forces,
    active: Vec<(bool, bool)>,
    /// Of the proximal point method: the problem with softer contacts, the forces about which they
    /// are soft, the problem with bounds that are held.
    softer: Problem<S>,
    about: Forces,
    held: Problem<S>,
}

impl<S: Space> ProblemSolver<S> {
    /// Room for that many candidates.
    pub(crate) fn reserve(&mut self, candidates: usize) {
        self.states.reserve(candidates);
        self.active.reserve(2 * S::TANGENTS * candidates);
        self.forces.reserve(candidates);
        self.start.reserve(candidates);
        self.previous.reserve(candidates);
        self.softer.reserve(candidates);
        self.about.reserve(candidates);
        self.held.reserve(candidates);
    }

    /// Solves from the present active set and forces, which are then those of the solution or of the best found.
    ///
    /// `refine`: called after every system with problem and forces, for entries that depend on the solution; how many changed.
    pub(crate) fn solve(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        activation: FrictionActivation,
        mut refine: impl FnMut(&mut Problem<S>, &Forces) -> usize,
    ) -> Outcome {
        self.start.copy_from(&self.forces);
        self.keep_activation(problem);
        if S::TANGENTS > 1 && system.read_motion(problem, &mut self.forces) {
            // The motion before says along which directions contacts slip.
            self.update_states(problem, system, RoundoffThresholds::NONE, false);
        }
        let (converged, systems) = self.newton(problem, system, activation, &mut refine);
        if converged {
            return self.accept(problem, system, systems);
        }
        self.restore_activation(problem);
        self.forces.copy_from(&self.start);
        self.read_states(problem);
        let outcome = self.solve_proximal(problem, system, activation, &mut refine);
        Outcome {
            systems: systems + outcome.systems,
            ..outcome
        }
    }

    /// The outcome of a solution: its forces are brought into their bounds.
    fn accept(&mut self, problem: &Problem<S>, system: &impl System<S>, systems: u32) -> Outcome {
        self.forces.project_onto_bounds(problem);
        let violation = self.forces.violation(problem, system);
        Outcome {
            status: violation.status(),
            violation,
            systems,
        }
    }

    /// Notes on which rows friction is active.
    fn keep_activation(&mut self, problem: &Problem<S>) {
        self.active.clear();
        let rows = problem.tangential.iter();
        self.active
            .extend(rows.map(|row| (row.active, row.was_deactivated)));
    }

    /// Makes friction active where it was noted: an active set that cycled says little about loads.
    fn restore_activation(&self, problem: &mut Problem<S>) {
        for (row, &noted) in problem.tangential.iter_mut().zip(&self.active) {
            (row.active, row.was_deactivated) = noted;
        }
    }

    /// The active set that the present forces show.
    pub(crate) fn read_states(&mut self, problem: &Problem<S>) {
        let (forces, states) = (&self.forces, &mut self.states);
        states.closed.clear();
        states.closed.extend(forces.normal.iter().map(|&f| f > 0.0));
        states.clear_friction();
        let slips = S::by_slip(&forces.tangential).iter();
        for (t, rows) in slips.zip(problem.tangential.chunks_exact(S::TANGENTS)) {
            let bound = rows[0].bound(forces.normal[rows[0].contact]);
            states.push_friction::<S>(t, bound);
        }
    }
}
