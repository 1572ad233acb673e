//! One instant of one configuration: what `sweep solve` and Python read, and what they answer.

mod contact;

use self::contact::Contact;
use super::Error;
use crate::tables;
use sd_core::cell::Cell;
use sd_core::contact::ContactState;
use sd_core::instant::{self, Configuration, ContactRequest, SolvedConfiguration, solve};
use sd_core::model::Words;
use sd_core::modes::{Background, Vec2};
use sd_core::two_sphere::Scalars;
use sd_core::{Hydrodynamics, LeadingOrder, NearFields, Params, StressComponents};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

/// Most different radii: every pair of them needs a table, which takes a second.
const RADIUS_LIMIT: usize = 10;

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

/// Reads the input strictly.
///
/// # Errors
/// What is wrong with it, and where.
pub(crate) fn read(path: &Path, bytes: &[u8]) -> Result<(Configuration, ContactRequest), Error> {
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
        (Some([x, y]), offset) => Cell::periodic(Vec2::new(x, y), offset.unwrap_or(0.0))?,
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

/// Solves an instant; near-field tables that it needs are made.
pub(crate) fn answer(
    configuration: &Configuration,
    contact: &ContactRequest,
) -> Result<Answer, Error> {
    let mut ratios = NearFields::ratios(&configuration.radii);
    if !configuration.hydrodynamics.needs_tables() {
        ratios.clear();
    }
    let tables = if ratios.iter().all(|ratio| (0.01..=100.0).contains(ratio)) {
        tables::make(&ratios, |_| ())?
    } else {
        NearFields::default()
    };
    Ok(Answer::from(&solve(configuration, contact, &tables)?))
}

/// The answer as it is written; its names are a promise.
#[derive(Serialize)]
pub(crate) struct Answer {
    /// Velocities minus the background at the own centre.
    pub(crate) velocity_disturbance: Vec<[f64; 2]>,
    /// Angular velocities minus the background's.
    pub(crate) angular_velocity_disturbance: Vec<f64>,
    /// Stresslets, xx.
    pub(crate) stresslet_xx: Vec<f64>,
    /// Stresslets, yy.
    pub(crate) stresslet_yy: Vec<f64>,
    /// Stresslets, xy.
    pub(crate) stresslet_xy: Vec<f64>,
    /// Viscosity in full; `null` in unbounded fluid, as the next two.
    pub(crate) viscosity: Option<f64>,
    /// Viscosity from the stresslets alone.
    pub(crate) viscosity_stresslet: Option<f64>,
    /// v'Rv over volume and rate.
    pub(crate) dissipation: Option<f64>,
    /// First and second normal stress difference, and the particle pressure of contacts and repulsion.
    pub(crate) n1: Option<f64>,
    pub(crate) n2: Option<f64>,
    pub(crate) particle_pressure: Option<f64>,
    /// The same and the shear stress, each by its causes.
    pub(crate) stress: Option<StressComponents>,
    /// All candidate pairs.
    pub(crate) contacts: Vec<Pair>,
}

/// One candidate pair as it is written.
#[derive(Serialize)]
pub(crate) struct Pair {
    /// First sphere.
    pub(crate) i: usize,
    /// Second sphere.
    pub(crate) j: usize,
    /// Image of the second.
    pub(crate) image: [i32; 2],
    /// Gap.
    pub(crate) gap: f64,
    /// Unit vector from the first to the second.
    pub(crate) normal: [f64; 2],
    /// Normal force.
    pub(crate) normal_force: f64,
    /// Tangential force.
    pub(crate) tangential_force: f64,
    /// Velocity along the normal in the final motion.
    pub(crate) normal_velocity: f64,
    /// Slip in the final motion.
    pub(crate) slip_velocity: f64,
    /// Quasi-force of rolling friction.
    pub(crate) rolling_force: f64,
    /// Rolling velocity in the final motion.
    pub(crate) rolling_velocity: f64,
    /// What the contact does.
    pub(crate) state: ContactState,
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

/// Resistance functions of two spheres by their published names: of a sphere's own motion, and of the other's.
pub fn named_scalars(s: &Scalars) -> [(&'static str, [f64; 2]); 10] {
    [
        ("XA", s.x_a),
        ("YA", s.y_a),
        ("YB", s.y_b),
        ("YC", s.y_c),
        ("XG", s.x_g),
        ("YG", s.y_g),
        ("YH", s.y_h),
        ("XM", s.x_m),
        ("YM", s.y_m),
        ("ZM", s.z_m),
    ]
}

#[cfg(test)]
mod tests;
