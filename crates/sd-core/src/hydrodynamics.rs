//! Hydrodynamics: two spheres, the far field of all, and the grand resistance that is made of both.

pub mod far_field;
pub mod iterative;
pub mod resistance;
pub mod two_sphere;
