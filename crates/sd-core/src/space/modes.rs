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
use serde::{Deserialize, Serialize};
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

/// The imposed linear flow `u∞(x) = E∞·x + Ω∞ × x`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Background {
    /// `E_xx`, in shear rates.
    pub xx: f64,
    /// `E_yy`.
    pub yy: f64,
    /// `E_xy`.
    pub xy: f64,
    /// `Ω_z`.
    pub angular_velocity: f64,
}

impl Background {
    /// Simple shear at unit rate: `u∞ = y x̂`.
    pub const SHEAR: Self = Self {
        xx: 0.0,
        yy: 0.0,
        xy: 0.5,
        angular_velocity: -0.5,
    };
    /// Simple shear in the sense of `direction`: 1 as [`Background::SHEAR`], −1 reversed.
    pub fn shear(direction: f64) -> Self {
        Self {
            xx: 0.0,
            yy: 0.0,
            xy: 0.5 * direction,
            angular_velocity: -0.5 * direction,
        }
    }

    /// Fluid at rest.
    pub const QUIESCENT: Self = Self {
        xx: 0.0,
        yy: 0.0,
        xy: 0.0,
        angular_velocity: 0.0,
    };

    /// Velocity at a point.
    ///
    /// ```
    /// use sd_core::modes::{Background, Vec2};
    ///
    /// assert_eq!(Background::SHEAR.velocity(Vec2::new(3.0, 2.0)), Vec2::new(2.0, 0.0));
    /// ```
    pub fn velocity(&self, x: Vec2) -> Vec2 {
        Vec2::new(
            self.xx * x.x + (self.xy - self.angular_velocity) * x.y,
            (self.xy + self.angular_velocity) * x.x + self.yy * x.y,
        )
    }

    /// Earlier position of a point advected to `x` over `time` at its initial velocity:
    /// `x = (1 + time ∇u∞) x₀`.
    pub fn advect_backward(&self, x: Vec2, time: f64) -> Vec2 {
        let (a, b) = (
            1.0 + time * self.xx,
            time * (self.xy - self.angular_velocity),
        );
        let (c, d) = (
            time * (self.xy + self.angular_velocity),
            1.0 + time * self.yy,
        );
        Vec2::new(d * x.x - b * x.y, a * x.y - c * x.x) / (a * d - b * c)
    }

    /// Strain components `(e1, e2, e3)`.
    pub fn strain(&self) -> Vector3<f64> {
        strain_modes(self.xx, self.yy, self.xy)
    }
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

    #[test]
    fn what_the_flow_carried_away_is_carried_back() {
        let flow = Background {
            xx: 0.3,
            yy: -0.4,
            xy: 0.2,
            angular_velocity: -0.6,
        };
        let before = Vec2::new(1.3, -0.7);
        let after = before + flow.velocity(before) * 0.1;
        assert!((flow.advect_backward(after, 0.1) - before).norm() < 1e-15);
    }

    #[test]
    fn shear_is_y_along_x() {
        assert_eq!(
            Background::SHEAR.velocity(Vec2::new(3.0, 2.0)),
            Vec2::new(2.0, 0.0)
        );
    }
}
