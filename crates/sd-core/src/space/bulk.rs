//! Suspensions: spheres in a volume.
//!
//! A tensor is held as its components in the orthonormal basis
//!
//! ```text
//! e1 = (E_xx − E_yy)/√2   e2 = √2 E_xy   e3 = √(3/2)(E_xx + E_yy)   e4 = √2 E_xz   e5 = √2 E_yz
//! ```
//! whose first three are those of the layer.

use super::Space;
use nalgebra::{Matrix3, SVector, Vector3};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Suspensions: spheres in a volume.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Bulk;

/// Five components of a strain or a stresslet.
pub(crate) type Strain = SVector<f64, 5>;

/// A symmetric traceless tensor: `E_zz = −E_xx − E_yy`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TracelessTensor {
    /// xx.
    pub xx: f64,
    /// yy.
    pub yy: f64,
    /// xy.
    pub xy: f64,
    /// xz.
    pub xz: f64,
    /// yz.
    pub yz: f64,
}

impl TracelessTensor {
    /// Its components `(e1, …, e5)`.
    pub(crate) fn components(&self) -> Strain {
        Strain::from([
            FRAC_1_SQRT_2 * (self.xx - self.yy),
            SQRT_2 * self.xy,
            1.5_f64.sqrt() * (self.xx + self.yy),
            SQRT_2 * self.xz,
            SQRT_2 * self.yz,
        ])
    }

    /// xx, yy, zz, xy, xz, yz.
    fn full(&self) -> [f64; 6] {
        let Self { xx, yy, xy, xz, yz } = *self;
        [xx, yy, -(xx + yy), xy, xz, yz]
    }

    /// The tensor of components.
    pub(crate) fn of_components(e: &Strain) -> Self {
        let (difference, sum) = (SQRT_2 * e[0], e[2] / 1.5_f64.sqrt());
        Self {
            xx: 0.5 * (sum + difference),
            yy: 0.5 * (sum - difference),
            xy: FRAC_1_SQRT_2 * e[1],
            xz: FRAC_1_SQRT_2 * e[3],
            yz: FRAC_1_SQRT_2 * e[4],
        }
    }
}

/// A vector in the volume of a suspension.
pub type Vec3 = Vector3<f64>;

/// A unit quaternion `[w, x, y, z]`: an orientation.
pub type Quaternion = [f64; 4];

impl Space for Bulk {
    const DIMENSIONS: usize = 3;
    const MODES: usize = 6;
    const STRAINS: usize = 5;
    const TANGENTS: usize = 2;
    /// Equal spheres on a face-centred lattice have 42 before the next shell.
    const RESERVED_NEIGHBOURS: usize = 54;
    const UPRIGHT: Quaternion = [1.0, 0.0, 0.0, 0.0];
    type Vector = Vector3<f64>;
    type Point = [f64; 3];
    type Image = [i32; 3];
    type Spin = Vector3<f64>;
    /// A vector of the frame of the flow.
    type Tangent = Vector3<f64>;
    type Orientation = Quaternion;
    type Strain = Strain;
    type Tensor = [f64; 5];
    type PerMode<T: Copy + Send + Sync> = [T; 6];
    type PerAnyMode<T: Copy + Send + Sync> = [T; 11];
    type PerTangent<T: Copy + Send + Sync> = [T; 2];
    type Weights = [f64; 12];
    type Block = [f64; 36];

    #[inline(always)]
    fn dot(a: &Self::Vector, b: &Self::Vector) -> f64 {
        a.dot(b)
    }

    fn point(vector: &Self::Vector) -> [f64; 3] {
        (*vector).into()
    }

    fn vector(point: &[f64; 3]) -> Self::Vector {
        (*point).into()
    }

    #[inline(always)]
    fn weights(i: &[f64; 6], j: &[f64; 6]) -> [f64; 12] {
        let mut weights = [0.0; 12];
        weights[..6].copy_from_slice(i);
        weights[6..].copy_from_slice(j);
        weights
    }

    #[inline(always)]
    fn join(vector: &Self::Vector, spin: &Self::Spin) -> [f64; 6] {
        [vector.x, vector.y, vector.z, spin.x, spin.y, spin.z]
    }

    #[inline(always)]
    fn translation(modes: &[f64; 6]) -> Self::Vector {
        Vector3::new(modes[0], modes[1], modes[2])
    }

