//! Published laws and points that figures show beside results, from one file of data.

use super::error::ReportError;
use super::selection::meant;
use crate::model::axes::Axis;
use sd_core::Params;
use serde::Deserialize;
use std::sync::LazyLock;

/// The file: name, source, what it is about, whether its numbers were written from memory, and its
/// curves, each a formula in `x` or points, with the range that it holds in.
const FILE: &str = include_str!("references.json");

static REFERENCES: LazyLock<Vec<Reference>> =
    LazyLock::new(|| serde_json::from_str(FILE).expect("a test reads the file"));

/// A publication.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    pub(super) name: String,
    pub(super) source: String,
    about: String,
    pub(super) from_memory: bool,
    /// `suspension` or `layer`.
    pub(super) space: String,
    pub(super) flow: String,
    pub(super) curves: Vec<ReferenceCurve>,
}

/// One of its curves.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReferenceCurve {
    /// Columns of points.
    pub(super) y: String,
    pub(super) x: String,
    friction: Option<f64>,
    formula: Option<String>,
    #[serde(default)]
    pub(super) points: Vec<[f64; 2]>,
    pub(super) range: [f64; 2],
}

impl Reference {
    /// The publication of this name.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on an unknown name, and on one of which no curve is known.
    pub fn named(name: &str) -> Result<&'static Self, ReportError> {
        let refused = |message| ReportError::argument("reference", message);
        let names = || REFERENCES.iter().map(|known| known.name.as_str());
        let found = REFERENCES.iter().find(|known| known.name == name);
        let found = found.ok_or_else(|| {
            let known: Vec<&str> = names().collect();
            refused(format!(
                "there is none of {name:?}{}; there are {}",
                meant(name, names()),
                known.join(", ")
            ))
        })?;
        if found.curves.is_empty() {
            let Self { source, about, .. } = found;
            return Err(refused(format!("{name} has no curve: {source}; {about}")));
        }
        Ok(found)
    }

    /// Why it cannot be compared with points of these parameters, if it cannot.
    pub(super) fn refuses<'p>(&self, params: impl Iterator<Item = &'p Params>) -> Option<String> {
        for params in params {
            let space = match params.volume_fraction {
                Some(_) => "suspension",
                None => "layer",
            };
            if space != self.space {
                return Some(format!(
                    "of a {}, and points here are of a {space}",
                    self.space
                ));
            }
            let is_oscillation = params
                .segments
                .last()
                .is_some_and(|last| last.amplitude.is_some());
            let flow = Axis::of_key("flow").map(|axis| axis.value(params).to_string());
            let flow = if is_oscillation {
                Some("oscillation".into())
            } else {
                flow
            };
            if let Some(flow) = flow.filter(|flow| *flow != self.flow) {
                return Some(format!(
                    "of steady {}, and points here are of {flow}",
                    self.flow
                ));
            }
        }
        None
    }

    /// What it can be drawn beside.
    pub(super) fn offers(&self) -> String {
        let mut words: Vec<String> = Vec::new();
        for curve in &self.curves {
            let word = format!("{} against {}", curve.y, curve.x);
            if !words.contains(&word) {
                words.push(word);
            }
        }
        words.join(", ")
    }
}

impl ReferenceCurve {
    /// Its name in a legend.
    pub(super) fn label(&self, of: &Reference) -> String {
        let friction = self.friction.map(|friction| format!(", ν = {friction}"));
        let memory = if of.from_memory { ", from memory" } else { "" };
        format!("{}{}{memory}", of.name, friction.unwrap_or_default())
    }

    /// Its value; `None` of points, and outside its range.
    pub(super) fn value(&self, x: f64) -> Option<f64> {
        let formula = self.formula.as_ref()?;
        let is_inside = (self.range[0]..=self.range[1]).contains(&x);
        evaluated(formula, x).filter(|value| is_inside && value.is_finite())
    }
}

/// The value of a formula of numbers, `x`, `+ - * /`, `**`, `sqrt` and `exp`, in the syntax of
/// Python; `None` if it is none.
fn evaluated(formula: &str, x: f64) -> Option<f64> {
    let mut rest = formula;
    let value = sum(&mut rest, x)?;
    rest.trim().is_empty().then_some(value)
}

/// Takes a sign off the rest of a formula, if it is there.
fn take(rest: &mut &str, sign: &str) -> bool {
    let after = rest.trim_start().strip_prefix(sign);
    *rest = after.unwrap_or(rest);
    after.is_some()
}

