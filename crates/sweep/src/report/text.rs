//! The report for people: a table with an explanation of its columns, and notes on points that lack
//! the requested precision, are not steady, or have too soft contacts.

use super::error::ReportError;
use super::failures::FailureGroup;
use super::points::{Point, Report};
use super::sheet::{Shape, Sheet};
use crate::measure::{Decision, Verdict};
use crate::model::axes::Axis;
use crate::model::precision::Precision;
use crate::text::format::{NumberFormat, counted, duration, significant};
use std::io::Write;

/// Maximum number of different notes of one kind.
const NOTES: usize = 12;

/// Writes the report as a table.
///
/// # Errors
/// Output that cannot be written.
pub fn write(
    report: &Report,
    shape: Shape,
    width: Option<u16>,
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    let c = &report.counts;
    let mut lines = vec![format!(
        "{}: {} of {} cases done, {}, {} failed, {} to do",
        report.campaign,
        c.done,
        c.total(),
        c.words_of_jammed(),
        c.failed,
        c.pending + c.running
    )];
    if !report.selection.is_everything() {
        lines.push(format!("only where {}", report.selection));
    }
    if let Some(point) = report.points.first() {
        let (columns, fixed) = report.axes();
        let params = || report.points.iter().map(|point| &point.params);
        let matter = fixed.iter().filter(|axis| axis.matters(params()));
        let words = matter.map(|axis| {
            let shown = params().find(|params| axis.means_something(params));
            let value = report.words_of(axis).value(shown.unwrap_or(&point.params));
            format!("{} {value}", axis.symbol())
        });
        lines.push(words.collect::<Vec<_>>().join(", "));
        let sheet = report.sheet(shape, width);
        lines.push(sheet.text(width));
        if sheet.is_cut {
            lines.push("more columns: --wide, or those of --columns NAME[,NAME..]".into());
        }
        lines.extend(legend(report, &sheet, shape));
        if report.shares_runs {
            lines.push(
                "rows with the same runs: friction has no effect at Γ = 0, nor has its onset at Γ = ∞, nor have its laws and Γ without \
                 friction"
                    .into(),
            );
        }
        lines.extend(notes(report, &columns));
    }
    if !report.jammed.is_empty() {
        let named = report.jammed.iter().take(NOTES).map(u64::to_string);
        let named = named.collect::<Vec<_>>().join(", ");
        let more = report.jammed.len().saturating_sub(NOTES);
        let more = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        let word = if c.arrested == c.jammed {
            "arrested"
        } else {
            "jammed"
        };
        lines.push(format!(
            "{word} runs, by their numbers in the file: {named}{more}; `sweep show` shows one"
        ));
    }
    if report.doubtful > 0 {
        let what = if report.with_doubtful {
            "averaged with the others because of --with-doubtful"
        } else {
            "not averaged; --with-doubtful includes them"
        };
        let have = if report.doubtful == 1 { "has" } else { "have" };
        lines.push(format!(
            "{} {have} doubtful numbers: {what}. `sweep show` gives the reason",
            counted(report.doubtful, "finished run")
        ));
    }
    if report.computing > 0.0 {
        lines.push(format!(
            "computed in {} of CPU time (wall time {}), summed over runs, by {}",
            duration(report.processor),
            duration(report.computing),
            report.programs().join("; ")
        ));
    }
    lines.extend(report.failures.iter().map(FailureGroup::text));
    Ok(writeln!(out, "{}", lines.join("\n"))?)
}

