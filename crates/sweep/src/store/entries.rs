//! Entries of another store, read one by one and checked as far as they can be: what salvage and merge trust.

use super::results::samples;
use super::{Checkpoint, count, integer};
use crate::case::Case;
use crate::statistics::Averages;
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, Transaction, params_from_iter};

/// One row: names of columns and values.
pub(super) type Entry = Vec<(String, Value)>;

/// A row by its number.
pub(super) fn entry(
    old: &Connection,
    table: &str,
    column: &str,
    id: i64,
) -> Result<Option<Entry>, rusqlite::Error> {
    let mut query = old.prepare_cached(&format!(
        "SELECT * FROM {table} WHERE {column} = ?1 LIMIT 1"
    ))?;
    let names: Vec<String> = query.column_names().map(String::from).collect();
    query
        .query_row([id], |row| {
            names
                .iter()
                .enumerate()
                .map(|(column, name)| Ok((name.clone(), row.get(column)?)))
                .collect()
        })
        .optional()
}

/// Writes a row.
pub(super) fn put(
    transaction: &Transaction<'_>,
    table: &str,
    entry: &Entry,
) -> Result<(), rusqlite::Error> {
    let names: Vec<&str> = entry.iter().map(|(name, _)| name.as_str()).collect();
    let places = vec!["?"; names.len()].join(", ");
    transaction
        .prepare_cached(&format!(
            "INSERT OR REPLACE INTO {table} ({}) VALUES ({places})",
            names.join(", ")
        ))?
        .execute(params_from_iter(entry.iter().map(|(_, value)| value)))?;
    Ok(())
}

/// A value of a row.
pub(super) fn get<'e>(entry: &'e Entry, name: &str) -> Option<&'e Value> {
    entry
        .iter()
        .find(|(known, _)| known == name)
        .map(|(_, value)| value)
}

/// A whole number of a row.
pub(super) fn whole(entry: &Entry, name: &str) -> Option<i64> {
    match get(entry, name)? {
        Value::Integer(whole) => Some(*whole),
        _ => None,
    }
}

/// A text of a row.
pub(super) fn text<'e>(entry: &'e Entry, name: &str) -> Option<&'e str> {
    match get(entry, name)? {
        Value::Text(text) => Some(text),
        _ => None,
    }
}

/// Replaces a value of a row.
pub(super) fn set(entry: &mut Entry, name: &str, value: impl Into<Value>) {
    if let Some((_, place)) = entry.iter_mut().find(|(known, _)| known == name) {
        *place = value.into();
    }
}

/// The case of a row, if it still has its key.
pub(super) fn trusted_case(entry: &Entry) -> Option<Case> {
    let case = Case {
        params: serde_json::from_str(text(entry, "params")?).ok()?,
        seed: count(whole(entry, "seed")?),
        steps: count(whole(entry, "steps")?),
        sample_stride: count(whole(entry, "sample_stride")?).max(1),
    };
    (text(entry, "key")? == case.key().to_string()).then_some(case)
}

/// The number of a case in the new store; a case that is in no grid any more is added without a position.
pub(super) fn place(transaction: &Transaction<'_>, row: &Entry) -> Result<i64, rusqlite::Error> {
    let number = |transaction: &Transaction<'_>| {
        transaction
            .prepare_cached("SELECT id FROM cases WHERE key = ?1")?
            .query_row([text(row, "key")], |row| row.get::<_, i64>(0))
            .optional()
    };
    if let Some(id) = number(transaction)? {
        return Ok(id);
    }
    let mut row = row.clone();
    row.retain(|(name, _)| name != "id");
    set(&mut row, "position", Value::Null);
    set(&mut row, "owner", Value::Null);
    set(&mut row, "state", "pending".to_owned());
    put(transaction, "cases", &row)?;
    Ok(transaction.last_insert_rowid())
}

/// The result of a case and its samples, if they are whole and agree with each other.
pub(super) fn result(
    old: &Connection,
    id: i64,
    case: &Case,
    steps: u64,
) -> Option<(Entry, Vec<(u64, sd_core::Sample)>)> {
    let result = entry(old, "results", "case_id", id).ok()??;
    let samples = samples(old, id).ok()?;
    let in_order = samples
        .iter()
        .enumerate()
        .all(|(number, (step, _))| *step == number as u64 * case.sample_stride);
    let whole_run = samples.len() as u64 == steps.div_ceil(case.sample_stride);
    let averages = Averages::of(&samples, count(whole(&result, "discard_step")?));
    let agrees = |name: &str, value: Option<f64>| match (get(&result, name), value) {
        (Some(Value::Real(stored)), Some(value)) => stored.to_bits() == value.to_bits(),
        (Some(Value::Null), value) => value.is_none_or(f64::is_nan),
        _ => false,
    };
    let trusted = in_order
        && whole_run
        && agrees("viscosity", averages.viscosity.as_ref().map(|d| d.mean))
        && agrees(
            "viscosity_stresslet",
            averages.viscosity_stresslet.as_ref().map(|d| d.mean),
        )
        && agrees(
            "normal_stress_difference",
            averages.normal_stress_difference,
        )
        && agrees("dissipation", averages.dissipation)
        && whole(&result, "contacts") == Some(integer(averages.contacts));
    trusted.then_some((result, samples))
}

/// All failures of a case.
pub(super) fn failures(old: &Connection, id: i64) -> Result<Vec<Entry>, rusqlite::Error> {
    // Without the index, which may be what is damaged.
    let ids: Vec<i64> = old
        .prepare_cached("SELECT id FROM failures NOT INDEXED WHERE case_id = ?1")?
        .query_map([id], |row| row.get(0))?
        .collect::<Result<_, _>>()?;
    ids.into_iter()
        .filter_map(|id| entry(old, "failures", "id", id).transpose())
        .collect()
}

/// A checkpoint of a case and its steps, if its checksum agrees.
pub(super) fn checkpoint(old: &Connection, id: i64, generation: i64) -> Option<(Entry, i64)> {
    let row: i64 = old
        .prepare_cached(
            "SELECT rowid FROM checkpoints NOT INDEXED WHERE case_id = ?1 AND generation = ?2",
        )
        .ok()?
        .query_row([id, generation], |row| row.get(0))
        .ok()?;
    let row = entry(old, "checkpoints", "rowid", row).ok()??;
    let Some(Value::Blob(data)) = get(&row, "data") else {
        return None;
    };
    let steps = Checkpoint::decode(data).ok()?.snapshot.steps;
    Some((row, integer(steps)))
}
