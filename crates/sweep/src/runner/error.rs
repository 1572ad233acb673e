//! Errors that end a run of a campaign. Failed cases are no errors: they are in the store.

use crate::store::StoreError;

/// Why computing could not start or had to end.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum RunnerError {
    /// Threads or signal handlers that could not be created.
    #[error("cannot start {what}: {reason}")]
    #[diagnostic(help(
        "nothing was computed; close other programs of yours, or compute with fewer workers"
    ))]
    Start {
        /// The resource.
        what: &'static str,
        /// What the system said.
        reason: String,
    },
    /// The tables of two spheres could not be made.
    #[error(transparent)]
    Tables(#[from] sd_core::Error),
    /// The store failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Store(#[from] StoreError),
}
