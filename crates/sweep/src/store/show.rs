//! What readers see of a store: all runs, one case, and the progress of the campaign.

use super::digest::DigestMismatch;
use super::entered::{self, Entered};
use super::points::{self, params};
use super::processes::{self, ActiveProcess, program};
use super::runs::{Attempt, ListedRun};
use super::statements::{Statements, json};
use super::{Store, StoreError, rules, runs, samples};
use crate::data::{DataColumn, Kind};
use crate::measure::doubt::Doubt;
use crate::measure::numbers::Level;
use crate::measure::{PointRun, numbers, run_table};
use crate::model::case::{CaseKey, State};
use crate::model::protocol::Protocol;
use crate::system::process;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, Row};
use sd_core::{Params, Sample};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

impl Store {
    /// All cases of the grid in the order of the file, each checked by its digest.
    pub(crate) fn point_runs(&self) -> Result<Vec<PointRun>, StoreError> {
        self.read(point_runs(&self.connection))
    }
}

impl Store {
    /// All runs of the campaign in its order, one row each. Pending runs have no results.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], and I/O or SQLite errors.
    pub fn runs(&self) -> Result<Vec<DataColumn>, StoreError> {
        let runs = self.point_runs()?;
        let runs: Vec<&PointRun> = runs.iter().collect();
        Ok(run_table(&runs))
    }

    /// Checks what commands show of all cases, their points, results and processes.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub(crate) fn verify(&self) -> Result<(), StoreError> {
        let checked = processes::SEALED.check(&self.connection).and_then(|()| {
            look(&self.connection, |run, known| {
                known.and_then(|_| run.check())
            })
        });
        self.read(checked)
    }
}

/// See [`Store::point_runs`].
fn point_runs(connection: &Connection) -> rusqlite::Result<Vec<PointRun>> {
    let mut runs = Vec::new();
    look(connection, |run, known| {
        let (key, point) = known?;
        run.check()?;
        let position: Option<u64> = run.get("position")?;
        if let Some(position) = position
            && run.get("counts")?
        {
            runs.push(point_run(run, position, key, point)?);
        }
        Ok(())
    })?;
    // Sorted here: SQLite would copy all columns.
    runs.sort_unstable_by_key(|run: &PointRun| run.position);
    Ok(runs)
}

/// Further columns of [`look`].
const MORE: &str = ", c.seed, c.steps AS requested, c.sample_stride, c.state AS present, c.position, c.counts, c.point";

/// Calls `each` for every case, with its key and point, or an error if these were changed. Checks
/// the campaign and the seeds that count.
pub(super) fn look(
    connection: &Connection,
    mut each: impl FnMut(
        &ListedRun<'_>,
        rusqlite::Result<(CaseKey, &KnownPoint)>,
    ) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    let Entered {
        protocol,
        grid,
        rules,
        ..
    } = Entered::read(connection)?;
    let mut points: HashMap<i64, rusqlite::Result<KnownPoint>> = HashMap::new();
    points::SEALED.each(connection, "true", [], |id, row, altered| {
        let whole = DigestMismatch::unless(altered.is_none(), points::SEALED.words);
        points.insert(id, whole.and_then(|()| KnownPoint::read(row, &protocol)));
        Ok(())
    })?;
    let (mut positions, mut keys) = (Vec::new(), Vec::new());
    runs::each(connection, MORE, "true", &[], |run| {
        let position: Option<u64> = run.get("position")?;
        let known = match points.get(&run.get("point")?) {
            Some(Ok(point)) => point
                .checked_key(&run, position.is_some())
                .map(|key| (key, point)),
            Some(Err(error)) => Err(DigestMismatch::error(DigestMismatch::words(error))),
            None => Err(DigestMismatch::error("the point of a case is missing")),
        };
        if let (Ok((key, _)), Some(position)) = (&known, position) {
            positions.push(position);
            keys.push(key.number());
        }
        each(&run, known)
    })?;
    positions.sort_unstable();
    let numbers = 0..positions.len() as u64;
    if !positions.into_iter().eq(numbers) || entered::grid(keys.into_iter()) != grid {
        return Err(DigestMismatch::error(
            "the grid of the campaign is incomplete: a case is missing",
        ));
    }
    rules::check(connection, &rules)
}

