//! What a factor lacks of the matrix that the states ask for, where few stiffnesses have changed since it was made.
//!
//! ```text
//! (A + Cᵀ Δ C)⁻¹ = A⁻¹ − W (Δ⁻¹ + C W)⁻¹ C A⁻¹,   W = A⁻¹ Cᵀ
//! ```
//!
//! C has the rows of the contacts whose stiffness changed, Δ has by how much (Woodbury, *Inverting modified matrices*, 1950). Eight columns of
//! W cost about two solves, a factor costs ten, and columns stay as long as the factor does.

use super::MOBILITY;
use crate::contact::row::Row;
use crate::linalg::cholesky::sparse::lanes::{LANES, Lanes};
use crate::linalg::cholesky::sparse::{BlockCholesky, BlockPattern};
use crate::linalg::dense::Matrix;
use crate::linalg::lu::LuSolver;
use crate::linalg::simd::vectorised;

/// Columns of W at most: more cost as much as a factor.
const MOST_COLUMNS: usize = 2 * LANES;
/// Stiffness that can be taken away, over that of the fluid: what is left of a larger one is lost in single precision.
const MOST_TAKEN: f64 = 1e3;

/// A contact or row whose stiffness is not the one in the factor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    /// Its number among stiffnesses.
    pub(super) at: usize,
    /// What its stiffness is more, in mu·a.
    pub(super) by: f64,
    /// Its row of C.
    pub(super) row: Row,
}

/// Changes since a factor was made, and what they do to its solves.
#[derive(Default)]
pub(super) struct Corrections {
    /// Number and row of C of each column of W.
    known: Vec<(usize, Row)>,
    /// W, `[3N]` for every eight columns.
    columns: Vec<Vec<Lanes>>,
    /// The changes there are now, each with its column of W.
    changes: Vec<(Change, usize)>,
    /// `Δ⁻¹ + C W` of these.
    matrix: Matrix,
    solver: LuSolver,
    /// What the changes read off a solution, then the share of each column.
    shares: Vec<f64>,
    /// The shares in the order of the columns.
    weights: Vec<[f64; LANES]>,
}

impl Corrections {
    /// Forgets everything: there is a new factor.
    pub(super) fn clear(&mut self) {
        self.known.clear();
        self.changes.clear();
    }

    /// Takes the changes there are now; `false`, and there are none, where another factor costs less or a change cannot be corrected.
    pub(super) fn take(
        &mut self,
        (factor, pattern): (&mut BlockCholesky, &BlockPattern),
        changes: impl Iterator<Item = Change>,
    ) -> bool {
        self.changes.clear();
        let first = self.known.len();
        for change in changes {
            let known = self.known.iter().position(|(at, _)| *at == change.at);
            let column = known.unwrap_or(self.known.len());
            if column == MOST_COLUMNS || change.by * MOBILITY < -MOST_TAKEN {
                self.changes.clear();
                self.known.truncate(first);
                return false;
            }
            if known.is_none() {
                self.known.push((change.at, change.row));
            }
            self.changes.push((change, column));
        }
        if self.known.len() > first {
            self.find_columns(first / LANES, factor, pattern);
        }
        let count = self.changes.len();
        self.matrix.reset(count, count);
        for (b, (_, column)) in self.changes.iter().enumerate() {
            let (eight, lane) = (&self.columns[column / LANES], column % LANES);
            let entries = self.matrix.column_mut(b).iter_mut();
            for (entry, (change, _)) in entries.zip(&self.changes) {
                *entry = read_lane(&change.row, eight, lane);
            }
            self.matrix[(b, b)] += self.changes[b].0.by.recip();
        }
        true
    }

    /// Finds the columns of W from those eight on, of which the first may be known already.
    fn find_columns(&mut self, first: usize, factor: &mut BlockCholesky, pattern: &BlockPattern) {
        let known = self.known.chunks(LANES).enumerate().skip(first);
        for (number, eight) in known {
            if self.columns.len() == number {
                self.columns.push(Vec::new());
            }
            let columns = &mut self.columns[number];
            columns.clear();
            columns.resize(3 * pattern.spheres(), [0.0; LANES]);
            for (lane, (_, row)) in eight.iter().enumerate() {
                put_into_lane(row, columns, lane);
            }
            factor.solve_lanes(pattern, columns);
        }
    }

    /// Corrects a solution `[3N]` by the factor. Where the changes leave no matrix to solve with, it stays as it is, as a preconditioner may.
    pub(super) fn correct(&mut self, z: &mut [f64]) {
        if self.changes.is_empty() {
            return;
        }
        self.shares.clear();
        let reads = self.changes.iter().map(|(change, _)| change.row.read(z));
        self.shares.extend(reads);
        self.solver.matrix_mut().clone_from(&self.matrix);
        if self.solver.solve(&mut self.shares).is_err() {
            return;
        }
        self.weights.clear();
        let eights = self.known.len().div_ceil(LANES);
        self.weights.resize(eights, [0.0; LANES]);
        for ((_, column), share) in self.changes.iter().zip(&self.shares) {
            self.weights[column / LANES][column % LANES] = *share;
        }
        let eights = self.columns.iter().zip(&self.weights);
        for (eight, weights) in eights.filter(|(_, weights)| **weights != [0.0; LANES]) {
            vectorised(
                #[inline(always)]
                || {
                    for (z, lanes) in z.iter_mut().zip(eight) {
                        let products = lanes.iter().zip(weights).map(|(w, y)| f64::from(*w) * y);
                        *z -= products.sum::<f64>();
                    }
                },
            );
        }
    }
}

