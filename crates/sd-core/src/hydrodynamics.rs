//! Hydrodynamics: spheres in unbounded fluid, two spheres, the far field, and the grand resistance
//! composed of both.

pub(crate) mod applied_forces;
pub(crate) mod far_field;
pub(crate) mod free_space;
pub(crate) mod inverse_mobility;
pub(crate) mod iterative;
pub(crate) mod part_of_pairs;
pub(crate) mod resistance;
pub mod two_sphere;
