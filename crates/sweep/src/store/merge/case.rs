//! Merging one case by rank. All of it is read and checked by its digests before anything is
//! written.

use super::{MergeMode, Merged};
use crate::model::case::{Case, State};
use crate::model::protocol::Protocol;
use crate::store::database::Statements;
use crate::store::digest::whole;
use crate::store::entry::Points;
use crate::store::runs::{self, RunEnd};
use crate::store::{Attempt, Checkpoint, frames, samples, schema, settle, workers};
use crate::system::process::now;
use rusqlite::{Connection, params};
use std::collections::HashMap;

/// The merge of one shard in progress.
pub(super) struct Merging<'m> {
    /// The shard.
    pub(super) other: &'m Connection,
    /// The store.
    pub(super) connection: &'m Connection,
    pub(super) mode: MergeMode,
    pub(super) protocol: &'m Protocol,
    /// Numbers of processes in the shard and in the store.
    pub(super) processes: HashMap<i64, i64>,
    pub(super) merged: &'m mut Merged,
}

/// A case in the shard.
struct Theirs {
    id: i64,
    key: String,
    case: Case,
    state: State,
    steps_done: u64,
}

/// A case in the store.
struct Ours {
    id: i64,
    state: State,
    steps_done: u64,
    requested: u64,
    /// If complete: its steps, whether it jammed, and its process.
    end: Option<((u64, bool), i64)>,
}

/// A checkpoint: generation, steps, process, data.
type Kept = (i64, u64, i64, Vec<u8>);

