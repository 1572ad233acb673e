//! The motion in two parts under an iterated far field, as the friction law asks for.
//!
//! ```text
//! v_N: the motion under all forces but friction,   v_T: what friction adds,   v = v_N + v_T
//! R_BM v_N = F + R_n,FE E + Cᵀ f − δ_N,   R_BM v_T = −Dᵀ F_t − δ_T        contact law on v and the slip of v_N
//! M q_N = (−E; v_N) − V c_N,   M q_T = (0; v_T) − V c_T                   q = M₀⁻¹ x + δ, Vᵀ q = 0 for each part
//! ```
//! Contacts are solved under Ball-Melrose hydrodynamics, on which the far field acts as the forces −δ. Given q and c, take
//! `δ = q − M₀⁻¹ (M q + V c)` and let the spheres move; `M₀⁻¹ x + δ` is the next q, and c moves by what the pair terms would need to
//! take up the force on the layer, `(Vᵀ R_n V)⁻¹ Vᵀ q`. This map is what the preconditioned conjugate gradients of [`super`]
//! iterate; contacts make it piecewise linear, and friction takes its symmetry: [`super::fixed_point`] accelerate it with a long memory.

use super::IterativeFarField;
use super::uniform::translation;
use crate::linalg::anderson::Mixing;
use crate::linalg::dense::dot;
use nalgebra::Vector3;

/// Vectors of the iteration, `[12N]`: part N `[6N]`, strains first, then part T; where said also c of both parts, four numbers.
#[derive(Default)]
pub(super) struct Workspace {
    /// `√M₀ q` and c times the root of the layer's drag, `[12N + 4]`.
    pub(super) scaled: Vec<f64>,
    /// `√M₀⁻¹`, then one over the root of the layer's drag, `[12N + 4]`.
    pub(super) roots: Vec<f64>,
    /// q.
    densities: Vec<f64>,
    /// `M q + V c`.
    flow: Vec<f64>,
    /// Change of `scaled` in one iteration, `[12N + 4]`.
    pub(super) change: Vec<f64>,
    /// Forces on the Ball-Melrose spheres, `[6N]`.
    pub(super) forces: Vec<f64>,
    /// Velocities, `[6N]`.
    pub(super) velocities: Vec<f64>,
    /// Friction forces applied, by candidate.
    pub(super) applied: Vec<f64>,
    /// What the law makes of them.
    pub(super) wanted: Vec<f64>,
    /// Acceleration.
    pub(super) mixing: Mixing,
}

impl Workspace {
    /// Starts the next solve from nothing.
    pub(super) fn forget(&mut self) {
        self.scaled.fill(0.0);
    }

    /// Gives the vectors their lengths; all but the first time nothing happens.
    pub(super) fn prepare(&mut self, drag: &[f64]) {
        let n = drag.len();
        if self.roots.len() == 2 * n + 4 {
            return;
        }
        let whole: f64 = drag[n / 2..].iter().step_by(3).sum();
        self.roots.clear();
        self.roots
            .extend(drag.iter().chain(drag).map(|drag| drag.sqrt()));
        self.roots.extend([whole.sqrt().recip(); 4]);
        for vector in [&mut self.densities, &mut self.flow] {
            vector.clear();
            vector.resize(2 * n, 0.0);
        }
        for vector in [&mut self.scaled, &mut self.change] {
            vector.clear();
            vector.resize(2 * n + 4, 0.0);
        }
        for vector in [&mut self.forces, &mut self.velocities] {
            vector.clear();
            vector.resize(n, 0.0);
        }
        self.mixing.reserve(2 * n + 4);
    }

    /// Norm of `change` over that of the next `√M₀ q` of both parts together: near jamming the two are large and all but cancel.
    pub(super) fn relative_change(&self) -> f64 {
        let part = (self.roots.len() - 4) / 2;
        let next: f64 = (0..part)
            .map(|k| {
                let [n, t] = [k, k + part].map(|at| self.scaled[at] + self.change[at]);
                (n + t) * (n + t)
            })
            .sum();
        let square = dot(&self.change, &self.change);
        if square > 0.0 {
            (square / next).sqrt()
        } else {
            0.0
        }
    }
}

impl IterativeFarField {
    /// `M q`, and with it the forces on the Ball-Melrose spheres.
    pub(super) fn take_flow(&mut self, forces: &[f64]) {
        let whole = self.drag.len();
        let half = whole / 2;
        let work = &mut self.split;
        for ((q, scaled), root) in work.densities.iter_mut().zip(&work.scaled).zip(&work.roots) {
            *q = scaled * root;
        }
        work.flow.fill(0.0);
        let moving = work.densities.iter().rposition(|&q| q != 0.0);
        let parts = moving.map_or(0, |last| last / whole + 1) * whole;
        self.operator
            .apply(&work.densities[..parts], &mut work.flow[..parts]);
        for part in 0..2 {
            let q = &work.densities[part * whole..(part + 1) * whole];
            let flow = &mut work.flow[part * whole..(part + 1) * whole];
            let c = [0, 1].map(|row| {
                let at = 2 * (whole + part) + row;
                work.scaled[at] * work.roots[at]
            });
            for k in 0..half {
                flow[half + k] += translation(c, k);
                let external = if part == 0 { forces[k] } else { 0.0 };
                let excess = q[half + k] - self.drag[half + k] * flow[half + k];
                work.forces[part * half + k] = external - excess;
            }
        }
    }

    /// The change for the velocities at hand: `√M₀⁻¹ (x − M q − V c)`, and that of c.
    pub(super) fn take_change(&mut self, strain: &Vector3<f64>) {
        let whole = self.drag.len();
        let half = whole / 2;
        let work = &mut self.split;
        for part in 0..2 {
            for k in 0..whole {
                let x = match (part, k < half) {
                    (_, false) => work.velocities[part * half + k - half],
                    (0, true) => -strain[k % 3],
                    _ => 0.0,
                };
                let at = part * whole + k;
                work.change[at] = work.roots[at] * (x - work.flow[at]);
            }
            // The next q, whose sum the pair terms are to take up.
            let mut net = [0.0; 2];
            for k in (0..half).filter(|k| k % 3 < 2) {
                let at = part * whole + half + k;
                net[k % 3] += work.densities[at] + work.roots[at] * work.change[at];
            }
            let c = self.work.uniform.against(net);
            for (row, c) in c.into_iter().enumerate() {
                let at = 2 * (whole + part) + row;
                work.change[at] = c / work.roots[at];
            }
        }
    }

    /// The excess of both parts together, and their velocities.
    pub(super) fn finish(&mut self, velocities: &mut [f64]) {
        let whole = self.drag.len();
        let half = whole / 2;
        let work = &mut self.split;
        let (normal, friction) = work.velocities.split_at(half);
        for ((v, normal), friction) in velocities.iter_mut().zip(normal).zip(friction) {
            *v = normal + friction;
        }
        for (k, excess) in self.excess.iter_mut().enumerate() {
            let parts = [k, k + whole].map(|at| work.densities[at] - self.drag[k] * work.flow[at]);
            *excess = parts[0] + parts[1];
        }
    }
}
