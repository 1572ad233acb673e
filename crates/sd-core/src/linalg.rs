//! Linear algebra: the only modules that name faer and pulp.
//!
//! Everything runs on one thread (`Par::Seq`), allocates only in constructors and sums in a fixed
//! order, so the same input gives the same bits.

pub mod dense;
pub mod profile;
pub mod simd;
pub mod staggered;
mod vector;
