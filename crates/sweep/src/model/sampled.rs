//! What a sample holds: name and place of each number, declared once. The store, tables and the Python package go by this list.

use super::axes::Value;
use super::{networks, stresses};
use sd_core::Sample;

/// A number of a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Its name in the store and in tables.
    pub name: &'static str,
    /// What it is.
    pub value: Value,
}

/// Where a number of a sample is.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Place {
    Number(fn(&mut Sample) -> &mut f64),
    Count(fn(&mut Sample) -> &mut u32),
    Total(fn(&mut Sample) -> &mut u64),
}

/// Names and places of all but the parts of the stress, which have a [list](stresses::STRESSES) of their own.
#[rustfmt::skip]
pub(crate) static PLACES: [(&str, Place); 22] = [
    ("strain", Place::Number(|s| &mut s.strain)),
    ("viscosity", Place::Number(|s| &mut s.viscosity)),
    ("viscosity_stresslet", Place::Number(|s| &mut s.viscosity_stresslet)),
    ("normal_stress_difference", Place::Number(|s| &mut s.normal_stress_difference)),
    ("shear_rate", Place::Number(|s| &mut s.shear_rate)),
    ("dissipation", Place::Number(|s| &mut s.dissipation)),
    ("contacts", Place::Count(|s| &mut s.contacts)),
    ("activated", Place::Count(|s| &mut s.activated)),
    ("rolling", Place::Count(|s| &mut s.rolling)),
    ("slipping", Place::Count(|s| &mut s.slipping)),
    ("normal_velocity", Place::Number(|s| &mut s.normal_velocity)),
    ("minimum_gap", Place::Number(|s| &mut s.minimum_gap)),
    ("stages", Place::Total(|s| &mut s.counters.stages)),
    ("unconverged_stages", Place::Total(|s| &mut s.counters.unconverged_stages)),
    ("inexact_stages", Place::Total(|s| &mut s.counters.inexact_stages)),
    ("jammed_stages", Place::Total(|s| &mut s.counters.jammed_stages)),
    ("worst_residual", Place::Number(|s| &mut s.counters.worst_residual)),
    ("worst_friction_error", Place::Number(|s| &mut s.counters.worst_friction_error)),
    ("minimum_gap_so_far", Place::Number(|s| &mut s.counters.minimum_gap)),
    ("jam_events", Place::Total(|s| &mut s.counters.jam_events)),
    ("jammed_steps", Place::Total(|s| &mut s.counters.jammed_steps)),
    ("jammed_steps_running", Place::Total(|s| &mut s.counters.jammed_steps_running)),
];
/// How many of these come before the parts of the stress.
const BEFORE_STRESSES: usize = 4;

/// All that a sample holds.
pub fn fields(sample: &Sample) -> Vec<Field> {
    let mut copy = *sample;
    let mut own = PLACES.iter().map(|(name, place)| Field {
        name,
        value: match place {
            Place::Number(number) => Value::Number(*number(&mut copy)),
            Place::Count(count) => Value::Count(u64::from(*count(&mut copy))),
            Place::Total(count) => Value::Count(*count(&mut copy)),
        },
    });
    let mut all: Vec<Field> = own.by_ref().take(BEFORE_STRESSES).collect();
    all.extend(stresses::parts().map(|part| Field {
        name: part.name,
        value: Value::Number(part.read(sample)),
    }));
    all.extend(own);
    all.extend(networks::NETWORK.iter().map(|column| Field {
        name: column.name,
        value: Value::Number(column.read(sample)),
    }));
    all
}

/// Whether a field is of the network of contacts, which most samples do not look at.
pub fn is_of_network(field: &Field) -> bool {
    networks::NETWORK
        .iter()
        .any(|column| column.name == field.name)
}

/// Names of all that a sample holds, as in a list of a statement.
pub(crate) fn names() -> String {
    let fields = fields(&Sample::default());
    let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
    names.join(", ")
}

/// The sample whose fields, by their places in [`fields`], are these.
///
/// # Errors
/// Those of `number` and `count`.
pub(crate) fn read<E>(
    number: impl Fn(usize) -> Result<f64, E> + Copy,
    count: impl Fn(usize) -> Result<u64, E>,
) -> Result<Sample, E> {
    let mut sample = Sample::default();
    let stresses = BEFORE_STRESSES..BEFORE_STRESSES + stresses::parts().count();
    for (place, (_, what)) in PLACES.iter().enumerate() {
        let place = if place < stresses.start {
            place
        } else {
            place + stresses.len()
        };
        match what {
            Place::Number(of) => *of(&mut sample) = number(place)?,
            Place::Count(of) => *of(&mut sample) = u32::try_from(count(place)?).unwrap_or(u32::MAX),
            Place::Total(of) => *of(&mut sample) = count(place)?,
        }
    }
    let parts: Vec<f64> = stresses.map(number).collect::<Result<_, E>>()?;
    sample.stress = stresses::of_parts(parts);
    let first = PLACES.len() + stresses::parts().count();
    let network = first..first + networks::NETWORK_COUNT;
    let network: Vec<f64> = network.map(number).collect::<Result<_, E>>()?;
    sample.network = networks::of_values(&network);
    Ok(sample)
}
