//! Cached prepared statements.

use rusqlite::types::FromSql;
use rusqlite::{CachedStatement, Connection, OptionalExtension as _, Params, Result, Row};

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
