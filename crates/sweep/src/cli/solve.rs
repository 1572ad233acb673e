//! `sweep solve`.

use super::{Output, read_input};
use crate::error::Error;
use crate::instant::{Amount, Answer, answer, read};
use crate::system::exit;
use crate::text::format::{significant, wrapped};
use crate::text::table::table;
use sd_core::contact::ContactState;
use std::path::PathBuf;

/// Largest input, in bytes.
const INPUT_LIMIT: u64 = 16 << 20;
/// Solve one instant of one configuration
///
/// FILE is JSON: `centres` and `hydrodynamics`, and optionally `radii`, `cell`, `offset`,
/// `background`, `forces`, `torques`, `lubrication`, `contact`; docs/json.md describes them.
/// Lengths in sphere radii, forces in viscosity times radius squared times shear rate.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  echo '{\"centres\": [[0, 0], [2.1, 0]], \"hydrodynamics\": \"ball-melrose\"}' | sweep solve - --json"
)]
pub(crate) struct Arguments {
    /// The configuration; `-` for standard input
    file: PathBuf,
}

/// Solves and writes.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let bytes = read_input(&arguments.file, INPUT_LIMIT)?;
    let problem = read(&bytes).map_err(|error| Error::of_input(&arguments.file, error))?;
    let answer = answer(&problem)?;
    if output.json {
        output.json(&answer)?;
    } else {
        write_text(&answer, output)?;
    }
    Ok(exit::DONE)
}

/// Writes tables of spheres and contacts.
fn write_text(instant: &Answer, output: &mut Output<'_>) -> Result<(), Error> {
    let digits = |value: f64| significant(value, 6);
    // The magnitude of a vector.
    let amount = |amount: &Amount| match amount {
        Amount::Number(number) => digits(*number),
        Amount::Vector(vector) => digits(vector.iter().map(|x| x * x).sum::<f64>().sqrt()),
    };
    let is_layer = instant.stresslet_xz.is_none();
    let heads = if is_layer {
        "sphere u′_x u′_y ω′ S_xx S_yy S_xy"
    } else {
        "sphere u′_x u′_y u′_z ω′_x ω′_y ω′_z S_xx S_yy S_xy S_xz S_yz"
    };
    let velocities = instant.velocity_disturbance.iter().enumerate();
    let rows = velocities.map(|(sphere, velocity)| {
        let turning = instant.angular_velocity_disturbance[sphere].numbers();
        let stresslets = [
            &instant.stresslet_xx,
            &instant.stresslet_yy,
            &instant.stresslet_xy,
        ];
        let others = instant.stresslet_xz.iter().chain(&instant.stresslet_yz);
        let stresslets = stresslets
            .into_iter()
            .chain(others)
            .map(|list| list[sphere]);
        let numbers = velocity.iter().chain(turning).copied().chain(stresslets);
        let row = std::iter::once(sphere.to_string()).chain(numbers.map(digits));
        row.collect::<Vec<_>>()
    });
    let spheres = table(output.width, heads.split(' '), rows);
    writeln!(output.out, "{spheres}")?;
    if !instant.contacts.is_empty() {
        let heads = [
            "i",
            "j",
            "image",
            "gap",
            "normal force",
            "tangential force",
            "normal velocity",
            "slip velocity",
            "state",
        ];
        let rows = instant.contacts.iter().map(|c| {
            let image: Vec<String> = c.image.iter().map(i32::to_string).collect();
            [
                c.i.to_string(),
                c.j.to_string(),
                image.join(" "),
                digits(c.gap),
                digits(c.normal_force),
                amount(&c.tangential_force),
                digits(c.normal_velocity),
                amount(&c.slip_velocity),
                match c.state {
                    ContactState::Frictionless => "frictionless",
                    ContactState::Sticking => "rolling",
                    ContactState::Slipping => "slipping",
                }
                .into(),
            ]
        });
        writeln!(output.out, "{}", table(output.width, heads, rows))?;
    }
    for (name, value) in [
        ("viscosity", instant.viscosity),
        ("stresslet viscosity", instant.viscosity_stresslet),
        ("dissipation", instant.dissipation),
        ("N1", instant.n1),
        ("N2", instant.n2),
        (
            "particle pressure of contacts and repulsion",
            instant.particle_pressure,
        ),
        (
            "particle pressure of the fluid",
            instant.pressure_hydrodynamic,
        ),
    ] {
        if let Some(value) = value {
            writeln!(output.out, "{name} {}", digits(value))?;
        }
    }
    let notes = "u′ and ω′: velocity and angular velocity less those of the background at the centre, in a × rate and rate; S: \
                 stresslets in μ a³ × rate; gaps in a; forces in μ a² × rate; viscosities in μ, stresses in μ × rate";
    writeln!(output.out, "{}", wrapped(notes, output.width).trim_end())?;
    Ok(())
}
