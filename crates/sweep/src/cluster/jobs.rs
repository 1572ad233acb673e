//! The submitted jobs of a campaign: progress of their tasks, and cancelling them.

use super::{ActiveTask, ClusterError, Scheduler, shard};
use crate::store::{SliceState, Store, Submission};
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant, UNIX_EPOCH};

/// Interval between checks of tasks that are ending.
const LOOK: Duration = Duration::from_secs(1);

/// A job and its tasks.
#[derive(Serialize)]
pub(crate) struct Jobs {
    #[serde(flatten)]
    pub(crate) submission: Submission,
    /// The scheduler's state of the job, in a few words, if it is reachable.
    pub(crate) problem: Option<String>,
    pub(crate) tasks: Vec<Task>,
}

/// A task and its slice.
#[derive(Serialize)]
pub(crate) struct Task {
    #[serde(rename = "task")]
    pub(crate) number: usize,
    /// State by the scheduler, or `ended`.
    pub(crate) state: String,
    /// The node it is on, or was last.
    pub(crate) node: String,
    /// Number of restarts, as recorded in its shards.
    pub(crate) restarts: u32,
    /// Seconds since it last published.
    pub(crate) published_s: Option<f64>,
    /// Progress of its slice.
    #[serde(flatten)]
    pub(crate) slice: SliceState,
}

/// All of them.
pub(crate) fn jobs(store: &Store) -> Result<Vec<Jobs>, ClusterError> {
    store
        .submissions()?
        .into_iter()
        .map(|submission| job(store, submission))
        .collect()
}

fn job(store: &Store, submission: Submission) -> Result<Jobs, ClusterError> {
    let slices = store.slice_states(submission.id, submission.tasks)?;
    let over = slices.iter().all(|slice| slice.ended == slice.cases);
    let asked = match (&submission.job, Scheduler::by_name(&submission.engine)) {
        _ if over => Ok(Vec::new()),
        (Some(job), Some(scheduler)) => scheduler.active(job).map_err(|error| error.to_string()),
        _ => Err("submitting was cut short before its number was known".into()),
    };
    let (active, problem) = match asked {
        Ok(active) => (active, None),
        Err(problem) => (Vec::new(), Some(problem)),
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
            // A task publishes as soon as it begins. Some file systems cut times to a second.
            let since_1970 = last.and_then(|shard| shard.at?.duration_since(UNIX_EPOCH).ok());
            let has_begun = since_1970.is_some_and(|at| {
                at.as_millis() + 1000 >= submission.submitted_at.unsigned_abs().into()
            });
            // Published results count, merged or not.
            let slice = last
                .and_then(|shard| Store::slice_of_shard(&shard.path).ok())
                .filter(|found| found.work_done > slice.work_done)
                .map_or(slice, |found| SliceState {
                    cases: slice.cases,
                    ..found
                });
            Task {
                number,
                state: state(at_work, problem.is_some(), slice, has_begun),
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
        problem,
        tasks,
    })
}

/// The state of a task in a word.
fn state(
    at_work: Option<&ActiveTask>,
    unknown: bool,
    slice: SliceState,
    has_begun: bool,
) -> String {
    match at_work {
        _ if slice.ended == slice.cases => "done".into(),
        // The local scheduler knows its tasks only together.
        Some(task) if task.task.is_none() && !has_begun => "pending".into(),
        Some(task) => task.state.to_lowercase(),
        None if unknown => "unknown".into(),
        None => "ended".into(),
    }
}

/// The jobs that were cancelled.
#[derive(Serialize)]
pub(crate) struct Cancelled {
    pub(crate) cancelled: Vec<String>,
    /// Tasks that have not ended yet.
    pub(crate) ending: usize,
}

/// Ends the tasks of one job, or of all of the campaign, and waits for that long until they have
/// ended.
pub(crate) fn cancel(
    path: &Path,
    job: Option<&str>,
    wait: Duration,
) -> Result<Cancelled, ClusterError> {
    let mut store = Store::open(path)?;
    let mut cancelled: Vec<(String, Scheduler)> = Vec::new();
    let named = |submission: &Submission| job.is_none() || submission.job.as_deref() == job;
    let submissions = store.submissions()?;
    if let Some(job) = job.filter(|_| !submissions.iter().any(named)) {
        return Err(ClusterError::NoJob { job: job.into() });
    }
    for submission in submissions.iter().filter(|submission| named(submission)) {
        let (Some(job), Some(scheduler)) =
            (&submission.job, Scheduler::by_name(&submission.engine))
        else {
            continue;
        };
        if scheduler.active(job)?.is_empty() {
            continue;
        }
        // Written before the tasks are signalled: a task that finds the mark does not request a
        // restart.
        let mark = shard::cancel_mark(&submission.folder, &submission.plan, job);
        if let Some(folder) = mark.parent() {
            let _ = std::fs::create_dir_all(folder);
        }
        // Without the mark the tasks query Slurm, with the same result.
        let _ = std::fs::write(&mark, "");
        scheduler.cancel(job)?;
        store.cancelled(submission.id)?;
        cancelled.push((job.clone(), scheduler));
    }
    let begun = Instant::now();
    let ending = loop {
        let mut ending = 0;
        for (job, scheduler) in &cancelled {
            ending += scheduler.active(job)?.len();
        }
        if ending == 0 || begun.elapsed() >= wait {
            break ending;
        }
        std::thread::sleep(LOOK);
    };
    Ok(Cancelled {
        cancelled: cancelled.into_iter().map(|(job, _)| job).collect(),
        ending,
    })
}
