//! What `status` and `report` ask the store.

use super::checksum::Altered;
use super::{Store, StoreError, count, process};
use crate::case::{Case, State};
use crate::doubt::Doubt;
use crate::statistics::Steadiness;
use crate::stresses::{self, COUNT, STRESSES};
use rusqlite::{Row, types::Type};
use sd_core::Params;
use serde::Serialize;
use std::collections::HashMap;

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

/// One case with its result, if it has one.
#[derive(Debug, Clone)]
pub struct PointRun {
    /// Its key.
    pub key: String,
    /// Its parameters.
    pub params: Params,
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
    /// Why its numbers are doubtful, if they are.
    pub doubts: Vec<Doubt>,
    /// Contact problems without a solution.
    pub jammed_stages: u64,
    /// Worst residual of the run.
    pub worst_residual: Option<f64>,
    /// Seconds of computing.
    pub wall_time_s: Option<f64>,
    /// Seconds of processor.
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
        // Rows in their own order: by the index of states each would be looked up alone, four times as slow.
        let rows: Result<Vec<(String, i64)>, _> = self
            .connection
            .prepare("SELECT state, count(*) FROM cases NOT INDEXED WHERE position IS NOT NULL GROUP BY state")
            .and_then(|mut query| {
                query
                    .query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?
                    .collect()
            });
        let mut counts = Counts::default();
        for (state, number) in self.read(rows)? {
            let place = match State::of(&state) {
                Some(State::Done) => &mut counts.done,
                Some(State::Jammed) => &mut counts.jammed,
                Some(State::Failed) => &mut counts.failed,
                Some(State::Running) => &mut counts.running,
                Some(State::Pending) => &mut counts.pending,
                None => {
                    return self.read(Err(Altered::error(format!(
                        "there is no state {state:?} of a case"
                    ))));
                }
            };
            *place = count(number);
        }
        Ok(counts)
    }

    /// Estimated cost of the grid, and of what is done of it: finished cases, and others up to their last checkpoint,
    /// but for those this process has under way. What was done of failed cases is lost.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn work(&self) -> Result<(f64, f64), StoreError> {
        self.read(self.connection.query_row(
            "SELECT total(cost), total(CASE WHEN state IN ('done', 'jammed') THEN cost
                                       WHEN state = 'failed' OR owner = ?1 THEN 0.0
                                       ELSE cost * min(1.0 * steps_done / steps, 1.0) END)
             FROM cases WHERE position IS NOT NULL",
            [self.me()],
            |row| Ok((row.get(0)?, row.get(1)?)),
        ))
    }

    /// How far each case of the grid is, by its key: `None` of one that has ended, or else the share of it that is done.
    ///
    /// # Errors
    /// Trouble with the file.
    pub(crate) fn standing(&self) -> Result<HashMap<String, Option<f64>>, StoreError> {
        let rows = self
            .connection
            .prepare(
                "SELECT key, CASE WHEN state IN ('pending', 'running') THEN min(1.0 * steps_done / steps, 1.0) END
                 FROM cases WHERE position IS NOT NULL",
            )
            .and_then(|mut query| query.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?.collect());
        self.read(rows)
    }

    /// Open cases of the grid, and the share of each that is left.
    ///
    /// # Errors
    /// Trouble with the file, or an entry that cannot be read.
    pub(crate) fn open_work(&self) -> Result<Vec<(Case, f64)>, StoreError> {
        let rows = self
            .connection
            .prepare(
                "SELECT params, seed, steps, sample_stride, 1.0 - min(1.0 * steps_done / steps, 1.0) FROM cases
                 WHERE position IS NOT NULL AND state IN ('pending', 'running')",
            )
            .and_then(|mut query| {
                query
                    .query_map([], |row| {
                        let case = Case {
                            params: params(row, 0)?,
                            seed: count(row.get(1)?),
                            steps: count(row.get(2)?),
                            sample_stride: count(row.get(3)?),
                        };
                        Ok((case, row.get(4)?))
                    })?
                    .collect()
            });
        self.read(rows)
    }

    /// Parameters, steps and seconds of processor of runs that this build has computed on this machine, at most a few thousand.
    ///
    /// # Errors
    /// Trouble with the file, or an entry that cannot be read.
    pub(crate) fn measured_runs(&self) -> Result<Vec<(Params, u64, f64)>, StoreError> {
        let rows = self
            .connection
            .prepare(
                "SELECT c.params, e.steps, r.cpu_time_s FROM results r JOIN cases c ON c.id = r.case_id
                 JOIN ends e ON e.case_id = c.id JOIN processes p ON p.id = r.process
                 WHERE r.cpu_time_s > 0 AND p.host = ?1 AND p.build = ?2 ORDER BY r.finished_at DESC LIMIT 5000",
            )
            .and_then(|mut query| {
                let here = (process::Identity::of_this_process().host, process::build());
                query
                    .query_map([here.0, here.1], |row| {
                        Ok((params(row, 0)?, count(row.get(1)?), row.get(2)?))
                    })?
                    .collect()
            });
        self.read(rows)
    }

    /// Estimated cost of the failed cases of the grid, which are not computed again by themselves.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn work_given_up(&self) -> Result<f64, StoreError> {
        self.read(self.connection.query_row(
            "SELECT total(cost) FROM cases WHERE position IS NOT NULL AND state = 'failed'",
            [],
            |row| row.get(0),
        ))
    }

    /// All cases of the grid in the order of the file.
    ///
    /// # Errors
    /// Trouble with the file, or an entry that cannot be read.
    pub fn point_runs(&self) -> Result<Vec<PointRun>, StoreError> {
        let rows = self
            .connection
            .prepare(&format!(
                "SELECT c.key, c.params, c.seed, c.state, r.viscosity, r.viscosity_median, r.viscosity_stresslet,
                     coalesce(r.samples, 0), coalesce(r.contacts, 0), coalesce(r.activated, 0),
                     coalesce(r.rolling, 0), coalesce(r.approach, 0.0), r.minimum_gap, coalesce(r.stages, 0),
                     coalesce(r.unconverged_stages, 0), r.worst_residual, r.wall_time_s,
                     r.normal_stress_difference, coalesce(r.jammed_stages, 0), coalesce(r.doubts, ''), r.cpu_time_s,
                     r.discard_step, r.viscosity_part_1, r.viscosity_part_2, r.viscosity_part_3, r.viscosity_part_4,
                     r.viscosity_variance, r.viscosity_correlation, c.sample_stride, {}, c.position
                 FROM cases c LEFT JOIN results r ON r.case_id = c.id AND c.state IN ('done', 'jammed')
                 WHERE c.position IS NOT NULL",
                stresses::names(STRESSES.iter(), "r.")
            ))
            .and_then(|mut query| {
                let mut known = None;
                query
                    .query_map([], |row| {
                        Ok((row.get(29 + COUNT)?, point_run(row, &mut known)?))
                    })?
                    .collect()
            });
        // Put into order here: SQLite would copy all columns for that, and most rows are in order as they lie.
        let mut runs: Vec<(i64, PointRun)> = self.read(rows)?;
        runs.sort_by_key(|(position, _)| *position);
        Ok(runs.into_iter().map(|(_, run)| run).collect())
    }

    /// The last failure of every failed case, at most `limit` of them.
    ///
    /// # Errors
    /// Trouble with the file, or an entry that cannot be read.
    pub fn failures(&self, limit: u32) -> Result<Vec<FailureLine>, StoreError> {
        let rows = self
            .connection
            .prepare(
                "SELECT c.key, c.seed, c.params, f.error, f.step, f.strain, f.attempt, f.sphere_i, f.sphere_j, f.gap
                 FROM cases c JOIN failures f ON f.id = (SELECT max(id) FROM failures WHERE case_id = c.id)
                 WHERE c.state = 'failed' AND c.position IS NOT NULL ORDER BY c.position LIMIT ?1",
            )
            .and_then(|mut query| {
                query
                    .query_map([limit], |row| {
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
                    })?
                    .collect()
            });
        self.read(rows)
    }

    /// States of the failed cases of the grid, or of the one with this key, at most `limit` of them.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn replays(&self, key: Option<&str>, limit: u32) -> Result<Vec<Replay>, StoreError> {
        let rows = self
            .connection
            .prepare(
                "SELECT c.key, f.error, f.snapshot
                 FROM cases c JOIN failures f ON f.id = (SELECT max(id) FROM failures WHERE case_id = c.id)
                 WHERE c.state = 'failed' AND c.key IS coalesce(?1, c.key) AND (?1 IS NOT NULL OR c.position IS NOT NULL)
                 ORDER BY c.position LIMIT ?2",
            )
            .and_then(|mut query| {
                query
                    .query_map(rusqlite::params![key, limit], |row| {
                        Ok(Replay {
                            key: row.get(0)?,
                            error: row.get(1)?,
                            snapshot: row.get(2)?,
                        })
                    })?
                    .collect()
            });
        self.read(rows)
    }

    /// Processes that own cases.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn processes(&self) -> Result<Vec<ProcessLine>, StoreError> {
        let now = process::now();
        let rows = self
            .connection
            .prepare(
                "SELECT p.host, p.pid, p.heartbeat, count(*) FROM processes p JOIN cases c ON c.owner = p.id
                 WHERE c.state = 'running' GROUP BY p.id ORDER BY p.id",
            )
            .and_then(|mut query| {
                query
                    .query_map([], |row| {
                        let heartbeat: i64 = row.get(2)?;
                        Ok(ProcessLine {
                            host: row.get(0)?,
                            pid: row.get(1)?,
                            silent_s: count(now - heartbeat) as f64 / 1000.0,
                            running: count(row.get(3)?),
                        })
                    })?
                    .collect()
            });
        self.read(rows)
    }
}

