//! Cholesky factorizations, by the storage of the matrix.

pub(crate) mod dense;
pub(crate) mod sparse;
pub(crate) mod tiled;
pub(crate) mod trailing;
