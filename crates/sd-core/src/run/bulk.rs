//! One instant of one suspension or cluster in three dimensions: velocities, stresslets, viscosity.
//!
//! Equations: see `hydrodynamics::resistance`; stress:
//!
//! ```text
//! η = 1 + Σ S_xy/V → 1 + 5φ/2 for a dilute suspension,   V (η − 1) = v'Rv in shear without forces
//! ```

use super::instant::{check_lists, check_numbers};
use crate::error::Error;
use crate::hydrodynamics::iterative::{IterativeFarField, NearSolver};
use crate::hydrodynamics::resistance::{NearFields, Resistance};
use crate::model::Hydrodynamics;
use crate::space::Bulk;
use crate::space::cell::Cell;
use nalgebra::Vector3;

pub use crate::space::bulk::{Background, TracelessTensor};

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
    solve_with(configuration, tables, is_sparse(configuration))
}

/// Solves one instant, with the resistance held pair by pair or full.
fn solve_with(
    configuration: &Configuration,
    tables: &NearFields,
    is_sparse: bool,
) -> Result<SolvedConfiguration, Error> {
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
    let is_full = *hydrodynamics == Hydrodynamics::StokesianDynamics;
    let mut resistance = if is_sparse {
        Resistance::new_pairwise(*hydrodynamics, cell, radii, tables, &[])?
    } else {
        Resistance::new(*hydrodynamics, cell, radii, tables)?
    };
    if hydrodynamics.admits_overlap() {
        resistance.regularise(0.0, f64::INFINITY);
    }
    resistance.update(cell, centres)?;
    let mut driving = vec![0.0; 6 * centres.len()];
    resistance.background_forces(&strain, &mut driving);
    let external = forces.iter().zip(torques);
    for (driving, (f, t)) in driving.chunks_exact_mut(6).zip(external) {
        for k in 0..3 {
            driving[k] += f[k];
            driving[3 + k] += t[k];
        }
    }
    let mut velocities = driving.clone();
    let (mut work, mut counterforces, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
    let mut take = |velocities: &[f64]| {
        resistance.apply(velocities, &strain, &mut work, &mut counterforces, &mut stresslets);
    };
    if is_sparse && is_full {
        let mut far = IterativeFarField::new(cell, radii, IterativeFarField::DEFAULT_RESIDUAL)?;
        far.update(cell, centres)?;
        far.solve(&resistance, &strain, &driving, &mut velocities)?;
        take(&velocities);
        far.correct(&mut counterforces, &mut stresslets);
    } else {
        let mut solver = NearSolver::default();
        solver.start(&resistance)?;
        solver.solve(&resistance, &mut velocities)?;
        take(&velocities);
    }
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
            let c = suspension(hydrodynamics);
            let dense = solve_with(&c, &NearFields::default(), false).unwrap();
            let sparse = solve_with(&c, &NearFields::default(), true).unwrap();
            for i in 0..c.centres.len() {
                let error = (sparse.velocities[i] - dense.velocities[i])
                    .amax()
                    .max((sparse.angular_velocities[i] - dense.angular_velocities[i]).amax());
                assert!(error < tolerance, "{hydrodynamics:?} {i}: {error:e}");
                let [found, expected] =
                    [&sparse, &dense].map(|solved| solved.stresslets[i].components());
                let error = (found - expected).amax() / 20.0;
                assert!(error < tolerance, "{hydrodynamics:?} stress {i}: {error:e}");
            }
        }
    }
}
