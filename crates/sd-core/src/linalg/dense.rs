//! Dense column-major matrices and their factorizations.

use super::cholesky::recursive;
use super::simd::vectorised;
use super::vector;
pub use super::vector::{add_scaled, dot};
use faer::dyn_stack::MemBuffer;
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::{self, triangular::BlockStructure};
use faer::linalg::triangular_inverse;
use faer::{Accum, MatMut, MatRef, Par, Spec};

/// A dense matrix `[rows × columns]`, stored by columns.
#[derive(Debug, Clone, Default)]
pub struct Matrix {
    /// Number of rows.
    rows: usize,
    /// Number of columns.
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

    /// Takes a new shape and sets all entries to zero; allocates only beyond the largest shape so far.
    pub fn reset(&mut self, rows: usize, columns: usize) {
        self.rows = rows;
        self.columns = columns;
        self.values.clear();
        self.values.resize(rows * columns, 0.0);
    }

    /// Takes a new shape, leaving old entries wherever they fall: for matrices that are about to be overwritten.
    pub fn reshape(&mut self, rows: usize, columns: usize) {
        self.rows = rows;
        self.columns = columns;
        self.values.resize(rows * columns, 0.0);
    }

    /// Room for that many entries, so that matrices up to that size allocate nothing.
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

    /// One column, to write.
    pub fn column_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.values[j * self.rows..(j + 1) * self.rows]
    }

    /// All entries, column after column.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All entries, to write.
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

    /// `y ← y + A x`, with the leading rows of A that y has. Columns with x = 0 cost nothing.
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

    /// A block as faer sees it.
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

    /// The whole as faer sees it.
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

/// The matrix had a pivot ≤ 0 at this row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotPositive {
    /// Row of the first bad pivot.
    pub pivot: usize,
}

/// Cholesky factorization `A = L Lᵀ` of a symmetric positive definite matrix, with its workspace.
pub struct Cholesky {
    /// L in the lower triangle; the upper triangle has no meaning.
    factor: Matrix,
    /// Scratch, sized for the largest matrix so far.
    scratch: MemBuffer,
    /// Largest dimension the scratch serves.
    capacity: usize,
}

impl Default for Cholesky {
    fn default() -> Self {
        Self::new(0)
    }
}

impl Cholesky {
    /// Workspace for matrices up to `[n × n]`; larger ones make it grow.
    pub fn new(n: usize) -> Self {
        let mut factor = Matrix::zeros(n, n);
        factor.reset(0, 0);
        Self {
            factor,
            scratch: scratch(n),
            capacity: n,
        }
    }

    /// The matrix to fill (lower triangle) before [`Cholesky::factor`]; holds L afterwards.
    pub fn matrix_mut(&mut self) -> &mut Matrix {
        &mut self.factor
    }

    /// L, in the lower triangle.
    pub fn lower(&self) -> &Matrix {
        &self.factor
    }

    /// Factors the matrix written into [`Cholesky::matrix_mut`], in place. Cost n³/3.
    ///
    /// # Errors
    /// [`NotPositive`] with the row at which it broke down.
    pub fn factor(&mut self) -> Result<(), NotPositive> {
        let (matrix, scratch) = self.parts();
        recursive::factor(matrix.view_mut(), scratch)
    }

    /// The matrix and the scratch of its factorization.
    pub(super) fn parts(&mut self) -> (&mut Matrix, &mut MemBuffer) {
        let n = self.factor.rows;
        if n > self.capacity {
            self.scratch = scratch(n);
            self.capacity = n;
        }
        (&mut self.factor, &mut self.scratch)
    }

    /// `x ← A⁻¹ x` for one vector.
    pub fn solve(&self, x: &mut [f64]) {
        self.solve_lower_vector(x);
        self.solve_upper_vector(x);
    }

