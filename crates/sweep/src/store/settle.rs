//! The result of a run that the campaign requests.
//!
//! A run is computed once: its beginning is the run of less strain, and its last state continues to
//! more.

use super::claims::{Claim, NewRows, owns};
use super::digest::whole;
use super::ends::{self, RunEnd};
use super::failures::{self, Attempt};
use super::results::{self, Covered};
use super::statements::Statements;
use super::{Store, StoreError, checkpoints, frames, rules, samples, states};
use crate::measure::mser_5;
use crate::model::campaign::Campaign;
use crate::model::case::{Case, State};
use crate::model::protocol::{Discard, Protocol};
use crate::system::process;
use rusqlite::Connection;
use sd_core::simulation::Counters;
use sd_core::{Params, Sample};
use std::collections::HashMap;

/// The new end of a run, and its samples if they are all at hand.
type NewEnd<'r> = (&'r RunEnd, Option<&'r [(u64, Sample)]>);

/// A completed case, and the result requested.
struct Computed {
    case: Covered,
    /// Number of its point.
    point: i64,
    requested: u64,
    state: String,
    /// Steps of its result now.
    steps_done: u64,
    /// Discarded steps of its result now.
    discarded: Option<u64>,
    steps: u64,
    jammed: bool,
}

impl Computed {
    /// The cases that meet a condition on `c`.
    fn of(
        connection: &Connection,
        condition: &str,
        parameters: impl rusqlite::Params,
    ) -> rusqlite::Result<Vec<Self>> {
        connection.all(
            &format!(
                "SELECT c.id, c.key, c.point, p.digest, p.params, c.samples_digest, c.steps, c.state, c.steps_done,
                     r.discard_step, e.steps, e.jammed
                 FROM ends e JOIN cases c ON c.id = e.case_id JOIN points p ON p.id = c.point
                 LEFT JOIN results r ON r.case_id = c.id WHERE {condition}"
            ),
            parameters,
            |row| {
                let case = Covered {
                    id: row.get(0)?,
                    key: row.get(1)?,
                    point: row.get(3)?,
                    params: super::schema::params(row, 4)?,
                    samples: row.get(5)?,
                };
                Ok(Self {
                    case,
                    point: row.get(2)?,
                    requested: row.get(6)?,
                    state: row.get(7)?,
                    steps_done: row.get(8)?,
                    discarded: row.get(9)?,
                    steps: row.get(10)?,
                    jammed: row.get(11)?,
                })
            },
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
        discard: u64,
        run: Option<NewEnd<'_>>,
    ) -> rusqlite::Result<()> {
        let id = self.case.id;
        let Some((state, steps)) = self.outcome() else {
            // Others are pending already, or failed in a continuation.
            if matches!(self.state.as_str(), "done" | "jammed") {
                states::reopen(connection, "id = ?2", &[id])?;
            }
            return Ok(());
        };
        let known = (self.state.as_str(), self.steps_done, self.discarded);
        if run.is_none() && known == (state.name(), steps, Some(discard)) {
            return Ok(());
        }
        let result = (state, steps, discard);
        if let Some((end, samples)) = run {
            results::put(connection, &self.case, result, end, samples)?;
        } else {
            let Some(end) = RunEnd::of(connection, id)? else {
                return Ok(());
            };
            results::put(connection, &self.case, result, &end, None)?;
        }
        states::end(connection, id, state, steps)
    }

    /// Settles it if every run discards the same strain; otherwise nothing is discarded yet.
    fn settle_alone(
        &self,
        connection: &Connection,
        protocol: &Protocol,
        run: Option<NewEnd<'_>>,
    ) -> rusqlite::Result<()> {
        let steps = protocol.with_time_step(self.case.params.time_step);
        self.settle(connection, steps.discard_steps().unwrap_or(0), run)
    }
}

/// Stores the end of a run whose samples are in the store, and sets the state and the result that
/// the protocol requests. The samples are read again unless they are given. For a discarded strain
/// chosen by point, see [`settle_point_of`].
pub(super) fn keep(
    connection: &Connection,
    (case, key): (i64, &str),
    end: &RunEnd,
    samples: Option<&[(u64, Sample)]>,
    protocol: &Protocol,
) -> rusqlite::Result<()> {
    end.write(connection, case, key)?;
    checkpoints::drop_until(connection, case, end.steps)?;
    Computed::of(connection, "c.id = ?1", [case])?
        .iter()
        .try_for_each(|case| case.settle_alone(connection, protocol, Some((end, samples))))
}

/// Continues new runs with segments from runs that were computed without the last segment.
pub(super) fn continue_shorter_runs(
    connection: &Connection,
    campaign: &Campaign,
) -> rusqlite::Result<()> {
    each_shorter_run(connection, campaign, |(id, key), of, end| {
        samples::copy((connection, of), (connection, id), end.steps)?;
        if let Some(kept) = frames::of(connection, of)? {
            frames::take(connection, (id, key), kept)?;
        }
        keep(connection, (id, key), end, None, &campaign.protocol)?;
        states::reopen(connection, "id = ?2", &[id]).map(drop)
    })
}

/// Counts the steps that new runs in segments would reuse as done, in a store opened for reading.
pub(super) fn count_shorter_runs(
    connection: &Connection,
    campaign: &Campaign,
) -> rusqlite::Result<()> {
    each_shorter_run(connection, campaign, |(id, _), _, end| {
        let steps = end.state.as_ref().map_or(0, |_| end.steps);
        let done = "UPDATE cases SET steps_done = ?2 WHERE id = ?1";
        connection.run(done, (id, whole(steps)))
    })
}

/// Calls `take` for every new run in segments whose beginning was computed, with the run, its key,
/// and the case and end of that beginning.
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
             AND NOT EXISTS (SELECT 1 FROM ends WHERE case_id = cases.id)";
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
                && end.steps <= most
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
    let of_grid = "c.position IS NOT NULL AND c.state != 'running'";
    let computed = Computed::of(connection, of_grid, [])?;
    if protocol.discard != Discard::Auto {
        return computed
            .iter()
            .try_for_each(|case| case.settle_alone(connection, protocol, None));
    }
    let mut points: HashMap<i64, Vec<Computed>> = HashMap::new();
    for case in computed {
        points.entry(case.point).or_default().push(case);
    }
    let mut points = points.values();
    points.try_for_each(|point| settle_point(connection, point))
}

