//! One instant of one configuration: input and output of `sweep solve` and of Python.

mod components;
mod contact;

pub(crate) use components::Amount;
pub use components::{Components, Written};

use crate::model::spaces::{InSpace, of_either};
use crate::near_field_cache;
use crate::trajectory::Kept;
use components::FirstCentre;
use contact::Contact;
use sd_core::cell::{Cell, Lattice};
use sd_core::contact::ContactState;
use sd_core::instant::{self, Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::model::Keywords;
use sd_core::two_sphere::{scalars, twist};
use sd_core::{
    Bulk, Hydrodynamics, Layer, LeadingOrder, Method, NearFields, Params, StressComponents,
    VelocityGradient,
};
use serde::de::IgnoredAny;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeSet;

/// Maximum number of different radii: each pair needs a table, which takes a second.
const RADIUS_LIMIT: usize = 10;

/// A configuration as it is written, in JSON or by another program. Lengths in sphere radii, forces
/// in mu·a²·rate.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct Input<S: Written = Layer> {
    /// Centres.
    pub centres: Vec<S::Components>,
    /// Radii, default 1.
    pub radii: Option<Vec<f64>>,
    /// Cell sides; none: unbounded.
    cell: Option<S::Components>,
    /// Lattice vectors, in place of a cell.
    lattice: Option<Vec<S::Components>>,
    /// Offset of the cell along the flow.
    offset: Option<f64>,
    /// Offset of the cell along the vorticity, in a suspension.
    cross_offset: Option<f64>,
    /// Hydrodynamics, by its word.
    #[serde(deserialize_with = "by_word")]
    hydrodynamics: Hydrodynamics,
    /// Parameters of leading-order lubrication; the defaults where absent.
    lubrication: Option<LeadingOrder>,
    /// Imposed flow, default simple shear.
    background: Option<FlowInput<S>>,
    /// External forces, default 0.
    pub forces: Option<Vec<S::Components>>,
    /// External torques, default 0.
    pub torques: Option<Vec<S::Turning>>,
    /// Contact problem, default none.
    contact: Option<Contact<S>>,
}

/// A choice by its word.
fn by_word<'de, D: Deserializer<'de>, T: Keywords>(deserializer: D) -> Result<T, D::Error> {
    let word = String::deserialize(deserializer)?;
    T::of_word(&word).ok_or_else(|| {
        let known = words::<T>();
        serde::de::Error::custom(format!("{word:?} is not known, expected {known}"))
    })
}

/// The words of a choice.
fn words<T: Keywords>() -> String {
    let known = T::KEYWORDS.iter();
    let known: Vec<String> = known.map(|known| format!("{:?}", known.word)).collect();
    known.join(" or ")
}

