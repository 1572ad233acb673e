//! Tables as Parquet: typed columns, so that no reader has to guess, and their units and meanings
//! in the file itself.

use super::{Cells, DataColumn, Word};
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type as Field;
use std::fmt;
use std::io::{self, Write};
use std::sync::Arc;

/// A Parquet file that is being written. Text columns are strings, counts 64-bit integers, other
/// numbers doubles, missing values null. The metadata hold `NAME.unit` and `NAME.meaning` of every
/// column.
pub struct ParquetFile<W: Write + Send>(SerializedFileWriter<W>);

impl<W: Write + Send> fmt::Debug for ParquetFile<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("ParquetFile").field(&self.0).finish()
    }
}

impl<W: Write + Send> ParquetFile<W> {
    /// Starts a file of tables with the columns of `like`; `about` is metadata of the file.
    ///
    /// # Errors
    /// Output that cannot be written.
    pub fn begin(
        out: W,
        name: &str,
        like: &[DataColumn],
        about: &[(&str, &str)],
    ) -> io::Result<Self> {
        let begun = || {
            let fields = like
                .iter()
                .map(|column| field(column).map(Arc::new))
                .collect::<Result<Vec<_>, _>>()?;
            let schema = Field::group_type_builder(name)
                .with_fields(fields)
                .build()?;
            let entry = |key: String, value: &str| KeyValue::new(key, value.to_owned());
            let metadata = like
                .iter()
                .flat_map(|column| {
                    [
                        entry(format!("{}.unit", column.name), column.unit),
                        entry(format!("{}.meaning", column.name), column.meaning),
                    ]
                })
                .chain(about.iter().map(|(key, value)| entry((*key).into(), value)))
                .collect();
            let properties = WriterProperties::builder()
                .set_created_by(concat!("sweep version ", env!("CARGO_PKG_VERSION")).to_owned())
                .set_key_value_metadata(Some(metadata))
                .build();
            SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties))
        };
        begun().map(Self).map_err(io_error)
    }

    /// Adds the rows of a table that has the columns of the file.
    ///
    /// # Errors
    /// Output that cannot be written.
    pub fn append(&mut self, table: &[DataColumn]) -> io::Result<()> {
        let mut added = || {
            let mut rows = self.0.next_row_group()?;
            for column in table {
                match &column.cells {
                    Cells::Word(cells) => {
                        write::<_, ByteArrayType, _>(&mut rows, cells, |word: &Word| {
                            ByteArray::from(word.as_ref())
                        })
                    }
                    Cells::Count(cells) => {
                        write::<_, Int64Type, _>(&mut rows, cells, |count| *count)
                    }
                    Cells::Number(cells) => {
                        write::<_, DoubleType, _>(&mut rows, cells, |number| *number)
                    }
                }?;
            }
            rows.close().map(|_| ())
        };
        added().map_err(io_error)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// Output that cannot be written.
    pub fn finish(self) -> io::Result<()> {
        self.0.close().map(|_| ()).map_err(io_error)
    }
}

/// The system error, if there is one.
fn io_error(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(source) => match source.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(other) => io::Error::other(other),
        },
        error => io::Error::other(error),
    }
}

/// The type of a column.
fn field(column: &DataColumn) -> Result<Field, ParquetError> {
    let (physical, logical) = match column.cells {
        Cells::Word(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Cells::Count(_) => (Physical::INT64, None),
        Cells::Number(_) => (Physical::DOUBLE, None),
    };
    Field::primitive_type_builder(&column.name, physical)
        .with_logical_type(logical)
        .with_repetition(Repetition::OPTIONAL)
        .build()
}

/// Writes the next column.
fn write<W: Write + Send, T: DataType, C>(
    rows: &mut SerializedRowGroupWriter<'_, W>,
    cells: &[Option<C>],
    convert: fn(&C) -> T::T,
) -> Result<(), ParquetError> {
    let there: Vec<i16> = cells.iter().map(|cell| cell.is_some().into()).collect();
    let values: Vec<T::T> = cells.iter().flatten().map(convert).collect();
    let Some(mut column) = rows.next_column()? else {
        return Err(ParquetError::General("more columns than its schema".into()));
    };
    column
        .typed::<T>()
        .write_batch(&values, Some(&there), None)?;
    column.close()
}
