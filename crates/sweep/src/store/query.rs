//! What `status` and `report` ask the store.

use super::digest::{Altered, Digest};
use super::request;
use super::results::COVERED;
use super::schema::axis_cells;
use super::{Store, StoreError, campaign, count, failures, rules};
use crate::case::{CaseKey, State};
use crate::doubt::Doubt;
use crate::process;
use crate::protocol::Protocol;
use crate::statistics::Steadiness;
use crate::stresses::{self, COUNT, STRESSES};
use rusqlite::types::{Type, Value, ValueRef};
use rusqlite::{Connection, OptionalExtension, Row};
use sd_core::Params;
use serde::Serialize;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Cases of the grid by state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Finished.
    pub done: u64,
    /// Ended as jammed layers.
    pub jammed: u64,
    /// Ended with an error.
    pub failed: u64,
    /// Owned by a process.
    pub running: u64,
    /// Not begun or stopped.
    pub pending: u64,
}

impl Counts {
    /// All cases of the grid.
    pub fn total(&self) -> u64 {
        self.done + self.jammed + self.failed + self.running + self.pending
    }
}

/// How far the grid is, in estimated seconds of CPU.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Its cases by state.
    pub counts: Counts,
    /// All of it.
    pub total: f64,
    /// What is done of it: finished cases, and others up to their last checkpoint, but for those this process has under way.
    pub done: f64,
    /// Failed cases, which are not computed again by themselves.
    pub given_up: f64,
    /// What is left of cases that are pending or under way.
    pub left: f64,
    /// Cases under way whose process was heard of lately.
    alive: u64,
}

/// How far the runs of one point are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PointWork {
    /// Place of the first of them in the campaign.
    pub(crate) position: usize,
    /// All that count.
    pub(crate) runs: f64,
    /// Those that have not ended.
    pub(crate) open: f64,
    /// What is done of these, in runs.
    pub(crate) done: f64,
}

/// Finished runs looked at to tell how fast a machine is.
const SAMPLED: i64 = 1000;

/// One case with its result, if it has one.
#[derive(Debug, Clone)]
pub struct PointRun {
    /// Its place in the campaign file, from 0.
    pub position: u64,
    /// Its key.
    pub key: String,
    /// Its parameters.
    pub params: Arc<Params>,
    /// Its seed.
    pub seed: u64,
    /// Its state.
    pub state: State,
    /// Mean viscosity in full.
    pub viscosity: Option<f64>,
    /// Its median.
    pub viscosity_median: Option<f64>,
    /// Mean viscosity from the stresslets alone.
    pub viscosity_stresslet: Option<f64>,
    /// Mean first normal stress difference.
    pub normal_stress_difference: Option<f64>,
    /// Means of the components and parts of the stress, in the order of [`STRESSES`].
    pub(crate) stresses: [Option<f64>; COUNT],
    /// Samples averaged.
    pub samples: u64,
    /// Sum of contacts over them.
    pub contacts: u64,
    /// Sum of activated contacts.
    pub activated: u64,
    /// Sum of rolling contacts.
    pub rolling: u64,
    /// Sum of approach velocities.
    pub approach: f64,
    /// Smallest gap of the run.
    pub minimum_gap: Option<f64>,
    /// Right-hand sides with contacts.
    pub stages: u64,
    /// Of these, unconverged ones.
    pub unconverged_stages: u64,
    /// Of these, with friction off by more than 1e-3 of the largest force.
    pub inexact_stages: u64,
    /// Why its numbers are doubtful, if they are.
    pub doubts: Vec<Doubt>,
    /// Contact problems without a solution.
    pub jammed_stages: u64,
    /// Worst residual of the run.
    pub worst_residual: Option<f64>,
    /// Seconds of computing.
    pub wall_time_s: Option<f64>,
    /// Seconds of CPU.
    pub cpu_time_s: Option<f64>,
    /// Strain discarded.
    pub discard: Option<f64>,
    /// Strain from one sample to the next.
    pub sample_every: f64,
    /// What it tells about steadiness.
    pub steadiness: Option<Steadiness>,
}

