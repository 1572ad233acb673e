//! Samples of runs.

use super::digest::{Digest, DigestMismatch, names_before, whole};
use super::statements::Statements;
use crate::data;
use crate::data::Kind;
use crate::measure::numbers;
use crate::measure::numbers::{Level, Number};
use rusqlite::types::Value;
use rusqlite::{Connection, Row, Rows, params, params_from_iter};
use sd_core::Sample;
use std::collections::HashMap;
use std::sync::LazyLock;

/// Description of the samples of a run.
pub(super) const WORDS: &str = "the samples of a run";

/// The columns of the numbers of a sample.
fn names() -> String {
    let names: Vec<&str> = numbers::kept().map(|number| number.name).collect();
    names.join(", ")
}

/// Reads the samples of a case.
static SELECT: LazyLock<String> = LazyLock::new(|| {
    let names = names();
    format!("SELECT step, {names} FROM samples WHERE case_id = ?1 ORDER BY step")
});
/// Writes one.
static INSERT: LazyLock<String> = LazyLock::new(|| {
    let names = names();
    let places = vec!["?"; 2 + names.split(", ").count()].join(", ");
    format!("INSERT OR REPLACE INTO samples (case_id, step, {names}) VALUES ({places})")
});

/// The digest of samples after one more, from the digest of those before, `None` without any. So it
/// grows with a run, and each checkpoint has that of the samples before it.
pub(crate) fn extended(before: Option<i64>, step: u64, sample: &Sample) -> i64 {
    let values = values(step, sample);
    let names = std::iter::once("step").chain(numbers::kept().map(|number| number.name));
    Digest::after(before).with(names.zip(&values)).finish()
}

/// Appends samples to those of a case; `digest` is that of all of them.
pub(super) fn append(
    connection: &Connection,
    case: i64,
    samples: &[(u64, Sample)],
    digest: Option<i64>,
) -> rusqlite::Result<()> {
    let mut insert = connection.prepare_cached(&INSERT)?;
    let case_id = Value::Integer(case);
    for (step, sample) in samples {
        let values = values(*step, sample);
        insert.execute(params_from_iter(std::iter::once(&case_id).chain(&values)))?;
    }
    set_digest(connection, case, digest)
}

/// Sets the digest of the samples of a case.
fn set_digest(connection: &Connection, case: i64, digest: Option<i64>) -> rusqlite::Result<()> {
    let set = "UPDATE cases SET samples_digest = ?2 WHERE id = ?1";
    connection.run(set, params![case, digest])
}

/// Calls `each` with the samples of a case and their steps, in order. Null becomes NaN.
///
/// # Errors
/// Those of the query and of `each`, and at the end [`DigestMismatch`] if the samples were changed.
pub(super) fn each(
    connection: &Connection,
    case: i64,
    mut each: impl FnMut(u64, Sample) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    let written = "SELECT samples_digest FROM cases WHERE id = ?1";
    let written: Option<i64> = connection.value(written, [case])?.flatten();
    let found = digested(connection, case, u64::MAX, |row| {
        let (step, sample) = sample(row)?;
        each(step, sample)
    })?;
    DigestMismatch::unless(found == written, WORDS)
}

