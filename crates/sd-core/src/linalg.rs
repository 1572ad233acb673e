//! Linear algebra: the only modules that name faer and pulp.
//!
//! Everything allocates only in constructors and sums in a fixed order, so the same input gives the same bits. Only the
//! factorization of a large full matrix may be shared by an idle thread, in the same pieces and so with the same bits.

pub mod dense;
pub mod general;
pub mod gradients;
mod halves;
pub mod profile;
pub mod simd;
pub mod sparse;
pub mod staggered;
pub mod tiles;
mod vector;
