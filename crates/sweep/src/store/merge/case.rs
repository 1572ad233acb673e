//! Merging one case: what outranks what.

use super::difference::difference;
use super::{MergeMode, Merged};
use crate::store::count;
use crate::store::entries::{
    Entry, checkpoint, entry, failures, place, put, result, set, text, trusted_case, whole,
};
use crate::store::process::now;
use crate::store::results::write_samples;
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, Transaction, params};
use std::collections::HashMap;

/// A merge of one shard under way.
pub(super) struct Merging<'m> {
    /// The shard.
    pub(super) old: &'m Connection,
    /// Writes to the store.
    pub(super) transaction: &'m Transaction<'m>,
    /// How.
    pub(super) manner: MergeMode,
    /// Numbers of processes in the shard and in the store.
    pub(super) processes: HashMap<i64, i64>,
    /// What was done.
    pub(super) merged: &'m mut Merged,
}

/// A case as the store has it.
struct Known {
    /// Its row.
    id: i64,
    /// Its state.
    state: String,
    /// Steps done.
    steps: i64,
}

impl Merging<'_> {
    /// Takes over what there is of a case.
    pub(super) fn case(&mut self, id: i64, row: &Entry) -> Result<(), rusqlite::Error> {
        let (Some(case), Some(state), Some(steps)) = (
            trusted_case(row),
            text(row, "state"),
            whole(row, "steps_done"),
        ) else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        let Some(known) = self.known(row, state != "pending" || steps > 0)? else {
            return Ok(());
        };
        match state {
            "done" | "jammed" => match result(self.old, id, &case, count(steps)) {
                None => self.merged.unreadable += 1,
                Some(found) if matches!(known.state.as_str(), "done" | "jammed") => {
                    self.compare(&known, id, state, steps, found)?;
                }
                Some(found) => {
                    self.take_result(&known, id, state, steps, found)?;
                    self.merged.results += 1;
                }
            },
            "failed" if matches!(known.state.as_str(), "pending" | "failed") => {
                self.take_failures(&known, id, steps)?;
            }
            // A case this store's own processes work on is left to them.
            "pending" | "running" if known.state == "pending" && steps > known.steps => {
                self.take_checkpoints(&known, id)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// The case as the store has it; a case of no grid is added if there is anything `worth` it.
    fn known(&self, row: &Entry, worth: bool) -> Result<Option<Known>, rusqlite::Error> {
        let look = || {
            self.transaction
                .prepare_cached("SELECT id, state, steps_done FROM cases WHERE key = ?1")?
                .query_row([text(row, "key")], |row| {
                    Ok(Known {
                        id: row.get(0)?,
                        state: row.get(1)?,
                        steps: row.get(2)?,
                    })
                })
                .optional()
        };
        let known = look()?;
        if known.is_some() || self.manner != MergeMode::Campaign || !worth {
            return Ok(known);
        }
        let mut row = row.clone();
        set(&mut row, "steps_done", 0_i64);
        place(self.transaction, &row)?;
        look()
    }

    /// Takes over a result.
    fn take_result(
        &mut self,
        known: &Known,
        id: i64,
        state: &str,
        steps: i64,
        (mut result, samples): (Entry, Vec<(u64, sd_core::Sample)>),
    ) -> Result<(), rusqlite::Error> {
        self.take_process(&mut result)?;
        set(&mut result, "case_id", known.id);
        put(self.transaction, "results", &result)?;
        write_samples(self.transaction, known.id, &samples)?;
        self.take_frames(known, id)?;
        crate::store::claims::drop_checkpoints(self.transaction, known.id)?;
        self.transaction
            .prepare_cached(
                "UPDATE cases SET state = ?2, owner = NULL, steps_done = ?3, changed_at = ?4 WHERE id = ?1",
            )?
            .execute(params![known.id, state, steps, now()])?;
        Ok(())
    }

    /// Compares the result of a case with the one that is there, and keeps the later attempt if they differ.
    fn compare(
        &mut self,
        known: &Known,
        id: i64,
        state: &str,
        steps: i64,
        found: (Entry, Vec<(u64, sd_core::Sample)>),
    ) -> Result<(), rusqlite::Error> {
        let difference = if state != known.state || steps != known.steps {
            Some(format!(
                "{state} after {steps} steps, and {} after {}",
                known.state, known.steps
            ))
        } else {
            difference(self.old, id, self.transaction, known.id)?
        };
        let Some(what) = difference else {
            self.take_frames(known, id)?;
            self.merged.duplicates += 1;
            return Ok(());
        };
        let theirs = self.take_process(&mut found.0.clone())?;
        let ours: i64 = self
            .transaction
            .prepare_cached("SELECT process FROM results WHERE case_id = ?1")?
            .query_row([known.id], |row| row.get(0))?;
        if theirs == ours {
            // Met before, and kept as the later attempt.
            return Ok(());
        }
        let later = self.attempt(theirs)? > self.attempt(ours)?;
        let (kept, other) = if later {
            (theirs, ours)
        } else {
            (ours, theirs)
        };
        if later {
            self.take_result(known, id, state, steps, found)?;
        }
        self.transaction.execute(
            "INSERT OR IGNORE INTO disagreements (case_id, kept, other, what, found_at) VALUES (?1, ?2, ?3, ?4, ?5)",
            params![known.id, kept, other, what, now()],
        )?;
        Ok(())
    }

    /// Puts processes in the order of their attempts: those of the store itself come last, and so win.
    fn attempt(&self, process: i64) -> Result<(i64, i64, i64, String, i64), rusqlite::Error> {
        self.transaction
            .prepare_cached(
                "SELECT job, restart, started_at, host, pid FROM processes WHERE id = ?1",
            )?
            .query_row([process], |row| {
                let job: Option<String> = row.get(0)?;
                let restart: Option<i64> = row.get(1)?;
                let number = |job: String| {
                    let digits = job.split(|c: char| !c.is_ascii_digit()).next();
                    digits.and_then(|digits| digits.parse().ok()).unwrap_or(0)
                };
                Ok((
                    job.map_or(i64::MAX, number),
                    restart.unwrap_or(0),
                    row.get(2)?,
                    row.get(3)?,
                    row.get(4)?,
                ))
            })
    }

    /// Takes over failures the store does not have.
    fn take_failures(&mut self, known: &Known, id: i64, steps: i64) -> Result<(), rusqlite::Error> {
        let Ok(found) = failures(self.old, id) else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        let mut taken = false;
        for mut failure in found {
            self.take_process(&mut failure)?;
            failure.retain(|(name, _)| name != "id");
            set(&mut failure, "case_id", known.id);
            let there = self
                .transaction
                .prepare_cached(
                    "SELECT 1 FROM failures WHERE case_id = ?1 AND process = ?2 AND failed_at = ?3",
                )?
                .exists(params![
                    known.id,
                    whole(&failure, "process"),
                    whole(&failure, "failed_at")
                ])?;
            if !there {
                put(self.transaction, "failures", &failure)?;
                taken = true;
            }
        }
        if taken {
            self.merged.failures += 1;
            if known.state == "pending" {
                crate::store::claims::drop_checkpoints(self.transaction, known.id)?;
                self.transaction.execute(
                    "UPDATE cases SET state = 'failed', steps_done = ?2, changed_at = ?3 WHERE id = ?1",
                    params![known.id, steps, now()],
                )?;
            }
        }
        Ok(())
    }

    /// Takes over the checkpoints of a run under way in place of those there, which are older.
    fn take_checkpoints(&mut self, known: &Known, id: i64) -> Result<(), rusqlite::Error> {
        let whole: Vec<(Entry, i64)> = [0, 1]
            .into_iter()
            .filter_map(|generation| checkpoint(self.old, id, generation))
            .collect();
        let Some(steps) = whole.iter().map(|(_, steps)| *steps).max() else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        if steps <= known.steps {
            return Ok(());
        }
        crate::store::claims::drop_checkpoints(self.transaction, known.id)?;
        for (mut checkpoint, _) in whole {
            self.take_process(&mut checkpoint)?;
            set(&mut checkpoint, "case_id", known.id);
            put(self.transaction, "checkpoints", &checkpoint)?;
        }
        self.take_frames(known, id)?;
        self.transaction.execute(
            "UPDATE cases SET steps_done = ?2, deaths = 0, changed_at = ?3 WHERE id = ?1",
            params![known.id, steps, now()],
        )?;
        self.merged.checkpoints += 1;
        Ok(())
    }

    /// Takes over frames the store does not have. Frames of one step are the same, whoever computed them.
    fn take_frames(&self, known: &Known, id: i64) -> Result<(), rusqlite::Error> {
        let read = "SELECT step, strain, data FROM frames WHERE case_id = ?1";
        let Ok(mut read) = self.old.prepare_cached(read) else {
            // A store of the first schema has none.
            return Ok(());
        };
        let mut rows = read.query([id])?;
        while let Some(row) = rows.next()? {
            let (step, strain, data): (i64, f64, Vec<u8>) = (row.get(0)?, row.get(1)?, row.get(2)?);
            self.transaction
                .prepare_cached("INSERT OR IGNORE INTO frames VALUES (?1, ?2, ?3, ?4)")?
                .execute(params![known.id, step, strain, data])?;
        }
        Ok(())
    }

    /// Takes over the process an entry names, and lets the entry name it by its number here.
    fn take_process(&mut self, named: &mut Entry) -> Result<i64, rusqlite::Error> {
        let there = whole(named, "process").unwrap_or(0);
        if let Some(here) = self.processes.get(&there) {
            set(named, "process", *here);
            return Ok(*here);
        }
        let mut process = entry(self.old, "processes", "id", there)?
            .ok_or(rusqlite::Error::QueryReturnedNoRows)?;
        process.retain(|(name, _)| name != "id");
        let value = |name: &str| {
            let found = process.iter().find(|(known, _)| known == name);
            found.map_or(Value::Null, |(_, value)| value.clone())
        };
        let known: Option<i64> = self
            .transaction
            .prepare_cached(
                "SELECT id FROM processes WHERE host = ?1 AND boot = ?2 AND namespace = ?3 AND pid = ?4 AND start = ?5
                     AND started_at = ?6",
            )?
            .query_row(
                params![
                    value("host"),
                    value("boot"),
                    value("namespace"),
                    value("pid"),
                    value("start"),
                    value("started_at")
                ],
                |row| row.get(0),
            )
            .optional()?;
        let here = if let Some(here) = known {
            here
        } else {
            put(self.transaction, "processes", &process)?;
            self.transaction.last_insert_rowid()
        };
        self.processes.insert(there, here);
        set(named, "process", here);
        Ok(here)
    }
}
