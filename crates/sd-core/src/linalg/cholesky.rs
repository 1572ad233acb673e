//! Cholesky factorizations, by how the matrix is held.

pub(crate) mod dense;
mod recursive;
pub(crate) mod skyline;
pub(crate) mod sparse;
pub(crate) mod tiled;
pub(crate) mod trailing;
