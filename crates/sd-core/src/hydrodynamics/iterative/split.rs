//! The motion in two parts under an iterated far field, for laws that depend on one part.
//!
//! ```text
//! v_N: the motion under the forces N,   v_T: the response to the forces T,   v = v_N + v_T
//! R_P v_N = F + (R_n + P)_FE E + Cᵀ f − δ_N,   R_P v_T = −Dᵀ F_t − δ_T        contact law on v and the slip of v_N
//! M q_N = (−E; v_N) − V c_N,   M q_T = (0; v_T) − V c_T                       q = P x + δ, Vᵀ q = 0 for each part
//! ```
//! Contacts are solved under the sparse hydrodynamics R_P, on which the far field acts as the
//! forces −δ. Given q and c, take `δ = q − P (M q + V c)` and let the spheres move; `P x + δ` is
//! the next q, and c moves by what the pair terms would need to take up the force on the layer,
//! `(Vᵀ R_n V)⁻¹ Vᵀ q`. Without contacts this map is affine. Contacts make it piecewise linear, and
//! friction makes it unsymmetric: [`super::fixed_point`] accelerates it with a history of many
//! steps, which on an affine map is GMRES.

use super::local::LocalResistance;
use super::uniform::Uniform;
use crate::hydrodynamics::far_field::far_operator::FarOperator;
use crate::hydrodynamics::resistance::Fluid;
use crate::linalg::anderson::Anderson;
use crate::space::Strains;
use std::marker::PhantomData;

/// Length of the history of the acceleration.
const DEPTH: usize = 40;

/// Vectors of the iteration, `[12N]`: all modes of part N sphere by sphere, `[6N]`, then those of
/// part T; where noted also c of both parts, four numbers.
pub(crate) struct SplitMotion<S: Fluid> {
    /// `√M₀ q` and c times the root of the layer's drag, `[12N + 4]`.
    pub(super) scaled: Vec<f64>,
    /// `scaled` before the step, to which it returns if the step fails.
    saved: Vec<f64>,
    /// `√M₀⁻¹`, then one over the root of the layer's drag, `[12N + 4]`.
    pub(super) roots: Vec<f64>,
    /// q.
    densities: Vec<f64>,
    /// `M q + V c`.
    flow: Vec<f64>,
    /// `P (M q + V c)`.
    reaction: Vec<f64>,
    /// P times the residual of one part, `[6N]`.
    work: Vec<f64>,
    /// The residual `x − M q − V c`.
    residual: Vec<f64>,
    /// Change of `scaled` in one iteration, `[12N + 4]`.
    pub(super) change: Vec<f64>,
    /// Forces on the spheres under sparse hydrodynamics, `[6N]`.
    pub(super) forces: Vec<f64>,
    /// Velocities, `[6N]`.
    pub(super) velocities: Vec<f64>,
    pub(super) anderson: Anderson,
    space: PhantomData<S>,
}

impl<S: Fluid> SplitMotion<S> {
    /// An iteration that starts from zero. `drag` is the diagonal of M₀⁻¹, `[6N]`.
    pub(super) fn new(drag: &[f64]) -> Self {
        let n = drag.len();
        let spheres = n / S::ALL_MODES;
        let whole: f64 = drag.iter().step_by(S::ALL_MODES).sum();
        let mut roots: Vec<f64> = drag.iter().chain(drag).map(|drag| drag.sqrt()).collect();
        roots.extend([whole.sqrt().recip(); 4]);
        Self {
            scaled: vec![0.0; 2 * n + 4],
            saved: vec![0.0; 2 * n + 4],
            roots,
            densities: vec![0.0; 2 * n],
            flow: vec![0.0; 2 * n],
            reaction: vec![0.0; 2 * n],
            work: vec![0.0; n],
            residual: vec![0.0; 2 * n],
            change: vec![0.0; 2 * n + 4],
            forces: vec![0.0; 2 * S::MODES * spheres],
            velocities: vec![0.0; 2 * S::MODES * spheres],
            anderson: Anderson::new(DEPTH, 2 * n + 4),
            space: PhantomData,
        }
    }

    /// Discards the last solution: the next solve starts without a far field.
    pub(crate) fn reset(&mut self) {
        self.scaled.fill(0.0);
    }

    /// Rounds the last solution to single precision, as in [`SplitMotion::warm_start`], so that the
    /// next solve starts from the same numbers after a restart.
    pub(crate) fn round(&mut self) {
        for x in &mut self.scaled {
            *x = f64::from(single(*x));
        }
    }

    /// Keeps the initial guess of the next solve for [`SplitMotion::restore`].
    pub(crate) fn save(&mut self) {
        self.saved.clone_from(&self.scaled);
    }

    /// Restores the initial guess as it was saved.
    pub(crate) fn restore(&mut self) {
        self.scaled.clone_from(&self.saved);
    }

    /// Initial guess of the next solve, in single precision: `scaled`, `[12N + 4]`.
    pub(crate) fn warm_start(&self) -> Vec<f32> {
        self.scaled.iter().map(|&x| single(x)).collect()
    }

    /// Sets the initial guess of the next solve to a value of [`SplitMotion::warm_start`]; zero if
    /// that is empty.
    pub(crate) fn start_from(&mut self, warm_start: &[f32]) {
        self.reset();
        for (x, &start) in self.scaled.iter_mut().zip(warm_start) {
            *x = f64::from(start);
        }
    }

