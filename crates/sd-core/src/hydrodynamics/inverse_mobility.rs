//! Solves with the mobility of the far field, by conjugate gradients.

use super::far_field::far_operator::FarOperator;
use super::resistance::{Fluid, isolated};
use crate::error::Error;
use crate::linalg::dense::{add_scaled, dot};
use crate::space::FixedArray as _;
use crate::space::cell::Cell;

/// Iterations after which a solve has failed. The condition number of M is some hundreds for
/// spheres in contact, which takes a few dozen.
const MAX_ITERATIONS: u32 = 1000;

/// Force modes from velocity modes, `M q = x`; on a periodic layer `M q = x − V c` and `Vᵀ q = 0`
/// with V its translations, which no force can cause.
pub(crate) struct InverseMobility<S: Fluid> {
    /// Drag of isolated spheres on all modes, which preconditions.
    drag: Vec<f64>,
    /// Sum of the drags on a translation of all spheres.
    uniform_drag: f64,
    /// Number of directions of V.
    drifts: usize,
    /// q.
    solution: Vec<f64>,
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
    space: std::marker::PhantomData<S>,
}

impl<S: Fluid> InverseMobility<S> {
    pub(crate) fn new(cell: &Cell<S>, radii: &[f64]) -> Self {
        let drag: Vec<_> = radii.iter().map(|&radius| isolated::<S>(radius)).collect();
        let drag = S::PerAnyMode::flat(&drag).to_vec();
        let vector = || vec![0.0; drag.len()];
        Self {
            drifts: cell.lattice().map_or(0, |_| S::DRIFTS),
            uniform_drag: drag.iter().step_by(S::ALL_MODES).sum(),
            solution: vector(),
            residual: vector(),
            preconditioned: vector(),
            direction: vector(),
            image: vector(),
            drag,
            space: std::marker::PhantomData,
        }
    }

    /// q for the velocity modes x, to a relative residual `√(rᵀ D r)/√(xᵀ D x)`, D the drag.
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    pub(crate) fn solve(
        &mut self,
        operator: &mut FarOperator<S>,
        x: &[f64],
        tolerance: f64,
    ) -> Result<&[f64], Error> {
        self.solution.fill(0.0);
        self.residual.copy_from_slice(x);
        let mut square = self.precondition();
        let first = square;
        self.direction.copy_from_slice(&self.preconditioned);
        let mut iterations = 0;
        while square > tolerance * tolerance * first {
            if iterations == MAX_ITERATIONS || !square.is_finite() {
                return Err(Error::NotConverged {
                    quantity: "the inverse of the mobility",
                    iterations,
                    residual: (square / first).sqrt(),
                    wanted: tolerance,
                });
            }
            iterations += 1;
            operator.apply(&self.direction, &mut self.image);
            let length = square / dot(&self.direction, &self.image);
            add_scaled(&mut self.solution, &self.direction, length);
            add_scaled(&mut self.residual, &self.image, -length);
            let before = square;
            square = self.precondition();
            for (direction, z) in self.direction.iter_mut().zip(&self.preconditioned) {
                *direction = z + square / before * *direction;
            }
        }
        Ok(&self.solution)
    }

    /// Multiplies the residual by the drag, without the translation that a net force would cause;
    /// returns the product of both.
    fn precondition(&mut self) -> f64 {
        let rows = self.residual.iter().zip(&self.drag);
        self.preconditioned.clear();
        self.preconditioned.extend(rows.map(|(r, drag)| r * drag));
        for k in 0..self.drifts {
            let translations = || (k..self.drag.len()).step_by(S::ALL_MODES);
            let net: f64 = translations().map(|row| self.preconditioned[row]).sum();
            for row in translations() {
                self.preconditioned[row] -= net / self.uniform_drag * self.drag[row];
            }
        }
        dot(&self.residual, &self.preconditioned)
    }
}