impl Merging<'_> {
    /// Copies the data of a case.
    pub(super) fn case(&mut self, id: i64) -> rusqlite::Result<()> {
        let Ok(theirs) = Theirs::read(self.other, id) else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        let has_something = theirs.state != State::Pending || theirs.steps_done > 0;
        let Some(ours) = self.ours(&theirs, has_something)? else {
            return Ok(());
        };
        match theirs.run(self.other) {
            Ok(None) => {}
            Ok(Some(end)) => self.run(&ours, &theirs, &end)?,
            Err(_) => self.merged.unreadable += 1,
        }
        // The copied data may have ended it.
        let Some(ours) = self.ours(&theirs, false)? else {
            return Ok(());
        };
        match theirs.state {
            State::Failed if matches!(ours.state, State::Pending | State::Failed) => {
                self.take_failures(&ours, &theirs)
            }
            // A case that a process of this store computes is skipped.
            State::Pending | State::Running
                if ours.state == State::Pending && theirs.steps_done > ours.steps_done =>
            {
                self.take_checkpoints(&ours, &theirs)
            }
            _ => Ok(()),
        }
    }

    /// The case in the store; a case outside the grid is added if the shard has data `worth` it.
    fn ours(&self, theirs: &Theirs, worth: bool) -> rusqlite::Result<Option<Ours>> {
        let look = || {
            self.connection.find(
                "SELECT c.id, c.state, c.steps_done, c.steps, r.computed, r.jammed, r.process
                 FROM cases c LEFT JOIN results r ON r.case_id = c.id WHERE c.key = ?1",
                [&theirs.key],
                |row| {
                    let end: (Option<u64>, Option<bool>, Option<i64>) =
                        (row.get(4)?, row.get(5)?, row.get(6)?);
                    Ok(Ours {
                        id: row.get(0)?,
                        state: schema::state(row.get_ref(1)?)?,
                        steps_done: row.get(2)?,
                        requested: row.get(3)?,
                        end: end.0.zip(end.1).zip(end.2),
                    })
                },
            )
        };
        let known = look()?;
        if known.is_some() || self.mode != MergeMode::Campaign || !worth {
            return Ok(known);
        }
        let case = &theirs.case;
        self.connection.execute(
            "INSERT INTO cases (key, point, seed, steps, sample_stride, counts, turn, cost,
                 changed_at)
             VALUES (?1, ?2, ?3, ?4, ?5, 0, 0, ?6, ?7)",
            params![
                theirs.key,
                Points::default().place(self.connection, &case.params)?,
                case.seed,
                case.steps,
                case.sample_stride,
                case.cost(),
                now(),
            ],
        )?;
        look()
    }

    /// Copies a run if there is none. Of two that agree, the longer is kept; of two that disagree,
    /// the later attempt.
    fn run(&mut self, ours: &Ours, theirs: &Theirs, end: &RunEnd) -> rusqlite::Result<()> {
        if ours.state == State::Running && !end.jammed && end.steps < ours.requested {
            // A process of this store continues it.
            return Ok(());
        }
        let Some((own, process)) = ours.end else {
            return self.take_run(ours, theirs, end);
        };
        let Some(what) = self.difference(ours.id, own, theirs, end)? else {
            if end.steps > own.0 {
                self.take_run(ours, theirs, end)?;
            } else {
                self.take_frames(ours, theirs)?;
                self.merged.duplicates += 1;
            }
            return Ok(());
        };
        let other = self.take_process(end.process)?;
        if other == process {
            // Merged before, and kept as the later attempt.
            return Ok(());
        }
        let is_later = self.is_later(other, process)?;
        let (kept, other) = if is_later {
            (other, process)
        } else {
            (process, other)
        };
        if is_later {
            self.take_run(ours, theirs, end)?;
        }
        self.connection.run(
            "INSERT OR IGNORE INTO disagreements (case_id, kept, other, what, found_at)
                     VALUES (?1, ?2, ?3, ?4, ?5)",
            params![ours.id, kept, other, what, now()],
        )
    }

    /// First difference between a run and the stored one over their common steps, if any; times may
    /// differ.
    fn difference(
        &self,
        case: i64,
        ours: (u64, bool),
        of: &Theirs,
        end: &RunEnd,
    ) -> rusqlite::Result<Option<String>> {
        let theirs = (end.steps, end.jammed);
        let jammed_early = |one: (u64, bool), other: u64| one.1 && one.0 < other;
        if jammed_early(theirs, ours.0)
            || jammed_early(ours, theirs.0)
            || (theirs.0 == ours.0 && theirs.1 != ours.1)
        {
            let word = |jammed: bool| if jammed { "jammed" } else { "done" };
            return Ok(Some(format!(
                "{} after {} steps, and {} after {}",
                word(theirs.1),
                theirs.0,
                word(ours.1),
                ours.0
            )));
        }
        let common = theirs.0.min(ours.0);
        let different = samples::difference((self.other, of.id), (self.connection, case), common)?;
        if different.is_some() || theirs.0 != ours.0 {
            return Ok(different);
        }
        let counters = RunEnd::of(self.connection, case)?.map(|end| format!("{:?}", end.counters));
        let found = format!("{:?}", end.counters);
        Ok(counters
            .filter(|counters| *counters != found)
            .map(|counters| format!("counters are {found}, and {counters}")))
    }

    /// Copies a complete run; one with damaged frames is to be computed again, with its frames.
    fn take_run(&mut self, ours: &Ours, theirs: &Theirs, end: &RunEnd) -> rusqlite::Result<()> {
        let Ok(kept) = frames::of(self.other, theirs.id) else {
            self.merged.unreadable += 1;
            return frames::request(self.connection, ours.id);
        };
        let end = RunEnd {
            process: self.take_process(end.process)?,
            ..end.clone()
        };
        self.take_samples(ours, theirs, end.steps)?;
        settle::keep(self.connection, ours.id, &end, None, self.protocol)?;
        // It may be shorter than requested.
        let reopened = "id = ?1 AND state IN ('pending', 'failed')";
        runs::reopen(self.connection, reopened, [ours.id])?;
        self.merged.results += 1;
        let case = (ours.id, theirs.key.as_str());
        kept.map_or(Ok(()), |kept| frames::take(self.connection, case, kept))
    }

    /// Replaces the samples of a case by theirs before a step.
    fn take_samples(&self, ours: &Ours, theirs: &Theirs, until: u64) -> rusqlite::Result<()> {
        samples::copy((self.other, theirs.id), (self.connection, ours.id), until)
    }

    /// Whether the attempt of a process is later than that of another. Processes of the store
    /// itself count as the latest.
    fn is_later(&self, one: i64, other: i64) -> rusqlite::Result<bool> {
        // The name of a job starts with its number.
        let attempt = "SELECT coalesce(CAST(job AS INTEGER), 0x7fffffffffffffff), coalesce(restart, 0), started_at, host, pid
             FROM processes WHERE id";
        let later = format!("SELECT ({attempt} = ?1) > ({attempt} = ?2)");
        self.connection.one(&later, [one, other], |row| row.get(0))
    }

    /// Copies failures that the store does not have.
    fn take_failures(&mut self, ours: &Ours, theirs: &Theirs) -> rusqlite::Result<()> {
        let found = runs::check(self.other, "c.id = ?1", &[&theirs.id])
            .and_then(|()| samples::each(self.other, theirs.id, |_, _| Ok(())))
            .and_then(|()| runs::of(self.other, theirs.id));
        let Ok(found) = found else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        let mut taken = false;
        for failure in found {
            // Compared without the process, which may be lost in the shard.
            let is_there = self.connection.has(
                "SELECT 1 FROM failures WHERE case_id = ?1 AND failed_at = ?2 AND step = ?3 AND error = ?4",
                params![ours.id, failure.failed_at, failure.step, failure.error],
            )?;
            if !is_there {
                let process = self.take_process(failure.process)?;
                let failure = Attempt { process, ..failure };
                runs::insert(self.connection, ours.id, &failure)?;
                taken = true;
            }
        }
        if !taken {
            return Ok(());
        }
        self.merged.failures += 1;
        if ours.end.is_none() {
            self.take_samples(ours, theirs, u64::MAX)?;
        }
        self.take_frames(ours, theirs)?;
        if ours.state == State::Pending {
            runs::delete_checkpoints(self.connection, ours.id, u64::MAX)?;
            runs::end(self.connection, ours.id, State::Failed, theirs.steps_done)?;
        }
        runs::seal(self.connection, "c.id = ?1", &[&ours.id])
    }

    /// Replaces the checkpoints of a running case by newer ones.
    fn take_checkpoints(&mut self, ours: &Ours, theirs: &Theirs) -> rusqlite::Result<()> {
        let whole = theirs.checkpoints(self.other).unwrap_or_default();
        let Some(steps) = whole.iter().map(|checkpoint| checkpoint.1).max() else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        if steps <= ours.steps_done {
            return Ok(());
        }
        runs::delete_checkpoints(self.connection, ours.id, u64::MAX)?;
        self.take_samples(ours, theirs, steps)?;
        for (generation, steps, process, data) in whole {
            let kept = (generation, steps, self.take_process(process)?, &data[..]);
            runs::put_checkpoint(self.connection, ours.id, kept)?;
        }
        runs::reopen(self.connection, "id = ?1", [ours.id])?;
        self.merged.checkpoints += 1;
        self.take_frames(ours, theirs)
    }

    /// Copies frames. Those of one step are identical in all processes.
    fn take_frames(&mut self, ours: &Ours, theirs: &Theirs) -> rusqlite::Result<()> {
        match frames::of(self.other, theirs.id) {
            Ok(None) => {}
            Ok(Some(kept)) => frames::take(self.connection, (ours.id, &theirs.key), kept)?,
            Err(_) => self.merged.unreadable += 1,
        }
        Ok(())
    }

    /// Copies the process with a number; returns its number in this store.
    fn take_process(&mut self, there: i64) -> rusqlite::Result<i64> {
        if let Some(here) = self.processes.get(&there) {
            return Ok(*here);
        }
        let described = workers::described(self.other, there);
        let known = "SELECT id FROM processes WHERE digest = ?1";
        let known = self
            .connection
            .value(known, [workers::SEALED.digest_of(&described)])?;
        let left = [("heartbeat", whole(0)), ("ended_at", now().into())];
        let enter = || workers::put(self.connection, &described, &left);
        let here = known.map_or_else(enter, Ok)?;
        self.processes.insert(there, here);
        Ok(here)
    }
}

