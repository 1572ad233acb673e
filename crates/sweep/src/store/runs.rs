//! What a store keeps of each run: its state, checkpoints, result and failures, under one digest.

use super::digest::{Digest, DigestMismatch, names_before, whole};
use super::samples::stored;
use super::statements::{Statements, as_json, json};
use super::{BadCheckpoint, Checkpoint, Store, StoreError, samples};
use crate::data;
use crate::data::Kind;
use crate::measure::doubt::Doubt;
use crate::measure::numbers::{Level, Number};
use crate::measure::{RunData, numbers};
use crate::model::case::State;
use crate::system::process;
use crate::system::process::now;
use rusqlite::types::{FromSql, Value, ValueRef};
use rusqlite::{Connection, Row, ToSql, params, params_from_iter};
use sd_core::simulation::Counters;
use sd_core::{Params, Sample};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::sync::LazyLock;

/// Tables with results of cases.
pub(super) const OF_CASES: [&str; 5] = ["samples", "frames", "checkpoints", "results", "failures"];
/// After this many successive deaths a case waits until no other is pending.
pub(super) const SUSPECT: u32 = 3;
/// Offset added to the rank of a case that waits for all others, and subtracted for a started one.
const AHEAD: i64 = 1 << 40;
/// Generation of the checkpoint of the last state of a completed run; those of a run in progress
/// have lower ones.
pub(super) const LAST: i64 = 2;

/// The columns of results after the case.
pub(super) static RESULT: LazyLock<String> = LazyLock::new(|| {
    let numbers = numbers::columns(Level::Runs).map(|number| number.name);
    let others = ["process", "doubts", "computed", "jammed", "counters"];
    numbers.chain(others).collect::<Vec<_>>().join(", ")
});

/// The columns that the digest of a run covers, from the tables `c` of cases and `r` of results,
/// besides its failures. The progress of an open run has its own digests.
static COVERED: LazyLock<String> = LazyLock::new(|| {
    let ended = |column: &str| {
        format!("CASE WHEN c.state NOT IN ('pending', 'running') THEN c.{column} END AS {column}")
    };
    let ended = ["state", "steps_done", "samples_digest"]
        .map(ended)
        .join(", ");
    format!("c.key, {ended}, r.{}", RESULT.replace(", ", ", r."))
});

/// A run in a list.
pub(super) struct ListedRun<'r> {
    pub(super) row: &'r Row<'r>,
    pub(super) id: i64,
    /// Whether its digest is the right one.
    pub(super) is_whole: bool,
    /// The right digest; none as long as there is nothing of it.
    right: Option<i64>,
    /// Column of the first number of its result.
    pub(super) numbers: usize,
    /// Columns by name: SQLite compares all names before one, for each row and value.
    columns: &'r HashMap<String, usize>,
}

