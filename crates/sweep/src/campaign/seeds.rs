//! The seeds of a grid: a count, a list, or as many as a precision needs.

use super::CASE_LIMIT;
use super::error::Problem;
use super::imposed_keys::keys_of;
use super::reader::{Reader, listed, values, whole, wrong_type};
use super::time_unit::{PECLET, has_rest};
use crate::data::Value;
use crate::model::axes::{AXES, Axis};
use crate::model::precision::{Precision, Quantity};
use sd_core::model::Range;
use toml::de::DeValue;

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
    /// Reads a count n (seeds 1, 2, … n), a list of seeds, or a table with a precision. Empty on a
    /// fault.
    pub(super) fn read(grid: &Reader<'_>) -> Self {
        let Some(written) = grid.need(SEEDS, "8") else {
            return Self::List(Vec::new());
        };
        let range = |low: u64, high: u64| {
            let words = range_words(low, high);
            (Range::from_to(low as f64, high as f64), words)
        };
        let seeds = match written.get_ref() {
            DeValue::Table(entries) => {
                let known = ["precision", QUANTITY, "at_least", "at_most"];
                let table = Reader::new(entries, written.span(), "`seeds`", &known, grid.faults);
                return Self::Until(precision(&table, grid));
            }
            DeValue::Array(_) => {
                let (range, allowed) = range(0, u32::MAX.into());
                let read = |one| whole(one, SEEDS, &range, &allowed).map(Value::Count);
                let list = listed(written);
                let list = values(&list, written.span(), SEEDS, grid.faults, read);
                let list = list.into_iter().flat_map(|values| values.all);
                let count = |value| match value {
                    Value::Count(seed) => Some(seed),
                    Value::Word(_) | Value::Number(_) => None,
                };
                list.filter_map(|seed| count(seed.value)).collect()
            }
            DeValue::Integer(_) => {
                let (range, allowed) = range(1, CASE_LIMIT);
                let count = grid.faults.ok(whole(written, SEEDS, &range, &allowed));
                (1..=count.unwrap_or(0)).collect()
            }
            _ => {
                let allowed = "`seeds` is a count, a list, or { precision = 0.05, at_least = 4, at_most = 64 }";
                grid.faults.push(wrong_type(written, SEEDS, allowed));
                Vec::new()
            }
        };
        Self::List(seeds)
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

/// The key of the quantity whose precision is requested.
const QUANTITY: &str = "quantity";

/// Reads a precision.
fn precision(table: &Reader<'_>, grid: &Reader<'_>) -> Precision {
    table.need("precision", "0.05");
    let note = ": half the 95 % interval over the mean";
    let seeds = |key: &str, least: u64, usual: u64| match table.get(key) {
        None => usual.max(least),
        Some(written) => {
            let range = Range::from_to(least as f64, CASE_LIMIT as f64);
            let read = whole(written, key, &range, &range_words(least, CASE_LIMIT));
            table.faults.ok(read).unwrap_or(least)
        }
    };
    let at_least = seeds("at_least", LEAST, DEFAULT_AT_LEAST);
    let at_most = seeds("at_most", at_least, DEFAULT_AT_MOST);
    let count = |seeds: u64| usize::try_from(seeds).unwrap_or(usize::MAX);
    let quantity = table.word(QUANTITY, &Quantity::ALL.map(Quantity::name));
    let quantity = quantity
        .and_then(Quantity::of_name)
        .unwrap_or(Quantity::Viscosity);
    let is_free = |axis: &Axis| {
        axis.is_imposed_pressure() && keys_of(axis).any(|key| grid.get(key).is_some())
    };
    if quantity == Quantity::Fraction && !AXES.iter().any(is_free) {
        let problem = "the fraction is given, and every run has it exactly";
        let allowed = "`fraction` where the pressure is imposed, by `viscous_number` or `macroscopic_friction`";
        let problem = Problem::at(&table.place(QUANTITY), problem, allowed).of_key(QUANTITY);
        grid.faults.push(problem);
    }
    if quantity != Quantity::Pressure && has_rest(grid.get(PECLET)) {
        let problem = format!(
            "the {} of fluid at rest, `peclet` = 0, is 0 but for noise, and no mean of it is precise",
            quantity.name().replace('_', " ")
        );
        let allowed = "`pressure` there, or seeds as a list";
        let problem = Problem::at(&table.place(QUANTITY), problem, allowed).of_key(QUANTITY);
        grid.faults.push(problem);
    }
    Precision {
        precision: table.number("precision", &PRECISION, note).unwrap_or(1.0),
        quantity,
        at_least: count(at_least),
        at_most: count(at_most),
    }
}

fn range_words(low: u64, high: u64) -> String {
    format!("from {low} to {high}")
}