/// One failure as it is listed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FailureLine {
    /// Key of the case.
    pub key: String,
    /// Its seed.
    pub seed: u64,
    /// Its parameters.
    pub params: Params,
    /// Its last error.
    pub error: String,
    /// The step that failed.
    pub step: u64,
    /// Strain at its start.
    pub strain: f64,
    /// Which attempt it was, from 1.
    pub attempt: u64,
    /// Pair of spheres it failed at, if it is known.
    pub pair: Option<(u64, u64)>,
    /// Gap of that pair.
    pub gap: Option<f64>,
}

/// The state of a failed case before the step that failed.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// Key of the case.
    pub key: String,
    /// Its last error.
    pub error: String,
    /// The input of `sweep solve`; `None` if it failed before it had a state.
    pub snapshot: Option<String>,
}

/// One process as it is listed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProcessLine {
    /// Its host.
    pub host: String,
    /// Its process id.
    pub pid: u32,
    /// Seconds since it was last heard of.
    pub silent_s: f64,
    /// Cases it owns.
    pub running: u64,
}

impl PointRun {
    /// Whether it is finished, and broke a rule.
    pub fn is_doubtful(&self) -> bool {
        self.state == State::Done && !self.doubts.is_empty()
    }

    /// Whether it is finished, and counts in averages.
    pub fn is_sound(&self) -> bool {
        self.state == State::Done && self.doubts.is_empty()
    }
}

