//! Digests of the contents of a store, written with every row that is averaged or shown later, and
//! checked by readers.
//!
//! `SQLite` detects a misplaced page, but not a changed digit.

use super::statements::Statements;
use rusqlite::types::{Type, Value, ValueRef};
use rusqlite::{Connection, Params, Row, Statement, params_from_iter};
use std::fmt;

/// A digest being computed, of values with the names of their columns. A value that is not there
/// adds nothing: so a column that an older store lacks changes no digest.
#[derive(Default)]
pub(super) struct Digest(blake3::Hasher, Vec<u8>);

/// Number of bytes hashed together: many small pieces cost more than one.
const PIECE: usize = 16 << 10;

impl Digest {
    /// Adds a value in its stored form: NaN is null.
    pub(super) fn add<'v>(&mut self, name: &str, value: impl Into<ValueRef<'v>>) {
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
        // No name has such a tag in it, so that every sequence of these is told from others.
        self.1.extend_from_slice(name.as_bytes());
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

    /// Adds values with the names of their columns.
    #[must_use]
    pub(super) fn with<'v>(
        mut self,
        values: impl IntoIterator<Item = (&'v str, &'v Value)>,
    ) -> Self {
        for (name, value) in values {
            self.add(name, value);
        }
        self
    }

    /// Adds the first columns of a row, as many as there are names.
    pub(super) fn with_row(mut self, row: &Row<'_>, names: &[String]) -> rusqlite::Result<Self> {
        for (column, name) in names.iter().enumerate() {
            self.add(name, row.get_ref(column)?);
        }
        Ok(self)
    }

    /// A digest that continues from another one.
    pub(super) fn after(before: Option<i64>) -> Self {
        Self::default().with([("before", &Value::from(before))])
    }

    /// The digest.
    pub(super) fn finish(mut self) -> i64 {
        self.0.update(&self.1);
        let mut first = [0; 8];
        first.copy_from_slice(&self.0.finalize().as_bytes()[..8]);
        i64::from_le_bytes(first)
    }
}

/// The first columns of a statement, until the one of a name.
pub(super) fn names_before(query: &Statement<'_>, name: &str) -> rusqlite::Result<Vec<String>> {
    let names = query.column_names().map(str::to_owned);
    Ok(names.take(query.column_index(name)?).collect())
}

/// A table whose rows have a digest each.
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
    /// Calls `each` with the rows `t`, with their cases `c` where there is a key, that meet a
    /// condition: with their number, their columns, and the digest that they should have, unless it
    /// is the one they have.
    pub(super) fn each(
        &self,
        connection: &Connection,
        condition: &str,
        parameters: impl Params,
        mut each: impl FnMut(i64, &Row<'_>, Option<i64>) -> rusqlite::Result<()>,
    ) -> rusqlite::Result<()> {
        let (key, cases) = if self.with_key {
            (", c.key AS key", " JOIN cases c ON c.id = t.case_id")
        } else {
            ("", "")
        };
        let columns = self.columns.replace(", ", ", t.");
        let mut query = connection.prepare_cached(&format!(
            "SELECT t.{columns}{key}, t.digest AS digest, t.rowid FROM {} t{cases} WHERE {condition}",
            self.table
        ))?;
        let names = names_before(&query, "digest")?;
        let mut rows = query.query(parameters)?;
        while let Some(row) = rows.next()? {
            let digest = Digest::default().with_row(row, &names)?.finish();
            let is_whole = row.get(names.len()) == Ok(digest);
            each(
                row.get(names.len() + 1)?,
                row,
                (!is_whole).then_some(digest),
            )?;
        }
        Ok(())
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
        let mut all = Vec::new();
        self.each(connection, condition, parameters, |_, row, altered| {
            DigestMismatch::unless(altered.is_none(), self.words)?;
            all.push(read(row)?);
            Ok(())
        })?;
        Ok(all)
    }

    /// Checks the digests of all rows.
    pub(super) fn check(&self, connection: &Connection) -> rusqlite::Result<()> {
        self.all(connection, "true", [], |_| Ok(())).map(drop)
    }

    /// The digest of a row without a key.
    pub(super) fn digest_of(&self, values: &[Value]) -> i64 {
        let columns = self.columns.split(", ");
        Digest::default().with(columns.zip(values)).finish()
    }

    /// Inserts or replaces a row, with the key of its case, and `more` columns that the digest does
    /// not cover. Returns its number.
    pub(super) fn put(
        &self,
        connection: &Connection,
        key: Option<&str>,
        values: &[Value],
        more: &[(&str, Value)],
    ) -> rusqlite::Result<i64> {
        let key = key.map(|key| Value::Text(key.to_owned()));
        let columns = self.columns.split(", ").zip(values);
        let digest = Digest::default().with(columns.chain(key.iter().map(|key| ("key", key))));
        let digest = Value::Integer(digest.finish());
        let names = more.iter().map(|(name, _)| *name);
        let names: Vec<&str> = [self.columns, "digest"].into_iter().chain(names).collect();
        let (table, names) = (self.table, names.join(", "));
        let places = vec!["?"; values.len() + 1 + more.len()].join(", ");
        let more = more.iter().map(|(_, value)| value);
        connection.run(
            &format!("INSERT OR REPLACE INTO {table} ({names}) VALUES ({places})"),
            params_from_iter(values.iter().chain([&digest]).chain(more)),
        )?;
        Ok(connection.last_insert_rowid())
    }

    /// Updates the digests of the rows that meet a condition.
    pub(super) fn seal(
        &self,
        connection: &Connection,
        condition: &str,
        parameters: impl Params,
    ) -> rusqlite::Result<()> {
        let mut altered = Vec::new();
        self.each(connection, condition, parameters, |number, _, digest| {
            altered.extend(digest.map(|digest| (number, digest)));
            Ok(())
        })?;
        let rewrite = format!("UPDATE {} SET digest = ?2 WHERE rowid = ?1", self.table);
        let mut altered = altered.into_iter();
        altered.try_for_each(|row| connection.run(&rewrite, row))
    }
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

    /// The digest of values with these names.
    fn of(values: &[(&str, Value)]) -> i64 {
        let values = values.iter().map(|(name, value)| (*name, value));
        Digest::default().with(values).finish()
    }

    #[test]
    fn a_changed_value_a_missing_one_and_one_of_another_type_or_column_change_the_digest() {
        let good = of(&[("a", Value::Integer(1)), ("b", Value::Real(2.5))]);
        let more = [
            ("a", Value::Integer(1)),
            ("x", Value::Null),
            ("b", Value::Real(2.5)),
        ];
        assert_eq!(good, of(&more), "an empty column changes nothing");
        for other in [
            &[("a", Value::Integer(1))][..],
            &[
                ("a", Value::Integer(1)),
                ("b", Value::Real(2.5000000000000004)),
            ],
            &[("a", Value::Integer(1)), ("b", Value::Text("2.5".into()))],
            &[("a", Value::Integer(1)), ("c", Value::Real(2.5))],
            &[("a", Value::Real(1.0)), ("b", Value::Real(2.5))],
            &[("b", Value::Real(2.5)), ("a", Value::Integer(1))],
        ] {
            assert_ne!(good, of(other), "{other:?}");
        }
        assert_eq!(of(&[("a", Value::Real(f64::NAN))]), of(&[]));
        let words =
            |a: &str, b: &str| of(&[("a", Value::Text(a.into())), ("b", Value::Text(b.into()))]);
        assert_ne!(words("ab", "c"), words("a", "bc"));
    }
}
