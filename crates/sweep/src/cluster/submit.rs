//! Submits the open cases of a campaign to a scheduler, as one array of tasks.

use super::slices::Slices;
use super::{ClusterError, Job, merge, shard, slurm};
use crate::model::campaign::Campaign;
use crate::store::{self, MergedCases, OpenCase, Store, Submission};
use crate::system::files::{is_left_behind, temporary_file, write_whole};
use crate::system::process::build;
use std::collections::HashSet;
use std::io::Write as _;
use std::path::Path;
use std::time::Duration;

/// Target duration of a task where no time limit is given, in seconds.
const DEFAULT_TIME_S: f64 = 3600.0;

/// How the open cases of a campaign are submitted.
pub(crate) struct SubmitOptions {
    /// Number of tasks; by default so many that each needs about half of its time.
    pub(crate) tasks: Option<usize>,
    pub(crate) workers: usize,
    /// Maximum number of tasks that run at the same time.
    pub(crate) throttle: Option<usize>,
    pub(crate) time: Option<Duration>,
    /// Further arguments of the command that submits.
    pub(crate) submit_arguments: Vec<String>,
    /// Further arguments of `sweep run`.
    pub(crate) run_arguments: Vec<String>,
    pub(crate) retry_failed: bool,
    /// Whether all runs are to keep frames.
    pub(crate) trajectory: bool,
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
    pub(crate) plan: String,
    pub(crate) job: Job,
    pub(crate) script: String,
}

/// Merges the published shards and submits the open cases of a campaign; `None` if there are none.
/// A dry run works on a copy of the store, and writes nothing else. Notes for the user go to
/// `note`.
pub(crate) fn submit(
    wanted: SubmitOptions,
    campaign: &Campaign,
    path: &Path,
    dry_run: bool,
    note: &dyn Fn(&str),
) -> Result<Option<Submitted>, ClusterError> {
    let limit = match slurm::task_limit() {
        Err(ClusterError::Missing { .. }) if dry_run => slurm::DEFAULT_ARRAY,
        limit => limit?,
    };
    let folder = shard::folder_of(path);
    let copies = tempfile::tempdir();
    let mut at = path.to_owned();
    if dry_run {
        let copies = copies
            .as_ref()
            .map_err(|error| ClusterError::of_plan(&std::env::temp_dir(), error.kind().into()))?;
        at = copies.path().join("store.sqlite");
        if path.exists() {
            drop(Store::open_read_only(path)?);
            store::snapshot(path, &at)?;
        }
    }
    let mut store = Store::enter(&at, campaign)?.0;
    gather(&wanted, &mut store, &folder, note)?;
    if wanted.trajectory {
        store.request_frames()?;
    }
    let open = open(wanted.again, &store, note)?;
    if open.is_empty() {
        return Ok(None);
    }
    let tasks = tasks(&wanted, &open, limit)?;
    let text = campaign.text_elsewhere();
    let slices = Slices::cut(&text, &open, tasks);
    let job = Job {
        campaign: campaign.name.clone(),
        program: folder.join(format!("sweep-{}", build())),
        plan_folder: shard::plan_folder(&folder, &slices.plan),
        folder,
        tasks,
        workers: wanted.workers,
        throttle: wanted.throttle,
        time: wanted.time,
        submit_arguments: wanted.submit_arguments,
        run_arguments: wanted.run_arguments,
    };
    let script = slurm::script(&job)?;
    let mut name = None;
    if !dry_run {
        clear_unsubmitted(&job.folder, &store)?;
        let plan = &job.plan_folder;
        let of_plan = |error| ClusterError::of_plan(plan, error);
        std::fs::create_dir_all(plan).map_err(of_plan)?;
        // Until the job is recorded: after a kill it tells the next submission that the folder of
        // the plan is of no use.
        let _unsubmitted = temporary_file(plan).map_err(of_plan)?;
        write_plan(&job, &text, &slices, &script)?;
        write_begun(&job, &store, campaign, &open)?;
        name = Some(submit_job(&job, &slices, &mut store)?);
    }
    Ok(Some(Submitted {
        name,
        command: slurm::command(&job),
        cases: open.len(),
        plan: slices.plan,
        script,
        job,
    }))
}

/// Updates the store: merges shards, marks failed cases to be retried.
fn gather(
    wanted: &SubmitOptions,
    store: &mut Store,
    folder: &Path,
    note: &dyn Fn(&str),
) -> Result<(), ClusterError> {
    let shards = merge::paths(folder);
    for damaged in store.merge(MergedCases::All, &shards)?.damaged {
        note(&format!("not merged: {damaged}"));
    }
    if wanted.retry_failed {
        store.retry_failed()?;
    }
    Ok(())
}

