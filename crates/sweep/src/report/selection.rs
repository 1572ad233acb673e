//! Selection of points of a campaign: `--where KEY=VALUE[,VALUE..]`, where a value may be a range.

use super::error::ReportError;
use super::units::Units;
use crate::campaign::nearest;
use crate::data::Value;
use crate::measure::PointRun;
use crate::model::axes::{AXES, Axis};
use crate::store::Store;
use sd_core::Params;
use std::fmt;

/// The selected points: those with one of the given values on every axis named; by default all.
#[derive(Debug, Clone, Default)]
pub struct Selection {
    /// Axes and the requested values.
    wanted: Vec<(&'static Axis, Vec<RequestedValue>)>,
    /// Whether runs with doubtful numbers are averaged too.
    pub(super) with_doubtful: bool,
}

/// The part of a store that is shown.
#[derive(Debug, Clone, Copy)]
pub struct Excerpt<'s> {
    /// The store.
    pub store: &'s Store,
    /// The selected points.
    pub selection: &'s Selection,
    /// The units of the numbers.
    pub units: Units,
}

/// A requested value.
#[derive(Debug, Clone)]
enum RequestedValue {
    /// A keyword.
    Word(String),
    /// A range of numbers, whose ends may be equal.
    Numbers(f64, f64),
}

impl Selection {
    /// Reads `KEY=VALUE[,VALUE..]`; values of a repeated key are combined.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on a key that is not an axis, on a missing value, on a value that
    /// should be a number.
    pub fn parse(texts: &[String]) -> Result<Self, ReportError> {
        let mut selection = Self::default();
        for text in texts {
            let (key, values) = text.split_once('=').ok_or_else(|| {
                refused(format!(
                    "{text:?} is not KEY=VALUE, as in friction=0.3 or shear_rate=0.1,inf"
                ))
            })?;
            let axis = Axis::named(key.trim()).ok_or_else(|| {
                let known = AXES.iter().map(|axis| axis.key).collect::<Vec<_>>();
                let meant = meant(key.trim(), known.iter().copied());
                refused(format!(
                    "{key:?} is not an axis of a campaign{meant}; the axes are {}, also by their symbols",
                    known.join(", ")
                ))
            })?;
            let values = values.split(',').map(str::trim);
            let values = values.map(|value| RequestedValue::read(axis, value));
            let values = values.collect::<Result<Vec<_>, _>>()?;
            match selection.wanted.iter_mut().find(|w| w.0.key == axis.key) {
                Some((_, known)) => known.extend(values),
                None => selection.wanted.push((axis, values)),
            }
        }
        Ok(selection)
    }

    /// Selects runs with doubtful numbers for averages, or leaves them out.
    #[must_use]
    pub fn with_doubtful(self, with_doubtful: bool) -> Self {
        Self {
            with_doubtful,
            ..self
        }
    }

    /// Whether averages include a run.
    pub(super) fn averages(&self, run: &PointRun) -> bool {
        run.is_sound() || (self.with_doubtful && run.is_doubtful())
    }

    /// Whether all points are selected.
    pub fn is_everything(&self) -> bool {
        self.wanted.is_empty()
    }

    /// Whether the point of these parameters is selected.
    pub fn has(&self, params: &Params) -> bool {
        self.wanted.iter().all(|(axis, values)| {
            let value = axis.value(params);
            values.iter().any(|wanted| wanted.is(value))
        })
    }

    /// Checks that every requested value occurs at some point of the campaign, and all of them at
    /// some point.
    ///
    /// # Errors
    /// [`ReportError::Argument`] with the available values.
    pub fn check(&self, params: &[&Params]) -> Result<(), ReportError> {
        for (axis, values) in &self.wanted {
            for wanted in values {
                if params.iter().any(|p| wanted.is(axis.value(p))) {
                    continue;
                }
                let mut there = axis.distinct(params.iter().copied());
                if there.is_empty() {
                    return Err(refused("the campaign has no points"));
                }
                there.sort_by(Value::order);
                let there: Vec<String> = there.iter().map(Value::to_string).collect();
                return Err(refused(format!(
                    "no point has {} = {wanted}; available: {}",
                    axis.key,
                    there.join(", ")
                )));
            }
        }
        if !self.is_everything() && !params.iter().any(|p| self.has(p)) {
            return Err(refused(format!("no point has {self} together")));
        }
        Ok(())
    }
}

/// As text: `friction = 0.3, shear_rate = 0.1 or inf`.
impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, (axis, values)) in self.wanted.iter().enumerate() {
            let values: Vec<String> = values.iter().map(RequestedValue::to_string).collect();
            let comma = if place > 0 { ", " } else { "" };
            write!(f, "{comma}{} = {}", axis.key, values.join(" or "))?;
        }
        Ok(())
    }
}

impl RequestedValue {
    /// Reads a value on an axis.
    fn read(axis: &Axis, text: &str) -> Result<Self, ReportError> {
        if text.is_empty() {
            return Err(refused(format!("the value of {} is missing", axis.key)));
        }
        if !axis.is_numeric() {
            return Ok(Self::Word(text.to_lowercase()));
        }
        let read = range(text).map(|[low, high]| Self::Numbers(low, high));
        read.ok_or_else(|| {
            refused(format!(
                "{} = {text:?} is neither a number nor a range such as 0.6..0.7, the lower end first",
                axis.key
            ))
        })
    }

