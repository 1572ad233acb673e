//! One instant of one suspension or cluster in three dimensions: velocities, stresslets, viscosity.
//!
//! A tensor is held as its components in the orthonormal basis
//!
//! ```text
//! e1 = (E_xx − E_yy)/√2   e2 = √2 E_xy   e3 = √(3/2)(E_xx + E_yy)   e4 = √2 E_xz   e5 = √2 E_yz
//! ```
//! whose first three are those of the layer. Equations: see `hydrodynamics::bulk`; stress:
//!
//! ```text
//! η = 1 + Σ S_xy/V → 1 + 5φ/2 for a dilute suspension,   V (η − 1) = v'Rv in shear without forces
//! ```

use super::instant::{check_lists, check_numbers};
use crate::error::Error;
use crate::hydrodynamics::bulk::{NearPart, Resistance, SparseResistance, Strain};
use crate::hydrodynamics::resistance::NearFields;
use crate::model::Hydrodynamics;
use crate::space::Bulk;
use crate::space::cell::Cell;
use nalgebra::Vector3;
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

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
    fn components(&self) -> Strain {
        Strain::from([
            FRAC_1_SQRT_2 * (self.xx - self.yy),
            SQRT_2 * self.xy,
            1.5_f64.sqrt() * (self.xx + self.yy),
            SQRT_2 * self.xz,
            SQRT_2 * self.yz,
        ])
    }

    /// The tensor of components.
    fn of_components(e: &Strain) -> Self {
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

/// The imposed linear flow `u∞(x) = E∞·x + Ω∞ × x`, in shear rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Background {
    /// Rate of strain.
    pub rate_of_strain: TracelessTensor,
    /// Angular velocity.
    pub angular_velocity: Vector3<f64>,
}

impl Background {
    /// Simple shear at unit rate: `u∞ = y x̂`.
    pub const SHEAR: Self = Self {
        rate_of_strain: TracelessTensor {
            xx: 0.0,
            yy: 0.0,
            xy: 0.5,
            xz: 0.0,
            yz: 0.0,
        },
        angular_velocity: Vector3::new(0.0, 0.0, -0.5),
    };

    /// Velocity at a point.
    pub fn velocity(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let TracelessTensor { xx, yy, xy, xz, yz } = self.rate_of_strain;
        Vector3::new(
            xx * x.x + xy * x.y + xz * x.z,
            xy * x.x + yy * x.y + yz * x.z,
            xz * x.x + yz * x.y - (xx + yy) * x.z,
        ) + self.angular_velocity.cross(x)
    }
}

/// Spheres, where they are and what drives them.
#[derive(Debug, Clone)]
pub struct Configuration {
    /// Centres, in a.
    pub centres: Vec<Vector3<f64>>,
    /// Radii, in a; one per centre.
    pub radii: Vec<f64>,
    /// Periodic cell or unbounded fluid.
    pub cell: Cell<Bulk>,
    /// Hydrodynamics.
    pub hydrodynamics: Hydrodynamics,
    /// Imposed flow.
    pub background: Background,
    /// External forces, in mu·a²·rate; one per centre. In a cell they move the spheres against a fluid whose mean flow with them is
    /// zero.
    pub forces: Vec<Vector3<f64>>,
    /// External torques, in mu·a³·rate; one per centre.
    pub torques: Vec<Vector3<f64>>,
}

/// Motion and stresslets of a configuration without contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct SolvedConfiguration {
    /// `U − u∞` of each sphere, background at its own centre, in a·rate.
    pub velocities: Vec<Vector3<f64>>,
    /// `Ω − Ω∞`, in rates.
    pub angular_velocities: Vec<Vector3<f64>>,
    /// Stresslets S, in mu·a³·rate.
    pub stresslets: Vec<TracelessTensor>,
    /// `1 + Σ S_xy/V`, in mu; `None` in unbounded fluid.
    pub viscosity: Option<f64>,
    /// `v'Rv/V`, v = (U − u∞, Ω − Ω∞, −E∞), in mu·rate²; `None` in unbounded fluid.
    pub dissipation: Option<f64>,
}

/// Spheres from which on the resistance is held pair by pair.
const LEAST_SPARSE: usize = 100;

/// Whether the resistance is held pair by pair, with the far field iterated on top: many spheres, in a cell or without a far field.
fn is_sparse(configuration: &Configuration) -> bool {
    let has_far_field = configuration.hydrodynamics == Hydrodynamics::StokesianDynamics;
    configuration.centres.len() >= LEAST_SPARSE
        && (configuration.cell != Cell::Unbounded || !has_far_field)
}

