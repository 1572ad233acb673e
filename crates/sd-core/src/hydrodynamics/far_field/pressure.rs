//! The pressure of the point forces and stresslets of the far field at the centres of the spheres.
//!
//! ```text
//! p = −F·∇φ/4π + S:∇∇φ/4π,   φ = 1/r = erfc(αr)/r + erf(αr)/r
//! layer:        φ^ = 2π erfc(q)/k,   ∂²φ/∂z² ^ = 2πk erfc(q) − 4α√π e^(−q²)      q = k/2α
//! suspension:   φ^ = 4π e^(−q²)/k²
//! ```
//! The pressure is harmonic, so that spheres have no terms of finite size, and a sphere's own
//! smooth part has no gradient and no traceless curvature at its centre. In a layer the pressure
//! vanishes far above it; forces on the fluid have no sum. In a suspension the wave vector 0 is
//! left out, so that the pressure has no mean over the cell, interior of the spheres included.

use super::far_space::FarSpace;
use crate::space::Space;
use crate::space::cell::{Cell, Lattice};
use std::f64::consts::PI;

/// Range of both sums in units of the splitting: remainders of 1e-6.
const RANGE: f64 = 3.6;

/// Force and stresslet of a sphere.
#[derive(Debug)]
pub(crate) struct Source<S: Space> {
    force: S::Vector,
    /// xx, yy, zz, xy, xz, yz.
    stresslet: [f64; 6],
}

impl<S: Space> Source<S> {
    fn new(modes: &S::PerAnyMode<f64>) -> Self {
        let (mut force, mut strain) = (S::Vector::default(), S::Strain::default());
        for k in 0..S::DIMENSIONS {
            force[k] = modes[k];
        }
        for k in 0..S::STRAINS {
            strain[k] = modes[S::MODES + k];
        }
        Self {
            force,
            stresslet: S::full_tensor(&strain),
        }
    }

    /// 4π times the pressure at x, from the derivatives `[φ'/r, (φ'' − φ'/r)/r²]`.
    fn pressure(&self, x: &S::Vector, [first, second]: [f64; 2]) -> f64 {
        second * S::tensor_along(&self.stresslet, x) - first * S::dot(&self.force, x)
    }
}

/// `Σ 4π a³ p'` over all spheres, p' the pressure that the others make at the centre, in
/// mu·a³·rate.
///
/// `modes`: forces, torques and stresslets that the spheres exert on the fluid; `sources`: scratch.
pub(crate) fn far_pressure_moment<S: FarSpace>(
    cell: &Cell<S>,
    centres: &[S::Vector],
    radii: &[f64],
    modes: &[S::PerAnyMode<f64>],
    sources: &mut Vec<Source<S>>,
) -> f64 {
    sources.clear();
    sources.extend(modes.iter().map(Source::new));
    let lattice = cell.lattice();
    let alpha = lattice.map(|lattice| {
        let power = 0.5 / S::DIMENSIONS as f64;
        PI.sqrt() * (centres.len() as f64 / lattice.content().powi(2)).powf(power)
    });
    moment_with_splitting(lattice.zip(alpha), centres, radii, sources)
}

/// As [`far_pressure_moment`] with a given splitting parameter in a lattice.
fn moment_with_splitting<S: FarSpace>(
    periodic: Option<(&Lattice<S>, f64)>,
    centres: &[S::Vector],
    radii: &[f64],
    sources: &[Source<S>],
) -> f64 {
    let weight = |sphere: usize| radii[sphere].powi(3);
    let Some((lattice, alpha)) = periodic else {
        let mut sum = 0.0;
        for (i, j) in (0..centres.len()).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let x = centres[i] - centres[j];
            let r = S::norm_squared(&x).sqrt();
            let derivatives = [-r.powi(-3), 3.0 * r.powi(-5)];
            sum += weight(i) * sources[j].pressure(&x, derivatives)
                + weight(j) * sources[i].pressure(&-x, derivatives);
        }
        return sum;
    };
    let mut sum = 0.0;
    for i in 0..centres.len() {
        for j in 0..=i {
            for x in lattice.images_within(centres[i] - centres[j], RANGE / alpha) {
                if i == j && x == S::Vector::default() {
                    continue;
                }
                let derivatives = short_ranged(S::norm_squared(&x), alpha);
                sum += weight(i) * sources[j].pressure(&x, derivatives);
                if i != j {
                    sum += weight(j) * sources[i].pressure(&-x, derivatives);
                }
            }
        }
    }
    sum + long_ranged_moment(lattice, alpha, centres, sources, radii)
}

