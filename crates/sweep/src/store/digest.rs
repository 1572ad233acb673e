//! Digests of the contents of a store, written with every row that is averaged or shown later, and
//! checked by readers.
//!
//! `SQLite` detects a misplaced page, but not a changed digit.

use super::statements::Statements;
use rusqlite::types::{Type, Value, ValueRef};
use rusqlite::{Connection, Params, Row, params_from_iter};
use std::fmt;
use std::ops::Range;

/// A digest being computed. It depends on the types and the order of the values that are there: a
/// column that an older store lacks is empty, and changes nothing.
#[derive(Default)]
pub(super) struct Digest(blake3::Hasher, Vec<u8>);

/// Number of bytes hashed together: many small pieces cost more than one.
const PIECE: usize = 16 << 10;

impl Digest {
    /// Adds a value in its stored form: NaN is null, and null adds nothing.
    pub(super) fn add<'v>(&mut self, value: impl Into<ValueRef<'v>>) {
        let (tag, bytes): (u8, &[u8]) = match value.into() {
            ValueRef::Null => return,
            ValueRef::Integer(whole) => (1, &whole.to_le_bytes()),
            ValueRef::Real(real) if real.is_nan() => return,
            // A column of a store drops the sign of zero.
            ValueRef::Real(0.0) => (2, &[0; 8]),
            ValueRef::Real(real) => (2, &real.to_bits().to_le_bytes()),
            ValueRef::Text(text) => (3, text),
            ValueRef::Blob(blob) => (4, blob),
        };
        self.1.push(tag);
        if tag > 2 {
            self.1
                .extend_from_slice(&(bytes.len() as u64).to_le_bytes());
        }
        self.1.extend_from_slice(bytes);
        if self.1.len() >= PIECE {
            self.0.update(&self.1);
            self.1.clear();
        }
    }

    /// Adds several values.
    #[must_use]
    pub(super) fn with<'v>(mut self, values: impl IntoIterator<Item = &'v Value>) -> Self {
        values.into_iter().for_each(|value| self.add(value));
        self
    }

    /// Adds columns of a row.
    pub(super) fn with_row(
        mut self,
        row: &Row<'_>,
        columns: Range<usize>,
    ) -> rusqlite::Result<Self> {
        for column in columns {
            self.add(row.get_ref(column)?);
        }
        Ok(self)
    }

    /// The digest.
    pub(super) fn finish(mut self) -> i64 {
        self.0.update(&self.1);
        let mut first = [0; 8];
        first.copy_from_slice(&self.0.finalize().as_bytes()[..8]);
        i64::from_le_bytes(first)
    }
}

/// The digest of some values.
pub(super) fn of(values: &[Value]) -> i64 {
    Digest::default().with(values).finish()
}

/// A table whose rows have a digest.
pub(super) struct Sealed {
    pub(super) table: &'static str,
    /// The columns that the digest covers, in their order.
    pub(super) columns: &'static str,
    /// Whether it also covers the key of the case, after these.
    pub(super) with_key: bool,
    /// Description of a row.
    pub(super) words: &'static str,
}

impl Sealed {
    /// Selects from rows `t`, and from their cases `c` where there is a key, the columns covered by
    /// the digest, the digest, and the row number.
    pub(super) fn select(&self) -> String {
        let (key, cases) = if self.with_key {
            (", c.key", " JOIN cases c ON c.id = t.case_id")
        } else {
            ("", "")
        };
        let columns = self.columns.replace(", ", ", t.");
        let table = self.table;
        format!("SELECT t.{columns}{key}, t.digest, t.rowid FROM {table} t{cases}")
    }

