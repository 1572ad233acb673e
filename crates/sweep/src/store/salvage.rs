//! Saving what a damaged store holds: entry by entry into a new store, each checked as far as it can be.

use super::checksum::{self, Kind};
use super::ends::{settle_all, settle_as};
use super::entries::{
    Entry, Found, checkpoint, computed_run, entry, failures, place, process, put, samples_of, set,
    take_frames, text, trusted_case, whole,
};
use super::place::{name_new, set_aside, with_suffix};
use super::samples::write_samples;
use super::{Store, StoreError, integer};
use crate::campaign::Campaign;
use rusqlite::{Connection, Transaction, params};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What was saved.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Salvaged {
    /// Results that are whole.
    pub results: u64,
    /// Samples of them.
    pub samples: u64,
    /// Frames of runs.
    pub frames: u64,
    /// Cases that failed.
    pub failures: u64,
    /// Runs under way with a whole checkpoint.
    pub checkpoints: u64,
    /// Entries that could not be read, or not be trusted.
    pub unreadable: u64,
    /// Cases to be computed.
    pub pending: u64,
    /// What is to be said of the damaged store: a log that was left out, or cannot be read to its end.
    pub warning: Option<String>,
    /// Where the damaged store is now, if the new one took its place.
    pub set_aside: Option<PathBuf>,
}

/// Saves into the new file `to` all that can be read of the store `from`, which is only read.
///
/// A result is taken over if its case still has its key, all its samples are there, its checksums agree, and its averages are
/// those of its samples to the last bit. Everything else of the grid is pending in the new store.
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
    let (saved, draft) = into_draft(from, to, campaign)?;
    // A log left behind by another store of that name would be taken for its own.
    placed(
        to,
        set_aside(to).and_then(|()| name_new(&draft, to)),
        &draft,
    )?;
    Ok(saved)
}

/// The same in the place of the damaged store, which is kept under another name with all that lies beside it.
///
/// # Errors
/// As [`salvage`].
pub fn salvage_in_place(path: &Path, campaign: Option<&Campaign>) -> Result<Salvaged, StoreError> {
    if let Ok(old) = Store::open_damaged(path)
        && let Some((pid, host)) = old.worker()
    {
        return Err(StoreError::InUse {
            path: path.to_owned(),
            pid,
            host,
        });
    }
    let (mut saved, draft) = into_draft(path, path, campaign)?;
    let aside = path.with_extension(format!("set-aside-{}.sqlite", std::process::id()));
    let moved = || -> std::io::Result<()> {
        std::fs::rename(path, &aside)?;
        let log = super::place::log_of(path);
        if log.exists() {
            std::fs::rename(log, super::place::log_of(&aside))?;
        }
        set_aside(path)?;
        name_new(&draft, path)
    };
    placed(path, moved(), &draft)?;
    saved.set_aside = Some(aside);
    Ok(saved)
}

/// Turns the error of giving the new store its name into one of the store.
fn placed(path: &Path, result: std::io::Result<()>, draft: &Path) -> Result<(), StoreError> {
    result.map_err(|source| {
        let _ = std::fs::remove_file(draft);
        if source.kind() == std::io::ErrorKind::AlreadyExists {
            return StoreError::Exists {
                path: path.to_owned(),
            };
        }
        StoreError::Unwritable {
            path: path.to_owned(),
            source,
        }
    })
}