/// The digest of the samples of a case before a step, after a call of `each` with every row.
fn digested(
    connection: &Connection,
    case: i64,
    until: u64,
    mut each: impl FnMut(&Row<'_>) -> rusqlite::Result<()>,
) -> rusqlite::Result<Option<i64>> {
    let mut query = connection.prepare_cached(&SELECT)?;
    let names: Vec<String> = query.column_names().map(str::to_owned).collect();
    let mut digest = None;
    let mut rows = query.query([case])?;
    while let Some(row) = rows.next()? {
        if row.get::<_, u64>(0)? >= until {
            break;
        }
        digest = Some(Digest::after(digest).with_row(row, &names)?.finish());
        each(row)?;
    }
    Ok(digest)
}

/// The digest of the samples of a case before a step.
pub(super) fn digest_until(
    connection: &Connection,
    case: i64,
    until: u64,
) -> rusqlite::Result<Option<i64>> {
    digested(connection, case, until, |_| Ok(()))
}

/// The samples of a case before a step, with their steps.
///
/// # Errors
/// As [`each`].
pub(super) fn of(
    connection: &Connection,
    case: i64,
    until: u64,
) -> rusqlite::Result<Vec<(u64, Sample)>> {
    let mut samples = Vec::new();
    each(connection, case, |step, sample| {
        if step < until {
            samples.push((step, sample));
        }
        Ok(())
    })?;
    Ok(samples)
}

/// Deletes the samples of a case from a step on; `digest` is that of those before.
pub(super) fn cut(
    connection: &Connection,
    case: i64,
    from: u64,
    digest: Option<i64>,
) -> rusqlite::Result<()> {
    let rest = "DELETE FROM samples WHERE case_id = ?1 AND step >= ?2";
    connection.run(rest, params![case, from])?;
    set_digest(connection, case, digest)
}

/// Replaces the samples of a case by those of another one, of any store, before a step.
pub(super) fn copy(
    (from, there): (&Connection, i64),
    (to, here): (&Connection, i64),
    until: u64,
) -> rusqlite::Result<()> {
    to.run("DELETE FROM samples WHERE case_id = ?1", [here])?;
    let mut insert = to.prepare_cached(&INSERT)?;
    let digest = digested(from, there, until, |row| {
        let columns = 0..row.as_ref().column_count();
        let values: Vec<Value> = columns.map(|n| row.get(n)).collect::<Result<_, _>>()?;
        let case = Value::Integer(here);
        insert
            .execute(params_from_iter(std::iter::once(&case).chain(&values)))
            .map(drop)
    })?;
    set_digest(to, here, digest)
}

/// The digests of the present samples of all cases.
pub(super) fn digests(connection: &Connection) -> rusqlite::Result<HashMap<i64, i64>> {
    let names = names();
    let mut query = connection.prepare(&format!(
        "SELECT step, {names}, case_id FROM samples ORDER BY case_id, step"
    ))?;
    let names = names_before(&query, "case_id")?;
    let mut rows = query.query([])?;
    let mut digests = HashMap::new();
    while let Some(row) = rows.next()? {
        let id = row.get(names.len())?;
        let digest = Digest::after(digests.get(&id).copied()).with_row(row, &names)?;
        digests.insert(id, digest.finish());
    }
    Ok(digests)
}

/// First difference in any bit between the samples of two cases before a step, if any.
pub(super) fn difference(
    (one, a): (&Connection, i64),
    (two, b): (&Connection, i64),
    until: u64,
) -> rusqlite::Result<Option<String>> {
    let (mut query_a, mut query_b) = (one.prepare_cached(&SELECT)?, two.prepare_cached(&SELECT)?);
    let (mut rows_a, mut rows_b) = (query_a.query([a])?, query_b.query([b])?);
    loop {
        let next = |rows: &mut Rows<'_>| {
            let found = rows.next()?.map(sample).transpose()?;
            Ok::<_, rusqlite::Error>(found.filter(|(step, _)| *step < until))
        };
        match (next(&mut rows_a)?, next(&mut rows_b)?) {
            (None, None) => return Ok(None),
            (Some(a), Some(b)) => {
                if let Some(what) = difference_of(&a, &b) {
                    return Ok(Some(format!("at step {}: {what}", a.0)));
                }
            }
            (Some((step, _)), None) | (None, Some((step, _))) => {
                return Ok(Some(format!("only one has a sample at step {step}")));
            }
        }
    }
}

/// First difference between two samples in any bit, if any.
fn difference_of(one: &(u64, Sample), two: &(u64, Sample)) -> Option<String> {
    let names = names();
    let names = std::iter::once("step").chain(names.split(", "));
    let values = values(one.0, &one.1).into_iter().zip(values(two.0, &two.1));
    names.zip(values).find_map(|(name, (one, two))| {
        let same = match (&one, &two) {
            (Value::Real(one), Value::Real(two)) => one.to_bits() == two.to_bits(),
            (one, two) => one == two,
        };
        // One of them may have been computed without observing it.
        let unseen = Number::named(name).is_some_and(Number::is_optional)
            && [&one, &two].iter().any(|value| is_nothing(value));
        (!same && !unseen).then(|| format!("{name} is {}, and {}", shown(&one), shown(&two)))
    })
}

fn is_nothing(value: &Value) -> bool {
    matches!(value, Value::Null) || matches!(value, Value::Real(real) if real.is_nan())
}

/// A value with all its digits.
fn shown(value: &Value) -> String {
    match value {
        Value::Real(real) => format!("{real:?}"),
        Value::Integer(whole) => whole.to_string(),
        _ => "nothing".into(),
    }
}

/// A value of a column in its stored form.
pub(super) fn stored(value: data::Value) -> Value {
    match value {
        data::Value::Number(number) => number.into(),
        data::Value::Count(count) => whole(count),
        data::Value::Word(word) => Value::Text(word.to_owned()),
    }
}

/// A number of a row; 0 for a missing count, NaN for another missing number.
fn read(row: &Row<'_>, column: usize, kind: Kind) -> rusqlite::Result<data::Value> {
    Ok(match kind {
        Kind::Count => data::Value::Count(row.get::<_, Option<u64>>(column)?.unwrap_or(0)),
        _ => data::Value::Number(row.get::<_, Option<f64>>(column)?.unwrap_or(f64::NAN)),
    })
}

/// The values of a sample, in the order of the columns.
fn values(step: u64, sample: &Sample) -> Vec<Value> {
    let numbers = numbers::kept().map(|number| stored(number.of_sample(sample)));
    std::iter::once(whole(step)).chain(numbers).collect()
}

/// A row of [`SELECT`].
fn sample(row: &Row<'_>) -> rusqlite::Result<(u64, Sample)> {
    let mut sample = Sample::default();
    for (number, column) in numbers::kept().zip(1..) {
        number.put(&mut sample, read(row, column, number.kind(Level::Samples))?);
    }
    Ok((row.get(0)?, sample))
}