impl Store {
    /// Cases of the grid by state.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn counts(&self) -> Result<Counts, StoreError> {
        self.work().map(|work| work.counts)
    }

    /// How far the grid is: one look at every case.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn work(&self) -> Result<Work, StoreError> {
        let heard_since = process::now()
            - i64::try_from(process::HEARTBEAT_LIMIT.as_millis()).unwrap_or(i64::MAX);
        let read = || {
            let alive: HashSet<i64> = self
                .connection
                .prepare_cached(
                    "SELECT id FROM processes WHERE ended_at IS NULL AND heartbeat >= ?1",
                )?
                .query_map([heard_since], |row| row.get(0))?
                .collect::<Result<_, _>>()?;
            // Summed up here: SQLite would sort all cases by their states first.
            let mut query = self.connection.prepare_cached(
                "SELECT state, cost, cost * min(1.0 * steps_done / steps, 1.0), owner FROM cases NOT INDEXED WHERE counts",
            )?;
            let mut rows = query.query([])?;
            let mut work = Work::default();
            while let Some(row) = rows.next()? {
                let state = state(row.get_ref(0)?)?;
                let (cost, done): (f64, f64) = (row.get(1)?, row.get(2)?);
                let owner: Option<i64> = row.get(3)?;
                work.total += cost;
                match state {
                    State::Done | State::Jammed => work.done += cost,
                    State::Failed => work.given_up += cost,
                    State::Pending | State::Running => {
                        work.left += cost - done;
                        if owner != Some(self.me()) {
                            work.done += done;
                        }
                    }
                }
                work.alive += u64::from(owner.is_some_and(|owner| alive.contains(&owner)));
                *match state {
                    State::Done => &mut work.counts.done,
                    State::Jammed => &mut work.counts.jammed,
                    State::Failed => &mut work.counts.failed,
                    State::Running => &mut work.counts.running,
                    State::Pending => &mut work.counts.pending,
                } += 1;
            }
            Ok(work)
        };
        self.read(read())
    }

    /// Seconds of wall time and of CPU that finished runs took, over those they were estimated to take; `None` where there is none.
    fn pace(&self) -> Result<Option<(f64, f64)>, StoreError> {
        let mut sums = (0.0, 0.0, 0.0);
        self.sampled_runs(
            "SELECT r.case_id, r.wall_time_s, r.cpu_time_s, c.cost * e.steps / c.steps FROM results r
             JOIN cases c ON c.id = r.case_id JOIN ends e ON e.case_id = c.id",
            |row| {
                sums.0 += row.get::<_, f64>(1)?;
                sums.1 += row.get::<_, f64>(2)?;
                sums.2 += row.get::<_, f64>(3)?;
                Ok(())
            },
        )?;
        Ok((sums.2 > 0.0).then(|| (sums.0 / sums.2, sums.1 / sums.2)))
    }

    /// Calls `each` with rows about finished runs, evenly spread over the store.
    fn sampled_runs(
        &self,
        query: &str,
        mut each: impl FnMut(&Row<'_>) -> Result<(), rusqlite::Error>,
    ) -> Result<(), StoreError> {
        let mut read = || {
            let last: Option<i64> =
                self.connection
                    .query_row("SELECT max(case_id) FROM results", [], |row| row.get(0))?;
            let stride = (last.unwrap_or(0) / SAMPLED).max(1);
            let mut query = self.connection.prepare_cached(&format!(
                "{query} WHERE r.case_id >= ?1 ORDER BY r.case_id LIMIT 1"
            ))?;
            let mut from = 0;
            while let Some(found) = query
                .query_row([from], |row| each(row).and_then(|()| row.get::<_, i64>(0)))
                .optional()?
            {
                from = found + stride;
            }
            Ok(())
        };
        self.read(read())
    }

    /// Estimated seconds of CPU that open cases still take, at the pace of those that are finished.
    pub(crate) fn remaining_cpu_s(&self, work: &Work) -> Result<f64, StoreError> {
        Ok(work.left * self.pace()?.map_or(1.0, |(_, cpu)| cpu))
    }

    /// Seconds until the cases at work and those pending are done, judged by what finished ones took; `None` if nobody
    /// works or nothing is finished yet.
    pub(crate) fn time_left(&self, work: &Work) -> Result<Option<f64>, StoreError> {
        if work.alive == 0 {
            return Ok(None);
        }
        Ok(self
            .pace()?
            .map(|(wall, _)| work.left * wall / work.alive as f64))
    }

    /// How far the runs of each point are, in the order of the campaign.
    ///
    /// # Errors
    /// Trouble with the file.
    pub(crate) fn point_work(&self) -> Result<Vec<PointWork>, StoreError> {
        self.rows(
                "SELECT min(position), count(*), total(state IN ('pending', 'running')),
                     total(CASE WHEN state IN ('pending', 'running') THEN min(1.0 * steps_done / steps, 1.0) END)
                 FROM cases WHERE counts GROUP BY point ORDER BY 1", [], |row| {
                        Ok(PointWork {
                            position: usize::try_from(count(row.get(0)?)).unwrap_or(usize::MAX),
                            runs: count(row.get(1)?) as f64,
                            open: row.get(2)?,
                            done: row.get(3)?,
                        })
                    })
    }

    /// Parameters, steps and seconds of CPU of runs that this build has computed on this machine, a thousand or so.
    ///
    /// # Errors
    /// Trouble with the file, or an entry that cannot be read.
    pub(crate) fn measured_runs(&self) -> Result<Vec<(Params, u64, f64)>, StoreError> {
        let here = (process::Identity::of_this_process().host, process::build());
        let mut runs = Vec::new();
        self.sampled_runs(
            "SELECT r.case_id, p.params, e.steps, r.cpu_time_s, o.host, o.build FROM results r JOIN cases c ON c.id = r.case_id
             JOIN points p ON p.id = c.point JOIN ends e ON e.case_id = c.id JOIN processes o ON o.id = r.process",
            |row| {
                let cpu_s: f64 = row.get(3)?;
                if cpu_s > 0.0 && row.get::<_, String>(4)? == here.0 && row.get::<_, String>(5)? == here.1 {
                    runs.push((params(row, 1)?, count(row.get(2)?), cpu_s));
                }
                Ok(())
            },
        )?;
        Ok(runs)
    }

    /// All cases of the grid in the order of the file, each compared with what was written.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], and trouble with the file.
    pub fn point_runs(&self) -> Result<Vec<PointRun>, StoreError> {
        self.read(point_runs(&self.connection))
    }

    /// The last failure of every failed case, at most `limit` of them.
    ///
    /// # Errors
    /// Trouble with the file, or an entry that cannot be read.
    pub fn failures(&self, limit: u32) -> Result<Vec<FailureLine>, StoreError> {
        self.read(failures::check(&self.connection, "c.state = 'failed'", []))?;
        self.rows(
                "SELECT c.key, c.seed, p.params, f.error, f.step, f.strain, f.attempt, f.sphere_i, f.sphere_j, f.gap
                 FROM cases c JOIN points p ON p.id = c.point
                 JOIN failures f ON f.id = (SELECT max(id) FROM failures WHERE case_id = c.id)
                 WHERE c.state = 'failed' AND c.counts ORDER BY c.position LIMIT ?1", [limit], |row| {
                        Ok(FailureLine {
                            key: row.get(0)?,
                            seed: count(row.get(1)?),
                            params: params(row, 2)?,
                            error: row.get(3)?,
                            step: count(row.get(4)?),
                            strain: row.get(5)?,
                            attempt: count(row.get(6)?),
                            pair: row.get(7).and_then(|i: Option<i64>| {
                                Ok(i.map(count).zip(row.get::<_, Option<i64>>(8)?.map(count)))
                            })?,
                            gap: row.get(9)?,
                        })
                    })
    }

    /// States of the failed cases of the grid, or of the one with this key, at most `limit` of them.
    pub(crate) fn replays(&self, key: Option<&str>, limit: u32) -> Result<Vec<Replay>, StoreError> {
        self.read(failures::check(&self.connection, "c.state = 'failed'", []))?;
        self.rows(
                "SELECT c.key, f.error, f.snapshot
                 FROM cases c JOIN failures f ON f.id = (SELECT max(id) FROM failures WHERE case_id = c.id)
                 WHERE c.state = 'failed' AND c.key IS coalesce(?1, c.key) AND (?1 IS NOT NULL OR c.counts)
                 ORDER BY c.position LIMIT ?2", rusqlite::params![key, limit], |row| {
                        Ok(Replay {
                            key: row.get(0)?,
                            error: row.get(1)?,
                            snapshot: row.get(2)?,
                        })
                    })
    }

    /// Processes that own cases.
    pub(crate) fn processes(&self) -> Result<Vec<ProcessLine>, StoreError> {
        let now = process::now();
        self.rows(
                "SELECT p.host, p.pid, p.heartbeat, count(*) FROM processes p JOIN cases c ON c.owner = p.id
                 WHERE c.state = 'running' GROUP BY p.id ORDER BY p.id", [], |row| {
                        let heartbeat: i64 = row.get(2)?;
                        Ok(ProcessLine {
                            host: row.get(0)?,
                            pid: row.get(1)?,
                            silent_s: count(now - heartbeat) as f64 / 1000.0,
                            running: count(row.get(3)?),
                        })
                    })
    }
}

