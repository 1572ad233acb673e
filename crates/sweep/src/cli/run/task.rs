//! `sweep run --shard`: one task of a campaign, in a store of its own.

use super::{Arguments, Conditions, compute};
use crate::api::Error;
use crate::campaign::Campaign;
use crate::campaign::Order;
use crate::cli::Output;
use crate::cluster::shard::{self, Publisher, ShardError, Slices};
use crate::cluster::{Requeue, Scheduler};
use crate::exit;
use crate::process::Identity;
use crate::runner::{Progress, RunObserver, Stop};
use crate::store::{Counts, MergeMode, OpenCase, Store, StoreError, TaskName};
use rustix::process::Signal;
use serde::Serialize;
use std::collections::HashSet;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Part {
    task: usize,
    tasks: usize,
}

pub(super) fn part(text: &str) -> Result<Part, String> {
    text.split_once('/')
        .and_then(|(task, tasks)| {
            Some(Part {
                task: task.parse().ok()?,
                tasks: tasks.parse().ok()?,
            })
        })
        .filter(|part| part.task < part.tasks && part.tasks <= 1_000_000)
        .ok_or_else(|| "write I/N with I from 0 to N - 1, as in 0/24".to_owned())
}

/// What is said at the end.
#[derive(Serialize)]
struct Answer<'a> {
    task: usize,
    tasks: usize,
    shard: &'a Path,
    /// Cases of the slice by state.
    #[serde(rename = "cases")]
    counts: Counts,
}

struct Task<'t> {
    publisher: Publisher,
    /// What started it, unless somebody did by hand, and its name there.
    started_by: Option<(Scheduler, TaskName)>,
    /// Marks that it was cancelled.
    cancelled: PathBuf,
    /// Where notes go; nowhere if nobody wants them.
    note: &'t (dyn Fn(&str) + Sync),
}

impl RunObserver for Task<'_> {
    fn look(&self, progress: &Progress) {
        if self.publisher.is_due()
            && let Err(error) = self.publisher.publish()
        {
            // Computing goes on: there may be room again at the next attempt.
            progress.note(&format!("{error}; tried again in a while"));
        }
    }

    fn before_abort(&self, signal: i32, _: &Progress) {
        match self.publisher.publish() {
            Ok(()) => self.again(signal),
            Err(error) => (self.note)(&error.to_string()),
        }
    }
}

impl Task<'_> {
    /// Has the task started again, after a signal with work left.
    fn again(&self, signal: i32) {
        let Some((scheduler, name)) = &self.started_by else {
            (self.note)("work is left: give the same command again to go on");
            return;
        };
        let again = if self.cancelled.exists() || signal == Signal::INT.as_raw() {
            Requeue::Cancelled
        } else {
            scheduler.start_again(name, signal == Signal::USR1.as_raw())
        };
        (self.note)(&match again {
            Requeue::Yes => format!("work is left: {} starts the task again", scheduler.name()),
            Requeue::Cancelled => "cancelled: `sweep submit` goes on from here".to_owned(),
            Requeue::No(why) => format!(
                "work is left, and the task could not be started again ({why}): `sweep submit` goes on from here"
            ),
        });
    }
}

/// Computes one slice of the campaign.
pub(super) fn execute(
    arguments: &Arguments,
    part: Part,
    mut campaign: Campaign,
    workers: usize,
    wall_limit: Option<Duration>,
    output: &mut Output<'_>,
) -> Result<u8, Error> {
    let stop = Stop::for_a_task()?;
    let quiet = output.quiet;
    let note = move |text: &str| {
        if !quiet {
            // Nobody may read standard error.
            let _ = writeln!(crate::visible::stderr(), "{text}");
        }
    };
    let plan = restrict(arguments, part, &mut campaign)?;
    let (mut store, task) = begin(arguments, part, &plan, &campaign, &note)?;
    let conditions = Conditions {
        workers,
        wall_limit,
        stop: &stop,
        observer: Some(&task),
    };
    let counts = store.counts()?;
    let computed = if counts.pending + counts.running > 0 {
        compute(arguments, &campaign, &mut store, conditions, output)
    } else {
        Ok(())
    };
    // What there is counts, whatever ended the run.
    let published = task.publisher.publish();
    computed?;
    published?;
    let counts = store.counts()?;
    drop(store);
    task.publisher.clean_up();
    answer(part, counts, task.publisher.target(), output)?;
    // Before the scheduler ends this process, as it does with a task that is to be started again.
    output.out.flush()?;
    Ok(match stop.signal() {
        Some(signal) if counts.pending + counts.running > 0 => {
            task.again(signal);
            exit::stopped_by(signal)
        }
        _ if counts.failed > 0 => exit::FAILED,
        _ => exit::DONE,
    })
}

