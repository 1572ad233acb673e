//! `sweep submit`, `sweep merge` and `sweep cancel`.

use super::Output;
use super::place::{StoreArguments, positive, print_warning, store_of, workers};
use crate::cluster::merge::{Joined, join, shards_in, store_for};
use crate::cluster::slurm::SCRIPT_OPTIONS;
use crate::cluster::submit::{self, SubmitOptions};
use crate::cluster::{ClusterError, quoted, status};
use crate::error::Error;
use crate::system::exit;
use crate::text::format::{counted, parse_duration, parse_positive_duration};
use serde::Serialize;
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Submit the open runs of a campaign to Slurm, as one array of tasks
///
/// Merges the published shards, cuts the open cases into slices of equal estimated cost, and
/// submits one array job whose tasks compute one slice each with `sweep run --shard`. A task that
/// reaches its time limit checkpoints and is restarted until its slice is done. Cases of earlier
/// tasks that still run are left out. No environment is exported to the tasks; the program is
/// copied into the folder of shards, so that it may be rebuilt meanwhile.
#[derive(Debug, clap::Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches of the command line"
)]
#[command(
    after_help = "Examples:\n  sweep submit sweeps/figure-11.toml --tasks 200 --time 4h --dry-run\n  \
                  sweep submit sweeps/figure-11.toml --time 12h --throttle 50 --sbatch-arg=--partition=short\n  \
                  sweep status sweeps/figure-11.toml && sweep merge sweeps/figure-11.toml && sweep report sweeps/figure-11.toml"
)]
pub(crate) struct SubmitArguments {
    /// The campaign file
    campaign: PathBuf,
    /// The store; shards go to the folder beside it [default: results/NAME.sqlite in the folder
    /// that holds `sweeps/`, or beside the file]
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Number of tasks [default: each needs about half of --time]
    #[arg(long, value_name = "N", value_parser = positive)]
    tasks: Option<NonZeroUsize>,
    /// Cases that each task computes in parallel, one core each
    #[arg(long, value_name = "K", default_value = "1", value_parser = workers)]
    workers_per_task: NonZeroUsize,
    /// Maximum number of tasks that run at the same time
    #[arg(long, value_name = "N", value_parser = positive)]
    throttle: Option<NonZeroUsize>,
    /// Time limit of a task, as 90m or 12h [default: the site's]
    #[arg(long, value_name = "TIME", value_parser = parse_positive_duration)]
    time: Option<Duration>,
    /// Argument of sbatch, as in --sbatch-arg=--partition=short, --sbatch-arg=--account=mine or
    /// --sbatch-arg=--mem=4G; repeatable
    #[arg(long, value_name = "ARG", allow_hyphen_values = true)]
    sbatch_arg: Vec<String>,
    /// Local disk of the nodes [default: SLURM_TMPDIR, or else the folder of shards]
    #[arg(long, value_name = "DIR")]
    scratch: Option<PathBuf>,
    /// Time between publications, as 90s or 2m: the most that a crash can lose
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = parse_duration)]
    publish_every: Duration,
    /// Computing time after which a case ends as failed, as 90s, 15m or 2h
    #[arg(long, value_name = "TIME", value_parser = parse_positive_duration)]
    max_wall_time: Option<Duration>,
    /// Keep a frame at every sampled strain, as for `sweep run`
    #[arg(long)]
    trajectory: bool,
    /// Compute failed cases again
    #[arg(long)]
    retry_failed: bool,
    /// Also submit cases that earlier tasks may still compute: costs time, but is harmless
    #[arg(long)]
    again: bool,
    /// Print the job without submitting it, and write nothing
    #[arg(long)]
    dry_run: bool,
}

#[derive(Default, Serialize)]
struct SubmitAnswer<'a> {
    /// The job, once it is submitted.
    job: Option<&'a str>,
    cases: usize,
    tasks: usize,
    /// Hash of the slices; this and all below are null without open cases.
    plan: Option<&'a str>,
    folder: Option<&'a Path>,
    /// The command that submits the script.
    command: Option<&'a [String]>,
    script: Option<&'a str>,
}

