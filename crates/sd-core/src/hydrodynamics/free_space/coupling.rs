//! Coupling of the modes of two spheres in three dimensions, by fifteen numbers and the direction
//! between them.
//!
//! Eleven modes a sphere, ordered `(U 3, Ω 3, e 5)`, the strain in the orthonormal basis of
//! symmetric traceless tensors
//!
//! ```text
//! e1 = (E_xx − E_yy)/√2   e2 = √2 E_xy   e3 = √(3/2)(E_xx + E_yy)   e4 = √2 E_xz   e5 = √2 E_yz
//! ```
//! A coupling that depends only on the unit vector n decomposes velocities and strains into parts
//! along and across n:
//!
//! ```text
//! E = √(3/2) a (nn − I/3) + (nσ + σn)/√2 + W,   a = √(3/2) n·E·n,   σ = √2 (E·n − n (n·E·n)),   W across n
//! F = ∥ U∥ + ⊥ U⊥ + f n×Ω + (axial a) n + shear σ        T = t n×U + ∥ Ω∥ + ⊥ Ω⊥ + s n×σ
//! a of S = axial U∥ + axial a,   σ of S = shear U⊥ + s n×Ω + shear σ,   W of S = transverse W
//! ```
//! The same form serves resistances and mobilities. Its orders about n are 0, ±1 and ±2: the X, Y
//! and Z functions.

use nalgebra::Vector3;
use std::ops::{Add, Mul, Sub};

/// Modes of a sphere in a suspension.
pub(crate) const MODES: usize = 11;
/// `(U, Ω, e)` of a sphere, or the forces conjugate to them.
pub(crate) type Modes = [f64; MODES];
/// `(U, Ω)` of a sphere, or its force and torque.
pub(crate) type Motion = [f64; 6];

/// √(2/3), √(1/6), √(1/2).
const ROOT_2_3: f64 = 0.816_496_580_927_726;
const ROOT_1_6: f64 = 0.408_248_290_463_863;
const ROOT_1_2: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A number, or several side by side.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Mul<f64, Output = Self>
{
    /// `self · factor + more`, rounded once.
    fn times_plus(self, factor: Self, more: Self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn times_plus(self, factor: Self, more: Self) -> Self {
        self.mul_add(factor, more)
    }
}

/// Four numbers side by side.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(crate) struct Lanes(pub(crate) [f64; 4]);

impl Add for Lanes {
    type Output = Self;

    #[inline(always)]
    fn add(self, Self(other): Self) -> Self {
        let mut lanes = self.0;
        for k in 0..4 {
            lanes[k] += other[k];
        }
        Self(lanes)
    }
}

impl Sub for Lanes {
    type Output = Self;

    #[inline(always)]
    fn sub(self, Self(other): Self) -> Self {
        let mut lanes = self.0;
        for k in 0..4 {
            lanes[k] -= other[k];
        }
        Self(lanes)
    }
}

impl Mul for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(self, Self(other): Self) -> Self {
        let mut lanes = self.0;
        for k in 0..4 {
            lanes[k] *= other[k];
        }
        Self(lanes)
    }
}

impl Mul<f64> for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self * Self([factor; 4])
    }
}

impl Number for Lanes {
    #[inline(always)]
    fn times_plus(self, Self(factor): Self, Self(more): Self) -> Self {
        let mut lanes = more;
        for k in 0..4 {
            lanes[k] = self.0[k].mul_add(factor[k], more[k]);
        }
        Self(lanes)
    }
}

// Adapters of the library are not inlined into code for this processor, hence written out.
/// Two numbers, each in two lanes.
#[inline(always)]
pub(crate) fn both(first: f64, second: f64) -> Lanes {
    Lanes([first, first, second, second])
}

#[inline(always)]
fn both_of(there: [f64; 2], back: [f64; 2]) -> [Lanes; 2] {
    [both(there[0], back[0]), both(there[1], back[1])]
}

/// A vector times a number.
#[inline(always)]
fn scaled<T: Number>(x: &[T; 3], by: T) -> [T; 3] {
    [x[0] * by, x[1] * by, x[2] * by]
}

