//! The tidy table as a Parquet file: typed columns, so that no reader has to guess, and their units in the file itself.

use super::Report;
use super::ReportError;
use super::columns::{Column, columns_of};
use crate::axes::{Kind, Value};
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type as Field;
use std::sync::Arc;

/// The points as a Parquet file: one row each, the columns of the CSV. Words are strings, counts 64-bit integers, other
/// numbers doubles, null where nothing was measured. The file's metadata say `campaign`, and of every column `NAME.unit`
/// and `NAME.meaning`.
///
/// # Errors
/// None that is known: it is written to memory.
pub fn parquet(report: &Report) -> Result<Vec<u8>, ReportError> {
    encode(report).map_err(|error| ReportError::Output(std::io::Error::other(error)))
}

/// The file.
fn encode(report: &Report) -> Result<Vec<u8>, ParquetError> {
    let columns = columns_of(report);
    let fields = columns
        .iter()
        .map(|column| field(column).map(Arc::new))
        .collect::<Result<Vec<_>, _>>()?;
    let schema = Field::group_type_builder("points")
        .with_fields(fields)
        .build()?;
    let about = |key: String, value: &str| KeyValue::new(key, value.to_owned());
    let metadata = columns
        .iter()
        .flat_map(|column| {
            [
                about(format!("{}.unit", column.name), column.unit),
                about(format!("{}.meaning", column.name), column.meaning),
            ]
        })
        .chain([about("campaign".into(), &report.campaign)])
        .collect();
    let properties = WriterProperties::builder()
        .set_created_by(concat!("sweep version ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(metadata))
        .build();
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::new(properties))?;
    let mut rows = file.next_row_group()?;
    for column in &columns {
        let cells = report.points.iter().map(|point| column.cell(point));
        match column.content() {
            Kind::Word => write::<ByteArrayType>(&mut rows, cells, |value| match value {
                Value::Word(word) => ByteArray::from(word),
                other => ByteArray::from(other.to_string().as_str()),
            }),
            Kind::Count => write::<Int64Type>(&mut rows, cells, |value| match value {
                Value::Count(count) => i64::try_from(count).unwrap_or(i64::MAX),
                _ => 0,
            }),
            Kind::Number => write::<DoubleType>(&mut rows, cells, |value| match value {
                Value::Number(number) => number,
                _ => f64::NAN,
            }),
        }?;
    }
    rows.close()?;
    file.close()?;
    Ok(bytes)
}

/// The type of a column.
fn field(column: &Column) -> Result<Field, ParquetError> {
    let (physical, logical) = match column.content() {
        Kind::Word => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Kind::Count => (Physical::INT64, None),
        Kind::Number => (Physical::DOUBLE, None),
    };
    Field::primitive_type_builder(column.name, physical)
        .with_logical_type(logical)
        .with_repetition(Repetition::OPTIONAL)
        .build()
}

/// Writes the next column.
fn write<T: DataType>(
    rows: &mut SerializedRowGroupWriter<'_, &mut Vec<u8>>,
    cells: impl Iterator<Item = Option<Value>>,
    convert: fn(Value) -> T::T,
) -> Result<(), ParquetError> {
    let cells: Vec<Option<T::T>> = cells.map(|cell| cell.map(convert)).collect();
    let there: Vec<i16> = cells.iter().map(|cell| cell.is_some().into()).collect();
    let values: Vec<T::T> = cells.into_iter().flatten().collect();
    let Some(mut column) = rows.next_column()? else {
        return Err(ParquetError::General("more columns than its schema".into()));
    };
    column
        .typed::<T>()
        .write_batch(&values, Some(&there), None)?;
    column.close()
}
