//! A value of a table or of an axis, and its type.

use serde::{Serialize, Serializer};
use std::fmt;

/// A value of an axis or of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A choice, by its keyword in campaign files.
    Word(&'static str),
    /// A whole number.
    Count(u64),
    /// A number, possibly infinite.
    Number(f64),
}

/// Type of the values of an axis or of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Words.
    Word,
    /// Whole numbers.
    Count,
    /// Numbers, possibly infinite.
    Number,
}

/// A value by its bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Tag {
    /// A word.
    Word(&'static str),
    /// Bits of a number.
    Bits(u64),
}

impl Value {
    /// Type of the value.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Word(_) => Kind::Word,
            Self::Count(_) => Kind::Count,
            Self::Number(_) => Kind::Number,
        }
    }

    /// The value as a number; NaN for words.
    pub(crate) fn number(self) -> f64 {
        match self {
            Self::Word(_) => f64::NAN,
            Self::Count(count) => count as f64,
            Self::Number(number) => number,
        }
    }

    /// The value by its bits.
    pub(crate) fn tag(self) -> Tag {
        match self {
            Self::Word(word) => Tag::Word(word),
            Self::Count(count) => Tag::Bits(count),
            Self::Number(number) => Tag::Bits((number + 0.0).to_bits()),
        }
    }

    /// Order of values of one axis.
    pub fn order(&self, other: &Self) -> std::cmp::Ordering {
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

/// Infinity as `"inf"`, since JSON has no number for it.
impl Serialize for Value {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Number(number) if number.is_finite() => s.serialize_f64(*number),
            Self::Count(count) => s.serialize_u64(*count),
            value => s.collect_str(value),
        }
    }
}
