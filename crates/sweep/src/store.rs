//! The store: one `SQLite` file per campaign, which holds all state of the program.
//!
//! State changes are synced to the disk before they take effect; checkpoints survive a killed
//! process, and all but the last few survive a power cut. Every change to a running case requires
//! that this process still owns it. A run is a pure function of its case, so damaged or lost
//! results are recomputed.

mod check;
mod claims;
mod database;
mod digest;
mod entry;
mod error;
mod frames;
mod merge;
mod rules;
mod runs;
mod samples;
mod schema;
mod settle;
mod show;
mod submissions;
mod workers;

pub(crate) use crate::model::checkpoint::can_be_kept;
pub use crate::model::checkpoint::{Checkpoint, Damage};
pub use check::{Checked, Finding, accept_changes, check};
pub use claims::{Claim, NewRows};
pub use database::{Store, StoreSource};
pub(crate) use database::{is_free, shorten_lock_wait, snapshot};
pub use entry::{Adoption, Inventory};
pub(crate) use entry::{CASE_BYTES, SAMPLE_BYTES};
pub use error::StoreError;
pub use frames::StoredFrame;
pub(crate) use merge::MergeMode;
pub use merge::{Damaged, Disagreement, Merged};
pub use rules::PointState;
pub use runs::{Attempt, FailureLine};
pub use settle::Finished;
pub(crate) use settle::LastState;
pub use show::{CaseDetails, Counts, Origin, ProcessLine, Work};
pub use submissions::{OpenCase, SliceState, Submission};
pub use workers::{DEATH_LIMIT, Provenance, TaskName};

#[cfg(test)]
mod tests;