/// The velocity that a row reads off one lane of velocities `[3N]`.
fn read_lane(row: &Row, v: &[Lanes], lane: usize) -> f64 {
    let sphere = |sphere: usize| [0, 1, 2].map(|k| f64::from(v[3 * sphere + k][lane]));
    let both = row.spheres.map(sphere);
    let products = row.weights.iter().zip(both.as_flattened());
    products.map(|(weight, v)| weight * v).sum()
}

/// Puts the transpose of a row into one lane of forces `[3N]`.
fn put_into_lane(row: &Row, forces: &mut [Lanes], lane: usize) {
    for (weights, sphere) in row.weights.chunks_exact(3).zip(row.spheres) {
        for (k, weight) in weights.iter().enumerate() {
            #[expect(clippy::cast_possible_truncation, reason = "the factor's precision")]
            let weight = *weight as f32;
            forces[3 * sphere + k][lane] = weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::add_stiffness;
    use super::*;
    use crate::geometry::modes::Vec2;

    /// Spheres in a row, each in contact with the next.
    const SPHERES: usize = 30;

    fn row(k: usize) -> Row {
        let angle = 0.4 * k as f64;
        Row::normal([k, k + 1], Vec2::new(angle.cos(), angle.sin()))
    }

    /// A factor of drags and of contacts with these stiffnesses.
    fn factor(pattern: &BlockPattern, stiffness: &[f64]) -> BlockCholesky {
        let mut factor = BlockCholesky::default();
        factor.reset(pattern);
        for sphere in 0..SPHERES {
            let drag = [18.0, 0.0, 0.0, 0.0, 18.0, 0.0, 0.0, 0.0, 25.0];
            factor.add_own(pattern, sphere, &drag);
        }
        for (k, &s) in stiffness.iter().enumerate() {
            add_stiffness(&mut factor, pattern, &row(k), Some(k), s);
        }
        factor.factor(pattern).unwrap();
        factor
    }

    #[test]
    fn corrected_solves_are_those_of_a_new_factor() {
        let couplings: Vec<_> = (0..SPHERES - 1).map(|k| (k, k + 1)).collect();
        let pattern = BlockPattern::new(SPHERES, &couplings).unwrap();
        let old: Vec<f64> = couplings
            .iter()
            .map(|(k, _)| 40.0 * (k % 3) as f64)
            .collect();
        let mut held = factor(&pattern, &old);
        let mut corrections = Corrections::default();
        let r: Vec<f64> = (0..3 * SPHERES).map(|k| (k as f64).cos()).collect();
        // Some contacts open and others close; then one that had opened closes again, and more change than eight columns hold.
        for changed in [
            &[2, 9, 10][..],
            &[9, 10],
            &[1, 3, 4, 5, 7, 9, 10, 12, 20, 27],
        ] {
            let mut new = old.clone();
            for &k in changed {
                new[k] = if old[k] > 0.0 { 0.0 } else { 500.0 };
            }
            let changes = changed.iter().map(|&at| Change {
                at,
                by: new[at] - old[at],
                row: row(at),
            });
            assert!(corrections.take((&mut held, &pattern), changes));
            let (mut z, mut expected) = (r.clone(), r.clone());
            held.solve(&pattern, &r, &mut z);
            corrections.correct(&mut z);
            factor(&pattern, &new).solve(&pattern, &r, &mut expected);
            for (a, b) in z.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-5, "{a} {b}");
            }
        }
    }

    #[test]
    fn what_cannot_be_corrected_asks_for_a_factor() {
        let couplings: Vec<_> = (0..SPHERES - 1).map(|k| (k, k + 1)).collect();
        let pattern = BlockPattern::new(SPHERES, &couplings).unwrap();
        let mut held = factor(&pattern, &[1e6; SPHERES - 1]);
        let mut corrections = Corrections::default();
        let change = |at, by| Change {
            at,
            by,
            row: row(at),
        };
        let stiff = [change(3, -1e6)];
        assert!(!corrections.take((&mut held, &pattern), stiff.into_iter()));
        let many = (0..=MOST_COLUMNS).map(|at| change(at, 1.0));
        assert!(!corrections.take((&mut held, &pattern), many));
        let mut z = vec![1.0; 3 * SPHERES];
        corrections.correct(&mut z);
        assert_eq!(z, vec![1.0; 3 * SPHERES]);
    }
}
