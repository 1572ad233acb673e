//! Stokesian Dynamics: the far field of all spheres, and `R_FU` as a full matrix with its factor.

use super::pair_terms;
use crate::error::Error;
use crate::hydrodynamics::far_field::{FarField, FarResistance};
use crate::hydrodynamics::two_sphere::PairTerm;
use crate::linalg::cholesky::skyline::SkylineCholesky;
use crate::linalg::dense::Matrix;
use crate::linalg::error::BadPivot;
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use crate::space::pair::Neighbours;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Drag, over that of free spheres, on a periodic layer that moves as a whole. The fluid gives it none, and a layer without
/// pairs would be free to drift; forces add up to zero, so this small drag only sets that drift to zero.
const UNIFORM_DRAG: f64 = 1e-9;

/// The far field and the full `R_FU`, rows in the order of the spheres.
pub(super) struct DenseResistance {
    far: FarResistance,
    /// `R_FU`, then its factor.
    factor: SkylineCholesky,
    /// Scratch of the far field, `[6N]`.
    vector: Vec<f64>,
}

impl DenseResistance {
    /// Workspace around a planned far field.
    pub(super) fn new(far_field: FarField) -> Self {
        let spheres = far_field.spheres();
        Self {
            far: FarResistance::new(far_field),
            factor: SkylineCholesky::new(3 * spheres),
            vector: Vec::new(),
        }
    }

    /// First row of a sphere in the factor.
    pub(super) fn row(sphere: usize) -> usize {
        3 * sphere
    }

    /// `R_FU` of the far field and the pair terms.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] for the far-field mobility.
    pub(super) fn assemble(
        &mut self,
        cell: &Cell,
        centres: &[Vec2],
        pairs: &[Neighbours],
        terms: &[PairTerm],
    ) -> Result<(), Error> {
        let matrix = self.factor.full_matrix();
        self.far.update(cell, centres, matrix)?;
        if matches!(cell, Cell::Periodic { .. }) {
            resist_uniform_motion(matrix);
        }
        pair_terms::add_to_matrix(pairs, terms, Self::row, matrix);
        Ok(())
    }

    /// Adds `slope` n nᵀ of a pair's relative velocity.
    pub(super) fn add_spring(&mut self, pair: &Neighbours, slope: f64) {
        let rows = [pair.i, pair.j].map(Self::row);
        pair_terms::add_spring(pair, slope, rows, self.factor.filled_matrix());
    }

    pub(super) fn factor(&mut self) -> Result<(), BadPivot> {
        self.factor.factor()
    }

    pub(super) fn solver(&self) -> &SkylineCholesky {
        &self.factor
    }

    /// Forces `[3N]` with which the background strain drives the spheres through the far field.
    pub(super) fn background_forces(&mut self, strain: &Vector3<f64>, forces: &mut [f64]) {
        let half = forces.len();
        self.vector.clear();
        self.vector.resize(2 * half, 0.0);
        for e in self.vector[..half].chunks_exact_mut(3) {
            e.copy_from_slice(strain.as_slice());
        }
        self.far.apply_for_forces(&mut self.vector);
        forces.copy_from_slice(&self.vector[half..]);
    }

    /// Appends the far field's counterforces `[3N]` and stresslets to empty vectors; `work` is scratch.
    pub(super) fn apply(
        &self,
        velocities: &[f64],
        strain: &Vector3<f64>,
        work: &mut Vec<f64>,
        forces: &mut Vec<f64>,
        stresslets: &mut Vec<Vector3<f64>>,
    ) {
        let half = velocities.len();
        work.clear();
        work.resize(2 * half, 0.0);
        for e in work[..half].chunks_exact_mut(3) {
            e.copy_from_slice((-strain).as_slice());
        }
        work[half..].copy_from_slice(velocities);
        self.far.apply(work);
        forces.extend_from_slice(&work[half..]);
        stresslets.extend(
            work[..half]
                .chunks_exact(3)
                .map(|s| -Vector3::from_column_slice(s)),
        );
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