/// Updates the results of the point of a case, if its runs determine the discarded strain.
pub(super) fn settle_point_of(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    let of_point = "c.point = (SELECT point FROM cases WHERE id = ?1)
         AND (c.id = ?1 OR c.position IS NOT NULL AND c.state != 'running')";
    settle_point(connection, &Computed::of(connection, of_point, [case])?)
}

/// Updates the results of a point with the discarded strain that MSER-5 chooses from the mean over
/// done runs. Under a requested precision only the first batch is used, so that the discarded
/// strain does not change while seeds are added.
fn settle_point(connection: &Connection, point: &[Computed]) -> rusqlite::Result<()> {
    let Some(first) = point.first() else {
        return Ok(());
    };
    let batch = rules::first_batch(connection, first.case.id)?;
    let mut total: Vec<f64> = Vec::new();
    let mut steps: Vec<u64> = Vec::new();
    for case in point {
        let Some((State::Done, end)) = case.outcome() else {
            continue;
        };
        if batch
            .as_ref()
            .is_some_and(|batch| !batch.contains(&case.case.id))
        {
            continue;
        }
        let is_first = steps.is_empty();
        let mut place = 0;
        samples::each(connection, case.case.id, |step, sample| {
            if is_first && step < end {
                steps.push(step);
                total.push(0.0);
            }
            if let Some(total) = total.get_mut(place).filter(|_| step < end) {
                *total += sample.viscosity;
            }
            place += 1;
            Ok(())
        })?;
    }
    let left_out = mser_5(&total).map_or(0, |(samples, _)| samples);
    let discard = steps.get(left_out).copied().unwrap_or(0);
    point
        .iter()
        .try_for_each(|case| case.settle(connection, discard, None))
}

