//! The six planar modes of a sphere in the layer.
//!
//! The layer's plane is a mirror and all forcing is even in z, so per sphere only the velocities
//! `U_x, U_y, Ω_z` and three strains survive, exactly. Orthonormal basis of the symmetric traceless
//! even tensors (`E_zz = −E_xx − E_yy`):
//!
//! ```text
//! e1 = (E_xx − E_yy)/√2,   e2 = √2 E_xy,   e3 = √(3/2) (E_xx + E_yy);   S:E = s·e,  S_xy = s2/√2
//! ```
//!
//! A mode vector is ordered `(U_x, U_y, Ω, e1, e2, e3)`, a force vector
//! `(F_x, F_y, T, s1, s2, s3)`. Under a rotation by θ, U turns by θ, `(e1, e2)` by 2θ; Ω and e3 are
//! unchanged.

use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// A vector in the plane of the layer.
pub type Vec2 = Vector2<f64>;
/// Modes of one sphere, or the forces conjugate to them.
pub type Modes = SVector<f64, 6>;
/// A coupling of the modes of two spheres.
pub type ModeBlock = SMatrix<f64, 6, 6>;

/// Symmetric traceless even tensor to its components `(e1, e2, e3)`.
pub fn strain_modes(xx: f64, yy: f64, xy: f64) -> Vector3<f64> {
    Vector3::new(
        (xx - yy) * FRAC_1_SQRT_2,
        SQRT_2 * xy,
        1.5_f64.sqrt() * (xx + yy),
    )
}

/// Components `(e1, e2, e3)` to the tensor's `(xx, yy, xy)`.
///
/// ```
/// use sd_core::modes::{strain_modes, strain_tensor};
///
/// let (xx, yy, xy) = strain_tensor(&strain_modes(0.1, -0.2, 0.5));
/// assert!((xx - 0.1).abs() < 1e-15 && (yy + 0.2).abs() < 1e-15 && (xy - 0.5).abs() < 1e-15);
/// ```
pub fn strain_tensor(e: &Vector3<f64>) -> (f64, f64, f64) {
    let difference = SQRT_2 * e[0];
    let sum = e[2] / 1.5_f64.sqrt();
    (
        0.5 * (sum + difference),
        0.5 * (sum - difference),
        e[1] * FRAC_1_SQRT_2,
    )
}

/// The matrix that transforms lab-frame modes to the frame whose x axis is the unit vector `n`.
///
/// Its transpose is the inverse.
pub fn rotation_to_frame(n: Vec2) -> ModeBlock {
    let (c, s) = (n.x, n.y);
    let (c2, s2) = (c * c - s * s, 2.0 * c * s);
    #[rustfmt::skip]
    let q = ModeBlock::from_row_slice(&[
          c,   s, 0.0,  0.0, 0.0, 0.0,
         -s,   c, 0.0,  0.0, 0.0, 0.0,
        0.0, 0.0, 1.0,  0.0, 0.0, 0.0,
        0.0, 0.0, 0.0,   c2,  s2, 0.0,
        0.0, 0.0, 0.0,  -s2,  c2, 0.0,
        0.0, 0.0, 0.0,  0.0, 0.0, 1.0,
    ]);
    q
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_is_orthonormal_under_double_contraction() {
        let (a, b) = ((0.3, -1.1, 0.7), (1.9, 0.4, -0.2));
        let contraction = a.0 * b.0 + a.1 * b.1 + 2.0 * a.2 * b.2 + (a.0 + a.1) * (b.0 + b.1);
        let dot = strain_modes(a.0, a.1, a.2).dot(&strain_modes(b.0, b.1, b.2));
        assert!((contraction - dot).abs() < 1e-14);
    }

    #[test]
    fn tensor_round_trip() {
        let (xx, yy, xy) = strain_tensor(&strain_modes(0.3, -1.1, 0.7));
        assert!((xx - 0.3).abs() + (yy + 1.1).abs() + (xy - 0.7).abs() < 1e-14);
    }

    #[test]
    fn strain_turns_by_twice_the_angle() {
        // Extension along n is extension along x in the frame of n.
        let (s, c) = 0.4_f64.sin_cos();
        let n = Vec2::new(c, s);
        let lab = strain_modes(c * c - 0.5, s * s - 0.5, c * s);
        let mut modes = Modes::zeros();
        modes.fixed_rows_mut::<3>(3).copy_from(&lab);
        let pair = rotation_to_frame(n) * modes;
        let expected = strain_modes(0.5, -0.5, 0.0);
        assert!((pair.fixed_rows::<3>(3) - expected).norm() < 1e-14);
    }
}
