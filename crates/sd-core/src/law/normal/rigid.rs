//! Rigid asperities: the gap of two spheres never falls below the roughness height.
//!
//! ```text
//! f ≥ 0,   d ≤ 0,   f d = 0
//! ```
//!
//! The force is whatever keeps them apart. Source: Townsend & Wilson, Phys. Fluids 29, 121607 (2017), eq. (12)-(13).

use crate::law::Quantity;

/// Its word.
pub const WORD: &str = "rigid";
/// What it does.
pub const MEANING: &str = "Gaps are held at the roughness height.";
/// It has no parameters.
pub const PARAMETERS: &[&Quantity] = &[];
/// The surfaces touch.
pub const TOUCHES: bool = true;

/// The law alone gives no force: the motion decides.
pub fn force(_overlap: f64, _stiffness: f64) -> f64 {
    0.0
}

/// It gives way to nothing.
pub fn slope(_overlap: f64, _stiffness: f64) -> f64 {
    f64::INFINITY
}

/// No force makes it overlap.
pub fn overlap(_force: f64, _stiffness: f64) -> f64 {
    0.0
}
