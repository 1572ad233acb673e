//! How far runs were computed, and what of it is the result the campaign requests.
//!
//! A run is computed once: its beginning is the run of less strain, and from its last state it goes on to more.

use super::digest::{Sealed, number, whole};
use super::results::Place;
use super::statements::Statements;
use super::{Checkpoint, Damage, Store, StoreError, claims, count, rules, samples};
use crate::axes::identity;
use crate::case::State;
use crate::protocol::{Discard, Protocol};
use crate::statistics::mser_5;
use crate::system::process;
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params};
use sd_core::simulation::Counters;
use sd_core::{Params, Sample};
use std::collections::HashMap;

/// The ends of runs.
pub(super) const SEALED: Sealed = Sealed {
    table: "ends",
    columns: "steps, jammed, minimum_gap, stages, unconverged_stages, worst_residual, worst_friction_error, jam_events, \
              jammed_steps, jammed_stages, wall_time_s, cpu_time_s, resumed, process, finished_at, state, inexact_stages",
    with_key: true,
    words: "the end of a run",
};

/// How far a run was computed.
#[derive(Debug, Clone)]
pub(super) struct RunEnd {
    pub(super) steps: u64,
    pub(super) jammed: bool,
    /// What all these steps met.
    pub(super) counters: Counters,
    pub(super) wall_time_s: f64,
    pub(super) cpu_time_s: f64,
    /// Times it went on from a checkpoint.
    pub(super) resumed: u32,
    pub(super) process: i64,
    pub(super) finished_at: i64,
    /// A checkpoint of the last state, without samples.
    pub(super) state: Option<Vec<u8>>,
}

impl RunEnd {
    /// Keeps it in place of any other of the case with this key.
    pub(super) fn write(
        &self,
        connection: &Connection,
        case: i64,
        key: &str,
    ) -> rusqlite::Result<()> {
        let counters = &self.counters;
        let values = [
            whole(self.steps),
            whole(self.jammed.into()),
            number(counters.minimum_gap),
            whole(counters.stages),
            whole(counters.unconverged_stages),
            number(counters.worst_residual),
            number(counters.worst_friction_error),
            whole(counters.jam_events),
            whole(counters.jammed_steps),
            whole(counters.jammed_stages),
            number(self.wall_time_s),
            number(self.cpu_time_s),
            whole(self.resumed.into()),
            Value::Integer(self.process),
            Value::Integer(self.finished_at),
            self.state.clone().map_or(Value::Null, Value::Blob),
            whole(counters.inexact_stages),
        ];
        SEALED.put(
            connection,
            Some(key),
            &values,
            &[("case_id", Value::Integer(case))],
        )
    }

    /// The end of the run of a case, if it was computed to one.
    ///
    /// # Errors
    /// Those of the query, and [`Altered`](super::digest::Altered) if it is not what was written.
    pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Option<Self>> {
        SEALED.check(connection, "t.case_id = ?1", [case])?;
        let columns = SEALED.columns;
        connection.find(
            &format!("SELECT {columns} FROM ends WHERE case_id = ?1"),
            [case],
            Self::read,
        )
    }

    fn read(row: &Row<'_>) -> rusqlite::Result<Self> {
        let number = |column: usize| -> rusqlite::Result<f64> {
            Ok(row.get::<_, Option<f64>>(column)?.unwrap_or(f64::NAN))
        };
        let whole = |column: usize| row.get(column).map(count);
        Ok(Self {
            steps: whole(0)?,
            jammed: row.get(1)?,
            counters: Counters {
                minimum_gap: number(2)?,
                stages: whole(3)?,
                unconverged_stages: whole(4)?,
                worst_residual: number(5)?,
                worst_friction_error: number(6)?,
                jam_events: whole(7)?,
                jammed_steps: whole(8)?,
                jammed_stages: whole(9)?,
                inexact_stages: whole(16)?,
                ..Counters::default()
            },
            wall_time_s: number(10)?,
            cpu_time_s: number(11)?,
            resumed: row.get(12)?,
            process: row.get(13)?,
            finished_at: row.get(14)?,
            state: row.get(15)?,
        })
    }

    /// Counters of the first steps of it: of a run cut short those of its last sample.
    pub(super) fn counters_at(&self, steps: u64, samples: &[(u64, Sample)]) -> Counters {
        match samples.last() {
            Some((_, last)) if steps < self.steps => last.counters,
            _ => self.counters,
        }
    }
}

