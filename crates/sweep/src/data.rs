//! Tables as whole columns, for programs.

mod parquet;
mod value;

pub use parquet::ParquetFile;
pub(crate) use value::Tag;
pub use value::{Kind, Value};

use serde::{Serialize, Serializer};
use std::borrow::Cow;
use std::io::{self, Write};

/// Text in a table.
pub type Word = Cow<'static, str>;

/// A column of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct DataColumn {
    /// Its name.
    pub name: Word,
    /// Its unit; `1` for pure numbers, empty for text and where it is unknown.
    pub unit: &'static str,
    /// Its meaning; empty where its name suffices.
    pub meaning: &'static str,
    /// What is in it.
    pub cells: Cells,
}

/// The cells of a column; `None` for empty ones.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// Words.
    Word(Vec<Option<Word>>),
    /// Whole numbers.
    Count(Vec<Option<i64>>),
    /// Numbers, possibly infinite.
    Number(Vec<Option<f64>>),
}

impl Cells {
    /// An empty column with a capacity.
    pub fn with_capacity(kind: Kind, rows: usize) -> Self {
        match kind {
            Kind::Word => Self::Word(Vec::with_capacity(rows)),
            Kind::Count => Self::Count(Vec::with_capacity(rows)),
            Kind::Number => Self::Number(Vec::with_capacity(rows)),
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Word(cells) => cells.len(),
            Self::Count(cells) => cells.len(),
            Self::Number(cells) => cells.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a cell. In a column of floats an integer is converted; a value of another kind or NaN
    /// leaves the cell empty.
    pub fn push(&mut self, value: Option<Value>) {
        match self {
            Self::Word(cells) => cells.push(match value {
                Some(Value::Word(word)) => Some(Cow::Borrowed(word)),
                _ => None,
            }),
            Self::Count(cells) => cells.push(match value {
                Some(Value::Count(count)) => Some(i64::try_from(count).unwrap_or(i64::MAX)),
                _ => None,
            }),
            Self::Number(cells) => cells.push(match value {
                Some(Value::Number(number)) if !number.is_nan() => Some(number),
                Some(Value::Count(count)) => Some(count as f64),
                _ => None,
            }),
        }
    }

    /// Adds the cells of a column of the same kind.
    pub(crate) fn append(&mut self, more: Self) {
        match (self, more) {
            (Self::Word(cells), Self::Word(more)) => cells.extend(more),
            (Self::Count(cells), Self::Count(more)) => cells.extend(more),
            (Self::Number(cells), Self::Number(more)) => cells.extend(more),
            (cells, more) => {
                for _ in 0..more.len() {
                    cells.push(None);
                }
            }
        }
    }

    /// A cell as a number; `None` for an empty one and for words.
    pub(crate) fn number(&self, row: usize) -> Option<f64> {
        match self {
            Self::Word(_) => None,
            Self::Count(cells) => cells[row].map(|count| count as f64),
            Self::Number(cells) => cells[row],
        }
    }

    /// Whether a cell is empty.
    pub(crate) fn is_missing(&self, row: usize) -> bool {
        match self {
            Self::Word(cells) => cells[row].is_none(),
            _ => self.number(row).is_none(),
        }
    }

    /// A cell as text; empty for `None`.
    pub fn text(&self, row: usize) -> String {
        match self {
            Self::Word(cells) => cells[row].clone().unwrap_or_default().into_owned(),
            Self::Count(cells) => cells[row].map_or_else(String::new, |count| count.to_string()),
            Self::Number(cells) => cells[row].map_or_else(String::new, |number| {
                // All digits, with an exponent in place of many zeros.
                let text = format!("{number:?}");
                text.strip_suffix(".0").unwrap_or(&text).to_owned()
            }),
        }
    }
}

impl DataColumn {
    /// A column without cells, unit or meaning.
    pub fn named(name: impl Into<Word>, kind: Kind, rows: usize) -> Self {
        Self {
            name: name.into(),
            unit: "",
            meaning: "",
            cells: Cells::with_capacity(kind, rows),
        }
    }

    /// A column of these cells, without a unit.
    pub(crate) fn of(
        name: impl Into<Word>,
        kind: Kind,
        meaning: &'static str,
        cells: impl Iterator<Item = Option<Value>>,
    ) -> Self {
        let mut column = Self {
            unit: "1",
            meaning,
            ..Self::named(name, kind, cells.size_hint().0)
        };
        cells.for_each(|cell| column.cells.push(cell));
        column
    }
}

/// The rows of a table as objects, by the names of its columns, with null for empty cells.
pub(crate) struct Objects<'t>(pub(crate) &'t [DataColumn]);

impl Serialize for Objects<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let rows = self.0.first().map_or(0, |column| column.cells.len());
        s.collect_seq((0..rows).map(|row| Object(self.0, row)))
    }
}

