//! Progress of a campaign and of its submitted jobs, and cancelling these.

use super::slurm::{self, ActiveTask};
use super::{ClusterError, shard};
use crate::measure::Verdict;
use crate::store::{
    Counts, FailureLine, PointState, ProcessLine, SliceState, Store, StoreError, Submission,
};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Maximum time to wait for tasks that are ending.
const WAIT: Duration = Duration::from_mins(2);
/// Interval between checks of them.
const LOOK: Duration = Duration::from_secs(1);

/// Progress of a campaign.
#[derive(Serialize)]
pub(crate) struct CampaignStatus {
    pub(crate) campaign: String,
    /// The file the store was last run with, if it is another version of the file given.
    pub(crate) last_run_with: Option<PathBuf>,
    /// Runs in the store that the campaign no longer contains.
    pub(crate) orphans: u64,
    pub(crate) cases: Counts,
    /// Mean fraction at which runs came to rest under an imposed ratio of stress and pressure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) arrested_fraction: Option<f64>,
    /// Share of the estimated work that is done, 0 to 1.
    pub(crate) work_done: f64,
    /// Estimated CPU seconds of the open cases on this machine.
    pub(crate) remaining_cpu_s: f64,
    /// Points with a requested precision, and how many of them still need an unknown number of
    /// seeds.
    pub(crate) precision: Option<PrecisionStatus>,
    pub(crate) processes: Vec<ProcessLine>,
    pub(crate) failures: Vec<FailureLine>,
    /// Jobs that were submitted, with their tasks.
    pub(crate) jobs: Vec<JobStatus>,
    /// Builds of the program that computed the results.
    pub(crate) builds: Vec<String>,
}

/// Points with a requested precision, by outcome.
#[derive(Serialize)]
pub(crate) struct PrecisionStatus {
    pub(crate) points: usize,
    pub(crate) reached: usize,
    pub(crate) open: usize,
}

impl PrecisionStatus {
    fn of(store: &Store) -> Result<Option<Self>, StoreError> {
        let states = store.point_states()?;
        let number = |verdict: Verdict| {
            let is = |state: &&PointState| state.decision.verdict == verdict;
            states.iter().filter(is).count()
        };
        Ok((!states.is_empty()).then(|| Self {
            points: states.len(),
            reached: number(Verdict::Reached),
            open: number(Verdict::Open),
        }))
    }
}

impl CampaignStatus {
    /// The status of an open store, with a maximum number of failures.
    pub(crate) fn of(store: &Store, failures: u32) -> Result<Self, ClusterError> {
        store.verify()?;
        let work = store.work()?;
        Ok(Self {
            campaign: store.campaign_name()?,
            last_run_with: store.last_run_with().map(PathBuf::from),
            orphans: store.orphans()?,
            cases: work.counts,
            arrested_fraction: store.arrested_fraction()?,
            work_done: if work.total > 0.0 {
                work.done / work.total
            } else {
                1.0
            },
            remaining_cpu_s: store.remaining_cpu_s(&work)?,
            precision: PrecisionStatus::of(store)?,
            processes: store.processes()?,
            failures: store.failures(failures)?,
            jobs: jobs(store)?,
            builds: store.builds()?,
        })
    }
}

/// A job and its tasks.
#[derive(Serialize)]
pub(crate) struct JobStatus {
    #[serde(flatten)]
    pub(crate) submission: Submission,
    /// Why the state of its tasks is unknown.
    pub(crate) problem: Option<String>,
    pub(crate) tasks: Vec<TaskStatus>,
}

/// A task and its slice.
#[derive(Serialize)]
pub(crate) struct TaskStatus {
    #[serde(rename = "task")]
    pub(crate) number: usize,
    /// State by the scheduler, or `done`, `ended`, `pending`, `unknown`.
    pub(crate) state: String,
    /// The node it is on, or was last.
    pub(crate) node: String,
    /// Number of restarts, as recorded in its shards.
    pub(crate) restarts: u32,
    pub(crate) published_s: Option<f64>,
    /// Progress of its slice.
    #[serde(flatten)]
    pub(crate) slice: SliceState,
}

