//! Dense column-major matrices and their products.

use super::simd::vectorised;
use super::vector;
pub(crate) use super::vector::{add_scaled, add_scaled_and_dot, dot};
use faer::linalg::matmul;
use faer::{Accum, MatMut, MatRef, Par};

/// A dense matrix `[rows × columns]`, stored by columns.
#[derive(Debug, Clone, Default)]
pub struct Matrix {
    rows: usize,
    columns: usize,
    /// Entries, column after column.
    values: Vec<f64>,
}

impl Matrix {
    /// All zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            values: vec![0.0; rows * columns],
        }
    }

    /// Sets the shape and zeroes all entries; allocates only beyond the largest shape so far.
    pub fn reset(&mut self, rows: usize, columns: usize) {
        self.rows = rows;
        self.columns = columns;
        self.values.clear();
        self.values.resize(rows * columns, 0.0);
    }

    /// Sets the shape without clearing entries, for matrices that are then overwritten.
    pub fn reshape(&mut self, rows: usize, columns: usize) {
        self.rows = rows;
        self.columns = columns;
        self.values.resize(rows * columns, 0.0);
    }

    /// Reserves that many entries, so that matrices up to that size allocate nothing.
    pub fn reserve(&mut self, entries: usize) {
        self.values
            .reserve(entries.saturating_sub(self.values.len()));
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// One column.
    pub fn column(&self, j: usize) -> &[f64] {
        &self.values[j * self.rows..(j + 1) * self.rows]
    }

    /// One column, mutable.
    pub fn column_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.values[j * self.rows..(j + 1) * self.rows]
    }

    /// All entries, column after column.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All entries, mutable.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Copies the lower triangle onto the upper.
    pub fn mirror_lower(&mut self) {
        for j in 0..self.columns {
            for i in j + 1..self.rows {
                self[(j, i)] = self[(i, j)];
            }
        }
    }

    /// `y ← y + A x`, with the leading rows of A that y has. Columns with x = 0 are skipped.
    pub fn add_product(&self, x: &[f64], y: &mut [f64]) {
        vectorised(
            #[inline(always)]
            || {
                let (mut columns, mut weights, mut count) = ([&self.values[..0]; 4], [0.0; 4], 0);
                for (j, &xj) in x.iter().enumerate() {
                    if xj != 0.0 {
                        columns[count] = &self.column(j)[..y.len()];
                        weights[count] = xj;
                        count += 1;
                        if count == 4 {
                            vector::add_four(y, columns, weights);
                            count = 0;
                        }
                    }
                }
                for k in 0..count {
                    vector::add_scaled_inline(y, columns[k], weights[k]);
                }
            },
        );
    }

    /// `y ← y − Aᵀ x`, with the leading rows of A that x has.
    pub fn subtract_transposed_product(&self, x: &[f64], y: &mut [f64]) {
        vectorised(
            #[inline(always)]
            || {
                let mut four = y.chunks_exact_mut(4);
                let mut j = 0;
                for four in &mut four {
                    let columns = [0, 1, 2, 3].map(|k| &self.column(j + k)[..x.len()]);
                    for (yj, product) in four.iter_mut().zip(vector::dot_four(columns, x)) {
                        *yj -= product;
                    }
                    j += 4;
                }
                for (k, yj) in four.into_remainder().iter_mut().enumerate() {
                    *yj -= vector::dot_inline(&self.column(j + k)[..x.len()], x);
                }
            },
        );
    }

    /// A block as a view of faer.
    pub(super) fn view(
        &self,
        row: usize,
        column: usize,
        rows: usize,
        columns: usize,
    ) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.values, self.rows, self.columns)
            .submatrix(row, column, rows, columns)
    }

    /// The matrix as a view of faer.
    pub(super) fn view_mut(&mut self) -> MatMut<'_, f64> {
        MatMut::from_column_major_slice_mut(&mut self.values, self.rows, self.columns)
    }
}

impl std::ops::Index<(usize, usize)> for Matrix {
    type Output = f64;
    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        &self.values[j * self.rows + i]
    }
}

impl std::ops::IndexMut<(usize, usize)> for Matrix {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        &mut self.values[j * self.rows + i]
    }
}

/// `C ← A B`.
pub(crate) fn product(a: &Matrix, b: &Matrix, c: &mut Matrix) {
    c.reshape(a.rows, b.columns);
    matmul::matmul(
        c.view_mut(),
        Accum::Replace,
        a.view(0, 0, a.rows, a.columns),
        b.view(0, 0, b.rows, b.columns),
        1.0,
        Par::Seq,
    );
}

/// `C ← C + α A Bᵀ`.
pub(crate) fn add_outer(c: &mut Matrix, a: &Matrix, b: &Matrix, alpha: f64) {
    matmul::matmul(
        c.view_mut(),
        Accum::Add,
        a.view(0, 0, a.rows, a.columns),
        b.view(0, 0, b.rows, b.columns).transpose(),
        alpha,
        Par::Seq,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outer_product_is_added() {
        let mut a = Matrix::zeros(2, 1);
        a.values_mut().copy_from_slice(&[1.0, 2.0]);
        let mut b = Matrix::zeros(3, 1);
        b.values_mut().copy_from_slice(&[3.0, 4.0, 5.0]);
        let mut c = Matrix::zeros(2, 3);
        c[(0, 0)] = 1.0;
        add_outer(&mut c, &a, &b, 2.0);
        assert_eq!(c.values(), [7.0, 12.0, 8.0, 16.0, 10.0, 20.0]);
    }
}
