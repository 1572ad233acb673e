//! Handing what a campaign lacks to a scheduler, as one array of tasks.

use super::folder::{Draft, write_plan};
use super::{Arguments, run_arguments};
use crate::api::Error;
use crate::api::plan::memory_bytes;
use crate::campaign::Campaign;
use crate::cli::Output;
use crate::cluster::{Job, Scheduler, SchedulerError, shard, shard::Slices};
use crate::store::{OpenCase, Store, Submission};
use std::collections::HashSet;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// Seconds of a task aimed at where no time limit is given.
const USUAL_TIME_S: f64 = 3600.0;

/// What was submitted, or would be.
pub(super) struct Submitted {
    /// Its name for the scheduler, unless nothing was submitted.
    pub(super) name: Option<String>,
    pub(super) cases: usize,
    /// Hash of the slices.
    pub(super) plan: String,
    pub(super) job: Job,
    pub(super) script: String,
    /// Estimated seconds of CPU of all of it.
    pub(super) cpu_s: f64,
    /// Memory of a task, in bytes.
    pub(super) memory_bytes: f64,
}

/// Merges the shards there are and submits the open cases of a campaign; `None` if there are none.
pub(super) fn submit(
    arguments: &Arguments,
    scheduler: &Scheduler,
    campaign: &Campaign,
    path: &Path,
    output: &Output<'_>,
) -> Result<Option<Submitted>, Error> {
    let limit = match scheduler.task_limit() {
        Err(SchedulerError::Missing { .. }) if arguments.dry_run => {
            crate::cluster::slurm::USUAL_ARRAY
        }
        limit => limit?,
    };
    let folder = shard::folder_of(path);
    let draft = Draft::new(arguments.dry_run, path)?;
    let mut store = draft.open(campaign)?;
    gather(arguments, &mut store, &folder, output)?;
    let open = open(arguments, &store, output)?;
    if open.is_empty() {
        return Ok(None);
    }
    let tasks = tasks(arguments, &open, limit)?;
    let slices = Slices::cut(&open, tasks);
    let text = campaign.text_elsewhere();
    let plan = slices.plan(&text);
    let job = Job {
        campaign: campaign.name.clone(),
        program: folder.join(format!("sweep-{}", crate::system::process::build())),
        plan_folder: shard::plan_folder(&folder, &plan),
        folder,
        tasks,
        workers: arguments.workers_per_task.get(),
        throttle: arguments.throttle.map(NonZeroUsize::get),
        run_arguments: run_arguments(arguments)?,
    };
    let script = scheduler.script(&job)?;
    let name = if arguments.dry_run {
        None
    } else {
        let tasks_read = [
            ("campaign.toml", text.as_str()),
            ("slices", &slices.text(&plan)),
        ];
        write_plan(&job, &store, campaign, &open, tasks_read, &script)?;
        Some(hand_over(scheduler, &job, &plan, &slices, &mut store)?)
    };
    Ok(Some(Submitted {
        name,
        cases: open.len(),
        plan,
        script,
        cpu_s: store.remaining_cpu_s(&store.work()?)?,
        memory_bytes: memory_bytes(campaign, job.workers),
        job,
    }))
}

/// Number of tasks: as many as asked for, if so many may be and have anything to do.
fn tasks(arguments: &Arguments, open: &[OpenCase], limit: usize) -> Result<usize, SchedulerError> {
    let asked = arguments.tasks.map(NonZeroUsize::get);
    let asked = asked.unwrap_or_else(|| usual_tasks(arguments, open, limit));
    if asked > limit {
        return Err(SchedulerError::TooManyTasks { asked, limit });
    }
    Ok(asked.min(open.len()))
}

