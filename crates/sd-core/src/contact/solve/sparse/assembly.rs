//! The matrix of the preconditioner.

use super::SparseSystem;
use super::linear::row_of;
use crate::contact::row::Row;
use crate::contact::solve::problem::Problem;
use crate::linalg::cholesky::sparse::{BlockCholesky, BlockPattern};

impl SparseSystem {
    /// The matrix of the preconditioner: the near part of R, and the stiffnesses of so many candidates and rows.
    ///
    /// Where the one before was of the same candidates, only blocks of spheres are made anew that have another stiffness now.
    pub(super) fn assemble(&mut self, problem: &Problem, pattern: &BlockPattern, rows: usize) {
        let again = self.is_factored && self.is_same && self.factored.len() == rows;
        self.is_same = true;
        self.changed.clear();
        self.changed.resize(pattern.spheres(), !again);
        let (held, changed) = (&mut self.held, &mut self.changed);
        if again {
            for (at, (old, new)) in self.factored.iter().zip(&self.stiffness).enumerate() {
                if old != new {
                    for sphere in row_of(problem, at).1.spheres {
                        changed[sphere] = true;
                    }
                }
            }
            for (sphere, _) in changed.iter().enumerate().filter(|(_, changed)| **changed) {
                held.copy_own(pattern, &self.near, sphere);
            }
            for (entry, number) in problem.normal.iter().zip(&self.numbers) {
                if let (true, Some(number)) =
                    (entry.row.spheres.iter().all(|&i| changed[i]), number)
                {
                    held.copy_coupling(pattern, &self.near, *number);
                }
            }
        } else {
            held.copy_matrix(&self.near);
        }
        for (at, &s) in self.stiffness[..rows].iter().enumerate() {
            if s != 0.0 {
                let (contact, row) = row_of(problem, at);
                let blocks = row.spheres.map(|sphere| changed[sphere]);
                if blocks != [false, false] {
                    add_stiffness(held, pattern, (row, self.numbers[contact]), s, blocks);
                }
            }
        }
    }
}

/// Adds `s rowᵀ row` to the blocks of those of its spheres, and to that between them if both are.
fn add_stiffness(
    matrix: &mut BlockCholesky,
    pattern: &BlockPattern,
    (row, number): (&Row, Option<usize>),
    s: f64,
    blocks: [bool; 2],
) {
    let (i, j) = row.weights.split_at(3);
    let block = |rows: &[f64], columns: &[f64]| {
        std::array::from_fn(|at| s * rows[at % 3] * columns[at / 3])
    };
    for ((sphere, weights), is_meant) in row.spheres.into_iter().zip([i, j]).zip(blocks) {
        if is_meant {
            matrix.add_own(pattern, sphere, &block(weights, weights));
        }
    }
    if let (Some(number), [true, true]) = (number, blocks) {
        matrix.add_coupling(pattern, number, &block(j, i));
    }
}