impl Theirs {
    /// The case with a number, if its key is intact.
    fn read(other: &Connection, id: i64) -> rusqlite::Result<Self> {
        let found = other.one(
            "SELECT c.key, p.params, c.seed, c.steps, c.sample_stride, c.state, c.steps_done
                 FROM cases c JOIN points p ON p.id = c.point WHERE c.id = ?1",
            [id],
            |row| {
                Ok(Self {
                    id,
                    key: row.get(0)?,
                    case: Case {
                        params: schema::params(row, 1)?,
                        seed: row.get(2)?,
                        steps: row.get(3)?,
                        sample_stride: row.get::<_, u64>(4)?.max(1),
                    },
                    state: schema::state(row.get_ref(5)?)?,
                    steps_done: row.get(6)?,
                })
            },
        )?;
        if found.case.key().to_string() == found.key {
            Ok(found)
        } else {
            Err(rusqlite::Error::QueryReturnedNoRows)
        }
    }

    /// The end of its run, if complete: with the samples of all its steps, and a matching last
    /// state.
    fn run(&self, other: &Connection) -> rusqlite::Result<Option<RunEnd>> {
        let is_finished = matches!(self.state, State::Done | State::Jammed);
        let untrusted = || rusqlite::Error::QueryReturnedNoRows;
        let Some(mut end) = RunEnd::of(other, self.id)? else {
            return if is_finished {
                Err(untrusted())
            } else {
                Ok(None)
            };
        };
        let stride = self.case.sample_stride;
        let (mut number, mut in_order) = (0, true);
        samples::each(other, self.id, |step, _| {
            // A run that failed after a continuation has more samples.
            if step < end.steps {
                in_order &= step == number * stride;
                number += 1;
            }
            Ok(())
        })?;
        if !in_order || number != end.steps.div_ceil(stride) {
            return Err(untrusted());
        }
        let last = end.state.as_deref().map(Checkpoint::decode);
        let is_last = |last: &Checkpoint| last.snapshot.steps() == end.steps;
        if !matches!(last, Some(Ok(last)) if is_last(&last)) {
            // The run cannot be continued from it, but its result is valid.
            end.state = None;
        }
        Ok(Some(end))
    }

    /// Its intact checkpoints.
    fn checkpoints(&self, other: &Connection) -> rusqlite::Result<Vec<Kept>> {
        let found: Vec<rusqlite::Result<Kept>> = other.all(
            "SELECT generation, steps, process, data FROM checkpoints WHERE case_id = ?1",
            [self.id],
            |row| Ok(row.try_into()),
        )?;
        let whole = |mut kept: Kept| {
            let checkpoint = Checkpoint::decode(&kept.3).ok()?;
            kept.1 = checkpoint.snapshot.steps();
            let samples = samples::digest_until(other, self.id, kept.1).ok()?;
            (matches!(kept.0, 0 | 1) && samples == checkpoint.samples_digest).then_some(kept)
        };
        Ok(found.into_iter().flatten().filter_map(whole).collect())
    }
}
