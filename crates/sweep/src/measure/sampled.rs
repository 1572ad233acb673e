//! The numbers of a sample: name, unit, meaning and place of each, declared once.
//!
//! The store, averages, tables, exports, the page and the Python package use this list.

use crate::data::{DataColumn, Kind, Value};
use sd_core::simulation::NetworkSample;
use sd_core::{Sample, StressComponents};

/// A number of a sample, stored or derived.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Number {
    /// Its name in the store, in tables and in JSON.
    pub(crate) name: &'static str,
    /// Its unit.
    pub(crate) unit: &'static str,
    /// Its meaning; for the stress also its label on the page.
    pub(crate) meaning: &'static str,
    place: Place,
}

/// Place of a number in a sample.
#[derive(Debug, Clone, Copy)]
enum Place {
    Real(fn(&mut Sample) -> &mut f64),
    Count(fn(&mut Sample) -> &mut u32),
    Total(fn(&mut Sample) -> &mut u64),
    /// A component of the stress, the sum of its stored parts.
    Sum(fn(&StressComponents) -> f64),
    /// A part of a component of the stress.
    Part(fn(&mut StressComponents) -> &mut f64),
    /// A number of the contact network, which most samples lack.
    Network(fn(&mut NetworkSample) -> &mut f64),
}
use Place::{Count, Network, Part, Real, Sum, Total};

const fn number(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    place: Place,
) -> Number {
    Number {
        name,
        unit,
        meaning,
        place,
    }
}

/// All of them, in the order of the columns.
#[rustfmt::skip]
pub(crate) static NUMBERS: [Number; 45] = [
    number("strain", "1", "strain from the start of the run", Real(|s| &mut s.strain)),
    number("viscosity", "mu", "viscosity in full: stresslets and contact stress", Real(|s| &mut s.viscosity)),
    number("viscosity_stresslet", "mu", "viscosity without contact stress", Real(|s| &mut s.viscosity_stresslet)),
    number("normal_stress_difference", "mu rate", "first normal stress difference, contacts included", Real(|s| &mut s.normal_stress_difference)),
    number("n1", "mu rate", "first normal stress difference N₁, contacts included", Sum(|s| s.n1.total())),
    number("n2", "mu rate", "second normal stress difference N₂, contacts included", Sum(|s| s.n2.total())),
    number("particle_pressure", "mu rate", "particle pressure Π of contacts and repulsion, without its hydrodynamic part", Sum(|s| s.particle_pressure.total())),
    number("shear_hydrodynamic", "mu rate", "shear stress of the stresslets", Part(|s| &mut s.shear.hydrodynamic)),
    number("shear_normal_contact", "mu rate", "shear stress of the normal contact forces", Part(|s| &mut s.shear.normal_contact)),
    number("shear_tangential_contact", "mu rate", "shear stress of the tangential contact forces", Part(|s| &mut s.shear.tangential_contact)),
    number("shear_repulsion", "mu rate", "shear stress of the repulsion", Part(|s| &mut s.shear.repulsion)),
    number("n1_hydrodynamic", "mu rate", "N₁ of the stresslets", Part(|s| &mut s.n1.hydrodynamic)),
    number("n1_normal_contact", "mu rate", "N₁ of the normal contact forces", Part(|s| &mut s.n1.normal_contact)),
    number("n1_tangential_contact", "mu rate", "N₁ of the tangential contact forces", Part(|s| &mut s.n1.tangential_contact)),
    number("n1_repulsion", "mu rate", "N₁ of the repulsion", Part(|s| &mut s.n1.repulsion)),
    number("n2_hydrodynamic", "mu rate", "N₂ of the stresslets", Part(|s| &mut s.n2.hydrodynamic)),
    number("n2_normal_contact", "mu rate", "N₂ of the normal contact forces", Part(|s| &mut s.n2.normal_contact)),
    number("n2_tangential_contact", "mu rate", "N₂ of the tangential contact forces", Part(|s| &mut s.n2.tangential_contact)),
    number("n2_repulsion", "mu rate", "N₂ of the repulsion", Part(|s| &mut s.n2.repulsion)),
    number("particle_pressure_normal_contact", "mu rate", "particle pressure of the normal contact forces", Part(|s| &mut s.particle_pressure.normal_contact)),
    number("particle_pressure_repulsion", "mu rate", "particle pressure of the repulsion", Part(|s| &mut s.particle_pressure.repulsion)),
    number("shear_rate", "1", "shear rate Γ: imposed, or what the imposed stress leaves", Real(|s| &mut s.shear_rate)),
    number("dissipation", "mu rate", "dissipation over area and rate", Real(|s| &mut s.dissipation)),
    number("contacts", "1", "pairs with a contact force", Count(|s| &mut s.contacts)),
    number("activated", "1", "contacts above the critical load", Count(|s| &mut s.activated)),
    number("rolling", "1", "activated contacts that roll", Count(|s| &mut s.sticking)),
    number("slipping", "1", "activated contacts that slip", Count(|s| &mut s.slipping)),
    number("normal_velocity", "a rate", "mean normal velocity of the contacts, negative for approach", Real(|s| &mut s.normal_velocity)),
    number("minimum_gap", "a", "smallest gap in the layer", Real(|s| &mut s.minimum_gap)),
    number("stages", "1", "contact problems solved", Total(|s| &mut s.counters.stages)),
    number("unconverged_stages", "1", "contact problems that did not converge", Total(|s| &mut s.counters.unconverged_stages)),
    number("inexact_stages", "1", "contact problems with friction off by more than 1e-3 of the largest force", Total(|s| &mut s.counters.inexact_stages)),
    number("jammed_stages", "1", "contact problems without an admissible motion", Total(|s| &mut s.counters.jammed_stages)),
    number("worst_residual", "a rate", "largest residual of the contact problem", Real(|s| &mut s.counters.worst_residual)),
    number("worst_friction_error", "1", "largest inconsistency of a friction force with its law, over the largest force", Real(|s| &mut s.counters.worst_friction_error)),
    number("minimum_gap_so_far", "a", "smallest gap of the run so far", Real(|s| &mut s.counters.minimum_gap)),
    number("jam_events", "1", "times the viscosity rose above the threshold of jamming", Total(|s| &mut s.counters.jam_events)),
    number("jammed_steps", "1", "steps begun above that threshold", Total(|s| &mut s.counters.jammed_steps)),
    number("jammed_steps_running", "1", "steps since it was last below", Total(|s| &mut s.counters.jammed_steps_running)),
    number("coordination", "1", "loaded contacts of a sphere", Network(|n| &mut n.coordination)),
    number("frictional_coordination", "1", "contacts of a sphere on which friction acts", Network(|n| &mut n.frictional_coordination)),
    number("largest_cluster", "1", "fraction of spheres in the largest cluster of frictional contacts", Network(|n| &mut n.largest_cluster)),
    number("percolating_x", "1", "fraction of instants at which such a cluster percolates along the flow", Network(|n| &mut n.percolating_x)),
    number("percolating_y", "1", "fraction of instants at which such a cluster percolates along the gradient", Network(|n| &mut n.percolating_y)),
    number("core_fraction", "1", "fraction of spheres in the 3-core of the frictional contacts of a layer, in the 4-core of a suspension", Network(|n| &mut n.core_fraction)),
];

