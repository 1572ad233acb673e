//! `sweep solve`.

use super::{Output, read_input};
use crate::api::Error;
use crate::api::instant::{Answer, answer, read};
use crate::exit;
use crate::text::format::significant;
use sd_core::contact::ContactState;
use std::path::PathBuf;

/// Largest input, in bytes.
const INPUT_LIMIT: u64 = 16 << 20;
/// Solve one instant of one configuration
///
/// FILE is JSON: `centres` and `hydrodynamics`, and optionally `radii`, `cell`, `offset`, `background`, `forces`, `torques`,
/// `lubrication`, `contact`; docs/json.md has all of it. Lengths in sphere radii, forces in viscosity times radius squared times shear rate.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  echo '{\"centres\": [[0, 0], [2.1, 0]], \"hydrodynamics\": \"ball-melrose\"}' | sweep solve - --json"
)]
pub(crate) struct Arguments {
    /// The configuration; `-` is standard input
    file: PathBuf,
}

/// Solves and writes.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let bytes = read_input(&arguments.file, INPUT_LIMIT)?;
    let (configuration, contact) = read(&arguments.file, &bytes)?;
    let answer = answer(&configuration, &contact)?;
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
    let mut spheres = crate::report::table(output.width);
    spheres.set_header(["sphere", "u_x", "u_y", "ω", "S_xx", "S_yy", "S_xy"]);
    for (sphere, velocity) in instant.velocity_disturbance.iter().enumerate() {
        let of = |list: &[f64]| list.get(sphere).map_or_else(String::new, |v| digits(*v));
        spheres.add_row([
            sphere.to_string(),
            digits(velocity[0]),
            digits(velocity[1]),
            of(&instant.angular_velocity_disturbance),
            of(&instant.stresslet_xx),
            of(&instant.stresslet_yy),
            of(&instant.stresslet_xy),
        ]);
    }
    writeln!(output.out, "{}", crate::report::whole(spheres))?;
    if !instant.contacts.is_empty() {
        let mut contacts = crate::report::table(output.width);
        contacts.set_header([
            "i",
            "j",
            "image",
            "gap",
            "normal force",
            "tangential force",
            "normal velocity",
            "slip velocity",
            "state",
        ]);
        for c in &instant.contacts {
            contacts.add_row([
                c.i.to_string(),
                c.j.to_string(),
                format!("{} {}", c.image[0], c.image[1]),
                digits(c.gap),
                digits(c.normal_force),
                digits(c.tangential_force),
                digits(c.normal_velocity),
                digits(c.slip_velocity),
                match c.state {
                    ContactState::Frictionless => "frictionless",
                    ContactState::Rolling => "rolling",
                    ContactState::Slipping => "slipping",
                }
                .into(),
            ]);
        }
        writeln!(output.out, "{}", crate::report::whole(contacts))?;
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
    ] {
        if let Some(value) = value {
            writeln!(output.out, "{name} {}", digits(value))?;
        }
    }
    Ok(())
}
