//! `sweep run`.

mod task;

use super::Output;
use super::place::{ThreadsArgument, WorkersArgument, print_warning, store_of};
use super::words::choice;
use crate::cluster::status::jobs;
use crate::cluster::task::TaskOf;
use crate::error::Error;
use crate::model::campaign::Campaign;
use crate::runner::{
    Options, Progress, Reason, RunObserver, StartOptions, StartedCampaign, Stop, Style, begin,
    complete,
};
use crate::store::{Adoption, Counts, Finding, Inventory, Store};
use crate::system::disk::network_file_system;
use crate::system::exit;
use crate::text::format::{bytes, counted, parse_duration, parse_positive_duration};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Compute the open runs of a campaign, then print its report
///
/// Finished runs in the store are not computed again. A signal (Ctrl-C) checkpoints and stops; a
/// second one aborts. The same command continues, with the same bits as without the interruption.
/// Several processes may run the same campaign on one machine: they share its cases. A case of a
/// dead process continues from its last checkpoint: immediately on the same machine, after two
/// minutes without a heartbeat on another. If its processes die five times in a row without a new
/// checkpoint, it ends as failed.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep run sweeps/quickstart.toml\n  sweep run sweeps/figure-11.toml --workers 8 --store /scratch/figure-11.sqlite\n  \
                  sweep run sweeps/figure-11.toml --time-limit 2h\n  \
                  sweep run sweeps/figure-11.toml --progress json\n  \
                  sweep run sweeps/figure-11.toml --shard 3/24"
)]
pub(crate) struct Arguments {
    /// The campaign file
    campaign: PathBuf,
    /// The store [default: results/NAME.sqlite in the folder that holds `sweeps/`, or beside the
    /// file]
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    #[command(flatten)]
    workers: WorkersArgument,
    #[command(flatten)]
    threads: ThreadsArgument,
    /// Compute failed cases again
    #[arg(long)]
    retry_failed: bool,
    /// Computing time after which a case ends as failed, as 90s, 15m or 2h [default: 50 times its
    /// estimate, at least half an hour]
    #[arg(long, value_name = "TIME", value_parser = parse_positive_duration)]
    max_wall_time: Option<Duration>,
    /// Wall time after which the program checkpoints and stops, as 90s, 15m or 2h; the same command
    /// continues
    #[arg(long, value_name = "TIME", conflicts_with = "shard", value_parser = parse_positive_duration)]
    time_limit: Option<Duration>,
    /// Progress on standard error: bars, lines, lines of JSON, or nothing [default: bars on a
    /// terminal, else lines]
    #[arg(long, value_name = "HOW", value_parser = choice::<Style>())]
    progress: Option<Style>,
    /// Keep a frame at every sampled strain of every run, for `sweep structure`, `sweep export` and
    /// movies; runs begun or finished without them are computed again, and later commands keep them
    /// too
    #[arg(long)]
    trajectory: bool,
    #[command(flatten)]
    cluster: ClusterArguments,
}

/// One task of a cluster, and its folders.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "One task of a cluster")]
#[group(requires = "shard")]
pub(crate) struct ClusterArguments {
    /// Compute slice I (from 0) of N in a separate store and publish it as a shard. TERM and USR1
    /// checkpoint, publish, and have Slurm restart the task if work is left
    #[arg(long, value_name = "I/N", conflicts_with = "store", value_parser = part, hide_short_help = true)]
    shard: Option<TaskOf>,
    /// File of slices from `sweep submit` [default: cut all cases of the file]
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    slices: Option<PathBuf>,
    /// Folder for shards [default: NAME.shards beside the store]
    #[arg(long, value_name = "DIR", hide_short_help = true)]
    shards: Option<PathBuf>,
    /// Local disk to work on [default: SLURM_TMPDIR, or else the folder of shards]
    #[arg(long, value_name = "DIR", hide_short_help = true)]
    scratch: Option<PathBuf>,
    /// Time between publications, as 90s or 2m: the most that a crash can lose
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = parse_duration, hide_short_help = true)]
    publish_every: Duration,
}

/// Reads `I/N`.
fn part(text: &str) -> Result<TaskOf, String> {
    text.split_once('/')
        .and_then(|(task, tasks)| {
            Some(TaskOf {
                task: task.parse().ok()?,
                tasks: tasks.parse().ok()?,
            })
        })
        .filter(|part| part.task < part.tasks && part.tasks <= 1_000_000)
        .ok_or_else(|| "write I/N with I from 0 to N - 1, as in 0/24".to_owned())
}

/// Form of the progress display.
fn style(arguments: &Arguments, output: &Output<'_>) -> Style {
    match (
        arguments.progress,
        output.quiet,
        std::io::stderr().is_terminal(),
    ) {
        (Some(style), ..) => style,
        (None, true, _) => Style::Quiet,
        (None, false, true) => Style::Bars,
        (None, false, false) => Style::Lines,
    }
}

