//! The normal problem: a linear complementarity problem on the Delassus matrix.
//!
//! ```text
//! f ≥ 0,   w = q + G f ≥ 0,   f·w = 0
//! ```
//!
//! Block principal pivoting (Júdice & Pires 1994): guess the support, solve for its forces by DenseCholesky, exchange
//! every violating index. Started from the last support it mostly needs one factorization, and none if the support has not
//! changed. Near jamming G is all but singular and the exchanges may cycle; then an active set that only ever descends takes
//! over, which is slower and ends.

use super::COMPLIANCE;
use super::cone::Chance;
use crate::linalg::cholesky::dense::DenseCholesky;
use crate::linalg::dense::Matrix;

/// Compliance where all pairs are halted at once: just enough for a Cholesky factor of a hyperstatic network.
const HALT_COMPLIANCE: f64 = 1e-13;
/// Exchanges of whole blocks without progress before the descent begins.
const PATIENCE: u32 = 5;
/// Steps of the descent per candidate pair, after which the problem is given up as unconverged.
const MOST_STEPS_PER_PAIR: usize = 5;

/// What decides nothing: forces below rounding of the largest, slack below rounding of the velocities.
struct Zero {
    /// In mu·a²·rate.
    force: f64,
    /// In a·rate.
    slack: f64,
}

impl Zero {
    /// For the problem's q and forces at hand.
    fn of(q: &[f64], f: &[f64]) -> Self {
        let largest = |x: &[f64]| x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        Self {
            force: 1e-13 * largest(f),
            slack: 1e-12 * largest(q),
        }
    }

    /// Whether a pair that carries force pulls, or one that carries none closes.
    fn violates(&self, carries: bool, force: f64, slack: f64) -> bool {
        if carries {
            force < -self.force
        } else {
            slack < -self.slack
        }
    }
}

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
    factor: DenseCholesky,
    /// Whether `factor` belongs to `active`.
    factored: bool,
    /// Right-hand side and solution on the support.
    solution: Vec<f64>,
    /// w of the last solution.
    slack: Vec<f64>,
    /// Forces f ≥ 0 from which the descent goes on.
    feasible: Vec<f64>,
}

