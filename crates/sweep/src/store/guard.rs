//! Stores that may come from anywhere are opened so that nothing in them acts: what is read is data, never SQL.

use super::schema::tables_of_today;
use super::{StoreError, place};
use rusqlite::config::DbConfig;
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension};
use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// Operations of `SQLite` from one look at the clock to the next.
const OPERATIONS: i32 = 100_000;
/// How long all queries of a store that is read may take together, before its size.
const PATIENCE: Duration = Duration::from_mins(2);
/// How much longer for every so many bytes: a tenth of what a slow network file system gives.
const BYTES_PER_SECOND: u64 = 1 << 20;
/// Largest text or blob that is read, in bytes.
const LENGTH_LIMIT: i32 = 256 << 20;

/// Pages of a store that are kept in memory, in KiB: enough to go through the results of 100 000 runs several times.
const CACHE: i32 = 64 << 10;

/// Lets nothing that is written in a store be carried out: no views, no triggers, no functions but those without effect.
pub(super) fn distrust(connection: &Connection) -> Result<(), rusqlite::Error> {
    for (option, value) in [
        (DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false),
        (DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true),
    ] {
        connection.set_db_config(option, value)?;
    }
    connection.set_limit(rusqlite::limits::Limit::SQLITE_LIMIT_LENGTH, LENGTH_LIMIT)?;
    Ok(())
}

/// Lets a connection keep pages in memory. This reads the list of tables, so it is no first look at a store.
pub(super) fn keep_pages(connection: &Connection) -> Result<(), rusqlite::Error> {
    connection.pragma_update(None, "cache_size", -CACHE)
}

/// Ends queries that take longer than any that reads a store of this size.
pub(super) fn limit_time(connection: &mut Connection, path: &Path) -> Result<(), rusqlite::Error> {
    let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
    let limit = PATIENCE + Duration::from_secs(bytes / BYTES_PER_SECOND);
    let begun = Instant::now();
    connection.progress_handler(OPERATIONS, Some(move || begun.elapsed() > limit))
}

/// Refuses what is no file: a folder, and what would let us wait for ever, as a pipe does.
pub(super) fn refuse_other_than_files(path: &Path) -> Result<(), StoreError> {
    place::refuse_folder(path)?;
    match std::fs::metadata(path) {
        Ok(there) if !there.is_file() => Err(StoreError::NotAFile {
            path: path.to_owned(),
        }),
        _ => Ok(()),
    }
}

/// A column of a table of ours.
#[derive(Debug)]
pub(super) struct Column {
    pub(super) name: String,
    /// As it was declared: `INTEGER`, `REAL`, `TEXT` or `BLOB`.
    kind: String,
}

impl Column {
    /// Whether we would ever write such a value there.
    pub(super) fn takes(&self, value: &Value) -> bool {
        match value {
            Value::Null => true,
            Value::Integer(_) => self.kind == "INTEGER" || self.kind == "REAL",
            Value::Real(_) => self.kind == "REAL",
            Value::Text(_) => self.kind == "TEXT",
            Value::Blob(_) => self.kind == "BLOB",
        }
    }
}

/// Names of our own tables and their columns.
static TABLES: LazyLock<Vec<(String, Vec<Column>)>> = LazyLock::new(|| {
    let column = |(name, kind): (&str, &str)| Column {
        name: name.to_owned(),
        kind: kind.to_owned(),
    };
    // Made in memory from statements of ours, which cannot fail; without them nothing would be read of other stores.
    tables_of_today().map_or_else(
        |_| Vec::new(),
        |tables| {
            tables
                .into_iter()
                .map(|table| {
                    let columns = table.columns_with_types().map(column).collect();
                    (table.name, columns)
                })
                .collect()
        },
    )
});

/// The columns a table of ours has, in order.
pub(super) fn columns_of(table: &str) -> &'static [Column] {
    TABLES
        .iter()
        .find(|(name, _)| name == table)
        .map_or(&[], |(_, columns)| columns)
}

/// Makes sure that what has the name of a table of ours is a table with values in it: no view, no virtual table, no columns
/// that are computed when they are read.
pub(super) fn has_plain_tables(connection: &Connection) -> Result<bool, rusqlite::Error> {
    for (table, _) in TABLES.iter() {
        let made: Option<(String, i64, String)> = connection
            .query_row(
                "SELECT type, rootpage, coalesce(sql, '') FROM main.sqlite_schema WHERE name = ?1 COLLATE NOCASE",
                [table],
                |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)),
            )
            .optional()?;
        let Some((kind, root, _)) = made else {
            continue;
        };
        let computed: i64 = connection.query_row(
            "SELECT count(*) FROM pragma_table_xinfo(?1, 'main') WHERE hidden != 0",
            [table],
            |row| row.get(0),
        )?;
        if kind != "table" || root < 2 || computed > 0 {
            return Ok(false);
        }
    }
    Ok(true)
}
