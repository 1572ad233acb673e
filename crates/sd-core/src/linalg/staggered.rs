//! Solves and products of columns that start at different rows.
//!
//! The column of a contact is zero above the rows of its first sphere, before and after `L⁻¹`. With
//! the columns ordered by their starts, each block of rows involves only the leading columns, and a
//! product of two blocks of columns only the rows below both starts: half to a third of the dense
//! cost.

use super::cholesky::dense::DenseCholesky;
use super::dense::Matrix;
use super::simd::vectorised;
use super::vector;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Par};

/// Columns of the factor eliminated together.
const PANEL: usize = 24;
/// Columns multiplied together.
const COLUMNS: usize = 24;

/// Columns `[n × K]`, each zero above its start.
#[derive(Debug, Clone, Default)]
pub struct StaggeredColumns {
    matrix: Matrix,
    /// First row of each column that may be nonzero, ascending.
    starts: Vec<usize>,
}

impl StaggeredColumns {
    /// Zero columns with the given starts, in ascending order.
    pub fn reset(&mut self, rows: usize, starts: impl Iterator<Item = usize>) {
        self.starts.clear();
        self.starts.extend(starts);
        debug_assert!(self.starts.is_sorted(), "columns must be ordered");
        self.matrix.reset(rows, self.starts.len());
    }

    /// Number of columns.
    pub fn count(&self) -> usize {
        self.starts.len()
    }

    /// A column, mutable below its start.
    pub fn column_mut(&mut self, k: usize) -> &mut [f64] {
        self.matrix.column_mut(k)
    }

    /// First row of a column that may be nonzero, and the column from there on.
    pub fn tail(&self, k: usize) -> (usize, &[f64]) {
        let start = self.starts[k];
        (start, &self.matrix.column(k)[start..])
    }

    /// `Bᵀ x`, appended to `out`.
    pub fn add_transposed_product(&self, x: &[f64], out: &mut Vec<f64>) {
        vectorised(
            #[inline(always)]
            || {
                let whole = self.count() - self.count() % 4;
                // Four columns from the start of the first: the others are zero above their own
                // starts.
                for k in (0..whole).step_by(4) {
                    let start = self.starts[k];
                    let columns = [0, 1, 2, 3].map(|c| &self.matrix.column(k + c)[start..]);
                    out.extend_from_slice(&vector::dot_four(columns, &x[start..]));
                }
                for k in whole..self.count() {
                    let (start, column) = self.tail(k);
                    out.push(vector::dot_inline(column, &x[start..]));
                }
            },
        );
    }

    /// `y ← y + B x`.
    pub fn add_product(&self, x: &[f64], y: &mut [f64]) {
        vectorised(
            #[inline(always)]
            || {
                let whole = self.count() - self.count() % 4;
                for k in (0..whole).step_by(4) {
                    let start = self.starts[k];
                    let columns = [0, 1, 2, 3].map(|c| &self.matrix.column(k + c)[start..]);
                    let weights = [0, 1, 2, 3].map(|c| x[k + c]);
                    vector::add_four(&mut y[start..], columns, weights);
                }
                for (k, &weight) in x.iter().enumerate().skip(whole) {
                    let (start, column) = self.tail(k);
                    vector::add_scaled_inline(&mut y[start..], column, weight);
                }
            },
        );
    }

    /// Replaces the columns B by `L⁻¹ B`.
    pub fn solve_lower(&mut self, cholesky: &DenseCholesky) {
        let n = self.matrix.rows();
        let lower = cholesky.lower();
        let mut columns = 0;
        for first in (0..n).step_by(PANEL) {
            let end = (first + PANEL).min(n);
            while columns < self.starts.len() && self.starts[columns] < end {
                columns += 1;
            }
            if columns == 0 {
                continue;
            }
            let begun = self.matrix.view_mut().submatrix_mut(0, 0, n, columns);
            let (above, below) = begun.split_at_row_mut(end);
            let mut block = above.submatrix_mut(first, 0, end - first, columns);
            solve_lower_triangular_in_place(
                lower.view(first, first, end - first, end - first),
                block.as_mut(),
                Par::Seq,
            );
            if end < n {
                matmul(
                    below,
                    Accum::Add,
                    lower.view(end, first, n - end, end - first),
                    block.as_ref(),
                    -1.0,
                    Par::Seq,
                );
            }
        }
    }

