//! The axes of a campaign: what tells its points apart. Tables, figures and selections all go by this one list.

use super::text::{contact, hydrodynamics, onset, tangential};
use sd_core::{ContactLaws, Params};
use std::fmt;

/// What tells points apart: everything that decides a run, but for its seed.
#[derive(Debug)]
pub struct Axis {
    /// Its key in campaign files, and its column in tables.
    pub key: &'static str,
    /// Its symbol, the heading of its column on a terminal.
    pub symbol: &'static str,
    /// Its unit; `1` where there is none, nothing for words.
    pub unit: &'static str,
    /// Its meaning, to a semicolon its label on a figure.
    pub meaning: &'static str,
    /// Its value.
    pub(crate) read: Read,
}

/// How a value is had from parameters.
#[derive(Debug)]
pub(crate) enum Read {
    /// A choice, by its word in campaign files.
    Word(fn(&Params) -> &'static str),
    /// A whole number.
    Count(fn(&Params) -> u64),
    /// A number, possibly infinite.
    Number(fn(&Params) -> f64),
}

/// A value in a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A choice, by its word in campaign files.
    Word(&'static str),
    /// A whole number.
    Count(u64),
    /// A number, possibly infinite.
    Number(f64),
}

/// Shorthand for [`AXES`].
const fn axis(
    key: &'static str,
    symbol: &'static str,
    unit: &'static str,
    meaning: &'static str,
    read: Read,
) -> Axis {
    Axis {
        key,
        symbol,
        unit,
        meaning,
        read,
    }
}

/// All axes, in the order of the columns.
#[rustfmt::skip]
pub static AXES: [Axis; 18] = [
    axis("hydrodynamics", "hydrodynamics", "", "how the grand resistance is made", Read::Word(|p| hydrodynamics(p.hydrodynamics))),
    axis("contact", "contact", "", "contact scheme", Read::Word(|p| contact(&p.contact))),
    axis("tangential", "tangential", "", "tangential law", Read::Word(|p| tangential(p.contact.laws().tangential))),
    axis("friction_onset", "onset", "", "how friction begins with the load", Read::Word(|p| onset(p.contact.laws().onset))),
    axis("spheres", "N", "1", "number of spheres N", Read::Count(|p| p.spheres as u64)),
    axis("area_fraction", "c", "1", "area fraction c", Read::Number(|p| p.area_fraction)),
    axis("size_ratio", "size ratio", "1", "radius of large over small spheres", Read::Number(|p| p.size_ratio)),
    axis("large_fraction", "large", "1", "large spheres over all", Read::Number(|p| p.large_fraction)),
    axis("roughness", "h", "a", "roughness height h", Read::Number(|p| p.roughness)),
    axis("friction", "ν", "1", "friction coefficient ν", Read::Number(|p| p.friction)),
    axis("stiffness", "k", "F_crit/a", "stiffness k of contacts; inf is rigid", Read::Number(|p| p.contact.laws().stiffness)),
    axis("tangential_stiffness", "k_t/k", "1", "tangential over normal stiffness", Read::Number(|p| p.contact.laws().tangential_stiffness)),
    axis("dashpot", "dashpot", "mu a", "dashpot of contacts", Read::Number(|p| p.contact.laws().dashpot)),
    axis("lubrication_gap", "g_min", "a", "gap below which lubrication is constant", Read::Number(|p| p.contact.laws().lubrication_gap)),
    axis("repulsion", "F0", "F_crit", "repulsion F0", Read::Number(|p| p.contact.laws().repulsion)),
    axis("repulsion_length", "l", "a", "decay length of the repulsion", Read::Number(|p| p.contact.laws().repulsion_length)),
    axis("time_step", "Δt", "strain", "time step Δt", Read::Number(|p| p.time_step)),
    axis("shear_rate", "Γ", "1", "shear rate Γ; inf is the upper plateau", Read::Number(|p| p.shear_rate)),
];

impl Axis {
    /// The axis with this key, its words joined by `_` or `-`.
    pub fn of_key(key: &str) -> Option<&'static Self> {
        let key = key.replace('-', "_");
        AXES.iter().find(|axis| axis.key == key)
    }

    /// Its value.
    pub fn value(&self, params: &Params) -> Value {
        match self.read {
            Read::Word(read) => Value::Word(read(params)),
            Read::Count(read) => Value::Count(read(params)),
            Read::Number(read) => Value::Number(read(params)),
        }
    }

