//! How far the solution of a stage depends on what should not matter: the forces from which it
//! starts, and the compliance that bounds the forces of rigid networks.
//!
//! Dense layers of rigid spheres are run with the friction laws; at some of their states the stage
//! is solved again from other starting forces. One line is written for each of them: the state, the
//! start, whether the stage converged, viscosity, normal stress difference, and all normal forces.
//! States are read from a file if it exists, else written to it, so that builds with another
//! compliance solve the same stages. `scripts/sensitivity --uniqueness` builds and runs it, and
//! writes the table of `docs/contacts.md`.
#![expect(clippy::print_stdout, reason = "examples print their results")]

use sd_core::{
    ContactLaws, ContactScheme, Error, Hydrodynamics, Layer, NearFields, Params, Simulation,
    Snapshot, TangentialLaw,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Strain before the first state, from one to the next, and number of states of a run.
const STATES: (f64, f64, usize) = (0.3, 0.07, 6);
/// Time step.
const TIME_STEP: f64 = 0.01;

/// A state before a step.
#[derive(Serialize, Deserialize)]
struct State {
    name: String,
    params: Params,
    snapshot: Value,
}

/// Names of starting forces, and factors of normal force and friction of a pair by its number.
type Start = (&'static str, fn(usize) -> [f64; 2]);

/// A number between 0 and 2 for each pair.
fn scattered(k: usize) -> f64 {
    2.0 * (1.0 + 12.9898 * k as f64).sin().abs()
}

const STARTS: [Start; 6] = [
    ("own", |_| [1.0, 1.0]),
    ("tenth", |_| [0.1, 0.1]),
    ("tenfold", |_| [10.0, 10.0]),
    ("no friction", |_| [1.0, 0.0]),
    ("reversed friction", |_| [1.0, -1.0]),
    ("scattered", |k| [scattered(k), scattered(k + 7)]),
];

/// Runs the layers and takes their states.
fn states(tables: &NearFields) -> Result<Vec<State>, Error> {
    let coulomb = ContactLaws {
        tangential: TangentialLaw::Coulomb,
        ..ContactLaws::PAPER
    };
    let springs = ContactLaws {
        tangential: TangentialLaw::StickSlide,
        tangential_stiffness: 1e5,
        ..ContactLaws::PAPER
    };
    let mut all = Vec::new();
    for (law, laws) in [("coulomb", coulomb), ("stick-slide", springs)] {
        for area_fraction in [0.70, 0.74] {
            for seed in 1..=2 {
                let params = Params::builder()
                    .spheres(50)
                    .area_fraction(area_fraction)
                    .roughness(0.01)
                    .friction(1.0)
                    .shear_rate(10.0)
                    .hydrodynamics(Hydrodynamics::BallMelrose)
                    .contact(ContactScheme::Laws(laws))
                    .time_step(TIME_STEP)
                    .build()?;
                let mut run = Simulation::<Layer>::new(&params, seed, tables)?;
                let mut next = STATES.0;
                for _ in 0..STATES.2 {
                    while run.strain() < next - 0.5 * TIME_STEP {
                        run.step()?;
                    }
                    next += STATES.1;
                    all.push(State {
                        name: format!("{law} {area_fraction}"),
                        params: params.clone(),
                        snapshot: serde_json::to_value(run.snapshot()).unwrap_or_default(),
                    });
                }
            }
        }
    }
    Ok(all)
}

/// The snapshot with other starting forces.
fn started(snapshot: &Value, factors: fn(usize) -> [f64; 2]) -> Value {
    let mut changed = snapshot.clone();
    let forces = &mut changed["memory"]["laws"]["warm_start"]["forces"];
    for (k, entry) in forces.as_array_mut().into_iter().flatten().enumerate() {
        for (at, factor) in (2..).zip(factors(k)) {
            let value = entry[at].as_f64().unwrap_or_default();
            entry[at] = Value::from(factor * value);
        }
    }
    changed
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let tables = NearFields::default();
    let file = std::env::args().nth(1).ok_or("a file of states")?;
    let file = Path::new(&file);
    if !file.exists() {
        std::fs::write(file, serde_json::to_string(&states(&tables)?)?)?;
    }
    let all: Vec<State> = serde_json::from_str(&std::fs::read_to_string(file)?)?;
    for (number, state) in all.iter().enumerate() {
        for (start, factors) in STARTS {
            let snapshot: Snapshot = serde_json::from_value(started(&state.snapshot, factors))?;
            let mut run = Simulation::<Layer>::from_snapshot(&state.params, snapshot, &tables)?;
            let before = *run.counters();
            let (sample, frame) = run.step_with_frame()?;
            let is_exact = run.counters().unconverged_stages == before.unconverged_stages
                && run.counters().jammed_stages == before.jammed_stages;
            let forces = frame.contacts.iter();
            let forces: Vec<String> = forces
                .map(|contact| format!("{}-{}:{:e}", contact.i, contact.j, contact.normal_force))
                .collect();
            println!(
                "{number}|{}|{start}|{is_exact}|{:e}|{:e}|{}",
                state.name,
                sample.viscosity,
                sample.normal_stress_difference,
                forces.join(" ")
            );
        }
    }
    Ok(())
}
