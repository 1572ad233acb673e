//! Cholesky factorization of matrices that are zero outside a band and some last rows.
//!
//! ```text
//!     ▙               With spheres ordered along one side of a periodic cell, near ones couple within the band and, across
//!     ▜▙              the boundary, to the last rows. L fills in nowhere else.
//!      ▜▙
//!     ████
//! ```
//!
//! A full matrix is the special case of a band that reaches the last row. Storage is that of the
//! full matrix; entries outside are neither read nor written.

use crate::linalg::cholesky::dense::DenseCholesky;
use crate::linalg::dense::Matrix;
use crate::linalg::error::BadPivot;
use crate::linalg::simd::vectorised;
use crate::linalg::vector;
use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::{self, triangular::BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Par, Spec};
use std::ops::Range;

/// Columns eliminated together; a multiple of four.
pub(in crate::linalg) const PANEL: usize = 24;

/// Cholesky factorization `A = L Lᵀ` within a band and last rows, with its workspace.
#[derive(Default)]
pub struct SkylineCholesky {
    /// Storage and the full factorization.
    full: DenseCholesky,
    /// End of the band of each panel of columns, ascending; empty for a full matrix.
    ends: Vec<usize>,
    /// First of the last rows.
    tail: usize,
}

impl SkylineCholesky {
    /// Workspace for matrices up to `[n × n]`; grows for larger ones.
    pub fn new(n: usize) -> Self {
        Self {
            full: DenseCholesky::new(n),
            ends: Vec::with_capacity(n.div_ceil(PANEL)),
            tail: n,
        }
    }

    /// The matrix to fill (lower triangle) before [`SkylineCholesky::factor`], as a full matrix of
    /// any shape.
    pub fn full_matrix(&mut self) -> &mut Matrix {
        self.ends.clear();
        self.full.matrix_mut()
    }

    /// The matrix `[n × n]` to fill (lower triangle), zero in its profile.
    ///
    /// `ends`: by column, the end of the rows before `tail` that are not zero; rows from `tail` on
    /// may all be nonzero.
    pub fn matrix_of_skyline(
        &mut self,
        n: usize,
        ends: impl Iterator<Item = usize>,
        tail: usize,
    ) -> &mut Matrix {
        self.ends.clear();
        self.tail = tail.min(n);
        let mut reached = 0;
        for (column, end) in ends.enumerate().take(n) {
            reached = end.max(reached);
            let panel_end = (column - column % PANEL + PANEL).min(n);
            if column % PANEL == 0 {
                self.ends.push(0);
            }
            if let Some(last) = self.ends.last_mut() {
                *last = reached.max(panel_end).min(n);
            }
        }
        self.full.matrix_mut().reshape(n, n);
        for column in 0..n {
            let [band, last] = self.rows(column / PANEL);
            let values = self.full.matrix_mut().column_mut(column);
            values[column..band.end].fill(0.0);
            values[last].fill(0.0);
        }
        self.full.matrix_mut()
    }

    /// The matrix as filled so far, for additions within its profile.
    pub fn filled_matrix(&mut self) -> &mut Matrix {
        self.full.matrix_mut()
    }

    /// L, in the lower triangle; undefined outside the profile.
    pub fn lower(&self) -> &Matrix {
        self.full.lower()
    }

    /// Nonzero rows below a panel: within the band, and the last ones.
    pub(in crate::linalg) fn rows(&self, panel: usize) -> [Range<usize>; 2] {
        let n = self.lower().rows();
        let end = ((panel + 1) * PANEL).min(n);
        match self.ends.get(panel) {
            Some(&band) if band < self.tail => [end..band, self.tail..n],
            _ => [end..n, n..n],
        }
    }

    /// Factors the matrix in place.
    ///
    /// # Errors
    /// [`BadPivot`] with the row at which it broke down.
    pub fn factor(&mut self) -> Result<(), BadPivot> {
        if self.ends.is_empty() {
            return self.full.factor();
        }
        let n = self.lower().rows();
        for panel in 0..n.div_ceil(PANEL) {
            let [band, last] = self.rows(panel);
            let first = panel * PANEL;
            let width = band.start - first;
            let (matrix, scratch) = self.full.parts();
            let (left, right) = matrix.view_mut().split_at_col_mut(band.start);
            let (above, below) = left
                .submatrix_mut(0, first, n, width)
                .split_at_row_mut(band.start);
            let mut diagonal = above.submatrix_mut(first, 0, width, width);
            llt::factor::cholesky_in_place(
                diagonal.as_mut(),
                llt::factor::LltRegularization::default(),
                Par::Seq,
                MemStack::new(scratch),
                Spec::default(),
            )
            .map_err(
                |llt::factor::LltError::NonPositivePivot { index }| BadPivot {
                    pivot: first + index,
                },
            )?;
            let (near, far) = below.split_at_row_mut(last.start - band.start);
            let mut near = near.submatrix_mut(0, 0, band.len(), width);
            let mut far = far;
            for rows in [near.as_mut(), far.as_mut()] {
                solve_lower_triangular_in_place(diagonal.as_ref(), rows.transpose_mut(), Par::Seq);
            }
            let mut rest = right;
            let offset = last.start - band.start;
            for (rows, at, start) in [
                (near.as_ref(), 0, band.start),
                (far.as_ref(), offset, last.start),
            ] {
                let count = rows.nrows();
                matmul::triangular::matmul(
                    rest.as_mut().submatrix_mut(start, at, count, count),
                    BlockStructure::TriangularLower,
                    Accum::Add,
                    rows,
                    BlockStructure::Rectangular,
                    rows.transpose(),
                    BlockStructure::Rectangular,
                    -1.0,
                    Par::Seq,
                );
            }
            if !last.is_empty() && !band.is_empty() {
                matmul::matmul(
                    rest.submatrix_mut(last.start, 0, last.len(), band.len()),
                    Accum::Add,
                    far.as_ref(),
                    near.as_ref().transpose(),
                    -1.0,
                    Par::Seq,
                );
            }
        }
        Ok(())
    }

