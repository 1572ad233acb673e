//! A table of the program as Arrow, through the interface of capsules.

use crate::arrays::need_numpy;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{
    ArrayRef, Float64Array, Int64Array, RecordBatch, RecordBatchIterator, StringArray,
};
use arrow_schema::ffi::FFI_ArrowSchema;
use arrow_schema::{ArrowError, DataType, Field, Schema};
use numpy::PyArray1;
use pyo3::exceptions::{PyKeyError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict};
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};
use sweep::data::{Cells, DataColumn};

/// A table, which pandas, polars and pyarrow read without copies.
///
/// ``pandas.DataFrame.from_arrow(table)``, ``polars.DataFrame(table)``, ``pyarrow.table(table)``;
/// ``table["viscosity"]`` is a column as an array of numpy.
#[pyclass(frozen, module = "sheared_layers")]
pub(crate) struct Table(Vec<DataColumn>, OnceLock<RecordBatch>);

impl Table {
    pub(crate) fn of(columns: Vec<DataColumn>) -> Self {
        Self(columns, OnceLock::new())
    }

    /// As Arrow, made once: all readers share its numbers. Units and meanings are metadata of the
    /// fields.
    fn batch(&self) -> PyResult<RecordBatch> {
        if let Some(made) = self.1.get() {
            return Ok(made.clone());
        }
        let (mut fields, mut arrays): (Vec<Field>, Vec<ArrayRef>) = Default::default();
        for column in &self.0 {
            let (kind, array): (_, ArrayRef) = match &column.cells {
                Cells::Word(cells) => (
                    DataType::Utf8,
                    Arc::new(cells.iter().map(Option::as_deref).collect::<StringArray>()),
                ),
                Cells::Count(cells) => (DataType::Int64, Arc::new(Int64Array::from(cells.clone()))),
                Cells::Number(cells) => (
                    DataType::Float64,
                    Arc::new(Float64Array::from(cells.clone())),
                ),
            };
            let about = [("unit", column.unit), ("meaning", column.meaning)].into_iter();
            let about = about.filter(|(_, text)| !text.is_empty());
            let about: HashMap<String, String> =
                about.map(|(key, text)| (key.into(), text.into())).collect();
            fields.push(Field::new(column.name.to_string(), kind, true).with_metadata(about));
            arrays.push(array);
        }
        let made =
            RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).map_err(arrow_error)?;
        Ok(self.1.get_or_init(|| made).clone())
    }

    /// A text about each column that has one.
    fn about<'py>(
        &self,
        py: Python<'py>,
        text: impl Fn(&DataColumn) -> &'static str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for column in self.0.iter().filter(|column| !text(column).is_empty()) {
            all.set_item(&*column.name, text(column))?;
        }
        Ok(all)
    }
}

/// An error of Arrow, which is not expected.
#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn arrow_error(error: ArrowError) -> PyErr {
    PyRuntimeError::new_err(error.to_string())
}

#[pymethods]
impl Table {
    /// The table as a stream of Arrow (`PyCapsule` interface).
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // Other types requested are not converted, as the interface allows.
        let _ = requested_schema;
        let batch = self.batch()?;
        let schema = batch.schema();
        let batches = RecordBatchIterator::new([Ok(batch)], schema);
        let stream = FFI_ArrowArrayStream::new(Box::new(batches));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    /// The types of the columns (`PyCapsule` interface).
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let batch = self.batch()?;
        let schema = FFI_ArrowSchema::try_from(batch.schema_ref().as_ref()).map_err(arrow_error)?;
        PyCapsule::new_with_value(py, schema, c"arrow_schema")
    }

    fn __len__(&self) -> usize {
        self.0.first().map_or(0, |column| column.cells.len())
    }

    /// Names of the columns.
    #[getter]
    fn columns(&self) -> Vec<String> {
        let names = self.0.iter().map(|column| column.name.to_string());
        names.collect()
    }

    /// Units of the columns, if known; "1" for pure numbers.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.about(py, |column| column.unit)
    }

    /// Meanings of the columns, where their names do not say them.
    #[getter]
    fn meanings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.about(py, |column| column.meaning)
    }

    /// A column as an array: float64 with nan for missing values; int64, or float64 with missing
    /// values; object for text.
    fn __getitem__<'py>(&self, py: Python<'py>, wanted: &str) -> PyResult<Bound<'py, PyAny>> {
        let Some(column) = self.0.iter().find(|column| column.name == wanted) else {
            return Err(PyKeyError::new_err(format!(
                "no column is called {wanted:?}; there are {}",
                self.columns().join(", ")
            )));
        };
        need_numpy(py)?;
        let missing = |cells: &[Option<i64>]| {
            let cells = cells
                .iter()
                .map(|cell| cell.map_or(f64::NAN, |cell| cell as f64));
            PyArray1::from_iter(py, cells).into_any()
        };
        Ok(match &column.cells {
            Cells::Number(cells) => {
                let cells = cells.iter().map(|cell| cell.unwrap_or(f64::NAN));
                PyArray1::from_iter(py, cells).into_any()
            }
            Cells::Count(cells) => match cells.iter().copied().collect::<Option<Vec<i64>>>() {
                Some(all) => PyArray1::from_vec(py, all).into_any(),
                None => missing(cells),
            },
            Cells::Word(cells) => {
                let kind = PyDict::new(py);
                kind.set_item("dtype", "object")?;
                let words: Vec<Option<&str>> = cells.iter().map(Option::as_deref).collect();
                let numpy = py.import("numpy")?;
                numpy.call_method("array", (words,), Some(&kind))?
            }
        })
    }

    /// The table as a data frame of pandas.
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let helper = slf.py().import("sheared_layers._table")?;
        helper.call_method1("to_pandas", (slf,))
    }

    /// The HTML of the table for notebooks: its first and last rows.
    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let helper = slf.py().import("sheared_layers._table")?;
        helper.call_method1("to_html", (slf,))
    }

    fn __repr__(&self) -> String {
        let columns = self.columns().join(", ");
        format!("Table({} rows: {columns})", self.__len__())
    }
}
