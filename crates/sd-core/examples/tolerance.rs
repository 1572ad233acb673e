//! What the tolerance of an iterated far field does to viscosity, normal stress difference and
//! contact forces: the table of `docs/constants.md`.
//!
//! ```text
//! cargo run --release -p sd-core --example tolerance
//! ```
#![expect(clippy::print_stdout, reason = "examples print their results")]

use sd_core::model::SolverSettings;
use std::collections::{BTreeMap, BTreeSet};

use sd_core::{
    Bulk, ContactLaws, ContactScheme, Error, Hydrodynamics, Layer, NearFields, Params, RunSpace,
    Simulation, Snapshot, TangentialLaw,
};

/// Relative residuals of the far field that are compared.
const TOLERANCES: [f64; 6] = [1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6];
/// That of the reference, which tests compare with dense matrices.
const EXACT: f64 = 1e-7;
/// Steps without a far field before, of a strain of 0.01 each.
const LEAD_IN: usize = 60;
/// Steps that are compared.
const STEPS: usize = 4;

fn contact(words: &str) -> ContactScheme {
    let rigid = |tangential| ContactLaws {
        tangential,
        ..ContactLaws::PAPER
    };
    ContactScheme::Laws(match words {
        "coulomb" => rigid(TangentialLaw::Coulomb),
        "springs" => ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01),
        _ => rigid(TangentialLaw::RollSlip),
    })
}

/// Parameters of a layer, or of a suspension, without a far field.
fn params(spheres: usize, fraction: f64, law: &str, is_layer: bool) -> Result<Params, Error> {
    let mut params = Params::builder()
        .spheres(spheres)
        .area_fraction(if is_layer { fraction } else { 0.5 })
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(1.0)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(contact(law))
        .time_step(0.01)
        .two_sizes(1.4, 0.5)
        .build()?;
    if !is_layer {
        params.area_fraction = 0.0;
        params.volume_fraction = Some(fraction);
    }
    params.canonicalise();
    Ok(params)
}

/// What is compared of each step: viscosity and N1, and the forces of each contact by its spheres.
struct Step {
    stresses: [f64; 2],
    forces: BTreeMap<(usize, usize), f64>,
}

/// Some steps at a tolerance.
fn steps<S: RunSpace>(
    params: &Params,
    start: &Snapshot<S>,
    tolerance: f64,
    tables: &NearFields,
) -> Result<Vec<Step>, Error> {
    let mut settings = SolverSettings::default();
    settings.far_field_residual = tolerance;
    let mut run = Simulation::with_settings(params, start.clone(), tables, &settings)?;
    let step = |_| {
        let (sample, frame) = run.step_with_frame()?;
        Ok(Step {
            stresses: [sample.viscosity, sample.normal_stress_difference],
            forces: frame
                .contacts
                .iter()
                .map(|c| ((c.i, c.j), c.normal_force))
                .collect(),
        })
    };
    (0..STEPS).map(step).collect()
}

/// Largest errors of viscosity, of N1 over the viscosity, and root mean square of those of contact
/// forces over that of the forces.
fn errors(exact: &[Step], found: &[Step]) -> [f64; 3] {
    let mut largest = [0.0_f64; 3];
    for (exact, found) in exact.iter().zip(found) {
        let viscosity = exact.stresses[0];
        let stresses = exact.stresses.iter().zip(&found.stresses);
        let [of_viscosity, of_n1] = stresses
            .map(|(exact, found)| (found - exact).abs() / viscosity)
            .collect::<Vec<_>>()[..]
        else {
            continue;
        };
        let pairs = exact.forces.keys().chain(found.forces.keys());
        let (mut squares, mut differences) = (0.0, 0.0);
        for pair in pairs.collect::<BTreeSet<_>>() {
            let [of, is] = [exact, found].map(|step| step.forces.get(pair).copied().unwrap_or(0.0));
            squares += of * of;
            differences += (of - is).powi(2);
        }
        let of_forces = if squares > 0.0 {
            (differences / squares).sqrt()
        } else {
            0.0
        };
        for (largest, error) in largest.iter_mut().zip([of_viscosity, of_n1, of_forces]) {
            *largest = largest.max(error);
        }
    }
    largest
}

/// Prints the errors of a case at each tolerance.
fn run<S: RunSpace>(name: &str, near: &Params, tables: &NearFields) -> Result<(), Error> {
    let mut before = Simulation::<S>::new(near, 1, tables)?;
    for _ in 0..LEAD_IN {
        before.step()?;
    }
    let full = Params {
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        ..near.clone()
    };
    let mut settings = SolverSettings::default();
    settings.far_field_residual = EXACT;
    let mut run = Simulation::with_settings(&full, before.snapshot(), tables, &settings)?;
    run.step()?;
    let start = run.snapshot();
    let exact = steps(&full, &start, EXACT, tables)?;
    let mut cells = Vec::new();
    for tolerance in TOLERANCES {
        let found = steps(&full, &start, tolerance, tables)?;
        let [viscosity, n1, forces] = errors(&exact, &found);
        cells.push(format!("{viscosity:.0e}, {n1:.0e}, {forces:.0e}"));
    }
    println!("| {name} | {} |", cells.join(" | "));
    Ok(())
}

fn main() -> Result<(), Error> {
    let tables = NearFields::default();
    println!(
        "| case |{}",
        TOLERANCES.map(|t| format!(" {t:.0e} |")).concat()
    );
    println!("| --- |{}", " ---: |".repeat(TOLERANCES.len()));
    for law in ["roll-slip", "coulomb", "springs"] {
        for (kind, spheres, fractions, is_layer) in [
            ("layer, c", 150, [0.5, 0.7], true),
            ("suspension, φ", 100, [0.3, 0.45], false),
        ] {
            for fraction in fractions {
                let name = format!("{law}, {kind} = {fraction}");
                let near = params(spheres, fraction, law, is_layer)?;
                if is_layer {
                    run::<Layer>(&name, &near, &tables)?;
                } else {
                    run::<Bulk>(&name, &near, &tables)?;
                }
            }
        }
    }
    Ok(())
}
