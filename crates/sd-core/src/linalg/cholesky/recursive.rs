//! Recursive Cholesky factorization of large full matrices, which an idle thread may share.
//!
//! ```text
//! A = ( A11     )    L11 from A11,   L21 = A21 L11⁻ᵀ (by halves of its rows),
//!     ( A21 A22 )    L22 from A22 − L21 L21ᵀ (one square, two triangles)
//! ```
//!
//! The work is cut into the same pieces for any number of threads, so the bits do not depend on it.
//! In a pool of threads that runs several simulations, all are busy and nothing is shared; when one
//! simulation remains, idle threads help. Outside a pool no thread is started.

use crate::linalg::error::BadPivot;
use crate::linalg::join::join;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::{self, triangular::BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, MatMut, MatRef, Par, Spec};

/// Minimum dimension at which a matrix is halved.
const LARGE: usize = 1000;

/// Factors the lower triangle of `matrix` in place. Cost n³/3.
pub(in crate::linalg) fn factor(
    matrix: MatMut<'_, f64>,
    scratch: &mut MemBuffer,
) -> Result<(), BadPivot> {
    let n = matrix.nrows();
    if n < LARGE {
        return llt::factor::cholesky_in_place(
            matrix,
            llt::factor::LltRegularization::default(),
            Par::Seq,
            MemStack::new(scratch),
            Spec::default(),
        )
        .map(|_| ())
        .map_err(|llt::factor::LltError::NonPositivePivot { index }| BadPivot { pivot: index });
    }
    // A multiple of the vector length keeps columns aligned.
    let half = (n / 2).next_multiple_of(16);
    let (mut first, _, mut below, mut second) = matrix.split_at_mut(half, half);
    factor(first.as_mut(), scratch)?;
    solve_below(first.as_ref(), below.as_mut());
    subtract_square(below.as_ref(), second.as_mut());
    factor(second, scratch).map_err(|bad| BadPivot {
        pivot: half + bad.pivot,
    })
}

/// `X ← X L⁻ᵀ`, by halves of the rows of X.
fn solve_below(l: MatRef<'_, f64>, x: MatMut<'_, f64>) {
    let half = (x.nrows() / 2).next_multiple_of(16).min(x.nrows());
    let (upper, lower) = x.split_at_row_mut(half);
    let solve = |part: MatMut<'_, f64>| {
        solve_lower_triangular_in_place(l, part.transpose_mut(), Par::Seq);
    };
    join(true, || solve(upper), || solve(lower));
}

/// Lower triangle of `A ← A − X Xᵀ`: the square below the diagonal and two triangles.
fn subtract_square(x: MatRef<'_, f64>, a: MatMut<'_, f64>) {
    let half = (a.nrows() / 2).next_multiple_of(16).min(a.nrows());
    let (upper, _, square, lower) = a.split_at_mut(half, half);
    let (x_upper, x_lower) = x.split_at_row(half);
    let triangle = |target: MatMut<'_, f64>, x: MatRef<'_, f64>| {
        matmul::triangular::matmul(
            target,
            BlockStructure::TriangularLower,
            Accum::Add,
            x,
            BlockStructure::Rectangular,
            x.transpose(),
            BlockStructure::Rectangular,
            -1.0,
            Par::Seq,
        );
    };
    join(
        true,
        || {
            matmul::matmul(
                square,
                Accum::Add,
                x_lower,
                x_upper.transpose(),
                -1.0,
                Par::Seq,
            );
        },
        || {
            triangle(upper, x_upper);
            triangle(lower, x_lower);
        },
    );
}

#[cfg(test)]
mod tests {
    use crate::linalg::cholesky::dense::DenseCholesky;
    use crate::linalg::join::tests::assert_same_with_any_threads;

    /// The factor of a dense positive definite matrix without structure.
    fn factor(n: usize) -> Vec<f64> {
        let mut cholesky = DenseCholesky::new(n);
        let matrix = cholesky.matrix_mut();
        matrix.reset(n, n);
        for j in 0..n {
            for i in j..n {
                matrix[(i, j)] = 1.0 / (1.0 + (i - j) as f64);
            }
            matrix[(j, j)] += 1.0;
        }
        cholesky.factor().unwrap();
        let lower = cholesky.lower();
        (0..n).flat_map(|j| lower.column(j)[j..].to_vec()).collect()
    }

    #[test]
    fn bits_do_not_depend_on_the_number_of_threads() {
        assert_same_with_any_threads(|| factor(2200));
    }

    #[test]
    fn factor_reproduces_the_matrix() {
        let n = 1100;
        let packed = factor(n);
        let start = |j: usize| j * n - j * (j.max(1) - 1) / 2;
        let entry = |i: usize, j: usize| packed[start(j) + i - j];
        for (i, j) in [(0, 0), (700, 30), (1099, 1099), (1099, 540), (600, 599)] {
            let product: f64 = (0..=j).map(|k| entry(i, k) * entry(j, k)).sum();
            let expected = 1.0 / (1.0 + (i - j) as f64) + f64::from(u8::from(i == j));
            assert!((product - expected).abs() < 1e-13);
        }
    }
}
