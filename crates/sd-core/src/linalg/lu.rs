//! Gaussian elimination with partial pivoting, for repeated solves.

use super::dense::Matrix;
use super::error::BadPivot;
use super::simd::vectorised;
use super::vector;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::{MatMut, Par, Spec};

/// Dimension below which systems are eliminated here: library calls for small blocks cost more than
/// the work.
const SMALL: usize = 160;
/// Columns eliminated together in small systems.
const PANEL: usize = 4;

/// Solver of general systems `A x = b`, with its workspace.
pub(crate) struct LuSolver {
    /// A to fill, then L and U.
    matrix: Matrix,
    /// Right-hand side of a small system.
    rhs: Vec<f64>,
    /// Order of the rows, and its inverse.
    permutation: [Vec<usize>; 2],
    /// Scratch, sized for the largest matrix so far.
    scratch: MemBuffer,
    /// Largest dimension of the scratch.
    capacity: usize,
}

impl Default for LuSolver {
    fn default() -> Self {
        Self {
            matrix: Matrix::default(),
            rhs: Vec::new(),
            permutation: Default::default(),
            scratch: MemBuffer::new(StackReq::EMPTY),
            capacity: 0,
        }
    }
}

fn scratch(n: usize) -> MemBuffer {
    let factoring = factor::lu_in_place_scratch::<usize, f64>(n, n, Par::Seq, Spec::default());
    let solving = solve::solve_in_place_scratch::<usize, f64>(n, 1, Par::Seq);
    MemBuffer::new(factoring.or(solving))
}

impl LuSolver {
    /// The matrix to fill before [`LuSolver::solve`], which overwrites it.
    pub(crate) fn matrix_mut(&mut self) -> &mut Matrix {
        &mut self.matrix
    }

