//! `sweep submit`.

mod folder;

use super::Output;
use super::place::store_of;
use crate::api::Error;
use crate::api::plan::memory_bytes;
use crate::campaign::Campaign;
use crate::cluster::{
    Job, Scheduler, SchedulerError, quoted, shard,
    shard::Slices,
    slurm::{Slurm, TimeLimit},
};
use crate::exit;
use crate::format::{bytes, duration, parse_duration, parse_positive_duration};
use crate::store::{OpenCase, Store, Submission};
use clap::ValueEnum;
use folder::{Draft, write_plan};
use serde::Serialize;
use std::collections::HashSet;
use std::io::Write as _;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Seconds of a task aimed at where no --time is given.
const USUAL_TIME_S: f64 = 3600.0;
/// Options of sbatch that are the business of the script.
const OURS: [&str; 7] = [
    "-a",
    "--array",
    "--export",
    "--wrap",
    "--parsable",
    "--signal",
    "--open-mode",
];

/// Hand what a campaign lacks to Slurm, as one array of tasks
///
/// Merges the shards there are, cuts the open cases into slices of equal estimated cost, and submits one array job whose
/// tasks compute one slice each with `sweep run --shard`. A task that meets its time limit checkpoints and is started again
/// until its slice is done. Cases that tasks submitted before still work on are left to them. Nothing of the environment is
/// exported to the tasks; the program is copied into the folder of shards, so that it may be built anew meanwhile.
#[derive(Debug, clap::Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches of the command line"
)]
#[command(
    after_help = "Examples:\n  sweep submit sweeps/figure-11.toml --tasks 200 --time 4:00:00 --partition short --dry-run\n  \
                  sweep submit sweeps/figure-11.toml --time 12:00:00 --throttle 50 --sbatch-arg=--mem=4G\n  \
                  sweep submit sweeps/figure-11.toml --engine local\n  \
                  sweep status sweeps/figure-11.toml && sweep merge sweeps/figure-11.toml && sweep report sweeps/figure-11.toml"
)]
pub(crate) struct Arguments {
    /// The campaign file
    campaign: PathBuf,
    /// What runs the tasks
    #[arg(long, value_enum, default_value_t = Kind::Slurm)]
    engine: Kind,
    /// The store; shards go to the folder beside it [default: results/NAME.sqlite in the folder that holds `sweeps/`, or beside
    /// the file]
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Number of tasks [default: so many that each needs about half of --time]
    #[arg(long, value_name = "N")]
    tasks: Option<NonZeroUsize>,
    /// Cases each task computes at a time, one core each
    #[arg(long, value_name = "K", default_value = "1")]
    workers_per_task: NonZeroUsize,
    /// Tasks at work at a time, at most
    #[arg(long, value_name = "N")]
    throttle: Option<NonZeroUsize>,
    /// Time limit of a task, as for sbatch: minutes, HH:MM:SS or D-HH [default: the site's]
    #[arg(long, value_name = "TIME")]
    time: Option<TimeLimit>,
    /// Partition of the cluster
    #[arg(long, value_parser = word)]
    partition: Option<String>,
    /// Account the time is charged to
    #[arg(long, value_parser = word)]
    account: Option<String>,
    /// Further argument of sbatch, as in --sbatch-arg=--mem=4G; may be repeated
    #[arg(long, value_name = "ARG", allow_hyphen_values = true)]
    sbatch_arg: Vec<String>,
    /// Disk of the nodes the tasks work on [default: SLURM_TMPDIR, or else the folder of shards]
    #[arg(long, value_name = "DIR")]
    scratch: Option<PathBuf>,
    /// Time between publications, as 90s or 2m: what a crashed node loses at most
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = parse_duration)]
    publish_every: Duration,
    /// Computing time after which a single case ends as failed, as 90s, 15m or 2h
    #[arg(long, value_name = "TIME", value_parser = parse_positive_duration)]
    max_wall_time: Option<Duration>,
    /// Keep the layer at every sampled strain, as `sweep run` does
    #[arg(long)]
    trajectory: bool,
    /// Compute failed cases again
    #[arg(long)]
    retry_failed: bool,
    /// Submit although another build of sweep computed what is stored; the store keeps a record of it
    #[arg(long)]
    allow_mixed_versions: bool,
    /// Also submit cases that tasks submitted before may still work on: costs time, does no harm
    #[arg(long)]
    again: bool,
    /// Print what would be submitted, and write nothing
    #[arg(long)]
    dry_run: bool,
}