fn sum(rest: &mut &str, x: f64) -> Option<f64> {
    let mut value = product(rest, x)?;
    loop {
        if take(rest, "+") {
            value += product(rest, x)?;
        } else if take(rest, "-") {
            value -= product(rest, x)?;
        } else {
            return Some(value);
        }
    }
}

fn product(rest: &mut &str, x: f64) -> Option<f64> {
    let mut value = signed(rest, x)?;
    loop {
        if take(rest, "*") {
            value *= signed(rest, x)?;
        } else if take(rest, "/") {
            value /= signed(rest, x)?;
        } else {
            return Some(value);
        }
    }
}

/// A power binds more closely than the sign before it, and less than the one after it.
fn signed(rest: &mut &str, x: f64) -> Option<f64> {
    if take(rest, "-") {
        return Some(-signed(rest, x)?);
    }
    let base = atom(rest, x)?;
    if take(rest, "**") {
        return Some(base.powf(signed(rest, x)?));
    }
    Some(base)
}

fn atom(rest: &mut &str, x: f64) -> Option<f64> {
    for (name, of) in [
        ("sqrt", f64::sqrt as fn(f64) -> f64),
        ("exp", f64::exp),
        ("", |y| y),
    ] {
        let before = *rest;
        if take(rest, name) && take(rest, "(") {
            let value = of(sum(rest, x)?);
            return take(rest, ")").then_some(value);
        }
        *rest = before;
    }
    if take(rest, "x") {
        return Some(x);
    }
    let text = rest.trim_start();
    let is_digit = |sign: char| sign.is_ascii_digit() || sign == '.';
    let (number, after) = text.split_at(text.find(|sign| !is_digit(sign)).unwrap_or(text.len()));
    *rest = after;
    number.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::numbers::Number;

    #[test]
    fn formulas_mean_what_they_do_in_python() {
        for (formula, x, value) in [
            ("1 + 2*x**2 - 3/4", 3.0, 18.25),
            ("-x**2", 3.0, -9.0),
            ("2**-x", 2.0, 0.25),
            ("2**3**x", 2.0, 512.0),
            ("8/4/2", 0.0, 1.0),
            ("(1 - x/0.5)**-2", 0.25, 4.0),
            ("sqrt(16)*exp(0*x) - -x", 1.0, 5.0),
        ] {
            assert_eq!(evaluated(formula, x), Some(value), "{formula}");
        }
        for wrong in ["", "1 +", "(1", "2 x", "sin(x)", "1..2"] {
            assert_eq!(evaluated(wrong, 1.0), None, "{wrong}");
        }
    }

    #[test]
    fn every_reference_is_of_known_columns_and_holds_in_its_range() {
        for reference in REFERENCES.iter() {
            assert!(["suspension", "layer"].contains(&reference.space.as_str()));
            for curve in &reference.curves {
                for column in [&curve.x, &curve.y] {
                    assert!(
                        Number::named(column).is_some() || Axis::of_key(column).is_some(),
                        "{column}"
                    );
                }
                assert_eq!(curve.formula.is_some(), curve.points.is_empty());
                let is_known = |x| curve.points.iter().any(|point| point[0] == x);
                for x in curve.range {
                    assert!(curve.value(x).is_some() || is_known(x), "{curve:?}");
                }
            }
        }
    }

    #[test]
    fn curves_of_boyer_are_those_of_their_law_and_agree_with_each_other() {
        let boyer = Reference::named("boyer2011").unwrap();
        let value = |y: &str, x: f64| {
            let curve = boyer.curves.iter().find(|curve| curve.y == y).unwrap();
            curve.value(x).unwrap()
        };
        for phi in [0.45_f64, 0.5, 0.56] {
            let j = (0.585 / phi - 1.0).powi(2);
            let mu = 0.32 + 0.38 / (1.0 + 0.005 / j) + j + 2.5 * 0.585 * j.sqrt();
            assert!((value("macroscopic_friction", j) - mu).abs() < 1e-12);
            assert!((value("volume_fraction", j) - phi).abs() < 1e-12);
            assert!((value("viscosity", phi) * j / mu - 1.0).abs() < 1e-12);
            assert!((value("normal_viscosity", phi) * j - 1.0).abs() < 1e-12);
        }
        assert!((value("viscosity", 0.45) - 13.4).abs() < 0.05);
    }

    #[test]
    fn what_is_not_known_is_said() {
        let error = |name| Reference::named(name).unwrap_err().to_string();
        assert!(error("boyer2012").contains("did you mean boyer2011?"));
        assert!(error("seto2018").contains("not at hand"));
    }
}