/// Calls `each` for all cases `c` that meet a condition, with further columns.
pub(super) fn each(
    connection: &Connection,
    more: &str,
    condition: &str,
    parameters: &[&dyn ToSql],
    mut each: impl FnMut(ListedRun<'_>) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    let failures = digests(connection, condition, parameters)?;
    let covered = &*COVERED;
    let mut query = connection.prepare_cached(&format!(
        "SELECT {covered}, c.digest AS digest, c.id{more} FROM cases c
         LEFT JOIN results r ON r.case_id = c.id WHERE {condition}"
    ))?;
    let names = names_before(&query, "digest")?;
    let columns = query.column_names().map(str::to_owned);
    let columns: HashMap<String, usize> = columns.zip(0..).collect();
    let after_case = names.len() - RESULT.split(", ").count();
    let mut rows = query.query(parameters)?;
    while let Some(row) = rows.next()? {
        let id = row.get(names.len() + 1)?;
        let failed = failures.get(&id).copied();
        let mut is_new = failed.is_none();
        for column in 1..names.len() {
            is_new = is_new && row.get_ref(column)? == ValueRef::Null;
        }
        let mut digest = Digest::default().with_row(row, &names)?;
        digest.add("failures", &Value::from(failed));
        let right = (!is_new).then(|| digest.finish());
        each(ListedRun {
            row,
            id,
            is_whole: row.get(names.len()) == Ok(right),
            right,
            numbers: after_case,
            columns: &columns,
        })?;
    }
    Ok(())
}

/// Checks the runs of cases `c` that meet a condition.
pub(super) fn check(
    connection: &Connection,
    condition: &str,
    parameters: &[&dyn ToSql],
) -> rusqlite::Result<()> {
    each(connection, "", condition, parameters, |run| run.check())
}

/// Updates the digests of the runs of cases `c` that meet a condition.
pub(super) fn seal(
    connection: &Connection,
    condition: &str,
    parameters: &[&dyn ToSql],
) -> rusqlite::Result<()> {
    let mut altered = Vec::new();
    each(connection, "", condition, parameters, |run| {
        if !run.is_whole {
            altered.push((run.id, run.right));
        }
        Ok(())
    })?;
    let seal = "UPDATE cases SET digest = ?2 WHERE id = ?1";
    let mut altered = altered.into_iter();
    altered.try_for_each(|run| connection.run(seal, run))
}

impl ListedRun<'_> {
    /// A column by its name.
    pub(super) fn get<T: FromSql>(&self, name: &str) -> rusqlite::Result<T> {
        self.row.get(self.column(name)?)
    }

    /// [`ListedRun::get`] without a copy.
    pub(super) fn get_ref(&self, name: &str) -> rusqlite::Result<ValueRef<'_>> {
        self.row.get_ref(self.column(name)?)
    }

    fn column(&self, name: &str) -> rusqlite::Result<usize> {
        let column = self.columns.get(name).copied();
        column.ok_or_else(|| rusqlite::Error::InvalidColumnName(name.to_owned()))
    }

    /// An error if it was changed.
    pub(super) fn check(&self) -> rusqlite::Result<()> {
        if self.is_whole {
            return Ok(());
        }
        let key: String = self.row.get(0)?;
        let what = format!("checksum mismatch in the state or the result of run {key}");
        Err(DigestMismatch::error(what))
    }
}

/// Ends a case in a final state; its result or its failures are written already.
pub(super) fn end(
    connection: &Connection,
    case: i64,
    state: State,
    steps: u64,
) -> rusqlite::Result<()> {
    connection.run(
        "UPDATE cases SET state = ?2, owner = NULL, steps_done = ?3, changed_at = ?4 WHERE id = ?1",
        params![case, state.name(), steps, now()],
    )?;
    seal(connection, "c.id = ?1", &[&case])
}

/// Sets all running cases of a process to pending.
pub(super) fn free(connection: &Connection, process: i64) -> rusqlite::Result<usize> {
    free_where(connection, "owner = ?2 AND state = 'running'", &[process])
}

/// Sets open cases that meet a condition to pending, with parameters from ?2 on; started ones
/// continue first.
pub(super) fn free_where(
    connection: &Connection,
    condition: &str,
    parameters: &[i64],
) -> rusqlite::Result<usize> {
    let turn = turn("steps_done");
    connection.change(
        &format!(
            "UPDATE cases SET state = 'pending', owner = NULL, changed_at = ?1, turn = {turn}
             WHERE {condition}"
        ),
        params_from_iter([&[now()], parameters].concat()),
    )
}

/// Sets cases that ended or whose data changed, and that meet a condition, to pending: earlier
/// deaths are reset, and they continue from the last stored state. Returns their number.
pub(super) fn reopen(
    connection: &Connection,
    condition: &str,
    parameters: impl rusqlite::Params,
) -> rusqlite::Result<usize> {
    let cases = format!("SELECT id FROM cases WHERE {condition}");
    let cases: Vec<i64> = connection.values(&cases, parameters)?;
    for case in &cases {
        let retried = "UPDATE failures SET retried = 1 WHERE case_id = ?1 AND NOT retried";
        connection.run(retried, [case])?;
        connection.run(
            "UPDATE cases SET deaths = 0, steps_done = coalesce(
                 (SELECT max(steps) FROM checkpoints WHERE case_id = cases.id), 0) WHERE id = ?1",
            [case],
        )?;
        free_where(connection, "id = ?2", &[*case])?;
        seal(connection, "c.id = ?1", &[case])?;
    }
    Ok(cases.len())
}

