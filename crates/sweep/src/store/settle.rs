//! The result of a run that the campaign requests.
//!
//! A run is computed once: its beginning is the run of less strain, and its last state continues to
//! more.

use super::claims::{Claim, NewRows, owns};
use super::digest::whole;
use super::entered::Entered;
use super::runs::{Attempt, LAST, RunEnd, StoredCheckpoint};
use super::statements::{Statements, json};
use super::{Store, StoreError, frames, rules, runs, samples};
use crate::model::campaign::Campaign;
use crate::model::case::{Case, State};
use crate::model::precision::Precision;
use crate::model::protocol::Protocol;
use crate::system::process;
use rusqlite::Connection;
use sd_core::simulation::Counters;
use sd_core::{Params, Sample, start};
use serde::Deserialize;

/// The new end of a run, and its samples if they are all at hand.
type NewEnd<'r> = (&'r RunEnd, Option<&'r [(u64, Sample)]>);

/// A completed case, and the result requested.
#[derive(Deserialize)]
struct Computed {
    id: i64,
    #[serde(deserialize_with = "json")]
    params: Params,
    requested: u64,
    state: State,
    /// Steps of its result now.
    steps_done: u64,
    /// Discarded steps of its result now.
    discarded: Option<u64>,
    steps: u64,
    jammed: bool,
}

impl Computed {
    /// The cases that meet a condition on `c`, with their results `r` if there are any.
    fn of(
        connection: &Connection,
        condition: &str,
        parameters: impl rusqlite::Params,
    ) -> rusqlite::Result<Vec<Self>> {
        connection.named(
            &format!(
                "SELECT c.id, p.params, c.steps AS requested, c.state, c.steps_done,
                     r.discard_step AS discarded, coalesce(r.computed, 0) AS steps,
                     coalesce(r.jammed, 0) AS jammed
                 FROM cases c JOIN points p ON p.id = c.point LEFT JOIN results r ON r.case_id = c.id
                 WHERE {condition}"
            ),
            parameters,
        )
    }

    /// State and steps of the requested result; `None` if more is requested than was computed.
    fn outcome(&self) -> Option<(State, u64)> {
        if self.jammed && self.requested >= self.steps {
            Some((State::Jammed, self.steps))
        } else if self.steps >= self.requested {
            Some((State::Done, self.requested))
        } else {
            None
        }
    }

    /// Sets the state and the result that are requested; `run` is its new end, and its samples if
    /// they are all at hand.
    fn settle(
        &self,
        connection: &Connection,
        protocol: &Protocol,
        run: Option<NewEnd<'_>>,
    ) -> rusqlite::Result<()> {
        let discard = protocol
            .with_time_step(self.params.time_step)
            .discard_steps();
        let case = (self.id, &self.params);
        let Some((state, steps)) = self.outcome() else {
            if let Some((end, _)) = run {
                // Averages of nothing, until the rest is computed.
                end.write(connection, case, (0, 0), Some(&[]))?;
            }
            // Others are pending already, or failed in a continuation.
            if run.is_some() || matches!(self.state, State::Done | State::Jammed) {
                let ended = "id = ?1 AND state IN ('done', 'jammed')";
                runs::reopen(connection, ended, [self.id])?;
                runs::seal(connection, "c.id = ?1", &[&self.id])?;
            }
            return Ok(());
        };
        let known = (self.state, self.steps_done, self.discarded);
        if run.is_none() && known == (state, steps, Some(discard)) {
            return Ok(());
        }
        let averaged = (steps, discard);
        if let Some((end, samples)) = run {
            end.write(connection, case, averaged, samples)?;
        } else if let Some(end) = RunEnd::of(connection, self.id)? {
            end.write(connection, case, averaged, None)?;
        }
        runs::end(connection, self.id, state, steps)
    }
}

