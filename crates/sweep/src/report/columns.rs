//! The columns of the table of points: axes, then measured numbers, each with the half width of its
//! interval if it is a mean; and the choice of some of them.

use super::error::ReportError;
use super::selection::meant;
use crate::data::{Kind, Word};
use crate::measure::Runs;
use crate::measure::numbers::{self, Level, Number, OverRuns};
use crate::model::axes::{AXES, Axis};
use std::collections::HashMap;
use std::sync::LazyLock;

/// A column of the table.
#[derive(Debug, Clone, Copy)]
pub(super) enum Column {
    /// Values on an axis.
    Axis(&'static Axis),
    /// A number of points, with its 95 % interval in the next column if it is a mean over runs.
    Number(&'static Number),
    /// Half width of that interval.
    Interval(&'static Number),
}

/// The measured columns, in the order of the numbers of a point.
static MEASURED: LazyLock<Vec<Column>> = LazyLock::new(|| {
    let columns = |number: &'static Number| {
        let is_mean = matches!(number.over_runs(), Some(OverRuns::Mean));
        let interval = is_mean.then_some(Column::Interval(number));
        std::iter::once(Column::Number(number)).chain(interval)
    };
    numbers::columns(Level::Points).flat_map(columns).collect()
});

/// Their places, by name.
static PLACES: LazyLock<HashMap<Word, usize>> = LazyLock::new(|| {
    let places = MEASURED.iter().enumerate();
    places
        .map(|(place, column)| (column.name(), place))
        .collect()
});

/// The place of a measured column of this name among the numbers of a point.
pub(super) fn place(name: &str) -> Option<usize> {
    PLACES.get(name).copied()
}

/// Measured numbers of a point; NaN for missing ones.
pub(super) fn measure(runs: &Runs<'_>) -> Box<[f64]> {
    let mut numbers = Vec::with_capacity(MEASURED.len());
    for number in numbers::columns(Level::Points) {
        match number.over_runs() {
            Some(OverRuns::Count(count)) => numbers.push(count(runs) as f64),
            Some(OverRuns::Real(of)) => numbers.push(of(runs).unwrap_or(f64::NAN)),
            Some(OverRuns::Mean) | None => {
                let estimate = runs.estimate(number.name);
                numbers.push(estimate.map_or(f64::NAN, |e| e.mean));
                numbers.push(estimate.and_then(|e| e.ci95).unwrap_or(f64::NAN));
            }
        }
    }
    numbers.into()
}

/// All columns: the axes, then the measured ones.
pub(super) fn all() -> impl Iterator<Item = Column> {
    let axes = AXES.iter().map(Column::Axis);
    axes.chain(MEASURED.iter().copied())
}

impl Column {
    /// The measured column of this name.
    pub(super) fn named(name: &str) -> Option<Self> {
        PLACES.get(name).map(|place| MEASURED[*place])
    }

    pub(super) fn name(self) -> Word {
        match self {
            Self::Axis(axis) => axis.key.into(),
            Self::Number(number) => number.name.into(),
            Self::Interval(number) => format!("{}_ci95", number.name).into(),
        }
    }

    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::Axis(axis) => axis.unit,
            Self::Number(number) | Self::Interval(number) => number.unit,
        }
    }

    pub(super) fn meaning(self) -> &'static str {
        match self {
            Self::Axis(axis) => axis.meaning,
            Self::Number(number) => number.meaning(Level::Points).unwrap_or_default(),
            Self::Interval(_) => "half width of its 95 % Student interval",
        }
    }

    /// The column with the half width of its interval, if there is one.
    pub(super) fn interval(self) -> Option<Self> {
        Self::named(&format!("{}_ci95", self.name()))
    }

    pub(super) fn kind(self) -> Kind {
        match self {
            Self::Axis(axis) => axis.kind(),
            Self::Number(number) => number.kind(Level::Points),
            Self::Interval(_) => Kind::Number,
        }
    }
}

/// The measured columns of tables: by default all of them, in tables for people the main ones.
#[derive(Debug, Clone, Default)]
pub struct Columns(pub(super) Option<Vec<Column>>);

impl Columns {
    /// The columns with these names, in this order; none is the default.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on a name that no column has.
    pub fn named(names: &[String]) -> Result<Self, ReportError> {
        if names.is_empty() {
            return Ok(Self::default());
        }
        let mut chosen: Vec<Column> = Vec::new();
        for name in names {
            let name = name.trim().replace('-', "_");
            let name = match name.as_str() {
                "η" | "eta" => "viscosity",
                name => name,
            };
            let is_axis = Column::named(name).is_none() && Axis::named(name).is_some();
            // Axes are there anyway.
            if !is_axis {
                let column = known("columns", name)?;
                if chosen.iter().all(|known| known.name() != name) {
                    chosen.push(column);
                }
            }
        }
        Ok(Self(Some(chosen)))
    }

    /// The columns of tables for programs.
    pub(super) fn of_tables(&self) -> &[Column] {
        self.0.as_deref().unwrap_or(&MEASURED)
    }
}

/// The measured column of this name, for an option.
fn known(option: &'static str, name: &str) -> Result<Column, ReportError> {
    Column::named(name).ok_or_else(|| {
        let known: Vec<Word> = MEASURED.iter().map(|column| column.name()).collect();
        let meant = meant(name, known.iter().map(|name| &**name));
        let numbers = MEASURED.iter().filter(|column| matches!(column, Column::Number(_)));
        let names: Vec<Word> = numbers.map(|column| column.name()).collect();
        ReportError::argument(
            option,
            format!(
                "no column is called {name:?}{meant}; besides the axes there are {}, and NAME_ci95 of each mean",
                names.join(", ")
            ),
        )
    })
}

/// The number of points of this name, for a figure; errors are about the option that names it.
///
/// # Errors
/// [`ReportError::Argument`] on a name that none has.
pub fn number(option: &'static str, name: &str) -> Result<&'static Number, ReportError> {
    match known(option, &name.replace('-', "_"))? {
        Column::Axis(_) | Column::Interval(_) => Err(ReportError::argument(
            option,
            format!("{name} is drawn as the interval of its number: name that"),
        )),
        Column::Number(number) => Ok(number),
    }
}
