//! Merging one case by rank. All of it is read and checked by its digests before anything is
//! written.

use super::{Disagreement, Merged, MergedCases};
use crate::model::case::State;
use crate::model::protocol::Protocol;
use crate::store::digest::whole;
use crate::store::points::{CaseRow, Points};
use crate::store::processes;
use crate::store::runs::{self, RunEnd, StoredCheckpoint};
use crate::store::statements::Statements;
use crate::store::{Attempt, Checkpoint, frames, samples, settle};
use crate::system::process::now;
use rusqlite::{Connection, params};
use serde::Deserialize;
use std::collections::HashMap;

/// The merge of one shard in progress.
pub(super) struct Merging<'m> {
    /// The shard.
    pub(super) other: &'m Connection,
    /// The store.
    pub(super) connection: &'m Connection,
    pub(super) cases: MergedCases,
    pub(super) protocol: &'m Protocol,
    /// Numbers of processes in the shard and in the store.
    pub(super) processes: HashMap<i64, i64>,
    pub(super) merged: &'m mut Merged,
}

/// A case in the shard or in the store, and the steps, outcome, counters and process of its run, if
/// that is complete.
#[derive(Deserialize)]
struct StoredCase {
    id: i64,
    key: String,
    state: State,
    steps: u64,
    steps_done: u64,
    samples_digest: Option<i64>,
    computed: Option<u64>,
    jammed: Option<bool>,
    counters: Option<String>,
    process: Option<i64>,
}

impl StoredCase {
    /// The case that meets a condition.
    fn find(
        connection: &Connection,
        condition: &str,
        parameters: impl rusqlite::Params,
    ) -> rusqlite::Result<Option<Self>> {
        let query =
            "SELECT c.id, c.key, c.state, c.steps, c.steps_done, c.samples_digest, r.computed,
                 r.jammed, r.counters, r.process
             FROM cases c LEFT JOIN results r ON r.case_id = c.id WHERE";
        connection.first(&format!("{query} {condition}"), parameters)
    }

    /// All that determines the bits of its run, if that is complete.
    fn bits(&self) -> Option<(u64, bool, &str, Option<i64>)> {
        let counters = self.counters.as_deref()?;
        Some((self.computed?, self.jammed?, counters, self.samples_digest))
    }
}

