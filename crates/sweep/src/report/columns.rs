//! The columns of all tables: the axes of the campaign, then measured quantities. Tables, JSON,
//! figures and the page use this list.

use super::error::ReportError;
use super::points::{Point, Report};
use crate::data::{DataColumn, Word};
use crate::data::{Kind, Value};
use crate::measure::Runs;
use crate::measure::numbers::{self, Level, Number, OverRuns};
use crate::model::axes::{AXES, Axis};
use crate::text::format::count;
use std::sync::LazyLock;

/// A column: a name for machines, a unit, a meaning, and a cell for every point.
#[derive(Debug)]
pub(super) struct Column {
    /// Name, the same in CSV, Parquet and JSON.
    pub(super) name: Word,
    /// Unit; `1` for pure numbers, empty for text.
    pub(super) unit: &'static str,
    pub(super) meaning: &'static str,
    /// Label on the page; empty for columns without curves.
    pub(super) label: &'static str,
    content: Content,
    /// Its index among all columns.
    place: usize,
}

/// Content of a column.
#[derive(Debug, Clone, Copy)]
enum Content {
    /// Values on an axis.
    Axis(&'static Axis),
    /// A number of points, with its 95 % interval in the next column if it is a mean over runs.
    Number(&'static Number),
    /// Half width of that interval.
    Interval,
}

/// All columns.
pub(super) static COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
    let mut all: Vec<Column> = Vec::new();
    let mut add = |name: Word, unit, meaning, label, content| {
        let place = all.len();
        all.push(Column {
            name,
            unit,
            meaning,
            label,
            content,
            place,
        });
    };
    for axis in AXES.iter() {
        add(
            axis.key.into(),
            axis.unit,
            axis.meaning,
            "",
            Content::Axis(axis),
        );
    }
    for number in numbers::columns(Level::Points) {
        let meaning = number.meaning(Level::Points).unwrap_or_default();
        let content = Content::Number(number);
        add(
            number.name.into(),
            number.unit,
            meaning,
            number.label,
            content,
        );
        if matches!(number.over_runs(), Some(OverRuns::Mean)) {
            let name = format!("{}_ci95", number.name);
            let meaning = "half width of its 95 % Student interval";
            add(name.into(), number.unit, meaning, "", Content::Interval);
        }
    }
    all
});

/// Measured values of a point, by column; NaN for missing ones and for the axes.
pub(super) fn measure(runs: &Runs<'_>) -> Box<[f64]> {
    let mut numbers = Vec::with_capacity(COLUMNS.len());
    for column in COLUMNS.iter() {
        match column.content {
            Content::Axis(_) => numbers.push(f64::NAN),
            Content::Number(number) => match number.over_runs() {
                Some(OverRuns::Count(count)) => numbers.push(count(runs) as f64),
                Some(OverRuns::Real(of)) => numbers.push(of(runs).unwrap_or(f64::NAN)),
                Some(OverRuns::Mean) | None => {
                    let estimate = runs.estimate(number.name);
                    numbers.push(estimate.map_or(f64::NAN, |e| e.mean));
                    numbers.push(estimate.and_then(|e| e.ci95).unwrap_or(f64::NAN));
                }
            },
            // Added together with its mean.
            Content::Interval => {}
        }
    }
    numbers.into()
}

/// The columns of tables besides the axes: by default all of them, in tables for people the main
/// ones.
#[derive(Debug, Clone, Default)]
pub struct Columns(Option<Vec<&'static Column>>);

impl Columns {
    /// The columns with these names, in this order; none is the default.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on a name that no column has.
    pub fn named(names: &[String]) -> Result<Self, ReportError> {
        if names.is_empty() {
            return Ok(Self::default());
        }
        let mut chosen: Vec<&Column> = Vec::new();
        for name in names {
            let name = name.trim().replace('-', "_");
            let axis = Axis::named(&name).map(|axis| axis.key);
            let meant = match name.as_str() {
                "η" | "eta" => "viscosity",
                name => axis.unwrap_or(name),
            };
            match Column::named(meant) {
                Some(column) if column.is_axis() || chosen.iter().any(|c| c.name == meant) => {}
                Some(column) => chosen.push(column),
                None => {
                    let measured = COLUMNS.iter().filter(|column| !column.is_axis());
                    let known: Vec<&str> = measured.map(|column| column.name.as_ref()).collect();
                    let known = known.join(", ");
                    return Err(ReportError::argument(
                        "columns",
                        format!("no column is called {name:?}; besides the axes there are {known}"),
                    ));
                }
            }
        }
        Ok(Self(Some(chosen)))
    }

    /// The columns that were chosen; `None` by default.
    pub(super) fn chosen(&self) -> Option<&[&'static Column]> {
        self.0.as_deref()
    }

    /// The axes, then the columns that were chosen or all.
    pub(super) fn all(&self) -> Vec<&'static Column> {
        let axes = COLUMNS.iter().filter(|column| column.is_axis());
        match &self.0 {
            Some(chosen) => axes.chain(chosen.iter().copied()).collect(),
            None => COLUMNS.iter().collect(),
        }
    }
}

