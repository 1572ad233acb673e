//! Motion with contacts under an iterated far field, friction forces iterated along with it.
//!
//! ```text
//! given q, c and F_t:   R_BM v_T = −Dᵀ F_t − δ_T;   R_BM v = F + R_n,FE E + Cᵀ f − Dᵀ F_t − δ_N − δ_T   with f ≥ 0, w ≥ 0, f w = 0
//! next:                 M₀⁻¹ x + δ of both parts as in `split`;   F_t ← the law at f and the slip of v − v_T
//! ```
//! One evaluation solves one normal problem, whose forces and set are those of the evaluation before but for little, and once for
//! v_T. Where a whole contact problem takes many rounds between normal forces and friction, this saves all but one of them in each
//! iteration.

use super::{Convergence, IterativeFarField, check_length};
use crate::error::Error;
use crate::hydrodynamics::resistance::Resistance;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// How far the iteration has come when the map is evaluated once more.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Evaluations made before in this solve.
    pub evaluations: u32,
    /// Relative residual of the last one; infinite before the first.
    pub residual: f64,
}

/// The map whose fixed point is sought along with the far field: normal problems under Ball-Melrose hydrodynamics with friction
/// forces given.
pub trait FixedPointMap {
    /// Friction forces of the candidates to begin with.
    fn start(&mut self, applied: &mut Vec<f64>);

    /// Evaluates the map once.
    ///
    /// # Arguments
    /// - `forces`: `[6N]`, on part N and on part T, without contact forces.
    /// - `applied`: friction force F_t of each candidate; its force on the spheres belongs to part T.
    /// - `progress`: forces and velocities need only be a little better than its residual.
    /// - `velocities`: v_N, then v_T `[6N]`.
    /// - `wanted`: what the law makes of it for each candidate; more entries than `applied` where candidates have joined, at its end.
    ///
    /// # Returns
    /// Whether the law itself has changed since the last evaluation, as by another choice of activated contacts. It must not forever.
    ///
    /// # Errors
    /// Whatever makes the stage fail.
    fn evaluate(
        &mut self,
        forces: &[f64],
        applied: &[f64],
        progress: Progress,
        velocities: &mut [f64],
        wanted: &mut Vec<f64>,
    ) -> Result<bool, Error>;
}

/// Rise of the residual over its least at which the acceleration starts anew.
const WORSE: f64 = 10.0;

/// Weight of a friction force in the norm of the iteration: that of a force which drives an isolated sphere.
fn weight() -> f64 {
    (6.0 * PI).sqrt().recip()
}

/// Whether no friction force differs from what the law wants by more than a share of the largest, or of the drag on a sphere: few
/// contacts hardly count in the norm over all spheres.
fn stands_still(applied: &[f64], wanted: &[f64], share: f64) -> bool {
    let largest = wanted.iter().fold(6.0 * PI, |m: f64, f| m.max(f.abs()));
    let mut pairs = applied.iter().zip(wanted);
    pairs.all(|(applied, wanted)| (applied - wanted).abs() <= share * largest)
}

impl IterativeFarField {
    /// Disturbance velocities `[3N]` with contacts; their forces stay with `map`.
    ///
    /// Arguments as in [`IterativeFarField::solve`], of `near` the pair terms alone. Friction forces are iterated along with the far field;
    /// those applied in the last evaluation are what the law wants up to the relative residual. The velocities are v = v_N + v_T of the
    /// last evaluation, and [`IterativeFarField::correct`] then has the far field of both parts.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::NotConverged`]; those of the contact problem.
    pub fn solve_fixed_point(
        &mut self,
        near: &Resistance,
        map: &mut impl FixedPointMap,
        strain: &Vector3<f64>,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<Convergence, Error> {
        let half = self.drag.len() / 2;
        check_length("forces", forces.len(), half)?;
        check_length("velocities", velocities.len(), half)?;
        check_length("near field", 3 * near.radii().len(), half)?;
        self.work.uniform.update(near, &self.drag[half..]);
        let flow = self.split.roots.len();
        let (mut applied, mut wanted) = (
            std::mem::take(&mut self.split.applied),
            std::mem::take(&mut self.split.wanted),
        );
        map.start(&mut applied);
        self.split.anderson.restart();
        let mut found = Convergence {
            residual: f64::INFINITY,
            ..Convergence::default()
        };
        let mut best = f64::INFINITY;
        let result = loop {
            let work = &mut self.split;
            work.take_flow(&mut self.operator, &self.drag, forces);
            work.change.truncate(flow);
            let progress = Progress {
                evaluations: found.evaluations,
                residual: found.residual,
            };
            let evaluated = map.evaluate(
                &work.forces,
                &applied,
                progress,
                &mut work.velocities,
                &mut wanted,
            );
            let changed = match evaluated {
                Ok(changed) => changed,
                Err(error) => break Err(error),
            };
            found.evaluations += 1;
            work.take_change(&self.work.uniform, strain);
            let joined = wanted.len() != applied.len();
            applied.resize(wanted.len(), 0.0);
            let pairs = applied.iter().zip(&wanted);
            work.change
                .extend(pairs.map(|(applied, wanted)| weight() * (wanted - applied)));
            work.scaled.truncate(flow);
            work.scaled.extend(applied.iter().map(|f| weight() * f));
            found.residual = work.relative_change();
            let still = stands_still(&applied, &wanted, self.residual);
            let done = found.residual <= self.residual && still && !changed && !joined;
            if done || found.iterations == self.most || !found.residual.is_finite() {
                break Ok(done);
            }
            found.iterations += 1;
            if changed || joined || found.residual > WORSE * best {
                work.anderson.restart();
                best = found.residual;
            }
            best = best.min(found.residual);
            work.anderson.advance(&mut work.scaled, &work.change);
            for (applied, scaled) in applied.iter_mut().zip(&work.scaled[flow..]) {
                *applied = scaled / weight();
            }
        };
        let work = &mut self.split;
        work.scaled.truncate(flow);
        work.change.truncate(flow);
        (work.applied, work.wanted) = (applied, wanted);
        match result {
            Ok(true) => {
                work.finish(&self.drag, &mut self.excess, velocities);
                Ok(found)
            }
            Ok(false) => {
                self.forget();
                Err(Error::NotConverged {
                    quantity: "the far field with contacts",
                    iterations: found.iterations,
                    residual: found.residual,
                    wanted: self.residual,
                })
            }
            Err(error) => Err(error),
        }
    }
}
