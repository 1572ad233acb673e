//! The report for machines: one JSON object, its names and meanings a promise.

use super::ReportError;
use super::columns::columns;
use super::{Point, Report};
use serde::{Serialize, Serializer};
use std::io::Write;

/// The object.
#[derive(Serialize)]
struct Document<'r> {
    /// Name of the campaign.
    campaign: &'r str,
    /// Cases by state.
    cases: Cases,
    /// Points.
    points: Vec<Row<'r>>,
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

/// A point as an object: the columns of the tables by name, `null` where nothing was measured.
pub(super) struct Row<'r>(pub(super) &'r Point);

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_map(columns().map(|column| (column.name, column.cell(self.0))))
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
    };
    serde_json::to_writer(&mut *out, &document).map_err(std::io::Error::from)?;
    Ok(writeln!(out)?)
}
