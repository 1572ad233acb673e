//! Conjugate gradients with a preconditioner (Hestenes & Stiefel 1952).

use super::StopCriteria;
use super::dense::dot;
use super::simd::vectorised;
use super::vector::add_scaled_inline;

/// Workspace of the iteration. Reused, it allocates nothing.
#[derive(Debug, Default)]
pub(crate) struct ConjugateGradients {
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    /// The matrix times the direction.
    image: Vec<f64>,
}

impl ConjugateGradients {
    /// Largest entry of the residual of the last solve.
    pub(crate) fn residual(&self) -> f64 {
        largest(&self.residual)
    }

    /// `x ≈ A⁻¹ b` from x = 0, the residual measured by its largest entry; returns the number of
    /// iterations.
    ///
    /// # Arguments
    /// - `apply`: writes A times its first argument to the second; A symmetric and positive
    ///   definite, as is
    /// - `precondition`: the same for an approximation of its inverse.
    pub(crate) fn solve(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        stop: StopCriteria,
        mut apply: impl FnMut(&[f64], &mut [f64]),
        mut precondition: impl FnMut(&[f64], &mut [f64]),
    ) -> usize {
        self.residual.clear();
        self.residual.extend_from_slice(b);
        for vector in [
            &mut self.preconditioned,
            &mut self.direction,
            &mut self.image,
        ] {
            vector.clear();
            vector.resize(b.len(), 0.0);
        }
        x.fill(0.0);
        let mut product_before = f64::INFINITY;
        for iteration in 0..stop.iterations {
            if largest(&self.residual) <= stop.residual {
                return iteration;
            }
            precondition(&self.residual, &mut self.preconditioned);
            let product = dot(&self.residual, &self.preconditioned);
            let share = product / product_before;
            for (p, z) in self.direction.iter_mut().zip(&self.preconditioned) {
                *p = z + share * *p;
            }
            apply(&self.direction, &mut self.image);
            let length = product / dot(&self.direction, &self.image);
            let (direction, image) = (&self.direction, &self.image);
            let residual = &mut self.residual;
            vectorised(
                #[inline(always)]
                || {
                    add_scaled_inline(x, direction, length);
                    add_scaled_inline(residual, image, -length);
                },
            );
            product_before = product;
        }
        stop.iterations
    }
}

/// Largest absolute entry.
pub(crate) fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_eigenvalues_take_three_iterations() {
        let diagonal = [1.0, 4.0, 9.0, 4.0, 1.0, 9.0];
        let apply = |x: &[f64], y: &mut [f64]| {
            for k in 0..6 {
                y[k] = diagonal[k] * x[k];
            }
        };
        let copy = |r: &[f64], z: &mut [f64]| z.copy_from_slice(r);
        let b = [1.0, 2.0, -3.0, 0.5, 4.0, 1.0];
        let mut x = [0.0; 6];
        let mut solver = ConjugateGradients::default();
        assert_eq!(
            solver.solve(&b, &mut x, StopCriteria::new(1e-12, 10), apply, copy),
            3
        );
        for k in 0..6 {
            assert!((x[k] - b[k] / diagonal[k]).abs() < 1e-12);
        }
    }

    #[test]
    fn nothing_is_done_where_nothing_is_wanted() {
        let mut x = [1.0];
        let never = |_: &[f64], _: &mut [f64]| panic!("not needed");
        let iterations = ConjugateGradients::default().solve(
            &[0.0],
            &mut x,
            StopCriteria::new(0.0, 5),
            never,
            never,
        );
        assert_eq!((iterations, x), (0, [0.0]));
    }
}