/// Stores the end of a run whose samples are in the store, and sets the state and the result that
/// the protocol requests. The samples are read again unless they are given.
pub(super) fn keep(
    connection: &Connection,
    case: i64,
    end: &RunEnd,
    samples: Option<&[(u64, Sample)]>,
    protocol: &Protocol,
) -> rusqlite::Result<()> {
    runs::delete_checkpoints(connection, case, end.computed)?;
    match end.state.clone() {
        Some(data) => StoredCheckpoint {
            generation: LAST,
            steps: end.computed,
            process: end.process,
            data,
        }
        .put(connection, case)?,
        None => connection.run(
            "DELETE FROM checkpoints WHERE case_id = ?1 AND generation = ?2",
            [case, LAST],
        )?,
    }
    for mut computed in Computed::of(connection, "c.id = ?1", [case])? {
        (computed.steps, computed.jammed) = (end.computed, end.jammed);
        computed.settle(connection, protocol, Some((end, samples)))?;
    }
    Ok(())
}

/// Continues new runs with segments from runs that were computed without the last segment.
pub(super) fn continue_shorter_runs(
    connection: &Connection,
    campaign: &Campaign,
    entered: &Entered,
) -> rusqlite::Result<()> {
    each_shorter_run(connection, campaign, |(id, key), of, end| {
        samples::copy((connection, of), (connection, id), end.computed)?;
        if let Some(kept) = frames::of(connection, of)? {
            frames::take(connection, (id, key), kept)?;
        }
        keep(connection, id, end, None, &entered.protocol)?;
        runs::reopen(connection, "id = ?1", [id]).map(drop)
    })
}

/// Counts the steps that new runs in segments would reuse as done, in a store opened for reading.
pub(super) fn count_shorter_runs(
    connection: &Connection,
    campaign: &Campaign,
) -> rusqlite::Result<()> {
    each_shorter_run(connection, campaign, |(id, _), _, end| {
        let steps = end.state.as_ref().map_or(0, |_| end.computed);
        let done = "UPDATE cases SET steps_done = ?2 WHERE id = ?1";
        connection.run(done, (id, whole(steps)))
    })
}

/// Calls `take` for every new run in segments whose beginning was computed, with the run, its key,
/// and the case and end of that beginning. A shorter run in other cells is no beginning of it.
fn each_shorter_run(
    connection: &Connection,
    campaign: &Campaign,
    mut take: impl FnMut((i64, &str), i64, &RunEnd) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    for (key, case) in &campaign.cases {
        let mut shorter = case.params.before_last_segment();
        if shorter.is_none() {
            continue;
        }
        let key = key.to_string();
        let new = "SELECT id FROM cases WHERE key = ?1 AND state = 'pending' AND steps_done = 0
             AND NOT EXISTS (SELECT 1 FROM results WHERE case_id = cases.id)";
        let Some(id) = connection.value(new, [&key])? else {
            continue;
        };
        while let Some((params, most)) = shorter {
            let known = Case {
                params,
                ..case.clone()
            };
            let computed = "SELECT id FROM cases WHERE key = ?1";
            let computed: Option<i64> = connection.value(computed, [known.key().to_string()])?;
            let end = match computed {
                Some(of) => RunEnd::of(connection, of)?.map(|end| (of, end)),
                None => None,
            };
            if let Some((of, end)) = end
                && !end.jammed
                && end.computed <= most
                && start::begins_like(&case.params, &known.params)
            {
                take((id, &key), of, &end)?;
                break;
            }
            shorter = known.params.before_last_segment();
        }
    }
    Ok(())
}

/// Sets the state and the result that the protocol requests for every completed case of the grid.
/// Running cases are skipped.
pub(super) fn settle_all(connection: &Connection, protocol: &Protocol) -> rusqlite::Result<()> {
    let of_grid = "c.position IS NOT NULL AND c.state != 'running' AND r.case_id IS NOT NULL";
    let computed = Computed::of(connection, of_grid, [])?;
    let mut computed = computed.iter();
    computed.try_for_each(|case| case.settle(connection, protocol, None))
}

/// The last state of a finished run.
#[derive(Deserialize)]
pub(crate) struct LastState {
    #[serde(deserialize_with = "json")]
    pub(crate) params: Params,
    pub(crate) seed: u64,
    /// The checkpoint of that state.
    pub(crate) state: Vec<u8>,
}

