//! Saving what a damaged store holds: entry by entry into a new store, each checked as far as it can be.

use super::results::{samples, write_samples};
use super::{Checkpoint, Store, StoreError, count, integer};
use crate::campaign::Campaign;
use crate::case::Case;
use crate::statistics::Averages;
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, Transaction, params, params_from_iter};
use serde::Serialize;
use std::path::Path;

/// What was saved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Salvaged {
    /// Results that are whole.
    pub results: u64,
    /// Samples of them.
    pub samples: u64,
    /// Cases that failed.
    pub failures: u64,
    /// Runs under way with a whole checkpoint.
    pub checkpoints: u64,
    /// Entries that could not be read, or not be trusted.
    pub unreadable: u64,
    /// Cases to be computed.
    pub pending: u64,
}

/// One row: names of columns and values.
type Entry = Vec<(String, Value)>;

/// Saves into the new file `to` all that can be read of the store `from`, which is only read.
///
/// A result is taken over if its case still has its key, all its samples are there, and their averages are the stored ones
/// to the last bit. Everything else of the grid is pending in the new store.
///
/// # Errors
/// [`StoreError::Hopeless`] if not even the list of tables or no campaign can be read, [`StoreError::Exists`], and trouble
/// with the new file.
pub fn salvage(
    from: &Path,
    to: &Path,
    campaign: Option<&Campaign>,
) -> Result<Salvaged, StoreError> {
    if to.exists() {
        return Err(StoreError::Exists {
            path: to.to_owned(),
        });
    }
    let old = Store::open_damaged(from).map_err(|error| match error {
        StoreError::Trouble { what, .. } => StoreError::Hopeless {
            path: from.to_owned(),
            reason: what,
            advice: "restore it from a copy, or run the campaign into another --store",
        },
        other => other,
    })?;
    let campaign = match campaign {
        Some(campaign) => campaign.clone(),
        None => campaign_of(&old)?,
    };
    // The new file has its name only once it is whole.
    let draft = to.with_extension(format!("part-{}", std::process::id()));
    let saved = save(&old.connection, &draft, &campaign);
    match saved {
        Ok(saved) => std::fs::rename(&draft, to)
            .map(|()| saved)
            .map_err(|source| StoreError::Unwritable {
                path: to.to_owned(),
                source,
            }),
        Err(error) => {
            let _ = std::fs::remove_file(&draft);
            Err(error)
        }
    }
}

/// The campaign a store was last run with.
fn campaign_of(old: &Store) -> Result<Campaign, StoreError> {
    let hopeless = |reason: String| StoreError::Hopeless {
        path: old.path.clone(),
        reason,
        advice: "give the campaign file with --campaign FILE",
    };
    let text: String = old
        .connection
        .query_row("SELECT text FROM campaign", [], |row| row.get(0))
        .map_err(|error| hopeless(format!("its campaign cannot be read: {error}")))?;
    Campaign::parse("campaign.toml", text)
        .map_err(|error| hopeless(format!("its campaign cannot be understood: {error}")))
}

/// Saves into a new store.
fn save(old: &Connection, to: &Path, campaign: &Campaign) -> Result<Salvaged, StoreError> {
    let mut new = Store::open(to)?;
    new.adopt(campaign)?;
    let mut saved = Salvaged::default();
    new.write(|transaction| {
        for id in ids(old, "cases", campaign.cases.len()) {
            match entry(old, "cases", "id", id) {
                Ok(Some(case)) => save_case(old, transaction, id, &case, &mut saved)?,
                Ok(None) => {}
                Err(_) => saved.unreadable += 1,
            }
        }
        Ok(())
    })?;
    saved.pending = new.counts()?.pending;
    Ok(saved)
}

/// Numbers that rows of a table may have.
fn ids(old: &Connection, table: &str, at_least: usize) -> std::ops::RangeInclusive<i64> {
    let largest = old
        .query_row(&format!("SELECT max(id) FROM {table}"), [], |row| {
            row.get::<_, Option<i64>>(0)
        })
        .ok()
        .flatten()
        // Not even the end of the table can be read: rows are numbered from 1.
        .unwrap_or_else(|| integer(at_least as u64));
    1..=largest.min(4 * integer(crate::campaign::CASE_LIMIT))
}

/// A row by its number.
fn entry(
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
fn put(transaction: &Transaction<'_>, table: &str, entry: &Entry) -> Result<(), rusqlite::Error> {
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
fn get<'e>(entry: &'e Entry, name: &str) -> Option<&'e Value> {
    entry
        .iter()
        .find(|(known, _)| known == name)
        .map(|(_, value)| value)
}

/// A whole number of a row.
fn whole(entry: &Entry, name: &str) -> Option<i64> {
    match get(entry, name)? {
        Value::Integer(whole) => Some(*whole),
        _ => None,
    }
}

