//! Merging one case: what outranks what.

use super::difference::difference;
use super::{MergeMode, Merged};
use crate::store::checksum::{self, Kind};
use crate::store::ends::settle;
use crate::store::entries::{
    ComputedRun, Entry, Found, checkpoint, computed_run, failures, place, process, put, samples_of,
    set, take_frames, text, trusted_case, whole,
};
use crate::store::process::now;
use crate::store::samples::write_samples;
use crate::store::{count, integer};
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, Transaction, params};
use std::collections::HashMap;

/// A merge of one shard under way.
pub(super) struct Merging<'m> {
    pub(super) old: &'m Connection,
    pub(super) transaction: &'m Transaction<'m>,
    pub(super) mode: MergeMode,
    /// Numbers of processes in the shard and in the store.
    pub(super) processes: HashMap<i64, i64>,
    pub(super) merged: &'m mut Merged,
}

/// A case as the store has it.
struct Known {
    id: i64,
    state: String,
    steps: i64,
    asked: u64,
    /// How far it was computed, if it was computed to an end.
    end: Option<KnownEnd>,
}

/// How far a case was computed here.
#[derive(Clone, Copy)]
struct KnownEnd {
    steps: u64,
    jammed: bool,
    /// Discarded steps of its result.
    discarded: i64,
}

