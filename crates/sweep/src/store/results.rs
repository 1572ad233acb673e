//! Results: what is averaged of a run, and how it is kept; and what is left of a run that failed.

use super::claims::{self, Claim};
use super::digest::{self, Digest, number, whole};
use super::ends::{self, RunEnd};
use super::statements::Statements;
use super::{Store, StoreError, failures, rules, samples};
use crate::case::{Case, State};
use crate::doubt::Doubt;
use crate::model::stresses::{self, STRESSES};
use crate::protocol::Protocol;
use crate::statistics::{Averages, Distribution};
use crate::system::process;
use rusqlite::types::Value;
use rusqlite::{Connection, params_from_iter};
use sd_core::simulation::Counters;
use sd_core::{Params, Sample};
use std::sync::LazyLock;

/// Columns of a result before those of the stresses, and after them.
const BEFORE: &str = "discard_step, samples, viscosity, viscosity_quartile_1, viscosity_median, viscosity_quartile_3, \
     viscosity_stresslet, viscosity_stresslet_quartile_1, viscosity_stresslet_median, viscosity_stresslet_quartile_3, \
     normal_stress_difference, dissipation, contacts_per_sphere, activated_fraction, rolling_fraction, \
     mean_approach_velocity, contacts, activated, rolling, approach, minimum_gap, stages, unconverged_stages, inexact_stages, \
     worst_residual, worst_friction_error, jam_events, jammed_strain, final_strain, wall_time_s, resumed, process, \
     finished_at, jammed_stages, doubts";
const AFTER: &str = "cpu_time_s, viscosity_part_1, viscosity_part_2, viscosity_part_3, viscosity_part_4, \
     viscosity_variance, viscosity_correlation";

/// What the digest of a result covers, of the tables `c` of cases, `p` of points and `r` of results; then the digest.
pub(super) static COVERED: LazyLock<String> = LazyLock::new(|| {
    format!(
        "c.key, p.digest, c.state, c.steps_done, c.samples_digest, r.{}, r.digest",
        columns().replace(", ", ", r.")
    )
});

/// The columns of a result.
pub(super) fn columns() -> String {
    format!(
        "{BEFORE}, {}, {AFTER}",
        stresses::names(STRESSES.iter(), "")
    )
}

/// Writes a result.
static INSERT: LazyLock<String> = LazyLock::new(|| {
    let columns = columns();
    let places = vec!["?"; columns.split(", ").count() + 2].join(", ");
    format!("INSERT OR REPLACE INTO results (case_id, {columns}, digest) VALUES ({places})")
});

/// A case in a store.
pub(super) struct Place<'p> {
    pub(super) id: i64,
    pub(super) key: &'p str,
    /// Digest of its point.
    pub(super) point: i64,
    pub(super) params: &'p Params,
}

impl Place<'_> {
    /// Gives the case the result of its first `steps`, of which some are discarded, and the state that goes with it. `samples` are
    /// those of these steps, `samples_digest` is of all that are kept.
    pub(super) fn put_result(
        &self,
        connection: &Connection,
        (state, steps, discard): (State, u64, u64),
        end: &RunEnd,
        samples: &[(u64, Sample)],
        samples_digest: Option<i64>,
    ) -> rusqlite::Result<()> {
        let counters = end.counters_at(steps, samples);
        let averages = Averages::of(samples, discard);
        let values = self.values((steps, discard), &averages, &counters, samples, end);
        let samples_digest = samples_digest.map_or(Value::Null, Value::Integer);
        let digest = Digest::default()
            .with(&[
                Value::Text(self.key.to_owned()),
                Value::Integer(self.point),
                Value::Text(state.name().to_owned()),
                whole(steps),
                samples_digest,
            ])
            .with(&values)
            .finish();
        let case = Value::Integer(self.id);
        connection.run(
            &INSERT,
            params_from_iter(
                std::iter::once(&case)
                    .chain(&values)
                    .chain([&Value::Integer(digest)]),
            ),
        )?;
        claims::end(connection, self.id, state, steps)
    }

    /// The values of a result, in the order of its columns.
    fn values(
        &self,
        (steps, discard): (u64, u64),
        averages: &Averages,
        counters: &Counters,
        samples: &[(u64, Sample)],
        end: &RunEnd,
    ) -> Vec<Value> {
        let distribution = |d: &Option<Distribution>| {
            [
                number(d.as_ref().map(|d| d.mean)),
                number(d.as_ref().map(|d| d.quartile_1)),
                number(d.as_ref().map(|d| d.median)),
                number(d.as_ref().map(|d| d.quartile_3)),
            ]
        };
        let strain = |steps: u64| number(steps as f64 * self.params.time_step);
        let averaged: Vec<&Sample> = samples
            .iter()
            .filter(|(step, _)| *step >= discard)
            .map(|(_, sample)| sample)
            .collect();
        let doubts = Doubt::write(&Doubt::of(self.params, counters, &averaged));
        let mut values = vec![whole(discard), whole(averages.samples)];
        values.extend(distribution(&averages.viscosity));
        values.extend(distribution(&averages.viscosity_stresslet));
        values.extend([
            number(averages.normal_stress_difference),
            number(averages.dissipation),
            number(averages.contacts_per_sphere(self.params.spheres)),
            number(averages.activated_fraction()),
            number(averages.rolling_fraction()),
            number(averages.mean_approach_velocity()),
            whole(averages.contacts),
            whole(averages.activated),
            whole(averages.rolling),
            number(averages.approach),
            number(counters.minimum_gap),
            whole(counters.stages),
            whole(counters.unconverged_stages),
            whole(counters.inexact_stages),
            number(counters.worst_residual),
            number(counters.worst_friction_error),
            whole(counters.jam_events),
            strain(counters.jammed_steps),
            strain(steps),
            number(end.wall_time_s),
            whole(end.resumed.into()),
            Value::Integer(end.process),
            Value::Integer(end.finished_at),
            whole(counters.jammed_stages),
            Value::Text(doubts),
        ]);
        values.extend(averages.stresses.iter().map(|mean| number(*mean)));
        let steady = averages.steadiness;
        values.push(number(end.cpu_time_s));
        values.extend((0..4).map(|part| number(steady.map(|s| s.parts[part]))));
        values.push(number(steady.map(|s| s.variance)));
        values.push(number(steady.map(|s| s.correlation)));
        values
    }
}

