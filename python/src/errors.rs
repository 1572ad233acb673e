//! Errors of the program as exceptions of Python, with the same messages.

use pyo3::create_exception;
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::io::ErrorKind;
use sweep::Error;
use sweep::ErrorRenderer;
use sweep::campaign::CampaignError;
use sweep::report::ReportError;
use sweep::store::StoreError as OfTheStore;
use sweep::system::exit;

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

/// The exception for an error: `ValueError` for bad input, `FileNotFoundError` for a missing file,
/// [`StoreError`] for errors of the store, [`SimulationError`] for all others. It has the
/// attributes `key`, `value`, `allowed` and `suggestion`, each `None` where the error is about no
/// key.
pub(crate) fn raise(error: impl Into<Error>) -> PyErr {
    let error = error.into();
    let words = words(&error);
    with_attributes(exception(&error, words), &error)
}

/// The same of a campaign that was not read from a file, in which no line can be named.
pub(crate) fn raise_without_place(error: CampaignError) -> PyErr {
    match error {
        CampaignError::Faulty(fault) => {
            let words = fault.words();
            with_attributes(
                PyValueError::new_err(words),
                &Error::from(CampaignError::Faulty(fault)),
            )
        }
        other => raise(other),
    }
}

/// Adds the attributes of an error to an exception.
fn with_attributes(exception: PyErr, error: &Error) -> PyErr {
    let [key, value, allowed, suggestion] = match error {
        Error::Campaign(CampaignError::Faulty(fault)) => {
            let (key, value) = (fault.key(), fault.value());
            [key, value, Some(fault.allowed()), fault.suggestion()]
        }
        Error::Physics(sd_core::Error::Refused(of)) => {
            [Some(of.key), Some(&of.value), Some(&of.allowed), None]
        }
        Error::Report(ReportError::Argument { option, message }) => {
            [Some(*option), None, Some(message.as_str()), None]
        }
        _ => [None; 4],
    };
    Python::attach(|py| {
        let instance = exception.value(py);
        for (name, text) in [
            ("key", key),
            ("value", value),
            ("allowed", allowed),
            ("suggestion", suggestion),
        ] {
            // Exceptions of Python take attributes; one that does not is still the error.
            let _ = instance.setattr(name, text);
        }
    });
    exception
}

/// The exception of its kind.
fn exception(error: &Error, words: String) -> PyErr {
    match error {
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

/// The message of an error on the command line.
fn words(error: &Error) -> String {
    match error {
        Error::Report(error @ ReportError::Argument { .. }) => error.to_string(),
        error => {
            let text = ErrorRenderer::plain().explain(error);
            let text = text.trim_matches('\n').trim_end();
            text.strip_prefix("  × ").unwrap_or(text).to_owned()
        }
    }
}