/// See [`Store::point_runs`].
fn point_runs(connection: &Connection) -> Result<Vec<PointRun>, rusqlite::Error> {
    campaign::check(connection)?;
    rules::check(connection)?;
    failures_fit_states(connection)?;
    let (protocol, grid): (String, String) = connection
        .prepare_cached("SELECT protocol, grid FROM campaign")?
        .query_row([], |row| Ok((row.get(0)?, row.get(1)?)))?;
    let protocol: Protocol = serde_json::from_str(&protocol).map_err(|error| {
        rusqlite::Error::FromSqlConversionFailure(0, Type::Text, Box::new(error))
    })?;
    let mut query = connection.prepare(&format!(
        "SELECT c.key, c.seed, c.steps, c.sample_stride, c.state, c.position, c.counts, c.point, r.case_id,
             e.steps, e.jammed, r.viscosity, r.viscosity_median, r.viscosity_stresslet, r.samples, r.contacts, r.activated,
             r.rolling, r.approach, r.minimum_gap, r.stages, r.unconverged_stages, r.worst_residual, r.wall_time_s,
             r.normal_stress_difference, r.jammed_stages, r.doubts, r.cpu_time_s, r.discard_step, r.viscosity_part_1,
             r.viscosity_part_2, r.viscosity_part_3, r.viscosity_part_4, r.viscosity_variance, r.viscosity_correlation,
             r.inexact_stages, {}, {}
         FROM cases c JOIN points p ON p.id = c.point
         LEFT JOIN results r ON r.case_id = c.id AND c.state IN ('done', 'jammed')
         LEFT JOIN ends e ON e.case_id = c.id AND c.state NOT IN ('done', 'jammed')
         WHERE c.position IS NOT NULL",
        stresses::names(STRESSES.iter(), "r."),
        *COVERED
    ))?;
    let points = KnownPoint::all(connection, protocol)?;
    let (mut runs, mut positions, mut keys) = (Vec::new(), Vec::new(), Vec::new());
    let mut rows = query.query([])?;
    while let Some(row) = rows.next()? {
        let known = points
            .get(&row.get(7)?)
            .ok_or_else(|| Altered::error("the point of a case is missing"))?;
        let key = known.checked_key(row, true)?;
        let position: i64 = row.get(5)?;
        keys.push(key);
        positions.push(position);
        if row.get(6)? {
            runs.push(point_run(row, key, known)?);
        }
    }
    positions.sort_unstable();
    let numbers = 0..super::integer(positions.len() as u64);
    let keys = keys.into_iter().map(CaseKey::number);
    if !positions.into_iter().eq(numbers) || request::grid(keys) != grid {
        return Err(Altered::error(
            "the grid is not what was written: a case is missing",
        ));
    }
    // Put into order here: SQLite would copy all columns for that.
    runs.sort_unstable_by_key(|run: &PointRun| run.position);
    Ok(runs)
}

