//! Statements of a connection, and their rows by the names of their columns.

use rusqlite::types::{FromSql, Type, Value};
use rusqlite::{CachedStatement, Connection, Error, OptionalExtension as _, Params, Result, Row};
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer};

/// Statements of a connection, or of the transaction it is in.
pub(super) trait Statements {
    /// A statement.
    fn prepared(&self, sql: &str) -> Result<CachedStatement<'_>>;

    /// Changes rows.
    fn run(&self, sql: &str, parameters: impl Params) -> Result<()> {
        self.change(sql, parameters).map(|_| ())
    }

    /// Changes rows. Returns their number.
    fn change(&self, sql: &str, parameters: impl Params) -> Result<usize> {
        self.prepared(sql)?.execute(parameters)
    }

    /// Whether there is a row.
    fn has(&self, sql: &str, parameters: impl Params) -> Result<bool> {
        self.prepared(sql)?.exists(parameters)
    }

    /// The first row, which must be there.
    fn one<T>(
        &self,
        sql: &str,
        parameters: impl Params,
        read: impl FnOnce(&Row<'_>) -> Result<T>,
    ) -> Result<T> {
        self.prepared(sql)?.query_row(parameters, read)
    }

    /// The first row, if there is one.
    fn find<T>(
        &self,
        sql: &str,
        parameters: impl Params,
        read: impl FnOnce(&Row<'_>) -> Result<T>,
    ) -> Result<Option<T>> {
        self.one(sql, parameters, read).optional()
    }

    /// All rows.
    fn all<T, C: FromIterator<T>>(
        &self,
        sql: &str,
        parameters: impl Params,
        read: impl FnMut(&Row<'_>) -> Result<T>,
    ) -> Result<C> {
        self.prepared(sql)?.query_map(parameters, read)?.collect()
    }

    /// All rows, by the names of their columns.
    fn named<T: DeserializeOwned>(&self, sql: &str, parameters: impl Params) -> Result<Vec<T>> {
        let mut query = self.prepared(sql)?;
        let rows = query.query(parameters)?;
        serde_rusqlite::from_rows(rows)
            .map(|row| row.map_err(unreadable))
            .collect()
    }

    /// The first row by the names of its columns, if there is one.
    fn first<T: DeserializeOwned>(&self, sql: &str, parameters: impl Params) -> Result<Option<T>> {
        Ok(self.named(sql, parameters)?.into_iter().next())
    }

    /// The first column of the first row, if there is one.
    fn value<T: FromSql>(&self, sql: &str, parameters: impl Params) -> Result<Option<T>> {
        self.find(sql, parameters, |row| row.get(0))
    }

    /// The first column of all rows.
    fn values<T: FromSql, C: FromIterator<T>>(
        &self,
        sql: &str,
        parameters: impl Params,
    ) -> Result<C> {
        self.all(sql, parameters, |row| row.get(0))
    }
}

impl Statements for Connection {
    fn prepared(&self, sql: &str) -> Result<CachedStatement<'_>> {
        self.prepare_cached(sql)
    }
}

/// As an error of a query.
fn unreadable(error: serde_rusqlite::Error) -> Error {
    match error {
        serde_rusqlite::Error::Rusqlite(error) => error,
        other => Error::FromSqlConversionFailure(0, Type::Null, Box::new(other)),
    }
}

/// A value in a column of JSON, for rows read by name; an empty one is null.
pub(super) fn json<'de, D: Deserializer<'de>, T: DeserializeOwned>(
    column: D,
) -> std::result::Result<T, D::Error> {
    let text = Option::<String>::deserialize(column)?;
    serde_json::from_str(text.as_deref().unwrap_or("null")).map_err(D::Error::custom)
}

/// A value as JSON, to be stored.
pub(super) fn as_json(value: &impl serde::Serialize) -> Result<Value> {
    let text = serde_json::to_string(value);
    text.map(Value::Text)
        .map_err(|error| Error::ToSqlConversionFailure(Box::new(error)))
}
