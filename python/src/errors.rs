//! Errors of the program as exceptions of Python, with the same words.

use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyRuntimeError, PyValueError};
use std::io::ErrorKind;
use sweep::api::ErrorRenderer;
use sweep::campaign::CampaignError;
use sweep::report::ReportError;
use sweep::store::StoreError as OfTheStore;
use sweep::{Error, exit};

create_exception!(
    sheared_layers,
    SimulationError,
    PyRuntimeError,
    "A computation that was begun could not be finished: it did not converge, or spheres came too close."
);
create_exception!(
    sheared_layers,
    StoreError,
    PyOSError,
    "The store failed: its disk is full, it is locked, gone or damaged. What was finished is safe in it."
);

/// The exception for an error: `ValueError` for bad input, `FileNotFoundError` for a file that is not there, [`StoreError`] for trouble
/// with the store, [`SimulationError`] for all else.
pub(crate) fn raise(error: impl Into<Error>) -> PyErr {
    let error = error.into();
    let words = words(&error);
    match &error {
        Error::Store(OfTheStore::Missing { .. }) => PyFileNotFoundError::new_err(words),
        Error::Campaign(CampaignError::Unreadable { source, .. })
            if source.kind() == ErrorKind::NotFound =>
        {
            PyFileNotFoundError::new_err(words)
        }
        error => match error.exit_code() {
            exit::BAD_INPUT => PyValueError::new_err(words),
            exit::STORE => StoreError::new_err(words),
            _ => SimulationError::new_err(words),
        },
    }
}

/// What the command line says of an error.
fn words(error: &Error) -> String {
    match error {
        // Arguments have the names of the keywords here.
        Error::Report(ReportError::Argument { argument, message }) => {
            format!("{}: {message}", argument.trim_start_matches('-'))
        }
        error => {
            let text = ErrorRenderer::plain().explain(error);
            let text = text.trim_matches('\n').trim_end();
            text.strip_prefix("  × ").unwrap_or(text).to_owned()
        }
    }
}
