//! Conical asperities, which become stiffer under compression.
//!
//! ```text
//! F = k d² − ζ v_n,   d = h − g > 0,   F ≥ 0
//! ```
//!
//! k in mu·rate, ζ in mu·a; v_n is negative for approach. Source: Sneddon, Int. J. Eng. Sci. 3, 47
//! (1965), of a cone pressed into a half-space.

use super::{DASHPOT, STIFFNESS};
use crate::law::Quantity;

/// Keyword in campaign files.
pub const KEYWORD: &str = "cone";
/// Description.
pub const MEANING: &str = "`F = k d²`, the force of conical asperities.";
/// Its stiffness and its dashpot.
pub const PARAMETERS: &[&Quantity] = &[&STIFFNESS, &DASHPOT];
/// The surfaces touch.
pub const TOUCHES: bool = true;

/// Force at an overlap d, in a.
pub fn force(overlap: f64, stiffness: f64) -> f64 {
    stiffness * overlap.max(0.0).powi(2)
}

/// Slope dF/dd at an overlap d.
pub fn slope(overlap: f64, stiffness: f64) -> f64 {
    2.0 * stiffness * overlap.max(0.0)
}

/// Overlap at which the force has a given value.
pub fn overlap(force: f64, stiffness: f64) -> f64 {
    (force / stiffness).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twice_the_overlap_bears_four_times_the_force() {
        assert!((force(0.02, 5000.0) - 2.0).abs() < 1e-14);
        assert!((force(0.04, 5000.0) - 8.0).abs() < 1e-14);
        assert_eq!(force(-0.02, 5000.0), 0.0);
    }
}