/// Deletes all of a running case but its failures, to be computed again from its start; it keeps
/// frames if it did before.
pub(super) fn delete_data(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    for table in ["samples", "frames", "checkpoints", "results"] {
        connection.run(&format!("DELETE FROM {table} WHERE case_id = ?1"), [case])?;
    }
    connection.run(
        "UPDATE cases SET steps_done = 0, samples_digest = NULL,
             frames_from = frames_from * 0, frames_until = frames_until * 0 WHERE id = ?1",
        [case],
    )?;
    seal(connection, "c.id = ?1", &[&case])
}

/// Resets a case to pending, without data.
pub(super) fn forget(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    connection.run("DELETE FROM failures WHERE case_id = ?1", [case])?;
    delete_data(connection, case)?;
    reopen(connection, "id = ?1", [case]).map(drop)
}

/// The rank of a case by its steps done, as SQL: before the others if it was started, after them if
/// it kills its processes.
pub(super) fn turn(steps_done: &str) -> String {
    format!(
        "((turn + {AHEAD}) % {AHEAD} + CASE WHEN deaths >= {SUSPECT} THEN {AHEAD}
             WHEN {steps_done} > 0 THEN -{AHEAD} ELSE 0 END)"
    )
}

/// The rank of an ordinary case.
pub(super) fn plain_turn(rank: u64) -> i64 {
    i64::try_from(rank).unwrap_or(i64::MAX).min(AHEAD - 1)
}

/// The checkpoints of a case, the newest first; that of its last state is among them.
pub(super) fn checkpoints(
    connection: &Connection,
    case: i64,
) -> rusqlite::Result<Vec<Result<Checkpoint, BadCheckpoint>>> {
    connection.all(
        "SELECT data FROM checkpoints WHERE case_id = ?1 ORDER BY steps DESC, written_at DESC",
        [case],
        |row| Ok(Checkpoint::decode(row.get_ref(0)?.as_blob()?)),
    )
}

/// A checkpoint as it is stored.
#[derive(Deserialize)]
pub(super) struct StoredCheckpoint {
    pub(super) generation: i64,
    pub(super) steps: u64,
    pub(super) process: i64,
    pub(super) data: Vec<u8>,
}

impl StoredCheckpoint {
    /// Replaces that of its generation of a case.
    pub(super) fn put(&self, connection: &Connection, case: i64) -> rusqlite::Result<()> {
        let put = "INSERT OR REPLACE INTO checkpoints
                 (case_id, generation, steps, process, written_at, data)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6)";
        let (generation, steps, process) = (self.generation, self.steps, self.process);
        connection.run(
            put,
            params![case, generation, steps, process, now(), self.data],
        )
    }
}

/// Deletes the checkpoints of a run in progress up to a step.
pub(super) fn delete_checkpoints(
    connection: &Connection,
    case: i64,
    until: u64,
) -> rusqlite::Result<()> {
    let begun = "DELETE FROM checkpoints WHERE case_id = ?1 AND generation != ?2 AND steps <= ?3";
    connection.run(begun, params![case, LAST, whole(until)])
}

/// The numbers that concern all steps of a run.
fn counters() -> impl Iterator<Item = &'static Number> {
    numbers::kept().filter(|number| number.is_counter())
}

/// What is known of a completed run besides its samples.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct RunEnd {
    /// Its steps.
    pub(super) computed: u64,
    pub(super) jammed: bool,
    /// Those of all its steps.
    #[serde(deserialize_with = "read_counters")]
    pub(super) counters: Counters,
    pub(super) wall_time_s: f64,
    pub(super) cpu_time_s: f64,
    pub(super) resumed: u32,
    pub(super) process: i64,
    pub(super) finished_at: i64,
    /// A checkpoint of the last state.
    pub(super) state: Option<Vec<u8>>,
}

/// Counters from their texts by name, as [`counter_texts`] writes them.
fn read_counters<'de, D: Deserializer<'de>>(column: D) -> Result<Counters, D::Error> {
    let texts: BTreeMap<String, String> = json(column)?;
    let mut last = Sample::default();
    for counter in counters() {
        let text = texts.get(counter.name).map_or("", String::as_str);
        let value = if counter.kind(Level::Samples) == Kind::Count {
            data::Value::Count(text.parse().unwrap_or(0))
        } else {
            data::Value::Number(text.parse().unwrap_or(f64::NAN))
        };
        counter.put(&mut last, value);
    }
    Ok(last.counters)
}

