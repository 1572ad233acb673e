//! The report for programs: one JSON object, a stable interface.

use super::columns::{COLUMNS, Column};
use super::error::ReportError;
use super::points::{Point, Report};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;

/// The object.
#[derive(Serialize)]
struct Document<'r> {
    campaign: &'r str,
    cases: Value,
    /// Points, in the units of the program.
    points: Vec<Row<'r>>,
    /// Points in the requested units.
    #[serde(skip_serializing_if = "Option::is_none")]
    physical: Option<Physical<'r>>,
}

/// The numbers in physical units, if requested.
#[derive(Serialize)]
struct Physical<'r> {
    /// Units of the columns that have one, by name.
    units: BTreeMap<&'static str, &'static str>,
    points: Vec<Row<'r>>,
}

/// A point as an object: the columns of the tables by name, `null` for missing values; in the units
/// of a report if one is given.
struct Row<'r>(&'r Point, Option<&'r Report>);

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let cell = |column: &Column| match self.1 {
            Some(report) => column.shown(report, self.0),
            None => column.cell(self.0),
        };
        s.collect_map(
            COLUMNS
                .iter()
                .map(|column| (column.name.as_ref(), cell(column))),
        )
    }
}

/// Writes the report.
///
/// # Errors
/// Output that cannot be written.
pub fn write(report: &Report, out: &mut dyn Write) -> Result<(), ReportError> {
    let rows = |units| {
        report
            .points
            .iter()
            .map(|point| Row(point, units))
            .collect()
    };
    let units = COLUMNS
        .iter()
        .map(|column| (column.name.as_ref(), column.unit_in(report)));
    let counts = &report.counts;
    let document = Document {
        campaign: &report.campaign,
        // Running cases count as pending; done ones include doubtful ones.
        cases: json!({
            "done": counts.done, "jammed": counts.jammed, "failed": counts.failed, "pending": counts.pending + counts.running,
            "doubtful": report.doubtful,
        }),
        points: rows(None),
        physical: report.units.are_requested().then(|| Physical {
            units: units.filter(|(_, unit)| !unit.is_empty()).collect(),
            points: rows(Some(report)),
        }),
    };
    serde_json::to_writer(&mut *out, &document).map_err(std::io::Error::from)?;
    Ok(writeln!(out)?)
}
