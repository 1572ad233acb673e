//! Solves with the sparse resistance R_P: by its factor, or pair by pair with conjugate gradients.

use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, NearMatrix, Resistance};
use crate::linalg::StopCriteria;
use crate::linalg::conjugate_gradients::{ConjugateGradients, largest};

/// Relative tolerance of conjugate gradients: largest residual force over the largest force.
const RESIDUAL_TOLERANCE: f64 = 1e-10;
const MAX_ITERATIONS: u32 = 500;

/// Workspace of solves with the sparse `R_FU` below the iterated far field.
#[derive(Default)]
pub(crate) struct NearSolver<S: Fluid> {
    /// Vector in the order of the factor's rows, `[3N]`.
    rows: Vec<f64>,
    forces: Vec<f64>,
    /// Factor of the near part of a pairwise resistance.
    factor: NearMatrix<S>,
    /// Conjugate gradients with all of `R_FU`, which that factor preconditions.
    gradients: ConjugateGradients,
}

impl<S: Fluid> NearSolver<S> {
    /// Prepares solves with a resistance at its present positions.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn start(&mut self, near: &Resistance<S>) -> Result<(), Error> {
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
                sphere: bad.pivot / S::MODES,
            })
    }

    /// `x ← R_P⁻¹ x`.
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    pub(crate) fn solve(&mut self, near: &Resistance<S>, x: &mut [f64]) -> Result<(), Error> {
        let Some(pairwise) = near.pairwise() else {
            near.to_rows(x, &mut self.rows);
            near.solver().solve(&mut self.rows);
            near.from_rows(&self.rows, x);
            return Ok(());
        };
        let pattern = pairwise.pattern();
        self.forces.clear();
        self.forces.extend_from_slice(x);
        let (factor, largest) = (&mut self.factor, largest(&self.forces));
        self.gradients.solve(
            &self.forces,
            x,
            StopCriteria::new(RESIDUAL_TOLERANCE * largest, MAX_ITERATIONS as usize),
            |v, y| pairwise.apply(v, y),
            |r, z| factor.solve(pattern, r, z),
        );
        let residual = self.gradients.residual();
        if residual <= RESIDUAL_TOLERANCE * largest {
            return Ok(());
        }
        Err(Error::NotConverged {
            quantity: "the motion under near-field hydrodynamics",
            iterations: MAX_ITERATIONS,
            residual: residual / largest,
            wanted: RESIDUAL_TOLERANCE,
        })
    }
}
