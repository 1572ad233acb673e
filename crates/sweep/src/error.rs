//! The error type of the program, and the exit code each kind ends with.

mod renderer;

pub use renderer::ErrorRenderer;

use crate::campaign::CampaignError;
use crate::cluster::{ClusterError, no_room};
use crate::instant::InputError;
use crate::report::ReportError;
use crate::runner::RunnerError;
use crate::serve::ServeError;
use crate::store::StoreError;
use crate::system::exit;
use std::io;
use std::path::{Path, PathBuf};

/// Why a command was refused or could not be finished.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum Error {
    /// A campaign file.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Campaign(#[from] CampaignError),
    /// A report.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Report(#[from] ReportError),
    /// The store.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Store(#[from] StoreError),
    /// The tasks of a cluster.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Cluster(#[from] ClusterError),
    /// Computing a campaign.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Runner(#[from] RunnerError),
    /// The live page.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Serve(#[from] ServeError),
    /// A file that could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file that could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Malformed JSON input.
    #[error("{}:{line}:{column}: {message}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// An invalid value in JSON input.
    #[error("{}: {field}: {message}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Name of the value.
        field: &'static str,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// An argument of the command line.
    #[error("{argument}: {message}")]
    Argument {
        /// The argument.
        argument: &'static str,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// An option of the command line that a report refused.
    #[error("{flag}: {message}")]
    Option {
        /// The option with its dashes.
        flag: String,
        /// What is wrong, and what is allowed.
        message: String,
    },
    /// A computation of the solver that was refused or failed.
    #[error(transparent)]
    Physics(#[from] sd_core::Error),
    /// Output that could not be written.
    #[error("cannot write the output: {0}")]
    Output(#[from] io::Error),
}

impl Error {
    /// An error in JSON input from a file.
    pub(crate) fn of_input(path: &Path, error: InputError) -> Self {
        let path = path.to_owned();
        match error {
            InputError::Json {
                line,
                column,
                message,
            } => Self::Json {
                path,
                line,
                column,
                message,
            },
            InputError::Value { field, message } => Self::Value {
                path,
                field,
                message,
            },
            InputError::Physics(error) => error.into(),
        }
    }

    /// The exit code of the program after this error.
    pub fn exit_code(&self) -> u8 {
        use sd_core::Error as Physics;
        match self {
            Self::Physics(error) | Self::Runner(RunnerError::Tables(error)) => match error {
                Physics::OutOfRange { .. }
                | Physics::Refused(_)
                | Physics::Missing { .. }
                | Physics::Length { .. }
                | Physics::OfSphere { .. }
                | Physics::NetForce { .. }
                | Physics::NoSpheres
                | Physics::Overlap { .. }
                | Physics::CellTooSmall { .. }
                | Physics::LatticeTooShort { .. }
                | Physics::BadPair { .. } => exit::BAD_INPUT,
                _ => exit::FAILED,
            },
            Self::Serve(ServeError::Start { .. }) | Self::Runner(RunnerError::Start { .. }) => {
                exit::FAILED
            }
            Self::Output(_)
            | Self::Report(ReportError::Output(_))
            | Self::Serve(ServeError::Output(_) | ServeError::Report(ReportError::Output(_))) => {
                exit::STORE
            }
            Self::Store(error)
            | Self::Runner(RunnerError::Store(error))
            | Self::Report(ReportError::Store(error))
            | Self::Serve(
                ServeError::Store(error) | ServeError::Report(ReportError::Store(error)),
            ) if error.is_of_the_store() => exit::STORE,
            Self::Cluster(error) if error.is_of_the_disk() => exit::STORE,
            Self::Write { path, source } if no_room(source, path) => exit::STORE,
            _ => exit::BAD_INPUT,
        }
    }

    /// Whether the reader closed standard output, which is not an error (`sweep report | head`).
    pub fn is_closed_pipe(&self) -> bool {
        matches!(
            self,
            Self::Output(error)
                | Self::Report(ReportError::Output(error))
                | Self::Serve(ServeError::Output(error))
            if error.kind() == io::ErrorKind::BrokenPipe
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lost() -> StoreError {
        StoreError::ClaimLost { key: "3f9a".into() }
    }

    fn full() -> io::Error {
        io::ErrorKind::StorageFull.into()
    }

    #[test]
    fn errors_of_the_store_and_the_output_have_one_exit_code() {
        let met: [Error; 8] = [
            lost().into(),
            full().into(),
            RunnerError::from(lost()).into(),
            ReportError::from(lost()).into(),
            ReportError::from(full()).into(),
            ServeError::from(lost()).into(),
            ServeError::from(full()).into(),
            ServeError::from(ReportError::from(full())).into(),
        ];
        for error in met {
            assert_eq!(error.exit_code(), exit::STORE, "{error:?}");
        }
        let unknown = StoreError::NoFrames { key: "3f9a".into() };
        let refused = Error::from(ReportError::from(unknown));
        assert_eq!(refused.exit_code(), exit::BAD_INPUT);
    }

    #[test]
    fn bad_spheres_and_lattices_are_bad_input() {
        let refused = sd_core::Error::OfSphere {
            field: "radii",
            sphere: 0,
            value: -1.0,
            allowed: "positive and finite",
        };
        let short = sd_core::Error::LatticeTooShort {
            shortest: 3.0,
            needed: 6.0,
        };
        for error in [refused, short] {
            assert_eq!(Error::from(error).exit_code(), exit::BAD_INPUT);
        }
    }

    #[test]
    fn a_closed_reader_is_detected_in_every_module() {
        let gone = || io::Error::from(io::ErrorKind::BrokenPipe);
        for error in [
            gone().into(),
            ReportError::from(gone()).into(),
            ServeError::from(gone()).into(),
        ] {
            let error: Error = error;
            assert!(error.is_closed_pipe(), "{error:?}");
        }
        assert!(!Error::from(full()).is_closed_pipe());
    }
}