    #[inline(always)]
    fn rotation(modes: &[f64; 6]) -> Self::Spin {
        Vector3::new(modes[3], modes[4], modes[5])
    }

    /// The first is in the plane of flow and gradient, unless n is along the vorticity.
    #[inline(always)]
    fn tangents(n: &Self::Vector) -> [Self::Vector; 2] {
        let in_plane = Vector3::new(-n.y, n.x, 0.0);
        let length = in_plane.norm();
        let first = if length > 1e-3 {
            in_plane / length
        } else {
            let other = Vector3::new(n.z, 0.0, -n.x);
            other / other.norm()
        };
        [first, n.cross(&first)]
    }

    #[inline(always)]
    fn axis(normal: &Self::Vector, direction: &Self::Vector) -> Self::Spin {
        normal.cross(direction)
    }

    #[inline(always)]
    fn tangent([d, e]: &[Self::Vector; 2], [along_d, along_e]: &[f64; 2]) -> Self::Tangent {
        d * *along_d + e * *along_e
    }

    #[inline(always)]
    fn along(directions: &[Self::Vector; 2], tangent: &Self::Tangent) -> [f64; 2] {
        directions.map(|direction| direction.dot(tangent))
    }

    #[inline(always)]
    fn spin_dot(axis: &Self::Spin, spin: &Self::Spin) -> f64 {
        axis.dot(spin)
    }

    #[inline(always)]
    fn length(&[d, e]: &[f64; 2]) -> f64 {
        d.hypot(e)
    }

    #[inline(always)]
    fn within(&[d, e]: &[f64; 2], bound: f64) -> [f64; 2] {
        let length = d.hypot(e);
        if length <= bound {
            [d, e]
        } else {
            [d * (bound / length), e * (bound / length)]
        }
    }

    #[inline(always)]
    fn tangent_dot(a: &Self::Tangent, b: &Self::Tangent) -> f64 {
        a.dot(b)
    }

    fn is_finite(tangent: &Self::Tangent) -> bool {
        tangent.iter().all(|x| x.is_finite())
    }

    /// By the smallest rotation that takes n to the new one.
    fn transported(
        tangent: &Self::Tangent,
        from: &Self::Vector,
        to: &Self::Vector,
    ) -> Self::Tangent {
        tangent - (from + to) * (to.dot(tangent) / (1.0 + from.dot(to)))
    }

    fn projected(tangent: &Self::Tangent, normal: &Self::Vector) -> Self::Tangent {
        let across = tangent - normal * normal.dot(tangent);
        let length = across.norm();
        if length > 0.0 {
            across * (tangent.norm() / length)
        } else {
            across
        }
    }

    fn turned(&[w, x, y, z]: &Quaternion, rotation: &Self::Spin) -> Quaternion {
        let (angle, v) = (rotation.norm(), Vector3::new(x, y, z));
        let (sin, cos) = (0.5 * angle).sin_cos();
        // sin(φ/2) times the unit axis, without division by an angle that may be 0.
        let share = if angle > 1e-6 {
            sin / angle
        } else {
            0.5 - angle * angle / 48.0
        };
        let axis = rotation * share;
        let (real, imaginary) = (cos * w - axis.dot(&v), v * cos + axis * w + axis.cross(&v));
        let length = (real * real + imaginary.norm_squared()).sqrt();
        [
            real / length,
            imaginary.x / length,
            imaginary.y / length,
            imaginary.z / length,
        ]
    }

    fn is_orientation(orientation: &Quaternion) -> bool {
        let square: f64 = orientation.iter().map(|q| q * q).sum();
        (square - 1.0).abs() < 1e-9
    }

    fn commutator(second: &Self::Spin, first: &Self::Spin) -> Self::Spin {
        second.cross(first)
    }

    fn gradient(&[xx, yy, xy, xz, yz]: &[f64; 5], spin: &Self::Spin) -> [Self::Vector; 3] {
        [
            Vector3::new(xx, xy - spin.z, xz + spin.y),
            Vector3::new(xy + spin.z, yy, yz - spin.x),
            Vector3::new(xz - spin.y, yz + spin.x, -(xx + yy)),
        ]
    }