impl NormalProblem {
    /// Room for that many candidates.
    pub(super) fn new(candidates: usize) -> Self {
        Self {
            support: Vec::with_capacity(candidates),
            active: Vec::with_capacity(candidates),
            factor: DenseCholesky::new(candidates),
            solution: Vec::with_capacity(candidates),
            slack: Vec::with_capacity(candidates),
            feasible: Vec::with_capacity(candidates),
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

    /// The matrix has changed: what was factored no longer belongs to it.
    pub(super) fn changed(&mut self) {
        self.factored = false;
    }

    /// w of the solution last measured.
    pub(super) fn slack(&self) -> &[f64] {
        &self.slack
    }

    /// Solves for the forces f; q and f have one entry per candidate. [`NormalProblem::residual`] says how well.
    ///
    /// G is the leading `[K × K]` block of `delassus`.
    pub(super) fn solve(&mut self, delassus: &Matrix, q: &[f64], f: &mut [f64]) {
        if !self.exchange_blocks(delassus, q, f) {
            self.descend(delassus, q, f);
        }
        for x in f.iter_mut() {
            *x = x.max(0.0);
        }
    }

    /// Block principal pivoting; whether it ended at the solution.
    fn exchange_blocks(&mut self, delassus: &Matrix, q: &[f64], f: &mut [f64]) -> bool {
        let mut fewest = usize::MAX;
        let mut patience = PATIENCE;
        while self.solve_on_support(delassus, q, f) {
            let zero = Zero::of(q, f);
            let mut violations = 0;
            for ((carries, &force), &slack) in
                self.support.iter_mut().zip(f.iter()).zip(&self.slack)
            {
                if zero.violates(*carries, force, slack) {
                    violations += 1;
                    *carries = !*carries;
                }
            }
            if violations == 0 {
                return true;
            }
            self.factored = false;
            if violations < fewest {
                fewest = violations;
                patience = PATIENCE;
            } else if patience == 0 {
                return false;
            } else {
                patience -= 1;
            }
        }
        false
    }

    /// Measures forces of either sign found elsewhere for the support `closed`, and exchanges the violating indices of it, all or some; how
    /// many there were. Forces below zero, as rounding leaves them or as they violate, end as zero.
    pub(super) fn exchange(
        &mut self,
        delassus: &Matrix,
        q: &[f64],
        f: &mut [f64],
        closed: &mut [bool],
        chance: &mut Chance,
    ) -> usize {
        self.update_slack(delassus, q, f);
        let zero = Zero::of(q, f);
        let mut violations = 0;
        for ((carries, force), &slack) in closed.iter_mut().zip(f.iter_mut()).zip(&self.slack) {
            if zero.violates(*carries, *force, slack) {
                violations += 1;
                *carries ^= chance.draw();
            }
            *force = force.max(0.0);
        }
        violations
    }

    /// The minimum of ½ f·Gf + q·f over f ≥ 0 by an active set (Lawson & Hanson 1974), started from the positive part of f.
    ///
    /// Each step goes towards the solution on the support, as far as no force turns negative, so that the function falls and no
    /// support comes twice. Violating pairs join all at once, or the worst alone where joining at once led nowhere.
    fn descend(&mut self, delassus: &Matrix, q: &[f64], f: &mut [f64]) {
        let at = &mut self.feasible;
        at.clear();
        at.extend(f.iter().map(|x| x.max(0.0)));
        for (carries, &x) in self.support.iter_mut().zip(at.iter()) {
            *carries = x > 0.0;
        }
        self.factored = false;
        let mut alone = false;
        let mut moved = true;
        for _ in 0..MOST_STEPS_PER_PAIR * q.len() {
            if !self.solve_on_support(delassus, q, f) {
                break;
            }
            let zero = Zero::of(q, f);
            let mut share = 1.0_f64;
            for &a in &self.active {
                if f[a] < -zero.force {
                    share = share.min(self.feasible[a] / (self.feasible[a] - f[a]));
                }
            }
            moved |= share > 0.0;
            let mut blocked = false;
            for &a in &self.active {
                let x = &mut self.feasible[a];
                let turned = f[a] < -zero.force;
                *x = (*x + share * (f[a] - *x)).max(0.0);
                if turned && *x <= zero.force {
                    *x = 0.0;
                    self.support[a] = false;
                    blocked = true;
                }
            }
            if blocked {
                self.factored = false;
                continue;
            }
            let mut joined = 0;
            let mut worst = (0.0, None);
            for (m, &slack) in self.slack.iter().enumerate() {
                if !self.support[m] && slack < -zero.slack {
                    joined += 1;
                    if slack < worst.0 {
                        worst = (slack, Some(m));
                    }
                    self.support[m] = moved;
                }
            }
            let Some(worst) = worst.1 else {
                return;
            };
            if !moved {
                if alone {
                    break;
                }
                self.support[worst] = true;
            }
            alone = joined == 1 || !moved;
            moved = false;
            self.factored = false;
        }
        f.copy_from_slice(&self.feasible);
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
    fn the_descent_ends_where_the_exchanges_do_and_beyond() {
        // 40 pairs on 12 degrees of freedom: rank 12, so that all but 12 eigenvalues are the compliance.
        let wave = |i: usize, j: usize| ((i * i + 7 * j * j + 3 * i * j) as f64).sin();
        let (rows, k) = (12, 40);
        let mut y = Matrix::zeros(rows, k);
        for j in 0..k {
            for (i, x) in y.column_mut(j).iter_mut().enumerate() {
                *x = wave(i, j);
            }
        }
        let mut g = Matrix::default();
        crate::linalg::dense::symmetric_product(&y, &y, &mut g);
        g.mirror_lower();
        let motion: Vec<f64> = (0..rows).map(|i| wave(i, 91)).collect();
        let q: Vec<f64> = (0..k)
            .map(|j| crate::linalg::dense::dot(y.column(j), &motion) + 0.01)
            .collect();
        let mut problem = NormalProblem::default();
        problem.start((0..k).map(|m| m % 3 == 0));
        let mut f = vec![0.0; k];
        problem.descend(&g, &q, &mut f);
        assert!(f.iter().all(|&x| x >= 0.0));
        let residual = problem.residual(&g, &q, &f);
        assert!(residual < 1e-10, "residual {residual}");
        let mut exchanged = vec![0.0; k];
        problem.start((0..k).map(|_| true));
        problem.solve(&g, &q, &mut exchanged);
        // The forces of a hyperstatic network are not unique at this compliance, the velocities are.
        let velocity = |f: &[f64]| {
            let mut v = q.clone();
            g.add_product(f, &mut v);
            v
        };
        for (a, b) in velocity(&f).iter().zip(velocity(&exchanged)) {
            assert!((a - b).abs() < 1e-8);
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
