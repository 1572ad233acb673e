//! Geometry: the sheared cell, which spheres are near each other, and the six planar modes of a sphere.

pub mod cell;
pub mod modes;
pub(crate) mod neighbours;
pub(crate) mod pair;
mod verlet;
