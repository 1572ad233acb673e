//! The far-field resistance: inverse of the grand mobility, without resistance to a uniform
//! translation of a layer.

use super::FarField;
use crate::error::Error;
use crate::linalg::cholesky::tiled::{TILE, TiledCholesky};
use crate::linalg::dense::{Matrix, dot};
use crate::linalg::simd::vectorised;
use crate::space::cell::Cell;
use crate::space::modes::Vec2;

/// The far-field resistance of one configuration: M⁻¹, without resistance to a uniform translation
/// of a layer.
///
/// ```text
/// periodic:  R_far = M⁻¹ − M⁻¹ V (Vᵀ M⁻¹ V)⁻¹ Vᵀ M⁻¹ = L⁻ᵀ (I − W Wᵀ) L⁻¹,   V: uniform forces [6N × 2]
/// ```
/// with `M = L Lᵀ` and W the orthonormalised `L⁻¹ V`. Its limit is that of an infinite mobility of
/// the uniform force.
pub struct FarResistance {
    /// Fills in M.
    far_field: FarField,
    /// M, then L.
    cholesky: TiledCholesky,
    /// Columns of W below its 3N zeros, `[3N × 2]`; no columns in unbounded fluid.
    uniform: Matrix,
    /// Columns of L⁻ᵀ W, velocity rows, `[3N × 2]`.
    lifted: Matrix,
}

impl FarResistance {
    /// Workspace around a planned far field.
    pub fn new(far_field: FarField) -> Self {
        Self {
            far_field,
            cholesky: TiledCholesky::default(),
            uniform: Matrix::default(),
            lifted: Matrix::default(),
        }
    }

    /// The far field in use.
    pub fn far_field(&self) -> &FarField {
        &self.far_field
    }

    /// Computes `R_far` of a configuration. Allocates nothing after the first call.
    ///
    /// # Arguments
    /// - `r_fu`: takes force from velocity, the lower triangle `[3N × 3N]` of `R_far`'s trailing
    ///   block, in mu·a, mu·a², mu·a³; rows and columns are `(x, y, z-rotation)` of sphere 0, of
    ///   sphere 1, ….
    ///
    /// # Errors
    /// Those of [`FarField::fill`]; [`Error::NotPositiveDefinite`] names the sphere at which the
    /// factorization broke down.
    pub fn update(
        &mut self,
        cell: &Cell,
        centres: &[Vec2],
        r_fu: &mut Matrix,
    ) -> Result<(), Error> {
        let n = self.far_field.spheres();
        self.far_field
            .fill(cell, centres, self.cholesky.matrix_mut())?;
        self.cholesky
            .factor()
            .map_err(|failure| Error::NotPositiveDefinite {
                matrix: "far-field mobility",
                pivot: failure.pivot,
                sphere: (failure.pivot % (3 * n)) / 3,
            })?;
        self.cholesky.trailing_inverse(r_fu);
        if self.far_field.is_periodic() {
            self.remove_uniform_motion(r_fu);
        }
        Ok(())
    }

    /// W, and the rank-two correction of the force-velocity block.
    fn remove_uniform_motion(&mut self, r_fu: &mut Matrix) {
        let m = r_fu.rows();
        self.uniform.reset(m, 2);
        self.lifted.reset(m, 2);
        let (first, second) = self.uniform.values_mut().split_at_mut(m);
        // L⁻¹ V: sums of every third row of L₂₂⁻ᵀ, whose rows of tiles begin with a sphere.
        for (rows, columns) in self.cholesky.inverse_rows() {
            let spheres = rows.len() / 3;
            for (column, (x, y)) in columns.chunks_exact(TILE).zip(
                first[rows.start..]
                    .iter_mut()
                    .zip(&mut second[rows.start..]),
            ) {
                for sphere in column[..3 * spheres].chunks_exact(3) {
                    *x += sphere[0];
                    *y += sphere[1];
                }
            }
        }
        normalise(first);
        let overlap = dot(first, second);
        for (b, a) in second.iter_mut().zip(&*first) {
            *b -= overlap * a;
        }
        normalise(second);
        let cholesky = &self.cholesky;
        let (x, y) = self.lifted.values_mut().split_at_mut(m);
        vectorised(
            #[inline(always)]
            || {
                for (rows, columns) in cholesky.inverse_rows() {
                    let (mut sum_x, mut sum_y) = ([0.0; TILE], [0.0; TILE]);
                    let weights = first[rows.start..].iter().zip(&second[rows.start..]);
                    for (column, (&a, &b)) in columns.chunks_exact(TILE).zip(weights) {
                        for k in 0..TILE {
                            sum_x[k] += a * column[k];
                            sum_y[k] += b * column[k];
                        }
                    }
                    x[rows.clone()].copy_from_slice(&sum_x[..rows.len()]);
                    y[rows.clone()].copy_from_slice(&sum_y[..rows.len()]);
                }
                for j in 0..m {
                    let (xj, yj) = (x[j], y[j]);
                    for ((r, xi), yi) in
                        r_fu.column_mut(j)[j..].iter_mut().zip(&x[j..]).zip(&y[j..])
                    {
                        *r -= xi * xj + yi * yj;
                    }
                }
            },
        );
    }

    /// `x ← R_far x`, with x `[6N]` as (−E; U − u∞, Ω − Ω∞) in the order of the module; becomes
    /// (S~; F, T).
    ///
    /// Two triangular solves, 2(6N)² flops.
    pub fn apply(&self, x: &mut [f64]) {
        self.apply_lower(x);
        self.cholesky.solve_upper_vector(x, 0);
    }

    /// As [`FarResistance::apply`] for the forces and torques alone: the 3N leading entries are
    /// undefined.
    pub fn apply_for_forces(&self, x: &mut [f64]) {
        self.apply_lower(x);
        self.cholesky
            .solve_upper_vector(x, 3 * self.far_field.spheres());
    }

    /// `x ← L⁻ᵀ (I − W Wᵀ) x`, all modes.
    pub fn take_root(&self, x: &mut [f64]) {
        self.project(x);
        self.cholesky.solve_upper_vector(x, 0);
    }

    /// `x ← (I − W Wᵀ) L⁻¹ x`.
    fn apply_lower(&self, x: &mut [f64]) {
        self.cholesky.solve_lower_vector(x);
        self.project(x);
    }

    /// `x ← (I − W Wᵀ) x`.
    fn project(&self, x: &mut [f64]) {
        let n = self.far_field.spheres();
        if self.far_field.is_periodic() {
            let tail = &mut x[3 * n..];
            for c in 0..2 {
                let w = self.uniform.column(c);
                let component = dot(w, tail);
                for (t, w) in tail.iter_mut().zip(w) {
                    *t -= component * w;
                }
            }
        }
    }
}

fn normalise(x: &mut [f64]) {
    let scale = dot(x, x).sqrt().recip();
    for value in x {
        *value *= scale;
    }
}
