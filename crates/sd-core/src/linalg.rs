//! Linear algebra: the only modules that name faer and pulp.
//!
//! Everything allocates only in constructors and sums in a fixed order, so the same input gives the same bits. Only the
//! factorization of a large full matrix may be shared by an idle thread, in the same pieces and so with the same bits.

pub mod anderson;
pub mod cholesky;
pub mod conjugate_gradients;
pub mod dense;
pub mod gmres;
pub mod lu;
pub mod simd;
pub mod staggered;
mod vector;
