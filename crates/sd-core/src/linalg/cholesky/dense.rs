//! Cholesky factorization of a dense matrix stored by columns.

use crate::linalg::dense::Matrix;
use crate::linalg::error::BadPivot;
use crate::linalg::simd::vectorised;
use crate::linalg::vector;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::{Par, Spec};

/// Cholesky factorization `A = L Lᵀ` of a symmetric positive definite matrix, with its workspace.
pub struct DenseCholesky {
    /// L in the lower triangle; the upper triangle is undefined.
    factor: Matrix,
    /// Scratch, sized for the largest matrix so far.
    scratch: MemBuffer,
    /// Largest dimension of the scratch.
    capacity: usize,
}

impl Default for DenseCholesky {
    fn default() -> Self {
        Self::new(0)
    }
}

impl DenseCholesky {
    /// Workspace for matrices up to `[n × n]`; grows for larger ones.
    pub fn new(n: usize) -> Self {
        let mut factor = Matrix::zeros(n, n);
        factor.reset(0, 0);
        Self {
            factor,
            scratch: scratch(n),
            capacity: n,
        }
    }

    /// The matrix to fill (lower triangle) before [`DenseCholesky::factor`]; holds L afterwards.
    pub fn matrix_mut(&mut self) -> &mut Matrix {
        &mut self.factor
    }

    /// L, in the lower triangle.
    pub fn lower(&self) -> &Matrix {
        &self.factor
    }

    /// Factors the matrix written into [`DenseCholesky::matrix_mut`], in place. Cost n³/3.
    ///
    /// # Errors
    /// [`BadPivot`] with the row at which it broke down.
    pub fn factor(&mut self) -> Result<(), BadPivot> {
        let n = self.factor.rows();
        if n > self.capacity {
            self.scratch = scratch(n);
            self.capacity = n;
        }
        llt::factor::cholesky_in_place(
            self.factor.view_mut(),
            llt::factor::LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut self.scratch),
            Spec::default(),
        )
        .map(|_| ())
        .map_err(|llt::factor::LltError::NonPositivePivot { index }| BadPivot { pivot: index })
    }

    /// `x ← A⁻¹ x` for one vector.
    pub fn solve(&self, x: &mut [f64]) {
        self.solve_lower_vector(x);
        self.solve_upper_vector(x);
    }

    /// `x ← L⁻¹ x` for one vector.
    pub fn solve_lower_vector(&self, x: &mut [f64]) {
        let n = self.factor.rows();
        vectorised(
            #[inline(always)]
            || {
                for j in (0..n).step_by(4) {
                    let end = (j + 4).min(n);
                    for k in j..end {
                        let column = self.factor.column(k);
                        let xk = x[k] / column[k];
                        x[k] = xk;
                        for row in k + 1..end {
                            x[row] -= column[row] * xk;
                        }
                    }
                    if end - j == 4 && end < n {
                        let (done, rest) = x.split_at_mut(end);
                        let columns = [0, 1, 2, 3].map(|k| &self.factor.column(j + k)[end..n]);
                        vector::add_four(rest, columns, [0, 1, 2, 3].map(|k| -done[j + k]));
                    }
                }
            },
        );
    }

    /// `x ← L⁻ᵀ x` for one vector.
    pub fn solve_upper_vector(&self, x: &mut [f64]) {
        let n = self.factor.rows();
        vectorised(
            #[inline(always)]
            || {
                for j in (0..n).step_by(4).rev() {
                    let end = (j + 4).min(n);
                    if end - j == 4 && end < n {
                        let (open, rest) = x.split_at_mut(end);
                        let columns = [0, 1, 2, 3].map(|k| &self.factor.column(j + k)[end..n]);
                        for (xk, sum) in open[j..].iter_mut().zip(vector::dot_four(columns, rest)) {
                            *xk -= sum;
                        }
                    }
                    for k in (j..end).rev() {
                        let column = self.factor.column(k);
                        for row in k + 1..end {
                            x[k] -= column[row] * x[row];
                        }
                        x[k] /= column[k];
                    }
                }
            },
        );
    }
}

/// Scratch for a Cholesky factorization of dimension n.
fn scratch(n: usize) -> MemBuffer {
    MemBuffer::new(llt::factor::cholesky_in_place_scratch::<f64>(
        n,
        Par::Seq,
        Spec::default(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A well-conditioned symmetric positive definite matrix without structure.
    fn spd(n: usize) -> Matrix {
        let mut a = Matrix::zeros(n, n);
        for j in 0..n {
            for i in 0..n {
                a[(i, j)] = 1.0 / (1.0 + (i as f64 - j as f64).abs()) + f64::from(u8::from(i == j));
            }
        }
        a
    }

    #[test]
    fn solve_has_small_residual() {
        let n = 57;
        let a = spd(n);
        let b: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
        let mut cholesky = DenseCholesky::new(n);
        cholesky.matrix_mut().clone_from(&a);
        cholesky.factor().unwrap();
        let mut x = b.clone();
        cholesky.solve(&mut x);
        let mut ax = vec![0.0; n];
        a.add_product(&x, &mut ax);
        assert!(ax.iter().zip(&b).all(|(p, q)| (p - q).abs() < 1e-13));
    }

    #[test]
    fn indefinite_matrix_names_its_row() {
        let mut cholesky = DenseCholesky::new(3);
        let matrix = cholesky.matrix_mut();
        matrix.reset(3, 3);
        matrix[(0, 0)] = 1.0;
        matrix[(1, 1)] = 1.0;
        matrix[(2, 2)] = -1.0;
        assert_eq!(cholesky.factor(), Err(BadPivot { pivot: 2 }));
    }
}
