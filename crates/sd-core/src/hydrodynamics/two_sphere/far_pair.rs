//! The far field of two spheres alone, as a function of their distance.
//!
//! ```text
//! R2B∞ − D,   D the drag of both spheres isolated,   w = 1 − λ_min(D^−1/2 R2B∞ D^−1/2)
//! ```
//! w bounds the reduction below isolated drag: `R2B∞ − D ≥ −w D`.

use super::pair_frame::{self, ENTRIES};
use super::pair_term::PairTerm;
use super::table::scaled;
use crate::hydrodynamics::free_space::planar::self_mobility;
use crate::linalg::polynomial::{chebyshev_points, horner, interpolate};
use nalgebra::SVector;

/// Nodes of the polynomials, which have one degree less: 1e-6 of the drag, test
/// `polynomials_meet_the_inverse_mobility`.
const NODES: usize = 8;
/// The entries, and w.
const LANES: usize = ENTRIES + 1;
/// Minimum distance in s'; closer pairs, which overlap, use this distance.
const LEAST: f64 = 2.0;

/// `R2B∞ − D` of two spheres of given radii.
pub(crate) struct FarPair {
    /// Half the sum of the radii, in a.
    mean_radius: f64,
    /// Radius of the second sphere over that of the first.
    size_ratio: f64,
    /// Largest distance in s'.
    range: f64,
    /// Coefficients of powers of the distance, between −1 at [`LEAST`] and 1 at the range.
    powers: [[f64; LANES]; NODES],
}

impl FarPair {
    /// Tabulates the term up to a distance in s', above 2.
    pub(crate) fn new(radii: [f64; 2], range: f64) -> Self {
        let mean_radius = 0.5 * (radii[0] + radii[1]);
        let places = chebyshev_points();
        let values = places.map(|x| {
            let place = 0.5 * (1.0 + x);
            values(radii, mean_radius * (LEAST + (range - LEAST) * place))
        });
        Self {
            mean_radius,
            size_ratio: radii[1] / radii[0],
            range,
            powers: interpolate(&places, values),
        }
    }

    /// The term of a pair in range, and w; `distance` between the centres, in a.
    #[inline(always)]
    pub(crate) fn evaluate(&self, distance: f64) -> (PairTerm, f64) {
        let sums = self.sums(distance);
        let entries: &[f64; ENTRIES] = sums.first_chunk().expect("more lanes than entries");
        (PairTerm::new(entries), sums[ENTRIES])
    }

    /// The term of spheres of about the size ratio of this table, of which the first has radius 1
    /// and the second is no smaller, and w: that of spheres of this size ratio and with the same
    /// product of the radii.
    #[inline(never)]
    pub(crate) fn evaluate_near(
        &self,
        radius_i: f64,
        radius_j: f64,
        distance: f64,
    ) -> (PairTerm, f64) {
        let small = (radius_i * radius_j / self.size_ratio).sqrt();
        let large = small * self.size_ratio;
        let sums = self.sums(self.mean_radius * 2.0 * distance / (radius_i + radius_j));
        let radii = if radius_i > radius_j {
            [large, small]
        } else {
            [small, large]
        };
        (scaled(&sums, radii[0], radii[1]), sums[ENTRIES])
    }

    /// The entries of a pair in range, then w.
    #[inline(always)]
    fn sums(&self, distance: f64) -> [f64; LANES] {
        let place = (distance / self.mean_radius - LEAST) / (self.range - LEAST);
        horner(&self.powers, 2.0 * place.clamp(0.0, 1.0) - 1.0)
    }
}

/// The entries of `R2B∞ − D`, then w.
fn values(radii: [f64; 2], distance: f64) -> [f64; LANES] {
    let far = pair_frame::far_field_entries(radii, distance);
    let mut roots = SVector::<f64, 12>::zeros();
    for (sphere, radius) in radii.into_iter().enumerate() {
        let mobility = self_mobility(radius).map(f64::sqrt);
        roots.fixed_rows_mut::<6>(6 * sphere).copy_from(&mobility);
    }
    let scaled = pair_frame::expand(&far).component_mul(&(roots * roots.transpose()));
    let mut values = [0.0; LANES];
    values[..ENTRIES].copy_from_slice(&far);
    for (entry, drag) in values.iter_mut().zip(pair_frame::isolated_entries(radii)) {
        *entry -= drag;
    }
    values[ENTRIES] = 1.0 - scaled.symmetric_eigenvalues().min();
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_of_a_near_size_ratio_are_near() {
        let (table, ratio) = (FarPair::new([1.0, 1.5], 2.4), 1.52);
        let radii = [0.7, 0.7 * ratio];
        let (expected, weight) = FarPair::new(radii, 2.4).evaluate(1.9);
        let drag = pair_frame::isolated_entries(radii);
        let largest = drag.into_iter().fold(0.0, f64::max);
        for [a, b] in [radii, [radii[1], radii[0]]] {
            let (term, near) = table.evaluate_near(a, b, 1.9);
            let turned = nalgebra::SMatrix::<f64, 12, 12>::from_fn(|row, column| {
                let sign = |mode: usize| if mode % 6 < 2 { -1.0 } else { 1.0 };
                sign(row) * sign(column) * term.matrix()[((row + 6) % 12, (column + 6) % 12)]
            });
            let found = if a > b { turned } else { term.matrix() };
            let error = (found - expected.matrix()).abs().max() / largest;
            assert!(error > 0.0 && error < 0.02, "{a} {b}: {error:e}");
            assert!((near - weight).abs() < 0.01, "{near} {weight}");
        }
    }

    #[test]
    fn polynomials_meet_the_inverse_mobility() {
        for radii in [[1.0, 1.0], [1.0, 1.4], [1.4, 1.0], [1.0, 3.0]] {
            let table = FarPair::new(radii, 2.4);
            let mean = 0.5 * (radii[0] + radii[1]);
            let drag = pair_frame::isolated_entries(radii);
            let largest = drag.into_iter().fold(0.0, f64::max);
            for k in 0..=20 {
                let distance = mean * (2.0 + 0.02 * f64::from(k));
                let (term, weight) = table.evaluate(distance);
                let expected = values(radii, distance);
                let exact = pair_frame::far_field_entries(radii, distance);
                let found = term.matrix() + pair_frame::expand(&drag);
                let error = (found - pair_frame::expand(&exact)).abs().max();
                assert!(error < 1e-6 * largest, "{radii:?} {distance}: {error:e}");
                assert!((weight - expected[ENTRIES]).abs() < 1e-5, "{weight}");
                assert!(weight > 0.0 && weight < 1.0, "{weight}");
            }
        }
    }
}
