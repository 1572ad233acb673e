//! Acceleration of a fixed point (Anderson 1965) that remembers many steps.
//!
//! ```text
//! steps e_k of x and d_k of the residual that belong together, d_k orthonormal:   x ← x + r − Σ (d_k·r)(e_k + d_k)
//! ```
//! Anderson's method with the least-squares problem solved as it grows; of a linear fixed point it makes the least residual in the
//! space spanned, as GMRES does.

use crate::linalg::dense::{add_scaled, dot};

/// The steps that the acceleration of one fixed point remembers.
pub(crate) struct Anderson {
    /// Pairs of steps (of x, of the residual), as many as are remembered at most, `kept` of them in use.
    steps: Vec<[Vec<f64>; 2]>,
    kept: usize,
    /// Which of them is overwritten next once all are in use.
    oldest: usize,
    /// The last x and its residual.
    last: [Vec<f64>; 2],
    /// Whether `last` is the iterate before this one, so that a step can be learned from it.
    connected: bool,
}

impl Anderson {
    /// Remembers up to `depth` steps of `unknowns` numbers; more unknowns make it allocate.
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

    /// Forgets all steps.
    pub(crate) fn restart(&mut self) {
        self.kept = 0;
        self.oldest = 0;
        self.connected = false;
    }

    /// Learns nothing from the step that led to the present x: g has changed since. What was learned before serves still.
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
        let useful = norm > 1e-10 * before;
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
            // The place in the middle has become empty: the last pair takes it.
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
    fn what_was_learned_serves_another_problem_of_the_same_slopes() {
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
            // The second direction is learned from the step after the change, or from one that is none.
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