/// The state of this name.
fn state(name: ValueRef<'_>) -> rusqlite::Result<State> {
    let name = name.as_str()?;
    State::of(name)
        .ok_or_else(|| DigestMismatch::error(format!("there is no state {name:?} of a case")))
}

/// The point of a case.
pub(super) struct KnownPoint {
    text: String,
    params: Arc<Params>,
    steps: u64,
}

impl KnownPoint {
    /// A row of the points.
    fn read(row: &Row<'_>, protocol: &Protocol) -> rusqlite::Result<Self> {
        let mut params = params(row, "params")?;
        // The store may be shown up to one of its segments.
        params.segments.truncate(protocol.segments.len());
        Ok(Self {
            text: row.get("params")?,
            steps: protocol.with_time_step(params.time_step).steps(),
            params: Arc::new(params),
        })
    }

    /// The key of a case of this point.
    ///
    /// # Errors
    /// [`DigestMismatch`] if the case was changed.
    fn checked_key(&self, run: &ListedRun<'_>, is_in_grid: bool) -> rusqlite::Result<CaseKey> {
        let key = CaseKey::of_text(&self.text, run.get("seed")?, run.get("sample_stride")?);
        let written = run.get_ref("key")?.as_str()?;
        if key.to_string() != written {
            return Err(DigestMismatch::error(format!(
                "the parameters of case {written} are not those it was named for"
            )));
        }
        state(run.get_ref("present")?)?;
        if is_in_grid && run.get::<u64>("requested")? != self.steps {
            return Err(DigestMismatch::error(format!(
                "case {written} has another length than the campaign requests"
            )));
        }
        Ok(key)
    }
}

/// One of [`point_runs`].
fn point_run(
    run: &ListedRun<'_>,
    position: u64,
    key: CaseKey,
    point: &KnownPoint,
) -> rusqlite::Result<PointRun> {
    let row = run.row;
    let state = state(run.get_ref("present")?)?;
    let (mut numbers, mut doubts) = (Vec::new(), Vec::new());
    // An open run may have the result of a shorter one.
    if matches!(state, State::Done | State::Jammed) {
        for (number, column) in numbers::columns(Level::Runs).zip(run.numbers..) {
            let value: Option<f64> = match number.kind(Level::Runs) {
                Kind::Count => row.get::<_, Option<u64>>(column)?.map(|count| count as f64),
                _ => row.get(column)?,
            };
            numbers.push(value.unwrap_or(f64::NAN));
        }
        doubts = Doubt::read(run.get_ref("doubts")?.as_str()?);
    }
    let params = point.params.clone();
    Ok(PointRun {
        position,
        key: key.to_string(),
        sample_every: run.get::<u64>("sample_stride")? as f64 * params.time_step,
        params,
        seed: run.get("seed")?,
        state,
        doubts,
        numbers: numbers.into(),
    })
}

/// One case with its state and data.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CaseDetails {
    /// Its key.
    pub key: String,
    /// Its number in the campaign file, from 1; `None` once it has left the grid.
    pub number: Option<u64>,
    /// Its parameters.
    #[serde(deserialize_with = "json")]
    pub params: Params,
    /// Its seed.
    pub seed: u64,
    /// Its state.
    pub state: State,
    /// Steps of the whole run.
    pub steps: u64,
    /// Steps done, as of the last checkpoint.
    pub steps_done: u64,
    /// Number of attempts.
    pub attempts: u64,
    /// Reasons why its numbers are doubtful, if any.
    #[serde(deserialize_with = "doubts")]
    pub doubts: Vec<String>,
    /// Wall seconds, once it is done.
    pub wall_time_s: Option<f64>,
    /// Seconds of CPU.
    pub cpu_time_s: Option<f64>,
    /// Area or volume fraction at its end, under an imposed pressure.
    pub final_fraction: Option<f64>,
    /// Number of times it was resumed from a checkpoint.
    pub resumed: Option<u64>,
    /// The process that computed it, or computes it.
    #[serde(skip_deserializing)]
    pub origin: Option<Origin>,
    /// Its failed attempts, the last one last.
    #[serde(skip_deserializing)]
    pub failures: Vec<Attempt>,
    /// Number of frames.
    #[serde(skip_deserializing)]
    pub frames: u64,
    /// Its samples so far, with their steps.
    #[serde(skip_deserializing)]
    pub samples: Vec<(u64, Sample)>,
}

