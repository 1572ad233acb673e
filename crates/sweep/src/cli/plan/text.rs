//! The plan as tables.

use super::{Kind, Plan, Source};
use crate::cli::{Error, Output};
use crate::format::{bytes, duration, significant, wrapped};
use std::io::Write;

/// Writes it.
pub(super) fn write(plan: &Plan, output: &mut Output<'_>) -> Result<(), Error> {
    let mut text = Vec::new();
    tables(plan, output.width, &mut text)?;
    let text = String::from_utf8_lossy(&text);
    output
        .out
        .write_all(wrapped(&text, output.width).as_bytes())?;
    Ok(())
}

/// The plan for a terminal of this width.
fn tables(plan: &Plan, width: Option<u16>, out: &mut dyn Write) -> Result<(), Error> {
    let ended = match plan.ended {
        0 => String::new(),
        ended => format!(", {ended} of them ended"),
    };
    writeln!(
        out,
        "{}: {} runs at {} points{ended}",
        plan.campaign, plan.cases, plan.points
    )?;
    write_axes(plan, width, out)?;
    if !plan.kinds.is_empty() {
        write_kinds(&plan.kinds, width, out)?;
    }
    write_precision(plan, out)?;
    writeln!(
        out,
        "about {} of processor time, {} with {} at a time; about {} on disk, {} of memory",
        duration(plan.computing_time_s),
        duration(plan.elapsed_s),
        plan.workers,
        bytes(plan.disk_bytes),
        bytes(plan.memory_bytes)
    )?;
    Ok(())
}

fn write_axes(plan: &Plan, width: Option<u16>, out: &mut dyn Write) -> Result<(), Error> {
    let mut axes = crate::report::table(width);
    axes.set_header(["axis", "values", ""]);
    for (name, values) in &plan.axes {
        let words: Vec<String> = values
            .iter()
            .map(|value| {
                value
                    .as_str()
                    .map_or_else(|| value.to_string(), str::to_owned)
            })
            .collect();
        let shown = if words.len() > 12 {
            format!("{}, … {}", words[..10].join(", "), words[words.len() - 1])
        } else {
            words.join(", ")
        };
        axes.add_row([(*name).to_owned(), words.len().to_string(), shown]);
    }
    writeln!(out, "{}", crate::report::whole(axes))?;
    Ok(())
}

fn write_kinds(kinds: &[Kind], width: Option<u16>, out: &mut dyn Write) -> Result<(), Error> {
    let mut table = crate::report::table(width);
    table.set_header([
        "N",
        "hydrodynamics and contacts",
        "steps",
        "runs",
        "step",
        "run",
        "memory",
        "known from",
    ]);
    for kind in kinds {
        let mark = if kind.measured { "" } else { "≈ " };
        table.add_row([
            kind.spheres.to_string(),
            match kind.tangential {
                "roll-slip" => format!("{}, {}", kind.hydrodynamics, kind.contact),
                other => format!("{}, {}, {other}", kind.hydrodynamics, kind.contact),
            },
            kind.steps.to_string(),
            kind.cases.to_string(),
            format!("{mark}{} ms", significant(1e3 * kind.step_s, 3)),
            format!("{mark}{}", duration(kind.step_s * kind.steps as f64)),
            bytes(kind.memory_bytes),
            match kind.source {
                Source::Runs => "runs here".into(),
                Source::Trial => "a short run now".into(),
                Source::Rough => "runs unlike it".to_owned(),
            },
        ]);
    }
    writeln!(out, "{}", crate::report::whole(table))?;
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
        "a precision is asked for at {} points, of which {} are settled: {} to {} seeds in all, about {} if runs scatter by {} % ({})",
        expected.points,
        expected.settled,
        expected.at_least,
        expected.at_most,
        expected.seeds,
        significant(100.0 * expected.scatter, 2),
        if expected.measured {
            "measured"
        } else {
            "taken for granted until some are done"
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
