//! A table of the program as Arrow, through the interface of capsules.

use crate::arrays::need_numpy;
use crate::values;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{
    ArrayRef, Float64Array, Int64Array, RecordBatch, RecordBatchIterator, StringArray,
};
use arrow_schema::ffi::FFI_ArrowSchema;
use arrow_schema::{ArrowError, DataType, Field, Schema};
use numpy::PyArray1;
use pyo3::exceptions::{PyImportError, PyKeyError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict, PyList, PyString};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::sync::Arc;
use sweep::data::{Cells, DataColumn};
use sweep::text::format::significant;

/// Rows shown in a notebook at the beginning and at the end of a long table.
const SHOWN: usize = 15;

/// A table, which pandas, polars and pyarrow read without copies.
///
/// ``pandas.DataFrame.from_arrow(table)``, ``polars.DataFrame(table)``, ``pyarrow.table(table)``;
/// ``table["viscosity"]`` is a column as an array of numpy.
#[pyclass(frozen, module = "sheared_layers")]
pub(crate) struct Table(RecordBatch);

impl Table {
    /// Of the columns of the program; units and meanings become metadata of the fields.
    pub(crate) fn of(columns: Vec<DataColumn>) -> PyResult<Self> {
        let mut fields = Vec::with_capacity(columns.len());
        let mut arrays: Vec<ArrayRef> = Vec::with_capacity(columns.len());
        for column in columns {
            let kind = match &column.cells {
                Cells::Word(_) => DataType::Utf8,
                Cells::Count(_) => DataType::Int64,
                Cells::Number(_) => DataType::Float64,
            };
            let about = [("unit", column.unit), ("meaning", column.meaning)];
            let about = about.into_iter().filter(|(_, text)| !text.is_empty());
            let about: HashMap<String, String> = about
                .map(|(key, text)| (key.to_owned(), text.to_owned()))
                .collect();
            fields.push(Field::new(column.name, kind, true).with_metadata(about));
            arrays.push(match column.cells {
                Cells::Word(cells) => Arc::new(StringArray::from_iter(cells)),
                Cells::Count(cells) => Arc::new(Int64Array::from(cells)),
                Cells::Number(cells) => Arc::new(Float64Array::from(cells)),
            });
        }
        let schema = Arc::new(Schema::new(fields));
        RecordBatch::try_new(schema, arrays)
            .map(Self)
            .map_err(arrow_error)
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
        let batches = RecordBatchIterator::new([Ok(self.0.clone())], self.0.schema());
        let stream = FFI_ArrowArrayStream::new(Box::new(batches));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    /// The types of the columns (`PyCapsule` interface).
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let schema =
            FFI_ArrowSchema::try_from(self.0.schema_ref().as_ref()).map_err(arrow_error)?;
        PyCapsule::new_with_value(py, schema, c"arrow_schema")
    }

    fn __len__(&self) -> usize {
        self.0.num_rows()
    }

    /// Names of the columns.
    #[getter]
    fn columns(&self) -> Vec<String> {
        let fields = self.0.schema_ref().fields().iter();
        fields.map(|field| field.name().clone()).collect()
    }

