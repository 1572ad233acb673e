//! Rigid asperities: the gap of two spheres never falls below the roughness height.
//!
//! ```text
//! f ≥ 0,   d ≤ 0,   f d = 0
//! ```
//!
//! The force is the reaction that keeps them apart. Source: Townsend & Wilson, Phys. Fluids 29,
//! 121607 (2017), eq. (12)-(13).

use crate::law::Quantity;

/// Keyword in campaign files.
pub const KEYWORD: &str = "rigid";
/// Description.
pub const MEANING: &str = "The gap never falls below the roughness height.";
/// It has no parameters.
pub const PARAMETERS: &[&Quantity] = &[];
/// The surfaces touch.
pub const TOUCHES: bool = true;

/// The force follows from the motion and not from the law.
pub fn force(_overlap: f64, _stiffness: f64) -> f64 {
    0.0
}

/// The contact is rigid.
pub fn slope(_overlap: f64, _stiffness: f64) -> f64 {
    f64::INFINITY
}

/// There is no overlap at any force.
pub fn overlap(_force: f64, _stiffness: f64) -> f64 {
    0.0
}
