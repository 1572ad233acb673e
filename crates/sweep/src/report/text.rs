//! The report for people: a table with an explanation of its columns.

mod notes;

use super::error::ReportError;
use super::failures::FailureGroup;
use super::points::Report;
use super::sheet::{NumberFormat, Shape, Sheet};
use crate::model::protocol::Discard;
use crate::text::format::{counted, duration};
use comfy_table::{ColumnConstraint, ContentArrangement, LineStyle, Row, Table, Width, presets};
use notes::notes;
use std::io::Write;

/// An empty table in the style of the program; `width` is that of the terminal.
pub(super) fn styled(width: Option<u16>) -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none()))
        .set_content_arrangement(ContentArrangement::Dynamic);
    // Not a terminal: unlimited width, for files and pipes.
    table.set_width(width.unwrap_or(u16::MAX));
    table
}

/// A table for a terminal of this width as text. Words and numbers are not split over lines, even
/// if it gets wider than the terminal.
pub(crate) fn table<R: Into<Row>>(
    width: Option<u16>,
    heads: impl Into<Row>,
    rows: impl IntoIterator<Item = R>,
) -> String {
    let mut table = styled(width);
    table.set_header(heads);
    table.add_rows(rows);
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
        // One space on either side.
        let width = u16::try_from(length + 2).unwrap_or(u16::MAX);
        column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(width)));
    }
    table.to_string()
}

/// Note on runs with doubtful numbers.
pub(super) fn doubtful(report: &Report) -> String {
    let what = if report.with_doubtful {
        "averaged with the others because of --with-doubtful"
    } else {
        "not averaged; --with-doubtful includes them"
    };
    let have = if report.doubtful == 1 { "has" } else { "have" };
    format!(
        "{} {have} doubtful numbers: {what}. `sweep show` gives the reason",
        counted(report.doubtful, "finished run")
    )
}

/// Explanation of the columns of a table, one line each.
fn legend(report: &Report, sheet: &Sheet, shape: Shape) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    if report
        .points
        .iter()
        .any(|p| p.params.shear_stress.is_some())
    {
        lines.push("σ*: imposed shear stress in F_crit/a²; Γ is then 6π σ*/viscosity. Jammed runs carry that stress at rest.".into());
    }
    let chosen = report.columns.chosen().unwrap_or_default();
    // That of the viscosity follows, with its interval.
    let explained = chosen.iter().filter(|column| column.name != "viscosity");
    lines.extend(explained.map(|column| format!("{}: {}", column.name, column.meaning)));
    let interval = match shape.format {
        NumberFormat::Plain => "± half the 95 % Student interval",
        NumberFormat::Si => "and in brackets half the 95 % Student interval",
    };
    let after = match report.discard {
        Discard::Strain(strain) if let Some(segment) = report.segment => {
            format!(
                "in segment {segment} after a strain of {strain}; all segments: `sweep segments`"
            )
        }
        Discard::Strain(strain) => format!("after a strain of {strain}"),
        Discard::Auto => "after the strain chosen by MSER-5 at each point".into(),
    };
    let known = [
        (
            "viscosity",
            format!("viscosity: mean over runs {interval}, {after}"),
        ),
        (
            "viscosity_stresslet",
            "stresslet viscosity: without contact stress".into(),
        ),
        (
            "viscosity_median",
            "median: over runs, of their medians in time".into(),
        ),
        ("jammed", "Jammed runs are counted, not averaged".into()),
        (
            "activated_fraction",
            "activated: of contacts; rolling: of activated ones".into(),
        ),
    ];
    let chosen = |name| name != "viscosity" && chosen.iter().any(|column| column.name == name);
    let known = known
        .into_iter()
        .filter(|(name, _)| sheet.has(name) && !chosen(*name));
    lines.extend(known.map(|(_, words)| words));
    lines
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
    let mut lines = vec![format!(
        "{}: {} of {} cases done, {} jammed, {} failed, {} to do",
        report.campaign,
        c.done,
        c.total(),
        c.jammed,
        c.failed,
        c.pending + c.running
    )];
    if !report.selection.is_everything() {
        lines.push(format!("only where {}", report.selection));
    }
    if let Some(point) = report.points.first() {
        let (columns, fixed) = report.axes();
        let params = || report.points.iter().map(|point| &point.params);
        let words = fixed
            .iter()
            .filter(|axis| axis.matters(params()))
            .map(|axis| {
                let shown = params().find(|params| axis.means_something(params));
                let value = report.words_of(axis).value(shown.unwrap_or(&point.params));
                format!("{} {value}", axis.symbol())
            });
        lines.push(words.collect::<Vec<_>>().join(", "));
        let sheet = Sheet::of(report, shape, width);
        lines.push(sheet.text(width));
        if sheet.is_cut {
            lines.push("more columns: --wide, or those of --columns NAME[,NAME..]".into());
        }
        lines.extend(legend(report, &sheet, shape));
        if report.shares_runs {
            lines.push(
                "rows with the same runs: friction has no effect at Γ = 0, nor has Γ without friction"
                    .into(),
            );
        }
        lines.extend(notes(report, &columns));
    }
    if report.doubtful > 0 {
        lines.push(doubtful(report));
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