    /// Units of the columns, if known; "1" for pure numbers.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.about(py, "unit")
    }

    /// Meanings of the columns, where their names do not say them.
    #[getter]
    fn meanings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.about(py, "meaning")
    }

    /// A column as an array: float64 with nan for missing values; int64, or float64 with missing
    /// values; object for text.
    fn __getitem__<'py>(
        &self,
        py: Python<'py>,
        column: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let column = values::text("column", column)?;
        let Some(array) = self.0.column_by_name(&column) else {
            return Err(PyKeyError::new_err(format!(
                "no column is called {column:?}; there are {}",
                self.columns().join(", ")
            )));
        };
        need_numpy(py)?;
        let array = array.as_ref() as &dyn arrow_array::Array;
        let any = array.as_any();
        if let Some(numbers) = any.downcast_ref::<Float64Array>() {
            let numbers = numbers.iter().map(|number| number.unwrap_or(f64::NAN));
            return Ok(PyArray1::from_iter(py, numbers).into_any());
        }
        if let Some(counts) = any.downcast_ref::<Int64Array>() {
            if array.null_count() == 0 {
                return Ok(PyArray1::from_slice(py, counts.values()).into_any());
            }
            let numbers = counts
                .iter()
                .map(|count| count.map_or(f64::NAN, |count| count as f64));
            return Ok(PyArray1::from_iter(py, numbers).into_any());
        }
        let words = PyList::empty(py);
        if let Some(cells) = any.downcast_ref::<StringArray>() {
            for word in cells {
                words.append(word.map(|word| PyString::new(py, word)))?;
            }
        }
        let kind = PyDict::new(py);
        kind.set_item("dtype", "object")?;
        py.import("numpy")?
            .call_method("array", (words,), Some(&kind))
    }

    /// The table as a data frame of pandas.
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let needed = |name: &str| {
            slf.py().import(name).map_err(|_| {
                PyImportError::new_err(format!(
                    "to_pandas needs {name}: pip install 'sheared-layers[pandas]'"
                ))
            })
        };
        let frame = needed("pandas")?.getattr("DataFrame")?;
        let arrow = needed("pyarrow")?;
        if frame.hasattr("from_arrow")? {
            return frame.call_method1("from_arrow", (slf,));
        }
        arrow
            .call_method1("table", (slf,))?
            .call_method0("to_pandas")
    }

    /// The HTML of the table for notebooks: its first and last rows.
    fn _repr_html_(&self) -> String {
        let fields = self.0.schema_ref().fields();
        let mut html = String::from("<table><thead><tr>");
        for field in fields {
            let about = ["meaning", "unit"]
                .iter()
                .filter_map(|key| field.metadata().get(key));
            let about: Vec<&str> = about.map(String::as_str).collect();
            let (title, name) = (escaped(&about.join(", ")), escaped(field.name()));
            let _ = write!(html, "<th title=\"{title}\">{name}</th>");
        }
        html.push_str("</tr></thead><tbody>");
        let rows = self.0.num_rows();
        let is_cut = rows > 2 * SHOWN;
        for row in 0..rows {
            if is_cut && row == SHOWN {
                let _ = write!(html, "<tr><td colspan=\"{}\">…</td></tr>", fields.len());
            }
            if is_cut && (SHOWN..rows - SHOWN).contains(&row) {
                continue;
            }
            html.push_str("<tr>");
            for column in self.0.columns() {
                let _ = write!(html, "<td>{}</td>", escaped(&cell(column, row)));
            }
            html.push_str("</tr>");
        }
        let _ = write!(
            html,
            "</tbody></table><p>{rows} rows × {} columns</p>",
            fields.len()
        );
        html
    }

    fn __repr__(&self) -> String {
        format!(
            "Table({} rows: {})",
            self.0.num_rows(),
            self.columns().join(", ")
        )
    }
}

/// A cell as text; empty for missing values.
fn cell(column: &ArrayRef, row: usize) -> String {
    let column = column.as_ref() as &dyn arrow_array::Array;
    let any = column.as_any();
    if column.is_null(row) {
        return String::new();
    }
    if let Some(numbers) = any.downcast_ref::<Float64Array>() {
        return significant(numbers.value(row), 4);
    }
    if let Some(counts) = any.downcast_ref::<Int64Array>() {
        return counts.value(row).to_string();
    }
    let words = any.downcast_ref::<StringArray>();
    words.map_or_else(String::new, |words| words.value(row).to_owned())
}

/// Text escaped for HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

impl Table {
    fn about<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for field in self.0.schema_ref().fields() {
            if let Some(text) = field.metadata().get(key) {
                all.set_item(field.name(), text)?;
            }
        }
        Ok(all)
    }
}