    /// `x ← A⁻¹ x`. Cost 2n³/3.
    ///
    /// # Errors
    /// [`BadPivot`] with the column in which no usable pivot was found; x is then unchanged.
    pub(crate) fn solve(&mut self, x: &mut [f64]) -> Result<(), BadPivot> {
        let n = self.matrix.rows();
        if n == 0 {
            return Ok(());
        }
        if n < SMALL {
            return self.solve_small(x);
        }
        if n > self.capacity {
            self.capacity = n.next_power_of_two();
            self.scratch = scratch(self.capacity);
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
                return Err(BadPivot { pivot: k });
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

    /// [`LuSolver::solve`] of a small system: in panels of four columns, which are then applied
    /// together to the other columns. The right-hand side is an additional column.
    fn solve_small(&mut self, x: &mut [f64]) -> Result<(), BadPivot> {
        let [work, _] = &mut self.permutation;
        let (matrix, rhs) = (&mut self.matrix, &mut self.rhs);
        rhs.clear();
        rhs.extend_from_slice(x);
        vectorised(
            #[inline(always)]
            || eliminate(matrix, rhs, work),
        )?;
        x.copy_from_slice(rhs);
        Ok(())
    }
}

/// Eliminates A and b, and solves for b in place; `exchanges` is scratch.
#[inline(always)]
fn eliminate(
    matrix: &mut Matrix,
    b: &mut [f64],
    exchanges: &mut Vec<usize>,
) -> Result<(), BadPivot> {
    let n = b.len();
    for first in (0..n).step_by(PANEL) {
        let end = (first + PANEL).min(n);
        exchanges.clear();
        let (panel, rest) = matrix.values_mut()[n * first..].split_at_mut(n * (end - first));
        for k in first..end {
            let (known, open) = panel.split_at_mut(n * (k - first));
            let column = &mut open[..n];
            take_steps(known, n, first, exchanges, column);
            let largest = vector::largest(&column[k..]);
            let place = column[k..].iter().position(|x| x.abs() == largest);
            let (Some(below), true) = (place, largest > 0.0 && largest.is_finite()) else {
                return Err(BadPivot { pivot: k });
            };
            let pivot = k + below;
            column.swap(k, pivot);
            exchanges.push(pivot);
            for known in known.chunks_exact_mut(n) {
                known.swap(k, pivot);
            }
            let own = column[k].recip();
            for value in &mut column[k + 1..] {
                *value *= own;
            }
        }
        if exchanges.iter().copied().eq(first..end) {
            // The diagonal entry is the largest in most columns.
            exchanges.clear();
        }
        if end - first == PANEL {
            let mut pairs = rest.chunks_exact_mut(2 * n);
            for two in &mut pairs {
                let (left, right) = two.split_at_mut(n);
                take_four_steps(panel, first, exchanges, [left, right]);
            }
            // With an odd number of columns the last one is paired with the right-hand side.
            let last = pairs.into_remainder();
            if last.is_empty() {
                take_steps(panel, n, first, exchanges, b);
            } else {
                take_four_steps(panel, first, exchanges, [last, b]);
            }
        } else {
            take_steps(panel, n, first, exchanges, b);
        }
    }
    for k in (0..n).rev() {
        let column = matrix.column(k);
        let value = b[k] / column[k];
        b[k] = value;
        vector::add_scaled_inline(&mut b[..k], &column[..k], -value);
    }
    Ok(())
}

/// Applies the row exchanges and the steps of a panel's first columns to another column.
#[inline(always)]
fn take_steps(panel: &[f64], n: usize, first: usize, exchanges: &[usize], column: &mut [f64]) {
    for (step, &pivot) in exchanges.iter().enumerate() {
        column.swap(first + step, pivot);
    }
    for (step, l) in panel.chunks_exact(n).enumerate() {
        let (above, below) = column.split_at_mut(first + step + 1);
        let value = above[first + step];
        vector::add_scaled_inline(below, &l[first + step + 1..], -value);
    }
}

/// Takes the steps of all four columns of a panel on two other columns.
#[inline(always)]
fn take_four_steps(panel: &[f64], first: usize, exchanges: &[usize], columns: [&mut [f64]; 2]) {
    let n = columns[0].len();
    let end = first + PANEL;
    let l = [0, 1, 2, 3].map(|k| &panel[n * k..n * (k + 1)]);
    let mut u = [[0.0; PANEL]; 2];
    let below = columns.map(|column| {
        for (step, &pivot) in exchanges.iter().enumerate() {
            column.swap(first + step, pivot);
        }
        column
    });
    let [left, right] = below;
    for (column, u) in [&mut *left, &mut *right].into_iter().zip(&mut u) {
        for k in 0..PANEL {
            let mut value = column[first + k];
            for (l, &before) in l.iter().zip(u.iter()).take(k) {
                value -= l[first + k] * before;
            }
            column[first + k] = value;
            u[k] = value;
        }
    }
    vector::subtract_four_from_two(
        [&mut left[end..], &mut right[end..]],
        l.map(|l| &l[end..]),
        u,
    );
}

/// Solves `A x = b` in place for a system that is solved only once; A is overwritten.
///
/// # Errors
/// [`BadPivot`] with the column in which no usable pivot was found.
pub(crate) fn solve_once(a: &mut Matrix, b: &mut Matrix) -> Result<(), BadPivot> {
    let n = a.rows();
    if n == 0 {
        return Ok(());
    }
    let lu = a.view(0, 0, n, n).partial_piv_lu();
    for k in 0..n {
        let pivot = lu.U()[(k, k)];
        if pivot == 0.0 || !pivot.is_finite() {
            return Err(BadPivot { pivot: k });
        }
    }
    faer::linalg::solvers::Solve::solve_in_place(&lu, b.view_mut());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_systems_of_changing_size_and_names_a_singular_column() {
        let mut solver = LuSolver::default();
        for n in [3, 40, 7, 200, 8] {
            solver.matrix_mut().reset(n, n);
            for j in 0..n {
                for i in 0..n {
                    // The largest entries are off the diagonal, so rows must be exchanged.
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

    #[test]
    fn general_solve() {
        let mut a = Matrix::zeros(2, 2);
        a[(0, 1)] = 2.0;
        a[(1, 0)] = 4.0;
        let mut b = Matrix::zeros(2, 1);
        b.column_mut(0).copy_from_slice(&[6.0, 8.0]);
        solve_once(&mut a, &mut b).unwrap();
        assert_eq!(b.column(0), [2.0, 3.0]);
    }
}