/// Counters as texts with all their digits, by name.
fn counter_texts(counters_of_run: Counters) -> BTreeMap<&'static str, String> {
    let all = Sample {
        counters: counters_of_run,
        ..Sample::default()
    };
    let text = |counter: &'static Number| match counter.of_sample(&all) {
        data::Value::Count(count) => count.to_string(),
        data::Value::Number(number) => format!("{number:?}"),
        data::Value::Word(word) => word.to_owned(),
    };
    counters()
        .map(|counter| (counter.name, text(counter)))
        .collect()
}

impl RunEnd {
    /// The end of the run of a case, if it was completed.
    ///
    /// # Errors
    /// Those of the query, and [`DigestMismatch`] if it was changed.
    pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Option<Self>> {
        check(connection, "c.id = ?1", &[&case])?;
        let end = "SELECT computed, jammed, wall_time_s, cpu_time_s, resumed, process, finished_at,
                 counters, (SELECT data FROM checkpoints k
                 WHERE k.case_id = r.case_id AND generation = ?2) AS state
             FROM results r WHERE case_id = ?1";
        connection.first(end, [case, LAST])
    }

    /// Writes the result of a case: the averages of its first `steps`, some of them discarded. Its
    /// samples are read from the store unless they are given.
    pub(super) fn write(
        &self,
        connection: &Connection,
        (case, params): (i64, &Params),
        (steps, discard): (u64, u64),
        samples: Option<&[(u64, Sample)]>,
    ) -> rusqlite::Result<()> {
        let mut params = params.clone();
        // The store may be shown up to one of the segments.
        let end = (steps as f64 - 0.5) * params.time_step;
        params.segments.retain(|segment| segment.start < end);
        let (mut run, mut last) = (RunData::new(&params, discard), None);
        let mut add = |step, sample: &Sample| {
            if step < steps {
                last = Some(sample.counters);
                run.add(step, sample);
            }
        };
        match samples {
            Some(samples) => samples.iter().for_each(|(step, sample)| add(*step, sample)),
            None => samples::each(connection, case, |step, sample| {
                add(step, &sample);
                Ok(())
            })?,
        }
        // Of a run cut short those of its last sample.
        run.counters = last
            .filter(|_| steps < self.computed)
            .unwrap_or(self.counters);
        run.steps = steps;
        run.wall_time_s = self.wall_time_s;
        run.cpu_time_s = self.cpu_time_s;
        run.resumed = self.resumed.into();
        run.finished_at = u64::try_from(self.finished_at).unwrap_or(0);
        run.finish();
        let doubts = Doubt::write(&Doubt::of(&run));
        let numbers = run.result().map(|value| value.map_or(Value::Null, stored));
        let others = [
            self.process.into(),
            Value::Text(doubts),
            whole(self.computed),
            self.jammed.into(),
            as_json(&counter_texts(self.counters))?,
        ];
        let row = std::iter::once(Value::Integer(case))
            .chain(numbers)
            .chain(others);
        connection.run(&INSERT, params_from_iter(row))
    }
}

/// Writes a result.
static INSERT: LazyLock<String> = LazyLock::new(|| {
    let columns = &*RESULT;
    let places = vec!["?"; columns.split(", ").count() + 1].join(", ");
    format!("INSERT OR REPLACE INTO results (case_id, {columns}) VALUES ({places})")
});

/// The columns of a failure, all but its number and its case.
const COLUMNS: &str =
    "attempt, error, step, strain, sphere_i, sphere_j, gap, snapshot, process, failed_at, retried";

/// The digests of the failures of each case `c` that meets a condition and has any.
pub(super) fn digests(
    connection: &Connection,
    condition: &str,
    parameters: &[&dyn ToSql],
) -> rusqlite::Result<HashMap<i64, i64>> {
    let columns = COLUMNS.replace(", ", ", f.");
    let mut query = connection.prepare_cached(&format!(
        "SELECT f.{columns}, f.case_id AS case_id FROM failures f JOIN cases c ON c.id = f.case_id
         WHERE {condition} ORDER BY f.id"
    ))?;
    let names = names_before(&query, "case_id")?;
    let mut rows = query.query(parameters)?;
    let mut digests = HashMap::new();
    while let Some(row) = rows.next()? {
        let case = row.get(names.len())?;
        let digest = Digest::after(digests.get(&case).copied()).with_row(row, &names)?;
        digests.insert(case, digest.finish());
    }
    Ok(digests)
}

