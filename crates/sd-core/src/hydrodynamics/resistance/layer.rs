//! The hydrodynamics of a layer.

use super::fluid::{FarMatrix, Fluid, NearTerm};
use super::reach::Reach;
use crate::error::Error;
use crate::hydrodynamics::far_field::{FarField, FarResistance};
use crate::hydrodynamics::two_sphere::PairTerm;
use crate::linalg::dense::Matrix;
use crate::space::Layer;
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use std::f64::consts::PI;

/// Drag, over that of free spheres, on the uniform translation of a periodic layer. The fluid does
/// not resist it, and a layer without pairs could drift; since forces sum to zero, this small drag
/// only sets the drift to zero.
const UNIFORM_DRAG: f64 = 1e-9;

impl Fluid for Layer {
    type Term = PairTerm;
    type Far = FarResistance;
    const TWISTS: bool = false;
    const ENDS_AT_CUTOFF: bool = false;
    const DRIFTS: usize = 2;
    const REACHES: [Reach; 2] = [
        // Pairs in contact or close to it: the factor is then small, which gives more but cheaper
        // iterations.
        Reach {
            required: 2.1,
            included: 2.2,
            contact_margin: 0.08,
        },
        // Includes first neighbours: each iteration then reduces the residual by a factor of about
        // thirty.
        Reach {
            required: 2.4,
            included: 2.7,
            contact_margin: 0.08,
        },
    ];

    #[inline(always)]
    fn term(term: &PairTerm, _: [f64; 3]) -> PairTerm {
        *term
    }
}

impl NearTerm<Layer> for PairTerm {
    #[inline]
    fn add(&mut self, other: &Self) {
        Self::add(self, other);
    }

    #[inline]
    fn scaled(&self, factor: f64) -> Self {
        Self::scaled(self, factor)
    }

    #[inline(always)]
    fn blocks(&self, n: &Vec2) -> [[f64; 9]; 3] {
        [
            self.block(*n, 0, 0),
            self.block(*n, 1, 0),
            self.block(*n, 1, 1),
        ]
    }

    #[inline]
    fn mode_blocks(&self, n: &Vec2) -> [[[f64; 6]; 6]; 3] {
        [
            self.mode_block(*n, 0, 0),
            self.mode_block(*n, 1, 0),
            self.mode_block(*n, 1, 1),
        ]
    }

    #[inline(always)]
    fn apply(&self, n: &Vec2, x: &[[f64; 6]; 2]) -> [[f64; 6]; 2] {
        Self::apply(self, *n, x)
    }
}

impl FarMatrix<Layer> for FarResistance {
    const TOLERANCE: f64 = FarField::DEFAULT_TOLERANCE;

    fn new(cell: &Cell, radii: &[f64], tolerance: f64) -> Result<Self, Error> {
        Ok(Self::new(FarField::new(cell, radii, tolerance)?))
    }

    fn fill(&mut self, cell: &Cell, centres: &[Vec2], matrix: &mut Matrix) -> Result<(), Error> {
        self.update(cell, centres, matrix)?;
        if matches!(cell, Cell::Periodic { .. }) {
            resist_uniform_motion(matrix);
        }
        Ok(())
    }

    fn apply(&self, x: &mut [f64]) {
        Self::apply(self, x);
    }

    fn apply_for_forces(&self, x: &mut [f64]) {
        Self::apply_for_forces(self, x);
    }

    fn take_root(&self, x: &mut [f64]) {
        Self::take_root(self, x);
    }
}

/// Adds [`UNIFORM_DRAG`] to the lower triangle of R_FU, `[3N × 3N]`.
fn resist_uniform_motion(matrix: &mut Matrix) {
    let n = matrix.rows() / 3;
    let drag = 6.0 * PI * UNIFORM_DRAG / n as f64;
    for i in 0..n {
        for m in 0..2 {
            let column = matrix.column_mut(3 * i + m);
            for entry in column[3 * i + m..].iter_mut().step_by(3) {
                *entry += drag;
            }
        }
    }
}
