//! Results and failures: what is left of a run.

use super::checksum::{self, Kind};
use super::claims::{Claim, drop_checkpoints};
use super::ends::{self, RunEnd};
use super::samples::write_samples;
use super::{Store, StoreError, integer, process};
use crate::case::State;
use rusqlite::{Connection, Transaction, params};
use sd_core::Sample;
use sd_core::simulation::Counters;

/// A run that came to its end.
#[derive(Debug)]
pub struct Finished {
    /// [`State::Done`] or [`State::Jammed`].
    pub state: State,
    /// Its samples, with their steps.
    pub samples: Vec<(u64, Sample)>,
    /// What it met.
    pub counters: Counters,
    /// Steps done.
    pub steps: u64,
    /// First step that counts in the averages.
    pub discard_step: u64,
    /// Seconds of computing.
    pub wall_time_s: f64,
    /// Times it went on from a checkpoint.
    pub resumed: u32,
    /// A checkpoint of its last state, without samples: what a longer run goes on from.
    pub last_state: Vec<u8>,
}

/// A run that failed.
#[derive(Debug)]
pub struct Failure {
    /// Its error.
    pub error: String,
    /// The step that failed.
    pub step: u64,
    /// Pair it failed at, if it is known.
    pub pair: Option<(usize, usize)>,
    /// Gap of that pair.
    pub gap: Option<f64>,
    /// JSON of the state before the step that failed.
    pub snapshot: Option<String>,
    /// Samples up to then.
    pub samples: Vec<(u64, Sample)>,
}

impl Store {
    /// Keeps the result of a case, and its last state.
    ///
    /// # Errors
    /// [`StoreError::ClaimLost`], and trouble with the file.
    pub fn finish(&mut self, claim: &Claim, finished: &Finished) -> Result<(), StoreError> {
        let me = self.me();
        let owned = self.write(|transaction| {
            if !end(transaction, claim, me, finished.state, finished.steps)? {
                return Ok(false);
            }
            write_samples(transaction, claim.id, &finished.samples)?;
            let end = RunEnd {
                steps: finished.steps,
                jammed: finished.state == State::Jammed,
                counters: &finished.counters,
                state: &finished.last_state,
            };
            end.write(transaction, claim.id)?;
            // Who computed it; what came out of it is filled in below. No run discards as many steps as this says.
            transaction
                .prepare_cached(
                    "INSERT OR REPLACE INTO results (case_id, discard_step, samples, contacts, activated, rolling,
                         approach, stages, unconverged_stages, jam_events, jammed_strain, final_strain, wall_time_s,
                         resumed, process, finished_at)
                     VALUES (?1, -1, 0, 0, 0, 0, 0.0, 0, 0, 0, 0.0, 0.0, ?2, ?3, ?4, ?5)",
                )?
                .execute(params![
                    claim.id,
                    finished.wall_time_s,
                    finished.resumed,
                    me,
                    process::now(),
                ])?;
            ends::settle(transaction, claim.id, finished.discard_step)?;
            drop_checkpoints(transaction, claim.id)?;
            Ok(true)
        })?;
        owned.then_some(()).ok_or_else(|| claim.lost())
    }

    /// Keeps the failure of a case.
    ///
    /// # Errors
    /// [`StoreError::ClaimLost`], and trouble with the file.
    pub fn fail(&mut self, claim: &Claim, failure: &Failure) -> Result<(), StoreError> {
        let me = self.me();
        let owned = self.write(|transaction| {
            if !end(transaction, claim, me, State::Failed, failure.step)? {
                return Ok(false);
            }
            // Samples of a run that was computed farther before are those of its result.
            let computed = ends::steps_of(transaction, claim.id)?;
            if computed.is_none_or(|steps| steps <= failure.step) {
                write_samples(transaction, claim.id, &failure.samples)?;
            }
            let sphere = |sphere: usize| integer(sphere as u64);
            transaction.execute(
                "INSERT INTO failures (case_id, attempt, error, step, strain, sphere_i, sphere_j, gap, snapshot, process,
                     failed_at)
                 SELECT ?1, attempts, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10 FROM cases WHERE id = ?1",
                params![
                    claim.id,
                    failure.error,
                    integer(failure.step),
                    failure.step as f64 * claim.case.params.time_step,
                    failure.pair.map(|(i, _)| sphere(i)),
                    failure.pair.map(|(_, j)| sphere(j)),
                    failure.gap,
                    failure.snapshot,
                    me,
                    process::now(),
                ],
            )?;
            checksum::seal(
                transaction,
                Kind::Failure,
                transaction.last_insert_rowid(),
            )?;
            drop_checkpoints(transaction, claim.id)?;
            Ok(true)
        })?;
        owned.then_some(()).ok_or_else(|| claim.lost())
    }

    /// Makes all failed cases of the grid pending again. Says how many.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn retry_failed(&mut self) -> Result<usize, StoreError> {
        self.write(|transaction| {
            let failed: Vec<i64> = transaction
                .prepare("SELECT id FROM cases WHERE state = 'failed' AND position IS NOT NULL")?
                .query_map([], |row| row.get(0))?
                .collect::<Result<_, _>>()?;
            for case in failed {
                checksum::check(transaction, Kind::Samples, case)?;
                transaction.execute(
                    "DELETE FROM samples WHERE case_id = ?1
                         AND step >= coalesce((SELECT steps FROM ends e WHERE e.case_id = samples.case_id), 0)",
                    [case],
                )?;
                checksum::seal(transaction, Kind::Samples, case)?;
            }
            reopen_failed(transaction, "position IS NOT NULL")
        })
    }
}

/// Makes failed cases that meet a condition pending again: they begin anew, or where they were computed to an end before, go on
/// from there. Says how many.
pub(super) fn reopen_failed(
    connection: &Connection,
    condition: &str,
) -> Result<usize, rusqlite::Error> {
    connection.execute(
        &format!(
            "UPDATE cases SET state = 'pending', deaths = 0, changed_at = ?1, steps_done = coalesce(
                 (SELECT e.steps FROM ends e WHERE e.case_id = cases.id AND e.state IS NOT NULL), 0)
             WHERE state = 'failed' AND {condition}"
        ),
        [process::now()],
    )
}

/// Ends a case that this process owns; says whether it did.
fn end(
    transaction: &Transaction<'_>,
    claim: &Claim,
    me: i64,
    state: State,
    steps: u64,
) -> Result<bool, rusqlite::Error> {
    let changed = transaction
        .prepare_cached(
            "UPDATE cases SET state = ?3, owner = NULL, steps_done = ?4, changed_at = ?5
             WHERE id = ?1 AND owner = ?2 AND state = 'running'",
        )?
        .execute(params![
            claim.id,
            me,
            state.name(),
            integer(steps),
            process::now()
        ])?;
    Ok(changed == 1)
}
