//! Samples of runs.

use super::digest::{Digest, DigestMismatch, whole};
use super::results::{read, stored};
use super::statements::Statements;
use crate::measure::numbers::{self, Level, Number};
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params, params_from_iter};
use sd_core::Sample;
use std::collections::HashMap;
use std::sync::LazyLock;

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
    format!("INSERT INTO samples (case_id, step, {names}) VALUES ({places})")
});

/// Replaces the samples of a case, and stores their digest with the case.
pub(super) fn write(
    connection: &Connection,
    case: i64,
    samples: &[(u64, Sample)],
) -> rusqlite::Result<()> {
    connection.run("DELETE FROM samples WHERE case_id = ?1", [case])?;
    let mut insert = connection.prepare_cached(&INSERT)?;
    let mut digest = Digest::default();
    let case_id = Value::Integer(case);
    for (step, sample) in samples {
        let values = values(*step, sample);
        digest = digest.with(&values);
        insert.execute(params_from_iter(std::iter::once(&case_id).chain(&values)))?;
    }
    let digest = (!samples.is_empty()).then(|| digest.finish());
    connection.run(
        "UPDATE cases SET samples_digest = ?2 WHERE id = ?1",
        params![case, digest],
    )
}

/// The samples of a case, with their steps. Null becomes NaN.
///
/// # Errors
/// Those of the query, and [`DigestMismatch`] if they were changed.
pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Vec<(u64, Sample)>> {
    let written = "SELECT samples_digest FROM cases WHERE id = ?1";
    let written: Option<i64> = connection.value(written, [case])?.flatten();
    let mut query = connection.prepare_cached(&SELECT)?;
    let columns = query.column_count();
    let (mut digest, mut samples) = (Digest::default(), Vec::new());
    let mut rows = query.query([case])?;
    while let Some(row) = rows.next()? {
        digest = digest.with_row(row, 0..columns)?;
        samples.push(sample(row)?);
    }
    if (!samples.is_empty()).then(|| digest.finish()) == written {
        Ok(samples)
    } else {
        Err(DigestMismatch::error(
            "the samples of a run are not what was written",
        ))
    }
}

/// The digests of the present samples of all cases.
pub(super) fn digests(connection: &Connection) -> rusqlite::Result<HashMap<i64, i64>> {
    let names = names();
    let mut query = connection.prepare(&format!(
        "SELECT step, {names}, case_id FROM samples ORDER BY case_id, step"
    ))?;
    let case = query.column_count() - 1;
    let mut rows = query.query([])?;
    let mut digests = HashMap::new();
    let mut current: Option<(i64, Digest)> = None;
    while let Some(row) = rows.next()? {
        let id = row.get(case)?;
        if current.as_ref().is_some_and(|(known, _)| *known != id) {
            digests.extend(current.take().map(|(id, digest)| (id, digest.finish())));
        }
        let (_, digest) = current.unwrap_or((id, Digest::default()));
        current = Some((id, digest.with_row(row, 0..case)?));
    }
    digests.extend(current.map(|(id, digest)| (id, digest.finish())));
    Ok(digests)
}

/// First difference between two samples in any bit, if any.
pub(super) fn difference(one: &(u64, Sample), two: &(u64, Sample)) -> Option<String> {
    let names = names();
    let names = std::iter::once("step").chain(names.split(", "));
    let values = values(one.0, &one.1).into_iter().zip(values(two.0, &two.1));
    names.zip(values).find_map(|(name, (one, two))| {
        let same = match (&one, &two) {
            (Value::Real(one), Value::Real(two)) => one.to_bits() == two.to_bits(),
            (one, two) => one == two,
        };
        // One of them may have been computed without observing the network.
        let unseen = Number::named(name).is_some_and(Number::is_of_network)
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

/// Deletes the samples of a case from a step on.
pub(super) fn cut(connection: &Connection, case: i64, from: u64) -> rusqlite::Result<()> {
    let mut samples = of(connection, case)?;
    samples.retain(|(step, _)| *step < from);
    write(connection, case, &samples)
}
