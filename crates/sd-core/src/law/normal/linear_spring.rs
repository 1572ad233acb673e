//! A linear spring between surfaces, with an optional dashpot.
//!
//! ```text
//! F = k d − ζ v_n,   d = h − g > 0,   F ≥ 0
//! ```
//!
//! k in mu·a·rate, ζ in mu·a; v_n is negative for approach. Source: Cundall & Strack, Géotechnique
//! 29, 47 (1979); in suspensions Seto et al., Phys. Rev. Lett. 111, 218301 (2013). The dashpot
//! never pulls.

use super::{DASHPOT, STIFFNESS};
use crate::law::Quantity;

/// Keyword in campaign files.
pub const KEYWORD: &str = "linear-spring";
/// Description.
pub const MEANING: &str = "`F = k d`, a linear spring.";
/// Its stiffness and its dashpot.
pub const PARAMETERS: &[&Quantity] = &[&STIFFNESS, &DASHPOT];
/// The surfaces touch.
pub const TOUCHES: bool = true;

/// Force of the spring at an overlap d, in a.
pub fn force(overlap: f64, stiffness: f64) -> f64 {
    stiffness * overlap.max(0.0)
}

/// Slope dF/dd at an overlap d.
pub fn slope(overlap: f64, stiffness: f64) -> f64 {
    if overlap > 0.0 { stiffness } else { 0.0 }
}

/// Overlap at which the force has a given value.
pub fn overlap(force: f64, stiffness: f64) -> f64 {
    force / stiffness
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_grows_with_the_overlap_and_never_pulls() {
        assert_eq!(force(0.002, 500.0), 1.0);
        assert_eq!(force(-0.002, 500.0), 0.0);
        assert_eq!(overlap(1.0, 500.0), 0.002);
    }
}
