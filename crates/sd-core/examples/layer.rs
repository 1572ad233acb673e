//! Shears a layer of rough, frictional spheres and averages its viscosity.
//!
//! `cargo run --release -p sd-core --example layer`
#![expect(clippy::print_stdout, reason = "examples print their results")]

use sd_core::{Error, Hydrodynamics, NearFields, Params, Simulation};

/// Half a strain of a small layer.
pub(crate) fn main() -> Result<(), Error> {
    let params = Params::builder()
        .spheres(40)
        .area_fraction(0.65)
        .roughness(0.01) // h, in radii
        .friction(0.5) // ν
        .shear_rate(f64::INFINITY) // Γ: friction acts on every contact
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .time_step(0.005) // strain
        .build()?;
    let mut layer = Simulation::<sd_core::Layer>::new(&params, 1, &NearFields::default())?;
    let samples = (0..100)
        .map(|_| layer.step())
        .collect::<Result<Vec<_>, _>>()?;
    for sample in samples.iter().step_by(20) {
        println!(
            "strain {:.2}: viscosity {:.3}, {} contacts",
            sample.strain, sample.viscosity, sample.contacts
        );
    }
    let mean = samples.iter().map(|s| s.viscosity).sum::<f64>() / samples.len() as f64;
    let dilute = 1.0 + 5.0 / 3.0 * params.area_fraction;
    println!("mean viscosity {mean:.3}, a dilute layer would have {dilute:.3}");
    println!(
        "smallest gap {:.5} at roughness {}",
        layer.counters().minimum_gap,
        params.roughness
    );
    Ok(())
}