/// That each failed case says why, and no pending one has failed.
fn failures_fit_states(connection: &Connection) -> Result<(), rusqlite::Error> {
    let unfit: bool = connection
        .prepare(
            "SELECT 1 FROM cases c WHERE c.state = 'failed'
                 AND NOT EXISTS (SELECT 1 FROM failures WHERE case_id = c.id AND NOT retried)
             UNION ALL SELECT 1 FROM failures f JOIN cases c ON c.id = f.case_id
                 WHERE NOT f.retried AND c.state IN ('pending', 'running')",
        )?
        .exists([])?;
    if unfit {
        return Err(Altered::error(
            "the state of a case is not that of its failures",
        ));
    }
    Ok(())
}

/// The point of a case, as it is read.
pub(super) struct KnownPoint {
    text: String,
    params: Arc<Params>,
    /// Steps that are requested.
    steps: u64,
}

impl KnownPoint {
    /// All points, by their numbers.
    fn all(
        connection: &Connection,
        protocol: Protocol,
    ) -> Result<HashMap<i64, Self>, rusqlite::Error> {
        connection
            .prepare("SELECT * FROM points")?
            .query_map([], |row| Ok((row.get(0)?, Self::read(row, protocol)?)))?
            .collect()
    }

    /// A row of the points.
    ///
    /// # Errors
    /// [`Altered`] if it is not what was written.
    pub(super) fn read(row: &Row<'_>, protocol: Protocol) -> Result<Self, rusqlite::Error> {
        let last = row.as_ref().column_count() - 1;
        let params = params(row, 1)?;
        let digest = Digest::default().with_row(row, 1..last)?.finish();
        let cells: Vec<Value> = (2..last)
            .map(|column| row.get(column))
            .collect::<Result<_, _>>()?;
        if digest != row.get::<_, i64>(last)? || !axis_cells(&params).eq(cells) {
            return Err(Altered::error(
                "the parameters of a point are not what was written",
            ));
        }
        Ok(Self {
            text: row.get(1)?,
            steps: protocol.with_time_step(params.time_step).steps(),
            params: Arc::new(params),
        })
    }

    /// The key of a row whose first columns are key, seed, steps, sample stride, state; then from 8 on whether there is a result,
    /// and the end that there is of an open case.
    ///
    /// # Errors
    /// [`Altered`] if these do not go together.
    pub(super) fn checked_key(
        &self,
        row: &Row<'_>,
        is_in_grid: bool,
    ) -> Result<CaseKey, rusqlite::Error> {
        let (seed, steps, stride) = (count(row.get(1)?), count(row.get(2)?), count(row.get(3)?));
        let key = CaseKey::of_text(&self.text, seed, stride);
        let written = row.get_ref(0)?.as_str()?;
        if key.to_string() != written {
            return Err(Altered::error(format!(
                "the parameters of case {written} are not those it was named for"
            )));
        }
        let is_finished = matches!(state(row.get_ref(4)?)?, State::Done | State::Jammed);
        let has_result = row.get_ref(8)? != ValueRef::Null;
        let end: Option<i64> = row.get(9)?;
        let is_covered = end.is_some_and(|end| count(end) >= steps)
            || row.get::<_, Option<bool>>(10)? == Some(true);
        if (is_in_grid && steps != self.steps) || is_finished != has_result || is_covered {
            return Err(Altered::error(format!(
                "the state of case {written} is not what was written"
            )));
        }
        Ok(key)
    }
}