pub(crate) fn submit(arguments: &SubmitArguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let campaign = crate::campaign::read(&arguments.campaign)?;
    check(arguments)?;
    let wanted = SubmitOptions {
        tasks: arguments.tasks.map(NonZeroUsize::get),
        workers: arguments.workers_per_task.get(),
        throttle: arguments.throttle.map(NonZeroUsize::get),
        time: arguments.time,
        submit_arguments: arguments.sbatch_arg.clone(),
        run_arguments: run_arguments(arguments)?,
        retry_failed: arguments.retry_failed,
        trajectory: arguments.trajectory,
        again: arguments.again,
    };
    let path = store_of(&campaign, arguments.store.as_deref())?;
    let note = |text: &str| output.note(text);
    let submitted = submit::submit(wanted, &campaign, &path, arguments.dry_run, &note)?;
    let Some(submitted) = submitted else {
        if output.json {
            output.json(&SubmitAnswer::default())?;
        } else {
            writeln!(
                output.out,
                "nothing to submit: every case has ended or is assigned to a task"
            )?;
        }
        return Ok(exit::DONE);
    };
    let job = &submitted.job;
    if output.json {
        output.json(&SubmitAnswer {
            job: submitted.name.as_deref(),
            cases: submitted.cases,
            tasks: job.tasks,
            plan: Some(&submitted.plan),
            folder: Some(&job.folder),
            command: Some(&submitted.command),
            script: Some(&submitted.script),
        })?;
        return Ok(exit::DONE);
    }
    if let Some(name) = &submitted.name {
        writeln!(
            output.out,
            "job {name}: {} in {}; logs in {}",
            counted(submitted.cases, "open case"),
            counted(job.tasks, "task"),
            job.plan_folder.display()
        )?;
    } else {
        let words: Vec<String> = submitted.command.iter().map(|word| quoted(word)).collect();
        let script = &submitted.script;
        write!(output.out, "{}\n\n{script}", words.join(" "))?;
    }
    if !campaign.rules.is_empty() {
        output.note(
            "this is one wave: after a merge, `sweep submit` submits the seeds that the precision still needs",
        );
    }
    Ok(exit::DONE)
}

/// Refuses options of sbatch that the script sets.
fn check(arguments: &SubmitArguments) -> Result<(), Error> {
    let refused = |argument, message: String| Err(Error::Argument { argument, message });
    for argument in &arguments.sbatch_arg {
        let name = argument.split('=').next().unwrap_or_default();
        if SCRIPT_OPTIONS.contains(&name) {
            let message = "is set by sweep itself: see `sweep submit --dry-run`";
            return refused("--sbatch-arg", format!("{name} {message}"));
        }
        if !name.starts_with('-') {
            let message = "write an option with its value, as in --sbatch-arg=--mem=4G, not";
            return refused("--sbatch-arg", format!("{message} {argument:?}"));
        }
    }
    Ok(())
}

/// Arguments of every task.
fn run_arguments(arguments: &SubmitArguments) -> Result<Vec<String>, Error> {
    let mut run = vec![
        "--publish-every".to_owned(),
        format!("{}s", arguments.publish_every.as_secs_f64()),
    ];
    if let Some(scratch) = &arguments.scratch {
        let scratch = std::path::absolute(scratch)
            .ok()
            .and_then(|path| path.into_os_string().into_string().ok())
            .ok_or_else(|| ClusterError::Path {
                path: scratch.clone(),
            })?;
        run.extend(["--scratch".to_owned(), scratch]);
    }
    if let Some(limit) = arguments.max_wall_time {
        run.extend([
            "--max-wall-time".to_owned(),
            format!("{}s", limit.as_secs_f64()),
        ]);
    }
    if arguments.trajectory {
        run.push("--trajectory".into());
    }
    Ok(run)
}