    /// Its place on a line; not a number for words.
    pub fn number(&self, params: &Params) -> f64 {
        match self.value(params) {
            Value::Word(_) => f64::NAN,
            Value::Count(count) => count as f64,
            Value::Number(number) => number,
        }
    }

    /// Its label on a figure.
    pub(super) fn label(&self) -> String {
        let label = self.meaning.split(';').next().unwrap_or(self.meaning);
        match self.unit {
            "" | "1" => label.into(),
            unit => format!("{label} ({unit})"),
        }
    }

    /// Whether its values lie on a line.
    pub fn is_numeric(&self) -> bool {
        !matches!(self.read, Read::Word(_))
    }

    /// Whether its values are drawn by their logarithm, 0 and infinity at its ends.
    pub fn is_logarithmic(&self) -> bool {
        self.is_shear_rate() || self.key == "stiffness"
    }

    /// Whether it is the axis of shear rates.
    pub fn is_shear_rate(&self) -> bool {
        self.key == "shear_rate"
    }

    /// Whether it says anything about some of these parameters: sizes do not of equal spheres, laws not under the paper's.
    pub fn matters<'p>(&self, mut params: impl Iterator<Item = &'p Params>) -> bool {
        match self.key {
            "size_ratio" | "large_fraction" => params.any(|p| p.size_ratio > 1.0),
            "tangential" | "friction_onset" => {
                params.any(|p| *p.contact.laws() != ContactLaws::PAPER)
            }
            "stiffness" => params.any(|p| self.number(p).is_finite()),
            "tangential_stiffness"
            | "dashpot"
            | "lubrication_gap"
            | "repulsion"
            | "repulsion_length" => params.any(|p| self.number(p) > 0.0),
            _ => true,
        }
    }

    /// Whether it says anything about a point: numbers that only some laws have are 0 under the others.
    pub fn has_meaning(&self, params: &Params) -> bool {
        match self.key {
            "tangential_stiffness" | "lubrication_gap" | "repulsion_length" => {
                self.number(params) > 0.0
            }
            _ => true,
        }
    }

    /// Whether some of these parameters have another value on it than the others, where it has a meaning.
    pub fn varies<'p>(&self, params: impl Iterator<Item = &'p Params>) -> bool {
        let mut params = params.filter(|p| self.has_meaning(p));
        let first = params.next().map(|p| self.value(p));
        params.any(|p| Some(self.value(p)) != first)
    }
}

impl Value {
    /// Order of values of one axis.
    pub(super) fn order(&self, other: &Self) -> std::cmp::Ordering {
        match (self, other) {
            (Self::Word(a), Self::Word(b)) => a.cmp(b),
            (Self::Count(a), Self::Count(b)) => a.cmp(b),
            (Self::Number(a), Self::Number(b)) => a.total_cmp(b),
            _ => std::cmp::Ordering::Equal,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Word(word) => f.write_str(word),
            Self::Count(count) => write!(f, "{count}"),
            Self::Number(number) => write!(f, "{number}"),
        }
    }
}

/// What is the same for all runs of a point, and for no other.
pub(crate) type Identity = [Tag; AXES.len()];

/// A value by its bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Tag {
    /// A word.
    Word(&'static str),
    /// Bits of a number.
    Bits(u64),
}

/// The identity of the point of a run.
pub(crate) fn identity(params: &Params) -> Identity {
    AXES.each_ref().map(|axis| match axis.value(params) {
        Value::Word(word) => Tag::Word(word),
        Value::Count(count) => Tag::Bits(count),
        Value::Number(number) => Tag::Bits(number.to_bits()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    #[test]
    fn every_parameter_is_an_axis() {
        // A parameter that is none would have its points averaged together.
        let written = serde_json::to_value(params()).unwrap();
        for key in written.as_object().unwrap().keys() {
            assert!(Axis::of_key(key).is_some(), "{key}");
        }
        for key in serde_json::to_value(ContactLaws::PAPER)
            .unwrap()
            .as_object()
            .unwrap()
            .keys()
        {
            let key = match key.as_str() {
                "normal" => "contact",
                "onset" => "friction_onset",
                same => same,
            };
            assert!(Axis::of_key(key).is_some(), "{key}");
        }
    }
}
