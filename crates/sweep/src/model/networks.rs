//! Numbers of the network of contacts that a run may sample: name and place of each, declared once. What they are stands in
//! [`crate::structure::NAMED`].

use sd_core::Sample;
use sd_core::simulation::NetworkSample;

/// One of them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NetworkColumn {
    /// Its name in the store, in tables and in JSON.
    pub(crate) name: &'static str,
    place: fn(&mut NetworkSample) -> &mut f64,
}

const fn number(name: &'static str, place: fn(&mut NetworkSample) -> &mut f64) -> NetworkColumn {
    NetworkColumn { name, place }
}

/// How many there are.
pub(crate) const NETWORK_COUNT: usize = 6;

/// All of them, in the order of the columns.
#[rustfmt::skip]
pub(crate) static NETWORK: [NetworkColumn; NETWORK_COUNT] = [
    number("coordination", |n| &mut n.coordination),
    number("frictional_coordination", |n| &mut n.frictional_coordination),
    number("largest_cluster", |n| &mut n.largest_cluster),
    number("percolating_x", |n| &mut n.percolating_x),
    number("percolating_y", |n| &mut n.percolating_y),
    number("core_fraction", |n| &mut n.core_fraction),
];

impl NetworkColumn {
    /// Its value in a sample; not a number in one that has none.
    pub(crate) fn read(&self, sample: &Sample) -> f64 {
        *(self.place)(&mut sample.network.unwrap_or(NetworkSample::NONE))
    }
}

/// The numbers whose values are these, in the order of [`NETWORK`]; `None` where none of them is a number.
pub(crate) fn of_values(values: &[f64]) -> Option<NetworkSample> {
    let mut network = NetworkSample::NONE;
    for (column, value) in NETWORK.iter().zip(values) {
        *(column.place)(&mut network) = *value;
    }
    values
        .iter()
        .any(|value| !value.is_nan())
        .then_some(network)
}

/// Names with something before each, as in a list of a statement.
pub(crate) fn names(before: &str) -> String {
    NETWORK
        .map(|column| format!("{before}{}", column.name))
        .join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_and_each_has_a_meaning() {
        let numbers: Vec<f64> = (1..=NETWORK_COUNT).map(|n| n as f64).collect();
        let sample = Sample {
            network: of_values(&numbers),
            ..Sample::default()
        };
        assert_eq!(NETWORK.map(|column| column.read(&sample)).to_vec(), numbers);
        assert_eq!(of_values(&[f64::NAN; NETWORK_COUNT]), None);
        for column in &NETWORK {
            let named = crate::structure::NAMED.iter();
            assert_eq!(named.filter(|known| known.name == column.name).count(), 1);
        }
    }
}
