//! Linear algebra: the only modules that name faer and pulp.
//!
//! Everything allocates only in constructors and sums in a fixed order, so the same input gives the same bits. Only
//! large full matrices may be filled and factored with the help of an idle thread, in the same pieces and so with the same bits.

pub(crate) mod anderson;
pub(crate) mod cholesky;
pub(crate) mod conjugate_gradients;
pub(crate) mod dense;
pub(crate) mod error;
pub(crate) mod gmres;
pub(crate) mod join;
pub(crate) mod lu;
pub(crate) mod simd;
pub(crate) mod staggered;
mod vector;

/// When an iteration ends: whichever comes first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Until {
    /// The residual is at most this.
    pub(crate) residual: f64,
    /// So many iterations are done.
    pub(crate) iterations: usize,
}

impl Until {
    pub(crate) fn new(residual: f64, iterations: usize) -> Self {
        Self {
            residual,
            iterations,
        }
    }
}

pub use cholesky::skyline::SkylineCholesky;
pub use cholesky::tiled::{TiledCholesky, TiledMatrix};
pub use dense::Matrix;
pub use error::BadPivot;
pub use simd::vectorised;
pub use staggered::StaggeredColumns;
