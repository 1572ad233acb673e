//! What reads a velocity of two surfaces off the motion of their spheres.

use crate::hydrodynamics::resistance::Motion;
use crate::space::Layer;
use crate::space::modes::Vec2;

/// Reads one velocity of a pair off the velocities of its two spheres; its transpose exerts a force on them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Row {
    /// The spheres i and j.
    pub(crate) spheres: [usize; 2],
    /// Weights of `(U_x, U_y, Ω)` of i, then of j.
    pub(crate) weights: [f64; 6],
}

impl Row {
    /// v_n = n·(U_j − U_i).
    #[inline(always)]
    pub(crate) fn normal(spheres: [usize; 2], n: Vec2) -> Self {
        let weights = [-n.x, -n.y, 0.0, n.x, n.y, 0.0];
        Self { spheres, weights }
    }

    /// u_t = t·(U_j − U_i) − (l_i Ω_i + l_j Ω_j).
    pub(crate) fn slip(spheres: [usize; 2], t: Vec2, levers: [f64; 2]) -> Self {
        let weights = [-t.x, -t.y, -levers[0], t.x, t.y, -levers[1]];
        Self { spheres, weights }
    }

    /// Ω_j − Ω_i.
    pub(crate) fn spin(spheres: [usize; 2]) -> Self {
        let weights = [0.0, 0.0, -1.0, 0.0, 0.0, 1.0];
        Self { spheres, weights }
    }

    /// u_r = a (Ω_j − Ω_i), a the radius of rolling.
    pub(crate) fn rolling(spheres: [usize; 2], radius: f64) -> Self {
        let weights = [0.0, 0.0, -radius, 0.0, 0.0, radius];
        Self { spheres, weights }
    }

    /// The velocity, of velocities `[3N]`.
    #[inline(always)]
    pub(crate) fn read(&self, v: &[f64]) -> f64 {
        let (i, j) = (3 * self.spheres[0], 3 * self.spheres[1]);
        let (w, v_i, v_j) = (&self.weights, &v[i..i + 3], &v[j..j + 3]);
        (w[0] * v_i[0] + w[1] * v_i[1] + w[2] * v_i[2])
            + (w[3] * v_j[0] + w[4] * v_j[1] + w[5] * v_j[2])
    }

    /// Adds `f` times the transpose to forces `[3N]` whose first rows of i and j are `starts`.
    #[inline(always)]
    pub(crate) fn add_at(&self, f: f64, starts: [usize; 2], forces: &mut [f64]) {
        for (sphere, start) in starts.into_iter().enumerate() {
            let weights = &self.weights[3 * sphere..3 * sphere + 3];
            for (force, weight) in forces[start..start + 3].iter_mut().zip(weights) {
                *force += f * weight;
            }
        }
    }

    /// Adds `f` times the transpose to forces `[3N]` in the order of the spheres.
    #[inline(always)]
    pub(crate) fn add(&self, f: f64, forces: &mut [f64]) {
        self.add_at(f, [3 * self.spheres[0], 3 * self.spheres[1]], forces);
    }

    /// The same in the first M of L kinds of forces side by side.
    #[inline(always)]
    pub(crate) fn add_to_first<const M: usize, const L: usize>(
        &self,
        f: f64,
        forces: &mut [Motion<Layer, L>],
    ) {
        let weights = self.weights.as_chunks::<3>().0;
        for (sphere, weights) in self.spheres.into_iter().zip(weights) {
            for (forces, weight) in forces[sphere].iter_mut().zip(weights) {
                for force in &mut forces[..M] {
                    *force += f * weight;
                }
            }
        }
    }
}