impl Merging<'_> {
    /// Copies the data of a case with a number in the shard.
    pub(super) fn case(&mut self, id: i64) -> rusqlite::Result<()> {
        let Some((theirs, case)) = self.theirs(id) else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        let Some(ours) = self.ours(&theirs, case)? else {
            return Ok(());
        };
        let is_finished = matches!(theirs.state, State::Done | State::Jammed);
        if theirs.bits().is_some() && theirs.bits() == ours.bits() {
            self.merged.duplicates += 1;
            if ours.state != State::Running {
                self.take_frames(&ours, &theirs)?;
            }
        } else if is_finished || theirs.computed.is_some() {
            match complete_run(self.other, &theirs) {
                Ok(end) => self.run(&ours, &theirs, &end)?,
                Err(_) => self.merged.unreadable += 1,
            }
        }
        // The copied data may have ended it.
        let ours = StoredCase::find(self.connection, "c.id = ?1", [ours.id])?.unwrap_or(ours);
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

    /// The case with a number in the shard, if its key is intact.
    fn theirs(&self, id: i64) -> Option<(StoredCase, CaseRow)> {
        let stored = StoredCase::find(self.other, "c.id = ?1", [id]).ok()??;
        let case = "SELECT p.params, c.seed, c.steps, max(c.sample_stride, 1) AS sample_stride
             FROM cases c JOIN points p ON p.id = c.point WHERE c.id = ?1";
        let case: CaseRow = self.other.first(case, [id]).ok()??;
        (case.key() == stored.key).then_some((stored, case))
    }

    /// The case in the store; a case outside the grid is added if the shard has data of it.
    fn ours(&self, theirs: &StoredCase, case: CaseRow) -> rusqlite::Result<Option<StoredCase>> {
        let known = || StoredCase::find(self.connection, "c.key = ?1", [&theirs.key]);
        let has_data = theirs.state != State::Pending || theirs.steps_done > 0;
        let found = known()?;
        if found.is_some() || self.cases == MergedCases::Own || !has_data {
            return Ok(found);
        }
        let case = case.into_case();
        self.connection.execute(
            "INSERT INTO cases (key, point, seed, steps, sample_stride, counts, turn, cost,
                 changed_at)
             VALUES (?1, ?2, ?3, ?4, ?5, 0, 0, ?6, ?7)",
            params![
                theirs.key,
                Points::default().id(self.connection, &case.params)?,
                case.seed,
                case.steps,
                case.sample_stride,
                case.cost(),
                now(),
            ],
        )?;
        known()
    }

    /// Copies a run if there is none. Of two that agree, the longer is kept; of two that disagree,
    /// the later attempt.
    fn run(
        &mut self,
        ours: &StoredCase,
        theirs: &StoredCase,
        end: &RunEnd,
    ) -> rusqlite::Result<()> {
        if ours.state == State::Running && !end.jammed && end.computed < ours.steps {
            // A process of this store continues it.
            return Ok(());
        }
        let (Some(computed), Some(process)) = (ours.computed, ours.process) else {
            return self.take_run(ours, theirs, end);
        };
        let Some(what) = self.difference(ours, theirs, end)? else {
            if end.computed > computed {
                return self.take_run(ours, theirs, end);
            }
            self.merged.duplicates += 1;
            return self.take_frames(ours, theirs);
        };
        let other = self.take_process(end.process)?;
        let is_later = processes::is_later(self.connection, other, process)?;
        let (kept, other) = if is_later {
            self.take_run(ours, theirs, end)?;
            (other, process)
        } else {
            (process, other)
        };
        self.merged.disagreements.push(Disagreement {
            key: theirs.key.clone(),
            kept: processes::name(self.connection, kept)?,
            other: processes::name(self.connection, other)?,
            what,
        });
        Ok(())
    }

    /// First difference between a run and the stored one over their common steps, if any; times may
    /// differ.
    fn difference(
        &self,
        ours: &StoredCase,
        theirs: &StoredCase,
        end: &RunEnd,
    ) -> rusqlite::Result<Option<String>> {
        let Some(own) = RunEnd::of(self.connection, ours.id)? else {
            return Ok(None);
        };
        let jammed_early = |one: &RunEnd, other: &RunEnd| {
            one.jammed
                && (one.computed < other.computed || !other.jammed)
                && one.computed <= other.computed
        };
        if jammed_early(end, &own) || jammed_early(&own, end) {
            let words = |end: &RunEnd| {
                let word = if end.jammed { "jammed" } else { "done" };
                format!("{word} after {} steps", end.computed)
            };
            return Ok(Some(format!("{}, and {}", words(end), words(&own))));
        }
        let common = end.computed.min(own.computed);
        let different =
            samples::difference((self.other, theirs.id), (self.connection, ours.id), common)?;
        if different.is_some() || end.computed != own.computed {
            return Ok(different);
        }
        let [found, known] = [end, &own].map(|end| format!("{:?}", end.counters));
        Ok((found != known).then(|| format!("counters are {found}, and {known}")))
    }

    /// Copies a complete run; one with damaged frames is to be computed again, with its frames.
    fn take_run(
        &mut self,
        ours: &StoredCase,
        theirs: &StoredCase,
        end: &RunEnd,
    ) -> rusqlite::Result<()> {
        let Ok(kept) = frames::of(self.other, theirs.id) else {
            self.merged.unreadable += 1;
            return frames::request(self.connection, ours.id);
        };
        let end = RunEnd {
            process: self.take_process(end.process)?,
            ..end.clone()
        };
        self.take_samples(ours, theirs, end.computed)?;
        settle::keep(self.connection, ours.id, &end, None, self.protocol)?;
        // It may be shorter than requested.
        let reopened = "id = ?1 AND state IN ('pending', 'failed')";
        runs::reopen(self.connection, reopened, [ours.id])?;
        self.merged.results += 1;
        let case = (ours.id, theirs.key.as_str());
        kept.map_or(Ok(()), |kept| frames::take(self.connection, case, kept))
    }

    /// Replaces the samples of a case by theirs before a step.
    fn take_samples(
        &self,
        ours: &StoredCase,
        theirs: &StoredCase,
        until: u64,
    ) -> rusqlite::Result<()> {
        samples::copy((self.other, theirs.id), (self.connection, ours.id), until)
    }

    /// Copies failures that the store does not have.
    fn take_failures(&mut self, ours: &StoredCase, theirs: &StoredCase) -> rusqlite::Result<()> {
        let found = runs::check(self.other, "c.id = ?1", &[&theirs.id])
            .and_then(|()| runs::failures_of(self.other, theirs.id));
        let Ok(mut found) = found else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        // Compared without the process, which may be lost in the shard.
        let known = runs::failures_of(self.connection, ours.id)?;
        let which = |failure: &Attempt| (failure.failed_at, failure.step, failure.error.clone());
        found.retain(|failure| !known.iter().any(|known| which(known) == which(failure)));
        if found.is_empty() {
            return Ok(());
        }
        if samples::each(self.other, theirs.id, |_, _| Ok(())).is_err() {
            self.merged.unreadable += 1;
            return Ok(());
        }
        for failure in found {
            let process = self.take_process(failure.process)?;
            runs::insert(self.connection, ours.id, &Attempt { process, ..failure })?;
        }
        self.merged.failures += 1;
        if ours.computed.is_none() {
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
    fn take_checkpoints(&mut self, ours: &StoredCase, theirs: &StoredCase) -> rusqlite::Result<()> {
        let intact = intact_checkpoints(self.other, theirs.id).unwrap_or_default();
        let Some(steps) = intact.iter().map(|checkpoint| checkpoint.steps).max() else {
            self.merged.unreadable += 1;
            return Ok(());
        };
        if steps <= ours.steps_done {
            return Ok(());
        }
        runs::delete_checkpoints(self.connection, ours.id, u64::MAX)?;
        self.take_samples(ours, theirs, steps)?;
        for mut checkpoint in intact {
            checkpoint.process = self.take_process(checkpoint.process)?;
            checkpoint.put(self.connection, ours.id)?;
        }
        runs::reopen(self.connection, "id = ?1", [ours.id])?;
        self.merged.checkpoints += 1;
        self.take_frames(ours, theirs)
    }

    /// Copies frames that the store lacks. Those of one step are identical in all processes.
    fn take_frames(&mut self, ours: &StoredCase, theirs: &StoredCase) -> rusqlite::Result<()> {
        let kept = frames::kept(self.connection, ours.id)?;
        let found = match (kept, frames::kept(self.other, theirs.id)) {
            (Some(ours), Ok(Some(theirs)))
                if ours.start <= theirs.start && theirs.end <= ours.end =>
            {
                return Ok(());
            }
            (_, Ok(_)) => frames::of(self.other, theirs.id),
            (_, Err(error)) => Err(error),
        };
        match found {
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
        let described = processes::described(self.other, there);
        let known = "SELECT id FROM processes WHERE digest = ?1";
        let known = self
            .connection
            .value(known, [processes::SEALED.digest_of(&described)])?;
        let left = [("heartbeat", whole(0)), ("ended_at", now().into())];
        let enter = || processes::SEALED.put(self.connection, None, &described, &left);
        let here = known.map_or_else(enter, Ok)?;
        self.processes.insert(there, here);
        Ok(here)
    }
}

/// The end of a complete run of a shard: with the samples of all its steps, and a matching last
/// state.
///
/// # Errors
/// Those of the queries, and [`rusqlite::Error::QueryReturnedNoRows`] where something is missing.
fn complete_run(other: &Connection, theirs: &StoredCase) -> rusqlite::Result<RunEnd> {
    let untrusted = || rusqlite::Error::QueryReturnedNoRows;
    let mut end = RunEnd::of(other, theirs.id)?.ok_or_else(untrusted)?;
    let stride = "SELECT max(sample_stride, 1) FROM cases WHERE id = ?1";
    let stride: u64 = other.one(stride, [theirs.id], |row| row.get(0))?;
    let (mut number, mut in_order) = (0, true);
    samples::each(other, theirs.id, |step, _| {
        // A run that failed after a continuation has more samples.
        if step < end.computed {
            in_order &= step == number * stride;
            number += 1;
        }
        Ok(())
    })?;
    if !in_order || number != end.computed.div_ceil(stride) {
        return Err(untrusted());
    }
    let last = end.state.as_deref().map(Checkpoint::decode);
    let is_last = |last: &Checkpoint| last.snapshot.steps() == end.computed;
    if !matches!(last, Some(Ok(last)) if is_last(&last)) {
        // The run cannot be continued from it, but its result is valid.
        end.state = None;
    }
    Ok(end)
}

/// The intact checkpoints of a run in progress.
fn intact_checkpoints(other: &Connection, id: i64) -> rusqlite::Result<Vec<StoredCheckpoint>> {
    let found = "SELECT generation, steps, process, data FROM checkpoints
         WHERE case_id = ?1 AND generation IN (0, 1)";
    let mut found: Vec<StoredCheckpoint> = other.named(found, [id])?;
    found.retain_mut(|stored| {
        let Ok(checkpoint) = Checkpoint::decode(&stored.data) else {
            return false;
        };
        stored.steps = checkpoint.snapshot.steps();
        let samples = samples::digest_until(other, id, stored.steps);
        samples.is_ok_and(|samples| samples == checkpoint.samples_digest)
    });
    Ok(found)
}