    /// Reads the rows that meet a condition, from the columns that the digest covers.
    ///
    /// # Errors
    /// [`DigestMismatch`] if one was changed, and those of the query.
    pub(super) fn all<T>(
        &self,
        connection: &Connection,
        condition: &str,
        parameters: impl Params,
        mut read: impl FnMut(&Row<'_>) -> rusqlite::Result<T>,
    ) -> rusqlite::Result<Vec<T>> {
        let query = format!("{} WHERE {condition}", self.select());
        let mut all = Vec::new();
        each(connection, &query, parameters, |row, is_whole, _| {
            DigestMismatch::unless(is_whole, self.words)?;
            all.push(read(row)?);
            Ok(())
        })?;
        Ok(all)
    }

    /// Checks the digests of the rows that meet a condition.
    pub(super) fn check(
        &self,
        connection: &Connection,
        condition: &str,
        parameters: impl Params,
    ) -> rusqlite::Result<()> {
        self.all(connection, condition, parameters, |_| Ok(()))?;
        Ok(())
    }

    /// Inserts or replaces a row, with the key of its case, and `more` columns that the digest does
    /// not cover.
    pub(super) fn put(
        &self,
        connection: &Connection,
        key: Option<&str>,
        values: &[Value],
        more: &[(&str, Value)],
    ) -> rusqlite::Result<()> {
        let key = key.map(|key| Value::Text(key.to_owned()));
        let digest = Value::Integer(Digest::default().with(values).with(&key).finish());
        let names = more.iter().map(|(name, _)| *name);
        let names: Vec<&str> = [self.columns, "digest"].into_iter().chain(names).collect();
        let (table, names) = (self.table, names.join(", "));
        let places = vec!["?"; values.len() + 1 + more.len()].join(", ");
        let more = more.iter().map(|(_, value)| value);
        connection.run(
            &format!("INSERT OR REPLACE INTO {table} ({names}) VALUES ({places})"),
            params_from_iter(values.iter().chain([&digest]).chain(more)),
        )
    }

    /// Updates the digests of the rows that meet a condition.
    pub(super) fn seal(
        &self,
        connection: &Connection,
        condition: &str,
        parameters: impl Params,
    ) -> rusqlite::Result<()> {
        let query = format!("{} WHERE {condition}", self.select());
        reseal(connection, self.table, &query, parameters)
    }
}

/// Calls `each` with rows, a flag whether the columns before `digest` match it, and their present
/// digest.
pub(super) fn each(
    connection: &Connection,
    query: &str,
    parameters: impl Params,
    mut each: impl FnMut(&Row<'_>, bool, i64) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    let mut query = connection.prepare_cached(query)?;
    let place = query.column_index("digest")?;
    let mut rows = query.query(parameters)?;
    while let Some(row) = rows.next()? {
        let digest = Digest::default().with_row(row, 0..place)?.finish();
        each(row, row.get(place) == Ok(digest), digest)?;
    }
    Ok(())
}

/// Rows with a wrong digest, by their numbers in the last column, each with the right digest.
pub(super) fn altered(
    connection: &Connection,
    query: &str,
    parameters: impl Params,
) -> rusqlite::Result<Vec<(i64, i64)>> {
    let mut altered = Vec::new();
    each(connection, query, parameters, |row, is_whole, digest| {
        if !is_whole {
            altered.push((row.get(row.as_ref().column_count() - 1)?, digest));
        }
        Ok(())
    })?;
    Ok(altered)
}

/// Updates the digests of rows of a table.
pub(super) fn reseal(
    connection: &Connection,
    table: &str,
    query: &str,
    parameters: impl Params,
) -> rusqlite::Result<()> {
    let rewrite = format!("UPDATE {table} SET digest = ?2 WHERE rowid = ?1");
    let altered = altered(connection, query, parameters)?;
    altered
        .into_iter()
        .try_for_each(|row| connection.run(&rewrite, row))
}

/// Contents that differ from what was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct DigestMismatch(String);

impl DigestMismatch {
    /// An error with the description of a row, unless it matches its digest.
    pub(super) fn unless(is_whole: bool, row: &str) -> rusqlite::Result<()> {
        if is_whole {
            return Ok(());
        }
        Err(Self::error(format!("checksum mismatch in {row}")))
    }

    /// As an error of a query.
    pub(super) fn error(what: impl Into<String>) -> rusqlite::Error {
        rusqlite::Error::FromSqlConversionFailure(0, Type::Null, Box::new(Self(what.into())))
    }

    /// The message of an error of a query.
    pub(super) fn words(error: &rusqlite::Error) -> String {
        Self::in_error(error).map_or_else(|| error.to_string(), Self::to_string)
    }

    /// The description in an error of a query, if it is a mismatch.
    pub(super) fn in_error(error: &rusqlite::Error) -> Option<&Self> {
        match error {
            rusqlite::Error::FromSqlConversionFailure(_, _, inner) => inner.downcast_ref(),
            _ => None,
        }
    }
}

impl fmt::Display for DigestMismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for DigestMismatch {}

/// A count in its stored form.
pub(super) fn whole(count: u64) -> Value {
    Value::Integer(i64::try_from(count).unwrap_or(i64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_value_a_missing_one_and_one_of_another_type_change_the_digest() {
        let row = [Value::Integer(1), Value::Real(2.5), Value::Null];
        let good = of(&row);
        assert_eq!(good, of(&row[..2]), "an empty column changes nothing");
        for other in [
            &row[..1],
            &[
                Value::Integer(1),
                Value::Real(2.5000000000000004),
                Value::Null,
            ],
            &[Value::Integer(1), Value::Text("2.5".into()), Value::Null],
            &[Value::Real(1.0), Value::Real(2.5), Value::Null],
            &[Value::Real(2.5), Value::Integer(1), Value::Null],
        ] {
            assert_ne!(good, of(other), "{other:?}");
        }
        assert_eq!(of(&[Value::Real(f64::NAN)]), of(&[Value::Null]));
        let words = |a: &str, b: &str| of(&[Value::Text(a.into()), Value::Text(b.into())]);
        assert_ne!(words("ab", "c"), words("a", "bc"));
    }
}
