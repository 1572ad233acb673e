//! The report for people: a table, and under it what its columns mean.

mod notes;

use super::ReportError;
use super::{Point, Report, columns};
use crate::axes::{AXES, Axis, Value};
use crate::campaign::Discard;
use crate::format::{duration, significant};
use crate::statistics::Estimate;
use crate::store::Provenance;
use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, presets};
use std::io::Write;

/// A measured quantity: its heading and how its value is written.
type Column = (&'static str, fn(&Point) -> String);

/// Measured quantities, in the order of the columns; those about jammed, failed and doubtful runs, precisions and strains discarded only
/// where there are some.
const COLUMNS: [Column; 18] = [
    ("runs", |p| p.seeds.to_string()),
    ("wanted", |p| p.seeds_wanted.to_string()),
    ("precision", |p| {
        p.precision.map_or_else(
            || "–".into(),
            |part| format!("{} %", significant(100.0 * part, 2)),
        )
    }),
    ("discard", |p| number(p.discard, 3)),
    ("jammed", |p| p.jammed.to_string()),
    ("failed", |p| p.failed.to_string()),
    ("doubtful", |p| p.doubtful.to_string()),
    ("viscosity", |p| interval(p.viscosity)),
    ("median", |p| number(p.viscosity_median, 4)),
    ("independent\nsamples", |p| number(p.effective_samples, 2)),
    ("stresslet\nviscosity", |p| interval(p.viscosity_stresslet)),
    ("contacts\n/ N", |p| number(p.contacts_per_sphere, 3)),
    ("activated", |p| number(p.activated_fraction, 3)),
    ("rolling", |p| number(p.rolling_fraction, 3)),
    ("smallest\ngap", |p| number(p.minimum_gap, 3)),
    ("approach", |p| number(p.mean_approach_velocity, 2)),
    ("worst\nresidual", |p| number(p.worst_residual, 2)),
    ("unconverged", |p| number(p.unconverged_fraction, 2)),
];

/// A table in the style of the program; `width` is that of the terminal.
pub(crate) fn table(width: Option<u16>) -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none()))
        .set_content_arrangement(ContentArrangement::Dynamic);
    // Not a terminal: as wide as it needs to be, for files and pipes.
    table.set_width(width.unwrap_or(u16::MAX));
    table
}

/// A number, or a dash.
fn number(value: Option<f64>, digits: i32) -> String {
    value.map_or_else(|| "–".into(), |value| significant(value, digits))
}

/// A mean with its interval.
fn interval(estimate: Option<Estimate>) -> String {
    match estimate {
        None => "–".into(),
        Some(Estimate {
            mean,
            ci95: Some(width),
            ..
        }) => format!("{} ± {}", significant(mean, 4), significant(width, 2)),
        Some(Estimate { mean, .. }) => significant(mean, 4),
    }
}

/// A cell of a column that was asked for, with its interval if it has one.
fn cell(column: &columns::Column, point: &Point) -> String {
    let of = |column: &columns::Column, digits| match column.cell(point) {
        Some(Value::Number(number)) => Some(significant(number, digits)),
        Some(value) => Some(value.to_string()),
        None => None,
    };
    let width = column.interval().and_then(|interval| of(&interval, 2));
    match (of(column, 4), width) {
        (Some(mean), Some(width)) => format!("{mean} ± {width}"),
        (Some(mean), None) => mean,
        (None, _) => "–".into(),
    }
}

/// What is said of runs with doubtful numbers.
pub(super) fn doubtful(report: &Report) -> String {
    let what = if report.with_doubtful {
        "averaged with the others, as --with-doubtful asks"
    } else {
        "not averaged; --with-doubtful averages them too"
    };
    format!(
        "{} finished runs have doubtful numbers: {what}. `sweep show` says why",
        report.doubtful
    )
}

/// What is said of an imposed stress and of columns that were asked for.
fn explain(report: &Report, out: &mut dyn Write) -> Result<(), ReportError> {
    if report
        .points
        .iter()
        .any(|p| p.params.shear_stress.is_some())
    {
        writeln!(
            out,
            "σ*: imposed shear stress in F_crit/a²; Γ is then 6π σ*/viscosity. Runs that jam bear that stress at rest."
        )?;
    }
    if let Some(chosen) = report.columns.chosen() {
        for column in chosen {
            writeln!(out, "{}: {}", column.name, column.meaning)?;
        }
    }
    Ok(())
}

