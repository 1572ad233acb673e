//! Conversion of keywords of Python to values of campaign files, and of results to dictionaries.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use serde::Serialize;
use std::num::NonZeroUsize;
use sweep::data::Value as OfAxis;
use toml::{Table, Value};

/// A short description of a value.
pub(crate) fn shown(given: &Bound<'_, PyAny>) -> String {
    let text = given
        .repr()
        .map_or_else(|_| "something".into(), |text| text.to_string());
    if text.chars().count() > 60 {
        let kind = given.get_type().name();
        return kind.map_or_else(|_| "something".into(), |kind| kind.to_string());
    }
    text
}

/// A number of frames or steps, from 1.
pub(crate) fn stride(every: usize) -> PyResult<usize> {
    NonZeroUsize::new(every)
        .map(NonZeroUsize::get)
        .ok_or_else(|| PyValueError::new_err("every must be a whole number from 1, got 0"))
}

/// A case by its name on the command line: the beginning of its key, or its number from 1.
pub(crate) struct CaseName(pub(crate) String);

impl<'py> FromPyObject<'_, 'py> for CaseName {
    type Error = PyErr;

    fn extract(case: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(key) = case.extract::<String>() {
            return Ok(Self(key));
        }
        match case.extract::<NonZeroUsize>() {
            Ok(number) => Ok(Self(number.to_string())),
            Err(_) => Err(PyTypeError::new_err(format!(
                "expected the beginning of a key or the number of a run, from 1, got {}",
                shown(&case)
            ))),
        }
    }
}

/// Allowed types of an argument, for messages.
const ALLOWED: &str = "a number, a text, a list or an array of them, or a dict";

/// A value of Python as one of a campaign file; `None` for `None`, an absent key. `name` is the
/// argument.
pub(crate) fn value(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Option<Value>> {
    if given.is_none() {
        return Ok(None);
    }
    // True and False are whole numbers too.
    if let Ok(truth) = given.cast::<PyBool>() {
        return Ok(Some(Value::Boolean(truth.is_true())));
    }
    if let Ok(text) = given.cast::<PyString>() {
        return Ok(Some(Value::String(text.to_cow()?.into_owned())));
    }
    if given.is_instance_of::<PyInt>() || given.hasattr("__index__")? && !given.hasattr("shape")? {
        let whole = given.extract::<i64>().map_err(|_| {
            PyValueError::new_err(format!(
                "{name} must be a whole number below 2^63, got {}",
                shown(given)
            ))
        });
        return whole.map(|whole| Some(Value::Integer(whole)));
    }
    if given.is_instance_of::<PyFloat>() {
        return Ok(Some(Value::Float(given.extract()?)));
    }
    if let Ok(dict) = given.cast::<PyDict>() {
        return Ok(Some(Value::Table(table(dict)?)));
    }
    if given.cast::<PyList>().is_ok() || given.cast::<PyTuple>().is_ok() {
        let entry = |entry: PyResult<Bound<'_, PyAny>>| {
            value(name, &entry?)?
                .ok_or_else(|| PyTypeError::new_err(format!("{name}: None in a list: {ALLOWED}")))
        };
        let all: PyResult<Vec<Value>> = given.try_iter()?.map(entry).collect();
        return Ok(Some(Value::Array(all?)));
    }
    // Arrays and scalars of numpy, paths, and what is like them.
    for plain in ["tolist", "__fspath__"] {
        if given.hasattr(plain)? {
            return value(name, &given.call_method0(plain)?);
        }
    }
    Err(PyTypeError::new_err(format!(
        "{name} must be {ALLOWED}, got {}",
        shown(given)
    )))
}

/// A dictionary as a table, without what is `None`.
pub(crate) fn table(dict: &Bound<'_, PyDict>) -> PyResult<Table> {
    let mut table = Table::new();
    for (key, given) in dict {
        let key: String = key.extract().map_err(|_| {
            PyTypeError::new_err(format!("keys are texts, and {key:?} is none of them"))
        })?;
        if let Some(value) = value(&key, &given)? {
            table.insert(key, value);
        }
    }
    Ok(table)
}

/// A value on an axis for Python.
pub(crate) fn of_axis(py: Python<'_>, value: OfAxis) -> PyResult<Bound<'_, PyAny>> {
    Ok(match value {
        OfAxis::Word(word) => PyString::new(py, word).into_any(),
        OfAxis::Count(count) => count.into_pyobject(py)?.into_any(),
        OfAxis::Number(number) => PyFloat::new(py, number).into_any(),
    })
}

/// A result of the program for Python.
pub(crate) fn answer<'py>(py: Python<'py>, answer: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text =
        serde_json::to_string(answer).map_err(|error| PyValueError::new_err(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}
