//! The report for people: a table, and under it what its columns mean.

mod notes;

use super::error::ReportError;
use super::points::Report;
use super::sheet::{NumberFormat, Shape, Sheet};
use crate::campaign::Discard;
use crate::format::duration;
use comfy_table::{ColumnConstraint, ContentArrangement, LineStyle, Table, Width, presets};
use std::io::Write;

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

/// The table as text, in which no word and no number is split over lines: rather is it wider than the terminal.
pub(crate) fn whole(mut table: Table) -> String {
    let mut longest: Vec<usize> = Vec::new();
    let rows = table.header().into_iter().chain(table.row_iter());
    for row in rows {
        for (place, cell) in row.cell_iter().enumerate() {
            let content = cell.content();
            let word = content
                .split_whitespace()
                .map(|word| word.chars().count())
                .max();
            if longest.len() <= place {
                longest.push(0);
            }
            longest[place] = longest[place].max(word.unwrap_or(0));
        }
    }
    for (column, length) in table.column_iter_mut().zip(longest) {
        // A space on either side.
        let width = u16::try_from(length + 2).unwrap_or(u16::MAX);
        column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(width)));
    }
    table.to_string()
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

/// Says what the columns of a table are.
fn legend(
    sheet: &Sheet,
    shape: Shape,
    after: &str,
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    if sheet.has("viscosity") {
        let interval = match shape.format {
            NumberFormat::Plain => "± half the 95 % Student interval",
            NumberFormat::Si => "and in brackets half the 95 % Student interval",
        };
        writeln!(out, "viscosity: mean over runs {interval}, {after}")?;
    }
    for (name, words) in [
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
        if sheet.has(name) {
            writeln!(out, "{words}")?;
        }
    }
    Ok(())
}

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
    let (columns, fixed) = report.axes();
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
                format!(
                    "{} {}",
                    axis.symbol,
                    report.words_of(axis).value(&shown.params)
                )
            })
            .collect();
        writeln!(out, "{}", words.join(", "))?;
        let sheet = Sheet::of(report, shape, width);
        writeln!(out, "{}", sheet.text(width))?;
        let after = match report.discard {
            Discard::Strain(strain) => format!("after a strain of {strain}"),
            Discard::Auto => "after the strain MSER-5 picks at each point".into(),
        };
        if sheet.is_cut {
            writeln!(
                out,
                "more columns: --wide, or those of --columns NAME[,NAME..]"
            )?;
        }
        explain(report, out)?;
        legend(&sheet, shape, &after, out)?;
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
            report.programs().join("; ")
        )?;
    }
    for failure in &report.failures {
        writeln!(out, "{}", failure.text())?;
    }
    Ok(())
}
