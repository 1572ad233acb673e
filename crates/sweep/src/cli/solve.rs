//! `sweep solve`.

mod contact;

use self::contact::Contact;
use super::{Output, read_limited};
use crate::cli::Error;
use crate::exit;
use crate::format::significant;
use crate::tables;
use sd_core::cell::Cell;
use sd_core::contact::ContactState;
use sd_core::instant::{self, Configuration, ContactRequest, SolvedConfiguration, solve};
use sd_core::model::Words;
use sd_core::modes::{Background, Vec2};
use sd_core::{Hydrodynamics, LeadingOrder, NearFields, Params, StressComponents};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Largest input, in bytes.
const INPUT_LIMIT: u64 = 16 << 20;
/// Most different radii: every pair of them needs a table, which takes a second.
const RADIUS_LIMIT: usize = 10;

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

/// A configuration as it is written, in JSON or by another program. Lengths in sphere radii, forces in mu·a²·rate.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Centres.
    pub centres: Vec<[f64; 2]>,
    /// Radii, default 1.
    pub radii: Option<Vec<f64>>,
    /// Cell sides; none: unbounded.
    cell: Option<[f64; 2]>,
    /// Offset of the cell.
    offset: Option<f64>,
    /// Hydrodynamics, by its word.
    #[serde(deserialize_with = "by_word")]
    hydrodynamics: Hydrodynamics,
    /// Numbers of leading-order lubrication, default the usual ones.
    lubrication: Option<LeadingOrder>,
    /// Imposed flow, default simple shear.
    background: Option<Flow>,
    /// External forces, default 0.
    pub forces: Option<Vec<[f64; 2]>>,
    /// External torques, default 0.
    pub torques: Option<Vec<f64>>,
    /// Contact problem, default none.
    contact: Option<Contact>,
}

/// A choice by its word.
fn by_word<'de, D: Deserializer<'de>, T: Words>(deserializer: D) -> Result<T, D::Error> {
    let word = String::deserialize(deserializer)?;
    T::of_word(&word).ok_or_else(|| {
        let known: Vec<String> = T::WORDS
            .iter()
            .map(|known| format!("{:?}", known.word))
            .collect();
        serde::de::Error::custom(format!(
            "{word:?} is not known, expected {}",
            known.join(" or ")
        ))
    })
}

/// Why an [`Input`] is no configuration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// A value that cannot be meant.
    #[error("{field}: {message}")]
    Value {
        /// Name of the value.
        field: &'static str,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// What the solver refuses.
    #[error(transparent)]
    Physics(#[from] sd_core::Error),
}

/// Imposed flow as it is written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Flow {
    /// Rate of strain.
    rate_of_strain: Strain,
    /// Angular velocity.
    angular_velocity: f64,
}

/// Rate of strain as it is written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Strain {
    /// xx.
    xx: f64,
    /// yy.
    yy: f64,
    /// xy.
    xy: f64,
}

/// Solves and writes.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let bytes = read_limited(&arguments.file, INPUT_LIMIT)?;
    let (configuration, contact) = read(&arguments.file, &bytes)?;
    let mut ratios = NearFields::ratios(&configuration.radii);
    if !configuration.hydrodynamics.needs_tables() {
        ratios.clear();
    }
    let tables = if ratios.iter().all(|ratio| (0.01..=100.0).contains(ratio)) {
        tables::make(&ratios, |_| ())?
    } else {
        NearFields::default()
    };
    let answer = Answer::from(&solve(&configuration, &contact, &tables)?);
    if output.json {
        output.json(&answer)?;
    } else {
        write_text(&answer, output)?;
    }
    Ok(exit::DONE)
}

/// Reads the input strictly.
fn read(path: &Path, bytes: &[u8]) -> Result<(Configuration, ContactRequest), Error> {
    let input: Input = serde_json::from_slice(bytes).map_err(|error| {
        // The message of serde ends with the place, which we put in front.
        let text = error.to_string();
        let message = text
            .rsplit_once(" at line ")
            .map_or(text.as_str(), |(message, _)| message);
        Error::Json {
            path: path.to_owned(),
            line: error.line(),
            column: error.column(),
            message: message.chars().take(400).collect(),
        }
    })?;
    configuration(input).map_err(|error| match error {
        InputError::Value { field, message } => Error::Value {
            path: path.to_owned(),
            field,
            message,
        },
        InputError::Physics(error) => error.into(),
    })
}

