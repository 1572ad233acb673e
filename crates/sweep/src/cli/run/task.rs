//! One task of a campaign, in a store of its own that is published as a shard.

use super::{Arguments, ClusterArguments, Part, compute, style};
use crate::api::Error;
use crate::campaign::{Campaign, Order};
use crate::cli::{Output, note};
use crate::cluster::shard::{self, Publisher, ShardError, Slices};
use crate::cluster::{Requeue, Scheduler};
use crate::exit;
use crate::runner::{Progress, RunObserver, Stop};
use crate::store::{Counts, MergeMode, OpenCase, Store, StoreError, TaskName};
use crate::system::process::Identity;
use rustix::process::Signal;
use serde::Serialize;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

struct Task {
    publisher: Publisher,
    /// What started it, unless somebody did by hand, and its name there.
    started_by: Option<(Scheduler, TaskName)>,
    /// Marks that it was cancelled.
    cancelled: PathBuf,
    quiet: bool,
}

impl RunObserver for Task {
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
            Err(error) => note(self.quiet, &error.to_string()),
        }
    }
}

impl Task {
    /// Has the task started again, after a signal with work left.
    fn again(&self, signal: i32) {
        let Some((scheduler, name)) = &self.started_by else {
            note(
                self.quiet,
                "work is left: give the same command again to go on",
            );
            return;
        };
        let again = if self.cancelled.exists() || signal == Signal::INT.as_raw() {
            Requeue::Cancelled
        } else {
            scheduler.start_again(name, signal == Signal::USR1.as_raw())
        };
        let what = match again {
            Requeue::Yes => format!("work is left: {} starts the task again", scheduler.name()),
            Requeue::Cancelled => "cancelled: `sweep submit` goes on from here".to_owned(),
            Requeue::No(why) => format!(
                "work is left, and the task could not be started again ({why}): `sweep submit` goes on from here"
            ),
        };
        note(self.quiet, &what);
    }
}

/// Computes one slice of a campaign, and says how far it is before a scheduler may end this process.
pub(super) fn run(
    arguments: &Arguments,
    part: Part,
    mut campaign: Campaign,
    output: &mut Output<'_>,
) -> Result<u8, Error> {
    let stop = Stop::for_a_task()?;
    let plan = restrict(arguments, part, &mut campaign)?;
    let (mut store, task) = begin(arguments, part, &plan, &campaign, output)?;
    let style = style(arguments, output);
    let computed = compute(
        arguments,
        &campaign,
        &mut store,
        (&stop, Some(&task)),
        style,
    );
    // What there is counts, whatever ended the run.
    let published = task.publisher.publish();
    let counts = computed?;
    published?;
    drop(store);
    task.publisher.clean_up();
    answer(part, counts, task.publisher.target(), output)?;
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
fn begin(
    arguments: &Arguments,
    part: Part,
    plan: &str,
    campaign: &Campaign,
    output: &Output<'_>,
) -> Result<(Store, Task), Error> {
    let options = &arguments.cluster;
    let usual = || shard::folder_of(&campaign.default_store());
    let folder = options.shards.clone().unwrap_or_else(usual);
    let scratch = options
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
        .map_or_else(|| by_hand(part.task), |(_, name)| name.clone());
    let file = shard::name(plan, &name);
    let work = scratch.join(&file);
    if work.exists() {
        for finding in Store::open(&work)?.forget_damaged()? {
            output.note(&format!("damaged, and computed again: {}", finding.what));
        }
    }
    let (mut store, _) = Store::enter(&work, campaign, Order::default())?;
    let before = Before::of(&folder, plan, &name);
    if go_on_from(&mut store, &before.others, options, output)? > 0 {
        // What failed in another job is in this slice because it is to be computed again.
        store.retry_failed()?;
    }
    go_on_from(&mut store, &before.own, options, output)?;
    if arguments.retry_failed {
        store.retry_failed()?;
    }
    let task = Task {
        publisher: Publisher::new(work, folder.join(file), options.publish_every),
        cancelled: shard::cancel_mark(&folder, plan, &name.job),
        started_by,
        quiet: output.quiet,
    };
    store.work_for(name);
    // Whoever cannot publish should know before hours are computed, not after.
    task.publisher.publish()?;
    Ok((store, task))
}

/// The name of a task that no scheduler started.
fn by_hand(task: usize) -> TaskName {
    TaskName {
        job: "by-hand".into(),
        task,
        restart: 0,
        node: Identity::of_this_process().host,
    }
}

/// Leaves only the cases of the slice in a campaign. Gives the name of the plan.
fn restrict(arguments: &Arguments, part: Part, campaign: &mut Campaign) -> Result<String, Error> {
    let slices = arguments.cluster.slices.as_deref();
    let (plan, keys) = if let Some(path) = slices {
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
            path: slices.map(Path::to_owned).unwrap_or_default(),
            reason: format!(
                "{} of its cases are not in {}: these are slices of another campaign file",
                keys.len() - campaign.cases.len(),
                campaign.file.display()
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
    options: &ClusterArguments,
    output: &Output<'_>,
) -> Result<u64, Error> {
    let mut failures = 0;
    for source in sources {
        match store.merge_as(
            MergeMode::Task,
            std::slice::from_ref(source),
            options.allow_mixed_versions,
        ) {
            Ok(merged) => {
                failures += merged.failures;
                for damaged in merged.damaged {
                    output.note(&damaged.to_string());
                }
            }
            Err(error @ (StoreError::OtherBuild { .. } | StoreError::OtherCampaign { .. })) => {
                output.note(&format!("{error}: not used"));
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(failures)
}

/// What is said at the end of a task.
#[derive(Serialize)]
struct Answer<'a> {
    task: usize,
    tasks: usize,
    shard: &'a Path,
    /// Cases of the slice by state.
    #[serde(rename = "cases")]
    counts: Counts,
}

/// Says how far the slice is.
fn answer(part: Part, counts: Counts, shard: &Path, output: &mut Output<'_>) -> Result<(), Error> {
    let left = counts.pending + counts.running;
    if output.json {
        output.json(&Answer {
            task: part.task,
            tasks: part.tasks,
            shard,
            counts,
        })?;
        return Ok(output.out.flush()?);
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
    Ok(output.out.flush()?)
}