#[inline(always)]
fn sum<T: Number>(x: [T; 3], y: [T; 3]) -> [T; 3] {
    [x[0] + y[0], x[1] + y[1], x[2] + y[2]]
}

#[inline(always)]
fn difference<T: Number>(x: [T; 3], y: [T; 3]) -> [T; 3] {
    [x[0] - y[0], x[1] - y[1], x[2] - y[2]]
}

#[inline(always)]
fn dot<T: Number>(x: &[T; 3], y: &[T; 3]) -> T {
    x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
}

#[inline(always)]
fn cross<T: Number>(x: &[T; 3], y: &[T; 3]) -> [T; 3] {
    [
        x[1] * y[2] - x[2] * y[1],
        x[2] * y[0] - x[0] * y[2],
        x[0] * y[1] - x[1] * y[0],
    ]
}

/// The modes of one sphere from those of another, see the module.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Coupling<T = f64> {
    /// Force from velocity, along and across n.
    pub(crate) force_velocity: [T; 2],
    /// Force from n × Ω.
    pub(crate) force_rotation: T,
    /// Force from a and σ.
    pub(crate) force_strain: [T; 2],
    /// Torque from n × U.
    pub(crate) torque_velocity: T,
    /// Torque from angular velocity, along and across n.
    pub(crate) torque_rotation: [T; 2],
    /// Torque from n × σ.
    pub(crate) torque_strain: T,
    /// a and σ from velocity along and across n.
    pub(crate) stress_velocity: [T; 2],
    /// σ from n × Ω.
    pub(crate) stress_rotation: T,
    /// a from a, σ from σ, W from W.
    pub(crate) stress_strain: [T; 3],
}

/// `E·n` of a strain in components.
#[inline(always)]
fn strain_on<T: Number>(e: &[T], n: &[T; 3]) -> [T; 3] {
    let (sum, difference) = (e[2] * ROOT_1_6, e[0] * ROOT_1_2);
    let (xy, xz, yz) = (e[1] * ROOT_1_2, e[3] * ROOT_1_2, e[4] * ROOT_1_2);
    let &[x, y, z] = n;
    [
        (sum + difference) * x + xy * y + xz * z,
        xy * x + (sum - difference) * y + yz * z,
        xz * x + yz * y - sum * 2.0 * z,
    ]
}

/// Components of `√(3/2) a (nn − I/3) + (nσ + σn)/√2`.
#[inline(always)]
fn strain_from<T: Number>(n: &[T; 3], a: T, sigma: &[T; 3]) -> [T; 5] {
    // n w + w n less its trace, with w = √(3/8) a n + σ/√2.
    let along = a * (1.5 * ROOT_1_6);
    let root = [
        sigma[0] * ROOT_1_2,
        sigma[1] * ROOT_1_2,
        sigma[2] * ROOT_1_2,
    ];
    let w = sum(scaled(n, along), root);
    let trace = dot(n, &w) * (2.0 / 3.0);
    let (xx, yy) = (n[0] * 2.0 * w[0] - trace, n[1] * 2.0 * w[1] - trace);
    [
        (xx - yy) * ROOT_1_2,
        (n[0] * w[1] + n[1] * w[0]) * (2.0 * ROOT_1_2),
        (xx + yy) * (1.5 * ROOT_2_3),
        (n[0] * w[2] + n[2] * w[0]) * (2.0 * ROOT_1_2),
        (n[1] * w[2] + n[2] * w[1]) * (2.0 * ROOT_1_2),
    ]
}

