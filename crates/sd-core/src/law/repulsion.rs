//! A short-ranged repulsion of the surfaces, as between charged spheres in an electrolyte.
//!
//! ```text
//! F = F0 a_ij/a exp(−g/l),   a_ij = 2 a_i a_j/(a_i + a_j)
//! ```
//!
//! along the line of centres, at every gap g within lubrication range, alone or in addition to a
//! contact law, which it does not affect: friction depends only on the contact force. Source: Mari
//! et al., J. Rheol. 58, 1693 (2014), eq. (13).

use super::Quantity;
use super::quantity::Range;

/// F0, in units in which it is a property of the material while Γ varies.
pub static REPULSION: Quantity = Quantity {
    key: "repulsion",
    unit: "F",
    meaning: "repulsion F0",
    range: Range::from_to(0.0, 1e6),
    note: "between spheres of radius a, in F_crit, or kT/a if `colloid_unit` = \"thermal\"",
};

/// Decay length l.
pub static REPULSION_LENGTH: Quantity = Quantity {
    key: "repulsion_length",
    unit: "a",
    meaning: "decay length of the repulsion",
    range: Range::above_to(0.0, 0.5),
    note: "in a",
};

/// Default of F0 where only the repulsion separates the spheres.
pub const REPULSION_ALONE: f64 = 1.0;
/// Default of l: Mari et al., J. Rheol. 58, 1693 (2014).
pub const DEFAULT_LENGTH: f64 = 0.02;

/// The law, in the units of the solver.
///
/// ```
/// use sd_core::law::repulsion::ExponentialRepulsion;
///
/// let repulsion = ExponentialRepulsion { force: 2.0, length: 0.02 };
/// assert_eq!(repulsion.at(0.0, 1.0), 2.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExponentialRepulsion {
    /// F0 of spheres of radius a, in mu·a²·rate.
    pub force: f64,
    /// l, in a.
    pub length: f64,
}

impl ExponentialRepulsion {
    /// Force at a gap between spheres with this mean radius a_ij, in mu·a²·rate.
    pub fn at(&self, gap: f64, radius: f64) -> f64 {
        self.force * radius * (-gap / self.length).exp()
    }

    /// Energy stored at a gap, in mu·a³·rate.
    pub fn energy(&self, gap: f64, radius: f64) -> f64 {
        self.length * self.at(gap, radius)
    }
}

#[cfg(test)]
mod tests {
    use super::ExponentialRepulsion;

    #[test]
    fn force_is_the_slope_of_the_energy_and_decays_over_the_length() {
        let law = ExponentialRepulsion {
            force: 3.0,
            length: 0.02,
        };
        assert_eq!(law.at(0.0, 1.0), 3.0);
        assert!((law.at(0.02, 1.2) / 3.6 - (-1.0_f64).exp()).abs() < 1e-15);
        let e = 1e-7;
        let slope = (law.energy(0.01 - e, 1.2) - law.energy(0.01 + e, 1.2)) / (2.0 * e);
        assert!((slope / law.at(0.01, 1.2) - 1.0).abs() < 1e-8);
    }
}
