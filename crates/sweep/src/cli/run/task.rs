//! One task of a campaign, in a store of its own that is published as a shard.

use super::Error;
use crate::campaign::{Campaign, Order};
use crate::cluster::shard::{self, Publisher, ShardError, Slices};
use crate::cluster::{Requeue, Scheduler};
use crate::exit;
use crate::runner::{Progress, RunObserver, Stop};
use crate::store::{Counts, MergeMode, OpenCase, Store, StoreError, TaskName};
use crate::system::process::Identity;
use rustix::process::Signal;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Which task it is, and where it works.
pub(crate) struct Options<'o> {
    /// Its number, from 0.
    pub(crate) task: usize,
    /// How many there are.
    pub(crate) tasks: usize,
    /// The slices, as they were written; without them the campaign is cut here.
    pub(crate) slices: Option<&'o Path>,
    /// Folder that shards are published in.
    pub(crate) shards: Option<&'o Path>,
    /// Disk of this machine to work on.
    pub(crate) scratch: Option<&'o Path>,
    pub(crate) publish_every: Duration,
    pub(crate) retry_failed: bool,
    pub(crate) allow_mixed_versions: bool,
    /// Told what the user should know.
    pub(crate) note: &'o (dyn Fn(&str) + Sync),
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

/// Computes one slice of a campaign, of which only the cases of the slice are left. Gives the exit code and how far the slice is;
/// `answer` is called with that and the shard before a scheduler may end this process.
pub(crate) fn run_task(
    campaign: &mut Campaign,
    options: &Options<'_>,
    stop: &Stop,
    compute: impl FnOnce(&Campaign, &mut Store, &dyn RunObserver) -> Result<Counts, Error>,
    answer: impl FnOnce(Counts, &Path) -> Result<(), Error>,
) -> Result<u8, Error> {
    let plan = restrict(options, campaign)?;
    let (mut store, task) = begin(options, &plan, campaign)?;
    let computed = compute(campaign, &mut store, &task);
    // What there is counts, whatever ended the run.
    let published = task.publisher.publish();
    let counts = computed?;
    published?;
    drop(store);
    task.publisher.clean_up();
    answer(counts, task.publisher.target())?;
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
    options: &Options<'t>,
    plan: &str,
    campaign: &Campaign,
) -> Result<(Store, Task<'t>), Error> {
    let note = options.note;
    let usual = || shard::folder_of(&campaign.default_store());
    let folder = options.shards.map_or_else(usual, Path::to_owned);
    let scratch = options
        .scratch
        .map(Path::to_owned)
        .or_else(|| std::env::var_os("SLURM_TMPDIR").map(PathBuf::from))
        .unwrap_or_else(|| folder.join("work"));
    for folder in [&folder, &scratch] {
        std::fs::create_dir_all(folder).map_err(|source| ShardError::Folder {
            path: folder.clone(),
            source,
        })?;
    }
    let started_by = Scheduler::of_this_task(options.task);
    let name = started_by
        .as_ref()
        .map_or_else(|| by_hand(options.task), |(_, name)| name.clone());
    let file = shard::name(plan, &name);
    let work = scratch.join(&file);
    if work.exists() {
        for finding in Store::open(&work)?.forget_damaged()? {
            note(&format!("damaged, and computed again: {}", finding.what));
        }
    }
    let (mut store, _) = Store::enter(&work, campaign, Order::default())?;
    let before = Before::of(&folder, plan, &name);
    if go_on_from(&mut store, &before.others, options)? > 0 {
        // What failed in another job is in this slice because it is to be computed again.
        store.retry_failed()?;
    }
    go_on_from(&mut store, &before.own, options)?;
    if options.retry_failed {
        store.retry_failed()?;
    }
    let task = Task {
        publisher: Publisher::new(work, folder.join(file), options.publish_every),
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
fn by_hand(task: usize) -> TaskName {
    TaskName {
        job: "by-hand".into(),
        task,
        restart: 0,
        node: Identity::of_this_process().host,
    }
}

/// Leaves only the cases of the slice in a campaign. Gives the name of the plan.
fn restrict(options: &Options<'_>, campaign: &mut Campaign) -> Result<String, Error> {
    let (plan, keys) = if let Some(path) = options.slices {
        Slices::read(path, options.task, options.tasks)?
    } else {
        let all: Vec<OpenCase> = campaign
            .certain()
            .map(|(key, case)| OpenCase {
                key: key.to_string(),
                cost: case.cost(),
                begun: false,
            })
            .collect();
        let mut slices = Slices::cut(&all, options.tasks);
        (
            slices.plan(&campaign.text),
            slices.tasks.swap_remove(options.task),
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
            path: options.slices.map(Path::to_owned).unwrap_or_default(),
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
fn go_on_from(store: &mut Store, sources: &[PathBuf], options: &Options<'_>) -> Result<u64, Error> {
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
                    (options.note)(&damaged.to_string());
                }
            }
            Err(error @ (StoreError::OtherBuild { .. } | StoreError::OtherCampaign { .. })) => {
                (options.note)(&format!("{error}: not used"));
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(failures)
}
