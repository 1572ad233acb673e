//! The normal problem: a linear complementarity problem on the Delassus matrix.
//!
//! ```text
//! f ≥ 0,   w = q + G f ≥ 0,   f·w = 0
//! ```
//!
//! Block principal pivoting (Júdice & Pires 1994): guess the support, solve for its forces by Cholesky, exchange
//! every violating index; when that cycles, only the last violating one (Murty's rule, which ends). Started from the
//! last support it mostly needs one factorization, and none if the support has not changed.

use super::COMPLIANCE;
use crate::linalg::dense::{Cholesky, Matrix};

/// Compliance where all pairs are halted at once: just enough for a Cholesky factor of a hyperstatic network.
const HALT_COMPLIANCE: f64 = 1e-13;
/// Exchanges of whole blocks without progress before single exchanges begin.
const PATIENCE: u32 = 5;
/// Exchanges after which the problem is given up as unconverged.
const MOST_EXCHANGES: u32 = 2000;

/// Support, factor and workspace of the normal problem.
#[derive(Default)]
pub(super) struct NormalProblem {
    /// Whether each index carries force.
    support: Vec<bool>,
    /// The indices of the support.
    active: Vec<usize>,
    /// Added to the diagonal of G.
    compliance: f64,
    /// Factor of `G_AA + compliance`.
    factor: Cholesky,
    /// Whether `factor` belongs to `active`.
    factored: bool,
    /// Right-hand side and solution on the support.
    solution: Vec<f64>,
    /// w of the last solution.
    slack: Vec<f64>,
}

impl NormalProblem {
    /// Room for that many candidates.
    pub(super) fn new(candidates: usize) -> Self {
        Self {
            support: Vec::with_capacity(candidates),
            active: Vec::with_capacity(candidates),
            factor: Cholesky::new(candidates),
            solution: Vec::with_capacity(candidates),
            slack: Vec::with_capacity(candidates),
            ..Self::default()
        }
    }

    /// Begins a new stage with a guess of the support.
    pub(super) fn start(&mut self, guess: impl Iterator<Item = bool>) {
        self.support.clear();
        self.support.extend(guess);
        self.compliance = COMPLIANCE;
        self.factored = false;
    }

    /// Solves for the forces f; q and f have one entry per candidate. [`NormalProblem::residual`] says how well.
    ///
    /// G is the leading `[K × K]` block of `delassus`.
    pub(super) fn solve(&mut self, delassus: &Matrix, q: &[f64], f: &mut [f64]) {
        let mut fewest = usize::MAX;
        let mut patience = PATIENCE;
        for _ in 0..MOST_EXCHANGES {
            if !self.solve_on_support(delassus, q, f) {
                break;
            }
            // Forces below rounding of the largest, or slack below rounding of the velocities, decide nothing.
            let largest = f.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let scale = q.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let (force_zero, slack_zero) = (1e-13 * largest, 1e-12 * scale);
            let violates = |carries: bool, force: f64, slack: f64| {
                if carries {
                    force < -force_zero
                } else {
                    slack < -slack_zero
                }
            };
            let mut violations = 0;
            let mut last = 0;
            for (m, &carries) in self.support.iter().enumerate() {
                if violates(carries, f[m], self.slack[m]) {
                    violations += 1;
                    last = m;
                }
            }
            if violations == 0 {
                break;
            }
            if violations < fewest {
                fewest = violations;
                patience = PATIENCE;
            } else {
                patience = patience.saturating_sub(1);
            }
            if patience > 0 {
                for (m, carries) in self.support.iter_mut().enumerate() {
                    *carries ^= violates(*carries, f[m], self.slack[m]);
                }
            } else {
                self.support[last] = !self.support[last];
            }
            self.factored = false;
        }
        for x in f.iter_mut() {
            *x = x.max(0.0);
        }
    }

