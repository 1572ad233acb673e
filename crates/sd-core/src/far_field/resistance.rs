//! The far-field resistance: inverse of the grand mobility, without resistance to a layer's translation as a whole.

use super::FarField;
use crate::cell::Cell;
use crate::error::Error;
use crate::linalg::dense::{Cholesky, Matrix, dot};
use crate::modes::Vec2;

/// The far-field resistance of one configuration: M⁻¹, without resistance to a uniform translation of a layer.
///
/// ```text
/// periodic:  R_far = M⁻¹ − M⁻¹ V (Vᵀ M⁻¹ V)⁻¹ Vᵀ M⁻¹ = L⁻ᵀ (I − W Wᵀ) L⁻¹,   V: uniform forces [6N × 2]
/// ```
/// with `M = L Lᵀ` and W the orthonormalised `L⁻¹ V`. Its limit is that of an infinite mobility of the uniform force.
pub struct FarResistance {
    /// Fills M.
    far_field: FarField,
    /// M, then L.
    cholesky: Cholesky,
    /// Inverse of the trailing half of L.
    work: Matrix,
    /// Force from velocity.
    r_fu: Matrix,
    /// Columns of W below its 3N zeros, `[3N × 2]`; no columns in unbounded fluid.
    uniform: Matrix,
    /// Columns of L⁻ᵀ W, velocity rows, `[3N × 2]`.
    lifted: Matrix,
}

impl FarResistance {
    /// Workspace around a planned far field.
    pub fn new(far_field: FarField) -> Self {
        let n = far_field.spheres();
        Self {
            far_field,
            cholesky: Cholesky::new(6 * n),
            work: Matrix::zeros(3 * n, 3 * n),
            r_fu: Matrix::zeros(3 * n, 3 * n),
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
    /// # Errors
    /// Those of [`FarField::fill`]; [`Error::NotPositiveDefinite`] names the sphere at which the factorization broke down.
    pub fn update(&mut self, cell: &Cell, centres: &[Vec2]) -> Result<(), Error> {
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
        self.cholesky
            .trailing_inverse(3 * n, &mut self.work, &mut self.r_fu);
        if self.far_field.is_periodic() {
            self.remove_uniform_motion();
        }
        Ok(())
    }

    /// W, and the rank-two correction of the force-velocity block.
    fn remove_uniform_motion(&mut self) {
        let m = self.r_fu.rows();
        self.uniform.reset(m, 2);
        self.lifted.reshape(m, 2);
        // L⁻¹ V: sums of columns of the inverse of the trailing half of L.
        for j in 0..m {
            if j % 3 < 2 {
                let column = &self.work.column(j)[j..];
                for (sum, value) in self.uniform.column_mut(j % 3)[j..].iter_mut().zip(column) {
                    *sum += value;
                }
            }
        }
        let (first, second) = self.uniform.values_mut().split_at_mut(m);
        normalise(first);
        let overlap = dot(first, second);
        for (b, a) in second.iter_mut().zip(&*first) {
            *b -= overlap * a;
        }
        normalise(second);
        for c in 0..2 {
            for j in 0..m {
                self.lifted[(j, c)] = dot(&self.work.column(j)[j..], &self.uniform.column(c)[j..]);
            }
        }
        let (x, y) = (self.lifted.column(0), self.lifted.column(1));
        for j in 0..m {
            let (xj, yj) = (x[j], y[j]);
            for ((r, xi), yi) in self.r_fu.column_mut(j)[j..]
                .iter_mut()
                .zip(&x[j..])
                .zip(&y[j..])
            {
                *r -= xi * xj + yi * yj;
            }
        }
    }

    /// Force from velocity: lower triangle `[3N × 3N]` of `R_far`'s trailing block, in mu·a, mu·a², mu·a³.
    ///
    /// Rows and columns are `(x, y, z-rotation)` of sphere 0, of sphere 1, ….
    pub fn r_fu(&self) -> &Matrix {
        &self.r_fu
    }

    /// `x ← R_far x`, with x `[6N]` as (−E; U − u∞, Ω − Ω∞) in the order of the module; becomes (S~; F, T).
    ///
    /// Two triangular solves, 2(6N)² flops.
    pub fn apply(&self, x: &mut [f64]) {
        let n = self.far_field.spheres();
        self.cholesky.solve_lower_vector(x);
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
        self.cholesky.solve_upper_vector(x);
    }
}

/// Scales to unit length.
fn normalise(x: &mut [f64]) {
    let scale = dot(x, x).sqrt().recip();
    for value in x {
        *value *= scale;
    }
}
