//! The table of the points of a report: the axes of the campaign, then the numbers that points
//! have. CSV, Parquet, JSON, the page and the tables for people are views of it.

use super::error::ReportError;
use super::points::{Point, Report};
use super::selection::meant;
use super::units::Units;
use crate::data::{DataColumn, Kind, Objects, Value, Word};
use crate::measure::numbers::{self, Level, Number, OverRuns};
use crate::measure::{Estimate, Runs};
use crate::model::axes::{AXES, Axis};
use crate::text::format::count;
use serde::Serialize;
use serde_json::json;
use std::collections::{BTreeMap, HashMap};
use std::io::Write;
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

impl Point {
    /// A measured number; `None` for a missing one.
    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        let number = self.measured.get(*PLACES.get(name)?);
        number.copied().filter(|number| !number.is_nan())
    }
}

/// All columns: the axes, then the measured ones.
pub(super) fn columns() -> impl Iterator<Item = Column> {
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

    fn kind(self) -> Kind {
        match self {
            Self::Axis(axis) => axis.kind(),
            Self::Number(number) => number.kind(Level::Points),
            Self::Interval(_) => Kind::Number,
        }
    }

    /// Its cell at a point; `None` if nothing was measured. `place` is that of a measured column.
    fn cell(self, place: usize, point: &Point) -> Option<Value> {
        match self {
            // Of rate and stress, the one that is not imposed is a result.
            Self::Axis(axis) if axis.is_shear_rate() => point.shear_rate().map(Value::Number),
            Self::Axis(axis) if axis.is_shear_stress() => {
                point.params.shear_stress.map(Value::Number)
            }
            Self::Axis(axis) => {
                let is_absent = axis.is_fraction() && !axis.means_something(&point.params);
                (!is_absent).then(|| axis.value(&point.params))
            }
            _ => {
                let number = point
                    .measured
                    .get(place)
                    .filter(|number| !number.is_nan())?;
                Some(match self.kind() {
                    Kind::Count => Value::Count(count(*number) as u64),
                    _ => Value::Number(*number),
                })
            }
        }
    }

    /// The column of some points, in some units.
    pub(super) fn data<'p>(
        self,
        points: impl Iterator<Item = &'p Point> + Clone,
        units: Units,
    ) -> DataColumn {
        let place = PLACES.get(&self.name()).copied().unwrap_or(usize::MAX);
        let cells = points.clone().map(|point| self.cell(place, point));
        let mut column = DataColumn {
            unit: self.unit(),
            ..DataColumn::of(self.name(), self.kind(), self.meaning(), cells)
        };
        units.convert(&mut column, points.map(Point::at));
        column
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

/// The number of points of this name, for a figure.
///
/// # Errors
/// [`ReportError::Argument`] on a name that none has.
pub fn number(name: &str) -> Result<&'static Number, ReportError> {
    match known("quantity", &name.replace('-', "_"))? {
        Column::Axis(_) | Column::Interval(_) => Err(ReportError::argument(
            "quantity",
            format!("{name} is drawn as the interval of its number: name that"),
        )),
        Column::Number(number) => Ok(number),
    }
}

/// The axes of some points, one row each.
pub(super) fn axis_table<'p>(
    points: &(impl Iterator<Item = &'p Point> + Clone),
) -> Vec<DataColumn> {
    let columns = AXES.iter().map(Column::Axis);
    let units = Units::default();
    columns
        .map(|column| column.data(points.clone(), units))
        .collect()
}

/// A table that is made column by column, each with a cell for every row.
pub(super) struct TableOf<'r, R> {
    pub(super) columns: Vec<DataColumn>,
    pub(super) rows: &'r [R],
}

impl<R> TableOf<'_, R> {
    /// Adds a column.
    pub(super) fn add(
        &mut self,
        name: impl Into<Word>,
        kind: Kind,
        meaning: &'static str,
        of: impl Fn(&R) -> Option<Value>,
    ) {
        let column = DataColumn::of(name, kind, meaning, self.rows.iter().map(of));
        self.columns.push(column);
    }

    pub(super) fn count(
        &mut self,
        name: &'static str,
        meaning: &'static str,
        of: impl Fn(&R) -> Option<u64>,
    ) {
        self.add(name, Kind::Count, meaning, |row| of(row).map(Value::Count));
    }

    pub(super) fn number(
        &mut self,
        name: impl Into<Word>,
        meaning: &'static str,
        of: impl Fn(&R) -> Option<f64>,
    ) {
        self.add(name, Kind::Number, meaning, |row| {
            of(row).map(Value::Number)
        });
    }

    /// Adds a column of means over runs, and one of half the widths of their intervals.
    pub(super) fn estimate(
        &mut self,
        name: &'static str,
        meaning: &'static str,
        of: impl Fn(&R) -> Option<Estimate>,
    ) {
        let half = "half width of its 95 % Student interval over runs";
        self.number(name, meaning, |row| Some(of(row)?.mean));
        self.number(format!("{name}_ci95"), half, |row| of(row)?.ci95);
    }
}

/// The points as a table, with the columns that were chosen or all, in the units of the report.
pub fn point_table(report: &Report) -> Vec<DataColumn> {
    let axes = AXES.iter().map(Column::Axis);
    let measured = report.columns.0.as_ref().unwrap_or(&MEASURED);
    let columns = axes.chain(measured.iter().copied());
    columns.map(|column| report.column(column)).collect()
}

impl Report {
    /// A column of its table.
    pub(super) fn column(&self, column: Column) -> DataColumn {
        column.data(self.points.iter(), self.units)
    }

    /// All columns of its table, in some units.
    pub(super) fn whole_table(&self, units: Units) -> Vec<DataColumn> {
        columns()
            .map(|column| column.data(self.points.iter(), units))
            .collect()
    }
}

/// Writes the report for programs: one JSON object, a stable interface.
///
/// # Errors
/// Output that cannot be written.
pub fn write_json(report: &Report, out: &mut dyn Write) -> Result<(), ReportError> {
    #[derive(Serialize)]
    struct Document<'r> {
        campaign: &'r str,
        cases: serde_json::Value,
        /// In the units of the program.
        points: Objects<'r>,
        /// In the requested units.
        #[serde(skip_serializing_if = "Option::is_none")]
        physical: Option<Physical<'r>>,
    }
    #[derive(Serialize)]
    struct Physical<'r> {
        units: BTreeMap<&'r str, &'static str>,
        points: Objects<'r>,
    }
    let points = report.whole_table(Units::default());
    let is_converted = report.units.are_requested();
    let converted = is_converted.then(|| report.whole_table(report.units));
    let counts = &report.counts;
    // Running cases count as pending; done ones include doubtful ones.
    let mut cases = json!({
        "done": counts.done, "jammed": counts.jammed, "failed": counts.failed, "pending": counts.pending + counts.running,
        "doubtful": report.doubtful,
    });
    if counts.arrested > 0 {
        cases["arrested"] = counts.arrested.into();
    }
    let document = Document {
        campaign: &report.campaign,
        cases,
        points: Objects(&points),
        physical: converted.as_ref().map(|table| Physical {
            units: table
                .iter()
                .filter(|column| !column.unit.is_empty())
                .map(|column| (column.name.as_ref(), column.unit))
                .collect(),
            points: Objects(table),
        }),
    };
    serde_json::to_writer(&mut *out, &document).map_err(std::io::Error::from)?;
    Ok(writeln!(out)?)
}