/// Open cases that no task has, or all of them `again`.
fn open(again: bool, store: &Store, note: &dyn Fn(&str)) -> Result<Vec<OpenCase>, ClusterError> {
    let mut taken: HashSet<String> = HashSet::new();
    let submissions = if again {
        Vec::new()
    } else {
        store.submissions()?
    };
    for submission in submissions {
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
        let active = slurm::active(job).map_err(|error| ClusterError::Unclear {
            job: job.clone(),
            source: Box::new(error),
        })?;
        let has = |number| active.iter().any(|task| task.task == number);
        let cases = cases.into_iter().filter(|(_, task)| has(*task));
        taken.extend(cases.map(|(key, _)| key));
    }
    let mut open = store.open_cases()?;
    open.retain(|case| !taken.contains(&case.key));
    Ok(open)
}

/// Number of tasks: as requested, if that is allowed and each has a case. By default so many that
/// each needs about half of its time by the estimate, which may be wrong.
fn tasks(wanted: &SubmitOptions, open: &[OpenCase], limit: usize) -> Result<usize, ClusterError> {
    let usual = || {
        let time = wanted
            .time
            .map_or(DEFAULT_TIME_S, |limit| limit.as_secs_f64());
        let cost: f64 = open.iter().map(|case| case.cost).sum();
        let tasks = (cost / (wanted.workers as f64 * time / 2.0)).ceil();
        let most = limit.min(open.len().div_ceil(wanted.workers)).max(1);
        crate::text::format::count(tasks).clamp(1, most)
    };
    match wanted.tasks.unwrap_or_else(usual) {
        asked if asked > limit => Err(ClusterError::TooManyTasks { asked, limit }),
        asked => Ok(asked.min(open.len())),
    }
}

/// Deletes the folders of plans that submissions wrote before they were killed. A plan of a
/// recorded job stays.
fn clear_unsubmitted(folder: &Path, store: &Store) -> Result<(), ClusterError> {
    let submissions = store.submissions()?.into_iter();
    let recorded: HashSet<String> = submissions.map(|job| job.plan).collect();
    let plans = std::fs::read_dir(folder.join("plans"));
    for plan in plans.into_iter().flatten().flatten() {
        if recorded.contains(plan.file_name().to_string_lossy().as_ref()) {
            continue;
        }
        let _ = if is_left_behind(&plan.path()) {
            std::fs::remove_dir_all(plan.path())
        } else {
            // Fails unless it is empty.
            std::fs::remove_dir(plan.path())
        };
    }
    Ok(())
}

/// Writes what the tasks read into the folder of shards: the program, the campaign, the slices, and
/// the script.
fn write_plan(
    job: &Job,
    campaign: &str,
    slices: &Slices,
    script: &str,
) -> Result<(), ClusterError> {
    let folder = &job.plan_folder;
    // Its name has the hash of the program.
    if !job.program.exists() {
        write_whole(&job.program, |copy| {
            let program = std::env::current_exe()?;
            std::io::copy(&mut std::fs::File::open(&program)?, copy)?;
            copy.set_permissions(std::fs::metadata(&program)?.permissions())
        })
        .map_err(|error| ClusterError::of_plan(&job.program, error))?;
    }
    let slices = serde_json::to_vec(slices).unwrap_or_default();
    for (path, bytes) in [
        (folder.join("campaign.toml"), campaign.as_bytes()),
        (folder.join("slices"), &slices),
        (job.script_path(), script.as_bytes()),
    ] {
        write_whole(&path, |file| file.write_all(bytes))
            .map_err(|error| ClusterError::of_plan(&path, error))?;
    }
    Ok(())
}

/// Writes the runs that were begun into a store beside the slices, so that tasks continue them.
fn write_begun(
    job: &Job,
    store: &Store,
    campaign: &Campaign,
    open: &[OpenCase],
) -> Result<(), ClusterError> {
    let begun = open.iter().filter(|case| case.begun);
    let begun: HashSet<&str> = begun.map(|case| case.key.as_str()).collect();
    if begun.is_empty() {
        return Ok(());
    }
    let folder = &job.plan_folder;
    let failed = |error| ClusterError::of_plan(folder, error);
    let work = tempfile::tempdir_in(folder).map_err(failed)?;
    let (part, whole) = (work.path().join("part"), work.path().join("whole"));
    store.write_begun(campaign, &begun, &part)?;
    store::snapshot(&part, &whole)?;
    std::fs::rename(&whole, folder.join(shard::BEGUN)).map_err(failed)
}

/// Records the job and submits it to the scheduler; returns its name.
fn submit_job(job: &Job, slices: &Slices, store: &mut Store) -> Result<String, ClusterError> {
    let submission = Submission {
        id: 0,
        job: None,
        plan: slices.plan.clone(),
        folder: job.folder.clone(),
        tasks: job.tasks,
        workers: job.workers,
        build: build(),
        submitted_at: 0,
        cancelled_at: None,
    };
    let id = store.submit(&submission, &slices.tasks)?;
    let submitted = slurm::submit(job);
    match &submitted {
        Ok(name) => store.submitted(id, name)?,
        // The job may exist although the answer could not be parsed.
        Err(ClusterError::Answer { .. }) => {}
        Err(_) => store.not_submitted(id)?,
    }
    submitted
}