/// The programs of processes, each once.
fn programs(processes: &[Provenance]) -> Vec<String> {
    let mut programs: Vec<String> = Vec::new();
    for process in processes {
        let program = process.program();
        if !programs.contains(&program) {
            programs.push(program);
        }
    }
    programs
}

/// Writes the report as a table.
///
/// # Errors
/// Output that cannot be written.
pub fn write(report: &Report, width: Option<u16>, out: &mut dyn Write) -> Result<(), ReportError> {
    let c = &report.counts;
    writeln!(
        out,
        "{}: {} of {} cases done, {} jammed, {} failed, {} to do",
        report.campaign,
        c.done,
        c.total(),
        c.jammed,
        c.failed,
        c.pending + c.running
    )?;
    // The shear rate is what curves are drawn against: always a column.
    let (columns, fixed): (Vec<&Axis>, Vec<&Axis>) = AXES.iter().partition(|axis| {
        axis.is_shear_rate() || axis.varies(report.points.iter().map(|point| &point.params))
    });
    if !report.selection.is_everything() {
        writeln!(out, "only where {}", report.selection)?;
    }
    if let Some(point) = report.points.first() {
        let words: Vec<String> = fixed
            .iter()
            .filter(|axis| axis.matters(report.points.iter().map(|p| &p.params)))
            .map(|axis| {
                let mut points = report.points.iter();
                let shown = points
                    .find(|p| axis.means_something(&p.params))
                    .unwrap_or(point);
                format!("{} {}", axis.symbol, axis.value(&shown.params))
            })
            .collect();
        writeln!(out, "{}", words.join(", "))?;
        let rules = report.points.iter().any(|point| point.rule.is_some());
        let auto = report.discard == Discard::Auto;
        let usual: Vec<Column> = COLUMNS
            .into_iter()
            .filter(|(heading, _)| match *heading {
                "wanted" | "precision" => rules,
                "discard" => auto,
                "jammed" => c.jammed > 0,
                "failed" => c.failed > 0,
                "doubtful" => report.doubtful > 0,
                _ => true,
            })
            .collect();
        let mut table = table(width);
        let axes = columns.iter().map(|axis| axis.symbol.to_owned());
        let headings: Vec<&str> = match report.columns.chosen() {
            Some(chosen) => chosen.iter().map(|column| column.name).collect(),
            None => usual.iter().map(|column| column.0).collect(),
        };
        table.set_header(axes.chain(headings.into_iter().map(str::to_owned)));
        for point in &report.points {
            let axes = columns.iter().map(|axis| match point.params.shear_stress {
                Some(_) if axis.is_shear_rate() => number(point.shear_rate(), 4),
                None if axis.is_shear_stress() => "–".into(),
                _ => axis.value(&point.params).to_string(),
            });
            let cells: Vec<String> = match report.columns.chosen() {
                Some(chosen) => chosen.iter().map(|column| cell(column, point)).collect(),
                None => usual.iter().map(|column| column.1(point)).collect(),
            };
            table.add_row(axes.chain(cells));
        }
        for column in table.column_iter_mut() {
            column.set_cell_alignment(CellAlignment::Right);
        }
        writeln!(out, "{table}")?;
        let after = match report.discard {
            Discard::Strain(strain) => format!("after a strain of {strain}"),
            Discard::Auto => "after the strain MSER-5 picks at each point".into(),
        };
        explain(report, out)?;
        writeln!(
            out,
            "viscosity: mean over runs ± half the 95 % Student interval, {after}; \
             stresslet viscosity: without contact stress.\n\
             median: over runs, of their medians in time. Jammed runs are counted, not averaged. \
             activated: of contacts; rolling: of activated ones.",
        )?;
        notes::write(report, &columns, out)?;
    }
    if report.doubtful > 0 {
        writeln!(out, "{}", doubtful(report))?;
    }
    if report.computing > 0.0 {
        writeln!(
            out,
            "computed in {} of processor time ({} by the wall), summed over runs, by {}",
            duration(report.processor),
            duration(report.computing),
            programs(&report.provenance).join("; ")
        )?;
    }
    for failure in &report.failures {
        writeln!(out, "{}", failure.text())?;
    }
    Ok(())
}