/// A case that was computed to an end, and what is requested of it.
struct Computed {
    id: i64,
    key: String,
    /// Digest of its point.
    point: i64,
    params: Params,
    requested: u64,
    state: String,
    /// Steps of its result now.
    steps_done: u64,
    /// Discarded steps of its result now.
    discarded: Option<u64>,
    steps: u64,
    jammed: bool,
    /// Whether it can go on from there.
    continues: bool,
}

/// What becomes of a case.
enum Verdict {
    /// A result of so many steps.
    Result(State, u64),
    /// More is requested than was computed.
    Short,
}

impl Computed {
    /// Those of a condition on `c`.
    fn of(
        connection: &Connection,
        condition: &str,
        parameters: impl rusqlite::Params,
    ) -> rusqlite::Result<Vec<Self>> {
        connection.all(
            &format!(
                "SELECT c.id, c.key, p.digest, p.params, c.steps, c.state, c.steps_done,
                     r.discard_step, e.steps,
                     e.jammed, e.state IS NOT NULL
                 FROM ends e JOIN cases c ON c.id = e.case_id JOIN points p ON p.id = c.point
                 LEFT JOIN results r ON r.case_id = c.id WHERE {condition}"
            ),
            parameters,
            |row| {
                Ok(Self {
                    id: row.get(0)?,
                    key: row.get(1)?,
                    point: row.get(2)?,
                    params: super::points::params(row, 3)?,
                    requested: count(row.get(4)?),
                    state: row.get(5)?,
                    steps_done: count(row.get(6)?),
                    discarded: row.get::<_, Option<i64>>(7)?.map(count),
                    steps: count(row.get(8)?),
                    jammed: row.get(9)?,
                    continues: row.get(10)?,
                })
            },
        )
    }

    fn verdict(&self) -> Verdict {
        if self.jammed && self.requested >= self.steps {
            Verdict::Result(State::Jammed, self.steps)
        } else if self.steps >= self.requested {
            Verdict::Result(State::Done, self.requested)
        } else {
            Verdict::Short
        }
    }

    /// Gives it the state and the result that is requested, where every run discards the same strain.
    fn settle_alone(&self, connection: &Connection, protocol: &Protocol) -> rusqlite::Result<()> {
        let steps = protocol.with_time_step(self.params.time_step);
        self.settle(connection, steps.discard_steps().unwrap_or(0))
    }

    /// Gives it the state and the result that is requested.
    fn settle(&self, connection: &Connection, discard: u64) -> rusqlite::Result<()> {
        let (state, steps) = match self.verdict() {
            Verdict::Result(state, steps) => (state, steps),
            Verdict::Short if matches!(self.state.as_str(), "done" | "jammed") => {
                return self.reopen(connection);
            }
            // It is pending already, or failed on its way on.
            Verdict::Short => return Ok(()),
        };
        if self.state == state.name() && self.steps_done == steps && self.discarded == Some(discard)
        {
            return Ok(());
        }
        let Some(end) = RunEnd::of(connection, self.id)? else {
            return Ok(());
        };
        let mut samples = samples::of(connection, self.id)?;
        samples.retain(|(step, _)| *step < steps);
        let samples_digest: Option<i64> = connection.one(
            "SELECT samples_digest FROM cases WHERE id = ?1",
            [self.id],
            |row| row.get(0),
        )?;
        Place {
            id: self.id,
            key: &self.key,
            point: self.point,
            params: &self.params,
        }
        .put_result(
            connection,
            (state, steps, discard),
            &end,
            &samples,
            samples_digest,
        )
    }

    /// Lets it go on, as more is requested than was computed: from its last state, or where that was not kept from the beginning.
    fn reopen(&self, connection: &Connection) -> rusqlite::Result<()> {
        let end = if self.continues { self.steps } else { 0 };
        connection.execute(
            "UPDATE cases SET state = 'pending', deaths = 0, changed_at = ?3, steps_done = max(?2,
                 coalesce((SELECT max(steps) FROM checkpoints WHERE case_id = ?1), 0)) WHERE id = ?1",
            params![self.id, super::integer(end), process::now()],
        )?;
        super::failures::mark_retried(connection, &format!("id = {}", self.id))?;
        claims::free_where(connection, "id = ?2", &[&self.id]).map(|_| ())
    }
}

/// Gives every case of the grid that was computed to an end the state and the result the protocol requests. Cases under way
/// are left alone.
pub(super) fn settle_all(connection: &Connection, protocol: &Protocol) -> rusqlite::Result<()> {
    let computed = Computed::of(
        connection,
        "c.position IS NOT NULL AND c.state != 'running'",
        [],
    )?;
    if protocol.discard == Discard::Auto {
        let mut points: HashMap<_, Vec<Computed>> = HashMap::new();
        for case in computed {
            points.entry(identity(&case.params)).or_default().push(case);
        }
        return points
            .values()
            .try_for_each(|point| settle_point(connection, point));
    }
    computed
        .iter()
        .try_for_each(|case| case.settle_alone(connection, protocol))
}