/// Meanings of the doubts of a column, empty where there is no result.
fn doubts<'de, D: Deserializer<'de>>(column: D) -> Result<Vec<String>, D::Error> {
    let names = Option::<String>::deserialize(column)?.unwrap_or_default();
    Ok(Doubt::read(&names)
        .into_iter()
        .map(Doubt::meaning)
        .collect())
}

/// Where a run was computed.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Origin {
    /// Host.
    pub host: String,
    /// Version of the program.
    pub version: String,
    /// Version of its physics.
    pub physics_version: u64,
    /// Hash of its executable.
    pub build: String,
    /// Its end or last heartbeat, in milliseconds since 1970.
    pub at: i64,
}

impl Store {
    /// The key of the case identified by the beginning of a key or by a number of the campaign
    /// file; an exact number takes precedence.
    ///
    /// # Errors
    /// [`StoreError::Case`] if no case or several match, and I/O or SQLite errors.
    pub fn key_of(&self, given: &str) -> Result<String, StoreError> {
        let mut keys = self.find_cases(given)?;
        match (keys.pop(), keys.as_slice()) {
            (None, _) => Err(self.no_case(given, "no case")),
            (Some(key), []) => Ok(key),
            (Some(_), _) => Err(self.no_case(given, "the beginning of several cases")),
        }
    }

    /// The error about a name that does not match exactly one case.
    pub(crate) fn no_case(&self, given: &str, what: &'static str) -> StoreError {
        StoreError::Case {
            path: self.path.clone(),
            given: given.to_owned(),
            what,
        }
    }

    /// Keys of the cases that match a name, at most two.
    fn find_cases(&self, given: &str) -> Result<Vec<String>, StoreError> {
        let number = given.parse::<i64>().ok().filter(|_| given.len() < 8);
        let by_number = "SELECT key FROM cases WHERE position = ?1 - 1";
        let by_number: Vec<String> = self.read(self.connection.values(by_number, [number]))?;
        if !by_number.is_empty() {
            return Ok(by_number);
        }
        let by_key = "SELECT key FROM cases WHERE substr(key, 1, length(?1)) = lower(?1) ORDER BY key LIMIT 2";
        self.read(self.connection.values(by_key, [given]))
    }

    /// The details of a case, by a name as for [`Store::key_of`].
    pub(crate) fn details(&self, given: &str) -> Result<CaseDetails, StoreError> {
        self.verify()?;
        let key = self.key_of(given)?;
        let id = "SELECT id FROM cases WHERE key = ?1";
        let id: i64 = self.read(self.connection.one(id, [&key], |row| row.get(0)))?;
        let found = || {
            let result = "results r ON r.case_id = c.id AND c.state IN ('done', 'jammed')";
            let case = format!(
                "SELECT c.key, c.position + 1 AS number, q.params, c.seed, c.state, c.steps, c.steps_done,
                     c.attempts, r.doubts, r.wall_time_s, r.cpu_time_s, r.final_fraction, r.resumed
                 FROM cases c JOIN points q ON q.id = c.point LEFT JOIN {result} WHERE c.id = ?1"
            );
            let origin = format!(
                "SELECT p.host, p.version, p.physics_version, p.build,
                     coalesce(r.finished_at, p.heartbeat) AS at
                 FROM cases c LEFT JOIN {result} JOIN processes p ON p.id = coalesce(r.process, c.owner,
                     (SELECT process FROM failures f WHERE f.case_id = c.id ORDER BY f.id DESC LIMIT 1))
                 WHERE c.id = ?1"
            );
            let case: Option<CaseDetails> = self.connection.first(&case, [id])?;
            let case = case.ok_or(rusqlite::Error::QueryReturnedNoRows)?;
            runs::check(&self.connection, "c.id = ?1", &[&id])?;
            Ok(CaseDetails {
                origin: self.connection.first(&origin, [id])?,
                failures: runs::failures_of(&self.connection, id)?,
                samples: samples::of(&self.connection, id, case.steps)?,
                ..case
            })
        };
        Ok(CaseDetails {
            frames: self.frame_count(&key)?,
            ..self.read(found())?
        })
    }