/// Makes the store of a task, with all that is known of its slice, and publishes it for the first time.
fn begin<'t>(
    arguments: &Arguments,
    part: Part,
    plan: &str,
    campaign: &Campaign,
    note: &'t (dyn Fn(&str) + Sync),
) -> Result<(Store, Task<'t>), Error> {
    let folder = arguments
        .shards
        .clone()
        .unwrap_or_else(|| shard::folder_of(&campaign.default_store()));
    let scratch = arguments
        .scratch
        .clone()
        .or_else(|| std::env::var_os("SLURM_TMPDIR").map(PathBuf::from))
        .unwrap_or_else(|| folder.join("work"));
    for folder in [&folder, &scratch] {
        std::fs::create_dir_all(folder).map_err(|source| ShardError::Folder {
            path: folder.clone(),
            source,
        })?;
    }
    let started_by = Scheduler::of_this_task(part.task);
    let name = started_by
        .as_ref()
        .map_or_else(|| by_hand(part), |(_, name)| name.clone());
    let file = shard::name(plan, &name);
    let work = scratch.join(&file);
    if work.exists() {
        for finding in Store::open(&work)?.forget_damaged()? {
            note(&format!("damaged, and computed again: {}", finding.what));
        }
    }
    let (mut store, _) = Store::enter(&work, campaign, Order::default())?;
    let before = Before::of(&folder, plan, &name);
    if go_on_from(&mut store, &before.others, arguments, note)? > 0 {
        // What failed in another job is in this slice because it is to be computed again.
        store.retry_failed()?;
    }
    go_on_from(&mut store, &before.own, arguments, note)?;
    if arguments.retry_failed {
        store.retry_failed()?;
    }
    let task = Task {
        publisher: Publisher::new(work, folder.join(file), arguments.publish_every),
        cancelled: shard::cancel_mark(&folder, plan, &name.job),
        started_by,
        note,
    };
    store.work_for(name);
    // Whoever cannot publish should know before hours are computed, not after.
    task.publisher.publish()?;
    Ok((store, task))
}

/// The name of a task that no scheduler started.
fn by_hand(part: Part) -> TaskName {
    TaskName {
        job: "by-hand".into(),
        task: part.task,
        restart: 0,
        node: Identity::of_this_process().host,
    }
}

/// Says how far the slice is.
fn answer(part: Part, counts: Counts, shard: &Path, output: &mut Output<'_>) -> Result<(), Error> {
    let left = counts.pending + counts.running;
    if output.json {
        return Ok(output.json(&Answer {
            task: part.task,
            tasks: part.tasks,
            shard,
            counts,
        })?);
    }
    writeln!(
        output.out,
        "task {} of {}: {} cases done, {} jammed, {} failed, {left} left: {}",
        part.task,
        part.tasks,
        counts.done,
        counts.jammed,
        counts.failed,
        shard.display()
    )?;
    Ok(())
}

/// Leaves only the cases of the slice in a campaign. Gives the name of the plan.
fn restrict(arguments: &Arguments, part: Part, campaign: &mut Campaign) -> Result<String, Error> {
    let (plan, keys) = if let Some(path) = &arguments.slices {
        Slices::read(path, part.task, part.tasks)?
    } else {
        let all: Vec<OpenCase> = campaign
            .certain()
            .map(|(key, case)| OpenCase {
                key: key.to_string(),
                cost: case.cost(),
                begun: false,
            })
            .collect();
        let mut slices = Slices::cut(&all, part.tasks);
        (
            slices.plan(&campaign.text),
            slices.tasks.swap_remove(part.task),
        )
    };
    let keys: HashSet<String> = keys.into_iter().collect();
    // A task computes what it was given; which seeds count is decided where all results meet.
    campaign.rules.clear();
    campaign
        .cases
        .retain(|(key, _)| keys.contains(&key.to_string()));
    if campaign.cases.len() < keys.len() {
        return Err(ShardError::Slices {
            path: arguments.slices.clone().unwrap_or_default(),
            reason: format!(
                "{} of its cases are not in {}: these are slices of another campaign file",
                keys.len() - campaign.cases.len(),
                arguments.campaign.display()
            ),
        }
        .into());
    }
    Ok(plan)
}

/// Where the slice may have been begun.
struct Before {
    /// What was known when it was planned, and what other jobs with the same slices published.
    others: Vec<PathBuf>,
    /// What the task published itself before it was started again.
    own: Vec<PathBuf>,
}

impl Before {
    fn of(folder: &Path, plan: &str, name: &TaskName) -> Self {
        let (own, published): (Vec<_>, Vec<_>) = shard::published(folder)
            .into_iter()
            .filter(|shard| shard.plan == plan && shard.task.task == name.task)
            .partition(|shard| shard.task.job == shard::sanitize(&name.job));
        let begun = shard::plan_folder(folder, plan).join(shard::BEGUN);
        Self {
            others: begun
                .exists()
                .then_some(begun)
                .into_iter()
                .chain(published.into_iter().map(|shard| shard.path))
                .collect(),
            own: own.into_iter().map(|shard| shard.path).collect(),
        }
    }
}

/// Takes over what shards hold of the slice; gives the number of failures among it. A shard that cannot be used is no reason
/// to stop: the slice is computed anew.
fn go_on_from(
    store: &mut Store,
    sources: &[PathBuf],
    arguments: &Arguments,
    note: &dyn Fn(&str),
) -> Result<u64, Error> {
    let mut failures = 0;
    for source in sources {
        match store.merge_as(
            MergeMode::Task,
            std::slice::from_ref(source),
            arguments.allow_mixed_versions,
        ) {
            Ok(merged) => {
                failures += merged.failures;
                for damaged in merged.damaged {
                    note(&damaged.to_string());
                }
            }
            Err(error @ (StoreError::OtherBuild { .. } | StoreError::OtherCampaign { .. })) => {
                note(&format!("{error}: not used"));
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(failures)
}
