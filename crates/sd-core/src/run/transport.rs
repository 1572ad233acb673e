//! Short-time transport of a suspension: what diffusion, sedimentation and the viscosity at high
//! frequency are before any sphere has moved.
//!
//! ```text
//! self_diffusion = ⟨6π a tr M_UF⟩/3       of a sphere whose neighbours bear no force
//! rotation       = ⟨8π a³ tr M_ΩT⟩/3
//! sedimentation  = ⟨U/U₀⟩ under forces in proportion to a³, in the frame without mean flow
//! viscosity      = 1 + Σ S:E/(2 V E:E) of spheres without forces, mean of all strains
//! ```
//! M is the mobility R⁻¹ of [`Resistance`]; brackets are means over the spheres. The traces are
//! estimated from random signs z, as tr M = ⟨z·M z⟩ (Hutchinson 1989), all others are exact.

use super::products::Resistance;
use crate::error::Error;
use crate::space::cell::Cell;
use crate::space::{Bulk, Space as _, VelocityGradient};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Vectors of random signs. They add to the scatter of self-diffusion from start to start, of which
/// they are about a tenth for a hundred spheres.
const PROBES: u32 = 8;

/// Short-time transport of a configuration, each over the value of a sphere alone; the viscosity
/// over that of the fluid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShortTime {
    /// Short-time self-diffusion D_s/D₀.
    pub self_diffusion: f64,
    /// Short-time rotational diffusion D_r/D_r0.
    pub rotation: f64,
    /// Sedimentation velocity U/U₀.
    pub sedimentation: f64,
    /// Viscosity at high frequency η∞/η₀.
    pub viscosity: f64,
}

/// Computes it for the positions of a planned resistance of spheres in a periodic cell.
///
/// Any incident flow of the resistance is replaced, at the end by fluid at rest.
///
/// # Arguments
/// - `radii`: those of the plan.
/// - `seed`: of the random signs (`ChaCha8`).
///
/// # Errors
/// [`Error::OutOfRange`] for unbounded fluid; those of [`Resistance::solve`].
///
/// ```
/// use sd_core::cell::Cell;
/// use sd_core::model::SolverSettings;
/// use sd_core::products::Resistance;
/// use sd_core::transport::short_time;
/// use sd_core::{Bulk, Hydrodynamics, NearFields};
///
/// // One sphere in a cell of side 20: self-diffusion and sedimentation are those of a simple cubic
/// // lattice, 1 − 1.7601 φ^(1/3) + φ − 1.5593 φ² (Hasimoto 1959).
/// let (cell, radii) = (Cell::<Bulk>::equal_sides(20.0, 0.0)?, [1.0]);
/// let mut resistance = Resistance::<Bulk>::new(
///     Hydrodynamics::StokesianDynamics,
///     &cell,
///     &radii,
///     &[[0.0, 0.0, 0.0].into()],
///     &NearFields::default(),
///     &SolverSettings::precise(),
/// )?;
/// let found = short_time(&mut resistance, &cell, &radii, 1)?;
/// assert!((found.self_diffusion - 0.8587).abs() < 1e-3);
/// assert!((found.sedimentation - found.self_diffusion).abs() < 1e-6);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn short_time(
    resistance: &mut Resistance<Bulk>,
    cell: &Cell<Bulk>,
    radii: &[f64],
    seed: u64,
) -> Result<ShortTime, Error> {
    let Some(volume) = cell.content() else {
        return Err(Error::OutOfRange {
            field: "sides of the cell",
            value: f64::INFINITY,
            allowed: "finite: a suspension has a volume fraction",
        });
    };
    let modes = Bulk::MODES;
    let spheres = radii.len() as f64;
    let mut forces = vec![0.0; modes * radii.len()];
    let mut velocities = forces.clone();

    resistance.set_flow(VelocityGradient::at_rest().into())?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut self_diffusion, mut rotation) = (0.0, 0.0);
    for _ in 0..PROBES {
        for (sphere, radius) in forces.chunks_exact_mut(modes).zip(radii) {
            let [translation, turn] = roots(*radius);
            for (k, force) in sphere.iter_mut().enumerate() {
                let sign = if random.random::<bool>() { 1.0 } else { -1.0 };
                *force = sign * if k < 3 { translation } else { turn };
            }
        }
        resistance.solve(&forces, &mut velocities)?;
        for (force, velocity) in forces
            .chunks_exact(3)
            .zip(velocities.chunks_exact(3))
            .step_by(2)
        {
            self_diffusion += dot(force, velocity);
        }
        let turns = forces.chunks_exact(3).zip(velocities.chunks_exact(3));
        for (torque, spin) in turns.skip(1).step_by(2) {
            rotation += dot(torque, spin);
        }
    }
    let traces = 3.0 * spheres * f64::from(PROBES);

    let mut sedimentation = 0.0;
    for along in 0..3 {
        forces.fill(0.0);
        for (sphere, radius) in forces.chunks_exact_mut(modes).zip(radii) {
            sphere[along] = radius.powi(3);
        }
        resistance.solve(&forces, &mut velocities)?;
        for (velocity, radius) in velocities.chunks_exact(modes).zip(radii) {
            sedimentation += 6.0 * PI / radius.powi(2) * velocity[along];
        }
    }

    forces.fill(0.0);
    let mut added = 0.0;
    for flow in strains() {
        let strain = flow.strain();
        resistance.set_flow(flow.into())?;
        resistance.solve(&forces, &mut velocities)?;
        let power: f64 = resistance
            .stresslets()
            .iter()
            .map(|stresslet| Bulk::strain_dot(stresslet, &strain))
            .sum();
        added += power / (2.0 * volume * Bulk::strain_dot(&strain, &strain));
    }
    resistance.set_flow(VelocityGradient::at_rest().into())?;
    Ok(ShortTime {
        self_diffusion: self_diffusion / traces,
        rotation: rotation / traces,
        sedimentation: sedimentation / (3.0 * spheres),
        viscosity: 1.0 + added / strains().len() as f64,
    })
}

