//! The store: one `SQLite` file per campaign, which holds all state of the program.
//!
//! State changes are synced to the disk before they take effect; checkpoints survive a killed
//! process, and all but the last few survive a power cut. Every change to a running case requires
//! that this process still owns it. A run is a pure function of its case, so damaged or lost
//! results are recomputed.

mod check;
mod claims;
mod details;
mod digest;
mod entry;
mod error;
mod failures;
mod frames;
mod inventory;
mod lock;
mod merge;
mod open;
mod place;
mod points;
mod processes;
mod reading;
mod registry;
mod rules;
mod runs;
mod samples;
mod schema;
mod settle;
mod statements;
mod submissions;
mod work;

pub(crate) use crate::model::checkpoint::can_be_kept;
pub use crate::model::checkpoint::{Checkpoint, Damage};
pub use check::{Checked, Finding, accept_changes, check};
pub use claims::{Claim, NewRows};
pub use details::{CaseDetails, Origin};
pub use error::StoreError;
pub use failures::{Attempt, FailureLine};
pub use frames::StoredFrame;
pub use inventory::{Adoption, Inventory};
pub(crate) use inventory::{CASE_BYTES, SAMPLE_BYTES};
pub(crate) use lock::shorten_lock_wait;
pub(crate) use merge::MergeMode;
pub use merge::{Damaged, Disagreement, Merged};
pub use open::Store;
pub(crate) use place::is_free;
pub use processes::{Provenance, TaskName};
pub use reading::StoreSource;
pub(crate) use reading::snapshot;
pub use registry::DEATH_LIMIT;
pub use rules::PointState;
pub use settle::Finished;
pub(crate) use settle::LastState;
pub use submissions::{OpenCase, SliceState, Submission};
pub use work::{Counts, ProcessLine, Work};

#[cfg(test)]
mod tests;