/// Number of those of which results have means.
pub(crate) const MEANS: usize = 23;

impl Number {
    /// Whether it is derived as a sum and not stored.
    pub(crate) fn is_sum(&self) -> bool {
        matches!(self.place, Sum(_))
    }

    /// Whether samples store it.
    pub(crate) fn is_kept(&self) -> bool {
        !self.is_sum()
    }

    /// Whether it is one part of a component of the stress.
    pub(crate) fn is_part(&self) -> bool {
        matches!(self.place, Part(_))
    }

    /// Whether it belongs to the contact network.
    pub(crate) fn is_of_network(&self) -> bool {
        matches!(self.place, Network(_))
    }

    /// Whether results have its mean: numbers of the stress and of the network.
    pub(crate) fn has_mean(&self) -> bool {
        self.is_sum() || self.is_part() || self.is_of_network()
    }

    /// Its value in a sample; NaN in samples without it.
    pub(crate) fn value(&self, sample: &Sample) -> Value {
        let mut copy = *sample;
        match self.place {
            Real(number) => Value::Number(*number(&mut copy)),
            Count(count) => Value::Count(u64::from(*count(&mut copy))),
            Total(count) => Value::Count(*count(&mut copy)),
            Sum(sum) => Value::Number(sum(&copy.stress)),
            Part(part) => Value::Number(*part(&mut copy.stress)),
            Network(number) => {
                let network = &mut copy.network.unwrap_or(NetworkSample::NONE);
                Value::Number(*number(network))
            }
        }
    }
}

/// The numbers of which results have means, in the order of their columns.
pub(crate) fn means() -> impl Iterator<Item = &'static Number> {
    NUMBERS.iter().filter(|number| number.has_mean())
}

/// The number of this name.
pub(crate) fn named(name: &str) -> Option<&'static Number> {
    NUMBERS.iter().find(|number| number.name == name)
}

/// A list of names for a statement, each between a prefix and a suffix.
pub(crate) fn listed(which: fn(&Number) -> bool, before: &str, after: &str) -> String {
    let some = NUMBERS.iter().filter(|number| which(number));
    let names: Vec<String> = some
        .map(|number| format!("{before}{}{after}", number.name))
        .collect();
    names.join(", ")
}

/// A number of a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Its name in the store and in tables.
    pub name: &'static str,
    /// Its meaning.
    pub value: Value,
}

impl Field {
    fn of(number: &Number, sample: &Sample) -> Self {
        Self {
            name: number.name,
            value: number.value(sample),
        }
    }
}

/// All stored numbers of a sample.
pub fn fields(sample: &Sample) -> Vec<Field> {
    let kept = NUMBERS.iter().filter(|number| number.is_kept());
    kept.map(|number| Field::of(number, sample)).collect()
}

