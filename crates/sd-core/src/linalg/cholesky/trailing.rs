//! The trailing block of an inverse, from a dense factor.

use crate::linalg::dense::Matrix;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::{Accum, Par};

/// Writes the lower triangle of the trailing block, from row `first` on, of `(L Lᵀ)⁻¹` into `out`:
/// `L₂₂⁻ᵀ L₂₂⁻¹`.
///
/// `inverse` is scratch.
pub(crate) fn trailing_inverse(
    lower: &Matrix,
    first: usize,
    inverse: &mut Matrix,
    out: &mut Matrix,
) {
    let n = lower.rows() - first;
    inverse.reset(n, n);
    out.reset(n, n);
    let block = lower.view(first, first, n, n);
    invert_lower_triangular(inverse.view_mut(), block, Par::Seq);
    let inverse = inverse.view(0, 0, n, n);
    triangular::matmul(
        out.view_mut(),
        BlockStructure::TriangularLower,
        Accum::Replace,
        inverse.transpose(),
        BlockStructure::TriangularUpper,
        inverse,
        BlockStructure::TriangularLower,
        1.0,
        Par::Seq,
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::cholesky::dense::DenseCholesky;

    #[test]
    fn trailing_block_is_that_of_the_inverse() {
        let (n, first) = (7, 3);
        let mut factor = DenseCholesky::new(n);
        let matrix = factor.matrix_mut();
        matrix.reset(n, n);
        for j in 0..n {
            for i in j..n {
                matrix[(i, j)] = (1.3 * (i * n + j) as f64).sin() + if i == j { 5.0 } else { 0.0 };
            }
        }
        factor.factor().unwrap();
        let (mut inverse, mut out) = (Matrix::default(), Matrix::default());
        trailing_inverse(factor.lower(), first, &mut inverse, &mut out);
        for j in first..n {
            let mut column = vec![0.0; n];
            column[j] = 1.0;
            factor.solve(&mut column);
            for i in j..n {
                assert!((out[(i - first, j - first)] - column[i]).abs() < 1e-14);
            }
        }
    }
}