/// A row of a table as an object.
pub(crate) struct Object<'t>(pub(crate) &'t [DataColumn], pub(crate) usize);

impl Serialize for Object<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let columns = self.0.iter();
        s.collect_map(columns.map(|column| (column.name.as_ref(), Cell(&column.cells, self.1))))
    }
}

/// A cell.
pub(crate) struct Cell<'t>(pub(crate) &'t Cells, pub(crate) usize);

impl Serialize for Cell<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Cells::Word(cells) => cells[self.1].serialize(s),
            Cells::Count(cells) => cells[self.1].serialize(s),
            Cells::Number(cells) => cells[self.1].map(Value::Number).serialize(s),
        }
    }
}

/// Writes a table of a campaign as a Parquet file.
pub(crate) fn write_parquet(
    table: &[DataColumn],
    name: &str,
    campaign: &str,
    out: &mut Vec<u8>,
) -> io::Result<()> {
    let mut file = ParquetFile::begin(out, name, table, &[("campaign", campaign)])?;
    file.append(table)?;
    file.finish()
}

/// Writes a table as comma-separated values: a header row of names, then the rows; missing values
/// are empty.
pub(crate) fn write_csv(table: &[DataColumn], out: &mut dyn Write) -> io::Result<()> {
    write_csv_header(table, out)?;
    write_csv_rows(table, out)
}

/// Writes the header row of a table that comes in parts.
pub(crate) fn write_csv_header(table: &[DataColumn], out: &mut dyn Write) -> io::Result<()> {
    let names = table.iter().map(|column| column.name.as_ref());
    write_records(std::iter::once(names), out)
}

/// Writes the rows of a table.
pub(crate) fn write_csv_rows(table: &[DataColumn], out: &mut dyn Write) -> io::Result<()> {
    let number = table.first().map_or(0, |column| column.cells.len());
    let row = |row| table.iter().map(move |column| column.cells.text(row));
    write_records((0..number).map(row), out)
}

/// Writes name, unit and meaning of each column of a table.
pub(crate) fn write_units(table: &[DataColumn], out: &mut dyn Write) -> io::Result<()> {
    let about = |column: &DataColumn| {
        [
            column.name.to_string(),
            column.unit.into(),
            column.meaning.into(),
        ]
    };
    let header = ["column", "unit", "meaning"].map(str::to_owned);
    write_records(std::iter::once(header).chain(table.iter().map(about)), out)
}

/// Writes rows with equal numbers of cells.
fn write_records<R, C>(rows: impl IntoIterator<Item = R>, out: &mut dyn Write) -> io::Result<()>
where
    R: IntoIterator<Item = C>,
    C: AsRef<[u8]>,
{
    let mut records = csv::Writer::from_writer(out);
    for row in rows {
        records.write_record(row).map_err(csv_error)?;
    }
    records.flush()
}

/// The system error. The conversion of the `csv` crate would hide its kind.
fn csv_error(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Output with a closed reader.
    struct Closed;

    impl Write for Closed {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::BrokenPipe.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn cells_are_quoted_where_they_must_be() {
        let mut bytes = Vec::new();
        write_records([["a", "b"], ["1", "x, y"], ["", "\"z\""]], &mut bytes).unwrap();
        assert_eq!(bytes, b"a,b\n1,\"x, y\"\n,\"\"\"z\"\"\"\n");
    }

    #[test]
    fn a_closed_reader_is_detected_for_tables_of_any_length() {
        for rows in [1, 100_000] {
            let table = std::iter::repeat_n(["1.5"], rows);
            let error = write_records(table, &mut Closed).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::BrokenPipe, "{rows}");
        }
    }

    #[test]
    fn rows_of_another_length_are_refused() {
        let rows = [vec!["a", "b"], vec!["1"]];
        assert!(write_records(rows, &mut Vec::new()).is_err());
    }
}
