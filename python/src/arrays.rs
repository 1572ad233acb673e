//! Reading and creating arrays of numpy.

use numpy::ndarray::{ArrayView1, ArrayView2};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyImportError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyCapsule;

/// What arrays of numbers may hold.
const NUMBERS: &str = "float64, or whole numbers and narrower floats, which are converted";

/// The supported versions of numpy, as in `pyproject.toml`.
const NUMPY: std::ops::Range<(u32, u32)> = (1, 24)..(3, 0);

/// Checks that a supported numpy is installed. All functions with arrays call this first: otherwise
/// the calls would panic.
///
/// # Errors
/// `ImportError` with what is wrong with it.
pub(crate) fn need_numpy(py: Python<'_>) -> PyResult<()> {
    static IS_THERE: PyOnceLock<()> = PyOnceLock::new();
    IS_THERE
        .get_or_try_init(py, || match find_numpy(py) {
            Ok(None) => Ok(()),
            Ok(Some(version)) => Err(PyImportError::new_err(format!(
                "numpy {version} is installed, and sheared_layers needs 1.24 or later, below 3: pip install --upgrade numpy"
            ))),
            Err(error) => {
                let words = format!(
                    "sheared_layers needs numpy, which cannot be used here ({error}): pip install --force-reinstall numpy"
                );
                let failed = PyImportError::new_err(words);
                failed.set_cause(py, Some(error));
                Err(failed)
            }
        })
        .copied()
}

/// Looks for numpy and its interface for compiled programs. Gives its version if that is another
/// than those that are needed.
fn find_numpy(py: Python<'_>) -> PyResult<Option<String>> {
    let version: String = py.import("numpy")?.getattr("__version__")?.extract()?;
    let mut numbers = version.split('.').map(|part| part.parse().unwrap_or(0));
    let found = (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0));
    if !NUMPY.contains(&found) {
        return Ok(Some(version));
    }
    // The crate needs the same, and this in addition.
    py.import("numpy.lib")?.getattr("NumpyVersion")?;
    let core = if found.0 >= 2 {
        "numpy._core.multiarray"
    } else {
        "numpy.core.multiarray"
    };
    let interface = py.import(core)?.getattr("_ARRAY_API")?;
    interface.cast_into::<PyCapsule>()?;
    Ok(None)
}

/// Reads an array `(N, D)` of any strides.
pub(crate) fn vectors<const D: usize>(
    name: &str,
    given: &Bound<'_, PyAny>,
) -> PyResult<Vec<[f64; D]>> {
    let shape = format!("(N, {D})");
    let array = with_numbers(name, given, &shape)?;
    let wrong = || wrong_shape(name, &array, &shape);
    let array = array.cast::<PyArray2<f64>>().map_err(|_| wrong())?;
    let array = array.try_readonly()?;
    let view: ArrayView2<'_, f64> = array.as_array();
    if view.ncols() != D {
        return Err(wrong());
    }
    let rows = view.rows().into_iter();
    Ok(rows.map(|row| std::array::from_fn(|k| row[k])).collect())
}

/// Whether an array has three columns.
///
/// # Errors
/// `TypeError` or `ValueError` if it is no array of numbers.
pub(crate) fn has_three_columns(name: &str, given: &Bound<'_, PyAny>) -> PyResult<bool> {
    let array = with_numbers(name, given, "(N, 2)")?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    Ok(matches!(shape[..], [_, 3]))
}

/// Reads an array `(N,)` of any strides.
pub(crate) fn numbers(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = with_numbers(name, given, "(N,)")?;
    let Ok(array) = array.cast::<PyArray1<f64>>() else {
        return Err(wrong_shape(name, &array, "(N,)"));
    };
    let array = array.try_readonly()?;
    let view: ArrayView1<'_, f64> = array.as_array();
    Ok(view.iter().copied().collect())
}

/// An array of float64 of any shape, made from what is like one.
pub(crate) fn with_numbers<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
    shape: &str,
) -> PyResult<Bound<'py, PyAny>> {
    if given.cast::<PyArray2<f64>>().is_ok() || given.cast::<PyArray1<f64>>().is_ok() {
        return Ok(given.clone());
    }
    let numpy = given.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (given,)).map_err(|error| {
        PyValueError::new_err(format!(
            "{name}: expected an array of shape {shape}: {}",
            error.value(given.py())
        ))
    })?;
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    let bytes: usize = dtype.getattr("itemsize")?.extract()?;
    if !["i", "u", "f"].contains(&kind.as_str()) || bytes > 8 {
        return Err(PyTypeError::new_err(format!(
            "{name}: expected an array of shape {shape} of {NUMBERS}, got dtype {dtype}"
        )));
    }
    array.call_method1("astype", ("float64",))
}

fn wrong_shape(name: &str, array: &Bound<'_, PyAny>, shape: &str) -> PyErr {
    let found = array
        .getattr("shape")
        .map_or_else(|_| "another".into(), |shape| shape.to_string());
    PyValueError::new_err(format!("{name}: expected shape {shape}, got {found}"))
}

/// An array `(N, D)` of rows that lie one after the other.
pub(crate) fn of_rows(py: Python<'_>, rows: Vec<f64>, width: usize) -> PyResult<Py<PyArray2<f64>>> {
    let n = rows.len() / width;
    Ok(PyArray1::from_vec(py, rows).reshape([n, width])?.unbind())
}

/// An array `(N,)`.
pub(crate) fn of_numbers(
    py: Python<'_>,
    values: impl IntoIterator<Item = f64>,
) -> Py<PyArray1<f64>> {
    PyArray1::from_vec(py, values.into_iter().collect()).unbind()
}
