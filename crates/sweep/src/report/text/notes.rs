//! What the report says of points that are not as precise as was asked, not steady, or softer than their contacts are meant to be.

use crate::axes::Axis;
use crate::format::significant;
use crate::report::error::ReportError;
use crate::report::points::{Point, Report};
use crate::statistics::Verdict;
use std::io::Write;

/// Points named one by one at most.
const SHOWN: usize = 12;

/// Writes the notes; nothing where there is nothing to say.
pub(super) fn write(
    report: &Report,
    columns: &[&'static Axis],
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    precision(report, columns, out)?;
    steadiness(report, columns, out)?;
    overlaps(report, columns, out)
}

/// How the points stand at which a precision is asked for.
fn precision(
    report: &Report,
    columns: &[&'static Axis],
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    let ruled: Vec<_> = report
        .points
        .iter()
        .filter_map(|point| Some((point, point.rule?)))
        .collect();
    if ruled.is_empty() {
        return Ok(());
    }
    let number = |verdict| {
        let is = |(_, (_, decision)): &&(&Point, _)| -> bool {
            let decision: &crate::statistics::Decision = decision;
            decision.verdict == verdict
        };
        ruled.iter().filter(is).count()
    };
    writeln!(
        out,
        "precision: {} of {} points have what was asked for, {} are under way",
        number(Verdict::Reached),
        ruled.len(),
        number(Verdict::Open)
    )?;
    let missed = ruled.iter().filter_map(|(point, (rule, decision))| {
        let asked = significant(100.0 * rule.precision, 2);
        let what = match decision.verdict {
            Verdict::Open | Verdict::Reached => return None,
            Verdict::AtMost => {
                let reached = point.precision.map_or_else(
                    || "has no interval".into(),
                    |part| format!("is known to {} %", significant(100.0 * part, 2)),
                );
                format!(
                    "{} {reached} and not to {asked} % with the {} seeds it may have (at_most)",
                    rule.quantity.name(),
                    rule.at_most
                )
            }
            Verdict::TooFewRuns => format!(
                "fewer than two of its first {} runs could be averaged: it gets no more",
                rule.at_least
            ),
        };
        Some((*point, what))
    });
    list(report, missed, columns, out)
}

/// Points that are not steady.
fn steadiness(
    report: &Report,
    columns: &[&'static Axis],
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    let unsteady = report.points.iter().filter_map(|point| {
        let advice = point.advice.as_ref()?;
        Some((point, format!("not steady: {advice}")))
    });
    list(report, unsteady, columns, out)
}

/// Points whose soft contacts gave way by more than the roughness height.
fn overlaps(
    report: &Report,
    columns: &[&'static Axis],
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    let soft = report.points.iter().filter(|p| p.overlaps_too_much());
    let soft = soft.filter_map(|point| {
        let heights = point.number("overlap")? / point.params.roughness;
        let what = format!(
            "overlaps of up to {} times the roughness height: the spheres themselves overlapped, and a larger stiffness would hold \
             them apart",
            significant(heights, 2)
        );
        Some((point, what))
    });
    list(report, soft, columns, out)
}

/// Names points with what there is to say about them.
fn list<'p>(
    report: &Report,
    points: impl Iterator<Item = (&'p Point, String)>,
    columns: &[&'static Axis],
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    let mut more = 0;
    for (place, (point, what)) in points.enumerate() {
        if place < SHOWN {
            writeln!(out, "{}: {what}", name(report, point, columns))?;
        } else {
            more += 1;
        }
    }
    if more > 0 {
        writeln!(out, "and {more} more points of which the same is true")?;
    }
    Ok(())
}

/// A point by the axes that tell it from the others.
fn name(report: &Report, point: &Point, columns: &[&'static Axis]) -> String {
    // Where the stress is imposed the rate is a result.
    let is_result = |axis: &Axis| axis.is_shear_rate() && point.params.shear_stress.is_some();
    let words: Vec<String> = columns
        .iter()
        .filter(|axis| !is_result(axis))
        .map(|axis| {
            let value = report.words_of(axis).value(&point.params);
            format!("{} {value}", axis.symbol)
        })
        .collect();
    words.join(", ")
}
