//! `sweep status`.

use super::Output;
use super::cluster::write_builds;
use super::place::{StoreArguments, last_run, print_warning};
use crate::cluster::shard;
use crate::cluster::status::{CampaignStatus, JobStatus, TaskStatus};
use crate::error::Error;
use crate::report::FailureGroup;
use crate::system::exit;
use crate::text::format::{counted, duration, significant};
use crate::text::table::table;
use std::io::Write;
use std::path::Path;

/// Maximum number of failures to list.
const FAILURES: u32 = 10;
/// Maximum number of tasks to list.
const TASKS: usize = 50;

/// Show the progress of a campaign
///
/// Reads only and needs no write access; works while the campaign runs.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep status results/quickstart.sqlite\n  sweep status sweeps/quickstart.toml --json"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    let (path, store) = (source.path(), source.open()?);
    print_warning(&store);
    let status = CampaignStatus::of(&store, FAILURES)?;
    if output.json {
        output.json(&status)?;
    } else {
        let failures = FailureGroup::of(store.failures(u32::MAX)?);
        write_text(&status, path, arguments, output)?;
        write_failures(&failures, arguments, output)?;
    }
    Ok(exit::DONE)
}

/// Writes all but the failures.
fn write_text(
    status: &CampaignStatus,
    store: &Path,
    arguments: &Arguments,
    output: &mut Output<'_>,
) -> Result<(), Error> {
    let (c, file) = (&status.cases, arguments.place.file.display());
    let heads = ["cases", "done", "jammed", "failed", "running", "pending"];
    // Those of a process that has ended wait for the next.
    let ended = status.processes.iter().filter(|process| !process.alive);
    let left: u64 = ended.map(|process| process.running).sum();
    let (running, pending) = (c.running.saturating_sub(left), c.pending + left);
    let row = [c.total(), c.done, c.jammed, c.failed, running, pending];
    let table = table(output.width, heads, [row]);
    let out = &mut *output.out;
    writeln!(
        out,
        "{}: {}{}",
        status.campaign,
        match c.pending + c.running {
            0 => format!("all {} runs have ended", c.total()),
            // Never shown as complete while work remains.
            _ => format!(
                "about {:.1} % of the work is done",
                (100.0 * status.work_done).min(99.9)
            ),
        },
        if c.failed > 0 {
            format!(", and {} of {} runs failed", c.failed, c.total())
        } else {
            String::new()
        }
    )?;
    if c.pending + c.running > 0 {
        writeln!(
            out,
            "about {} of CPU time left",
            duration(status.remaining_cpu_s)
        )?;
    }
    if let Some(precision) = &status.precision {
        writeln!(
            out,
            "precision: reached at {} of {} points; {} still need seeds, perhaps more than counted here",
            precision.reached, precision.points, precision.open
        )?;
    }
    if let Some(last) = &status.last_run_with {
        writeln!(out, "{}", last_run(store, last, &arguments.place.file))?;
    }
    if status.orphans > 0 {
        writeln!(
            out,
            "{} in the store belong to other versions of the campaign: sweep prune {file} removes them",
            counted(status.orphans, "run")
        )?;
    }
    writeln!(out, "{table}")?;
    if let Some(fraction) = status.arrested_fraction {
        writeln!(
            out,
            "{}, at a mean fraction of {}",
            c.words_of_jammed(),
            significant(fraction, 4)
        )?;
    }
    for process in &status.processes {
        writeln!(
            out,
            "process {} on {}: {}, {}",
            process.pid,
            process.host,
            counted(process.running, "case"),
            if process.alive {
                format!("last heartbeat {} ago", duration(process.silent_s))
            } else {
                "but it has ended: `sweep run` continues them from their last checkpoints".into()
            }
        )?;
    }
    write_tasks(&status.jobs, output.width, out, &arguments.place.file)?;
    write_builds(&status.builds, out)?;
    Ok(())
}

/// Writes the submitted jobs and their open tasks.
fn write_tasks(
    jobs: &[JobStatus],
    width: Option<u16>,
    out: &mut dyn Write,
    store: &Path,
) -> Result<(), Error> {
    for job in jobs {
        let s = &job.submission;
        let done = |task: &&TaskStatus| task.slice.ended == task.slice.cases;
        writeln!(
            out,
            "job {}{}: {} tasks, {} of their slices done",
            s.job.as_deref().unwrap_or("without a number"),
            if s.cancelled_at.is_some() {
                ", cancelled"
            } else {
                ""
            },
            job.tasks.len(),
            job.tasks.iter().filter(done).count(),
        )?;
        if let Some(problem) = &job.problem {
            writeln!(out, "its tasks are unknown: {problem}")?;
        }
        let open: Vec<&TaskStatus> = job.tasks.iter().filter(|task| !done(task)).collect();
        if open.is_empty() {
            continue;
        }
        let heads = "task state node restarts cases ended work published".split(' ');
        let rows = open.iter().take(TASKS).map(|task| {
            [
                task.number.to_string(),
                task.state.clone(),
                task.node.clone(),
                task.restarts.to_string(),
                task.slice.cases.to_string(),
                task.slice.ended.to_string(),
                format!("{:.0} %", 100.0 * task.slice.work_done),
                task.published_s
                    .map_or_else(|| "–".into(), |s| format!("{} ago", duration(s))),
            ]
        });
        writeln!(out, "{}", table(width, heads, rows))?;
        if open.len() > TASKS {
            writeln!(out, "and {} more tasks", open.len() - TASKS)?;
        }
        let waiting = open.iter().any(|task| task.state == "ended");
        if waiting && job.problem.is_none() {
            writeln!(
                out,
                "tasks ended with work left: after `sweep merge {}`, `sweep submit` continues; their logs are in {}",
                store.display(),
                shard::plan_folder(&s.folder, &s.plan).display()
            )?;
        }
    }
    Ok(())
}

/// Writes the failures, similar ones grouped.
fn write_failures(
    groups: &[FailureGroup],
    arguments: &Arguments,
    output: &mut Output<'_>,
) -> Result<(), Error> {
    let out = &mut *output.out;
    let listed = FAILURES as usize;
    for group in groups.iter().take(listed) {
        writeln!(out, "{}", group.text())?;
    }
    if groups.len() > listed {
        writeln!(out, "and {} more kinds of failures", groups.len() - listed)?;
    }
    if !groups.is_empty() {
        writeln!(
            out,
            "to solve the state before a failure: sweep replay {} CASE | sweep solve -",
            arguments.place.file.display()
        )?;
    }
    Ok(())
}