    /// Norm of the residual, as a change of `scaled` under isolated drag, over that of the next
    /// `√M₀ q` of both parts together: near jamming the two are large and nearly cancel.
    pub(super) fn relative_residual(&self) -> f64 {
        let part = (self.roots.len() - 4) / 2;
        let next: f64 = (0..part)
            .map(|k| {
                let [n, t] = [k, k + part].map(|at| self.scaled[at] + self.change[at]);
                (n + t) * (n + t)
            })
            .sum();
        let rows = self.residual.iter().zip(&self.roots);
        let translations = &self.change[2 * part..];
        let square = rows
            .map(|(r, root)| r * r * root * root)
            .chain(translations.iter().map(|c| c * c))
            .sum::<f64>();
        if square > 0.0 {
            (square / next).sqrt()
        } else {
            0.0
        }
    }

    /// Computes `M q`, and with it the forces on the spheres under sparse hydrodynamics.
    ///
    /// `forces`: on the spheres, `[3N]`.
    pub(super) fn take_flow(
        &mut self,
        operator: &mut FarOperator<S>,
        local: &LocalResistance<S>,
        forces: &[f64],
    ) {
        let moves = self.velocities.len() / 2;
        let whole = self.work.len();
        for ((q, scaled), root) in self.densities.iter_mut().zip(&self.scaled).zip(&self.roots) {
            *q = scaled * root;
        }
        self.flow.fill(0.0);
        let moving = self.densities.iter().rposition(|&q| q != 0.0);
        let parts = moving.map_or(0, |last| last / whole + 1) * whole;
        operator.apply(&self.densities[..parts], &mut self.flow[..parts]);
        self.forces[..moves].copy_from_slice(forces);
        self.forces[moves..].fill(0.0);
        for part in 0..2 {
            let rows = part * whole..(part + 1) * whole;
            let (flow, reaction) = (
                &mut self.flow[rows.clone()],
                &mut self.reaction[rows.clone()],
            );
            for row in 0..S::DRIFTS {
                let at = 2 * (whole + part) + row;
                let c = self.scaled[at] * self.roots[at];
                for modes in S::all_modes_mut(flow) {
                    modes[row] += c;
                }
            }
            local.apply(flow, reaction);
            let modes = S::all_modes(&self.densities[rows]).iter();
            let forces = S::by_sphere_mut(&mut self.forces[part * moves..]).iter_mut();
            for ((q, reaction), force) in modes.zip(S::all_modes(reaction)).zip(forces) {
                for k in 0..S::MODES {
                    force[k] -= q[k] - reaction[k];
                }
            }
        }
    }

    /// Computes the residual of the velocities found, and the changes for them:
    /// `√M₀ P (x − M q − V c)`, and that of c.
    pub(super) fn take_change(
        &mut self,
        uniform: &Uniform<S>,
        local: &LocalResistance<S>,
        strains: Strains<'_, S>,
    ) {
        let moves = self.velocities.len() / 2;
        let whole = self.work.len();
        for part in 0..2 {
            let rows = part * whole..(part + 1) * whole;
            let residuals = S::all_modes_mut(&mut self.residual[rows.clone()]).iter_mut();
            let flows = S::all_modes(&self.flow[rows.clone()]);
            let velocities = S::by_sphere(&self.velocities[part * moves..]);
            let spheres = residuals.zip(flows).zip(velocities).enumerate();
            for (sphere, ((residual, flow), velocity)) in spheres {
                for k in 0..S::MODES {
                    residual[k] = velocity[k] - flow[k];
                }
                for k in 0..S::STRAINS {
                    let strain = if part == 0 {
                        strains.at(sphere)[k]
                    } else {
                        0.0
                    };
                    residual[S::MODES + k] = -strain - flow[S::MODES + k];
                }
            }
            local.apply(&self.residual[rows.clone()], &mut self.work);
            for (at, reaction) in rows.clone().zip(&self.work) {
                self.change[at] = reaction / self.roots[at];
            }
            // The next q, whose sum the pair terms balance.
            let mut net = [0.0; 2];
            for first in rows.step_by(S::ALL_MODES) {
                for (k, net) in net.iter_mut().enumerate().take(S::DRIFTS) {
                    let at = first + k;
                    *net += self.densities[at] + self.roots[at] * self.change[at];
                }
            }
            let c = uniform.against(net);
            for (row, c) in c.into_iter().enumerate() {
                let at = 2 * (whole + part) + row;
                self.change[at] = c / self.roots[at];
            }
        }
    }

    /// Writes δ `[6N]` of both parts together, and the sum of their velocities `[3N]`.
    pub(super) fn finish(&self, delta: &mut [f64], velocities: &mut [f64]) {
        let whole = delta.len();
        let (n, t) = self.velocities.split_at(velocities.len());
        for ((v, n), t) in velocities.iter_mut().zip(n).zip(t) {
            *v = n + t;
        }
        for (k, delta) in delta.iter_mut().enumerate() {
            let parts = [k, k + whole].map(|at| self.densities[at] - self.reaction[at]);
            *delta = parts[0] + parts[1];
        }
    }
}

/// The nearest number of single precision.
#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
fn single(x: f64) -> f32 {
    x as f32
}