/// The same for one case, and where the strain discarded is that of its point, for all of the point.
pub(super) fn settle(
    connection: &Connection,
    case: i64,
    protocol: &Protocol,
) -> rusqlite::Result<()> {
    if protocol.discard == Discard::Auto {
        let of_point = "c.point = (SELECT point FROM cases WHERE id = ?1)
             AND (c.id = ?1 OR c.position IS NOT NULL AND c.state != 'running')";
        return settle_point(connection, &Computed::of(connection, of_point, [case])?);
    }
    settle_one(connection, case, protocol)
}

/// The same for one case by itself; where the strain discarded is that of its point, nothing is left out yet.
pub(super) fn settle_one(
    connection: &Connection,
    case: i64,
    protocol: &Protocol,
) -> rusqlite::Result<()> {
    Computed::of(connection, "c.id = ?1", [case])?
        .iter()
        .try_for_each(|case| case.settle_alone(connection, protocol))
}

/// Settles the runs of a point, leaving out as much as MSER-5 picks from the mean over those that are done. Where a precision
/// decides on the seeds, these are those of the first batch: so what is left out does not change while seeds are still added.
fn settle_point(connection: &Connection, point: &[Computed]) -> rusqlite::Result<()> {
    let Some(first) = point.first() else {
        return Ok(());
    };
    let batch = rules::first_batch(connection, first.id)?;
    let mut total: Vec<f64> = Vec::new();
    let mut steps: Vec<u64> = Vec::new();
    for case in point {
        let Verdict::Result(State::Done, end) = case.verdict() else {
            continue;
        };
        if batch
            .as_ref()
            .is_some_and(|batch| !batch.contains(&case.id))
        {
            continue;
        }
        let mut samples = samples::of(connection, case.id)?;
        samples.retain(|(step, _)| *step < end);
        if steps.is_empty() {
            steps = samples.iter().map(|(step, _)| *step).collect();
            total = vec![0.0; steps.len()];
        }
        for (total, (_, sample)) in total.iter_mut().zip(&samples) {
            *total += sample.viscosity;
        }
    }
    let left_out = mser_5(&total).map_or(0, |(samples, _)| samples);
    let discard = steps.get(left_out).copied().unwrap_or(0);
    point
        .iter()
        .try_for_each(|case| case.settle(connection, discard))
}

/// Steps to which a case was computed, if it was computed to an end.
pub(super) fn steps_of(connection: &Connection, case: i64) -> rusqlite::Result<Option<u64>> {
    connection
        .find("SELECT steps FROM ends WHERE case_id = ?1", [case], |row| {
            row.get(0)
        })
        .map(|steps| steps.map(count))
}

/// Forgets the last state of a run, which proved to be of no use.
pub(super) fn drop_state(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    if let Some(end) = RunEnd::of(connection, case)? {
        let key: String =
            connection.query_row("SELECT key FROM cases WHERE id = ?1", [case], |row| {
                row.get(0)
            })?;
        RunEnd { state: None, ..end }.write(connection, case, &key)?;
    }
    Ok(())
}

/// The last state of a run that was computed to an end, with all its samples, so that it can go on.
pub(super) fn end_to_go_on_from(
    connection: &Connection,
    case: i64,
) -> rusqlite::Result<Option<Result<Checkpoint, Damage>>> {
    let Some(state) = RunEnd::of(connection, case)?.and_then(|end| end.state) else {
        return Ok(None);
    };
    let mut end = match Checkpoint::decode(&state) {
        Ok(end) => end,
        Err(damage) => return Ok(Some(Err(damage))),
    };
    end.samples = samples::of(connection, case)?;
    end.samples.retain(|(step, _)| *step < end.snapshot.steps);
    Ok(Some(Ok(end)))
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
        let states = || {
            SEALED.check(&self.connection, "c.counts AND c.state = 'done'", [])?;
            self.connection.all("SELECT p.params, c.seed, e.state FROM cases c
                 JOIN points p ON p.id = c.point
                     JOIN ends e ON e.case_id = c.id
                     WHERE c.counts AND c.state = 'done' AND e.state IS NOT NULL ORDER BY c.position", [], |row| {
                    Ok(LastState {
                        params: super::points::params(row, 0)?,
                        seed: count(row.get(1)?),
                        state: row.get(2)?,
                    })
                })
        };
        self.read(states())
    }
}
