//! Rows of the kinematic matrices C and D: relative velocities of a pair as linear functions of
//! sphere velocities.

use crate::hydrodynamics::resistance::Motion;
use crate::space::{Layer, Space};

/// One relative velocity of a pair as a linear function of the velocities of its two spheres. The
/// transpose distributes a contact force over both spheres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Row<S: Space = Layer> {
    pub(crate) spheres: [usize; 2],
    /// Weights of the velocities of i, then of j.
    pub(crate) weights: S::Weights,
}

impl<S: Space> Row<S> {
    /// v_n = n·(U_j − U_i).
    #[inline(always)]
    pub(crate) fn normal(spheres: [usize; 2], n: &S::Vector) -> Self {
        let still = S::Spin::default();
        Self {
            spheres,
            weights: S::weights(&S::join(&-*n, &still), &S::join(n, &still)),
        }
    }

    /// u_d = d·(U_j − U_i) − (n × d)·(l_i Ω_i + l_j Ω_j): the slip along d.
    pub(crate) fn slip(
        spheres: [usize; 2],
        n: &S::Vector,
        d: &S::Vector,
        levers: [f64; 2],
    ) -> Self {
        let [axis_i, axis_j] = levers.map(|lever| S::axis(n, d) * -lever);
        Self {
            spheres,
            weights: S::weights(&S::join(&-*d, &axis_i), &S::join(d, &axis_j)),
        }
    }

    /// a (n × d)·(Ω_j − Ω_i), with the rolling radius a: the rolling velocity along d; with a = 1
    /// the relative rotation.
    pub(crate) fn rolling(spheres: [usize; 2], n: &S::Vector, d: &S::Vector, radius: f64) -> Self {
        let (still, axis) = (S::Vector::default(), S::axis(n, d) * radius);
        Self {
            spheres,
            weights: S::weights(&S::join(&still, &-axis), &S::join(&still, &axis)),
        }
    }

    #[inline(always)]
    pub(crate) fn sphere_weights(&self) -> [&S::PerMode<f64>; 2] {
        let both = S::by_sphere(self.weights.as_ref());
        [&both[0], &both[1]]
    }

    /// The relative velocity for given velocities of all spheres.
    #[inline(always)]
    pub(crate) fn read(&self, v: &[f64]) -> f64 {
        let v = S::by_sphere(v);
        let [w_i, w_j] = self.sphere_weights();
        let [v_i, v_j] = self.spheres.map(|sphere| &v[sphere]);
        let product = |w: &S::PerMode<f64>, v: &S::PerMode<f64>| {
            let mut sum = w[0] * v[0];
            for k in 1..S::MODES {
                sum += w[k] * v[k];
            }
            sum
        };
        product(w_i, v_i) + product(w_j, v_j)
    }

    /// Adds `f` times the transpose to forces whose entries of i and j begin at `starts`.
    #[inline(always)]
    pub(crate) fn add_at(&self, f: f64, starts: [usize; 2], forces: &mut [f64]) {
        for (weights, start) in self.sphere_weights().into_iter().zip(starts) {
            let forces = &mut forces[start..start + S::MODES];
            for (force, weight) in forces.iter_mut().zip(weights.as_ref()) {
                *force += f * weight;
            }
        }
    }

    /// Adds `f` times the transpose to the forces on all spheres.
    #[inline(always)]
    pub(crate) fn add(&self, f: f64, forces: &mut [f64]) {
        self.add_at(f, self.spheres.map(|sphere| S::MODES * sphere), forces);
    }

    /// Adds `f` times the transpose to the first M of L interleaved force vectors.
    #[inline(always)]
    pub(crate) fn add_to_first<const M: usize, const L: usize>(
        &self,
        f: f64,
        forces: &mut [Motion<S, L>],
    ) {
        for (sphere, weights) in self.spheres.into_iter().zip(self.sphere_weights()) {
            let forces = forces[sphere].as_mut().iter_mut();
            for (forces, weight) in forces.zip(weights.as_ref()) {
                for force in &mut forces[..M] {
                    *force += f * weight;
                }
            }
        }
    }

    /// The row with its weights multiplied by a factor.
    pub(crate) fn times(mut self, factor: f64) -> Self {
        for weight in self.weights.as_mut() {
            *weight *= factor;
        }
        self
    }

    /// The sum with a factor times another row of the same spheres.
    pub(crate) fn plus(mut self, factor: f64, other: &Self) -> Self {
        for (weight, other) in self.weights.as_mut().iter_mut().zip(other.weights.as_ref()) {
            *weight += factor * other;
        }
        self
    }
}