/// What can run the tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// A cluster with Slurm.
    Slurm,
    /// The background of this machine.
    Local,
}

/// A name of a partition or an account.
fn word(text: &str) -> Result<String, String> {
    let fits = |c: char| c.is_ascii_alphanumeric() || "_-.,@+:/".contains(c);
    if !text.is_empty() && !text.starts_with('-') && text.chars().all(fits) {
        Ok(text.to_owned())
    } else {
        Err("a name of letters, digits and _ - . , @ + : /".into())
    }
}

#[derive(Serialize)]
struct Answer<'a> {
    /// The job, once it is submitted.
    job: Option<&'a str>,
    cases: usize,
    tasks: usize,
    /// Hash of the slices; this and what follows is null if nothing is open.
    plan: Option<&'a str>,
    folder: Option<&'a Path>,
    /// The command that hands the script over.
    command: Option<&'a [String]>,
    script: Option<&'a str>,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let campaign = Campaign::read(&arguments.campaign)?;
    let scheduler = scheduler(arguments)?;
    let limit = match scheduler.task_limit() {
        Err(SchedulerError::Missing { .. }) if arguments.dry_run => {
            crate::cluster::slurm::USUAL_ARRAY
        }
        limit => limit?,
    };
    let path = store_of(&campaign, arguments.store.as_deref())?;
    let folder = shard::folder_of(&path);
    let draft = Draft::new(arguments.dry_run, &path)?;
    let mut store = draft.open(&campaign)?;
    gather(arguments, &mut store, &folder, output)?;
    let open = open(arguments, &store, output)?;
    if open.is_empty() {
        nothing(output)?;
        return Ok(exit::DONE);
    }
    let tasks = tasks(arguments, &open, limit)?;
    let slices = Slices::cut(&open, tasks);
    let text = campaign.text_elsewhere();
    let plan = slices.plan(&text);
    let job = Job {
        campaign: campaign.name.clone(),
        program: folder.join(format!("sweep-{}", crate::process::build())),
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
        write_plan(&job, &store, &campaign, &open, tasks_read, &script)?;
        Some(hand_over(&scheduler, &job, &plan, &slices, &mut store)?)
    };
    let command = scheduler.command(&job);
    if output.json {
        output.json(&Answer {
            job: name.as_deref(),
            cases: open.len(),
            tasks,
            plan: Some(&plan),
            folder: Some(&job.folder),
            command: Some(&command),
            script: Some(&script),
        })?;
        return Ok(exit::DONE);
    }
    if let Some(name) = name {
        writeln!(
            output.out,
            "job {name}: {} open cases in {tasks} tasks; logs in {}",
            open.len(),
            job.plan_folder.display()
        )?;
    } else {
        let words: Vec<String> = command
            .iter()
            .map(|word| quoted(word))
            .collect::<Result<_, _>>()?;
        write!(output.out, "{}\n\n{script}", words.join(" "))?;
    }
    forecast(&campaign, &store, open.len(), &job, output)?;
    Ok(exit::DONE)
}

/// Says that nothing is open.
fn nothing(output: &mut Output<'_>) -> Result<(), Error> {
    if output.json {
        return Ok(output.json(&Answer {
            job: None,
            cases: 0,
            tasks: 0,
            plan: None,
            folder: None,
            command: None,
            script: None,
        })?);
    }
    writeln!(
        output.out,
        "nothing to submit: no case is open that is not with a task already"
    )?;
    Ok(())
}