/// Selects the columns of [`Attempt`] from failures `f`.
const ATTEMPT: &str =
    "f.attempt, f.error, f.step, f.strain, f.gap, f.snapshot, f.process, f.failed_at,
     CASE WHEN f.sphere_i IS NOT NULL THEN json_array(f.sphere_i, f.sphere_j) END AS pair";

/// A failed attempt at a case.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Attempt {
    /// Its number, from 1.
    pub attempt: u64,
    /// Its error.
    pub error: String,
    /// The step that failed.
    pub step: u64,
    /// Strain at its start.
    pub strain: f64,
    /// Pair of spheres at which it failed, if known.
    #[serde(deserialize_with = "json")]
    pub pair: Option<(u64, u64)>,
    /// Gap of that pair.
    pub gap: Option<f64>,
    /// The state before that step, as input of `sweep solve`; `None` if it failed before there was
    /// one.
    #[serde(skip_serializing)]
    pub snapshot: Option<String>,
    #[serde(skip_serializing)]
    pub(crate) process: i64,
    #[serde(skip_serializing)]
    pub(crate) failed_at: i64,
}

/// A case that failed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FailureLine {
    /// Its key.
    pub key: String,
    /// Its seed.
    pub seed: u64,
    /// Its parameters.
    #[serde(deserialize_with = "json")]
    pub params: Params,
    /// Its last attempt.
    #[serde(flatten)]
    pub failed: Attempt,
}

impl Attempt {
    /// The failure as one by a process, at the present time.
    pub(super) fn by(self, process: i64) -> Self {
        Self {
            process,
            failed_at: process::now(),
            ..self
        }
    }
}

/// Stores a failure of a case; that of its last attempt has the number 0.
pub(super) fn insert(connection: &Connection, case: i64, failed: &Attempt) -> rusqlite::Result<()> {
    let pair = failed.pair.unzip();
    connection.run(
        &format!(
            "INSERT INTO failures (case_id, {COLUMNS}) VALUES (?1, CASE ?2 WHEN 0
                 THEN (SELECT attempts FROM cases WHERE id = ?1) ELSE ?2 END,
                 ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, 0)"
        ),
        params![
            case,
            failed.attempt,
            failed.error,
            failed.step,
            failed.strain,
            pair.0,
            pair.1,
            failed.gap,
            failed.snapshot,
            failed.process,
            failed.failed_at,
        ],
    )
}

/// The failures of a case.
pub(super) fn failures_of(connection: &Connection, case: i64) -> rusqlite::Result<Vec<Attempt>> {
    let of_case = format!("SELECT {ATTEMPT} FROM failures f WHERE case_id = ?1 ORDER BY id");
    connection.named(&of_case, [case])
}

impl Store {
    /// The last failure of every failed case of the grid, at most `limit` of them, without states.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], and I/O or SQLite errors.
    pub fn failures(&self, limit: u32) -> Result<Vec<FailureLine>, StoreError> {
        let without = ATTEMPT.replace("f.snapshot", "NULL AS snapshot");
        self.last_failures(&without, None, limit)
    }

    /// The last failures with the states before them, or that of the case with this key.
    pub(crate) fn replays(
        &self,
        key: Option<&str>,
        limit: u32,
    ) -> Result<Vec<FailureLine>, StoreError> {
        self.last_failures(ATTEMPT, key, limit)
    }

    fn last_failures(
        &self,
        columns: &str,
        key: Option<&str>,
        limit: u32,
    ) -> Result<Vec<FailureLine>, StoreError> {
        self.read(check(&self.connection, "c.state = 'failed'", &[]))?;
        // An index may be damaged, which no digest shows.
        let query = format!(
            "SELECT c.key, c.seed, p.params, {columns}
             FROM (SELECT case_id, max(id) AS id FROM failures NOT INDEXED GROUP BY case_id) l
             JOIN failures f ON f.id = l.id JOIN cases c ON c.id = l.case_id
             JOIN points p ON p.id = c.point
             WHERE c.state = 'failed' AND c.key IS coalesce(?2, c.key) AND (?2 IS NOT NULL OR c.counts)
             ORDER BY c.position LIMIT ?1"
        );
        self.named(&query, params![limit, key])
    }
}
