//! Conversion of keywords of Python to values of campaign files, and of results to dictionaries.

use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use serde::Serialize;
use std::path::PathBuf;
use sweep::data::Value as OfAxis;
use toml::{Table, Value};

/// Reads an argument; errors have its name and what is allowed.
fn read<'a, 'py, T: FromPyObject<'a, 'py>>(
    name: &str,
    given: &'a Bound<'py, PyAny>,
    allowed: &str,
) -> PyResult<T> {
    given.extract::<T>().map_err(|error: T::Error| {
        let error: PyErr = error.into();
        let words = format!("{name} must be {allowed}, got {}", shown(given));
        if error.is_instance_of::<PyOverflowError>(given.py()) {
            PyValueError::new_err(words)
        } else {
            PyTypeError::new_err(words)
        }
    })
}

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

/// A number.
pub(crate) fn number(name: &str, given: &Bound<'_, PyAny>) -> PyResult<f64> {
    read(name, given, "a number")
}

/// A whole number that is not negative.
pub(crate) fn count(name: &str, given: &Bound<'_, PyAny>) -> PyResult<u64> {
    read(name, given, "a whole number from 0 to 2^64 - 1")
}

/// A number of frames or steps, from 1.
pub(crate) fn stride(given: Option<&Bound<'_, PyAny>>) -> PyResult<usize> {
    let Some(given) = given else {
        return Ok(1);
    };
    let allowed = "a whole number from 1";
    match read("every", given, allowed)? {
        0 => Err(PyValueError::new_err(format!(
            "every must be {allowed}, got 0"
        ))),
        every => Ok(every),
    }
}

/// True or False.
pub(crate) fn flag(name: &str, given: Option<&Bound<'_, PyAny>>, default: bool) -> PyResult<bool> {
    given.map_or(Ok(default), |given| read(name, given, "True or False"))
}

/// A text.
pub(crate) fn text(name: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    read(name, given, "a text")
}

/// Bytes.
pub(crate) fn bytes(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<u8>> {
    read(name, given, "bytes")
}

/// The name of a file.
pub(crate) fn file(name: &str, given: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    read(name, given, "the name of a file")
}

/// A dictionary.
pub(crate) fn dict<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    read(name, given, "a dict")
}

/// Texts.
pub(crate) fn texts(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    read(name, given, "a list of texts")
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
        return whole(name, given).map(Some);
    }
    if given.is_instance_of::<PyFloat>() {
        return Ok(Some(Value::Float(given.extract()?)));
    }
    if let Ok(dict) = given.cast::<PyDict>() {
        return Ok(Some(Value::Table(table(dict)?)));
    }
    if given.cast::<PyList>().is_ok() || given.cast::<PyTuple>().is_ok() {
        let mut all = Vec::new();
        for entry in given.try_iter()? {
            let entry = entry?;
            let entry = value(name, &entry)?.ok_or_else(|| {
                PyTypeError::new_err(format!("{name}: None in a list: {ALLOWED}"))
            })?;
            all.push(entry);
        }
        return Ok(Some(Value::Array(all)));
    }
    // Arrays and scalars of numpy, and what is like them.
    if given.hasattr("tolist")? {
        return value(name, &given.call_method0("tolist")?);
    }
    if given.hasattr("__fspath__")? {
        return value(name, &given.call_method0("__fspath__")?);
    }
    Err(PyTypeError::new_err(format!(
        "{name} must be {ALLOWED}, got {}",
        shown(given)
    )))
}

/// A whole number.
fn whole(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Value> {
    given.extract::<i64>().map(Value::Integer).map_err(|_| {
        PyValueError::new_err(format!(
            "{name} must be a whole number below 2^63, got {}",
            shown(given)
        ))
    })
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
