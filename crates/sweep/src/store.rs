//! The store: one `SQLite` file per campaign, which holds all state of the program.
//!
//! State changes are synced to the disk before they take effect; checkpoints survive a killed
//! process, and all but the last few survive a power cut. Every change to a running case requires
//! that this process still owns it. A run is a pure function of its case, so damaged or lost
//! results are recomputed.
//!
//! # Files, from the lowest up
//! A file reads only files named above it here.
//! ```text
//! statements, digest, error, files     SQL by names of columns; checksums; database and log
//! points, entered, processes           rows of points, of the campaign, of processes
//! schema                               tables, what a store of another program lacks, copies
//! database                             an open store: lock, transactions, reading without a log
//! samples, runs, frames                what a run has, each under its digest
//! rules, claims, settle, workers       seeds that count; a case at work; its result; processes
//! show, entry, check                   what readers see; entering a campaign; damage
//! merge, submissions                   shards, and the jobs of a cluster that made them
//! ```

mod check;
mod claims;
mod database;
mod digest;
mod entered;
mod entry;
mod error;
mod files;
mod frames;
mod merge;
mod points;
mod processes;
mod rules;
mod runs;
mod samples;
mod schema;
mod settle;
mod show;
mod statements;
mod submissions;
mod workers;

pub(crate) use crate::model::checkpoint::can_be_kept;
pub use crate::model::checkpoint::{BadCheckpoint, Checkpoint};
#[doc(hidden)]
pub use check::accept_changes;
pub use check::{Checked, Finding, check};
pub use claims::{Claim, NewRows};
pub use database::Store;
pub(crate) use database::{shorten_lock_wait, snapshot};
pub use entry::{Adoption, Inventory, StoreSource};
pub(crate) use entry::{CASE_BYTES, SAMPLE_BYTES};
pub use error::StoreError;
pub(crate) use files::is_free;
pub use frames::StoredFrame;
pub(crate) use merge::MergedCases;
pub use merge::{Damaged, Disagreement, Merged};
pub use processes::{Provenance, TaskName};
pub use rules::PointState;
pub use runs::{Attempt, FailureLine};
pub use settle::Finished;
pub(crate) use settle::LastState;
pub use show::{CaseDetails, Counts, Origin, ProcessLine, Work};
pub use submissions::{OpenCase, SliceState, Submission};
pub use workers::DEATH_LIMIT;

#[cfg(test)]
mod tests;