/// Records the job and hands it to the scheduler; gives its name.
fn hand_over(
    scheduler: &Scheduler,
    job: &Job,
    plan: &str,
    slices: &Slices,
    store: &mut Store,
) -> Result<String, Error> {
    let submission = Submission {
        id: 0,
        engine: scheduler.name().into(),
        job: None,
        plan: plan.to_owned(),
        folder: job.folder.clone(),
        tasks: job.tasks,
        workers: job.workers,
        build: crate::system::process::build(),
        submitted_at: 0,
        cancelled_at: None,
    };
    let id = store.submit(&submission, &slices.tasks)?;
    match scheduler.submit(job) {
        Ok(name) => {
            store.submitted(id, &name)?;
            Ok(name)
        }
        Err(error) => {
            // After an answer nobody understands the job may be there all the same.
            if !matches!(error, SchedulerError::Answer { .. }) {
                store.not_submitted(id)?;
            }
            Err(error.into())
        }
    }
}

/// Brings the store up to date: shards there are, failed cases to be tried again; refuses to mix builds.
fn gather(
    arguments: &Arguments,
    store: &mut Store,
    folder: &Path,
    output: &Output<'_>,
) -> Result<(), Error> {
    let shards: Vec<PathBuf> = shard::published(folder)
        .into_iter()
        .map(|shard| shard.path)
        .collect();
    let merged = store.merge(&shards, arguments.allow_mixed_versions)?;
    for damaged in &merged.damaged {
        output.note(&format!(
            "not merged: {}: {}",
            damaged.path.display(),
            damaged.reason
        ));
    }
    let (build, known) = (crate::system::process::build(), store.known_builds()?);
    if !arguments.allow_mixed_versions && !known.is_empty() && !known.contains(&build) {
        return Err(Error::Argument {
            argument: "--allow-mixed-versions",
            message: format!(
                "the store holds what build {} of sweep computed, and this is build {build}, whose bits may differ: use \
                 that one, another --store, or allow it; nothing was submitted",
                known.into_iter().collect::<Vec<_>>().join(", ")
            ),
        });
    }
    if arguments.retry_failed {
        store.retry_failed()?;
    }
    Ok(())
}

/// Open cases that no task has.
fn open(arguments: &Arguments, store: &Store, output: &Output<'_>) -> Result<Vec<OpenCase>, Error> {
    let mut taken: HashSet<String> = HashSet::new();
    for submission in store.submissions()? {
        if arguments.again {
            break;
        }
        let Some(job) = &submission.job else {
            output.note(
                "a submission before was cut short before its job number was known: look with `squeue --me` whether it \
                 runs. What it computes is merged in any case",
            );
            continue;
        };
        let cases = store.open_of(submission.id)?;
        if cases.is_empty() {
            continue;
        }
        let Some(scheduler) = Scheduler::by_name(&submission.engine) else {
            continue;
        };
        let active = scheduler.active(job).map_err(|error| Error::Argument {
            argument: "--again",
            message: format!(
                "whether job {job}, submitted before, still runs is not known ({error}): give the same command again in a \
                 while, or with --again to submit its open cases once more"
            ),
        })?;
        if active.is_empty() {
            continue;
        }
        let all = active.iter().any(|task| task.task.is_none());
        let tasks: HashSet<usize> = active.iter().filter_map(|task| task.task).collect();
        taken.extend(
            cases
                .into_iter()
                .filter(|(_, task)| all || tasks.contains(task))
                .map(|(key, _)| key),
        );
    }
    let mut open = store.open_cases()?;
    open.retain(|case| !taken.contains(&case.key));
    Ok(open)
}

/// So many tasks that each needs about half of its time by the estimate, which is no promise.
fn usual_tasks(arguments: &Arguments, open: &[OpenCase], limit: usize) -> usize {
    let time = arguments.time.as_ref();
    let time = time.map_or(USUAL_TIME_S, |limit| limit.time.as_secs_f64());
    let cost: f64 = open.iter().map(|case| case.cost).sum();
    let workers = arguments.workers_per_task.get();
    let tasks = crate::format::count((cost / (workers as f64 * time / 2.0)).ceil());
    tasks.clamp(1, limit.min(open.len().div_ceil(workers)).max(1))
}
