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

/// The modes of one sphere from those of another, see the module.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Coupling {
    /// Force from velocity, along and across n.
    pub(crate) force_velocity: [f64; 2],
    /// Force from n × Ω.
    pub(crate) force_rotation: f64,
    /// Force from a and σ.
    pub(crate) force_strain: [f64; 2],
    /// Torque from n × U.
    pub(crate) torque_velocity: f64,
    /// Torque from angular velocity, along and across n.
    pub(crate) torque_rotation: [f64; 2],
    /// Torque from n × σ.
    pub(crate) torque_strain: f64,
    /// a and σ from velocity along and across n.
    pub(crate) stress_velocity: [f64; 2],
    /// σ from n × Ω.
    pub(crate) stress_rotation: f64,
    /// a from a, σ from σ, W from W.
    pub(crate) stress_strain: [f64; 3],
}

/// `E·n` of a strain in components.
#[inline(always)]
fn strain_on(e: &[f64], n: &Vector3<f64>) -> Vector3<f64> {
    let (sum, difference) = (ROOT_1_6 * e[2], ROOT_1_2 * e[0]);
    let (xy, xz, yz) = (ROOT_1_2 * e[1], ROOT_1_2 * e[3], ROOT_1_2 * e[4]);
    Vector3::new(
        (sum + difference) * n.x + xy * n.y + xz * n.z,
        xy * n.x + (sum - difference) * n.y + yz * n.z,
        xz * n.x + yz * n.y - 2.0 * sum * n.z,
    )
}

/// Components of `√(3/2) a (nn − I/3) + (nσ + σn)/√2`.
#[inline(always)]
fn strain_from(n: &Vector3<f64>, a: f64, sigma: &Vector3<f64>) -> [f64; 5] {
    // n w + w n less its trace, with w = √(3/8) a n + σ/√2.
    let w = n * (1.5 * ROOT_1_6 * a) + sigma * ROOT_1_2;
    let trace = 2.0 / 3.0 * n.dot(&w);
    let (xx, yy) = (2.0 * n.x * w.x - trace, 2.0 * n.y * w.y - trace);
    [
        ROOT_1_2 * (xx - yy),
        2.0 * ROOT_1_2 * (n.x * w.y + n.y * w.x),
        1.5 * ROOT_2_3 * (xx + yy),
        2.0 * ROOT_1_2 * (n.x * w.z + n.z * w.x),
        2.0 * ROOT_1_2 * (n.y * w.z + n.z * w.y),
    ]
}

impl Coupling {
    /// Adds the product with the modes `x` of one sphere to the modes of the other.
    #[inline(always)]
    pub(crate) fn add(&self, n: &Vector3<f64>, x: &Modes, to: &mut Modes) {
        let u = Vector3::new(x[0], x[1], x[2]);
        let w = Vector3::new(x[3], x[4], x[5]);
        let (along, turning) = (n.dot(&u), n.dot(&w));
        let on = strain_on(&x[6..], n);
        let stretch = n.dot(&on);
        let a = 1.5 * ROOT_2_3 * stretch;
        let sigma = (on - n * stretch) / ROOT_1_2;
        let across = u - n * along;
        let turn = n.cross(&w);
        let force = across * self.force_velocity[1]
            + turn * self.force_rotation
            + sigma * self.force_strain[1]
            + n * (self.force_velocity[0] * along + self.force_strain[0] * a);
        let torque = n.cross(&(u * self.torque_velocity + sigma * self.torque_strain))
            + w * self.torque_rotation[1]
            + n * ((self.torque_rotation[0] - self.torque_rotation[1]) * turning);
        let whole = self.stress_strain[2];
        let axial = self.stress_velocity[0] * along + (self.stress_strain[0] - whole) * a;
        let shear = across * self.stress_velocity[1]
            + turn * self.stress_rotation
            + sigma * (self.stress_strain[1] - whole);
        let stress = strain_from(n, axial, &shear);
        for k in 0..3 {
            to[k] += force[k];
            to[3 + k] += torque[k];
        }
        for k in 0..5 {
            to[6 + k] = whole.mul_add(x[6 + k], to[6 + k] + stress[k]);
        }
    }

    /// As [`Coupling::add`], for velocities and forces only.
    #[inline(always)]
    pub(crate) fn add_forces(&self, n: &Vector3<f64>, v: &Motion, to: &mut Motion) {
        let u = Vector3::new(v[0], v[1], v[2]);
        let w = Vector3::new(v[3], v[4], v[5]);
        let along = (self.force_velocity[0] - self.force_velocity[1]) * n.dot(&u);
        let turning = (self.torque_rotation[0] - self.torque_rotation[1]) * n.dot(&w);
        let force = u * self.force_velocity[1] + n.cross(&w) * self.force_rotation + n * along;
        let torque = w * self.torque_rotation[1] + n.cross(&u) * self.torque_velocity + n * turning;
        for k in 0..3 {
            to[k] += force[k];
            to[3 + k] += torque[k];
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
    pub(crate) fn force_matrix(&self, n: &Vector3<f64>) -> [Motion; 6] {
        std::array::from_fn(|column| {
            let (mut from, mut to) = ([0.0; 6], [0.0; 6]);
            from[column] = 1.0;
            self.add_forces(n, &from, &mut to);
            to
        })
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
        let e = strain_from(&n, 1.0, &Vector3::zeros());
        let on = strain_on(&e, &n);
        assert!((on - n * ROOT_2_3).norm() < 1e-15);
        assert!((e.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-15);
    }
}