/// The jobs submitted from a store.
pub(crate) fn jobs(store: &Store) -> Result<Vec<JobStatus>, ClusterError> {
    let submissions = store.submissions()?.into_iter();
    submissions
        .map(|submission| job(store, submission))
        .collect()
}

fn job(store: &Store, submission: Submission) -> Result<JobStatus, ClusterError> {
    let slices = store.slice_states(submission.id, submission.tasks)?;
    let is_over = slices.iter().all(|slice| slice.ended == slice.cases);
    let asked = match &submission.job {
        _ if is_over => Ok(Vec::new()),
        Some(job) => slurm::active(job).map_err(|error| error.to_string()),
        None => Err("submitting was cut short before its number was known".into()),
    };
    let (active, problem) = match asked {
        Ok(active) => (active, None),
        Err(problem) => (Vec::new(), Some(problem)),
    };
    let shards = shard::published(&submission.folder);
    let task = |(number, slice): (usize, SliceState)| {
        let last = shards
            .iter()
            .filter(|shard| shard.plan == submission.plan && shard.task.task == number)
            .max_by_key(|shard| shard.at);
        let published = last.and_then(|shard| shard.at);
        // Published results count, merged or not.
        let found = last.and_then(|shard| Store::slice_of_shard(&shard.path).ok());
        let slice = match found {
            Some(found) if found.work_done > slice.work_done => SliceState {
                cases: slice.cases,
                ..found
            },
            _ => slice,
        };
        let at_work = active.iter().find(|task| task.task == number);
        let node = at_work.map(|task| &task.node);
        let node = node.filter(|node| !node.is_empty());
        TaskStatus {
            number,
            state: state(at_work, problem.is_some(), slice),
            node: node
                .or(last.map(|shard| &shard.task.node))
                .cloned()
                .unwrap_or_default(),
            restarts: last.map_or(0, |shard| shard.task.restart),
            published_s: published
                .and_then(|at| at.elapsed().ok())
                .map(|since| since.as_secs_f64()),
            slice,
        }
    };
    let tasks = slices.into_iter().enumerate().map(task).collect();
    Ok(JobStatus {
        submission,
        problem,
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

/// The jobs that were cancelled.
#[derive(Serialize)]
pub(crate) struct Cancelled {
    pub(crate) cancelled: Vec<String>,
    /// Tasks that have not ended yet.
    pub(crate) ending: usize,
}

/// Ends the tasks of a campaign, and waits for them, for some time.
pub(crate) fn cancel(path: &Path) -> Result<Cancelled, ClusterError> {
    let mut store = Store::open(path)?;
    let mut cancelled = Vec::new();
    for submission in store.submissions()? {
        let Some(job) = submission.job else {
            continue;
        };
        if slurm::active(&job)?.is_empty() {
            continue;
        }
        // Written before the tasks are signalled: a task that finds the mark does not request a
        // restart. Without the mark tasks ask Slurm, with the same result.
        let mark = shard::cancel_mark(&submission.folder, &submission.plan, &job);
        if let Some(folder) = mark.parent() {
            let _ = std::fs::create_dir_all(folder);
        }
        let _ = std::fs::write(&mark, "");
        slurm::cancel(&job)?;
        store.cancelled(submission.id)?;
        cancelled.push(job);
    }
    let begun = Instant::now();
    let ending = loop {
        let mut ending = 0;
        for job in &cancelled {
            ending += slurm::active(job)?.len();
        }
        if ending == 0 || begun.elapsed() >= WAIT {
            break ending;
        }
        std::thread::sleep(LOOK);
    };
    Ok(Cancelled { cancelled, ending })
}
