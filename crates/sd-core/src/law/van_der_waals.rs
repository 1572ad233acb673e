//! Van der Waals attraction of the surfaces, between all pairs in range.
//!
//! ```text
//! F = −A a_ij/(24 (g² + δ²)),   a_ij = 2 a_i a_j/(a_i + a_j)
//! ```
//!
//! along the line of centres, at every gap g within lubrication range, in addition to a contact
//! law, which it does not affect: friction depends only on the contact force. The energy is that of
//! Derjaguin's approximation, kept finite by δ: `−A a_ij/(24 g)`, so that A is twice the Hamaker
//! constant.
//! Source: Singh, Pednekar, Chun, Denn & Morris, Phys. Rev. Lett. 122, 098004 (2019).

use super::Quantity;
use super::quantity::Range;

/// A, in units in which it is a property of the material.
pub static VAN_DER_WAALS: Quantity = Quantity {
    key: "van_der_waals",
    unit: "F a",
    meaning: "strength A of van der Waals attraction, twice the Hamaker constant",
    range: Range::from_to(0.0, 1e6),
    note: "in F_crit a, or kT if `colloid_unit` = \"thermal\"",
};

/// δ.
pub static VAN_DER_WAALS_LENGTH: Quantity = Quantity {
    key: "van_der_waals_length",
    unit: "a",
    meaning: "length δ at which van der Waals attraction ends its growth",
    range: Range::above_to(0.0, 0.5),
    note: "",
};

/// Default of δ.
pub const DEFAULT_LENGTH: f64 = 0.01;

/// The law, in the units of the solver.
///
/// ```
/// use sd_core::law::van_der_waals::VanDerWaals;
///
/// let attraction = VanDerWaals { energy: 24.0, length: 0.1 };
/// assert!((attraction.at(0.0, 1.0) + 100.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VanDerWaals {
    /// A, in mu·a³·rate.
    pub energy: f64,
    /// δ, in a.
    pub length: f64,
}

impl VanDerWaals {
    /// Force at a gap between spheres with this mean radius a_ij, in mu·a²·rate: below 0.
    pub fn at(&self, gap: f64, radius: f64) -> f64 {
        -self.energy * radius / (24.0 * (gap * gap + self.length * self.length))
    }

    /// Energy at a gap, from none far away, in mu·a³·rate.
    pub fn energy(&self, gap: f64, radius: f64) -> f64 {
        -self.energy * radius / (24.0 * self.length) * self.length.atan2(gap)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_is_the_slope_of_the_energy() {
        let law = VanDerWaals {
            energy: 5.0,
            length: 0.02,
        };
        let e = 1e-6;
        for gap in [0.0, 0.01, 0.3] {
            let slope = (law.energy(gap - e, 1.2) - law.energy(gap + e, 1.2)) / (2.0 * e);
            assert!((slope / law.at(gap, 1.2) - 1.0).abs() < 1e-7, "{gap}");
        }
    }

    #[test]
    fn energy_is_that_of_hamaker_with_half_of_the_constant() {
        let law = VanDerWaals {
            energy: 5.0,
            length: 1e-9,
        };
        // Two spheres of radii a and b at a distance r, Physica 4, 1058 (1937).
        let exact = |gap: f64, a: f64, b: f64| {
            let (sum, difference) = (a + b, a - b);
            let outside = gap * (gap + 2.0 * sum);
            let inside = (sum + gap).powi(2) - difference * difference;
            -2.5 / 6.0 * (2.0 * a * b * (1.0 / outside + 1.0 / inside) + (outside / inside).ln())
        };
        for [a, b] in [[1.0, 1.0], [1.0, 1.4]] {
            let radius = 2.0 * a * b / (a + b);
            let ratio = law.energy(1e-5, radius) / exact(1e-5, a, b);
            assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
        }
    }
}