impl<T: Number> Coupling<T> {
    /// Adds the product with the modes `x` of one sphere to the modes of the other.
    #[inline(always)]
    pub(crate) fn add_product(&self, n: &[T; 3], x: &[T; MODES], to: &mut [T; MODES]) {
        let (u, w) = ([x[0], x[1], x[2]], [x[3], x[4], x[5]]);
        let (along, turning) = (dot(n, &u), dot(n, &w));
        let on = strain_on(&x[6..], n);
        let stretch = dot(n, &on);
        let a = stretch * (1.5 * ROOT_2_3);
        let [s, t, v] = difference(on, scaled(n, stretch));
        let root = 2.0 * ROOT_1_2;
        let sigma = [s * root, t * root, v * root];
        let across = difference(u, scaled(n, along));
        let turn = cross(n, &w);
        let force = sum(
            sum(
                sum(
                    scaled(&across, self.force_velocity[1]),
                    scaled(&turn, self.force_rotation),
                ),
                scaled(&sigma, self.force_strain[1]),
            ),
            scaled(n, self.force_velocity[0] * along + self.force_strain[0] * a),
        );
        let pushed = sum(
            scaled(&u, self.torque_velocity),
            scaled(&sigma, self.torque_strain),
        );
        let twisted = (self.torque_rotation[0] - self.torque_rotation[1]) * turning;
        let torque = sum(
            sum(cross(n, &pushed), scaled(&w, self.torque_rotation[1])),
            scaled(n, twisted),
        );
        let whole = self.stress_strain[2];
        let axial = self.stress_velocity[0] * along + (self.stress_strain[0] - whole) * a;
        let shear = sum(
            sum(
                scaled(&across, self.stress_velocity[1]),
                scaled(&turn, self.stress_rotation),
            ),
            scaled(&sigma, self.stress_strain[1] - whole),
        );
        let stress = strain_from(n, axial, &shear);
        for k in 0..3 {
            to[k] = to[k] + force[k];
            to[3 + k] = to[3 + k] + torque[k];
        }
        for k in 0..5 {
            to[6 + k] = whole.times_plus(x[6 + k], to[6 + k] + stress[k]);
        }
    }
}

impl Coupling {
    /// As [`Coupling::add_product`].
    #[inline(always)]
    pub(crate) fn add(&self, n: &Vector3<f64>, x: &Modes, to: &mut Modes) {
        self.add_product(&[n.x, n.y, n.z], x, to);
    }

    /// One coupling in the first two lanes, and another one in the others.
    #[inline(always)]
    pub(crate) fn side_by_side(a: &Self, b: &Self) -> Coupling<Lanes> {
        let [axial, shear, across] = a.stress_strain;
        Coupling {
            force_velocity: both_of(a.force_velocity, b.force_velocity),
            force_rotation: both(a.force_rotation, b.force_rotation),
            force_strain: both_of(a.force_strain, b.force_strain),
            torque_velocity: both(a.torque_velocity, b.torque_velocity),
            torque_rotation: both_of(a.torque_rotation, b.torque_rotation),
            torque_strain: both(a.torque_strain, b.torque_strain),
            stress_velocity: both_of(a.stress_velocity, b.stress_velocity),
            stress_rotation: both(a.stress_rotation, b.stress_rotation),
            stress_strain: [
                both(axial, b.stress_strain[0]),
                both(shear, b.stress_strain[1]),
                both(across, b.stress_strain[2]),
            ],
        }
    }

    /// All numbers, mutable.
    fn numbers_mut(&mut self) -> [&mut [f64]; 9] {
        [
            &mut self.force_velocity,
            std::slice::from_mut(&mut self.force_rotation),
            &mut self.force_strain,
            std::slice::from_mut(&mut self.torque_velocity),
            &mut self.torque_rotation,
            std::slice::from_mut(&mut self.torque_strain),
            &mut self.stress_velocity,
            std::slice::from_mut(&mut self.stress_rotation),
            &mut self.stress_strain,
        ]
    }

    /// All numbers times a factor.
    pub(crate) fn scaled(mut self, factor: f64) -> Self {
        for number in self.numbers_mut().into_iter().flatten() {
            *number *= factor;
        }
        self
    }

    /// Adds the numbers of another coupling in the same direction.
    pub(crate) fn accumulate(&mut self, other: &Self) {
        let mut other = *other;
        let pairs = self.numbers_mut().into_iter().zip(other.numbers_mut());
        for (number, other) in pairs.flat_map(|(own, other)| own.iter_mut().zip(other)) {
            *number += *other;
        }
    }

