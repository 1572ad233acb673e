//! The runs of a campaign as a table, with all their stored results.

use super::schema::axis_columns;
use super::{Store, StoreError, results};
use crate::data::Kind;
use crate::data::{Cells, DataColumn, Word};
use rusqlite::Connection;
use rusqlite::types::{FromSqlError, Type, ValueRef};

impl Store {
    /// All runs of the campaign in its order, one row each: the columns of the view `runs`, by
    /// their names. Pending runs have no results.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], and I/O or SQLite errors.
    pub fn runs(&self) -> Result<Vec<DataColumn>, StoreError> {
        self.point_runs()?;
        let query = format!(
            "SELECT c.key, c.state, {}, c.seed, r.case_id, r.{}
             FROM cases c JOIN points p ON p.id = c.point
             LEFT JOIN results r ON r.case_id = c.id AND c.state IN ('done', 'jammed')
             WHERE c.counts ORDER BY c.position",
            axis_columns("p."),
            results::columns().replace(", ", ", r.")
        );
        self.read(columns_of(&self.connection, &query))
    }
}

/// The result of a statement as columns.
fn columns_of(connection: &Connection, query: &str) -> rusqlite::Result<Vec<DataColumn>> {
    let mut statement = connection.prepare(query)?;
    let mut columns: Vec<DataColumn> = statement
        .columns()
        .map(|column| {
            let kind = match column.decl_type() {
                Some("TEXT") => Kind::Word,
                Some("INTEGER") => Kind::Count,
                _ => Kind::Number,
            };
            DataColumn::named(column.name().to_owned(), kind, 0)
        })
        .collect();
    let mut rows = statement.query([])?;
    while let Some(row) = rows.next()? {
        for (place, column) in columns.iter_mut().enumerate() {
            let cell = row.get_ref(place)?;
            push(&mut column.cells, cell).map_err(|error| {
                rusqlite::Error::FromSqlConversionFailure(place, cell.data_type(), Box::new(error))
            })?;
        }
    }
    Ok(columns)
}

/// Adds a stored value.
fn push(cells: &mut Cells, value: ValueRef<'_>) -> Result<(), FromSqlError> {
    let is_null = value.data_type() == Type::Null;
    match cells {
        Cells::Word(cells) => {
            let word = value.as_str_or_null()?;
            cells.push(word.map(|word| Word::Owned(word.to_owned())));
        }
        Cells::Count(cells) => cells.push(value.as_i64_or_null()?),
        Cells::Number(cells) => cells.push(match value {
            // SQLite stores whole floats as integers in columns without a type.
            ValueRef::Integer(whole) => Some(whole as f64),
            _ if is_null => None,
            other => Some(other.as_f64()?),
        }),
    }
    Ok(())
}
