//! Solves with the sparse resistance R_P: by its factor, or pair by pair with conjugate gradients.

use crate::error::Error;
use crate::hydrodynamics::resistance::Resistance;
use crate::linalg::Until;
use crate::linalg::cholesky::sparse::BlockCholesky;
use crate::linalg::conjugate_gradients::{ConjugateGradients, largest};

/// Largest residual force at which conjugate gradients stop, over the largest force.
const LEFT: f64 = 1e-10;
const MOST_ITERATIONS: usize = 100;

/// Workspace of solves with the `R_FU` of what the far field is iterated on.
#[derive(Default)]
pub(super) struct NearSolver {
    /// Vector in the order of the factor's rows, `[3N]`.
    rows: Vec<f64>,
    forces: Vec<f64>,
    /// Factor of the near part of what is held pair by pair.
    factor: BlockCholesky,
    /// Conjugate gradients with all of `R_FU`, which that factor preconditions.
    gradients: ConjugateGradients,
}

impl NearSolver {
    /// Prepares solves with a resistance at its present positions.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(super) fn start(&mut self, near: &Resistance) -> Result<(), Error> {
        let Some(pairwise) = near.pairwise() else {
            return Ok(());
        };
        let pattern = pairwise.pattern();
        pairwise.fill(pattern, &mut self.factor);
        self.factor
            .factor(pattern)
            .map_err(|bad| Error::NotPositiveDefinite {
                matrix: "near part of the resistance",
                pivot: bad.pivot,
                sphere: bad.pivot / 3,
            })
    }

    /// `x ← R_P⁻¹ x`, `[3N]`.
    pub(super) fn solve(&mut self, near: &Resistance, x: &mut [f64]) {
        let Some(pairwise) = near.pairwise() else {
            near.to_rows(x, &mut self.rows);
            near.solver().solve(&mut self.rows);
            near.from_rows(&self.rows, x);
            return;
        };
        let pattern = pairwise.pattern();
        self.forces.clear();
        self.forces.extend_from_slice(x);
        let factor = &mut self.factor;
        self.gradients.solve(
            &self.forces,
            x,
            Until::new(LEFT * largest(&self.forces), MOST_ITERATIONS),
            |v, y| pairwise.apply(v, y),
            |r, z| factor.solve(pattern, r, z),
        );
    }
}
