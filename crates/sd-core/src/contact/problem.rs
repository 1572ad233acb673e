//! The contact problem and its solution.
//!
//! The unknowns are the velocities v and the normal forces f and friction forces t of the candidate
//! pairs. C and D are the matrices whose rows give v_n and u_t from v; b and d are the
//! contributions of the background, the gaps and the springs:
//!
//! ```text
//! R_FU v = F + Cᵀ f − Dᵀ t
//! normal      f ≥ 0,  w = C v + b + κ f ≥ 0,  f·w = 0
//! tangential  |t| ≤ ρ(f);   z = D v + d − μ t;
//!             z = 0 for |t| < ρ,  z > 0 only where t = ρ,  z < 0 only where t = −ρ
//! ```
//!
//! | law | κ | μ | ρ(f) |
//! | --- | --- | --- | --- |
//! | rigid | 0 | | |
//! | spring of stiffness k, over the time span s | 1/(k s); Hertz: from its slope, iterated | | |
//! | roll-slip | | 1/K, D acts on the motion under normal forces alone | ν f |
//! | coulomb | | 0 | ν f |
//! | stick-slide with springs k_t | | 1/(k_t s), d includes the spring force | ν f |
//! | stick-rotate | | 0, with a second row for the relative rotation | no bound |
//!
//! Under an imposed pressure P the cell dilates at a rate e, one more coordinate, and a pair at the
//! distance r opens at the rate c e, c = r/d in d dimensions:
//!
//! ```text
//! w = C v + c e + b + κ f,   V κ_V e = Σ c f − V P
//! ```
//! Eliminated, e adds c cᵀ/(V κ_V) to the Delassus matrix and a constant to w.
//!
//! In a suspension, slip and friction are vectors perpendicular to the line of centres, |t| is a
//! length, and at the bound z = λ t with λ ≥ 0. For the reduced onset f − F_crit replaces f. Where
//! friction is not active, ρ = 0.
//!
//! The problem is solved by [`newton`], and where that does not converge by [`proximal`], which
//! follows a [`path`] where rigid contacts in a layer have tangential springs. The linear algebra
//! of both is [`dense_system`] of few spheres and [`sparse_system`] of many.

pub(crate) mod dense_system;
mod newton;
mod path;
mod proximal;
pub(crate) mod sparse_system;
pub(crate) mod statement;

#[cfg(test)]
mod tests;

use super::Quality;
use super::laws::COMPLIANCE;
use crate::space::{Layer, Space};
use newton::Effort;
use statement::{Forces, Friction, Problem, RoundoffThresholds, States, System};

/// Active set, forces and workspace of a contact problem.
#[derive(Default)]
pub(crate) struct ProblemSolver<S: Space = Layer> {
    pub(crate) states: States<S>,
    pub(crate) forces: Forces<S>,
    initial: Forces<S>,
    /// Forces before the last Newton step.
    previous: Forces<S>,
    /// Of each friction force, whether it was active, and whether it had been deactivated.
    saved_activation: Vec<(bool, bool)>,
    differences: path::Differences,
    /// Workspace of the proximal point method: the softened problem, the forces about which it is
    /// softened, and the problem with fixed friction bounds.
    softened: Problem<S>,
    reference: Forces<S>,
    bounded: Problem<S>,
}

impl<S: Space> Problem<S> {
    /// Whether [`path`] applies: in a layer, to rigid contacts with tangential springs. Without
    /// these a problem may have no solution, which a path takes long to find out: 110 spheres at
    /// c = 0.84 with `roll-slip` come to a third of their strain in a minute.
    fn has_path(&self) -> bool {
        let is_spring =
            |entry: &Friction<S>| entry.coefficient.is_finite() && entry.compliance > COMPLIANCE;
        S::TANGENTS == 1
            && !self.uses_frictionless_slip
            && !self.friction.is_empty()
            && self.friction.iter().all(is_spring)
            && self
                .normal
                .iter()
                .all(|entry| entry.compliance <= COMPLIANCE)
    }
}

impl<S: Space> ProblemSolver<S> {
    /// Solves the problem from the current active set and forces. The final forces are those of the
    /// solution, or the best that were found.
    ///
    /// `held_loads`: loads at which friction bounds are held; `None` where they follow the loads.
    ///
    /// `refine`: called after every linear system with the problem and the forces, for coefficients
    /// that depend on the solution; returns how many changed.
    pub(crate) fn solve(
        &mut self,
        problem: &mut Problem<S>,
        system: &mut impl System<S>,
        held_loads: Option<&[f64]>,
        mut refine: impl FnMut(&mut Problem<S>, &Forces<S>) -> usize,
    ) -> Quality {
        if let Some(loads) = held_loads {
            return self.solve_bounded(problem, system, loads, &mut refine);
        }
        self.initial.copy_from(&self.forces);
        self.save_activation(problem);
        if S::TANGENTS > 1 && system.read_motion(problem, &mut self.forces) {
            // The preceding motion provides the initial slip directions.
            self.update_states(problem, system, RoundoffThresholds::NONE, false, 0.0);
        }
        let effort = if problem.has_path() {
            Effort::FIRST
        } else {
            Effort::full::<S>()
        };
        let (converged, systems) = self.newton(problem, system, effort, &mut refine);
        if converged {
            return self.accept(problem, systems);
        }
        self.restore_activation(problem);
        self.forces.copy_from(&self.initial);
        self.infer_states(problem);
        let quality = self.solve_proximal(problem, system, &mut refine);
        Quality {
            systems: systems + quality.systems,
            ..quality
        }
    }

    /// The quality of a converged solution, after projection of its forces onto their bounds.
    fn accept(&mut self, problem: &Problem<S>, systems: u32) -> Quality {
        self.forces.project_onto_bounds(problem);
        Quality {
            systems,
            ..self.forces.quality(problem)
        }
    }

    fn save_activation(&mut self, problem: &Problem<S>) {
        self.saved_activation.clear();
        let entries = problem.friction.iter();
        self.saved_activation
            .extend(entries.map(|entry| (entry.active, entry.was_deactivated)));
    }

    /// Restores the saved activation: an active set that cycled says little about loads.
    fn restore_activation(&self, problem: &mut Problem<S>) {
        for (entry, &saved) in problem.friction.iter_mut().zip(&self.saved_activation) {
            (entry.active, entry.was_deactivated) = saved;
        }
    }

    pub(crate) fn infer_states(&mut self, problem: &Problem<S>) {
        let f = |k: usize| self.forces.normal[k];
        self.states
            .infer(problem, f, |k, _| self.forces.tangential[k]);
    }
}