    /// Forces of either sign that halt every pair at once, `q + G f = 0`, as (12)-(13) of the paper. Returns `max |w|`,
    /// infinite if the matrix cannot be factored.
    pub(super) fn halt_all(&mut self, delassus: &Matrix, q: &[f64], f: &mut [f64]) -> f64 {
        self.start(q.iter().map(|_| true));
        self.compliance = HALT_COMPLIANCE;
        if self.solve_on_support(delassus, q, f) {
            self.slack.iter().fold(0.0, |m: f64, w| m.max(w.abs()))
        } else {
            f.fill(0.0);
            f64::INFINITY
        }
    }

    /// Forces on the support that make its slack vanish, and the slack elsewhere; `false` if G_AA cannot be factored.
    fn solve_on_support(&mut self, delassus: &Matrix, q: &[f64], f: &mut [f64]) -> bool {
        if !self.factored {
            self.active.clear();
            self.active
                .extend((0..q.len()).filter(|&m| self.support[m]));
            let size = self.active.len();
            let matrix = self.factor.matrix_mut();
            matrix.reshape(size, size);
            for (column, &b) in self.active.iter().enumerate() {
                let source = delassus.column(b);
                let target = matrix.column_mut(column);
                for (row, &a) in self.active.iter().enumerate().skip(column) {
                    target[row] = source[a];
                }
                target[column] += self.compliance;
            }
            if size > 0 && self.factor.factor().is_err() {
                return false;
            }
            self.factored = true;
        }
        self.solution.clear();
        self.solution.extend(self.active.iter().map(|&a| -q[a]));
        self.factor.solve(&mut self.solution);
        f.fill(0.0);
        for (&a, &x) in self.active.iter().zip(&self.solution) {
            f[a] = x;
        }
        self.update_slack(delassus, q, f);
        true
    }

    /// `w = q + (G + compliance) f`.
    fn update_slack(&mut self, delassus: &Matrix, q: &[f64], f: &[f64]) {
        self.slack.clear();
        self.slack.extend_from_slice(q);
        delassus.add_product(f, &mut self.slack);
        for (w, x) in self.slack.iter_mut().zip(f) {
            *w += self.compliance * x;
        }
    }

    /// `max |min(G_kk f, w)|`: zero exactly at the solution.
    pub(super) fn residual(&mut self, delassus: &Matrix, q: &[f64], f: &[f64]) -> f64 {
        self.update_slack(delassus, q, f);
        (0..q.len())
            .map(|m| (delassus[(m, m)] * f[m]).min(self.slack[m]).abs())
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn conditions_hold_for_random_networks(
            columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 6), 1..14),
            q in prop::collection::vec(-1.0..1.0f64, 14),
        ) {
            // More contacts than degrees of freedom: G is singular, q in its range so that a solution exists.
            let k = columns.len();
            let mut y = Matrix::zeros(6, k);
            for (j, c) in columns.iter().enumerate() {
                y.column_mut(j).copy_from_slice(c);
            }
            let mut g = Matrix::default();
            crate::linalg::dense::symmetric_product(&y, &y, &mut g);
            g.mirror_lower();
            let q: Vec<f64> = (0..k)
                .map(|j| crate::linalg::dense::dot(y.column(j), &q[..6]) + 0.1)
                .collect();
            let mut problem = NormalProblem::default();
            problem.start((0..k).map(|_| true));
            let mut f = vec![0.0; k];
            problem.solve(&g, &q, &mut f);
            let residual = problem.residual(&g, &q, &f);
            prop_assert!(residual < 1e-9, "residual {residual}");
        }
    }

    #[test]
    fn one_pressed_pair() {
        let mut g = Matrix::zeros(1, 1);
        g[(0, 0)] = 2.0;
        let mut f = [0.0];
        let mut problem = NormalProblem::default();
        problem.start(std::iter::once(false));
        problem.solve(&g, &[-1.0], &mut f);
        assert!((f[0] - 0.5).abs() < 1e-9);
        problem.solve(&g, &[1.0], &mut f);
        assert_eq!(f, [0.0]);
    }
}
