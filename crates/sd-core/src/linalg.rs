//! Linear algebra: the only modules that name faer and pulp.
//!
//! All code allocates only for sizes larger than any before, and sums in a fixed order, so the same
//! input gives the same bits.

pub(crate) mod anderson;
pub(crate) mod cholesky;
pub(crate) mod dense;
pub(crate) mod error;
pub(crate) mod gmres;
pub(crate) mod lanczos;
pub(crate) mod lu;
pub(crate) mod polynomial;
pub(crate) mod simd;
pub(crate) mod staggered;
mod vector;

/// The whole number below a number from 0 on; casts saturate.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "callers count what fits the memory"
)]
#[inline(always)]
pub(crate) fn whole(x: f64) -> usize {
    x as usize
}

/// Stopping criteria of an iteration; the first one met ends it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StopCriteria {
    /// Residual to reach.
    pub(crate) residual: f64,
    /// Maximum number of iterations.
    pub(crate) iterations: usize,
}

impl StopCriteria {
    pub(crate) fn new(residual: f64, iterations: usize) -> Self {
        Self {
            residual,
            iterations,
        }
    }
}

pub use cholesky::tiled::{TiledCholesky, TiledMatrix};
pub use dense::Matrix;
pub use simd::vectorised;
pub use staggered::StaggeredColumns;
