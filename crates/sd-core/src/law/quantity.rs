//! A physical quantity of the input: its key, unit and range, declared once.

use std::fmt;

/// An interval of numbers, used both for checks and for messages.
///
/// ```
/// use sd_core::model::Range;
///
/// let range = Range::from_to(0.0, 10.0);
/// assert!(range.contains(10.0) && !range.contains(f64::NAN));
/// assert_eq!(range.to_string(), "from 0 to 10");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    low: f64,
    high: f64,
    low_belongs: bool,
    high_belongs: bool,
}

impl Range {
    /// From `low` to `high`, both included.
    pub const fn from_to(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            low_belongs: true,
            high_belongs: true,
        }
    }

    /// From `low` to below `high`.
    pub const fn from_below(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            low_belongs: true,
            high_belongs: false,
        }
    }

    /// Above `low`, infinity included.
    pub const fn above(low: f64) -> Self {
        Self::above_to(low, f64::INFINITY)
    }

    /// Above `low` and at most `high`.
    pub const fn above_to(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            low_belongs: false,
            high_belongs: true,
        }
    }

    /// Above `low` and below `high`.
    pub const fn between(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            low_belongs: false,
            high_belongs: false,
        }
    }

    /// Whether a number lies in it; NaN never does.
    pub fn contains(&self, value: f64) -> bool {
        let above = value > self.low || (self.low_belongs && value == self.low);
        let below = value < self.high || (self.high_belongs && value == self.high);
        above && below
    }

    /// Its lower end.
    pub const fn low(&self) -> f64 {
        self.low
    }

    /// Its upper end.
    pub const fn high(&self) -> f64 {
        self.high
    }
}

/// As text: `from 0 to 10`, `above 0 and at most 0.84`, `above 0`.
impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (low, high) = (Short(self.low), Short(self.high));
        match (self.low_belongs, self.high_belongs) {
            (true, true) => write!(f, "from {low} to {high}"),
            (true, false) => write!(f, "from {low} to below {high}"),
            (false, true) if self.high.is_infinite() => write!(f, "above {low}"),
            (false, true) => write!(f, "above {low} and at most {high}"),
            (false, false) => write!(f, "above {low} and below {high}"),
        }
    }
}

/// A number, with an exponent where that is shorter.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (plain, exponent) = (format!("{}", self.0), format!("{:e}", self.0));
        f.write_str(if exponent.len() + 2 < plain.len() {
            &exponent
        } else {
            &plain
        })
    }
}

/// A physical quantity that a user may choose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Its key in files, tables and JSON.
    pub key: &'static str,
    /// Its unit; `1` for pure numbers, empty for keywords.
    pub unit: &'static str,
    /// Its meaning; up to a semicolon the label of an axis.
    pub meaning: &'static str,
    /// The values it may have.
    pub range: Range,
    /// A note to the range, such as the unit or the meaning of the ends.
    pub note: &'static str,
}

impl Quantity {
    /// Description of allowed values: the range and the note.
    pub fn allowed(&self) -> String {
        match self.note {
            "" => self.range.to_string(),
            note => format!("{} ({note})", self.range),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_says_what_it_checks() {
        for (range, words, inside, outside) in [
            (
                Range::from_to(0.0, 10.0),
                "from 0 to 10",
                vec![0.0, 10.0],
                vec![-1e-300, 10.1],
            ),
            (
                Range::above_to(0.0, 0.84),
                "above 0 and at most 0.84",
                vec![1e-300, 0.84],
                vec![0.0, 0.85],
            ),
            (
                Range::between(0.0, 0.5),
                "above 0 and below 0.5",
                vec![0.4],
                vec![0.0, 0.5],
            ),
            (
                Range::from_below(0.0, 0.5),
                "from 0 to below 0.5",
                vec![0.0, 0.4],
                vec![-1e-300, 0.5],
            ),
            (
                Range::above(0.0),
                "above 0",
                vec![1.0, f64::INFINITY],
                vec![0.0],
            ),
            (
                Range::from_to(1e-7, 1e6),
                "from 1e-7 to 1e6",
                vec![1e-7, 1e6],
                vec![1e-8, 1.1e6],
            ),
        ] {
            assert_eq!(range.to_string(), words);
            assert!(inside.iter().all(|value| range.contains(*value)), "{range}");
            assert!(
                !outside.iter().any(|value| range.contains(*value)),
                "{range}"
            );
            assert!(!range.contains(f64::NAN), "{range}");
        }
    }
}
