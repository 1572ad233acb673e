//! The points as a Markdown table.

use super::columns::Column;
use super::error::ReportError;
use super::points::Report;
use crate::data::Value;
use crate::model::axes::Axis;
use crate::text::format::short;
use std::io::Write;

/// Writes the points as a Markdown table with units in its head, without empty columns.
pub(crate) fn write_markdown(report: &Report, out: &mut dyn Write) -> Result<(), ReportError> {
    let matters = |name| {
        // The rate that follows from an imposed stress is a result.
        Axis::of_key(name).is_none_or(|axis| {
            axis.is_shear_rate() || axis.matters(report.points.iter().map(|p| &p.params))
        })
    };
    let is_chosen = report.columns.chosen().is_some();
    let columns: Vec<&Column> = report
        .columns
        .all()
        .into_iter()
        .filter(|column| is_chosen || !column.is_detail())
        .filter(|column| match column.name.as_ref() {
            _ if is_chosen && Axis::of_key(&column.name).is_none() => true,
            "jammed" => report.counts.jammed > 0,
            "failed" => report.counts.failed > 0,
            "doubtful" => report.doubtful > 0,
            name => matters(name),
        })
        .collect();
    let heads = columns.iter().map(|column| match column.unit_in(report) {
        "" | "1" => column.name.to_string(),
        unit => format!("{} ({unit})", column.name),
    });
    writeln!(out, "| {} |", heads.collect::<Vec<_>>().join(" | "))?;
    writeln!(out, "|{}", " ---: |".repeat(columns.len()))?;
    for point in &report.points {
        let cells = columns
            .iter()
            .map(|column| match column.shown(report, point) {
                Some(Value::Number(number)) => short(number, 4),
                Some(value) => value.to_string(),
                None => "–".into(),
            });
        writeln!(out, "| {} |", cells.collect::<Vec<_>>().join(" | "))?;
    }
    if report.doubtful > 0 {
        writeln!(out, "\n{}", super::text::doubtful(report))?;
    }
    Ok(())
}