    /// Samples of a case so far, with their steps.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub fn samples(&self, key: &str) -> Result<Vec<(u64, Sample)>, StoreError> {
        let case = "SELECT id, steps FROM cases WHERE key = ?1";
        let found = self.connection.find(case, [key], |row| row.try_into());
        match self.read(found)? {
            Some((id, steps)) => self.read(samples::of(&self.connection, id, steps)),
            None => Ok(Vec::new()),
        }
    }

    /// Strain and viscosity of a case at its samples so far.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub fn trace(&self, key: &str) -> Result<Vec<(f64, f64)>, StoreError> {
        Ok(self
            .samples(key)?
            .into_iter()
            .map(|(_, sample)| (sample.strain, sample.viscosity))
            .filter(|(_, viscosity)| viscosity.is_finite())
            .collect())
    }
}

impl Origin {
    /// Name and version of the program.
    pub fn program(&self) -> String {
        program(&self.version, self.physics_version, &self.build)
    }
}

/// Cases of the grid by state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Finished.
    pub done: u64,
    /// Ended as jammed layers.
    pub jammed: u64,
    /// Of these, those that came to rest under an imposed ratio of stress and pressure; in JSON
    /// only if there are any.
    #[serde(skip_serializing_if = "is_none")]
    pub arrested: u64,
    /// Ended with an error.
    pub failed: u64,
    /// Owned by a process.
    pub running: u64,
    /// Not started, or stopped.
    pub pending: u64,
}

impl Counts {
    /// All cases of the grid.
    pub fn total(&self) -> u64 {
        self.done + self.jammed + self.failed + self.running + self.pending
    }

    /// Adds a case in a state, which may be that of an [arrest](State::is_arrest).
    pub(crate) fn add(&mut self, state: State, is_arrest: bool) {
        *self.count_mut(state) += 1;
        self.arrested += u64::from(is_arrest);
    }

    /// The jammed ones in words.
    pub(crate) fn words_of_jammed(&self) -> String {
        match (self.jammed, self.arrested) {
            (jammed, 0) => format!("{jammed} jammed"),
            (jammed, arrested) if jammed == arrested => format!("{arrested} arrested"),
            (jammed, arrested) => format!("{jammed} jammed, {arrested} of them arrested"),
        }
    }

    /// Number of cases in a state.
    fn count_mut(&mut self, state: State) -> &mut u64 {
        match state {
            State::Done => &mut self.done,
            State::Jammed => &mut self.jammed,
            State::Failed => &mut self.failed,
            State::Running => &mut self.running,
            State::Pending => &mut self.pending,
        }
    }

    /// Counts a case that ended in this state since the last count.
    pub(crate) fn end(&mut self, state: State, is_arrest: bool) {
        if matches!(state, State::Pending | State::Running) {
            return;
        }
        // It may have been claimed after that count.
        let open = if self.running > 0 {
            &mut self.running
        } else {
            &mut self.pending
        };
        if *open > 0 {
            *open -= 1;
            self.add(state, is_arrest);
        }
    }
}

/// Whether a number of cases is 0.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_none(cases: &u64) -> bool {
    *cases == 0
}

/// Progress of the grid, in estimated CPU seconds.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Its cases by state.
    pub counts: Counts,
    /// Total work.
    pub total: f64,
    /// Work done: finished cases, and others up to their last checkpoint, except those running in
    /// this process.
    pub done: f64,
    /// Failed cases, which are not retried automatically.
    pub given_up: f64,
    /// Remaining work of pending and running cases.
    pub left: f64,
    /// Running cases with a recent heartbeat of their process.
    alive: u64,
}

