//! Hydrodynamics: two spheres, the far field of all, and the grand resistance that is made of both.

pub(crate) mod far_field;
pub(crate) mod iterative;
pub(crate) mod resistance;
pub mod two_sphere;
