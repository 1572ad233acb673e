//! Cholesky factorizations, by the storage of the matrix.

pub(crate) mod dense;
mod recursive;
pub(crate) mod skyline;
pub(crate) mod sparse;
pub(crate) mod tiled;
pub(crate) mod trailing;
