//! Spheres that touch roll on each other, up to Coulomb's limit.
//!
//! ```text
//! F_roll = K u_t,   K > 0 the inverse slip mobility of the isolated pair, u_t the slip under normal forces alone
//! |F_roll| ≤ ν f: F_t = F_roll (rolls);   else F_t = ν f sign(u_t) (slips)
//! ```
//!
//! Forces in mu·a²·rate, K in mu·a. Source: Townsend & Wilson, Phys. Fluids 29, 121607 (2017),
//! steps 4 to 6, with a sign error of (19) corrected: friction opposes slip.

use super::FrictionConstraint;
use crate::law::Quantity;

/// Keyword in campaign files.
pub const KEYWORD: &str = "roll-slip";
/// Description.
pub const MEANING: &str =
    "The paper's law: the force at which the isolated pair would roll, at most ν f.";
/// It has no parameters.
pub const PARAMETERS: &[&Quantity] = &[];
/// The slip of the isolated pair.
pub const CONSTRAINT: FrictionConstraint = FrictionConstraint::IsolatedSlip;

/// Coulomb's limit.
pub fn bound(friction: f64, load: f64) -> f64 {
    friction * load
}

/// The friction force at a slip u_t and a load, and whether the pair rolls; the force has the sign
/// of the slip.
pub fn force(slip: f64, slip_resistance: f64, bound: f64) -> (f64, bool) {
    let roll = slip_resistance * slip;
    if roll.abs() <= bound {
        (roll, true)
    } else {
        (bound.copysign(roll), false)
    }
}

#[cfg(test)]
mod tests {
    use super::{bound, force};

    #[test]
    fn pair_rolls_up_to_the_limit_and_slips_beyond() {
        assert_eq!(force(0.1, 2.0, 0.3), (0.2, true));
        assert_eq!(force(-0.1, 2.0, 0.15), (-0.15, false));
        assert_eq!(force(0.0, 2.0, 0.0), (0.0, true));
    }

    #[test]
    fn friction_has_the_sign_of_the_slip_and_is_limited() {
        assert_eq!(force(0.1, 20.0, bound(0.5, 10.0)), (2.0, true));
        assert_eq!(force(-1.0, 20.0, bound(0.5, 10.0)), (-5.0, false));
        assert_eq!(force(1.0, 20.0, bound(0.0, 10.0)), (0.0, false));
    }
}