/// Solves one instant.
///
/// # Errors
/// Lists of other lengths, numbers that are not finite, radii that are not positive, overlaps, a cell too small, an indefinite matrix.
pub fn solve(
    configuration: &Configuration,
    tables: &NearFields,
) -> Result<SolvedConfiguration, Error> {
    check(configuration)?;
    let Configuration {
        centres,
        radii,
        cell,
        hydrodynamics,
        background,
        forces,
        torques,
    } = configuration;
    let strain = background.rate_of_strain.components();
    let external: Vec<f64> = forces
        .iter()
        .zip(torques)
        .flat_map(|(f, t)| [f.x, f.y, f.z, t.x, t.y, t.z])
        .collect();
    let is_full = *hydrodynamics == Hydrodynamics::StokesianDynamics;
    let near = NearPart::new(*hydrodynamics, cell, radii, tables)?;
    let (velocities, counterforces, stresslets) = if is_sparse(configuration) {
        let mut resistance = SparseResistance::new(near, cell, is_full)?;
        let motion = resistance.solve(cell, centres, &external, &strain)?;
        (motion.velocities, motion.forces, motion.stresslets)
    } else {
        let mut resistance = Resistance::new(near, cell, is_full)?;
        resistance.update(cell, centres)?;
        let (driving, _) = resistance.apply(&vec![0.0; external.len()], &strain);
        let mut velocities: Vec<f64> = external
            .iter()
            .zip(driving)
            .map(|(external, driving)| external - driving)
            .collect();
        resistance.solve(&mut velocities);
        let (counterforces, stresslets) = resistance.apply(&velocities, &strain);
        (velocities, counterforces, stresslets)
    };
    let power = crate::linalg::dense::dot(&velocities, &counterforces)
        + stresslets.iter().map(|s| s.dot(&strain)).sum::<f64>();
    let stresslets: Vec<_> = stresslets
        .iter()
        .map(TracelessTensor::of_components)
        .collect();
    let part = |first: usize| {
        velocities
            .chunks_exact(6)
            .map(|v| Vector3::new(v[first], v[first + 1], v[first + 2]))
            .collect()
    };
    let volume = cell.content();
    Ok(SolvedConfiguration {
        velocities: part(0),
        angular_velocities: part(3),
        viscosity: volume.map(|v| 1.0 + stresslets.iter().map(|s| s.xy).sum::<f64>() / v),
        dissipation: volume.map(|v| power / v),
        stresslets,
    })
}

/// Refuses a configuration with a list of another length or a value out of range.
fn check(configuration: &Configuration) -> Result<(), Error> {
    let vectors = |list: &[Vector3<f64>]| {
        list.iter()
            .flat_map(|x| x.iter().copied())
            .collect::<Vec<_>>()
    };
    let background = &configuration.background;
    let strain = background.rate_of_strain.components();
    let flow = strain.iter().chain(&background.angular_velocity);
    check_lists(
        configuration.centres.len(),
        [
            ("radii", configuration.radii.len()),
            ("forces", configuration.forces.len()),
            ("torques", configuration.torques.len()),
        ],
    )?;
    check_numbers(
        configuration.hydrodynamics,
        [
            ("centres", vectors(&configuration.centres)),
            ("forces", vectors(&configuration.forces)),
            ("torques", vectors(&configuration.torques)),
            ("background", flow.copied().collect()),
        ],
        &configuration.radii,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sheared cell of spheres on a disordered lattice, at φ = 0.35.
    fn suspension(hydrodynamics: Hydrodynamics) -> Configuration {
        let side = 2.29;
        let centres: Vec<_> = (0..64)
            .map(|k| {
                let place = Vector3::new(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16));
                let k = f64::from(k);
                place * side
                    + Vector3::new((1.7 * k).sin(), (2.9 * k).cos(), (0.9 * k).sin()) * 0.07
            })
            .collect();
        let n = centres.len();
        Configuration {
            radii: vec![1.0; n],
            cell: Cell::periodic(Vector3::repeat(4.0 * side), side).unwrap(),
            hydrodynamics,
            background: Background::SHEAR,
            forces: (0..n)
                .map(|k| Vector3::new((0.7 * k as f64).sin(), 0.3, -0.1))
                .collect(),
            torques: (0..n)
                .map(|k| Vector3::new(0.1, (1.1 * k as f64).cos(), 0.2))
                .collect(),
            centres,
        }
    }

    #[test]
    fn motion_pair_by_pair_is_that_of_full_matrices() {
        for (hydrodynamics, tolerance) in [
            (Hydrodynamics::StokesianDynamics, 1e-5),
            (Hydrodynamics::BallMelrose, 1e-8),
        ] {
            let full = hydrodynamics == Hydrodynamics::StokesianDynamics;
            let c = suspension(hydrodynamics);
            let dense = solve(&c, &NearFields::default()).unwrap();
            let near = || NearPart::new(hydrodynamics, &c.cell, &c.radii, &NearFields::default());
            let mut sparse = SparseResistance::new(near().unwrap(), &c.cell, full).unwrap();
            let external: Vec<f64> = c
                .forces
                .iter()
                .zip(&c.torques)
                .flat_map(|(f, t)| [f.x, f.y, f.z, t.x, t.y, t.z])
                .collect();
            let strain = c.background.rate_of_strain.components();
            let motion = sparse
                .solve(&c.cell, &c.centres, &external, &strain)
                .unwrap();
            for (i, v) in motion.velocities.chunks_exact(6).enumerate() {
                let error = (Vector3::new(v[0], v[1], v[2]) - dense.velocities[i])
                    .amax()
                    .max((Vector3::new(v[3], v[4], v[5]) - dense.angular_velocities[i]).amax());
                assert!(error < tolerance, "{hydrodynamics:?} {i}: {error:e}");
                let stress = motion.stresslets[i] - dense.stresslets[i].components();
                let error = stress.amax() / 20.0;
                assert!(error < tolerance, "{hydrodynamics:?} stress {i}: {error:e}");
            }
            // The forces that resist the motion are those that drive it.
            let left = motion.forces.iter().zip(&external);
            let left = left.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(left < 1e-7, "{hydrodynamics:?}: {left:e}");
        }
    }
}