/// The state of this name.
pub(super) fn state(name: ValueRef<'_>) -> Result<State, rusqlite::Error> {
    let name = name.as_str()?;
    State::of(name).ok_or_else(|| Altered::error(format!("there is no state {name:?} of a case")))
}

/// First column of the stresses in a row of [`point_runs`].
const OF_STRESSES: usize = 36;

/// One row of [`point_runs`].
fn point_run(row: &Row<'_>, key: CaseKey, point: &KnownPoint) -> Result<PointRun, rusqlite::Error> {
    let covered = OF_STRESSES + COUNT;
    let last = row.as_ref().column_count() - 1;
    let has_result = row.get_ref(8)? != ValueRef::Null;
    if has_result
        && Digest::default().with_row(row, covered..last)?.finish() != row.get::<_, i64>(last)?
    {
        return Err(Altered::error(format!(
            "the result of run {key} is not what was written"
        )));
    }
    let whole = |column: usize| {
        row.get::<_, Option<i64>>(column)
            .map(|n| count(n.unwrap_or(0)))
    };
    let mut stresses = [None; COUNT];
    for (stress, column) in stresses.iter_mut().zip(OF_STRESSES..) {
        *stress = row.get(column)?;
    }
    let params = point.params.clone();
    let discarded: Option<i64> = row.get(28)?;
    Ok(PointRun {
        position: whole(5)?,
        stresses,
        key: key.to_string(),
        sample_every: whole(3)? as f64 * params.time_step,
        discard: discarded.map(|steps| count(steps) as f64 * params.time_step),
        params,
        seed: whole(1)?,
        state: state(row.get_ref(4)?)?,
        viscosity: row.get(11)?,
        viscosity_median: row.get(12)?,
        viscosity_stresslet: row.get(13)?,
        samples: whole(14)?,
        contacts: whole(15)?,
        activated: whole(16)?,
        rolling: whole(17)?,
        approach: row.get::<_, Option<f64>>(18)?.unwrap_or(0.0),
        minimum_gap: row.get(19)?,
        stages: whole(20)?,
        unconverged_stages: whole(21)?,
        inexact_stages: whole(35)?,
        worst_residual: row.get(22)?,
        wall_time_s: row.get(23)?,
        normal_stress_difference: row.get(24)?,
        jammed_stages: whole(25)?,
        doubts: row
            .get_ref(26)?
            .as_str_or_null()?
            .map(Doubt::read)
            .unwrap_or_default(),
        cpu_time_s: row.get(27)?,
        steadiness: steadiness(row)?,
    })
}

/// What a run tells about steadiness, where it does.
fn steadiness(row: &Row<'_>) -> Result<Option<Steadiness>, rusqlite::Error> {
    let number = |column: usize| row.get::<_, Option<f64>>(column);
    let parts = [number(29)?, number(30)?, number(31)?, number(32)?];
    let ([Some(a), Some(b), Some(c), Some(d)], Some(variance), Some(correlation)) =
        (parts, number(33)?, number(34)?)
    else {
        return Ok(None);
    };
    Ok(Some(Steadiness {
        parts: [a, b, c, d],
        correlation,
        variance,
    }))
}

/// The parameters in a column of JSON.
pub(super) fn params(row: &Row<'_>, column: usize) -> Result<Params, rusqlite::Error> {
    let text: String = row.get(column)?;
    serde_json::from_str(&text).map_err(|error| {
        rusqlite::Error::FromSqlConversionFailure(column, Type::Text, Box::new(error))
    })
}