/// Computes the open cases and prints the report.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let campaign = crate::campaign::read(&arguments.campaign)?;
    super::plan::check_memory(&campaign)?;
    if let Some(part) = arguments.cluster.shard {
        return task::run(arguments, part, campaign, output);
    }
    let stop = Stop::on_signals()?;
    if let Some(limit) = arguments.time_limit {
        stop.after(limit);
    }
    let style = style(arguments, output);
    let path = store_of(&campaign, arguments.store.as_deref())?;
    let folder = path.parent().filter(|folder| !folder.exists());
    if let Some(folder) = folder.filter(|_| arguments.store.is_some()) {
        style.note(&format!("{} is a new folder", folder.display()));
    }
    if let Some(network) = network_file_system(&path) {
        style.note(&format!(
            "warning: {} is on a network file system ({network}), where several machines cannot safely share a store: run it \
             from one machine only, or choose a local disk with --store FILE",
            path.display()
        ));
    }
    let beginning = StartOptions {
        retry_failed: arguments.retry_failed,
        trajectory: arguments.trajectory,
    };
    let StartedCampaign {
        mut store,
        adoption,
        damaged,
        without_frames,
    } = begin(&path, &campaign, beginning)?;
    print_warning(&store);
    if let Some(warning) = campaign.warning() {
        style.note(&format!("warning: {warning}"));
    }
    print_damage(&damaged, style);
    print_inventory(&campaign, &path, adoption, style);
    print_tasks(&store, &campaign, style)?;
    if without_frames > 0 {
        style.note(&format!(
            "{} without all frames of the averaged strain: computed again, with the same digits",
            counted(without_frames, "begun or finished run")
        ));
    }
    let counts = compute(arguments, &campaign, &mut store, (&stop, None), style)?;
    let is_over = counts.pending + counts.running == 0;
    let code = match stop.reason() {
        // The time limit was reached without work left.
        Some(Reason::TimeLimit) if is_over && counts.failed > 0 => exit::FAILED,
        Some(Reason::TimeLimit) if is_over => exit::DONE,
        Some(reason) => reason.exit_code(),
        None if counts.failed > 0 => exit::FAILED,
        None => exit::DONE,
    };
    match super::report::write(&store, output) {
        // The reader closed standard output; the exit code stays that of the runs.
        Err(error) if error.is_closed_pipe() => {}
        written => written?,
    }
    if stop.reason().is_some() && !is_over {
        style.note("stopped: the same command continues from the last checkpoints");
    }
    Ok(code)
}

/// Notes how a changed campaign compares with its store: runs kept, new, and no longer in the
/// campaign.
fn print_inventory(campaign: &Campaign, path: &Path, adoption: Adoption, style: Style) {
    let Inventory {
        orphans,
        orphan_bytes,
        ..
    } = adoption.inventory;
    if adoption.changed {
        let name = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
        style.note(&format!(
            "{} differs from the last campaign in {}: {}",
            name(&campaign.file),
            name(path),
            adoption.inventory.words()
        ));
    }
    if orphans > 0 {
        style.note(&format!(
            "{orphans} runs in {} (about {}) belong to other versions of the campaign; they are kept, and `sweep prune {}` removes them",
            path.display(),
            bytes(orphan_bytes),
            campaign.file.display()
        ));
    }
}

/// Notes the open cases of tasks that have not ended, which are computed twice.
fn print_tasks(store: &Store, campaign: &Campaign, style: Style) -> Result<(), Error> {
    let jobs = jobs(store)?;
    let tasks = jobs.iter().flat_map(|job| &job.tasks);
    let open: u64 = tasks
        .filter(|task| !matches!(task.state.as_str(), "done" | "ended" | "unknown"))
        .map(|task| task.slice.cases - task.slice.ended)
        .sum();
    if open > 0 {
        style.note(&format!(
            "{} of submitted tasks that have not ended: this run computes them a second time, unless you stop it or \
             `sweep cancel {}`",
            counted(open, "open case"),
            campaign.file.display()
        ));
    }
    Ok(())
}

/// Notes the damaged runs, which are computed again.
fn print_damage(damaged: &[Finding], style: Style) {
    for finding in damaged {
        let whose = finding
            .key
            .as_ref()
            .map(|key| format!(" ({key}, which is computed again)"));
        style.note(&format!(
            "damaged: {}{}",
            finding.what,
            whose.unwrap_or_default()
        ));
    }
}

/// Computes the cases of a store. Returns their number by state.
fn compute(
    arguments: &Arguments,
    campaign: &Campaign,
    store: &mut Store,
    (stop, observer): (&Stop, Option<&dyn RunObserver>),
    style: Style,
) -> Result<Counts, Error> {
    let cases = campaign.cases.len();
    let (workers, threads, note) = arguments.threads.shared(&arguments.workers, cases);
    if let Some(note) = note {
        style.note(&note);
    }
    let progress = Progress::new(style, workers, Box::new(std::io::stderr()));
    let options = Options {
        workers,
        threads,
        wall_limit: arguments.max_wall_time,
        observer,
        stop,
        progress: &progress,
    };
    Ok(complete(store, campaign, options)?)
}