/// Makes sure that the result of a case is what was written.
pub(super) fn check(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    digest::check(
        connection,
        &format!(
            "SELECT {} FROM results r JOIN cases c ON c.id = r.case_id
                 JOIN points p ON p.id = c.point
             WHERE c.id = ?1 AND c.state IN ('done', 'jammed')",
            *COVERED
        ),
        [case],
        "the result of a run",
    )
}

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
    /// What is averaged.
    pub protocol: Protocol,
    /// Seconds of computing.
    pub wall_time_s: f64,
    /// Seconds of CPU.
    pub cpu_time_s: f64,
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
    /// Keeps the results of cases, and their last states, in one transaction. Says for each whether this process still owned it: of
    /// others nothing is kept.
    pub(crate) fn finish(&mut self, runs: &[(&Claim, &Finished)]) -> Result<Vec<bool>, StoreError> {
        let me = self.me();
        self.write(|connection| {
            runs.iter()
                .map(|(claim, finished)| {
                    let is_owned = owns(connection, claim, me)?;
                    if is_owned {
                        finish(connection, claim, finished, me)?;
                    }
                    Ok(is_owned)
                })
                .collect()
        })
    }

    /// Keeps the failure of a case.
    pub(crate) fn fail(&mut self, claim: &Claim, failure: &Failure) -> Result<(), StoreError> {
        let me = self.me();
        let owned = self.write(|connection| {
            if !owns(connection, claim, me)? {
                return Ok(false);
            }
            claims::end(connection, claim.id, State::Failed, failure.step)?;
            // Samples of a run that was computed farther before are those of its result.
            let computed = ends::steps_of(connection, claim.id)?;
            if computed.is_none_or(|steps| steps <= failure.step) {
                samples::write(connection, claim.id, &failure.samples)?;
            }
            let failed = failures::Attempt {
                attempt: 0,
                error: failure.error.clone(),
                step: failure.step,
                strain: failure.step as f64 * claim.case.params.time_step,
                pair: failure.pair.map(|(i, j)| (i as u64, j as u64)),
                gap: failure.gap,
                snapshot: failure.snapshot.clone(),
                process: me,
                failed_at: process::now(),
            };
            failures::insert(connection, claim.id, failed)?;
            claims::drop_checkpoints(connection, claim.id)?;
            rules::apply_to_case(connection, claim.id)?;
            Ok(true)
        })?;
        owned.then_some(()).ok_or_else(|| claim.lost())
    }

    /// Makes all failed cases of the grid pending again. Returns how many.
    pub(crate) fn retry_failed(&mut self) -> Result<usize, StoreError> {
        self.write(|connection| {
            let failed: Vec<(i64, String, u64)> = connection.all(
                "SELECT c.id, c.key, coalesce(e.steps, 0) FROM cases c LEFT
                     JOIN ends e ON e.case_id = c.id
                     WHERE c.state = 'failed' AND c.counts",
                [],
                |row| Ok((row.get(0)?, row.get(1)?, row.get(2).map(super::count)?)),
            )?;
            for (case, key, steps) in failed {
                samples::cut(connection, case, steps)?;
                tracing::info!(case = key, "retried");
            }
            let reopened = failures::reopen(connection, "counts")?;
            rules::apply_all(connection)?;
            Ok(reopened)
        })
    }
}

/// Whether this process still owns a case that it computes.
fn owns(connection: &Connection, claim: &Claim, me: i64) -> rusqlite::Result<bool> {
    connection.has(
        "SELECT 1 FROM cases WHERE id = ?1 AND owner = ?2 AND state = 'running'",
        [claim.id, me],
    )
}

/// Keeps a run that came to its end: the averages are of the samples at hand, unless each point has its own strain to discard or more is
/// computed than requested.
fn finish(
    connection: &Connection,
    claim: &Claim,
    finished: &Finished,
    me: i64,
) -> rusqlite::Result<()> {
    let Case { params, .. } = &claim.case;
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
    end.write(connection, claim.id, &claim.key)?;
    let samples_digest = samples::write(connection, claim.id, &finished.samples)?;
    claims::drop_checkpoints(connection, claim.id)?;
    let place = Place {
        id: claim.id,
        key: &claim.key,
        point: claim.point.1,
        params,
    };
    let steps = finished.protocol.with_time_step(params.time_step);
    let discard = steps.discard_steps();
    place.put_result(
        connection,
        (finished.state, finished.steps, discard.unwrap_or(0)),
        &end,
        &finished.samples,
        samples_digest,
    )?;
    // A run whose last checkpoint lies beyond what is requested now has more samples than count.
    if discard.is_none() || finished.steps > claim.case.steps {
        ends::settle(connection, claim.id, &finished.protocol)?;
    }
    rules::apply_to_case(connection, claim.id)
}
