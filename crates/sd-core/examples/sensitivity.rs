//! Runs that show what numerical constants do: dense layers and suspensions under several laws,
//! with the work, the inexact stages and the viscosity of each.
//!
//! `scripts/sensitivity` builds it with constants that can be changed from outside, runs it for
//! each of them, and writes the table of `docs/constants.md`.
#![expect(clippy::print_stdout, reason = "examples print their results")]

use sd_core::{
    Bulk, ContactLaws, ContactScheme, Error, Hydrodynamics, Layer, NearFields, NormalLaw, Params,
    RunSpace, Simulation, TangentialLaw,
};

/// Steps of a run, of a strain of 0.005 each.
const STEPS: u64 = 60;

/// A name, parameters and the seeds of the runs.
struct Case {
    name: &'static str,
    params: Params,
    seeds: &'static [u64],
}

fn cases() -> Vec<Case> {
    let rigid = |tangential| {
        ContactScheme::Laws(ContactLaws {
            tangential,
            ..ContactLaws::PAPER
        })
    };
    let layer = |spheres, area_fraction, contact| {
        let mut params = Params::builder()
            .spheres(spheres)
            .area_fraction(area_fraction)
            .roughness(0.01)
            .friction(1.0)
            .shear_rate(10.0)
            .hydrodynamics(Hydrodynamics::BallMelrose)
            .contact(contact)
            .time_step(0.005)
            .two_sizes(1.4, 0.5)
            .build()
            .expect("parameters in range");
        params.canonicalise();
        params
    };
    let hertz = ContactLaws {
        normal: NormalLaw::Hertz,
        ..ContactLaws::linear_spring(1e5, TangentialLaw::StickSlide, 0.01)
    };
    let coulomb = rigid(TangentialLaw::Coulomb);
    let suspension = Params {
        area_fraction: 0.0,
        volume_fraction: Some(0.5),
        friction: 0.5,
        ..layer(150, 0.5, coulomb)
    };
    let full = Params {
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        ..layer(125, 0.68, coulomb)
    };
    // Seed 2 of the sparse layer has stages that only the proximal point method solves.
    let cases: [(_, _, &[u64]); 6] = [
        ("dense", layer(50, 0.76, coulomb), &[1, 2]),
        ("sparse", layer(100, 0.76, coulomb), &[2]),
        (
            "roll-slip",
            layer(100, 0.76, rigid(TangentialLaw::RollSlip)),
            &[1, 2],
        ),
        (
            "hertz",
            layer(60, 0.76, ContactScheme::Laws(hertz)),
            &[1, 2],
        ),
        ("suspension", suspension, &[1]),
        ("full", full, &[1]),
    ];
    cases
        .map(|(name, params, seeds)| Case {
            name,
            params,
            seeds,
        })
        .into()
}

/// Prints linear systems, stages, inexact and unconverged ones, and the mean viscosity of the
/// second half of the runs.
fn run<S: RunSpace>(case: &Case, tables: &NearFields) -> Result<(), Error> {
    let (mut systems, mut counts, mut viscosity, mut samples) = (0, [0; 3], 0.0, 0.0);
    for &seed in case.seeds {
        let mut run = Simulation::<S>::new(&case.params, seed, tables)?;
        for step in 0..STEPS {
            let sample = run.step()?;
            if 2 * step >= STEPS {
                viscosity += sample.viscosity;
                samples += 1.0;
            }
        }
        let counters = run.counters();
        systems += run.linear_systems();
        let more = [
            counters.stages,
            counters.inexact_stages,
            counters.unconverged_stages,
        ];
        for (count, more) in counts.iter_mut().zip(more) {
            *count += more;
        }
    }
    let [stages, inexact, unconverged] = counts;
    let mean = viscosity / samples;
    println!(
        "{} {systems} {stages} {inexact} {unconverged} {mean}",
        case.name
    );
    Ok(())
}

/// Runs all cases.
///
/// # Errors
/// Those of a run.
pub(crate) fn main() -> Result<(), Error> {
    let tables = NearFields::default();
    for case in cases() {
        if case.params.volume_fraction.is_some() {
            run::<Bulk>(&case, &tables)?;
        } else {
            run::<Layer>(&case, &tables)?;
        }
    }
    Ok(())
}