/// Parameters with their text.
type Known = Option<(String, Params)>;

/// One row of [`Store::point_runs`]. Runs of a point come one after the other: their parameters are read once.
fn point_run(row: &Row<'_>, known: &mut Known) -> Result<PointRun, rusqlite::Error> {
    let text = row.get_ref(1)?.as_str()?;
    let params = match known {
        Some((last, params)) if last == text => params.clone(),
        _ => known.insert((text.to_owned(), params(row, 1)?)).1.clone(),
    };
    let state = row.get_ref(3)?.as_str()?;
    let discarded: Option<i64> = row.get(21)?;
    let mut stresses = [None; COUNT];
    for (stress, column) in stresses.iter_mut().zip(29..) {
        *stress = row.get(column)?;
    }
    // Programs of schema 8 and before knew N1 by its other name only.
    let n1 = STRESSES.iter().position(|column| column.name == "n1");
    if let Some(n1) = n1.map(|place| &mut stresses[place]) {
        *n1 = n1.or(row.get(17)?);
    }
    Ok(PointRun {
        stresses,
        key: row.get(0)?,
        sample_every: count(row.get(28)?) as f64 * params.time_step,
        discard: discarded.map(|steps| count(steps) as f64 * params.time_step),
        params,
        seed: count(row.get(2)?),
        state: State::of(state)
            .ok_or_else(|| Altered::error(format!("there is no state {state:?} of a case")))?,
        viscosity: row.get(4)?,
        viscosity_median: row.get(5)?,
        viscosity_stresslet: row.get(6)?,
        samples: count(row.get(7)?),
        contacts: count(row.get(8)?),
        activated: count(row.get(9)?),
        rolling: count(row.get(10)?),
        approach: row.get(11)?,
        minimum_gap: row.get(12)?,
        stages: count(row.get(13)?),
        unconverged_stages: count(row.get(14)?),
        worst_residual: row.get(15)?,
        wall_time_s: row.get(16)?,
        normal_stress_difference: row.get(17)?,
        jammed_stages: count(row.get(18)?),
        cpu_time_s: row.get(20)?,
        steadiness: steadiness(row)?,
        doubts: Doubt::read(row.get_ref(19)?.as_str()?),
    })
}

/// What a run tells about steadiness, where it does.
fn steadiness(row: &Row<'_>) -> Result<Option<Steadiness>, rusqlite::Error> {
    let number = |column: usize| row.get::<_, Option<f64>>(column);
    let parts = [number(22)?, number(23)?, number(24)?, number(25)?];
    let ([Some(a), Some(b), Some(c), Some(d)], Some(variance), Some(correlation)) =
        (parts, number(26)?, number(27)?)
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