/// Number of tasks: as many as asked for, if so many may be and have anything to do.
fn tasks(arguments: &Arguments, open: &[OpenCase], limit: usize) -> Result<usize, SchedulerError> {
    let asked = arguments
        .tasks
        .map_or_else(|| usual_tasks(arguments, open, limit), NonZeroUsize::get);
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
        build: crate::process::build(),
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

/// The scheduler as it was asked for.
fn scheduler(arguments: &Arguments) -> Result<Scheduler, Error> {
    let refused =
        |argument: &'static str, message: String| Err(Error::Argument { argument, message });
    for argument in &arguments.sbatch_arg {
        let name = argument.split('=').next().unwrap_or_default();
        if OURS.contains(&name) {
            return refused(
                "--sbatch-arg",
                format!("{name} is set by sweep itself: see `sweep submit --dry-run`"),
            );
        }
        if !name.starts_with('-') {
            return refused(
                "--sbatch-arg",
                format!(
                    "write an option with its value, as in --sbatch-arg=--mem=4G, not {argument:?}"
                ),
            );
        }
    }
    Ok(match arguments.engine {
        Kind::Slurm => Scheduler::Slurm(Slurm {
            time: arguments.time.clone(),
            partition: arguments.partition.clone(),
            account: arguments.account.clone(),
            arguments: arguments.sbatch_arg.clone(),
        }),
        Kind::Local => {
            let foreign = [
                ("--time", arguments.time.is_some()),
                ("--partition", arguments.partition.is_some()),
                ("--account", arguments.account.is_some()),
                ("--sbatch-arg", !arguments.sbatch_arg.is_empty()),
            ];
            if let Some((argument, _)) = foreign.into_iter().find(|(_, given)| *given) {
                return refused(argument, "only --engine slurm has it".into());
            }
            Scheduler::Local
        }
    })
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
        note(
            output,
            &format!("not merged: {}: {}", damaged.path.display(), damaged.reason),
        );
    }
    let (build, known) = (crate::process::build(), store.known_builds()?);
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
            note(
                output,
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
    let time = arguments
        .time
        .as_ref()
        .map_or(USUAL_TIME_S, |limit| limit.time.as_secs_f64());
    let cost: f64 = open.iter().map(|case| case.cost).sum();
    let workers = arguments.workers_per_task.get();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a count, held within limits below"
    )]
    let tasks = (cost / (workers as f64 * time / 2.0)).ceil() as usize;
    tasks.clamp(1, limit.min(open.len().div_ceil(workers)).max(1))
}

/// Arguments of every task.
fn run_arguments(arguments: &Arguments) -> Result<Vec<String>, Error> {
    let mut run = vec![
        "--publish-every".to_owned(),
        arguments.publish_every.as_secs_f64().to_string(),
    ];
    if let Some(scratch) = &arguments.scratch {
        let scratch = std::path::absolute(scratch)
            .ok()
            .and_then(|path| path.into_os_string().into_string().ok())
            .ok_or_else(|| SchedulerError::Path {
                path: scratch.clone(),
            })?;
        run.extend(["--scratch".to_owned(), scratch]);
    }
    if let Some(limit) = arguments.max_wall_time {
        run.extend([
            "--max-wall-time".to_owned(),
            limit.as_secs_f64().to_string(),
        ]);
    }
    for (given, name) in [
        (arguments.trajectory, "--trajectory"),
        (arguments.allow_mixed_versions, "--allow-mixed-versions"),
    ] {
        if given {
            run.push(name.into());
        }
    }
    Ok(run)
}

/// Says how long it may take and how much memory a task needs.
fn forecast(
    campaign: &Campaign,
    store: &Store,
    cases: usize,
    job: &Job,
    output: &Output<'_>,
) -> Result<(), Error> {
    if output.quiet {
        return Ok(());
    }
    let memory = memory_bytes(campaign, job.workers);
    let seconds = store.remaining_cpu_s(&store.work()?)?;
    note(
        output,
        &format!(
            "{cases} cases in {} tasks of {} workers: about {} of computing per task, {} of memory each, if nodes are as fast as \
             this machine",
            job.tasks,
            job.workers,
            duration(seconds / (job.tasks * job.workers) as f64),
            bytes(memory)
        ),
    );
    if !campaign.rules.is_empty() {
        note(
            output,
            "this is one wave: once it is merged, `sweep submit` submits the seeds that the precision still takes",
        );
    }
    Ok(())
}

/// Says something on standard error.
fn note(output: &Output<'_>, text: &str) {
    if !output.quiet {
        // Nobody may read standard error.
        let _ = writeln!(crate::visible::stderr(), "{text}");
    }
}
