//! Submits the open cases of a campaign to a scheduler, as one array of tasks.

mod folder;

use super::slices::Slices;
use super::{ClusterError, Job, Scheduler, shard};
use crate::model::campaign::Campaign;
use crate::plan::memory_bytes;
use crate::store::{OpenCase, Store, Submission};
use folder::{Draft, write_plan};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Target duration of a task where no time limit is given, in seconds.
const DEFAULT_TIME_S: f64 = 3600.0;

/// How the open cases of a campaign are submitted.
pub(crate) struct SubmitOptions {
    pub(crate) scheduler: Scheduler,
    /// Number of tasks; by default so many that each needs about half of its time.
    pub(crate) tasks: Option<usize>,
    /// Cases that each task computes in parallel.
    pub(crate) workers: usize,
    /// Maximum number of tasks that run at the same time.
    pub(crate) throttle: Option<usize>,
    /// Further arguments of `sweep run`.
    pub(crate) run_arguments: Vec<String>,
    /// Whether failed cases are computed again.
    pub(crate) retry_failed: bool,
    /// Whether stored results of another build are accepted.
    pub(crate) mixed: bool,
    /// Whether cases of tasks that may still be running are submitted too.
    pub(crate) again: bool,
}

/// The job that was submitted, or would be.
pub(crate) struct Submitted {
    /// The command that submits the script: a program and its arguments.
    pub(crate) command: Vec<String>,
    /// Its name at the scheduler, unless nothing was submitted.
    pub(crate) name: Option<String>,
    pub(crate) cases: usize,
    /// Hash of the slices.
    pub(crate) plan: String,
    pub(crate) job: Job,
    pub(crate) script: String,
    /// Estimated CPU seconds of the whole job.
    pub(crate) cpu_s: f64,
    /// Memory of a task, in bytes.
    pub(crate) memory_bytes: f64,
}

/// Merges the published shards and submits the open cases of a campaign; `None` if there are none.
/// A dry run writes nothing. Notes for the user go to `note`.
pub(crate) fn submit(
    wanted: SubmitOptions,
    campaign: &Campaign,
    path: &Path,
    dry_run: bool,
    note: &dyn Fn(&str),
) -> Result<Option<Submitted>, ClusterError> {
    let scheduler = &wanted.scheduler;
    let limit = match scheduler.task_limit() {
        Err(ClusterError::Missing { .. }) if dry_run => crate::cluster::slurm::DEFAULT_ARRAY,
        limit => limit?,
    };
    let folder = shard::folder_of(path);
    let draft = Draft::new(dry_run, path)?;
    let mut store = draft.open(campaign)?;
    gather(&wanted, &mut store, &folder, note)?;
    let open = open(wanted.again, &store, note)?;
    if open.is_empty() {
        return Ok(None);
    }
    let tasks = tasks(&wanted, &open, limit)?;
    let slices = Slices::cut(&open, tasks);
    let text = crate::campaign::text_elsewhere(campaign);
    let plan = slices.plan(&text);
    let job = Job {
        campaign: campaign.name.clone(),
        program: folder.join(format!("sweep-{}", crate::system::process::build())),
        plan_folder: shard::plan_folder(&folder, &plan),
        folder,
        tasks,
        workers: wanted.workers,
        throttle: wanted.throttle,
        run_arguments: wanted.run_arguments,
    };
    let script = scheduler.script(&job)?;
    let name = if dry_run {
        None
    } else {
        let tasks_read = [
            ("campaign.toml", text.as_str()),
            ("slices", &slices.text(&plan)),
        ];
        write_plan(&job, &store, campaign, &open, tasks_read, &script)?;
        Some(submit_job(scheduler, &job, &plan, &slices, &mut store)?)
    };
    Ok(Some(Submitted {
        name,
        command: scheduler.command(&job),
        cases: open.len(),
        plan,
        script,
        cpu_s: store.remaining_cpu_s(&store.work()?)?,
        memory_bytes: memory_bytes(campaign, job.workers),
        job,
    }))
}

/// Number of tasks: as requested, if that is allowed and each has a case.
fn tasks(wanted: &SubmitOptions, open: &[OpenCase], limit: usize) -> Result<usize, ClusterError> {
    let usual = || default_tasks(wanted, open, limit);
    let asked = wanted.tasks.unwrap_or_else(usual);
    if asked > limit {
        return Err(ClusterError::TooManyTasks { asked, limit });
    }
    Ok(asked.min(open.len()))
}

/// Records the job and submits it to the scheduler; returns its name.
fn submit_job(
    scheduler: &Scheduler,
    job: &Job,
    plan: &str,
    slices: &Slices,
    store: &mut Store,
) -> Result<String, ClusterError> {
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
            // The job may exist although the answer could not be parsed.
            if !matches!(error, ClusterError::Answer { .. }) {
                store.not_submitted(id)?;
            }
            Err(error)
        }
    }
}

/// Updates the store: merges shards, marks failed cases to be retried; refuses to mix builds.
fn gather(
    wanted: &SubmitOptions,
    store: &mut Store,
    folder: &Path,
    note: &dyn Fn(&str),
) -> Result<(), ClusterError> {
    let shards: Vec<PathBuf> = shard::published(folder)
        .into_iter()
        .map(|shard| shard.path)
        .collect();
    let merged = store.merge(&shards, wanted.mixed)?;
    for damaged in &merged.damaged {
        note(&format!(
            "not merged: {}: {}",
            damaged.path.display(),
            damaged.reason
        ));
    }
    let (build, known) = (crate::system::process::build(), store.known_builds()?);
    if !wanted.mixed && !known.is_empty() && !known.contains(&build) {
        return Err(ClusterError::OtherBuild {
            build,
            known: known.into_iter().collect::<Vec<_>>().join(", "),
        });
    }
    if wanted.retry_failed {
        store.retry_failed()?;
    }
    Ok(())
}

/// Open cases that are assigned to no task.
fn open(again: bool, store: &Store, note: &dyn Fn(&str)) -> Result<Vec<OpenCase>, ClusterError> {
    let mut taken: HashSet<String> = HashSet::new();
    for submission in store.submissions()? {
        if again {
            break;
        }
        let Some(job) = &submission.job else {
            note(
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
        let active = scheduler
            .active(job)
            .map_err(|error| ClusterError::Unclear {
                job: job.clone(),
                source: Box::new(error),
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

/// So many tasks that each needs about half of its time by the estimate, which may be wrong.
fn default_tasks(wanted: &SubmitOptions, open: &[OpenCase], limit: usize) -> usize {
    let time = match &wanted.scheduler {
        Scheduler::Slurm(slurm) => slurm.time.as_ref(),
        Scheduler::Local => None,
    };
    let time = time.map_or(DEFAULT_TIME_S, |limit| limit.time.as_secs_f64());
    let cost: f64 = open.iter().map(|case| case.cost).sum();
    let tasks = crate::text::format::count((cost / (wanted.workers as f64 * time / 2.0)).ceil());
    tasks.clamp(1, limit.min(open.len().div_ceil(wanted.workers)).max(1))
}