    /// `x ← L⁻¹ x` for one vector.
    pub fn solve_lower_vector(&self, x: &mut [f64]) {
        let n = self.factor.rows;
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
        let n = self.factor.rows;
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

    /// Lower triangle of the trailing `[m × m]` block of A⁻¹, written into `out`; `work` is scratch.
    ///
    /// The trailing block of the inverse is `(L₂₂ L₂₂ᵀ)⁻¹`, L₂₂ the trailing block of L, whatever stands before it.
    pub fn trailing_inverse(&self, m: usize, work: &mut Matrix, out: &mut Matrix) {
        let start = self.factor.rows - m;
        work.reset(m, m);
        out.reshape(m, m);
        triangular_inverse::invert_lower_triangular(
            work.view_mut(),
            self.factor.view(start, start, m, m),
            Par::Seq,
        );
        matmul::triangular::matmul(
            out.view_mut(),
            BlockStructure::TriangularLower,
            Accum::Replace,
            work.view(0, 0, m, m).transpose(),
            BlockStructure::TriangularUpper,
            work.view(0, 0, m, m),
            BlockStructure::TriangularLower,
            1.0,
            Par::Seq,
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

/// Lower triangle of `C = Aᵀ B` for a product known to be symmetric.
pub fn symmetric_product(a: &Matrix, b: &Matrix, c: &mut Matrix) {
    c.reshape(a.columns, b.columns);
    matmul::triangular::matmul(
        c.view_mut(),
        BlockStructure::TriangularLower,
        Accum::Replace,
        a.view(0, 0, a.rows, a.columns).transpose(),
        BlockStructure::Rectangular,
        b.view(0, 0, b.rows, b.columns),
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
}

/// Lower triangle of `C ← C + α A Bᵀ` for a product known to be symmetric.
pub fn add_symmetric_outer(c: &mut Matrix, a: &Matrix, b: &Matrix, alpha: f64) {
    matmul::triangular::matmul(
        c.view_mut(),
        BlockStructure::TriangularLower,
        Accum::Add,
        a.view(0, 0, a.rows, a.columns),
        BlockStructure::Rectangular,
        b.view(0, 0, b.rows, b.columns).transpose(),
        BlockStructure::Rectangular,
        alpha,
        Par::Seq,
    );
}

/// `C ← A B`.
pub fn product(a: &Matrix, b: &Matrix, c: &mut Matrix) {
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
pub fn add_outer(c: &mut Matrix, a: &Matrix, b: &Matrix, alpha: f64) {
    matmul::matmul(
        c.view_mut(),
        Accum::Add,
        a.view(0, 0, a.rows, a.columns),
        b.view(0, 0, b.rows, b.columns).transpose(),
        alpha,
        Par::Seq,
    );
}

/// Solves `A x = b` in place by Gaussian elimination with partial pivoting; A is overwritten. For small or one-off systems.
///
/// # Errors
/// [`NotPositive`] with the column in which no usable pivot was found.
pub fn solve_general(a: &mut Matrix, b: &mut Matrix) -> Result<(), NotPositive> {
    let n = a.rows;
    if n == 0 {
        return Ok(());
    }
    let lu = a.view(0, 0, n, n).partial_piv_lu();
    for k in 0..n {
        let pivot = lu.U()[(k, k)];
        if pivot == 0.0 || !pivot.is_finite() {
            return Err(NotPositive { pivot: k });
        }
    }
    faer::linalg::solvers::Solve::solve_in_place(&lu, b.view_mut());
    Ok(())
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
        let mut cholesky = Cholesky::new(n);
        cholesky.matrix_mut().clone_from(&a);
        cholesky.factor().unwrap();
        let mut x = b.clone();
        cholesky.solve(&mut x);
        let mut ax = vec![0.0; n];
        a.add_product(&x, &mut ax);
        assert!(ax.iter().zip(&b).all(|(p, q)| (p - q).abs() < 1e-13));
    }

    #[test]
    fn trailing_block_of_the_inverse() {
        let (n, m) = (20, 7);
        let a = spd(n);
        let mut cholesky = Cholesky::new(n);
        cholesky.matrix_mut().clone_from(&a);
        cholesky.factor().unwrap();
        let (mut work, mut block) = (Matrix::default(), Matrix::default());
        cholesky.trailing_inverse(m, &mut work, &mut block);
        for j in 0..m {
            let mut column = vec![0.0; n];
            column[n - m + j] = 1.0;
            cholesky.solve(&mut column);
            for i in j..m {
                assert!((block[(i, j)] - column[n - m + i]).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn indefinite_matrix_names_its_row() {
        let mut cholesky = Cholesky::new(3);
        let matrix = cholesky.matrix_mut();
        matrix.reset(3, 3);
        matrix[(0, 0)] = 1.0;
        matrix[(1, 1)] = 1.0;
        matrix[(2, 2)] = -1.0;
        assert_eq!(cholesky.factor(), Err(NotPositive { pivot: 2 }));
    }

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

    #[test]
    fn general_solve() {
        let mut a = Matrix::zeros(2, 2);
        a[(0, 1)] = 2.0;
        a[(1, 0)] = 4.0;
        let mut b = Matrix::zeros(2, 1);
        b.column_mut(0).copy_from_slice(&[6.0, 8.0]);
        solve_general(&mut a, &mut b).unwrap();
        assert_eq!(b.column(0), [2.0, 3.0]);
    }
}