impl Store {
    /// The last states of all done runs of the grid that have one, in the order of the campaign.
    pub(crate) fn last_states(&self) -> Result<Vec<LastState>, StoreError> {
        self.read(runs::check(
            &self.connection,
            "c.counts AND c.state = 'done'",
            &[],
        ))?;
        self.named(
            "SELECT p.params, c.seed, k.data AS state FROM cases c JOIN points p ON p.id = c.point
             JOIN checkpoints k ON k.case_id = c.id AND k.generation = ?1
             WHERE c.counts AND c.state = 'done' ORDER BY c.position",
            [LAST],
        )
    }
}

/// A completed run.
#[derive(Debug)]
pub struct Finished {
    /// [`State::Done`] or [`State::Jammed`].
    pub state: State,
    /// What it measured since its last checkpoint.
    pub rows: NewRows,
    /// Its counters.
    pub counters: Counters,
    /// Steps done.
    pub steps: u64,
    /// Seconds of computing.
    pub wall_time_s: f64,
    /// Seconds of CPU.
    pub cpu_time_s: f64,
    /// Number of times it was resumed from a checkpoint.
    pub resumed: u32,
    /// The checkpoint of its last state, from which a longer run continues.
    pub last_state: Vec<u8>,
}

impl Store {
    /// Stores the results of cases and their last states in one transaction. Returns for each
    /// whether this process still owned it; otherwise nothing is stored.
    pub(crate) fn finish(&mut self, runs: &[(&Claim, &Finished)]) -> Result<Vec<bool>, StoreError> {
        let (me, entered) = (self.me(), self.entered()?);
        self.write(|connection| {
            runs.iter()
                .map(|(claim, finished)| {
                    let is_owned = owns(connection, claim, me)?;
                    if is_owned {
                        finish(connection, claim, finished, &entered, me)?;
                    }
                    Ok(is_owned)
                })
                .collect()
        })
    }

    /// Stores the failure of a case, with what it measured since its last checkpoint.
    pub(crate) fn fail(
        &mut self,
        claim: &Claim,
        failure: Attempt,
        rows: &NewRows,
    ) -> Result<(), StoreError> {
        let (me, entered) = (self.me(), self.entered()?);
        let owned = self.write(|connection| {
            if !owns(connection, claim, me)? {
                return Ok(false);
            }
            rows.append(connection, claim, failure.step)?;
            fail(connection, &entered.rules, claim.id, &failure.by(me))?;
            Ok(true)
        })?;
        owned.then_some(()).ok_or_else(|| claim.lost())
    }

    /// Resets all failed cases of the grid to pending. Returns their number.
    pub(crate) fn retry_failed(&mut self) -> Result<usize, StoreError> {
        let rules = self.entered()?.rules;
        self.write(|connection| {
            let reopened = runs::reopen(connection, "state = 'failed' AND counts", [])?;
            rules::apply_all(connection, &rules)?;
            Ok(reopened)
        })
    }
}

/// Ends a case as failed.
pub(super) fn fail(
    connection: &Connection,
    rules: &[Precision],
    case: i64,
    failed: &Attempt,
) -> rusqlite::Result<()> {
    runs::insert(connection, case, failed)?;
    runs::end(connection, case, State::Failed, failed.step)?;
    runs::delete_checkpoints(connection, case, u64::MAX)?;
    rules::apply_to_case(connection, rules, case)
}

/// Stores a completed run. It may be longer than requested if its last checkpoint was beyond that.
fn finish(
    connection: &Connection,
    claim: &Claim,
    finished: &Finished,
    entered: &Entered,
    me: i64,
) -> rusqlite::Result<()> {
    let rows = &finished.rows;
    rows.append(connection, claim, finished.steps)?;
    let end = RunEnd {
        computed: finished.steps,
        jammed: finished.state == State::Jammed,
        counters: finished.counters,
        wall_time_s: finished.wall_time_s,
        cpu_time_s: finished.cpu_time_s,
        resumed: finished.resumed,
        process: me,
        finished_at: process::now(),
        state: Some(finished.last_state.clone()).filter(|state| !state.is_empty()),
    };
    let begins = rows.samples.first().is_some_and(|(step, _)| *step == 0);
    let samples = begins.then_some(rows.samples.as_slice());
    keep(connection, claim.id, &end, samples, &entered.protocol)?;
    rules::apply_to_case(connection, &entered.rules, claim.id)
}
