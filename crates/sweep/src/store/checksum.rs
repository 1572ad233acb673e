//! Checksums of what a store holds: written with every row that is averaged or shown later, and compared by whoever reads it.
//!
//! `SQLite` notices a page that is torn out of its place; it does not notice a changed digit.

use rusqlite::types::{Type, ValueRef};
use rusqlite::{Connection, OptionalExtension, Row, Statement, params};
use std::cmp::Ordering;
use std::fmt;

/// What a checksum is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// The campaign last run, with the number of cases in its grid.
    Campaign,
    /// Who computed: what the report says of a process.
    Process,
    /// The result of a case, with its state.
    Result,
    /// How far a run was computed, with its last state.
    End,
    /// All samples of a case.
    Samples,
    /// A failed attempt.
    Failure,
}

/// All kinds of rows.
pub(super) const KINDS: [Kind; 6] = [
    Kind::Campaign,
    Kind::Process,
    Kind::Result,
    Kind::End,
    Kind::Samples,
    Kind::Failure,
];

impl Kind {
    /// Its name in the store.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Campaign => "campaign",
            Self::Process => "process",
            Self::Result => "result",
            Self::End => "end",
            Self::Samples => "samples",
            Self::Failure => "failure",
        }
    }

    /// What people call it.
    const fn words(self) -> &'static str {
        match self {
            Self::Campaign => "the campaign and the number of its runs",
            Self::Process => "a process that computed",
            Self::Result => "the result of a run",
            Self::End => "the end of a run",
            Self::Samples => "the samples of a run",
            Self::Failure => "a failure",
        }
    }

    /// Columns and tables; the first column is the number a checksum is kept under.
    const fn rows(self) -> &'static str {
        match self {
            Self::Campaign => {
                "SELECT t.id, t.name, t.text, t.protocol, t.file, t.asks,
                     (SELECT count(*) FROM cases WHERE position IS NOT NULL) AS cases FROM campaign t"
            }
            Self::Process => {
                "SELECT t.id, t.host, t.version, t.physics_version, t.build, t.threads, t.started_at FROM processes t"
            }
            Self::Result => {
                "SELECT t.case_id, c.key, c.state, c.steps_done, t.* FROM results t JOIN cases c ON c.id = t.case_id"
            }
            Self::End => "SELECT t.* FROM ends t",
            Self::Samples => "SELECT t.* FROM samples t",
            Self::Failure => "SELECT t.* FROM failures t",
        }
    }

    /// The column that holds that number.
    const fn id(self) -> &'static str {
        match self {
            Self::Campaign | Self::Process | Self::Failure => "t.id",
            Self::Result | Self::End | Self::Samples => "t.case_id",
        }
    }

    /// Which rows have a checksum that says something: a result whose case waits to go on is written anew before it is shown.
    const fn condition(self) -> &'static str {
        match self {
            Self::Result => "WHERE c.state IN ('done', 'jammed')",
            _ => "",
        }
    }

    /// The order of rows of one number, and of numbers.
    const fn order(self) -> &'static str {
        match self {
            Self::Samples => "t.case_id, t.step",
            _ => self.id(),
        }
    }
}

/// Something that is not what it was when it was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Altered(String);

impl Altered {
    /// Of the row or the rows of a number.
    pub(super) fn of(kind: Kind, id: i64) -> Self {
        Self(format!(
            "{} (number {id}) is not what was written",
            kind.words()
        ))
    }

    /// As an error of a query.
    pub(super) fn into_error(self) -> rusqlite::Error {
        rusqlite::Error::FromSqlConversionFailure(0, Type::Null, Box::new(self))
    }

    /// Such an error of a query, for something else that contradicts itself.
    pub(super) fn error(what: impl Into<String>) -> rusqlite::Error {
        Self(what.into()).into_error()
    }

    /// What an error of a query is about, if it is about this.
    pub(super) fn in_error(error: &rusqlite::Error) -> Option<&Self> {
        match error {
            rusqlite::Error::FromSqlConversionFailure(_, _, inner) => inner.downcast_ref(),
            _ => None,
        }
    }
}

impl fmt::Display for Altered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Altered {}

