//! Why there is no report.

use crate::store::StoreError;
use std::io;
use std::path::PathBuf;

/// Why a report was refused or could not be made.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum ReportError {
    /// The store.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Store(#[from] StoreError),
    /// An argument that cannot be meant.
    #[error("{argument}: {message}")]
    Argument {
        /// The argument of the command line.
        argument: &'static str,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// A case that is not in the store, or is named by too little.
    #[error("{given:?} is {what} of {}", path.display())]
    #[diagnostic(help(
        "a case is named by the beginning of its key, or by its number in the campaign file, from 1"
    ))]
    Case {
        /// The store.
        path: PathBuf,
        /// What was given.
        given: String,
        /// What it is.
        what: &'static str,
    },
    /// A run without frames.
    #[error("no frames of case {key} are stored")]
    #[diagnostic(help(
        "`sweep run CAMPAIGN.toml --trajectory` keeps frames of the runs it computes"
    ))]
    NoFrames {
        /// Its key.
        key: String,
    },
    /// Output that could not be written.
    #[error("cannot write the output: {0}")]
    Output(#[from] io::Error),
}
