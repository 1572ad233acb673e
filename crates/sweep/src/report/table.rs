//! The table of the points of a report: the axes of the campaign, then the numbers that points
//! have. CSV, Parquet, JSON, the page and the tables for people are views of it.

use super::columns::{self, Column};
use super::error::ReportError;
use super::points::{Point, Report};
use super::units::Units;
use crate::data::{DataColumn, Kind, Objects, Value, Word};
use crate::measure::Estimate;
use crate::model::axes::AXES;
use crate::text::format::count;
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write;

impl Column {
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
        let place = columns::place(&self.name()).unwrap_or(usize::MAX);
        let cells = points.clone().map(|point| self.cell(place, point));
        let mut column = DataColumn {
            unit: self.unit(),
            ..DataColumn::of(self.name(), self.kind(), self.meaning(), cells)
        };
        units.convert(&mut column, points.map(Point::at));
        column
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
    let measured = report.columns.of_tables();
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
        columns::all()
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
