//! Anderson acceleration of a fixed point (1965) with a long history.
//!
//! ```text
//! corresponding steps e_k of x and d_k of the residual, d_k orthonormal:   x ← x + r − Σ (d_k·r)(e_k + d_k)
//! ```
//! Anderson's method with incremental solution of the least-squares problem; for a linear fixed
//! point it minimizes the residual in the spanned space, like GMRES.

use crate::linalg::dense::{add_scaled, dot};

/// Smallest part of a change of the residual, over its length, by which it is independent of the
/// changes before; less is rounding, which the history would amplify.
const MIN_INDEPENDENT: f64 = 1e-10;

/// The history of the acceleration of one fixed point.
pub(crate) struct Anderson {
    /// Pairs of steps (of x, of the residual), up to the length of the history, `kept` of them in
    /// use.
    steps: Vec<[Vec<f64>; 2]>,
    kept: usize,
    /// Index of the one overwritten next once all are in use.
    oldest: usize,
    /// The last x and its residual.
    last: [Vec<f64>; 2],
    /// Whether `last` is the preceding iterate, so that a step can be added from it.
    connected: bool,
}

impl Anderson {
    /// A history of up to `depth` steps of `unknowns` numbers; more unknowns cause an allocation.
    pub(crate) fn new(depth: usize, unknowns: usize) -> Self {
        let pair = || [Vec::with_capacity(unknowns), Vec::with_capacity(unknowns)];
        Self {
            steps: (0..depth).map(|_| pair()).collect(),
            kept: 0,
            oldest: 0,
            last: pair(),
            connected: false,
        }
    }

    /// Clears the history.
    pub(crate) fn restart(&mut self) {
        self.kept = 0;
        self.oldest = 0;
        self.connected = false;
    }

    /// Skips the step that led to the present x, since g has changed; earlier steps are kept.
    pub(crate) fn skip_step(&mut self) {
        self.connected = false;
    }

    /// Replaces x by the next guess; `residual` is g(x) − x.
    pub(crate) fn advance(&mut self, x: &mut [f64], residual: &[f64]) {
        if self.connected {
            self.learn(x, residual);
        }
        for (last, now) in self.last.iter_mut().zip([&*x, residual]) {
            last.clear();
            last.extend_from_slice(now);
        }
        self.connected = true;
        add_scaled(x, residual, 1.0);
        for [step, change] in &self.steps[..self.kept] {
            let share = dot(change, residual);
            add_scaled(x, step, -share);
            add_scaled(x, change, -share);
        }
    }

    /// Adds the step from the last x to this one.
    fn learn(&mut self, x: &[f64], residual: &[f64]) {
        let depth = self.steps.len();
        let full = self.kept == depth;
        let slot = if full { self.oldest } else { self.kept };
        let mut new = std::mem::take(&mut self.steps[slot]);
        let now = [x, residual];
        for ((new, now), last) in new.iter_mut().zip(now).zip(&self.last) {
            new.clear();
            new.extend(now.iter().zip(last).map(|(now, last)| now - last));
        }
        let [step, change] = &mut new;
        let before = dot(change, change).sqrt();
        // Twice is enough.
        for _ in 0..2 {
            for (k, [other_step, other]) in self.steps[..self.kept].iter().enumerate() {
                if k != slot {
                    let share = dot(other, change);
                    add_scaled(change, other, -share);
                    add_scaled(step, other_step, -share);
                }
            }
        }
        let norm = dot(change, change).sqrt();
        let useful = norm > MIN_INDEPENDENT * before;
        if useful {
            for value in step.iter_mut().chain(change.iter_mut()) {
                *value /= norm;
            }
        }
        self.steps[slot] = new;
        if useful && full {
            self.oldest = (slot + 1) % depth;
        } else if useful {
            self.kept += 1;
        } else if full {
            // The last pair fills the gap in the middle.
            self.steps.swap(slot, depth - 1);
            self.kept -= 1;
            self.oldest = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_fixed_point_takes_as_many_steps_as_unknowns() {
        // g(x) = A x + b; the plain iteration diverges.
        let g = |x: &[f64]| {
            [
                1.5 * x[0] - 0.3 * x[1] + 1.0,
                0.4 * x[0] + 0.2 * x[1] - 2.0,
                -2.0 * x[2] + 0.1 * x[0] + 0.5,
            ]
        };
        let residual = |x: &[f64]| -> Vec<f64> { g(x).iter().zip(x).map(|(g, x)| g - x).collect() };
        let mut anderson = Anderson::new(40, 3);
        let mut x = vec![0.0; 3];
        for _ in 0..4 {
            let r = residual(&x);
            anderson.advance(&mut x, &r);
        }
        assert!(residual(&x).iter().all(|r| r.abs() < 1e-12), "{x:?}");
    }

    #[test]
    fn learned_steps_remain_useful_for_another_problem_of_the_same_slopes() {
        // g(x) = A x + b, whose b changes once all directions are known.
        let slopes = [[1.5, -0.3], [0.4, 0.2]];
        let residual = |x: &[f64], b: [f64; 2]| -> Vec<f64> {
            let rows = slopes.iter().zip(b);
            let images = rows.map(|(a, b)| a[0] * x[0] + a[1] * x[1] + b);
            images.zip(x).map(|(g, x)| g - x).collect()
        };
        let (before, after) = ([1.0, -2.0], [-3.0, 0.5]);
        let solved = |skips: bool| {
            let mut anderson = Anderson::new(40, 2);
            let mut x = vec![0.0; 2];
            for _ in 0..2 {
                let r = residual(&x, before);
                anderson.advance(&mut x, &r);
            }
            // The second direction is added from the step after the change, or from an invalid one.
            if skips {
                anderson.skip_step();
            }
            for _ in 0..2 {
                let r = residual(&x, after);
                anderson.advance(&mut x, &r);
            }
            residual(&x, after).iter().all(|r| r.abs() < 1e-12)
        };
        assert!(solved(true));
        assert!(!solved(false));
    }
}