    #[inline(always)]
    fn rotation_of([x, y, z]: &[Self::Vector; 3]) -> Self::Spin {
        Vector3::new(z.y - y.z, x.z - z.x, y.x - x.y) * 0.5
    }

    fn strain_of(&[xx, yy, _, xy, xz, yz]: &[f64; 6]) -> Strain {
        TracelessTensor { xx, yy, xy, xz, yz }.components()
    }

    /// By Cramer's rule.
    fn solve_columns([a, b, c]: &[Self::Vector; 3], x: &Self::Vector) -> Self::Vector {
        let volume = a.dot(&b.cross(c));
        Matrix3::from_columns(&[b.cross(c), c.cross(a), a.cross(b)]).transpose() * x / volume
    }

    #[inline(always)]
    fn strain_dot(a: &Strain, b: &Strain) -> f64 {
        a.dot(b)
    }

    #[inline(always)]
    fn tensor(strain: &Strain) -> [f64; 5] {
        let TracelessTensor { xx, yy, xy, xz, yz } = TracelessTensor::of_components(strain);
        [xx, yy, xy, xz, yz]
    }

    fn full_tensor(strain: &Strain) -> [f64; 6] {
        TracelessTensor::of_components(strain).full()
    }

    fn moment_along(n: &Self::Vector, m: f64) -> [f64; 6] {
        [
            m * n.x * n.x,
            m * n.y * n.y,
            m * n.z * n.z,
            m * n.x * n.y,
            m * n.x * n.z,
            m * n.y * n.z,
        ]
    }

    fn moment_across(n: &Self::Vector, t: &Self::Tangent, m: f64) -> [f64; 6] {
        [
            m * t.x * n.x,
            m * t.y * n.y,
            m * t.z * n.z,
            0.5 * m * (t.x * n.y + t.y * n.x),
            0.5 * m * (t.x * n.z + t.z * n.x),
            0.5 * m * (t.y * n.z + t.z * n.y),
        ]
    }

    fn volume(content: f64, _: &[f64]) -> f64 {
        content
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_across_a_line_are_orthonormal() {
        for n in [
            Vector3::new(0.36, -0.48, 0.8),
            Vector3::new(0.0, 0.0, -1.0),
            Vector3::new(1e-4, 0.0, 1.0).normalize(),
            Vector3::x(),
        ] {
            let [d, e] = Bulk::tangents(&n);
            let all = Matrix3::from_columns(&[n, d, e]);
            assert!((all.transpose() * all - Matrix3::identity()).norm() < 1e-12);
            assert!((all.determinant() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn vectors_across_a_line_turn_with_it_and_keep_their_length() {
        let from = Vector3::new(0.36, -0.48, 0.8);
        let to = Vector3::new(0.5, -0.4, 0.7).normalize();
        let vector = Bulk::tangents(&from)[0] * 0.3 - Bulk::tangents(&from)[1] * 1.7;
        for moved in [
            Bulk::transported(&vector, &from, &to),
            Bulk::projected(&vector, &to),
        ] {
            assert!(moved.dot(&to).abs() < 1e-15);
            assert!((moved.norm() - vector.norm()).abs() < 1e-15);
            assert!((moved - vector).norm() < 2.0 * (to - from).norm());
        }
        let back = Bulk::transported(&Bulk::transported(&vector, &from, &to), &to, &from);
        assert!((back - vector).norm() < 1e-15);
    }

    #[test]
    fn quaternions_add_up_rotations_about_one_axis() {
        let axis = Vector3::new(0.36, -0.48, 0.8);
        let mut turned = Bulk::UPRIGHT;
        for _ in 0..100 {
            turned = Bulk::turned(&turned, &(axis * 0.02));
        }
        let (sin, cos) = 1.0_f64.sin_cos();
        let expected = [cos, sin * axis.x, sin * axis.y, sin * axis.z];
        for (found, expected) in turned.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-14);
        }
        // About z, and then about x: the order matters, and the later rotation is in the frame of
        // the flow.
        let quarter = std::f64::consts::FRAC_PI_2;
        let z = Bulk::turned(&Bulk::UPRIGHT, &(Vector3::z() * quarter));
        let both = Bulk::turned(&z, &(Vector3::x() * quarter));
        for (found, expected) in both.into_iter().zip([0.5, 0.5, -0.5, 0.5]) {
            assert!((found - expected).abs() < 1e-15);
        }
    }
}
