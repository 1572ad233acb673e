//! The plan as text.

use super::tables::Sheets;
use crate::cli::Output;
use crate::error::Error;
use crate::plan::{Kind, Plan};
use crate::text::format::{bytes, counted, duration, significant, wrapped};
use std::io::Write;

/// Writes it.
pub(super) fn write(plan: &Plan, sheets: &Sheets, output: &mut Output<'_>) -> Result<(), Error> {
    let mut text = Vec::new();
    tables(plan, sheets, output.width, &mut text)?;
    let text = String::from_utf8_lossy(&text);
    output
        .out
        .write_all(wrapped(&text, output.width).as_bytes())?;
    Ok(())
}

/// The plan for a terminal of this width.
fn tables(
    plan: &Plan,
    sheets: &Sheets,
    width: Option<u16>,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let ended = match plan.ended {
        0 => String::new(),
        ended => format!(", {ended} of them ended"),
    };
    writeln!(
        out,
        "{}: {} at {}{ended}",
        plan.campaign,
        counted(plan.cases, "run"),
        counted(plan.points, "point")
    )?;
    if plan.folded > 0 {
        writeln!(
            out,
            "{} more runs of the grids are identical to these: friction has no effect at Γ = 0, nor has Γ without friction, \
             which is listed as Γ = 0",
            plan.folded
        )?;
    }
    sheets.write(width, out)?;
    if !plan.segments.is_empty() {
        writeln!(out, "segments of a run: {}", plan.segments.join("; "))?;
    }
    let has_interval = |kind: &Kind| kind.step_ci95_s.is_some();
    if plan.kinds.iter().any(has_interval) {
        writeln!(
            out,
            "step: mean CPU time and half its 95 % interval, from the scatter of similar measured runs"
        )?;
    }
    write_reasons(&plan.kinds, out)?;
    for warning in &plan.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    write_precision(plan, out)?;
    writeln!(
        out,
        "about {} of CPU time, {} of wall time with {} in parallel; about {} on disk, {} of memory",
        duration(plan.computing_time_s),
        duration(plan.elapsed_s),
        plan.workers,
        bytes(plan.disk_bytes),
        bytes(plan.memory_bytes)
    )?;
    Ok(())
}

/// Why a short run could not be made.
fn write_reasons(kinds: &[Kind], out: &mut dyn Write) -> Result<(), Error> {
    for kind in kinds {
        if let Some(reason) = &kind.reason {
            writeln!(out, "no short run of {} spheres: {reason}", kind.spheres)?;
        }
    }
    Ok(())
}

fn write_precision(plan: &Plan, out: &mut dyn Write) -> Result<(), Error> {
    let Some(expected) = &plan.precision else {
        return Ok(());
    };
    writeln!(
        out,
        "a precision is requested at {} points, of which {} are finished: {} to {} seeds in all, about {} if runs scatter by {} % ({})",
        expected.points,
        expected.settled,
        expected.at_least,
        expected.at_most,
        expected.seeds,
        significant(100.0 * expected.scatter, 2),
        if expected.measured {
            "measured"
        } else {
            "assumed until some are done"
        },
    )?;
    let cheapest = expected
        .lengths
        .iter()
        .min_by(|a, b| a.work.total_cmp(&b.work));
    if let Some(cheapest) = cheapest {
        let listed: Vec<String> = expected
            .lengths
            .iter()
            .map(|length| {
                format!(
                    "{} runs of {} take {}",
                    length.seeds,
                    length.strain,
                    significant(length.work, 2)
                )
            })
            .collect();
        writeln!(
            out,
            "length of runs, by the scatter between them and within: {}; cheapest is strain = {}",
            listed.join(", "),
            cheapest.strain
        )?;
    }
    Ok(())
}
