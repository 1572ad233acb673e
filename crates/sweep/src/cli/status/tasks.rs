//! What `sweep status` says of tasks that were submitted.

use crate::api::Error;
use crate::cluster::{ActiveTask, Scheduler, shard};
use crate::report::table;
use crate::store::{SliceState, Store, Submission};
use serde::Serialize;
use std::io::Write;

/// Tasks listed at most.
const ROWS: usize = 50;

pub(super) fn write(
    jobs: &[Jobs],
    width: Option<u16>,
    out: &mut dyn Write,
    store: &std::path::Path,
) -> Result<(), Error> {
    for job in jobs {
        let s = &job.submission;
        let done = |task: &&Task| task.slice.ended == task.slice.cases;
        writeln!(
            out,
            "job {} on {}{}: {} tasks, {} of their slices done",
            s.job.as_deref().unwrap_or("without a number"),
            s.engine,
            if s.cancelled_at.is_some() {
                ", cancelled"
            } else {
                ""
            },
            job.tasks.len(),
            job.tasks.iter().filter(done).count(),
        )?;
        if let Some(trouble) = &job.trouble {
            writeln!(out, "its tasks cannot be asked for: {trouble}")?;
        }
        let open: Vec<&Task> = job.tasks.iter().filter(|task| !done(task)).collect();
        if open.is_empty() {
            continue;
        }
        let heads = "task state node restarts cases ended work published".split(' ');
        let rows = open.iter().take(ROWS).map(|task| {
            [
                task.number.to_string(),
                task.state.clone(),
                task.node.clone(),
                task.restarts.to_string(),
                task.slice.cases.to_string(),
                task.slice.ended.to_string(),
                format!("{:.0} %", 100.0 * task.slice.work_done),
                task.published_s.map_or_else(
                    || "–".into(),
                    |s| format!("{} ago", crate::format::duration(s)),
                ),
            ]
        });
        writeln!(out, "{}", table(width, heads, rows))?;
        if open.len() > ROWS {
            writeln!(out, "and {} more tasks", open.len() - ROWS)?;
        }
        let waiting = open.iter().any(|task| task.state == "ended");
        if waiting && job.trouble.is_none() {
            writeln!(
                out,
                "tasks ended with work left: `sweep merge {}`, then `sweep submit` goes on from there; their logs are in {}",
                store.display(),
                shard::plan_folder(&s.folder, &s.plan).display()
            )?;
        }
    }
    Ok(())
}

/// A job and its tasks.
#[derive(Serialize)]
pub(super) struct Jobs {
    #[serde(flatten)]
    submission: Submission,
    /// What the scheduler says of it, in a few words, if it can be asked.
    trouble: Option<String>,
    tasks: Vec<Task>,
}

/// A task and its slice.
#[derive(Serialize)]
struct Task {
    #[serde(rename = "task")]
    number: usize,
    /// What the scheduler says, or `ended`.
    state: String,
    /// The node it is on, or was last.
    node: String,
    /// Times it was started again, as far as its shards tell.
    restarts: u32,
    /// Seconds since it last published.
    published_s: Option<f64>,
    /// How far its slice is.
    #[serde(flatten)]
    slice: SliceState,
}

pub(super) fn jobs(store: &Store) -> Result<Vec<Jobs>, Error> {
    store
        .submissions()?
        .into_iter()
        .map(|submission| job(store, submission))
        .collect()
}

fn job(store: &Store, submission: Submission) -> Result<Jobs, Error> {
    let slices = store.slice_states(submission.id, submission.tasks)?;
    let over = slices.iter().all(|slice| slice.ended == slice.cases);
    let asked = match (&submission.job, Scheduler::by_name(&submission.engine)) {
        _ if over => Ok(Vec::new()),
        (Some(job), Some(scheduler)) => scheduler.active(job).map_err(|error| error.to_string()),
        _ => Err("submitting was cut short before its number was known".into()),
    };
    let (active, trouble) = match asked {
        Ok(active) => (active, None),
        Err(trouble) => (Vec::new(), Some(trouble)),
    };
    let shards = shard::published(&submission.folder);
    let tasks = slices
        .into_iter()
        .enumerate()
        .map(|(number, slice)| {
            let last = shards
                .iter()
                .filter(|shard| shard.plan == submission.plan && shard.task.task == number)
                .max_by_key(|shard| shard.at);
            let at_work = active
                .iter()
                .find(|task| task.task == Some(number) || task.task.is_none());
            // What is published counts, merged or not.
            let slice = last
                .and_then(|shard| Store::slice_of_shard(&shard.path).ok())
                .filter(|found| found.work_done > slice.work_done)
                .map_or(slice, |found| SliceState {
                    cases: slice.cases,
                    ..found
                });
            Task {
                number,
                state: state(at_work, trouble.is_some(), slice),
                node: at_work
                    .map(|task| task.node.clone())
                    .filter(|node| !node.is_empty())
                    .or_else(|| last.map(|shard| shard.task.node.clone()))
                    .unwrap_or_default(),
                restarts: last.map_or(0, |shard| shard.task.restart),
                published_s: last
                    .and_then(|shard| shard.at?.elapsed().ok())
                    .map(|since| since.as_secs_f64()),
                slice,
            }
        })
        .collect();
    Ok(Jobs {
        submission,
        trouble,
        tasks,
    })
}

/// The state of a task in a word.
fn state(at_work: Option<&ActiveTask>, unknown: bool, slice: SliceState) -> String {
    match at_work {
        _ if slice.ended == slice.cases => "done".into(),
        Some(task) => task.state.to_lowercase(),
        None if unknown => "unknown".into(),
        None => "ended".into(),
    }
}