    /// The coupling of the two spheres exchanged, in a symmetric matrix.
    #[inline(always)]
    pub(crate) fn transposed(&self) -> Self {
        Self {
            force_velocity: self.force_velocity,
            force_rotation: -self.torque_velocity,
            force_strain: self.stress_velocity,
            torque_velocity: -self.force_rotation,
            torque_rotation: self.torque_rotation,
            torque_strain: -self.stress_rotation,
            stress_velocity: self.force_strain,
            stress_rotation: -self.torque_strain,
            stress_strain: self.stress_strain,
        }
    }

    /// The matrix, by columns.
    pub(crate) fn matrix(&self, n: &Vector3<f64>) -> [Modes; MODES] {
        std::array::from_fn(|column| {
            let (mut from, mut to) = ([0.0; MODES], [0.0; MODES]);
            from[column] = 1.0;
            self.add(n, &from, &mut to);
            to
        })
    }

    /// Forces and torques from velocities alone, by columns.
    #[inline(always)]
    pub(crate) fn force_matrix(&self, n: &Vector3<f64>) -> [Motion; 6] {
        let n = [n.x, n.y, n.z];
        // n × each axis.
        let turned = [[0.0, n[2], -n[1]], [-n[2], 0.0, n[0]], [n[1], -n[0], 0.0]];
        let [force, torque] = [self.force_velocity, self.torque_rotation];
        let mut columns = [[0.0; 6]; 6];
        for k in 0..3 {
            let pushed = (force[0] - force[1]) * n[k];
            let twisted = (torque[0] - torque[1]) * n[k];
            for row in 0..3 {
                columns[k][row] = n[row] * pushed;
                columns[k][3 + row] = turned[k][row] * self.torque_velocity;
                columns[3 + k][row] = turned[k][row] * self.force_rotation;
                columns[3 + k][3 + row] = n[row] * twisted;
            }
            columns[k][k] += force[1];
            columns[3 + k][3 + k] += torque[1];
        }
        columns
    }

    /// The coupling of isolated spheres: force, torque and stresslet.
    pub(crate) fn isotropic(velocity: f64, rotation: f64, strain: f64) -> Self {
        Self {
            force_velocity: [velocity; 2],
            torque_rotation: [rotation; 2],
            stress_strain: [strain; 3],
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A coupling with unrelated numbers.
    fn coupling() -> Coupling {
        let mut coupling = Coupling::default();
        for (k, number) in coupling.numbers_mut().into_iter().flatten().enumerate() {
            *number = (1.7 * k as f64).sin();
        }
        coupling
    }

    #[test]
    fn forces_from_velocities_are_those_of_all_modes() {
        let n = Vector3::new(0.36, -0.48, 0.8);
        let block = coupling();
        let (whole, forces) = (block.matrix(&n), block.force_matrix(&n));
        for (row, column) in (0..6).flat_map(|r| (0..6).map(move |c| (r, c))) {
            assert!((whole[column][row] - forces[column][row]).abs() < 1e-15);
        }
    }

    #[test]
    fn the_transposed_coupling_is_the_transposed_matrix() {
        let n = Vector3::new(0.36, -0.48, 0.8);
        let block = coupling();
        let (there, back) = (block.matrix(&n), block.transposed().matrix(&n));
        for row in 0..MODES {
            for column in 0..MODES {
                assert!((there[column][row] - back[row][column]).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn a_strain_is_put_together_from_its_parts() {
        let n = Vector3::new(0.36, -0.48, 0.8);
        let identity = Coupling::isotropic(1.0, 1.0, 1.0).matrix(&n);
        for (row, column) in (0..MODES).flat_map(|r| (0..MODES).map(move |c| (r, c))) {
            let expected = f64::from(u8::from(row == column));
            assert!((identity[column][row] - expected).abs() < 1e-15);
        }
        // Stretch along n alone is a.
        let n = [n.x, n.y, n.z];
        let e = strain_from(&n, 1.0, &[0.0; 3]);
        let on = difference(strain_on(&e, &n), scaled(&n, ROOT_2_3));
        assert!(dot(&on, &on).sqrt() < 1e-15);
        assert!((e.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-15);
    }
}
