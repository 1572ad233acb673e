//! Motion under an iterated far field.
//!
//! ```text
//! given q and c:   contact forces and velocities under sparse hydrodynamics and the forces −δ of the far field
//! next:            P x + δ of both parts as in `split`
//! ```
//! One evaluation solves one contact problem, whose forces and states change little between
//! evaluations. Where no friction is consistent with the far field of its own motion, or where the
//! iteration does not find it, friction bounds are held from some evaluation on: forces are then
//! unique and depend continuously on the far field, and the iteration converges.

use super::{Convergence, IterativeFarField};
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::space::Strains;

/// State of the iteration at an evaluation of the map.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Number of earlier evaluations in this solve.
    pub evaluations: u32,
    /// Relative residual of the last one; infinite before the first.
    pub residual: f64,
    /// Whether friction bounds are to be held at the loads of the last evaluation before.
    pub holds_bounds: bool,
}

/// The map whose fixed point is sought along with the far field: a contact problem under sparse
/// hydrodynamics.
pub trait FixedPointMap {
    /// Evaluates the map once.
    ///
    /// # Arguments
    /// - `forces`: `[6N]`, on part N and on part T, without contact forces.
    /// - `progress`: forces and velocities need only be slightly more accurate than its residual.
    /// - `velocities`: v_N, then v_T `[6N]`; v_T is zero where the contact law does not read the
    ///   motion without friction.
    ///
    /// # Returns
    /// Whether the problem itself has changed since the last evaluation, as by an update of the
    /// active set. It may change only finitely often.
    ///
    /// # Errors
    /// Any error of the stage.
    fn evaluate(
        &mut self,
        forces: &[f64],
        progress: Progress,
        velocities: &mut [f64],
    ) -> Result<bool, Error>;

    /// Whether the last evaluation was exact enough to be the last. If not, later ones must be.
    fn accepts(&mut self) -> bool {
        true
    }
}

/// Number of evaluations after which friction bounds are held. Near jamming about thirty are
/// needed, and as many with held bounds.
const FREE_EVALUATIONS: u32 = 200;
/// Maximum number of evaluations.
pub(super) const MAX_EVALUATIONS: u32 = 300;
/// Relative residual above which the result is rejected.
const LARGEST_ACCEPTED_RESIDUAL: f64 = 0.1;
/// Ratio of the residual to its minimum at which the acceleration is restarted.
const RESTART_RATIO: f64 = 10.0;

impl<S: Fluid> IterativeFarField<S> {
    /// Disturbance velocities `[3N]`; forces of contacts are kept in `map`.
    ///
    /// # Arguments
    /// - `near`: Ball-Melrose with or without the far field of near pairs, factored or held pair by
    ///   pair, at the positions of [`IterativeFarField::update`].
    /// - `map`: the motion under forces and the hydrodynamics of `near`.
    /// - `strains`: of the incident flow.
    /// - `forces`: external ones and those of [`Resistance::background_forces`] of `near`, `[3N]`.
    ///   External ones should sum to zero, since their sum meets hardly any resistance.
    ///
    /// The velocities are v = v_N + v_T of the last evaluation, and [`IterativeFarField::correct`]
    /// then has the far field of both parts.
    ///
    /// Contact states that are consistent with the far field of their own motion may not exist or
    /// may not be found: the friction bounds are then held, and friction does not obey its law.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::NotConverged`]; those of the contact problem.
    pub fn solve_fixed_point(
        &mut self,
        near: &Resistance<S>,
        map: &mut impl FixedPointMap,
        strains: Strains<'_, S>,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<Convergence, Error> {
        self.check_lengths(near, forces, velocities)?;
        self.local.update(&self.drag, near);
        if S::DRIFTS > 0 {
            self.uniform.update(near, &self.local, &self.drag);
        }
        self.split.anderson.restart();
        let mut found = Convergence {
            residual: f64::INFINITY,
            ..Convergence::default()
        };
        let mut best = f64::INFINITY;
        let result = loop {
            let work = &mut self.split;
            work.take_flow(&mut self.operator, &self.local, forces);
            let progress = Progress {
                evaluations: found.evaluations,
                residual: found.residual,
                holds_bounds: found.evaluations >= FREE_EVALUATIONS,
            };
            if found.evaluations == FREE_EVALUATIONS {
                work.anderson.restart();
                best = f64::INFINITY;
            }
            let evaluated = map.evaluate(&work.forces, progress, &mut work.velocities);
            let changed = match evaluated {
                Ok(changed) => changed,
                Err(error) => break Err(error),
            };
            found.evaluations += 1;
            work.take_change(&self.uniform, &self.local, strains);
            found.residual = work.relative_residual();
            found.converged = found.residual <= self.residual && !changed && map.accepts();
            if found.converged
                || found.evaluations >= self.max_evaluations
                || !found.residual.is_finite()
            {
                break Ok(found.residual <= LARGEST_ACCEPTED_RESIDUAL);
            }
            // An update of the active set changes few directions: earlier steps remain useful,
            // except the one across the update.
            if changed {
                work.anderson.skip_step();
            }
            if found.residual > RESTART_RATIO * best {
                work.anderson.restart();
                best = found.residual;
            }
            best = best.min(found.residual);
            work.anderson.advance(&mut work.scaled, &work.change);
        };
        self.last = found;
        let work = &mut self.split;
        match result {
            Ok(true) => {
                work.finish(&mut self.delta, velocities);
                Ok(found)
            }
            Ok(false) => {
                self.split.reset();
                Err(self.unconverged())
            }
            Err(error) => Err(error),
        }
    }

    /// Refuses a last solve that did not converge.
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    pub(crate) fn check_converged(&self) -> Result<(), Error> {
        if self.last.converged {
            Ok(())
        } else {
            Err(self.unconverged())
        }
    }

    /// The error of a last solve that did not converge.
    fn unconverged(&self) -> Error {
        Error::NotConverged {
            quantity: "the far field",
            iterations: self.last.evaluations,
            residual: self.last.residual,
            wanted: self.residual,
        }
    }
}
