//! Gaussian elimination with partial pivoting, for systems that are solved again and again.

use super::dense::{Matrix, NotPositive};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::{MatMut, Par, Spec};

/// Solver of general systems `A x = b`, with its workspace.
pub struct GeneralSolver {
    /// A to fill, then L and U.
    matrix: Matrix,
    /// Order of the rows, and its inverse.
    permutation: [Vec<usize>; 2],
    /// Scratch, sized for the largest matrix so far.
    scratch: MemBuffer,
    /// Largest dimension the scratch serves.
    capacity: usize,
}

impl Default for GeneralSolver {
    fn default() -> Self {
        Self::new(0)
    }
}

/// Scratch for dimension n.
fn scratch(n: usize) -> MemBuffer {
    let factoring = factor::lu_in_place_scratch::<usize, f64>(n, n, Par::Seq, Spec::default());
    let solving = solve::solve_in_place_scratch::<usize, f64>(n, 1, Par::Seq);
    MemBuffer::new(factoring.or(solving))
}

impl GeneralSolver {
    /// Workspace for systems up to `[n × n]`; larger ones make it grow.
    pub fn new(n: usize) -> Self {
        let mut matrix = Matrix::default();
        matrix.reserve(n * n);
        Self {
            matrix,
            permutation: [Vec::with_capacity(n), Vec::with_capacity(n)],
            scratch: scratch(n),
            capacity: n,
        }
    }

    /// The matrix to fill before [`GeneralSolver::solve`], which overwrites it.
    pub fn matrix_mut(&mut self) -> &mut Matrix {
        &mut self.matrix
    }

    /// `x ← A⁻¹ x`. Cost 2n³/3.
    ///
    /// # Errors
    /// [`NotPositive`] with the column in which no usable pivot was found; x is then unchanged.
    pub fn solve(&mut self, x: &mut [f64]) -> Result<(), NotPositive> {
        let n = self.matrix.rows();
        if n == 0 {
            return Ok(());
        }
        if n > self.capacity {
            self.scratch = scratch(n);
            self.capacity = n;
        }
        let [forward, inverse] = &mut self.permutation;
        forward.resize(n, 0);
        inverse.resize(n, 0);
        let (_, order) = factor::lu_in_place(
            self.matrix.view_mut(),
            forward,
            inverse,
            Par::Seq,
            MemStack::new(&mut self.scratch),
            Spec::default(),
        );
        for k in 0..n {
            let pivot = self.matrix[(k, k)];
            if pivot == 0.0 || !pivot.is_finite() {
                return Err(NotPositive { pivot: k });
            }
        }
        let factors = self.matrix.view(0, 0, n, n);
        solve::solve_in_place(
            factors,
            factors,
            order,
            MatMut::from_column_major_slice_mut(x, n, 1),
            Par::Seq,
            MemStack::new(&mut self.scratch),
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_systems_of_changing_size_and_names_a_singular_column() {
        let mut solver = GeneralSolver::new(4);
        for n in [3, 40, 7] {
            solver.matrix_mut().reset(n, n);
            for j in 0..n {
                for i in 0..n {
                    // The largest entries stand off the diagonal: rows must be exchanged.
                    let entry = (0.3 + i as f64 * 1.7 + j as f64 * 0.9).sin();
                    solver.matrix_mut()[(i, j)] = if (i + 1) % n == j { 9.0 } else { entry };
                }
            }
            let expected: Vec<f64> = (0..n).map(|k| (k as f64).cos()).collect();
            let mut x = vec![0.0; n];
            solver.matrix_mut().add_product(&expected, &mut x);
            solver.solve(&mut x).unwrap();
            assert!(x.iter().zip(&expected).all(|(x, y)| (x - y).abs() < 1e-12));
        }
        solver.matrix_mut().reset(2, 2);
        let mut x = vec![1.0, 2.0];
        assert!(solver.solve(&mut x).is_err());
        assert_eq!(x, [1.0, 2.0]);
    }
}