impl Merging<'_> {
    /// Takes over what there is of a case.
    pub(super) fn case(&mut self, id: i64, mut row: Entry) -> Result<(), rusqlite::Error> {
        let (Some(case), Some(state), Some(steps)) = (
            trusted_case(&mut row),
            text(&row, "state").map(str::to_owned),
            whole(&row, "steps_done"),
        ) else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        let Some(known) = self.known(&row, state != "pending" || steps > 0)? else {
            return Ok(());
        };
        match computed_run(self.old, id, &row, &case) {
            Found::Nothing => {}
            Found::Untrusted => self.merged.unreadable += 1,
            Found::Run(run) => match known.end {
                Some(end) => self.compare(&known, end, id, *run)?,
                // A case this store's own processes take farther is left to them.
                None if known.state == "running" && !run.jammed && run.steps < known.asked => {}
                None => {
                    self.take_run(&known, id, *run)?;
                    self.merged.results += 1;
                }
            },
        }
        // What was taken over may have ended it.
        let Some(known) = self.known(&row, false)? else {
            return Ok(());
        };
        match state.as_str() {
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
                .prepare_cached(
                    "SELECT c.id, c.state, c.steps_done, c.steps, e.steps, e.jammed, r.discard_step FROM cases c
                     LEFT JOIN ends e ON e.case_id = c.id LEFT JOIN results r ON r.case_id = c.id WHERE c.key = ?1",
                )?
                .query_row([text(row, "key")], |row| {
                    let end: Option<i64> = row.get(4)?;
                    let end = end.map(|steps| {
                        Ok::<_, rusqlite::Error>(KnownEnd {
                            steps: count(steps),
                            jammed: row.get(5)?,
                            discarded: row.get::<_, Option<i64>>(6)?.unwrap_or(0),
                        })
                    });
                    Ok(Known {
                        id: row.get(0)?,
                        state: row.get(1)?,
                        steps: row.get(2)?,
                        asked: count(row.get(3)?),
                        end: end.transpose()?,
                    })
                })
                .optional()
        };
        let known = look()?;
        if known.is_some() || self.mode != MergeMode::Campaign || !worth {
            return Ok(known);
        }
        let mut row = row.clone();
        set(&mut row, "steps_done", 0_i64);
        place(self.transaction, &row)?;
        look()
    }

    /// Takes over a run that was computed to an end.
    fn take_run(
        &mut self,
        known: &Known,
        id: i64,
        mut run: ComputedRun,
    ) -> Result<(), rusqlite::Error> {
        self.take_process(&mut run.result)?;
        run.write(self.transaction, known.id)?;
        self.frames(known, id)?;
        if known.steps <= integer(run.steps) {
            crate::store::claims::drop_checkpoints(self.transaction, known.id)?;
        }
        // As the shard has it; what this store asks for is looked at when all shards are merged.
        self.transaction
            .prepare_cached(
                "UPDATE cases SET state = 'pending', owner = NULL, changed_at = ?2,
                     steps_done = CASE WHEN ?4 THEN max(steps_done, ?3) ELSE steps_done END WHERE id = ?1",
            )?
            .execute(params![
                known.id,
                now(),
                integer(run.steps),
                run.continues()
            ])?;
        let discard = known
            .end
            .map_or_else(|| run.discarded(), |end| count(end.discarded));
        settle(self.transaction, known.id, discard)
    }

    /// Compares a run with the one that is there. Of two that agree the longer is kept, of two that do not the later attempt.
    fn compare(
        &mut self,
        known: &Known,
        ours: KnownEnd,
        id: i64,
        run: ComputedRun,
    ) -> Result<(), rusqlite::Error> {
        let jammed_early = |one: (u64, bool), other: u64| one.1 && one.0 < other;
        let difference = if jammed_early((run.steps, run.jammed), ours.steps)
            || jammed_early((ours.steps, ours.jammed), run.steps)
            || (run.steps == ours.steps && run.jammed != ours.jammed)
        {
            let word = |jammed: bool| if jammed { "jammed" } else { "done" };
            Some(format!(
                "{} after {} steps, and {} after {}",
                word(run.jammed),
                run.steps,
                word(ours.jammed),
                ours.steps
            ))
        } else {
            checksum::check(self.transaction, Kind::Samples, known.id)?;
            difference(
                (self.old, id, run.steps),
                (self.transaction, known.id, ours.steps),
            )?
        };
        let Some(what) = difference else {
            if run.steps > ours.steps {
                self.take_run(known, id, run)?;
                self.merged.results += 1;
            } else {
                self.frames(known, id)?;
                self.merged.duplicates += 1;
            }
            return Ok(());
        };
        let theirs = self.take_process(&mut run.result.clone())?;
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
            self.take_run(known, id, run)?;
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
                let new = self.transaction.last_insert_rowid();
                checksum::seal(self.transaction, Kind::Failure, new)?;
                taken = true;
            }
        }
        if taken {
            self.merged.failures += 1;
            self.take_samples(known, id)?;
            self.frames(known, id)?;
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
        self.frames(known, id)?;
        self.transaction.execute(
            "UPDATE cases SET steps_done = ?2, deaths = 0, changed_at = ?3 WHERE id = ?1",
            params![known.id, steps, now()],
        )?;
        self.merged.checkpoints += 1;
        Ok(())
    }

    /// Takes over the samples of a failed run, unless the store has those of one that was computed to an end.
    fn take_samples(&mut self, known: &Known, id: i64) -> Result<(), rusqlite::Error> {
        match samples_of(self.old, id) {
            Ok(samples) if known.end.is_none() => {
                write_samples(self.transaction, known.id, &samples)
            }
            Ok(_) => Ok(()),
            Err(_) => {
                self.merged.unreadable += 1;
                Ok(())
            }
        }
    }

    /// Takes over frames the store does not have.
    fn frames(&mut self, known: &Known, id: i64) -> Result<(), rusqlite::Error> {
        let (_, damaged) = take_frames(self.old, id, self.transaction, known.id)?;
        self.merged.unreadable += damaged;
        Ok(())
    }

    /// Takes over the process an entry names, and lets the entry name it by its number here.
    fn take_process(&mut self, named: &mut Entry) -> Result<i64, rusqlite::Error> {
        let there = whole(named, "process").unwrap_or(0);
        if let Some(here) = self.processes.get(&there) {
            set(named, "process", *here);
            return Ok(*here);
        }
        let process = process(self.old, there);
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
            let new = self.transaction.last_insert_rowid();
            checksum::seal(self.transaction, Kind::Process, new)?;
            new
        };
        self.processes.insert(there, here);
        set(named, "process", here);
        Ok(here)
    }
}