impl Column {
    /// The column of this name.
    pub(super) fn named(name: &str) -> Option<&'static Self> {
        COLUMNS.iter().find(|column| column.name == name)
    }

    fn is_axis(&self) -> bool {
        matches!(self.content, Content::Axis(_))
    }

    /// Type of its cells.
    fn kind(&self) -> Kind {
        match self.content {
            Content::Axis(axis) => axis.kind(),
            Content::Number(number) => number.kind(Level::Points),
            Content::Interval => Kind::Number,
        }
    }

    /// Its cell at a point; `None` if nothing was measured.
    pub(super) fn cell(&self, point: &Point) -> Option<Value> {
        let measured = point.measured[self.place];
        let number = match self.content {
            // Of rate and stress, the one that is not imposed is a result.
            Content::Axis(axis) if axis.is_shear_rate() => point.shear_rate()?,
            Content::Axis(axis) if axis.is_shear_stress() => point.params.shear_stress?,
            Content::Axis(axis) if axis.is_fraction() && !axis.means_something(&point.params) => {
                return None;
            }
            Content::Axis(axis) => return Some(axis.value(&point.params)),
            Content::Number(number) if number.kind(Level::Points) == Kind::Count => {
                return Some(Value::Count(count(measured) as u64));
            }
            _ => measured,
        };
        (!number.is_nan()).then_some(Value::Number(number))
    }

    /// The cell in the units of a report.
    pub(super) fn shown(&self, report: &Report, point: &Point) -> Option<Value> {
        match self.cell(point)? {
            Value::Number(number) => {
                let at = point.at();
                let number = match self.content {
                    Content::Axis(axis) => report.units.along(axis, at, number),
                    _ => report.units.factor(self.unit, at)? * number,
                };
                (!number.is_nan()).then_some(Value::Number(number))
            }
            value => Some(value),
        }
    }

    pub(super) fn unit_in(&self, report: &Report) -> &'static str {
        match self.content {
            Content::Axis(axis) => report.units.of_axis(axis).unwrap_or(self.unit),
            _ => report.units.word(self.unit),
        }
    }

    /// Its name in print.
    pub(super) fn title(&self) -> String {
        match (self.label.split_once(','), self.content) {
            (Some((label, _)), _) => label.into(),
            (None, Content::Interval) => {
                format!("95 % interval of {}", COLUMNS[self.place - 1].title())
            }
            (None, _) if self.label.is_empty() => self.name.replace('_', " "),
            (None, _) => self.label.into(),
        }
    }

    /// Whether tables for people show it only on request.
    pub(super) fn is_detail(&self) -> bool {
        match self.content {
            Content::Number(number) => number.is_detail() || number.name == "n1",
            Content::Interval => Number::named(&COLUMNS[self.place - 1].name)
                .is_some_and(|mean| mean.is_detail() || mean.is_sum()),
            Content::Axis(_) => false,
        }
    }

    /// The column with the half width of its interval, if there is one.
    pub(super) fn interval(&self) -> Option<&'static Self> {
        Self::named(&format!("{}_ci95", self.name))
    }
}

/// The axes of a point as an object, by their names.
pub(super) fn point_row(point: &Point) -> serde_json::Map<String, serde_json::Value> {
    let axes = COLUMNS.iter().filter(|column| column.is_axis());
    axes.map(|column| {
        (
            column.name.to_string(),
            serde_json::json!(column.cell(point)),
        )
    })
    .collect()
}

/// The points as a table, with the columns that were chosen or all, in the units of the report.
pub fn point_table(report: &Report) -> Vec<DataColumn> {
    let table = |column: &'static Column| {
        let points = report.points.iter();
        let cells = points.map(|point| column.shown(report, point));
        DataColumn {
            unit: column.unit_in(report),
            ..DataColumn::of(column.name.clone(), column.kind(), column.meaning, cells)
        }
    };
    report.columns.all().into_iter().map(table).collect()
}