    /// `x ← A⁻¹ x` for one vector.
    pub fn solve(&self, x: &mut [f64]) {
        self.solve_lower_vector(x);
        self.solve_upper_vector(x);
    }

    /// `x ← L⁻¹ x` for one vector.
    pub fn solve_lower_vector(&self, x: &mut [f64]) {
        let (lower, n) = (self.lower(), self.lower().rows());
        vectorised(
            #[inline(always)]
            || {
                for j in (0..n).step_by(4) {
                    let end = (j + 4).min(n);
                    for k in j..end {
                        let column = lower.column(k);
                        let xk = x[k] / column[k];
                        x[k] = xk;
                        for row in k + 1..end {
                            x[row] -= column[row] * xk;
                        }
                    }
                    if end - j == 4 {
                        let [band, last] = self.rows(j / PANEL);
                        let weights = [0, 1, 2, 3].map(|k| -x[j + k]);
                        for rows in [end..band.end, last] {
                            let columns = [0, 1, 2, 3].map(|k| &lower.column(j + k)[rows.clone()]);
                            vector::add_four(&mut x[rows], columns, weights);
                        }
                    }
                }
            },
        );
    }

    /// `x ← L⁻ᵀ x` for one vector.
    pub fn solve_upper_vector(&self, x: &mut [f64]) {
        let (lower, n) = (self.lower(), self.lower().rows());
        vectorised(
            #[inline(always)]
            || {
                for j in (0..n).step_by(4).rev() {
                    let end = (j + 4).min(n);
                    if end - j == 4 {
                        let [band, last] = self.rows(j / PANEL);
                        for rows in [end..band.end, last] {
                            let columns = [0, 1, 2, 3].map(|k| &lower.column(j + k)[rows.clone()]);
                            let sums = vector::dot_four(columns, &x[rows]);
                            for (xk, sum) in x[j..end].iter_mut().zip(sums) {
                                *xk -= sum;
                            }
                        }
                    }
                    for k in (j..end).rev() {
                        let column = lower.column(k);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Fills a diagonally dominant matrix with a band of 30 rows and the last rows from `tail` on.
    fn fill(matrix: &mut Matrix, n: usize, tail: usize) {
        for j in 0..n {
            for i in (j..n).filter(|&i| i < j + 30 || i >= tail) {
                matrix[(i, j)] = (0.3 + i as f64 * 1.7 + j as f64).sin();
            }
            matrix[(j, j)] = n as f64;
        }
    }

    #[test]
    fn solves_are_those_of_the_full_matrix() {
        for (n, tail) in [(30, 20), (230, 190), (230, 230), (192, 144)] {
            let mut full = DenseCholesky::new(n);
            full.matrix_mut().reset(n, n);
            fill(full.matrix_mut(), n, tail);
            full.factor().unwrap();
            let mut profile = SkylineCholesky::new(n);
            // Entries outside must not be read.
            profile.full_matrix().reshape(n, n);
            profile.full_matrix().values_mut().fill(f64::NAN);
            let ends = (0..n).map(|j| (j + 30).min(n));
            fill(profile.matrix_of_skyline(n, ends, tail), n, tail);
            // `fill` writes within the profile only.
            profile.factor().unwrap();
            let mut x: Vec<f64> = (0..n).map(|k| (k as f64).cos()).collect();
            let mut y = x.clone();
            full.solve(&mut x);
            profile.solve(&mut y);
            assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-14));
        }
    }

    #[test]
    fn indefinite_matrix_names_its_row() {
        let mut profile = SkylineCholesky::new(100);
        let matrix = profile.matrix_of_skyline(100, 1..=100, 90);
        for k in 0..100 {
            matrix[(k, k)] = if k == 70 { -1.0 } else { 1.0 };
        }
        assert_eq!(profile.factor(), Err(BadPivot { pivot: 70 }));
    }
}
