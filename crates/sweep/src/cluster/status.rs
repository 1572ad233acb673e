//! Progress of a campaign.

use super::jobs::{Jobs, jobs};
use super::{ClusterError, shard};
use crate::measure::Verdict;
use crate::store::{Counts, Disagreement, FailureLine, PointState, ProcessLine, Store, StoreError};
use serde::Serialize;
use std::path::PathBuf;

/// Progress of a campaign.
#[derive(Serialize)]
pub(crate) struct Status {
    pub(crate) campaign: String,
    /// The file the store was last run with, if it is another version of the file given.
    pub(crate) last_run_with: Option<PathBuf>,
    /// Runs in the store that the campaign no longer contains.
    pub(crate) orphans: u64,
    pub(crate) cases: Counts,
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
    pub(crate) jobs: Vec<Jobs>,
    /// Published shards that were not merged, or have changed since.
    pub(crate) unmerged_shards: u64,
    /// Results of one case that differ in some bit.
    pub(crate) disagreements: Vec<Disagreement>,
    /// Shards of another build that were accepted.
    pub(crate) mixed_shards: u64,
}

/// Points with a requested precision, by outcome.
#[derive(Serialize)]
pub(crate) struct PrecisionStatus {
    pub(crate) points: usize,
    /// Points that have reached it.
    pub(crate) reached: usize,
    /// Points that still need seeds.
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

impl Status {
    /// The status of an open store, with a maximum number of failures.
    pub(crate) fn of(store: &Store, failures: u32) -> Result<Self, ClusterError> {
        let work = store.work()?;
        let shards: Vec<PathBuf> = shard::published(&shard::folder_of(store.path()))
            .into_iter()
            .map(|shard| shard.path)
            .collect();
        Ok(Self {
            campaign: store.campaign_name()?,
            last_run_with: store.last_run_with().map(PathBuf::from),
            orphans: store.orphans()?,
            cases: work.counts,
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
            unmerged_shards: store.unmerged(&shards)?,
            disagreements: store.disagreements()?,
            mixed_shards: store.mixed_shards()?,
        })
    }
}