/// The numbers of a sample and the components of the stress derived from it, by the names of the
/// columns of samples.
pub fn sample_fields(sample: &Sample) -> Vec<Field> {
    let all = NUMBERS.iter();
    all.map(|number| Field::of(number, sample)).collect()
}

/// Whether a field belongs to the contact network, which most samples lack.
pub fn is_of_network(field: &Field) -> bool {
    named(field.name).is_some_and(Number::is_of_network)
}

/// The sample whose fields, by their places in [`fields`], are these.
///
/// # Errors
/// Those of `number` and `count`.
pub(crate) fn read<E>(
    number: impl Fn(usize) -> Result<f64, E>,
    count: impl Fn(usize) -> Result<u64, E>,
) -> Result<Sample, E> {
    let mut sample = Sample::default();
    let (mut network, mut is_seen) = (NetworkSample::NONE, false);
    let kept = NUMBERS.iter().filter(|number| number.is_kept());
    for (place, of) in kept.enumerate() {
        match of.place {
            Real(of) => *of(&mut sample) = number(place)?,
            Count(of) => *of(&mut sample) = u32::try_from(count(place)?).unwrap_or(u32::MAX),
            Total(of) => *of(&mut sample) = count(place)?,
            Part(of) => *of(&mut sample.stress) = number(place)?,
            Sum(_) => {}
            Network(of) => {
                let value = number(place)?;
                is_seen |= !value.is_nan();
                *of(&mut network) = value;
            }
        }
    }
    sample.network = is_seen.then_some(network);
    Ok(sample)
}

/// A table of samples, each with its step in the first column, whose other columns are these
/// fields.
pub(crate) fn numbered(
    samples: &[(u64, Sample)],
    fields: impl Fn(&Sample) -> Vec<Field>,
) -> Vec<DataColumn> {
    let rows = samples.len();
    let mut steps = DataColumn::named("step", Kind::Count, rows);
    let mut columns: Vec<DataColumn> = fields(&Sample::default())
        .into_iter()
        .map(|field| DataColumn::named(field.name, field.value.kind(), rows))
        .collect();
    for (step, sample) in samples {
        steps.cells.push(Some(Value::Count(*step)));
        for (column, field) in columns.iter_mut().zip(fields(sample)) {
            column.cells.push(Some(field.value));
        }
    }
    columns.insert(0, steps);
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Cells;

    #[test]
    fn samples_are_a_table_with_the_columns_of_the_store() {
        let sample = Sample {
            viscosity: f64::NAN,
            minimum_gap: f64::INFINITY,
            contacts: 7,
            ..Sample::default()
        };
        let table = numbered(&[(40, sample)], fields);
        let cells = |name: &str| &table.iter().find(|c| c.name == name).unwrap().cells;
        assert_eq!(*cells("step"), Cells::Count(vec![Some(40)]));
        assert_eq!(*cells("contacts"), Cells::Count(vec![Some(7)]));
        assert_eq!(*cells("viscosity"), Cells::Number(vec![None]));
        let infinite = Cells::Number(vec![Some(f64::INFINITY)]);
        assert_eq!(*cells("minimum_gap"), infinite);
        assert_eq!(*cells("minimum_gap_so_far"), infinite);
        let none = numbered(&[], fields);
        assert_eq!(none.len(), table.len());
        assert!(none.iter().all(|column| column.cells.is_empty()));
    }

    #[test]
    fn numbers_come_back_and_parts_add_up_to_what_they_are_parts_of() {
        let number = |place| Ok::<_, ()>(place as f64 + 1.0);
        let sample = read(number, |place| Ok(place as u64)).unwrap();
        for (place, field) in fields(&sample).into_iter().enumerate() {
            let expected = match field.value {
                Value::Count(_) => Value::Count(place as u64),
                _ => Value::Number(place as f64 + 1.0),
            };
            assert_eq!(field.value, expected, "{}", field.name);
        }
        let value = |number: &Number| number.value(&sample).number();
        for column in NUMBERS.iter().filter(|number| number.is_sum()) {
            let begins = format!("{}_", column.name);
            let parts = NUMBERS.iter().filter(|number| number.is_part());
            let sum: f64 = parts
                .filter(|part| part.name.starts_with(&begins))
                .map(value)
                .sum();
            assert_eq!(value(column), sum, "{}", column.name);
        }
        let unseen = read(|_| Ok::<_, ()>(f64::NAN), |_| Ok(0)).unwrap();
        assert_eq!(unseen.network, None);
    }

    #[test]
    fn each_has_a_name_of_its_own_and_a_meaning() {
        for number in &NUMBERS {
            let of_name = NUMBERS.iter().filter(|other| other.name == number.name);
            assert_eq!(of_name.count(), 1, "{}", number.name);
            assert!(!number.meaning.is_empty(), "{}", number.name);
        }
        assert_eq!(means().count(), MEANS);
    }
}
