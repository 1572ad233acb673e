//! Lets a suspension sink in fluid at rest and prints its mean velocity:
//! `sedimentation [spheres] [volume fraction] [time]`.
//!
//! Forces are in units that make the velocity of a single sphere in unbounded fluid 1, and times in
//! the time in which that sphere sinks by its radius. The mean flow of spheres and fluid is zero.

use sd_core::{Bulk, Hydrodynamics, NearFields, Params, Simulation};
use std::error::Error;
use std::f64::consts::PI;
use std::io::Write as _;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut next = |usual: &str| arguments.next().unwrap_or_else(|| usual.into());
    let (spheres, volume_fraction) = (next("64").parse()?, next("0.1").parse()?);
    for [time, velocity, fluctuation] in sink(spheres, volume_fraction, next("0.5").parse()?, 1)? {
        writeln!(
            std::io::stdout(),
            "time {time:.3}: velocity {velocity:.4}, fluctuation along z {fluctuation:.4}"
        )?;
    }
    Ok(())
}

/// Time, mean velocity downwards and its standard deviation over the spheres, after each step.
pub(crate) fn sink(
    spheres: usize,
    volume_fraction: f64,
    until: f64,
    seed: u64,
) -> Result<Vec<[f64; 3]>, sd_core::Error> {
    let params = Params::builder()
        .spheres(spheres)
        .volume_fraction(volume_fraction)
        .roughness(0.01)
        .friction(0.0)
        .shear_rate(0.0)
        .hydrodynamics(Hydrodynamics::StokesianDynamics)
        .time_step(0.05)
        .at_rest()
        .build()?;
    let mut suspension = Simulation::<Bulk>::new(&params, seed, &NearFields::default())?;
    let weight = [0.0, 0.0, -6.0 * PI, 0.0, 0.0, 0.0];
    suspension.use_constant_forces(&vec![weight; spheres])?;
    let mut rows = Vec::new();
    while suspension.time() < until - 1e-9 {
        suspension.step()?;
        let velocities = || suspension.velocities().iter().map(|u| -u[2]);
        let mean = velocities().sum::<f64>() / spheres as f64;
        let square = velocities().map(|u| (u - mean).powi(2)).sum::<f64>() / spheres as f64;
        rows.push([suspension.time(), mean, square.sqrt()]);
    }
    Ok(rows)
}