/// A text of a row.
fn text<'e>(entry: &'e Entry, name: &str) -> Option<&'e str> {
    match get(entry, name)? {
        Value::Text(text) => Some(text),
        _ => None,
    }
}

/// Replaces a value of a row.
fn set(entry: &mut Entry, name: &str, value: impl Into<Value>) {
    if let Some((_, place)) = entry.iter_mut().find(|(known, _)| known == name) {
        *place = value.into();
    }
}

/// The case of a row, if it still has its key.
fn trusted_case(entry: &Entry) -> Option<Case> {
    let case = Case {
        params: serde_json::from_str(text(entry, "params")?).ok()?,
        seed: count(whole(entry, "seed")?),
        steps: count(whole(entry, "steps")?),
        sample_stride: count(whole(entry, "sample_stride")?).max(1),
    };
    (text(entry, "key")? == case.key().to_string()).then_some(case)
}

/// Saves what there is of a case.
fn save_case(
    old: &Connection,
    transaction: &Transaction<'_>,
    id: i64,
    row: &Entry,
    saved: &mut Salvaged,
) -> Result<(), rusqlite::Error> {
    let (Some(case), Some(state), Some(steps_done)) = (
        trusted_case(row),
        text(row, "state"),
        whole(row, "steps_done"),
    ) else {
        saved.unreadable += 1;
        return Ok(());
    };
    match state {
        "done" | "jammed" => match result(old, id, &case, count(steps_done)) {
            Some((mut result, samples)) => {
                let new_id = place(transaction, row)?;
                take_process(old, transaction, &result)?;
                set(&mut result, "case_id", new_id);
                put(transaction, "results", &result)?;
                write_samples(transaction, new_id, &samples)?;
                transaction.execute(
                    "UPDATE cases SET state = ?2, steps_done = ?3 WHERE id = ?1",
                    params![new_id, state, steps_done],
                )?;
                saved.results += 1;
                saved.samples += samples.len() as u64;
            }
            None => saved.unreadable += 1,
        },
        "failed" => match failures(old, id) {
            Ok(failures) if !failures.is_empty() => {
                let new_id = place(transaction, row)?;
                for mut failure in failures {
                    take_process(old, transaction, &failure)?;
                    set(&mut failure, "case_id", new_id);
                    put(transaction, "failures", &failure)?;
                }
                transaction.execute(
                    "UPDATE cases SET state = 'failed', steps_done = ?2 WHERE id = ?1",
                    params![new_id, steps_done],
                )?;
                saved.failures += 1;
            }
            _ => saved.unreadable += 1,
        },
        _ if steps_done > 0 => {
            let mut steps = 0;
            for generation in [0, 1] {
                let Some((mut kept, found)) = checkpoint(old, id, generation) else {
                    continue;
                };
                let new_id = place(transaction, row)?;
                take_process(old, transaction, &kept)?;
                set(&mut kept, "case_id", new_id);
                put(transaction, "checkpoints", &kept)?;
                steps = found.max(steps);
                transaction.execute(
                    "UPDATE cases SET steps_done = ?2 WHERE id = ?1",
                    params![new_id, steps],
                )?;
            }
            let counter = if steps > 0 {
                &mut saved.checkpoints
            } else {
                &mut saved.unreadable
            };
            *counter += 1;
        }
        _ => {}
    }
    Ok(())
}

/// The number of a case in the new store; a case that is in no grid any more is added without a position.
fn place(transaction: &Transaction<'_>, row: &Entry) -> Result<i64, rusqlite::Error> {
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
fn result(
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
fn failures(old: &Connection, id: i64) -> Result<Vec<Entry>, rusqlite::Error> {
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
fn checkpoint(old: &Connection, id: i64, generation: i64) -> Option<(Entry, i64)> {
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

/// Takes over the process an entry names, or a stand-in if it cannot be read.
fn take_process(
    old: &Connection,
    transaction: &Transaction<'_>,
    named: &Entry,
) -> Result<(), rusqlite::Error> {
    let id = whole(named, "process").unwrap_or(0);
    let known = transaction
        .prepare_cached("SELECT 1 FROM processes WHERE id = ?1")?
        .exists([id])?;
    if known {
        return Ok(());
    }
    match entry(old, "processes", "id", id) {
        Ok(Some(process)) if put(transaction, "processes", &process).is_ok() => Ok(()),
        _ => transaction
            .execute(
                "INSERT INTO processes (id, host, boot, namespace, pid, start, started_at, heartbeat, version,
                     physics_version, build, threads)
                 VALUES (?1, 'unknown', '', '', 0, '', 0, 0, '', 0, '', 0)",
                [id],
            )
            .map(|_| ()),
    }
}