    /// Whether a value matches; numbers up to the last digits of a decimal fraction.
    fn is(&self, value: Value) -> bool {
        let number = match value {
            Value::Word(word) => return matches!(self, Self::Word(wanted) if wanted == word),
            Value::Count(count) => count as f64,
            Value::Number(number) => number,
        };
        let is = |wanted: f64| {
            wanted == number
                || (number.is_finite() && (wanted - number).abs() <= 1e-12 * number.abs())
        };
        match self {
            Self::Word(_) => false,
            Self::Numbers(low, high) => is(*low) || is(*high) || (*low..=*high).contains(&number),
        }
    }
}

impl fmt::Display for RequestedValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Word(word) => f.write_str(word),
            Self::Numbers(low, high) if low == high => write!(f, "{low}"),
            Self::Numbers(low, high) => write!(f, "{low}..{high}"),
        }
    }
}

/// The name that was probably meant, for a message.
pub(super) fn meant<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> String {
    let nearest = nearest(name, known);
    nearest.map_or_else(String::new, |name| format!(" (did you mean {name}?)"))
}

/// Reads a range such as `0.01..100`; a single number is both ends.
pub(crate) fn range(text: &str) -> Option<[f64; 2]> {
    let (low, high) = text.split_once("..").unwrap_or((text, text));
    let end = |text: &str| text.trim().replace('∞', "inf").parse::<f64>().ok();
    let (low, high) = end(low).zip(end(high))?;
    (low <= high).then_some([low, high])
}

/// The error about the argument.
fn refused(message: impl Into<String>) -> ReportError {
    ReportError::argument("where", message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    fn selection(texts: &[&str]) -> Result<Selection, ReportError> {
        Selection::parse(&texts.iter().map(ToString::to_string).collect::<Vec<_>>())
    }

    #[test]
    fn values_of_a_key_are_alternatives_and_keys_go_together() {
        let at = |friction, shear_rate| Params {
            friction,
            shear_rate,
            ..params()
        };
        let some = selection(&["friction=0.1,0.3", "shear-rate = ∞", "friction=0.5"]).unwrap();
        assert!(some.has(&at(0.3, f64::INFINITY)) && some.has(&at(0.5, f64::INFINITY)));
        assert!(!some.has(&at(0.3, 1.0)) && !some.has(&at(0.2, f64::INFINITY)));
        assert_eq!(
            some.to_string(),
            "friction = 0.1 or 0.3 or 0.5, shear_rate = inf"
        );
        assert!(
            selection(&["contact=Rigid", "spheres=90"])
                .unwrap()
                .has(&params())
        );
        assert!(!selection(&["shear_rate=1"]).unwrap().has(&params()));
        assert!(Selection::default().has(&params()));
    }

    #[test]
    fn symbols_and_ranges_mean_what_keys_and_values_do() {
        let at = |area_fraction, shear_rate| Params {
            area_fraction,
            shear_rate,
            ..params()
        };
        for key in ["area_fraction", "c"] {
            let some = selection(&[&format!("{key}=0.6..0.7")]).unwrap();
            assert_eq!(some.to_string(), "area_fraction = 0.6..0.7");
            let has = [0.59, 0.6, 0.65, 0.7, 0.71].map(|c| some.has(&at(c, 1.0)));
            assert_eq!(has, [false, true, true, true, false], "{key}");
        }
        let some = selection(&["Γ=0,1..∞"]).unwrap();
        let has = [0.0, 0.5, 1.0, f64::INFINITY].map(|rate| some.has(&at(0.6, rate)));
        assert_eq!(has, [true, false, true, true]);
        for (symbol, key) in [
            ("φ", "volume_fraction"),
            ("phi", "volume_fraction"),
            ("ν", "friction"),
            ("nu", "friction"),
            ("h", "roughness"),
            ("N", "spheres"),
            ("Gamma", "shear_rate"),
            ("σ*", "shear_stress"),
            ("Δt", "time_step"),
        ] {
            let some = selection(&[&format!("{symbol}=1")]).unwrap();
            assert_eq!(some.to_string(), format!("{key} = 1"));
        }
        for wrong in ["c=0.7..0.6", "c=0.6..", "c=a..b"] {
            let error = selection(&[wrong]).unwrap_err().to_string();
            assert!(error.contains("0.6..0.7"), "{error}");
        }
    }

    #[test]
    fn errors_say_what_is_there() {
        let point = params();
        for (text, part) in [
            ("friction", "KEY=VALUE"),
            (
                "seed=3",
                "area_fraction, volume_fraction, sizes, size_ratio",
            ),
            ("friction=", "missing"),
            ("friction=nan", "neither a number"),
            ("friction=many", "neither a number"),
            (
                "friction=0.25",
                "no point has friction = 0.25; available: 0.3",
            ),
            ("contact=soft", "available: rigid"),
        ] {
            let error = selection(&[text])
                .and_then(|s| s.check(&[&point]))
                .unwrap_err()
                .to_string();
            assert!(error.contains(part), "{error}");
        }
        let none = selection(&["friction=0.3"]).unwrap().check(&[]);
        assert!(none.unwrap_err().to_string().contains("no points"));
    }

    #[test]
    fn values_that_never_meet_are_an_error() {
        let points = [0.1, 0.3].map(|friction| Params {
            friction,
            spheres: if friction < 0.2 { 90 } else { 40 },
            ..params()
        });
        let error = selection(&["friction=0.1", "spheres=40"])
            .unwrap()
            .check(&points.each_ref())
            .unwrap_err();
        assert!(error.to_string().contains("together"), "{error}");
    }
}
