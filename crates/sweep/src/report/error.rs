//! Errors of reports.

use crate::store::StoreError;
use std::io;

/// Why a report was refused or could not be made.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum ReportError {
    /// The store.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Store(#[from] StoreError),
    /// A request that cannot be met.
    #[error("{0}")]
    Refused(String),
    /// An invalid option.
    #[error("{option}: {message}")]
    Argument {
        /// Name of the option, with underscores.
        option: &'static str,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// Output that could not be written.
    #[error("cannot write the output: {0}")]
    Output(#[from] io::Error),
}

impl ReportError {
    /// The error about an option.
    pub(super) fn argument(option: &'static str, message: impl Into<String>) -> Self {
        Self::Argument {
            option,
            message: message.into(),
        }
    }
}
