//! Hertz's law of elastic spheres, with an optional dashpot.
//!
//! ```text
//! F = k d^(3/2) − ζ v_n,   d = h − g > 0,   F ≥ 0
//! ```
//!
//! k in mu·a^(1/2)·rate, ζ in mu·a; for two equal spheres of modulus E and Poisson number σ it is
//! `k = E (2a)^(1/2) / (3 (1 − σ²))`. Source: Hertz, J. reine angew. Math. 92, 156 (1881); Johnson,
//! Contact Mechanics (1985), eq. (4.23).

use super::{DASHPOT, STIFFNESS};
use crate::law::Quantity;

/// Keyword in campaign files.
pub const KEYWORD: &str = "hertz";
/// Description.
pub const MEANING: &str = "`F = k d^(3/2)`, the force of elastic spheres.";
/// Its stiffness and its dashpot.
pub const PARAMETERS: &[&Quantity] = &[&STIFFNESS, &DASHPOT];
/// The surfaces touch.
pub const TOUCHES: bool = true;

/// Force at an overlap d, in a.
pub fn force(overlap: f64, stiffness: f64) -> f64 {
    let d = overlap.max(0.0);
    stiffness * d * d.sqrt()
}

/// Slope dF/dd at an overlap d.
pub fn slope(overlap: f64, stiffness: f64) -> f64 {
    1.5 * stiffness * overlap.max(0.0).sqrt()
}

/// Overlap at which the force has a given value.
pub fn overlap(force: f64, stiffness: f64) -> f64 {
    (force / stiffness).cbrt().powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_grows_as_the_overlap_to_three_halves() {
        assert!((force(0.04, 100.0) - 0.8).abs() < 1e-15);
        assert_eq!(force(-0.04, 100.0), 0.0);
        assert!((overlap(0.8, 100.0) - 0.04).abs() < 1e-15);
        let e = 1e-6;
        let difference = (force(0.04 + e, 100.0) - force(0.04 - e, 100.0)) / (2.0 * e);
        assert!((slope(0.04, 100.0) - difference).abs() < 1e-6);
    }
}