/// Square roots of the drag and of the resistance to turning of a sphere alone.
fn roots(radius: f64) -> [f64; 2] {
    [6.0 * PI * radius, 8.0 * PI * radius.powi(3)].map(f64::sqrt)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Five strains, perpendicular to each other: three shears and two extensions.
fn strains() -> [VelocityGradient<Bulk>; 5] {
    let [xy, xz, yz] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let diagonals = [
        [0.0; 3],
        [0.0; 3],
        [0.0; 3],
        [1.0, -1.0, 0.0],
        [1.0, 1.0, -2.0],
    ];
    let others = [xy, xz, yz, [0.0; 3], [0.0; 3]];
    std::array::from_fn(|k| {
        let ([xx, yy, _], [xy, xz, yz]) = (diagonals[k], others[k]);
        VelocityGradient::from_parts(&[xx, yy, xy, xz, yz], &Vector3::zeros())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hydrodynamics::resistance::NearFields;
    use crate::model::{Hydrodynamics, Params, SolverSettings, StartFrom};
    use crate::run::start;

    fn found(volume_fraction: f64, spheres: usize, seed: u64) -> ShortTime {
        let params = Params {
            spheres,
            area_fraction: 0.0,
            volume_fraction: Some(volume_fraction),
            roughness: 1e-4,
            friction: 0.0,
            shear_rate: 0.0,
            hydrodynamics: Hydrodynamics::StokesianDynamics,
            time_step: 0.005,
            start: Some(StartFrom::Equilibrium),
            ..Params::UNSET
        };
        let start = start::suspension(&params, seed).unwrap();
        let cell = Cell::<Bulk>::equal_sides(start.side, 0.0).unwrap();
        let mut resistance = Resistance::new(
            params.hydrodynamics,
            &cell,
            &start.radii,
            &start.centres,
            &NearFields::default(),
            &SolverSettings::precise(),
        )
        .unwrap();
        short_time(&mut resistance, &cell, &start.radii, seed).unwrap()
    }

    /// Fits to hydrodynamic multipoles by Abade et al. and Riest et al. (from memory of their table
    /// in the code of Park and Nägele), and 1 − 0.631φ − 0.726φ² of rotation (Cichocki,
    /// Ekiel-Jeżewska and Wajnryb 1999, from memory).
    #[test]
    fn equilibrium_suspensions_have_the_published_transport() {
        for (phi, [diffusion, rotation, viscosity]) in
            [(0.2, [0.635, 0.845, 1.808]), (0.45, [0.248, 0.0, 5.661])]
        {
            let spheres = 80;
            let found = found(phi, spheres, 1);
            let images = 1.7601 * (phi / spheres as f64).cbrt() / found.viscosity;
            let infinite = found.self_diffusion + images;
            assert!((infinite / diffusion - 1.0).abs() < 0.06, "{infinite}");
            if rotation > 0.0 {
                assert!((found.rotation / rotation - 1.0).abs() < 0.03);
            }
            assert!((found.viscosity / viscosity - 1.0).abs() < 0.05);
            // Neighbours that bear their own weight drag a sphere along; the return flow holds it
            // back.
            assert!(found.sedimentation < infinite);
        }
    }

    #[test]
    fn spheres_of_two_sizes_far_apart_move_as_each_alone() {
        let cell = Cell::<Bulk>::equal_sides(400.0, 0.0).unwrap();
        let radii = [1.5, 0.5];
        let centres = [[0.0, 0.0, 0.0], [200.0, 200.0, 200.0]].map(Vector3::from);
        let mut resistance = Resistance::new(
            Hydrodynamics::StokesianDynamics,
            &cell,
            &radii,
            &centres,
            &NearFields::default(),
            &SolverSettings::precise(),
        )
        .unwrap();
        let found = short_time(&mut resistance, &cell, &radii, 1).unwrap();
        // Images hold a sphere of radius a back by 2.8373 a/L.
        assert!((found.self_diffusion - 1.0 + 2.8373 / 400.0).abs() < 1e-3);
        assert!((found.rotation - 1.0).abs() < 1e-5);
        let volume: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
        let dilute = 2.5 * volume / 400.0_f64.powi(3);
        assert!(((found.viscosity - 1.0) / dilute - 1.0).abs() < 1e-3);
    }

    #[test]
    fn spheres_in_unbounded_fluid_are_no_suspension() {
        let centres = [Vector3::zeros()];
        let mut resistance = Resistance::new(
            Hydrodynamics::StokesianDynamics,
            &Cell::Unbounded,
            &[1.0],
            &centres,
            &NearFields::default(),
            &SolverSettings::precise(),
        )
        .unwrap();
        let refused = short_time(&mut resistance, &Cell::Unbounded, &[1.0], 1).unwrap_err();
        assert!(refused.to_string().contains("volume fraction"), "{refused}");
    }
}