/// Why an [`Input`] was rejected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// Malformed JSON.
    #[error("{line}:{column}: {message}")]
    Json {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// An invalid value.
    #[error("{field}: {message}")]
    Value {
        /// Name of the value.
        field: &'static str,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// An error of the solver.
    #[error(transparent)]
    Physics(#[from] sd_core::Error),
}

/// Imposed flow in JSON.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
struct FlowInput<S: Written> {
    rate_of_strain: S::Rates,
    angular_velocity: S::Turning,
}

/// A configuration and its contact problem.
type InstantProblem<S> = (Configuration<S>, InstantContacts<S>);

/// A configuration of a layer or of a suspension.
pub(crate) type AnyProblem = InSpace<InstantProblem<Layer>, InstantProblem<Bulk>>;

/// Reads the input strictly; the first of its centres says whether it is a layer or a suspension.
///
/// # Errors
/// What is wrong with it, and where.
pub(crate) fn read(bytes: &[u8]) -> Result<AnyProblem, InputError> {
    // What is no JSON says nothing about the values.
    if let Err(error) = serde_json::from_slice::<IgnoredAny>(bytes)
        && !error.is_data()
    {
        return Err(malformed(&error));
    }
    match serde_json::from_slice::<FirstCentre>(bytes) {
        Ok(first) if first.is_suspended() => Ok(InSpace::Suspension(read_in(bytes)?)),
        _ => Ok(InSpace::Layer(read_in(bytes)?)),
    }
}

/// The message of serde ends with the position, which is reported separately.
fn malformed(error: &serde_json::Error) -> InputError {
    let text = error.to_string();
    let message = text
        .rsplit_once(" at line ")
        .map_or(text.as_str(), |(message, _)| message);
    let mut message: String = message.chars().take(400).collect();
    if message == "missing field `hydrodynamics`" {
        message = format!("{message}: {}", words::<Hydrodynamics>());
    }
    InputError::Json {
        line: error.line(),
        column: error.column(),
        message,
    }
}

/// Reads the input of one space.
fn read_in<S: Written>(bytes: &[u8]) -> Result<InstantProblem<S>, InputError> {
    configuration(serde_json::from_slice(bytes).map_err(|error| malformed(&error))?)
}

/// The configuration and the contact problem of an input.
///
/// # Errors
/// Lists of other lengths, more spheres or radii than can be computed, values without meaning or
/// out of range.
pub fn configuration<S: Written>(
    input: Input<S>,
) -> Result<(Configuration<S>, InstantContacts<S>), InputError> {
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
    let most = Params::MAX_SPHERES;
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
    let cell = cell_of::<S>(input.cell, input.offset, input.cross_offset, input.lattice)?;
    let contact = match input.contact {
        None => InstantContacts::None,
        Some(contact) => match contact.request(hydrodynamics) {
            Ok(request) => request,
            Err((field, message)) => return refuse(field, &message),
        },
    };
    let vectors = |list: Vec<S::Components>| -> Vec<S::Vector> {
        list.into_iter().map(S::vector_of).collect()
    };
    let configuration = Configuration {
        centres: vectors(input.centres),
        radii: input.radii.unwrap_or_else(|| vec![1.0; n]),
        cell,
        hydrodynamics,
        background: match input.background {
            None => VelocityGradient::simple_shear(1.0).into(),
            Some(flow) => match S::flow_of(flow.rate_of_strain, flow.angular_velocity) {
                Ok(flow) => flow.into(),
                Err(message) => return refuse("background.rate_of_strain", &message),
            },
        },
        forces: input
            .forces
            .map_or_else(|| vec![S::Vector::default(); n], vectors),
        torques: input.torques.map_or_else(
            || vec![S::Spin::default(); n],
            |list| list.into_iter().map(S::spin_of).collect(),
        ),
    };
    let method = instant::method(&configuration, &contact);
    let most = method.most_spheres(hydrodynamics);
    if n > most {
        let word = hydrodynamics.word();
        let which = match method {
            Method::Dense => " in unbounded fluid or with listed contacts or the paper's procedure",
            Method::Pairwise | Method::Iterated => "",
        };
        return refuse(
            "centres",
            &format!("{n} spheres, at most {most} under {word}{which}"),
        );
    }
    Ok((configuration, contact))
}

/// The cell of an input.
fn cell_of<S: Written>(
    sides: Option<S::Components>,
    offset: Option<f64>,
    cross_offset: Option<f64>,
    lattice: Option<Vec<S::Components>>,
) -> Result<Cell<S>, InputError> {
    let refuse = |field, message: &str| {
        Err(InputError::Value {
            field,
            message: message.into(),
        })
    };
    let is_given = [
        ("cell", sides.is_some()),
        ("offset", offset.is_some()),
        ("cross_offset", cross_offset.is_some()),
    ];
    if let Some(rows) = lattice {
        if let Some((field, _)) = is_given.iter().find(|(_, is_given)| *is_given) {
            return refuse(field, "has no meaning beside `lattice`");
        }
        let rows: Vec<S::Vector> = rows.into_iter().map(S::vector_of).collect();
        return Ok(Cell::Periodic(Lattice::new(&rows)?));
    }
    match (sides, is_given[1..].iter().find(|(_, is_given)| *is_given)) {
        (Some(sides), _) => {
            let cell = Cell::periodic(S::vector_of(sides), offset.unwrap_or(0.0))?;
            Ok(cell.with_cross_offset(cross_offset.unwrap_or(0.0))?)
        }
        (None, None) => Ok(Cell::Unbounded),
        (None, Some((field, _))) => refuse(field, "has no meaning without `cell`"),
    }
}

/// Solves an instant, computing the near-field tables that it needs.
pub(crate) fn answer(problem: &AnyProblem) -> Result<Answer, sd_core::Error> {
    of_either!(problem, problem => answer_in(problem))
}

fn answer_in<S: Written + Kept>(
    (configuration, contact): &InstantProblem<S>,
) -> Result<Answer, sd_core::Error> {
    let mut ratios = NearFields::ratios(&configuration.radii);
    if !configuration.hydrodynamics.needs_tables() {
        ratios.clear();
    }
    let tables = if ratios.iter().all(|ratio| (0.01..=100.0).contains(ratio)) {
        near_field_cache::make(&ratios, |_| ())?
    } else {
        NearFields::default()
    };
    Answer::of(&solve(configuration, contact, &tables)?)
}

/// The result in JSON; its keys are a stable interface.
#[derive(Debug, Serialize)]
pub struct Answer {
    /// Velocities minus the background at the own centre.
    pub(crate) velocity_disturbance: Vec<Vec<f64>>,
    /// Angular velocities minus the background's.
    pub(crate) angular_velocity_disturbance: Vec<Amount>,
    /// Stresslets, xx.
    pub(crate) stresslet_xx: Vec<f64>,
    /// Stresslets, yy.
    pub(crate) stresslet_yy: Vec<f64>,
    /// Stresslets, xy.
    pub(crate) stresslet_xy: Vec<f64>,
    /// Stresslets of a suspension, xz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) stresslet_xz: Option<Vec<f64>>,
    /// Stresslets of a suspension, yz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) stresslet_yz: Option<Vec<f64>>,
    /// Viscosity in full; `null` in unbounded fluid, as the next two.
    pub(crate) viscosity: Option<f64>,
    /// Viscosity from the stresslets alone.
    pub(crate) viscosity_stresslet: Option<f64>,
    /// v'Rv over volume and rate.
    pub(crate) dissipation: Option<f64>,
    /// First and second normal stress difference, and the particle pressure of contacts and
    /// repulsion.
    pub(crate) n1: Option<f64>,
    pub(crate) n2: Option<f64>,
    pub(crate) particle_pressure: Option<f64>,
    /// Particle pressure of the fluid, which no other number includes.
    pub(crate) pressure_hydrodynamic: Option<f64>,
    /// Normal stress differences, particle pressure and shear stress, split by cause.
    pub(crate) stress: Option<StressComponents>,
    /// All candidate pairs.
    pub(crate) contacts: Vec<Pair>,
}

/// One candidate pair in JSON.
#[derive(Debug, Serialize)]
pub(crate) struct Pair {
    pub(crate) i: usize,
    pub(crate) j: usize,
    pub(crate) image: Vec<i32>,
    pub(crate) gap: f64,
    /// Unit vector from the first to the second.
    pub(crate) normal: Vec<f64>,
    pub(crate) normal_force: f64,
    pub(crate) tangential_force: Amount,
    /// Velocity along the normal in the final motion.
    pub(crate) normal_velocity: f64,
    pub(crate) slip_velocity: Amount,
    /// Quasi-force of rolling friction.
    pub(crate) rolling_force: Amount,
    pub(crate) rolling_velocity: Amount,
    pub(crate) state: ContactState,
}

impl Answer {
    /// Refuses numbers that are not finite, which JSON cannot hold: forces near the end of the
    /// range of floats overflow in products.
    fn check_finite(&self) -> Result<(), sd_core::Error> {
        let sphere_of = |list: &[f64]| list.iter().position(|number| !number.is_finite());
        let layers = [&self.stresslet_xx, &self.stresslet_yy, &self.stresslet_xy];
        let lists = layers
            .into_iter()
            .chain(&self.stresslet_xz)
            .chain(&self.stresslet_yz);
        for list in lists {
            if let Some(sphere) = sphere_of(list) {
                let quantity = "the stresslet";
                return Err(sd_core::Error::NotFinite { quantity, sphere });
            }
        }
        let turned = self
            .angular_velocity_disturbance
            .iter()
            .map(Amount::numbers);
        let moved = self.velocity_disturbance.iter().map(Vec::as_slice);
        for (sphere, numbers) in moved.enumerate().chain(turned.enumerate()) {
            if sphere_of(numbers).is_some() {
                let quantity = "the velocity";
                return Err(sd_core::Error::NotFinite { quantity, sphere });
            }
        }
        let whole = [self.viscosity, self.viscosity_stresslet, self.dissipation];
        let pressures = [self.particle_pressure, self.pressure_hydrodynamic];
        let stresses = [self.n1, self.n2].into_iter().chain(pressures);
        let numbers: Vec<f64> = whole.into_iter().chain(stresses).flatten().collect();
        if sphere_of(&numbers).is_some() {
            let (quantity, sphere) = ("the stress of the cell with the forces", 0);
            return Err(sd_core::Error::NotFinite { quantity, sphere });
        }
        for pair in &self.contacts {
            let forces = [pair.normal_force, pair.normal_velocity];
            let numbers = [
                &forces,
                pair.tangential_force.numbers(),
                pair.slip_velocity.numbers(),
            ];
            if numbers
                .into_iter()
                .any(|numbers| sphere_of(numbers).is_some())
            {
                let (quantity, sphere) = ("a contact force or velocity", pair.i);
                return Err(sd_core::Error::NotFinite { quantity, sphere });
            }
        }
        Ok(())
    }

    /// Of a solved configuration.
    ///
    /// # Errors
    /// [`sd_core::Error::NotFinite`].
    pub fn of<S: Written + Kept>(instant: &SolvedConfiguration<S>) -> Result<Self, sd_core::Error> {
        let stresslets: Vec<S::Tensor> = instant.stresslets.iter().map(S::tensor).collect();
        let column = |place: usize| -> Vec<f64> { stresslets.iter().map(|s| s[place]).collect() };
        let suspended = |place: usize| (S::STRAINS > place).then(|| column(place));
        let moved = |v: &S::PerMode<f64>| S::point(&S::translation(v)).as_ref().to_vec();
        let turned = |v: &S::PerMode<f64>| Amount::of(&S::turning(&S::rotation(v)));
        let across = |tangent: &S::Tangent| Amount::of(S::across(tangent));
        let stress = instant.stress.as_ref();
        let answer = Self {
            velocity_disturbance: instant.disturbances.iter().map(moved).collect(),
            angular_velocity_disturbance: instant.disturbances.iter().map(turned).collect(),
            stresslet_xx: column(0),
            stresslet_yy: column(1),
            stresslet_xy: column(2),
            stresslet_xz: suspended(3),
            stresslet_yz: suspended(4),
            viscosity: stress.map(|s| s.viscosity),
            viscosity_stresslet: stress.map(|s| s.viscosity_stresslet),
            dissipation: stress.map(|s| s.dissipation),
            n1: stress.map(|s| s.components.n1.total()),
            n2: stress.map(|s| s.components.n2.total()),
            particle_pressure: stress.map(|s| s.components.particle_pressure.total()),
            pressure_hydrodynamic: stress.map(|s| instant.pressure_moment / s.volume),
            stress: stress.map(|s| s.components),
            contacts: instant
                .contacts
                .iter()
                .map(|contact| Pair {
                    i: contact.pair.i,
                    j: contact.pair.j,
                    image: (0..S::DIMENSIONS).map(|k| contact.pair.image[k]).collect(),
                    gap: contact.pair.gap,
                    normal: S::point(&contact.pair.normal).as_ref().to_vec(),
                    normal_force: contact.normal_force,
                    tangential_force: across(&contact.tangential_force),
                    normal_velocity: contact.normal_velocity,
                    slip_velocity: across(&contact.slip_velocity),
                    rolling_force: across(&contact.rolling_force),
                    rolling_velocity: across(&contact.rolling_velocity),
                    state: contact.state,
                })
                .collect(),
        };
        answer.check_finite()?;
        Ok(answer)
    }
}

/// Resistance functions of two spheres by their published names, for a sphere's own motion and for
/// that of the other.
///
/// # Errors
/// [`sd_core::Error::OutOfRange`] about the size ratio or the separation.
pub fn named_scalars(
    size_ratio: f64,
    separation: f64,
) -> Result<[(&'static str, [f64; 2]); 11], sd_core::Error> {
    let s = scalars(size_ratio, separation).map_err(|error| match error {
        // The library's name of it.
        sd_core::Error::OutOfRange {
            field: "s_prime",
            value,
            allowed,
        } => sd_core::Error::OutOfRange {
            field: "separation",
            value,
            allowed,
        },
        error => error,
    })?;
    Ok([
        ("XA", s.x_a),
        ("YA", s.y_a),
        ("YB", s.y_b),
        ("XC", twist(size_ratio, separation)?),
        ("YC", s.y_c),
        ("XG", s.x_g),
        ("YG", s.y_g),
        ("YH", s.y_h),
        ("XM", s.x_m),
        ("YM", s.y_m),
        ("ZM", s.z_m),
    ])
}

#[cfg(test)]
mod tests;