/// Saves into a new file beside `to`, which has its name only once it is whole.
fn into_draft(
    from: &Path,
    to: &Path,
    campaign: Option<&Campaign>,
) -> Result<(Salvaged, PathBuf), StoreError> {
    let mut old = Store::open_damaged(from).map_err(|error| match error {
        StoreError::Trouble { what, .. } | StoreError::Damaged { what, .. } => {
            StoreError::Hopeless {
                path: from.to_owned(),
                reason: what,
                advice: "restore it from a copy, or run the campaign into another --store",
            }
        }
        other => other,
    })?;
    let campaign = match campaign {
        Some(campaign) => campaign.clone(),
        None => campaign_of(&old)?,
    };
    let draft = with_suffix(to, &format!(".part-{}", std::process::id()));
    for stale in ["", "-wal", "-shm"] {
        let _ = std::fs::remove_file(with_suffix(&draft, stale));
    }
    match save(&old.connection, &draft, &campaign) {
        Ok(mut saved) => {
            saved.warning = old.warning.take();
            Ok((saved, draft))
        }
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
                Ok(Some(case)) => save_case(old, transaction, id, case, &mut saved)?,
                Ok(None) => {}
                Err(_) => saved.unreadable += 1,
            }
        }
        settle_all(transaction, &campaign.protocol)?;
        super::rules::apply_all(transaction)
    })?;
    saved.pending = new.counts()?.pending;
    // Nothing of it is in a log any more when it gets its name.
    new.read(
        new.connection
            .execute_batch("PRAGMA wal_checkpoint(TRUNCATE)"),
    )?;
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

/// Saves what there is of a case.
fn save_case(
    old: &Connection,
    transaction: &Transaction<'_>,
    id: i64,
    mut row: Entry,
    saved: &mut Salvaged,
) -> Result<(), rusqlite::Error> {
    let (Some(case), Some(state), Some(steps_done)) = (
        trusted_case(&mut row),
        text(&row, "state").map(str::to_owned),
        whole(&row, "steps_done"),
    ) else {
        saved.unreadable += 1;
        return Ok(());
    };
    let row = &row;
    let found = computed_run(old, id, row, &case);
    let has_end = matches!(found, Found::Run(_));
    match found {
        Found::Run(mut run) => {
            let new_id = place(transaction, row)?;
            take_process(old, transaction, &run.result)?;
            run.write(transaction, new_id)?;
            settle_as(transaction, new_id, run.discarded())?;
            saved.results += 1;
            saved.samples += run.samples.len() as u64;
            save_frames(old, id, transaction, new_id, saved)?;
        }
        Found::Untrusted => saved.unreadable += 1,
        Found::Nothing => {}
    }
    match state.as_str() {
        "done" | "jammed" => {}
        "failed" => match failures(old, id) {
            Ok(failures) if !failures.is_empty() => {
                let new_id = place(transaction, row)?;
                for mut failure in failures {
                    take_process(old, transaction, &failure)?;
                    set(&mut failure, "case_id", new_id);
                    put(transaction, "failures", &failure)?;
                    checksum::seal(transaction, Kind::Failure, transaction.last_insert_rowid())?;
                }
                if !has_end {
                    match samples_of(old, id) {
                        Ok(samples) => write_samples(transaction, new_id, &samples)?,
                        Err(_) => saved.unreadable += 1,
                    }
                    save_frames(old, id, transaction, new_id, saved)?;
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
                    "UPDATE cases SET steps_done = max(steps_done, ?2) WHERE id = ?1",
                    params![new_id, steps],
                )?;
            }
            if steps > 0 {
                saved.checkpoints += 1;
                let new_id = place(transaction, row)?;
                save_frames(old, id, transaction, new_id, saved)?;
            } else if !has_end {
                saved.unreadable += 1;
            }
        }
        _ => {}
    }
    Ok(())
}

/// Saves the frames of a case that are whole.
fn save_frames(
    old: &Connection,
    id: i64,
    transaction: &Transaction<'_>,
    to: i64,
    saved: &mut Salvaged,
) -> Result<(), rusqlite::Error> {
    let (whole, damaged) = take_frames(old, id, transaction, to)?;
    saved.frames += whole;
    saved.unreadable += damaged;
    Ok(())
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
    let mut process = process(old, id);
    process.push(("id".to_owned(), id.into()));
    put(transaction, "processes", &process)?;
    checksum::seal(transaction, Kind::Process, id)
}
