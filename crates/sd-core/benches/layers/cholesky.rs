//! faer's bare Cholesky factorization of a matrix `[6N × 6N]`: the reference for the time of
//! right-hand sides.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::{Mat, Par, Spec};

/// A matrix to factor again and again.
pub(crate) struct BareCholesky {
    matrix: Mat<f64>,
    scratch: MemBuffer,
}

impl BareCholesky {
    /// For a matrix of N spheres.
    pub(crate) fn new(spheres: usize) -> Self {
        let n = 6 * spheres;
        let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Spec::default());
        Self {
            matrix: Mat::zeros(n, n),
            scratch: MemBuffer::new(scratch),
        }
    }

    /// A matrix that can be factored.
    pub(crate) fn reset(&mut self) {
        self.matrix.fill(0.0);
        for k in 0..self.matrix.nrows() {
            self.matrix[(k, k)] = 2.0;
        }
    }

    /// Factors it in place; to be timed without the rest.
    pub(crate) fn factor(&mut self) {
        llt::factor::cholesky_in_place(
            self.matrix.as_mut(),
            llt::factor::LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut self.scratch),
            Spec::default(),
        )
        .expect("a positive diagonal");
    }
}