/// The configuration and the contact problem that an input means.
///
/// # Errors
/// Lists of other lengths, more spheres or radii than can be computed, values without meaning or out of range.
pub fn configuration(input: Input) -> Result<(Configuration, ContactRequest), InputError> {
    let refuse = |field, message: &str| {
        Err(InputError::Value {
            field,
            message: message.into(),
        })
    };
    let hydrodynamics = match (input.hydrodynamics, input.lubrication) {
        (Hydrodynamics::Lubrication(_), Some(numbers)) => Hydrodynamics::Lubrication(numbers),
        (other, None) => other,
        (other, Some(_)) => {
            let word = other.word();
            return refuse("lubrication", &format!("has no meaning under {word}"));
        }
    };
    let n = input.centres.len();
    let most = Params::MOST_SPHERES;
    if n > most {
        return refuse("centres", &format!("{n} spheres, at most {most}"));
    }
    let different: BTreeSet<u64> = input.radii.iter().flatten().map(|r| r.to_bits()).collect();
    if different.len() > RADIUS_LIMIT {
        return refuse(
            "radii",
            &format!(
                "{} different ones, at most {RADIUS_LIMIT}: each pair needs a table of its own",
                different.len()
            ),
        );
    }
    for (field, length) in [
        ("radii", input.radii.as_ref().map(Vec::len)),
        ("forces", input.forces.as_ref().map(Vec::len)),
        ("torques", input.torques.as_ref().map(Vec::len)),
    ] {
        if let Some(found) = length.filter(|length| *length != n) {
            return Err(sd_core::Error::Length {
                field,
                found,
                expected: n,
            }
            .into());
        }
    }
    let cell = match (input.cell, input.offset) {
        (Some([x, y]), offset) => Cell::periodic(x, y, offset.unwrap_or(0.0))?,
        (None, None) => Cell::Unbounded,
        (None, Some(_)) => return refuse("offset", "has no meaning without `cell`"),
    };
    let contact = match input.contact {
        None => ContactRequest::None,
        Some(contact) => match contact.request(hydrodynamics) {
            Ok(request) => request,
            Err((field, message)) => return refuse(field, &message),
        },
    };
    let vectors = |list: Vec<[f64; 2]>| list.into_iter().map(Vec2::from).collect::<Vec<_>>();
    let configuration = Configuration {
        centres: vectors(input.centres),
        radii: input.radii.unwrap_or_else(|| vec![1.0; n]),
        cell,
        hydrodynamics,
        background: input
            .background
            .map_or(Background::SHEAR, |flow| Background {
                xx: flow.rate_of_strain.xx,
                yy: flow.rate_of_strain.yy,
                xy: flow.rate_of_strain.xy,
                angular_velocity: flow.angular_velocity,
            }),
        forces: input.forces.map_or_else(|| vec![Vec2::zeros(); n], vectors),
        torques: input.torques.unwrap_or_else(|| vec![0.0; n]),
    };
    let most = instant::method(&configuration, &contact).most_spheres(hydrodynamics);
    if n > most {
        let word = hydrodynamics.word();
        let message = format!(
            "{n} spheres, at most {most} under {word} in unbounded fluid or with listed contacts or the paper's procedure"
        );
        return refuse("centres", &message);
    }
    Ok((configuration, contact))
}

/// The answer as it is written; its names are a promise.
#[derive(Serialize)]
struct Answer {
    /// Velocities minus the background at the own centre.
    velocity_disturbance: Vec<[f64; 2]>,
    /// Angular velocities minus the background's.
    angular_velocity_disturbance: Vec<f64>,
    /// Stresslets, xx.
    stresslet_xx: Vec<f64>,
    /// Stresslets, yy.
    stresslet_yy: Vec<f64>,
    /// Stresslets, xy.
    stresslet_xy: Vec<f64>,
    /// Viscosity in full; `null` in unbounded fluid, as the next two.
    viscosity: Option<f64>,
    /// Viscosity from the stresslets alone.
    viscosity_stresslet: Option<f64>,
    /// v'Rv over volume and rate.
    dissipation: Option<f64>,
    /// First and second normal stress difference, and the particle pressure of contacts and repulsion.
    n1: Option<f64>,
    n2: Option<f64>,
    particle_pressure: Option<f64>,
    /// The same and the shear stress, each by its causes.
    stress: Option<StressComponents>,
    /// All candidate pairs.
    contacts: Vec<Pair>,
}

/// One candidate pair as it is written.
#[derive(Serialize)]
struct Pair {
    /// First sphere.
    i: usize,
    /// Second sphere.
    j: usize,
    /// Image of the second.
    image: [i32; 2],
    /// Gap.
    gap: f64,
    /// Unit vector from the first to the second.
    normal: [f64; 2],
    /// Normal force.
    normal_force: f64,
    /// Tangential force.
    tangential_force: f64,
    /// Velocity along the normal in the final motion.
    normal_velocity: f64,
    /// Slip in the final motion.
    slip_velocity: f64,
    /// Quasi-force of rolling friction, and the rolling velocity in the final motion.
    rolling_force: f64,
    rolling_velocity: f64,
    /// What the contact does.
    state: ContactState,
}

impl From<&SolvedConfiguration> for Answer {
    fn from(instant: &SolvedConfiguration) -> Self {
        let stresslets: Vec<_> = (0..instant.stresslets.len())
            .map(|sphere| instant.stresslet(sphere))
            .collect();
        let stress = instant.stress.as_ref();
        Self {
            velocity_disturbance: instant.disturbances.iter().map(|v| [v[0], v[1]]).collect(),
            angular_velocity_disturbance: instant.disturbances.iter().map(|v| v[2]).collect(),
            stresslet_xx: stresslets.iter().map(|s| s.0).collect(),
            stresslet_yy: stresslets.iter().map(|s| s.1).collect(),
            stresslet_xy: stresslets.iter().map(|s| s.2).collect(),
            viscosity: stress.map(|s| s.viscosity),
            viscosity_stresslet: stress.map(|s| s.viscosity_stresslet),
            dissipation: stress.map(|s| s.dissipation),
            n1: stress.map(|s| s.components.n1.total()),
            n2: stress.map(|s| s.components.n2.total()),
            particle_pressure: stress.map(|s| s.components.particle_pressure.total()),
            stress: stress.map(|s| s.components),
            contacts: instant
                .contacts
                .iter()
                .map(|contact| Pair {
                    i: contact.pair.i,
                    j: contact.pair.j,
                    image: contact.pair.image,
                    gap: contact.pair.gap,
                    normal: [contact.pair.normal.x, contact.pair.normal.y],
                    normal_force: contact.normal_force,
                    tangential_force: contact.tangential_force,
                    normal_velocity: contact.normal_velocity,
                    slip_velocity: contact.slip_velocity,
                    rolling_force: contact.rolling_force,
                    rolling_velocity: contact.rolling_velocity,
                    state: contact.state,
                })
                .collect(),
        }
    }
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

#[cfg(test)]
mod tests;
