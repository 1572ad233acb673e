//! How far a campaign is.

use super::Error;
use super::jobs::{Jobs, jobs};
use crate::cluster::shard;
use crate::statistics::Verdict;
use crate::store::{Counts, Disagreement, FailureLine, PointState, ProcessLine, Store, StoreError};
use serde::Serialize;
use std::path::PathBuf;

/// How far a campaign is.
#[derive(Serialize)]
pub(crate) struct Status {
    pub(crate) campaign: String,
    /// The file the store was last run with, if that is another version of the one asked about.
    pub(crate) last_run_with: Option<PathBuf>,
    /// Runs in the store that are not asked for.
    pub(crate) orphans: u64,
    pub(crate) cases: Counts,
    /// Share of the estimated work that is done, 0 to 1.
    pub(crate) work_done: f64,
    /// Seconds of processor that the open cases still take on this machine, estimated.
    pub(crate) remaining_cpu_s: f64,
    /// Points at which a precision is asked for, and how many of them still take seeds that are not known yet.
    pub(crate) precision: Option<PrecisionStatus>,
    pub(crate) processes: Vec<ProcessLine>,
    pub(crate) failures: Vec<FailureLine>,
    /// Jobs that were submitted, with their tasks.
    pub(crate) jobs: Vec<Jobs>,
    /// Published shards that were not merged, or have changed since.
    pub(crate) unmerged_shards: u64,
    /// Results of one case that do not agree bit for bit.
    pub(crate) disagreements: Vec<Disagreement>,
    /// Shards of another build that were let in.
    pub(crate) mixed_shards: u64,
}

/// How points stand at which a precision is requested.
#[derive(Serialize)]
pub(crate) struct PrecisionStatus {
    pub(crate) points: usize,
    /// Those that have it.
    pub(crate) reached: usize,
    /// Those that still take seeds.
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
    /// As an open store shows it, with so many failures at most.
    pub(crate) fn of(store: &Store, failures: u32) -> Result<Self, Error> {
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
