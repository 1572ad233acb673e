//! The seeds of a grid: a count, a list, or as many as a precision needs.

use super::CASE_LIMIT;
use super::error::Problem;
use super::reader::{Table, number, values, whole, word, wrong_type};
use crate::data::Value;
use crate::model::precision::{Precision, Quantity};
use sd_core::model::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The key of the seeds.
pub(super) const SEEDS: &str = "seeds";
/// Allowed precisions.
const PRECISION: Range = Range::above_to(0.0, 1.0);
/// Fewest seeds of a first batch: two are too few to estimate a scatter.
const LEAST: u64 = 3;
/// Default number of seeds of the first batch.
const DEFAULT_AT_LEAST: u64 = 4;
/// Default maximum number of seeds.
const DEFAULT_AT_MOST: u64 = 64;

/// The seeds of every point of a grid.
#[derive(Debug)]
pub(super) enum Seeds {
    /// A fixed list.
    List(Vec<u64>),
    /// 1, 2, … until the precision is reached.
    Until(Precision),
}

impl Seeds {
    /// Reads a count n (seeds 1, 2, … n), a list of seeds, or a table with a precision.
    pub(super) fn read(written: &Spanned<DeValue<'_>>, problems: &mut Vec<Problem>) -> Self {
        let count = |written: &Spanned<DeValue<'_>>, low, high| {
            let range = Range::from_to(low, high);
            whole(written, SEEDS, &range, &format!("from {low} to {high}"))
        };
        match written.get_ref() {
            DeValue::Table(entries) => Self::until(entries, written, problems),
            DeValue::Array(_) => {
                let read = |written: &Spanned<DeValue<'_>>| {
                    count(written, 0.0, f64::from(u32::MAX)).map(Value::Count)
                };
                let list = values(written, SEEDS, problems, read);
                let counts = list.into_iter().flat_map(|values| values.all);
                Self::List(
                    counts
                        .filter_map(|seed| match seed.value {
                            Value::Count(seed) => Some(seed),
                            Value::Word(_) | Value::Number(_) => None,
                        })
                        .collect(),
                )
            }
            DeValue::Integer(_) => match count(written, 1.0, CASE_LIMIT as f64) {
                Ok(number) => Self::List((1..=number).collect()),
                Err(problem) => {
                    problems.push(problem);
                    Self::List(Vec::new())
                }
            },
            _ => {
                problems.push(wrong_type(
                    written,
                    SEEDS,
                    "`seeds` is a count, a list, or { precision = 0.05, at_least = 4, at_most = 64 }",
                ));
                Self::List(Vec::new())
            }
        }
    }

    /// Reads a precision.
    fn until(
        entries: &DeTable<'_>,
        written: &Spanned<DeValue<'_>>,
        problems: &mut Vec<Problem>,
    ) -> Self {
        let known = ["precision", "quantity", "at_least", "at_most"];
        let table = Table::new(entries, written.span(), "`seeds`", &known, problems);
        let mut note = |problem: Problem| problems.push(problem);
        let precision = if let Some(written) = table.get("precision") {
            let allowed = format!("{PRECISION}: half the 95 % interval over the mean");
            number(written, "precision", &PRECISION, &allowed).unwrap_or_else(|problem| {
                note(problem);
                1.0
            })
        } else {
            if let Some(problem) = table.missing("precision", "0.05") {
                note(problem);
            }
            1.0
        };
        let quantity = match table.get("quantity") {
            None => Quantity::Viscosity,
            Some(written) => {
                let names = Quantity::ALL.map(Quantity::name);
                match word(written, "quantity", &names) {
                    Ok(name) => Quantity::of_name(name).unwrap_or(Quantity::Viscosity),
                    Err(problem) => {
                        note(problem);
                        Quantity::Viscosity
                    }
                }
            }
        };
        let mut seeds = |key: &str, least: u64, usual: u64| {
            let Some(written) = table.get(key) else {
                return usual.max(least);
            };
            let range = Range::from_to(least as f64, CASE_LIMIT as f64);
            whole(
                written,
                key,
                &range,
                &format!("from {least} to {CASE_LIMIT}"),
            )
            .unwrap_or_else(|problem| {
                note(problem);
                least
            })
        };
        let at_least = seeds("at_least", LEAST, DEFAULT_AT_LEAST);
        let at_most = seeds("at_most", at_least, DEFAULT_AT_MOST);
        let places = |seeds: u64| usize::try_from(seeds).unwrap_or(usize::MAX);
        Self::Until(Precision {
            precision,
            quantity,
            at_least: places(at_least),
            at_most: places(at_most),
        })
    }

    /// The maximum number of seeds of a point.
    pub(super) fn most(&self) -> u64 {
        match self {
            Self::List(seeds) => seeds.len() as u64,
            Self::Until(rule) => rule.at_most as u64,
        }
    }

    /// All possible seeds of a point, in order.
    pub(super) fn all(&self) -> Box<dyn Iterator<Item = u64> + '_> {
        match self {
            Self::List(seeds) => Box::new(seeds.iter().copied()),
            Self::Until(_) => Box::new(1..=self.most()),
        }
    }

    /// The requested precision.
    pub(super) fn rule(&self) -> Option<Precision> {
        match self {
            Self::List(_) => None,
            Self::Until(rule) => Some(*rule),
        }
    }
}
