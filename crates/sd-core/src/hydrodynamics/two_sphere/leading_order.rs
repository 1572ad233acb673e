//! Leading-order lubrication: the singular terms of a pair, regularized near contact.
//!
//! ```text
//! X functions: g1/x,   Y functions: g2 ln(1/x),   Z^M = 0,   x = max(ξ, 0) + δ,   zero for ξ ≥ cutoff
//! ```
//!
//! No regular terms and no far field of the pair are added, so the term directly complements the
//! drag of isolated spheres. It is positive semidefinite while x ≤ 1, and finite where surfaces
//! overlap.
//!
//! # Source
//! Ball & Melrose, Physica A 247, 444 (1997); Mari, Seto, Morris & Denn, J. Rheol. 58, 1693 (2014),
//! with all of the force, torque and stresslet terms. Coefficients: `near_contact`.

use super::Scalars;
use super::near_contact;
use super::pair_frame::{self, ENTRIES, odd};
use super::pair_term::PairTerm;
use crate::model::LeadingOrder;
use std::f64::consts::PI;

/// Leading-order terms of spheres of two given radii, i before j, at any gap.
#[derive(Debug, Clone)]
pub(crate) struct LeadingOrderPair {
    radii: [f64; 2],
    numbers: LeadingOrder,
    /// Coefficients of 1/x: X functions.
    squeezing: [f64; ENTRIES],
    /// Coefficients of ln(1/x): Y functions.
    shearing: [f64; ENTRIES],
}

impl LeadingOrderPair {
    /// The terms of spheres with these radii, in a.
    pub(crate) fn new(radii: [f64; 2], numbers: LeadingOrder) -> Self {
        let ratio = radii[1] / radii[0];
        let both = [
            near_contact::singular(ratio),
            near_contact::singular(ratio.recip()),
        ];
        let squeezing = both.map(|[inverse, _, _]| inverse);
        // The logarithms of X functions are not of leading order.
        let shearing = both.map(|[_, logarithm, _]| Scalars {
            x_a: [0.0; 2],
            x_g: [0.0; 2],
            x_m: [0.0; 2],
            ..logarithm
        });
        Self {
            radii,
            numbers,
            squeezing: pair_frame::resistance_entries(&squeezing, radii),
            shearing: pair_frame::resistance_entries(&shearing, radii),
        }
    }

    /// ξ of a gap, in a.
    fn xi(&self, gap: f64) -> f64 {
        2.0 * gap / (self.radii[0] + self.radii[1])
    }

    /// The entries of the pair frame at a gap.
    #[inline(always)]
    fn entries(&self, gap: f64) -> [f64; ENTRIES] {
        let xi = self.xi(gap);
        let mut entries = [0.0; ENTRIES];
        if xi < self.numbers.cutoff {
            let x = xi.max(0.0) + self.numbers.regularisation;
            let (inverse, logarithm) = (x.recip(), -x.ln());
            for (k, entry) in entries.iter_mut().enumerate() {
                *entry = self.squeezing[k] * inverse + self.shearing[k] * logarithm;
            }
        }
        entries
    }

    /// The term at a gap, in a, which may be negative.
    #[inline(always)]
    pub(crate) fn evaluate(&self, gap: f64) -> PairTerm {
        PairTerm::new(&self.entries(gap))
    }

    /// Resistance K to slip at the contact of the pair alone, as
    /// [`super::NearField::slip_resistance`]: the term and isolated drags.
    pub(crate) fn slip_resistance(&self, gap: f64) -> f64 {
        let mut entries = self.entries(gap);
        for (sphere, a) in self.radii.into_iter().enumerate() {
            let (velocity, spin) = (3 * sphere, 3 * sphere + 1);
            entries[odd(velocity, velocity)] += 6.0 * PI * a;
            entries[odd(spin, spin)] += 8.0 * PI * a.powi(3);
        }
        pair_frame::slip_resistance(&entries, self.radii, gap)
    }
}

#[cfg(test)]
mod tests {
    use super::super::pair_frame::{axial, transverse};
    use super::super::two_sphere_resistance;
    use super::*;

    /// Terms without regularization.
    fn sharp(radii: [f64; 2]) -> LeadingOrderPair {
        let numbers = LeadingOrder {
            cutoff: 0.5,
            regularisation: 1e-300,
        };
        LeadingOrderPair::new(radii, numbers)
    }