    /// `C = Bᵀ B`, both triangles.
    pub fn gram(&self, c: &mut Matrix) {
        let (n, count) = (self.matrix.rows(), self.count());
        c.reshape(count, count);
        for first in (0..count).step_by(COLUMNS) {
            let width = COLUMNS.min(count - first);
            let start = self.starts[first];
            matmul(
                c.view_mut().submatrix_mut(first, 0, width, first + width),
                Accum::Replace,
                self.matrix.view(start, first, n - start, width).transpose(),
                self.matrix.view(start, 0, n - start, first + width),
                1.0,
                Par::Seq,
            );
        }
        c.mirror_lower();
    }

    /// `C = Bᵀ A` for columns A of the same length.
    pub fn transposed_product(&self, a: &Self, c: &mut Matrix) {
        let (n, count) = (self.matrix.rows(), self.count());
        c.reshape(count, a.count());
        for first in (0..count).step_by(COLUMNS) {
            let width = COLUMNS.min(count - first);
            // Columns of A that start above the block together, then the others piece by piece.
            let above = a.starts.partition_point(|&s| s <= self.starts[first]);
            let mut column = 0;
            while column < a.count() {
                let end = if column < above {
                    above
                } else {
                    (column + COLUMNS).min(a.count())
                };
                let start = self.starts[first].max(a.starts[column]);
                matmul(
                    c.view_mut()
                        .submatrix_mut(first, column, width, end - column),
                    Accum::Replace,
                    self.matrix.view(start, first, n - start, width).transpose(),
                    a.matrix.view(start, column, n - start, end - column),
                    1.0,
                    Par::Seq,
                );
                column = end;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::dense::dot;

    /// Columns whose starts are given, in a space of 120 dimensions.
    fn columns(starts: &[usize]) -> StaggeredColumns {
        let mut b = StaggeredColumns::default();
        b.reset(120, starts.iter().copied());
        for (k, &start) in starts.iter().enumerate() {
            for (row, x) in b.column_mut(k).iter_mut().enumerate().skip(start) {
                *x = (0.3 + row as f64 * 1.7 + k as f64).sin();
            }
        }
        b
    }

    #[test]
    fn products_are_those_of_whole_columns() {
        let starts: Vec<usize> = (0..70).map(|k| k + k / 3).collect();
        let (a, b) = (columns(&starts), columns(&[5, 5, 60, 61, 118]));
        let (mut gram, mut product) = (Matrix::default(), Matrix::default());
        a.gram(&mut gram);
        b.transposed_product(&a, &mut product);
        for k in 0..a.count() {
            for l in 0..a.count() {
                let expected = dot(a.matrix.column(k), a.matrix.column(l));
                assert!((gram[(l, k)] - expected).abs() < 1e-12);
            }
            let (mut sums, mut sum) = (Vec::new(), vec![0.0; 120]);
            b.add_transposed_product(a.matrix.column(k), &mut sums);
            b.add_product(&sums, &mut sum);
            for (row, x) in sum.iter().enumerate() {
                let expected: f64 = (0..b.count()).map(|l| sums[l] * b.matrix[(row, l)]).sum();
                assert!((x - expected).abs() < 1e-12);
            }
            for l in 0..b.count() {
                let expected = dot(a.matrix.column(k), b.matrix.column(l));
                assert!((product[(l, k)] - expected).abs() < 1e-12);
                assert!((sums[l] - expected).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn solves_are_those_of_whole_columns() {
        let mut cholesky = DenseCholesky::new(120);
        let matrix = cholesky.matrix_mut();
        matrix.reset(120, 120);
        for j in 0..120 {
            for i in j..120 {
                matrix[(i, j)] = 1.0 / (1.0 + (i - j) as f64) + f64::from(u8::from(i == j));
            }
        }
        cholesky.factor().unwrap();
        let mut b = columns(&[0, 3, 47, 48, 90, 119]);
        let before = b.clone();
        b.solve_lower(&cholesky);
        for k in 0..b.count() {
            let mut expected = before.matrix.column(k).to_vec();
            cholesky.solve_lower_vector(&mut expected);
            let (start, tail) = b.tail(k);
            assert!(expected[..start].iter().all(|&x| x == 0.0));
            assert!(
                tail.iter()
                    .zip(&expected[start..])
                    .all(|(x, y)| (x - y).abs() < 1e-13)
            );
        }
    }
}