/// Progress of the runs of one point.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub(crate) struct PointWork {
    /// Position of the first of them in the campaign.
    pub(crate) position: usize,
    /// All that count.
    pub(crate) runs: f64,
    /// Those that have not ended.
    pub(crate) open: f64,
    /// The done part of these, in runs.
    pub(crate) done: f64,
}

/// Number of finished runs used to estimate the speed of a machine.
const SAMPLED: i64 = 1000;

/// One process in a list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProcessLine {
    /// Its host.
    pub host: String,
    /// Its process id.
    pub pid: u32,
    /// Seconds since its last heartbeat.
    pub silent_s: f64,
    /// Cases it owns.
    pub running: u64,
    /// Whether it still lives.
    pub alive: bool,
}

impl Store {
    /// Cases of the grid by state.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub fn counts(&self) -> Result<Counts, StoreError> {
        self.work().map(|work| work.counts)
    }

    /// Progress of the grid, from one scan of all cases.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub fn work(&self) -> Result<Work, StoreError> {
        let read = || {
            let alive = ActiveProcess::living(&self.connection)?;
            let ratios = self
                .connection
                .values::<i64, HashSet<_>>(points::AT_RATIO, [])?;
            // Summed here: SQLite would sort all cases by their states first.
            let mut query = self.connection.prepare_cached(
                "SELECT state, cost, cost * min(1.0 * steps_done / steps, 1.0), owner, point
                     FROM cases NOT INDEXED WHERE counts",
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
                let is_arrest = state == State::Jammed && ratios.contains(&row.get(4)?);
                work.counts.add(state, is_arrest);
            }
            Ok(work)
        };
        self.read(read())
    }

    /// Wall and CPU seconds that open runs still take, one after another: each those of the
    /// finished runs of its point on average, and without any its estimate, scaled by all finished
    /// ones. `None` without finished runs.
    fn open_times(&self) -> Result<Option<[f64; 2]>, StoreError> {
        #[derive(Deserialize)]
        struct FinishedRun {
            point: i64,
            wall_time_s: f64,
            cpu_time_s: f64,
            cost: f64,
        }
        #[derive(Deserialize)]
        struct OpenPoint {
            point: i64,
            runs: f64,
            cost: f64,
        }
        let finished: Vec<FinishedRun> = self.sampled_runs(
            "c.point, r.wall_time_s, r.cpu_time_s, c.cost * r.computed / c.steps AS cost",
            "cases c ON c.id = r.case_id",
        )?;
        let (mut of_all, mut of_points) = ([0.0; 3], HashMap::<_, [f64; 3]>::new());
        for run in &finished {
            let times = [run.wall_time_s, run.cpu_time_s];
            let of_point = of_points.entry(run.point).or_default();
            for (sums, scale) in [(&mut of_all, run.cost), (of_point, 1.0)] {
                sums[0] += times[0];
                sums[1] += times[1];
                sums[2] += scale;
            }
        }
        if of_all[2] <= 0.0 {
            return Ok(None);
        }
        let open: Vec<OpenPoint> = self.named(
            "SELECT point, total(1.0 - min(1.0 * steps_done / steps, 1.0)) AS runs,
                 total(cost * (1.0 - min(1.0 * steps_done / steps, 1.0))) AS cost
             FROM cases WHERE counts AND state IN ('pending', 'running') GROUP BY point",
            [],
        )?;
        let mut left = [0.0; 2];
        for open in open {
            let ([wall, cpu, scale], amount) = match of_points.get(&open.point) {
                Some(sums) => (*sums, open.runs),
                None => (of_all, open.cost),
            };
            left[0] += wall / scale * amount;
            left[1] += cpu / scale * amount;
        }
        Ok(Some(left))
    }

    /// Columns of finished runs, evenly spread over the store, with another table.
    fn sampled_runs<T: DeserializeOwned>(
        &self,
        columns: &str,
        joined: &str,
    ) -> Result<Vec<T>, StoreError> {
        let sampled = || {
            let last = "SELECT coalesce(max(case_id), 0) FROM results";
            let last: i64 = self.connection.one(last, [], |row| row.get(0))?;
            let next = "SELECT case_id FROM results WHERE case_id >= ?1 ORDER BY case_id LIMIT 1";
            let run = format!("SELECT {columns} FROM results r JOIN {joined} WHERE r.case_id = ?1");
            let (mut from, mut found) = (0, Vec::new());
            while let Some(id) = self.connection.value::<i64>(next, [from])? {
                found.extend(self.connection.first(&run, [id])?);
                from = id + (last / SAMPLED).max(1);
            }
            Ok(found)
        };
        self.read(sampled())
    }

    /// The mean fraction at which runs came to rest under an imposed ratio of stress and pressure;
    /// `None` without such runs.
    pub(crate) fn arrested_fraction(&self) -> Result<Option<f64>, StoreError> {
        let mean = format!(
            "SELECT avg(r.final_fraction) FROM cases c JOIN results r ON r.case_id = c.id
                 WHERE c.counts AND c.state = 'jammed' AND c.point IN ({})",
            points::AT_RATIO
        );
        self.read(self.connection.one(&mean, [], |row| row.get(0)))
    }

    /// Estimated CPU seconds that open runs still take.
    pub(crate) fn remaining_cpu_s(&self, work: &Work) -> Result<f64, StoreError> {
        Ok(self.open_times()?.map_or(work.left, |[_, cpu]| cpu))
    }

    /// Estimated seconds until running and pending cases are done; `None` without running processes
    /// or finished runs.
    pub(crate) fn time_left(&self, work: &Work) -> Result<Option<f64>, StoreError> {
        if work.alive == 0 {
            return Ok(None);
        }
        Ok(self.open_times()?.map(|[wall, _]| wall / work.alive as f64))
    }

    /// Progress of the runs of each point, in the order of the campaign.
    pub(crate) fn point_work(&self) -> Result<Vec<PointWork>, StoreError> {
        self.named(
            "SELECT min(position) AS position, 1.0 * count(*) AS runs,
                 total(state IN ('pending', 'running')) AS open,
                 total(CASE WHEN state IN ('pending', 'running')
                     THEN min(1.0 * steps_done / steps, 1.0) END) AS done
             FROM cases WHERE counts GROUP BY point ORDER BY 1",
            [],
        )
    }

    /// Parameters, steps and CPU seconds of about a thousand runs that this machine has computed,
    /// with any build: whether contacts are many matters more than the build.
    pub(crate) fn measured_runs(&self) -> Result<Vec<(Params, u64, f64)>, StoreError> {
        #[derive(Deserialize)]
        struct MeasuredRun {
            #[serde(deserialize_with = "json")]
            params: Params,
            computed: u64,
            cpu_time_s: f64,
            host: String,
        }
        let here = process::ProcessIdentity::of_this_process().host;
        let mut runs: Vec<MeasuredRun> = self.sampled_runs(
            "p.params, r.computed, r.cpu_time_s, o.host",
            "cases c ON c.id = r.case_id JOIN points p ON p.id = c.point
             JOIN processes o ON o.id = r.process",
        )?;
        runs.retain(|run| run.cpu_time_s > 0.0 && run.host == here);
        let runs = runs.into_iter();
        Ok(runs
            .map(|run| (run.params, run.computed, run.cpu_time_s))
            .collect())
    }

    /// Processes that own cases.
    pub(crate) fn processes(&self) -> Result<Vec<ProcessLine>, StoreError> {
        #[derive(Deserialize)]
        struct Owner {
            id: i64,
            host: String,
            pid: u32,
            silent_s: f64,
            running: u64,
        }
        let read = || {
            let owners: Vec<Owner> = self.connection.named(
                "SELECT p.id, p.host, p.pid, max(?1 - p.heartbeat, 0) / 1000.0 AS silent_s,
                     count(*) AS running
                 FROM processes p JOIN cases c ON c.owner = p.id
                 WHERE c.state = 'running' GROUP BY p.id ORDER BY p.id",
                [process::now()],
            )?;
            let alive = ActiveProcess::living(&self.connection)?;
            let lines = owners.into_iter().map(|owner| ProcessLine {
                host: owner.host,
                pid: owner.pid,
                silent_s: owner.silent_s,
                running: owner.running,
                alive: alive.contains(&owner.id),
            });
            Ok(lines.collect())
        };
        self.read(read())
    }
}
