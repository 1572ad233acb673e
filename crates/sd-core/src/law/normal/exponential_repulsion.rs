//! Surfaces that never touch: only the repulsion of [`crate::law::repulsion`] separates the
//! spheres.

use crate::law::Quantity;

/// Keyword in campaign files.
pub const KEYWORD: &str = "exponential-repulsion";
/// Description.
pub const MEANING: &str = "The repulsion `F = F0 exp(−g/l)` alone: the surfaces never touch.";
/// Those of the repulsion belong to every law that it is added to.
pub const PARAMETERS: &[&Quantity] = &[];
/// There is no contact, and so no friction.
pub const TOUCHES: bool = false;

/// There is no contact force.
pub fn force(_overlap: f64, _stiffness: f64) -> f64 {
    0.0
}

/// There is no contact force.
pub fn slope(_overlap: f64, _stiffness: f64) -> f64 {
    0.0
}

/// There is no contact force.
pub fn overlap(_force: f64, _stiffness: f64) -> f64 {
    0.0
}
