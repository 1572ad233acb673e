//! Cholesky factorizations, by how the matrix is held.

pub(in crate::linalg) mod recursive;
pub mod skyline;
pub mod sparse;
pub mod tiled;