/// A checksum under way.
struct Sum {
    hasher: blake3::Hasher,
    /// What was taken in and is not hashed yet: many small pieces cost more than one.
    pending: Vec<u8>,
    /// Names of the columns, each with what ends it.
    names: Vec<Vec<u8>>,
}

/// Bytes that are hashed together.
const PIECE: usize = 64 << 10;

impl Sum {
    /// Over the rows of a query.
    fn new(query: &Statement<'_>) -> Self {
        let name = |name: &str| [name.as_bytes(), &[0]].concat();
        Self {
            hasher: blake3::Hasher::new(),
            pending: Vec::new(),
            names: query.column_names().map(name).collect(),
        }
    }

    /// Takes in a row. Columns without a value leave no trace, so that one that is added later changes nothing.
    fn add(&mut self, row: &Row<'_>) -> Result<(), rusqlite::Error> {
        for (column, name) in self.names.iter().enumerate() {
            let (tag, bytes): (u8, &[u8]) = match row.get_ref(column)? {
                ValueRef::Null => continue,
                ValueRef::Integer(whole) => (1, &whole.to_le_bytes()),
                ValueRef::Real(real) => (2, &real.to_bits().to_le_bytes()),
                ValueRef::Text(text) => (3, text),
                ValueRef::Blob(blob) => (4, blob),
            };
            self.pending.extend_from_slice(name);
            self.pending.push(tag);
            self.pending
                .extend_from_slice(&(bytes.len() as u64).to_le_bytes());
            self.pending.extend_from_slice(bytes);
        }
        self.pending.push(0xff);
        if self.pending.len() >= PIECE {
            self.hash_pending();
        }
        Ok(())
    }

    fn hash_pending(&mut self) {
        self.hasher.update(&self.pending);
        self.pending.clear();
    }

    /// The sum so far, from which the next one begins.
    fn take(&mut self) -> i64 {
        self.hash_pending();
        let hash = self.hasher.finalize();
        self.hasher.reset();
        let mut first = [0; 8];
        first.copy_from_slice(&hash.as_bytes()[..8]);
        i64::from_le_bytes(first)
    }
}

/// The checksum of the row or rows of one number as they are now; `None` if there are none.
fn sum_of(connection: &Connection, kind: Kind, id: i64) -> Result<Option<i64>, rusqlite::Error> {
    let mut query = connection.prepare_cached(&format!(
        "{} WHERE {} = ?1 ORDER BY {}",
        kind.rows(),
        kind.id(),
        kind.order()
    ))?;
    let mut sum = Sum::new(&query);
    let mut rows = query.query([id])?;
    let mut any = false;
    while let Some(row) = rows.next()? {
        sum.add(row)?;
        any = true;
    }
    Ok(any.then(|| sum.take()))
}

/// Writes the checksum of a row, or of the rows of a case, as they are now. Whatever writes them calls this in the same
/// transaction.
pub(super) fn seal(connection: &Connection, kind: Kind, id: i64) -> Result<(), rusqlite::Error> {
    match sum_of(connection, kind, id)? {
        Some(value) => connection
            .prepare_cached(
                "INSERT OR REPLACE INTO checksums (kind, id, value) VALUES (?1, ?2, ?3)",
            )?
            .execute(params![kind.name(), id, value]),
        None => connection
            .prepare_cached("DELETE FROM checksums WHERE kind = ?1 AND id = ?2")?
            .execute(params![kind.name(), id]),
    }
    .map(|_| ())
}

/// Makes sure that a row, or the rows of a case, are what was written.
///
/// # Errors
/// [`Altered`], in an error of the query, if they are not.
pub(super) fn check(connection: &Connection, kind: Kind, id: i64) -> Result<(), rusqlite::Error> {
    let written: Option<i64> = connection
        .prepare_cached("SELECT value FROM checksums WHERE kind = ?1 AND id = ?2")?
        .query_row(params![kind.name(), id], |row| row.get(0))
        .optional()?;
    if sum_of(connection, kind, id)? == written {
        Ok(())
    } else {
        Err(Altered::of(kind, id).into_error())
    }
}