/// `[φ'/r, (φ'' − φ'/r)/r²]` of erfc(αr)/r at r².
fn short_ranged(square: f64, alpha: f64) -> [f64; 2] {
    let r = square.sqrt();
    let (rest, gauss) = (
        libm::erfc(alpha * r) / r,
        2.0 * alpha / PI.sqrt() * (-alpha * alpha * square).exp(),
    );
    let first = (rest + gauss) / square;
    [-first, (3.0 * first + 2.0 * alpha * alpha * gauss) / square]
}

/// The smooth part of the moment.
fn long_ranged_moment<S: FarSpace>(
    lattice: &Lattice<S>,
    alpha: f64,
    centres: &[S::Vector],
    sources: &[Source<S>],
    radii: &[f64],
) -> f64 {
    let is_layer = S::DIMENSIONS < 3;
    let across = |k: f64| {
        let q = 0.5 * k / alpha;
        if is_layer {
            2.0 * PI * k * libm::erfc(q) - 4.0 * alpha * PI.sqrt() * (-q * q).exp()
        } else {
            0.0
        }
    };
    let zz: f64 = sources.iter().map(|source| source.stresslet[2]).sum();
    let weights = radii.iter().map(|a| a.powi(3));
    let mut sum = weights.clone().sum::<f64>() * zz * across(0.0);
    let largest = 2.0 * RANGE * alpha;
    #[expect(
        clippy::cast_possible_truncation,
        reason = "numbers of waves are small"
    )]
    let [l_most, m_most, n_most] = lattice
        .wave_lengths()
        .map(|length| (largest * length / (2.0 * PI)).floor() as i32);
    let n_most = if is_layer { 0 } else { n_most };
    for l in 0..=l_most {
        for m in -m_most..=m_most {
            for n in -n_most..=n_most {
                // One of each pair of opposite vectors.
                if l == 0 && (m < 0 || (m == 0 && n <= 0)) {
                    continue;
                }
                let k = lattice.wave_vector([l, m, n].map(f64::from));
                let square = S::norm_squared(&k);
                if square > largest * largest {
                    continue;
                }
                let (length, q) = (square.sqrt(), 0.5 * square.sqrt() / alpha);
                let whole = if is_layer {
                    2.0 * PI * libm::erfc(q) / length
                } else {
                    4.0 * PI * (-q * q).exp() / square
                };
                let across = across(length);
                // Σ w e^(ik·x) and Σ p^ e^(−ik·x).
                let (mut w, mut p) = ([0.0; 2], [0.0; 2]);
                for ((x, source), weight) in centres.iter().zip(sources).zip(weights.clone()) {
                    let (sin, cos) = libm::sincos(S::dot(&k, x));
                    let even = across * source.stresslet[2]
                        - whole * S::tensor_along(&source.stresslet, &k);
                    let odd = whole * S::dot(&source.force, &k);
                    w[0] += weight * cos;
                    w[1] += weight * sin;
                    p[0] += even * cos - odd * sin;
                    p[1] -= even * sin + odd * cos;
                }
                sum += 2.0 * (w[0] * p[0] - w[1] * p[1]);
            }
        }
    }
    sum / lattice.content()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{Bulk, FixedArray as _, Layer};
    use nalgebra::{Vector2, Vector3};

    /// Modes of spheres without a net force.
    fn modes<S: Space>(count: usize) -> Vec<S::PerAnyMode<f64>> {
        let mut all: Vec<_> = (0..count)
            .map(|i| {
                let mut modes = S::PerAnyMode::<f64>::each(0.0);
                for k in 0..S::ALL_MODES {
                    modes[k] = (1.3 * i as f64 + 2.1 * k as f64).sin();
                }
                modes
            })
            .collect();
        for k in 0..S::DIMENSIONS {
            let mean = all.iter().map(|modes| modes[k]).sum::<f64>() / count as f64;
            for modes in &mut all {
                modes[k] -= mean;
            }
        }
        all
    }

    fn sources<S: Space>(modes: &[S::PerAnyMode<f64>]) -> Vec<Source<S>> {
        modes.iter().map(Source::new).collect()
    }

    fn whole_moment<S: FarSpace>(
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        modes: &[S::PerAnyMode<f64>],
    ) -> f64 {
        far_pressure_moment(cell, centres, radii, modes, &mut Vec::new())
    }

    const RADII: [f64; 4] = [1.0, 0.7, 1.2, 0.9];

    fn layer() -> (Cell<Layer>, Vec<Vector2<f64>>) {
        let centres = [[0.0, 0.0], [2.5, 1.0], [-1.5, 2.7], [4.0, 4.5]];
        let cell = Cell::periodic(Vector2::new(7.0, 8.0), 2.3).unwrap();
        (cell, centres.map(|[x, y]| Vector2::new(x, y)).to_vec())
    }

    fn suspension() -> (Cell<Bulk>, Vec<Vector3<f64>>) {
        let centres = [
            [0.0, 0.0, 0.0],
            [2.5, 1.0, 0.4],
            [-1.5, 2.7, 2.9],
            [4.0, 4.5, 1.1],
        ];
        let cell = Cell::periodic(Vector3::new(7.0, 8.0, 5.0), 2.3).unwrap();
        (cell, centres.map(Vector3::from).to_vec())
    }

    #[test]
    fn the_sum_does_not_depend_on_its_splitting() {
        let (cell, centres) = layer();
        let (lattice, forces) = (cell.lattice().unwrap(), modes::<Layer>(4));
        let sums = [0.3, 0.5, 0.8].map(|alpha| {
            moment_with_splitting(Some((lattice, alpha)), &centres, &RADII, &sources(&forces))
        });
        assert!((sums[0] - sums[1]).abs() < 3e-6, "{sums:?}");
        assert!((sums[2] - sums[1]).abs() < 3e-6, "{sums:?}");
        let (cell, centres) = suspension();
        let (lattice, forces) = (cell.lattice().unwrap(), modes::<Bulk>(4));
        let sums = [0.3, 0.5, 0.8].map(|alpha| {
            moment_with_splitting(Some((lattice, alpha)), &centres, &RADII, &sources(&forces))
        });
        assert!((sums[0] - sums[1]).abs() < 3e-6, "{sums:?}");
        assert!((sums[2] - sums[1]).abs() < 3e-6, "{sums:?}");
    }

    #[test]
    fn in_a_suspension_it_is_minus_the_pressure_between_the_spheres() {
        let (cell, mut centres) = suspension();
        let lattice = *cell.lattice().unwrap();
        // Pairs that are pushed together.
        let mut forces = modes::<Bulk>(4);
        for [i, j] in [[0, 1], [2, 3]] {
            let push = cell.nearest(centres[j] - centres[i]).0;
            for k in 0..3 {
                forces[i][k] = push[k];
                forces[j][k] = -push[k];
            }
        }
        let volume = lattice.content();
        let whole = whole_moment(&cell, &centres, &RADII, &forces);
        // A sphere more that only feels the pressure.
        forces.push([0.0; 11]);
        centres.push(Vector3::zeros());
        let only = [0.0, 0.0, 0.0, 0.0, 1.0];
        let (mut sum, mut count) = (0.0, 0);
        let steps: i32 = 28;
        let place = |k: i32| (f64::from(k) + 0.5) / f64::from(steps);
        for point in 0..steps.pow(3) {
            let [l, m, n] = [point % steps, point / steps % steps, point / steps.pow(2)];
            let vectors = lattice.vectors();
            let x = vectors[0] * place(l) + vectors[1] * place(m) + vectors[2] * place(n);
            // The share of a point that is in the fluid, whose neighbours are 0.24 apart.
            let shares = centres[..4].iter().zip(RADII).map(|(centre, radius)| {
                lattice
                    .images_within(x - centre, radius + 0.12)
                    .map(|y| ((y.norm() - radius) / 0.24 + 0.5).clamp(0.0, 1.0))
                    .product::<f64>()
            });
            let share: f64 = shares.product();
            count += 1;
            if share > 0.0 {
                centres[4] = x;
                let moment = whole_moment(&cell, &centres, &only, &forces);
                sum += share * moment / (4.0 * PI);
            }
        }
        let found = sum / f64::from(count);
        let expected = -whole / (3.0 * volume);
        assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
    }

    #[test]
    fn in_a_dilute_suspension_it_is_that_of_the_pair_less_the_virial_of_its_forces() {
        // The pressure of two spheres alone has the mean `r f/3V` over a cell.
        let radii = [1.0, 1.3];
        let x = Vector3::new(1.6, 1.2, 0.9);
        let mut modes = modes::<Bulk>(2);
        let push = Vector3::new(0.7, -0.2, 0.4);
        for k in 0..3 {
            (modes[0][k], modes[1][k]) = (push[k], -push[k]);
        }
        let centres = [Vector3::zeros(), x];
        let spheres = radii.map(|a| 4.0 / 3.0 * PI * f64::powi(a, 3));
        let alone = whole_moment(&Cell::<Bulk>::Unbounded, &centres, &radii, &modes);
        for side in [20.0, 40.0] {
            let cell = Cell::<Bulk>::equal_sides(side, 0.0).unwrap();
            let found = whole_moment(&cell, &centres, &radii, &modes);
            let fraction = (spheres[0] + spheres[1]) / side.powi(3);
            let expected = alone - fraction * push.dot(&x);
            // Images add the fifth power of the distance over the side.
            let error = (found - expected).abs() / alone.abs();
            assert!(
                error < 15.0 * f64::powi(x.norm() / side, 5),
                "{side}: {error:.1e}"
            );
            assert!((found - alone).abs() > 5.0 * (found - expected).abs());
        }
    }

    #[test]
    fn in_a_layer_it_is_the_sum_over_all_images() {
        let (cell, centres) = layer();
        let (lattice, forces) = (cell.lattice().unwrap(), modes::<Layer>(4));
        let found = whole_moment(&cell, &centres, &RADII, &forces);
        // Sums over circles of images, whose remainders fall off as 1/R.
        let direct = |reach: f64| {
            let mut sum = 0.0;
            let sources = sources::<Layer>(&forces);
            for (i, centre) in centres.iter().enumerate() {
                for (j, source) in sources.iter().enumerate() {
                    for x in lattice.images_within(centre - centres[j], reach) {
                        let r = x.norm();
                        if r > 0.0 {
                            let derivatives = [-r.powi(-3), 3.0 * r.powi(-5)];
                            sum += RADII[i].powi(3) * source.pressure(&x, derivatives);
                        }
                    }
                }
            }
            sum
        };
        let means = [200.0, 400.0].map(|from| {
            (0..40)
                .map(|k| direct(from + 0.5 * f64::from(k)))
                .sum::<f64>()
                / 40.0
        });
        assert!((found - means[1]).abs() < 5e-3, "{found} {means:?}");
        assert!((found - means[1]).abs() < (found - means[0]).abs());
    }
}
