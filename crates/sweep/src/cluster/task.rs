//! One task of a campaign, in a store of its own that is published as a shard.

use super::shard::Publisher;
use super::slices::Slices;
use super::slurm::{self, Requeue};
use super::{ClusterError, shard};
use crate::model::campaign::Campaign;
use crate::runner::{Progress, RunObserver};
use crate::store::{MergedCases, OpenCase, Store, StoreError, TaskName};
use crate::system::process::ProcessIdentity;
use rustix::process::Signal;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A task of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TaskOf {
    pub(crate) task: usize,
    pub(crate) tasks: usize,
}

/// Where a task works.
pub(crate) struct TaskOptions {
    pub(crate) folder: PathBuf,
    /// A folder on a disk of this machine.
    pub(crate) scratch: PathBuf,
    pub(crate) publish_every: Duration,
    pub(crate) retry_failed: bool,
    /// Whether runs keep a frame with each sample.
    pub(crate) trajectory: bool,
}

/// A running task.
pub(crate) struct Task {
    pub(crate) publisher: Publisher,
    /// Its name at Slurm, which can restart it; `None` for other starts.
    at_slurm: Option<TaskName>,
    /// Marks that it was cancelled.
    cancelled: PathBuf,
}

impl RunObserver for Task {
    fn look(&self, progress: &Progress) {
        if self.publisher.is_due()
            && let Err(error) = self.publisher.publish()
        {
            // Computing continues: the disk may have space again at the next attempt.
            progress.note(&format!("{error}; will be retried"));
        }
    }

    fn before_abort(&self, signal: i32, progress: &Progress) {
        match self.publisher.publish() {
            Ok(()) => progress.note(&self.again(signal)),
            Err(error) => progress.note(&error.to_string()),
        }
    }
}

impl Task {
    /// Requests a restart of the task after a signal with work left. Returns a message about the
    /// outcome.
    pub(crate) fn again(&self, signal: i32) -> String {
        let Some(name) = &self.at_slurm else {
            return "work is left: repeat the same command to continue".to_owned();
        };
        let again = if self.cancelled.exists() || signal == Signal::INT.as_raw() {
            Requeue::Cancelled
        } else {
            slurm::start_again(name, signal == Signal::USR1.as_raw())
        };
        match again {
            Requeue::Yes => "work is left: slurm restarts the task".to_owned(),
            Requeue::Cancelled => "cancelled: `sweep submit` continues from here".to_owned(),
            Requeue::No(why) => format!(
                "work is left, and the task could not be restarted ({why}): `sweep submit` continues from here"
            ),
        }
    }

    /// Creates the store of a task from all known results of its slice, and publishes it for the
    /// first time.
    pub(crate) fn begin(
        options: &TaskOptions,
        task: usize,
        plan: &str,
        campaign: &Campaign,
        note: &dyn Fn(&str),
    ) -> Result<(Store, Self), ClusterError> {
        let folder = &options.folder;
        for folder in [folder, &options.scratch] {
            std::fs::create_dir_all(folder)
                .map_err(|source| ClusterError::of_plan(folder, source))?;
        }
        let at_slurm = slurm::this_task(task);
        let name = at_slurm.clone().unwrap_or_else(|| TaskName {
            job: "by-hand".into(),
            task,
            restart: 0,
            node: ProcessIdentity::of_this_process().host,
        });
        let file = shard::name(plan, &name);
        let work = options.scratch.join(&file);
        if work.exists() {
            for finding in Store::open(&work)?.forget_damaged()? {
                note(&format!("damaged, and computed again: {}", finding.what));
            }
        }
        let (mut store, _) = Store::enter(&work, campaign)?;
        // Results known when the slices were planned and those of other jobs with the same slices;
        // and what the task itself published before a restart.
        let shards = shard::published(folder).into_iter();
        let (own, others): (Vec<_>, Vec<_>) = shards
            .filter(|shard| shard.plan == plan && shard.task.task == task)
            .partition(|shard| shard.task.job == shard::sanitize(&name.job));
        let begun = shard::plan_folder(folder, plan).join(shard::BEGUN);
        let others: Vec<PathBuf> = (begun.exists().then_some(begun).into_iter())
            .chain(others.into_iter().map(|shard| shard.path))
            .collect();
        if reuse_shards(&mut store, &others, note)? > 0 {
            // Failures of another job are in this slice in order to be retried.
            store.retry_failed()?;
        }
        let own: Vec<PathBuf> = own.into_iter().map(|shard| shard.path).collect();
        reuse_shards(&mut store, &own, note)?;
        if options.retry_failed {
            store.retry_failed()?;
        }
        if options.trajectory {
            store.request_frames()?;
        }
        let task = Self {
            publisher: Publisher::new(work, folder.join(file), options.publish_every),
            cancelled: shard::cancel_mark(folder, plan, &name.job),
            at_slurm,
        };
        store.work_for(name);
        // A failure to publish should show before hours of computing, not after.
        task.publisher.publish()?;
        Ok((store, task))
    }
}

/// Reduces a campaign to the cases of the slice of a task, from a file of slices or else cut here.
/// Returns the name of the plan.
pub(crate) fn restrict(
    slices: Option<&Path>,
    part: TaskOf,
    campaign: &mut Campaign,
) -> Result<String, ClusterError> {
    let mut cut = if let Some(path) = slices {
        Slices::read(path, part.tasks)?
    } else {
        let certain = campaign.certain().map(|(key, case)| OpenCase {
            key: key.to_string(),
            cost: case.cost(),
            begun: false,
        });
        Slices::cut(&campaign.text, &certain.collect::<Vec<_>>(), part.tasks)
    };
    let (plan, keys) = (cut.plan, cut.tasks.swap_remove(part.task));
    let keys: HashSet<String> = keys.into_iter().collect();
    // A task computes the cases it was given; which seeds count is decided when all results are
    // merged.
    campaign.rules.clear();
    campaign
        .cases
        .retain(|(key, _)| keys.contains(&key.to_string()));
    if campaign.cases.len() < keys.len() {
        return Err(ClusterError::Slices {
            path: slices.map(Path::to_owned).unwrap_or_default(),
            reason: format!(
                "{} of its cases are not in {}: these are slices of another campaign file",
                keys.len() - campaign.cases.len(),
                campaign.file.display()
            ),
        });
    }
    Ok(plan)
}

/// Reuses the parts of the slice that shards hold; returns the number of failures among them. An
/// unusable shard does not stop the task: the slice is recomputed.
fn reuse_shards(
    store: &mut Store,
    sources: &[PathBuf],
    note: &dyn Fn(&str),
) -> Result<u64, ClusterError> {
    let mut failures = 0;
    for source in sources {
        match store.merge(MergedCases::Own, std::slice::from_ref(source)) {
            Ok(merged) => {
                failures += merged.failures;
                for damaged in merged.damaged {
                    note(&damaged.to_string());
                }
            }
            Err(error @ StoreError::OtherCampaign { .. }) => {
                note(&format!("{error}: not used"));
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(failures)
}
