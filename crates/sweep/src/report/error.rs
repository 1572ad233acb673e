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
    /// An invalid argument.
    #[error("{}{message}", before(argument))]
    Argument {
        /// The argument of the command line.
        argument: &'static str,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// Output that could not be written.
    #[error("cannot write the output: {0}")]
    Output(#[from] io::Error),
}

impl ReportError {
    /// The error about an argument.
    pub(super) fn argument(argument: &'static str, message: impl Into<String>) -> Self {
        Self::Argument {
            argument,
            message: message.into(),
        }
    }
}

/// Prefix of a message: the argument, unless it is the file, which is not an option.
fn before(argument: &str) -> String {
    match argument {
        "FILE" => String::new(),
        option => format!("{option}: "),
    }
}