/// Merge the shards that tasks published into the store of their campaign
///
/// May be repeated in any order, also while tasks run. Complete runs replace partial ones, and
/// later attempts earlier ones. Runs computed twice must agree to the last bit; disagreeing ones
/// are listed, and the exit code is 1. The same holds for a damaged shard, of which the intact part
/// is merged. This also recovers a damaged store into a new one; `sweep run` then recomputes the
/// rest with the same digits.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep merge results/figure-11.sqlite results/figure-11.shards\n  \
                  sweep merge results/figure-11.sqlite results/figure-11.shards/*.sqlite other-machine.sqlite\n  \
                  sweep merge saved.sqlite damaged.sqlite"
)]
pub(crate) struct MergeArguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Shards, or folders of them [default: the folder beside the store]
    shards: Vec<PathBuf>,
}

pub(crate) fn merge(arguments: &MergeArguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    let shards = shards_in(&arguments.shards, source.path())?;
    let mut store = store_for(&source, &shards)?;
    print_warning(&store);
    let joined = join(&mut store, &shards)?;
    let merged = &joined.merged;
    let intact = merged.damaged.is_empty() && merged.unreadable == 0;
    let clean = intact && merged.disagreements.is_empty();
    if output.json {
        output.json(&joined)?;
    } else {
        write_merged(&joined, output)?;
    }
    Ok(if clean { exit::DONE } else { exit::FAILED })
}

fn write_merged(answer: &Joined, output: &mut Output<'_>) -> Result<(), Error> {
    let (merged, cases, out) = (&answer.merged, &answer.cases, &mut *output.out);
    writeln!(
        out,
        "{} read: {}, {}, {}; {}",
        counted(merged.shards, "shard"),
        counted(merged.results, "new result"),
        counted(merged.failures, "failure"),
        counted(merged.checkpoints, "checkpoint"),
        match merged.duplicates {
            0 => "no result was known before".into(),
            known => format!(
                "{} known before, with the same bits",
                counted(known, "result")
            ),
        }
    )?;
    if merged.unreadable > 0 {
        writeln!(
            out,
            "damaged entries, which are recomputed: {}",
            merged.unreadable
        )?;
    }
    for damaged in &merged.damaged {
        writeln!(
            out,
            "cannot be read: {}: {}",
            damaged.path.display(),
            damaged.reason
        )?;
    }
    if !merged.damaged.is_empty() {
        writeln!(
            out,
            "running tasks publish theirs again; their other cases are open, and `sweep submit` continues them"
        )?;
    }
    for disagreement in &merged.disagreements {
        writeln!(
            out,
            "DISAGREE: {}: {}; kept: {}, not: {}",
            disagreement.key, disagreement.what, disagreement.kept, disagreement.other
        )?;
    }
    write_builds(&answer.builds, out)?;
    if answer.orphans > 0 {
        writeln!(
            out,
            "{} in the store belong to other versions of the campaign file: `sweep prune` removes them",
            counted(answer.orphans, "run")
        )?;
    }
    writeln!(
        out,
        "{} of {} cases are done, {}, {} failed",
        cases.done,
        cases.total(),
        cases.words_of_jammed(),
        cases.failed
    )?;
    Ok(())
}

/// Names the builds that computed the results, if there are several.
pub(super) fn write_builds(builds: &[String], out: &mut dyn Write) -> std::io::Result<()> {
    if builds.len() < 2 {
        return Ok(());
    }
    let builds: Vec<&str> = builds.iter().map(|b| b.get(..12).unwrap_or(b)).collect();
    let (number, builds) = (builds.len(), builds.join(", "));
    writeln!(
        out,
        "computed by {number} builds of sweep, whose bits may differ: {builds}"
    )
}

/// Cancel the submitted tasks of a campaign
///
/// Running tasks checkpoint and publish before they end; the command waits for them. `sweep submit`
/// continues from there.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: sweep cancel sweeps/figure-11.toml")]
pub(crate) struct CancelArguments {
    #[command(flatten)]
    place: StoreArguments,
}

pub(crate) fn cancel(arguments: &CancelArguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    let answer = status::cancel(source.path())?;
    if output.json {
        output.json(&answer)?;
    } else if answer.cancelled.is_empty() {
        writeln!(
            output.out,
            "no tasks of this campaign are pending or running"
        )?;
    } else {
        writeln!(output.out, "cancelled: {}", answer.cancelled.join(", "))?;
        if answer.ending > 0 {
            let ending = answer.ending;
            writeln!(output.out, "{ending} tasks have not ended yet")?;
        }
        writeln!(
            output.out,
            "`sweep merge {}` collects their results; `sweep submit` continues from there",
            arguments.place.file.display()
        )?;
    }
    Ok(exit::DONE)
}