/// The same of a damaged store, whose checksums may be what is lost: then what else is known of the rows has to do.
///
/// # Errors
/// [`Altered`] if there is a checksum and it is another one, and rows that cannot be read.
pub(super) fn check_if_there(
    connection: &Connection,
    kind: Kind,
    id: i64,
) -> Result<(), rusqlite::Error> {
    let written: Result<i64, _> = connection
        .prepare_cached("SELECT value FROM checksums WHERE kind = ?1 AND id = ?2")
        .and_then(|mut query| query.query_row(params![kind.name(), id], |row| row.get(0)));
    match (sum_of(connection, kind, id)?, written) {
        (Some(now), Ok(written)) if now != written => Err(Altered::of(kind, id).into_error()),
        _ => Ok(()),
    }
}

/// Calls `each` with every number of a kind that meets a condition, and the checksum its rows have now.
fn sums(
    connection: &Connection,
    kind: Kind,
    condition: &str,
    mut each: impl FnMut(i64, i64) -> Result<(), rusqlite::Error>,
) -> Result<(), rusqlite::Error> {
    let mut query = connection.prepare(&format!(
        "{} {condition} ORDER BY {}",
        kind.rows(),
        kind.order()
    ))?;
    let mut sum = Sum::new(&query);
    let mut rows = query.query([])?;
    let mut current: Option<i64> = None;
    while let Some(row) = rows.next()? {
        let id: i64 = row.get(0)?;
        if let Some(before) = current.filter(|before| *before != id) {
            each(before, sum.take())?;
        }
        current = Some(id);
        sum.add(row)?;
    }
    current.map_or(Ok(()), |last| each(last, sum.take()))
}

/// Writes all checksums of a store that has none yet, or whose tables have new columns.
pub(super) fn seal_all(connection: &Connection) -> Result<(), rusqlite::Error> {
    for kind in KINDS {
        let mut found = Vec::new();
        sums(connection, kind, kind.condition(), |id, value| {
            found.push((id, value));
            Ok(())
        })?;
        let mut insert = connection
            .prepare("INSERT OR REPLACE INTO checksums (kind, id, value) VALUES (?1, ?2, ?3)")?;
        for (id, value) in found {
            insert.execute(params![kind.name(), id, value])?;
        }
    }
    Ok(())
}

/// Makes sure that all rows of a kind are what was written. Says how many there are.
///
/// # Errors
/// As [`check`].
pub(super) fn check_all(connection: &Connection, kind: Kind) -> Result<u64, rusqlite::Error> {
    // Both in the order of their numbers, side by side.
    let mut written =
        connection.prepare("SELECT id, value FROM checksums WHERE kind = ?1 ORDER BY id")?;
    let mut written = written.query([kind.name()])?;
    let mut number = 0;
    sums(connection, kind, kind.condition(), |id, value| {
        number += 1;
        while let Some(row) = written.next()? {
            // Those of rows that say nothing now, or are gone, are passed over.
            match row.get::<_, i64>(0)?.cmp(&id) {
                Ordering::Less => {}
                Ordering::Equal if row.get::<_, i64>(1)? == value => return Ok(()),
                _ => break,
            }
        }
        Err(Altered::of(kind, id).into_error())
    })?;
    Ok(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_value_a_missing_one_and_one_of_another_type_change_the_checksum() {
        let connection = Connection::open_in_memory().unwrap();
        connection
            .execute_batch("CREATE TABLE t (a, b, c); INSERT INTO t VALUES (1, 2.5, NULL)")
            .unwrap();
        let sum = |query: &str| {
            let mut query = connection.prepare(query).unwrap();
            let mut sum = Sum::new(&query);
            let mut rows = query.query([]).unwrap();
            while let Some(row) = rows.next().unwrap() {
                sum.add(row).unwrap();
            }
            sum.take()
        };
        let good = sum("SELECT a, b FROM t");
        assert_eq!(
            good,
            sum("SELECT a, b, c FROM t"),
            "nothing leaves no trace"
        );
        for other in [
            "SELECT a FROM t",
            "SELECT a, 2.5000000000000004 AS b FROM t",
            "SELECT a, '2.5' AS b FROM t",
            "SELECT 1.0 AS a, b FROM t",
            "SELECT a, b FROM t UNION ALL SELECT a, b FROM t",
            "SELECT b AS a, a AS b FROM t",
        ] {
            assert_ne!(good, sum(other), "{other}");
        }
    }
}
