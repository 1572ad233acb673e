//! The report for machines: one JSON object, its names and meanings a promise.

use super::columns::columns;
use super::error::ReportError;
use super::points::{Point, Report};
use serde::{Serialize, Serializer};
use std::io::Write;

/// The object.
#[derive(Serialize)]
struct Document<'r> {
    /// Name of the campaign.
    campaign: &'r str,
    /// Cases by state.
    cases: Cases,
    /// Points, in the units of the program.
    points: Vec<Row<'r>>,
    /// Points in the units that were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    physical: Option<Physical<'r>>,
}

/// Cases by state; those under way count as pending.
#[derive(Serialize)]
struct Cases {
    /// Finished.
    done: u64,
    /// Jammed.
    jammed: u64,
    /// Failed.
    failed: u64,
    /// To do, or under way.
    pending: u64,
    /// Of those done, runs with doubtful numbers.
    doubtful: u64,
}

/// The numbers in physical units, where they are asked for.
#[derive(Serialize)]
struct Physical<'r> {
    /// Units of the columns.
    units: Units<'r>,
    /// The same points.
    points: Vec<PhysicalRow<'r>>,
}

/// The units of the columns that have one, by name.
struct Units<'r>(&'r Report);

impl Serialize for Units<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let units = columns().map(|column| (column.name, column.unit_in(self.0)));
        s.collect_map(units.filter(|(_, unit)| !unit.is_empty()))
    }
}

/// A point as an object: the columns of the tables by name, `null` where nothing was measured.
struct Row<'r>(&'r Point);

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_map(columns().map(|column| (column.name, column.cell(self.0))))
    }
}

/// The same in the units of its report.
struct PhysicalRow<'r>(&'r Report, &'r Point);

impl Serialize for PhysicalRow<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_map(columns().map(|column| (column.name, column.shown(self.0, self.1))))
    }
}

/// Writes the report.
///
/// # Errors
/// Output that cannot be written.
pub fn write(report: &Report, out: &mut dyn Write) -> Result<(), ReportError> {
    let document = Document {
        campaign: &report.campaign,
        cases: Cases {
            done: report.counts.done,
            jammed: report.counts.jammed,
            failed: report.counts.failed,
            pending: report.counts.pending + report.counts.running,
            doubtful: report.doubtful,
        },
        points: report.points.iter().map(Row).collect(),
        physical: report.units.are_asked_for().then(|| Physical {
            units: Units(report),
            points: report
                .points
                .iter()
                .map(|point| PhysicalRow(report, point))
                .collect(),
        }),
    };
    serde_json::to_writer(&mut *out, &document).map_err(std::io::Error::from)?;
    Ok(writeln!(out)?)
}