    #[test]
    fn exact_pair_differs_by_less_than_the_leading_order_near_contact() {
        for radii in [[1.0, 1.0], [1.0, 1.4], [1.4, 1.0], [0.5, 2.0]] {
            let mean = 0.5 * (radii[0] + radii[1]);
            let pair = sharp(radii);
            let rest = |xi: f64| {
                let exact = two_sphere_resistance(radii[0], radii[1], mean * (2.0 + xi)).unwrap();
                exact - pair.evaluate(mean * xi).matrix()
            };
            let (near, nearer) = (rest(1e-4), rest(1e-6));
            let change = nearer - near;
            // 1/ξ grows by 1e6 − 1e4 between the two gaps and ln(1/ξ) by 4.6; the omitted terms of
            // X grow as the logarithm, and those of Y do not grow.
            for row in 0..12 {
                for column in 0..12 {
                    let most = 6.0 * PI * mean.powi(3) * 8.0;
                    assert!(
                        change[(row, column)].abs() < most,
                        "{radii:?} {row} {column} {change}"
                    );
                }
            }
            // The remainder of Y is of the order of ξ ln(1/ξ), 1e-3 at the first gap.
            let most = 1e-3 * 8.0 * PI * radii[0].max(radii[1]).powi(3);
            for mode in [1, 2, 4, 7, 8, 10] {
                for other in [1, 2, 4, 7, 8, 10] {
                    let left = change[(mode, other)].abs();
                    assert!(left < most, "{radii:?} {mode} {other} {left:.2e}");
                }
            }
            // The squeezing flow itself, which the terms must reproduce almost completely.
            let exact = two_sphere_resistance(radii[0], radii[1], mean * (2.0 + 1e-6)).unwrap();
            for (row, column) in [(0, 0), (0, 6), (0, 3), (3, 9), (5, 5)] {
                let ratio =
                    pair.evaluate(mean * 1e-6).matrix()[(row, column)] / exact[(row, column)];
                assert!(
                    (ratio - 1.0).abs() < 1e-4,
                    "{radii:?} {row} {column} {ratio}"
                );
            }
        }
    }

    #[test]
    fn term_is_positive_semidefinite_and_resists_no_rigid_motion() {
        for radii in [[1.0, 1.0], [1.0, 1.4], [1.0, 3.0], [1.0, 10.0], [5.0, 1.0]] {
            let pair = LeadingOrderPair::new(radii, LeadingOrder::DEFAULT);
            for gap in [-0.1, 0.0, 1e-4, 0.01, 0.1, 0.3] {
                let matrix = pair.evaluate(gap).matrix();
                assert!((matrix - matrix.transpose()).amax() < 1e-12 * matrix.amax());
                let lowest = matrix.symmetric_eigenvalues().min();
                assert!(
                    lowest > -1e-12 * matrix.amax(),
                    "{radii:?} {gap} {lowest:.2e}"
                );
                // Moving together along or across the line of centres.
                for mode in [0, 1] {
                    let force = matrix.column(mode) + matrix.column(6 + mode);
                    assert!(
                        force.amax() < 1e-12 * matrix.amax(),
                        "{radii:?} {gap} {mode}"
                    );
                }
            }
        }
    }

    #[test]
    fn beyond_the_cutoff_there_is_nothing_and_overlaps_are_as_contact() {
        let pair = LeadingOrderPair::new([1.0, 1.4], LeadingOrder::DEFAULT);
        assert_eq!(pair.evaluate(0.6), PairTerm::new(&[0.0; ENTRIES]));
        assert_ne!(pair.evaluate(0.599), PairTerm::new(&[0.0; ENTRIES]));
        assert_eq!(pair.evaluate(-0.01), pair.evaluate(0.0));
        let entries = pair.entries(0.0);
        assert_eq!(entries[transverse(0, 0)], 0.0);
        // X11A = 2λ²/(1 + λ)³ / δ at contact.
        let expected = 6.0 * PI * 2.0 * 1.4 * 1.4 / 2.4_f64.powi(3) / 1e-3;
        assert!((entries[axial(0, 0)] / expected - 1.0).abs() < 1e-14);
    }

    #[test]
    fn slip_of_a_free_pair_under_a_force_is_that_of_its_resistance() {
        // K is defined by a whole solve of the pair: forces ±1 across and the torques l that go
        // with them.
        let (radii, gap) = ([1.0, 1.4], 0.004);
        let pair = LeadingOrderPair::new(radii, LeadingOrder::DEFAULT);
        let term = pair.evaluate(gap).matrix();
        let modes = [0, 1, 2, 6, 7, 8];
        let mut resistance =
            nalgebra::SMatrix::<f64, 6, 6>::from_fn(|r, c| term[(modes[r], modes[c])]);
        for (sphere, a) in radii.into_iter().enumerate() {
            for (mode, drag) in [6.0 * PI * a, 6.0 * PI * a, 8.0 * PI * a.powi(3)]
                .into_iter()
                .enumerate()
            {
                resistance[(3 * sphere + mode, 3 * sphere + mode)] += drag;
            }
        }
        let levers = radii.map(|a| a + 0.5 * gap);
        let force =
            nalgebra::SVector::<f64, 6>::from([0.0, -1.0, -levers[0], 0.0, 1.0, -levers[1]]);
        let v = resistance.try_inverse().unwrap() * force;
        let slip = v[4] - v[1] - levers[0] * v[2] - levers[1] * v[5];
        assert!((pair.slip_resistance(gap) * slip - 1.0).abs() < 1e-12);
    }
}
