//! `sweep plan`.

use super::Output;
use super::place::{WorkersArgument, store_of};
use crate::error::Error;
use crate::model::campaign::Campaign;
use crate::plan::{Plan, RunKind, Source, beyond_memory, plan};
use crate::report::room;
use crate::store::StoreSource;
use crate::system::exit;
use crate::text::format::{Digits, bytes, counted, duration, significant, wrapped};
use crate::text::table::table;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Columns of a terminal apart from the values of an axis: its name, their number, the spaces
/// between.
const COLUMNS_WITHOUT_VALUES: usize = 32;

/// Show the plan of a campaign: axes, runs, estimated time and disk space
///
/// Writes nothing. CPU times come from runs of the store that this machine has computed, or else
/// from short runs of a few seconds in all. Runs in the store of the campaign are left out.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep plan sweeps/quickstart.toml\n  sweep plan sweeps/quickstart.toml --trajectory\n  \
                  sweep plan sweeps/quickstart.toml --json"
)]
pub(crate) struct Arguments {
    /// The campaign file
    campaign: PathBuf,
    /// The store whose runs are left out [default: results/NAME.sqlite in the folder that holds
    /// `sweeps/`, or beside the file]
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Include frames at every sampled strain, as `sweep run --trajectory` keeps them
    #[arg(long)]
    trajectory: bool,
    #[command(flatten)]
    workers: WorkersArgument,
}

/// Refuses a campaign that has a run too large for the memory of this machine.
pub(super) fn check_memory(campaign: &Campaign) -> Result<(), Error> {
    match beyond_memory(campaign) {
        Some(message) => Err(Error::Argument {
            argument: "spheres",
            message,
        }),
        None => Ok(()),
    }
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let campaign = crate::campaign::read(&arguments.campaign)?;
    check_memory(&campaign)?;
    let workers = arguments.workers.or_all();
    let path = store_of(&campaign, arguments.store.as_deref())?;
    let store = if path.exists() {
        Some(StoreSource::new(path, Some(campaign.clone())).open()?)
    } else {
        None
    };
    let plan = plan(&campaign, workers, arguments.trajectory, store.as_ref())?;
    if output.json {
        output.json(&plan)?;
    } else {
        let text = text(&plan, output.width).unwrap_or_default();
        let text = wrapped(&text, output.width);
        output.out.write_all(text.as_bytes())?;
    }
    Ok(exit::DONE)
}

/// The plan for a terminal of this width.
fn text(plan: &Plan, width: Option<u16>) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
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
            "{} more runs of the grids are identical to these: friction has no effect at Γ = 0, nor has its onset at Γ = ∞, nor have its laws and Γ \
             without friction",
            plan.folded
        )?;
    }
    let most = room(width).saturating_sub(COLUMNS_WITHOUT_VALUES);
    let axes = plan.axes.iter().map(|(name, values)| {
        [
            (*name).to_owned(),
            values.len().to_string(),
            listed(values, most),
        ]
    });
    writeln!(out, "{}", table(None, ["axis", "number", "values"], axes))?;
    if !plan.kinds.is_empty() {
        writeln!(out, "{}", kinds(&plan.kinds, width))?;
    }
    if !plan.segments.is_empty() {
        writeln!(out, "segments of a run: {}", plan.segments.join("; "))?;
    }
    for warning in &plan.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    if let Some(expected) = &plan.precision {
        writeln!(
            out,
            "a precision is requested at {}, of which {} are finished: {} to {} seeds in all, about {} if runs scatter by {} % ({})",
            counted(expected.points, "point"),
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
    }
    writeln!(
        out,
        "about {} of CPU time, {} of wall time with {} in parallel; about {} on disk, {} of memory",
        duration(plan.computing_time_s),
        duration(plan.elapsed_s),
        plan.workers,
        bytes(plan.disk_bytes),
        bytes(plan.memory_bytes)
    )?;
    if plan.threads_per_run > 1 && plan.computing_time_s > 0.0 {
        writeln!(
            out,
            "wall time is that of one thread per run; `sweep run` gives each {}, which shortens large runs by less than that",
            plan.threads_per_run
        )?;
    }
    Ok(out)
}

/// Values as a list of limited length that includes the last one.
fn listed(values: &[serde_json::Value], most: usize) -> String {
    let numbers = values.iter().filter(|value| value.is_f64());
    let digits = Digits::of(numbers.filter_map(serde_json::Value::as_f64));
    let word = |value: &serde_json::Value| match (value.as_str(), value.as_f64()) {
        (Some(word), _) => word.to_owned(),
        (None, Some(number)) if value.is_f64() => digits.write(number),
        _ => value.to_string(),
    };
    // There may be a million seeds, of which a line shows few.
    let words: Vec<String> = values.iter().take(most.max(2)).map(word).collect();
    let whole = words.join(", ");
    if words.len() == values.len() && whole.chars().count() <= most {
        return whole;
    }
    let last = values.last().map(word).unwrap_or_default();
    let with = |number: usize| format!("{}, … {last}", words[..number].join(", "));
    let fits = |number: &usize| with(*number).chars().count() <= most;
    with((1..words.len()).rev().find(fits).unwrap_or(1))
}

/// The table of the kinds of runs. Their step is shown where they differ in it.
fn kinds(kinds: &[RunKind], width: Option<u16>) -> String {
    let has_step = kinds
        .iter()
        .any(|kind| kind.time_step != kinds[0].time_step);
    let differs = |of: fn(&RunKind) -> &str| kinds.iter().any(|kind| of(kind) != of(&kinds[0]));
    let has_law = differs(|kind| kind.tangential) || kinds[0].tangential != "roll-slip";
    let cells = |name, steps: Option<String>, rest: [String; 6]| {
        let mut cells: Vec<String> = vec![name];
        cells.extend(steps);
        cells.extend(rest);
        cells
    };
    let heads = ["N", "runs", "step", "all runs", "memory", "known by"].map(String::from);
    let heads = cells(
        "hydrodynamics, contacts".into(),
        has_step.then(|| "Δt".into()),
        heads,
    );
    let rows = kinds.iter().map(|kind| {
        let mut name = format!("{}, {}", kind.hydrodynamics, kind.contact);
        if has_law {
            let _ = write!(name, ", {}", kind.tangential);
        }
        cells(
            name,
            has_step.then(|| kind.time_step.to_string()),
            [
                kind.spheres.to_string(),
                kind.cases.to_string(),
                format!("{} ms", significant(1e3 * kind.step_s, 2)),
                duration(kind.computing_time_s),
                bytes(kind.memory_bytes),
                match kind.source {
                    Source::Runs => "runs",
                    Source::Trial => "trial",
                    Source::Rough => "guess",
                }
                .to_owned(),
            ],
        )
    });
    table(width, heads, rows)
}

#[cfg(test)]
mod tests {
    use super::listed;

    #[test]
    fn a_list_of_a_million_values_is_short_and_comes_at_once() {
        let seeds: Vec<serde_json::Value> = (1..=1_000_000).map(Into::into).collect();
        assert_eq!(listed(&seeds, 30), "1, 2, 3, 4, 5, 6, 7, … 1000000");
        assert_eq!(listed(&seeds[..3], 30), "1, 2, 3");
        assert_eq!(listed(&seeds[..3], 5), "1, … 3");
    }
}