/// Explanation of the columns of a table, one line each.
fn legend(report: &Report, sheet: &Sheet, shape: Shape) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut points = report.points.iter();
    if points.any(|point| point.params.shear_stress.is_some()) {
        lines.push("σ*: imposed shear stress in F_crit/a²; Γ is then 6π σ*/viscosity. Jammed runs carry that stress at rest.".into());
    }
    // The viscosity follows, with its interval.
    let chosen = report.columns.0.as_deref().unwrap_or_default();
    let chosen = chosen.iter().filter(|column| column.name() != "viscosity");
    lines.extend(
        chosen
            .clone()
            .map(|column| format!("{}: {}", column.name(), column.meaning())),
    );
    let interval = match shape.format {
        NumberFormat::Plain => "± half the 95 % Student interval",
        NumberFormat::Si => "and in brackets half the 95 % Student interval",
    };
    let strain = report.discard;
    let after = match report.segment {
        Some(segment) => format!(
            "in segment {segment} after a strain of {strain}; all segments: `sweep segments`"
        ),
        None => format!("after a strain of {strain}"),
    };
    let viscosity = format!("viscosity: mean over runs {interval}, {after}");
    for (name, words) in [
        ("viscosity", viscosity.as_str()),
        (
            "viscosity_stresslet",
            "stresslet viscosity: without contact stress",
        ),
        (
            "viscosity_median",
            "median: over runs, of their medians in time",
        ),
        ("jammed", "Jammed runs are counted, not averaged"),
        (
            "activated_fraction",
            "activated: of contacts; rolling: of activated ones",
        ),
    ] {
        if sheet.has(name) && !chosen.clone().any(|column| column.name() == name) {
            lines.push(words.to_owned());
        }
    }
    lines
}

/// Notes on points, one line each.
fn notes(report: &Report, columns: &[&'static Axis]) -> Vec<String> {
    let points = || report.points.iter();
    let ruled: Vec<(&Point, (Precision, Decision))> = points()
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
    let unsteady = points()
        .filter_map(|point| {
            point
                .trend
                .as_ref()
                .map(|(trend, advice)| (point, trend, advice))
        })
        .map(|(point, trend, advice)| (point, format!("{}: {advice}", trend.name())));
    lines.extend(list(report, missed, columns));
    lines.extend(list(report, unsteady, columns));
    // The worst of the points whose spheres overlapped.
    let heights = |point: &Point| Some(point.number("overlap")? / point.params.roughness);
    let soft: Vec<(&Point, f64)> = points()
        .filter(|point| point.overlaps_too_much())
        .filter_map(|point| Some((point, heights(point)?)))
        .collect();
    lines.extend(soft.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(worst, most)| {
        let what = format!(
            "overlaps of up to {} times the roughness height: the spheres themselves overlapped, and a larger stiffness would hold \
             them apart",
            significant(*most, 2)
        );
        note(report, worst, columns, soft.len() - 1, &what)
    }));
    lines
}

/// Why a point will not reach the requested precision, if so.
fn missed(point: &Point, (rule, decision): (Precision, Decision)) -> Option<String> {
    let percent = |part: f64| significant(100.0 * part, 2);
    match decision.verdict {
        Verdict::Open | Verdict::Reached => None,
        Verdict::AtMost => {
            let reached = point.number("precision").map_or_else(
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
    let shown = notes.iter().take(NOTES);
    let shown = shown.map(|(what, of)| note(report, of[0], columns, of.len() - 1, what));
    let mut lines: Vec<String> = shown.collect();
    let more = notes.iter().skip(NOTES).map(|(_, points)| points.len());
    let more = more.sum::<usize>();
    if more > 0 {
        lines.push(format!("and {more} more such points"));
    }
    lines
}

/// A note on a point and others, after its name from the axes that distinguish it: the only point
/// has none.
fn note(
    report: &Report,
    point: &Point,
    columns: &[&'static Axis],
    others: usize,
    what: &str,
) -> String {
    // Under imposed stress the rate is a result.
    let is_result = |axis: &Axis| axis.is_shear_rate() && point.params.shear_stress.is_some();
    let named = columns.iter().filter(|axis| !is_result(axis));
    let words = named.map(|axis| {
        let value = report.words_of(axis).value(&point.params);
        format!("{} {value}", axis.symbol())
    });
    let mut name = words.collect::<Vec<_>>().join(", ");
    if others > 0 {
        name = format!("{name} and {}", counted(others as u64, "more point"));
    }
    if name.is_empty() {
        what.to_owned()
    } else {
        format!("{name}: {what}")
    }
}
