//! Friction of hydrodynamic roughness: a pair resists sliding below a range of gaps, without
//! touching.
//!
//! ```text
//! F = K_h u_t,   K_h = α 6π mu a (g0/g − 1) for g < g0,   none beyond
//! ```
//!
//! It acts at the contact point, halfway between the surfaces, with its torques and stresslets, in
//! addition to the exact resistance of the pair. u_t is the slip there, with the strain of the
//! fluid; a the mean radius. The force is linear in the velocities and dissipates K_h u_t², so it
//! belongs to the hydrodynamic resistance and its stress to the hydrodynamic stress. Beside
//! roll-slip friction K_h adds to the slip resistance of the pair.
//!
//! Source: Jamali & Brady, Phys. Rev. Lett. 123, 138002 (2019), whose lubrication between
//! asperities diverges as 1/g; here made continuous at g0.

use super::Quantity;
use super::quantity::Range;
use std::f64::consts::PI;

/// α.
pub static HYDRODYNAMIC_FRICTION: Quantity = Quantity {
    key: "hydrodynamic_friction",
    unit: "1",
    meaning: "hydrodynamic friction α",
    range: Range::from_to(0.0, 1e4),
    note: "sliding below the range is resisted by α 6 pi mu a (range/gap − 1)",
};

/// g0.
pub static HYDRODYNAMIC_FRICTION_RANGE: Quantity = Quantity {
    key: "hydrodynamic_friction_range",
    unit: "a",
    meaning: "range g0 of hydrodynamic friction",
    range: Range::above_to(0.0, 0.5),
    note: "",
};

/// Default of g0: that of asperities some per cent of a radius high.
pub const DEFAULT_RANGE: f64 = 0.1;

/// The law with its parameters; without friction by default.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HydrodynamicFriction {
    /// α.
    pub coefficient: f64,
    /// g0, in a.
    pub range: f64,
}

impl HydrodynamicFriction {
    /// K_h at a gap above 0, in mu·a.
    ///
    /// ```
    /// use sd_core::law::hydrodynamic_friction::HydrodynamicFriction;
    ///
    /// let friction = HydrodynamicFriction { coefficient: 2.0, range: 0.1 };
    /// assert_eq!(friction.resistance(0.1), 0.0);
    /// assert!((friction.resistance(0.05) - 12.0 * std::f64::consts::PI).abs() < 1e-12);
    /// ```
    pub fn resistance(&self, gap: f64) -> f64 {
        if gap < self.range {
            6.0 * PI * self.coefficient * (self.range / gap - 1.0)
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resistance_vanishes_at_the_range_and_without_a_coefficient() {
        let friction = HydrodynamicFriction {
            coefficient: 0.3,
            range: 0.05,
        };
        assert_eq!(friction.resistance(0.05), 0.0);
        assert_eq!(friction.resistance(1.0), 0.0);
        assert!(friction.resistance(0.05 * (1.0 - 1e-9)) < 1e-7);
        assert!(friction.resistance(1e-3) > friction.resistance(1e-2));
        assert_eq!(HydrodynamicFriction::default().resistance(1e-6), 0.0);
    }
}
