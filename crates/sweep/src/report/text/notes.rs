//! Notes on points that lack the requested precision, are not steady, or have too soft contacts.

use crate::measure::{Decision, Verdict};
use crate::model::axes::Axis;
use crate::model::precision::Precision;
use crate::report::points::{Point, Report};
use crate::text::format::{counted, significant};

/// Maximum number of points named.
const SHOWN: usize = 12;

/// The notes, one line each.
pub(super) fn notes(report: &Report, columns: &[&'static Axis]) -> Vec<String> {
    let ruled: Vec<(&Point, (Precision, Decision))> = report
        .points
        .iter()
        .filter_map(|point| Some((point, point.rule?)))
        .collect();
    let mut lines = Vec::new();
    if !ruled.is_empty() {
        let number = |verdict| {
            let verdicts = ruled.iter().map(|(_, (_, decision))| decision.verdict);
            verdicts.filter(|known| *known == verdict).count()
        };
        lines.push(format!(
            "precision: reached at {} of {} points, {} in progress",
            number(Verdict::Reached),
            ruled.len(),
            number(Verdict::Open)
        ));
    }
    let missed = ruled
        .iter()
        .filter_map(|(point, rule)| Some((*point, missed(point, *rule)?)));
    let unsteady = report.points.iter().filter_map(|point| {
        let advice = point.advice.as_ref()?;
        Some((point, format!("not steady: {advice}")))
    });
    lines.extend(list(report, missed, columns));
    lines.extend(list(report, unsteady, columns));
    lines.extend(soft(report, columns));
    lines
}

/// A warning about points whose spheres overlapped; it names the worst.
fn soft(report: &Report, columns: &[&'static Axis]) -> Option<String> {
    let soft = report.points.iter().filter(|p| p.overlaps_too_much());
    let heights = |point: &Point| Some(point.number("overlap")? / point.params.roughness);
    let soft: Vec<(&Point, f64)> = soft
        .filter_map(|point| Some((point, heights(point)?)))
        .collect();
    let (worst, most) = soft.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let what = format!(
        "overlaps of up to {} times the roughness height: the spheres themselves overlapped, and a larger stiffness would hold \
         them apart",
        significant(*most, 2)
    );
    let name = name(report, worst, columns);
    Some(with_name(name, soft.len() - 1, &what))
}

/// Why a point will not reach the requested precision, if so.
fn missed(point: &Point, (rule, decision): (Precision, Decision)) -> Option<String> {
    let percent = |part: f64| significant(100.0 * part, 2);
    match decision.verdict {
        Verdict::Open | Verdict::Reached => None,
        Verdict::AtMost => {
            let reached = point.precision.map_or_else(
                || "has no interval".into(),
                |part| format!("is known to {} %", percent(part)),
            );
            Some(format!(
                "{} {reached} and not to {} % with the {} seeds it may have (at_most)",
                rule.quantity.name(),
                percent(rule.precision),
                rule.at_most
            ))
        }
        Verdict::TooFewRuns => Some(format!(
            "fewer than two of its first {} runs could be averaged, so no more are computed",
            rule.at_least
        )),
    }
}

/// Points by name, each with its note; those with the same note share a line.
fn list<'p>(
    report: &Report,
    points: impl Iterator<Item = (&'p Point, String)>,
    columns: &[&'static Axis],
) -> Vec<String> {
    let mut notes: Vec<(String, Vec<&Point>)> = Vec::new();
    for (point, what) in points {
        match notes.iter_mut().find(|(known, _)| *known == what) {
            Some((_, points)) => points.push(point),
            None => notes.push((what, vec![point])),
        }
    }
    let shown = notes.iter().take(SHOWN).map(|(what, points)| {
        let name = name(report, points[0], columns);
        with_name(name, points.len() - 1, what)
    });
    let mut lines: Vec<String> = shown.collect();
    let hidden = notes.iter().skip(SHOWN);
    let more: usize = hidden.map(|(_, points)| points.len()).sum();
    if more > 0 {
        lines.push(format!("and {more} more such points"));
    }
    lines
}

/// A note on a point and others, after its name if it has one: the only point has none.
fn with_name(mut name: String, others: usize, what: &str) -> String {
    if others > 0 {
        let others = counted(others as u64, "more point");
        name = format!("{name} and {others}");
    }
    if name.is_empty() {
        what.to_owned()
    } else {
        format!("{name}: {what}")
    }
}

/// Name of a point, from the axes that distinguish it.
fn name(report: &Report, point: &Point, columns: &[&'static Axis]) -> String {
    // Under imposed stress the rate is a result.
    let is_result = |axis: &Axis| axis.is_shear_rate() && point.params.shear_stress.is_some();
    let named = columns.iter().filter(|axis| !is_result(axis));
    let words = named.map(|axis| {
        let value = report.words_of(axis).value(&point.params);
        format!("{} {value}", axis.symbol())
    });
    words.collect::<Vec<_>>().join(", ")
}