/// The last state of a finished run.
pub(crate) struct LastState {
    pub(crate) params: Params,
    pub(crate) seed: u64,
    /// A checkpoint without samples.
    pub(crate) state: Vec<u8>,
}

impl Store {
    /// The last states of all done runs of the grid that have one, in the order of the campaign.
    pub(crate) fn last_states(&self) -> Result<Vec<LastState>, StoreError> {
        self.read(ends::sealed().check(&self.connection, "c.counts AND c.state = 'done'", []))?;
        self.rows(
            "SELECT p.params, c.seed, e.state FROM cases c JOIN points p ON p.id = c.point JOIN ends e ON e.case_id = c.id
             WHERE c.counts AND c.state = 'done' AND e.state IS NOT NULL ORDER BY c.position",
            [],
            |row| {
                Ok(LastState {
                    params: super::schema::params(row, 0)?,
                    seed: row.get(1)?,
                    state: row.get(2)?,
                })
            },
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
    /// A checkpoint of its last state, without samples, from which a longer run continues.
    pub last_state: Vec<u8>,
}

impl Store {
    /// Stores the results of cases and their last states in one transaction. Returns for each
    /// whether this process still owned it; otherwise nothing is stored.
    pub(crate) fn finish(&mut self, runs: &[(&Claim, &Finished)]) -> Result<Vec<bool>, StoreError> {
        let (me, protocol) = (self.me(), self.protocol()?);
        self.write(|connection| {
            runs.iter()
                .map(|(claim, finished)| {
                    let is_owned = owns(connection, claim, me)?;
                    if is_owned {
                        finish(connection, claim, finished, &protocol, me)?;
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
        let me = self.me();
        let owned = self.write(|connection| {
            if !owns(connection, claim, me)? {
                return Ok(false);
            }
            rows.append(connection, claim, failure.step)?;
            fail(connection, claim.id, failure.by(me))?;
            Ok(true)
        })?;
        owned.then_some(()).ok_or_else(|| claim.lost())
    }

    /// Resets all failed cases of the grid to pending. Returns their number.
    pub(crate) fn retry_failed(&mut self) -> Result<usize, StoreError> {
        self.write(|connection| {
            let reopened = states::reopen(connection, "state = 'failed' AND counts", &[])?;
            rules::apply_all(connection)?;
            Ok(reopened)
        })
    }
}

/// Ends a case as failed.
pub(super) fn fail(connection: &Connection, case: i64, failed: Attempt) -> rusqlite::Result<()> {
    states::end(connection, case, State::Failed, failed.step)?;
    failures::insert(connection, case, failed)?;
    checkpoints::drop_all(connection, case)?;
    rules::apply_to_case(connection, case)
}

/// Stores a completed run. It may be longer than requested if its last checkpoint was beyond that.
fn finish(
    connection: &Connection,
    claim: &Claim,
    finished: &Finished,
    protocol: &Protocol,
    me: i64,
) -> rusqlite::Result<()> {
    let rows = &finished.rows;
    rows.append(connection, claim, finished.steps)?;
    let end = RunEnd {
        steps: finished.steps,
        jammed: finished.state == State::Jammed,
        counters: finished.counters,
        wall_time_s: finished.wall_time_s,
        cpu_time_s: finished.cpu_time_s,
        resumed: finished.resumed,
        process: me,
        finished_at: process::now(),
        state: Some(finished.last_state.clone()),
    };
    let case = (claim.id, claim.key.as_str());
    let begins = rows.samples.first().is_some_and(|(step, _)| *step == 0);
    let samples = begins.then_some(rows.samples.as_slice());
    keep(connection, case, &end, samples, protocol)?;
    if protocol.discard == Discard::Auto {
        settle_point_of(connection, claim.id)?;
    }
    rules::apply_to_case(connection, claim.id)
}
