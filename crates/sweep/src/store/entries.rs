//! Entries of another store, read one by one and checked as far as they can be: what salvage and merge trust.

use super::axis_columns;
use super::checksum::{self, Kind};
use super::guard::{Column, columns_of};
use super::samples::{unchecked, write_samples};
use super::schema::{self, CaseRow};
use super::{Checkpoint, count, integer};
use crate::axes::AXES;
use crate::case::Case;
use crate::statistics::Averages;
use crate::stresses::STRESSES;
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, Transaction, params_from_iter};

/// One row: names of columns and values.
pub(super) type Entry = Vec<(String, Value)>;

/// A row by its number, in the columns that our own table has, whatever others there are.
///
/// # Errors
/// Those of the query, and a value of a type that its column cannot have.
pub(super) fn entry(
    old: &Connection,
    table: &str,
    column: &str,
    id: i64,
) -> Result<Option<Entry>, rusqlite::Error> {
    let mut query = old.prepare_cached(&format!(
        "SELECT * FROM {table} WHERE {column} = ?1 LIMIT 1"
    ))?;
    let found: Vec<(usize, &Column)> = columns_of(table)
        .iter()
        .filter_map(|known| Some((query.column_index(&known.name).ok()?, known)))
        .collect();
    query
        .query_row([id], |row| {
            found
                .iter()
                .map(|(place, known)| {
                    let value: Value = row.get(*place)?;
                    if known.takes(&value) {
                        Ok((known.name.clone(), value))
                    } else {
                        Err(rusqlite::Error::InvalidColumnType(
                            *place,
                            known.name.clone(),
                            value.data_type(),
                        ))
                    }
                })
                .collect()
        })
        .optional()
}

/// Writes a row in place of the one with the same key. Its columns are those of [`entry`]: names of ours, never another store's.
pub(super) fn put(
    transaction: &Transaction<'_>,
    table: &str,
    entry: &Entry,
) -> Result<(), rusqlite::Error> {
    debug_assert!(
        entry
            .iter()
            .all(|(name, _)| columns_of(table).iter().any(|own| own.name == *name)),
        "only columns of ours"
    );
    let names: Vec<&str> = entry.iter().map(|(name, _)| name.as_str()).collect();
    let places = vec!["?"; names.len()].join(", ");
    transaction
        .prepare_cached(&format!(
            "INSERT OR REPLACE INTO {table} ({}) VALUES ({places})",
            names.join(", ")
        ))?
        .execute(params_from_iter(entry.iter().map(|(_, value)| value)))?;
    Ok(())
}

/// A value of a row.
pub(super) fn get<'e>(entry: &'e Entry, name: &str) -> Option<&'e Value> {
    entry
        .iter()
        .find(|(known, _)| known == name)
        .map(|(_, value)| value)
}

/// A whole number of a row.
pub(super) fn whole(entry: &Entry, name: &str) -> Option<i64> {
    match get(entry, name)? {
        Value::Integer(whole) => Some(*whole),
        _ => None,
    }
}

/// A text of a row.
pub(super) fn text<'e>(entry: &'e Entry, name: &str) -> Option<&'e str> {
    match get(entry, name)? {
        Value::Text(text) => Some(text),
        _ => None,
    }
}

/// Takes out of the row of a process what it asks for, which means nothing in another store.
fn without_wishes(process: &mut Entry) {
    process.retain(|(name, _)| name != "file" && name != "asks");
}

/// Replaces a value of a row.
pub(super) fn set(entry: &mut Entry, name: &str, value: impl Into<Value>) {
    if let Some((_, place)) = entry.iter_mut().find(|(known, _)| known == name) {
        *place = value.into();
    }
}

/// The case of a row, if it still has its key. One with the key of an older schema gets that of today.
pub(super) fn trusted_case(entry: &mut Entry) -> Option<Case> {
    let described = CaseRow {
        key: text(entry, "key")?,
        params: text(entry, "params")?,
        seed: count(whole(entry, "seed")?),
        steps: count(whole(entry, "steps")?),
        sample_stride: count(whole(entry, "sample_stride")?),
    };
    let case = described.case()?;
    // Columns for other programs follow from the parameters, whatever the other store has in them.
    let of_axes: Vec<Value> = axis_columns::cells(&case.params).collect();
    let key = case.key().to_string();
    if described.key != key {
        if described.key_of_today()? != key {
            return None;
        }
        set(entry, "key", key);
    }
    for (axis, value) in AXES.iter().zip(of_axes) {
        set(entry, axis.key, value);
    }
    Some(case)
}

/// The number of a case in the new store; a case that is in no grid any more is added without a position.
pub(super) fn place(transaction: &Transaction<'_>, row: &Entry) -> Result<i64, rusqlite::Error> {
    let number = |transaction: &Transaction<'_>| {
        transaction
            .prepare_cached("SELECT id FROM cases WHERE key = ?1")?
            .query_row([text(row, "key")], |row| row.get::<_, i64>(0))
            .optional()
    };
    if let Some(id) = number(transaction)? {
        return Ok(id);
    }
    let mut row = row.clone();
    row.retain(|(name, _)| name != "id");
    for place_there in ["position", "point", "reserve"] {
        set(&mut row, place_there, Value::Null);
    }
    set(&mut row, "owner", Value::Null);
    set(&mut row, "state", "pending".to_owned());
    put(transaction, "cases", &row)?;
    Ok(transaction.last_insert_rowid())
}

/// A run that was computed to an end, as another store holds it.
pub(super) struct ComputedRun {
    /// The row of its result.
    pub(super) result: Entry,
    /// The row of its end.
    pub(super) end: Entry,
    pub(super) steps: u64,
    pub(super) jammed: bool,
    pub(super) samples: Vec<(u64, sd_core::Sample)>,
}

/// What there is of the end of a run.
pub(super) enum Found {
    /// Nothing: it was never computed to an end.
    Nothing,
    /// Something that cannot be read, or contradicts itself.
    Untrusted,
    /// All of it, and it is consistent.
    Run(Box<ComputedRun>),
}

/// The run of a case, if it was computed to an end.
pub(super) fn computed_run(old: &Connection, id: i64, row: &Entry, case: &Case) -> Found {
    let is_finished = matches!(text(row, "state"), Some("done" | "jammed"));
    let end = match end_of(old, id, row, case) {
        Ok(Some(end)) => end,
        Ok(None) if !is_finished => return Found::Nothing,
        _ => return Found::Untrusted,
    };
    trusted_run(old, id, row, end, case).map_or(Found::Untrusted, |run| Found::Run(Box::new(run)))
}

/// The row of the end of a run. Where there is none, as in a store of schema 4 or before, or it is damaged, what the result
/// tells of it, without a last state.
fn end_of(
    old: &Connection,
    id: i64,
    row: &Entry,
    case: &Case,
) -> Result<Option<Entry>, rusqlite::Error> {
    if let Ok(Some(end)) = entry(old, "ends", "case_id", id) {
        return whole_row(old, Kind::End, id).map(|()| Some(end));
    }
    let state = text(row, "state").unwrap_or_default();
    if !matches!(state, "done" | "jammed") {
        return Ok(None);
    }
    let Some(result) = entry(old, "results", "case_id", id)? else {
        return Ok(None);
    };
    let jammed_steps = match get(&result, "jammed_strain") {
        Some(Value::Real(strain)) => whole_steps(*strain, case),
        _ => 0,
    };
    let mut end: Entry = [
        "case_id",
        "minimum_gap",
        "stages",
        "unconverged_stages",
        "worst_residual",
        "worst_friction_error",
        "jam_events",
        "jammed_stages",
    ]
    .into_iter()
    .filter_map(|name| Some((name.to_owned(), get(&result, name)?.clone())))
    .collect();
    for (name, value) in [
        ("steps", whole(row, "steps_done").unwrap_or(0)),
        ("jammed", i64::from(state == "jammed")),
        ("jammed_steps", jammed_steps),
    ] {
        end.push((name.to_owned(), value.into()));
    }
    Ok(Some(end))
}

/// A strain in steps.
#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates; wrong ones are found out"
)]
fn whole_steps(strain: f64, case: &Case) -> i64 {
    (strain / case.params.time_step).round() as i64
}

/// A run whose samples are whole and give the averages of its result to the last bit.
fn trusted_run(
    old: &Connection,
    id: i64,
    row: &Entry,
    end: Entry,
    case: &Case,
) -> Option<ComputedRun> {
    let result = entry(old, "results", "case_id", id).ok()??;
    let steps = count(whole(&end, "steps")?);
    let mut samples = samples_of(old, id).ok()?;
    if matches!(text(row, "state"), Some("done" | "jammed")) {
        whole_row(old, Kind::Result, id).ok()?;
    }
    // Of a run that failed on its way on there are more.
    samples.retain(|(step, _)| *step < steps);
    let in_order = samples
        .iter()
        .enumerate()
        .all(|(number, (step, _))| *step == number as u64 * case.sample_stride);
    let whole_run = samples.len() as u64 == steps.div_ceil(case.sample_stride);
    // The result may be that of the beginning of the run only.
    let Some(Value::Real(strain)) = get(&result, "final_strain") else {
        return None;
    };
    let averaged = count(whole_steps(*strain, case));
    let beginning = samples.partition_point(|(step, _)| *step < averaged);
    let averages = Averages::of(
        &samples[..beginning],
        count(whole(&result, "discard_step")?),
    );
    let agrees = |name: &str, value: Option<f64>| match (get(&result, name), value) {
        (Some(Value::Real(stored)), Some(value)) => stored.to_bits() == value.to_bits(),
        (Some(Value::Null), value) => value.is_none_or(f64::is_nan),
        _ => false,
    };
    let trusted = in_order
        && whole_run
        && agrees("viscosity", averages.viscosity.as_ref().map(|d| d.mean))
        && agrees(
            "viscosity_stresslet",
            averages.viscosity_stresslet.as_ref().map(|d| d.mean),
        )
        && agrees(
            "normal_stress_difference",
            averages.normal_stress_difference,
        )
        && STRESSES
            .iter()
            .zip(averages.stresses)
            // A store of schema 6 or before has none of them.
            .all(|(column, mean)| get(&result, column.name).is_none() || agrees(column.name, mean))
        && agrees("dissipation", averages.dissipation)
        && whole(&result, "contacts") == Some(integer(averages.contacts))
        && last_state_fits(&end, steps);
    trusted.then(|| ComputedRun {
        jammed: whole(&end, "jammed") == Some(1),
        result,
        end,
        steps,
        samples,
    })
}

/// The row of a process without its number, or a stand-in if it cannot be read or is not what was written.
pub(super) fn process(old: &Connection, id: i64) -> Entry {
    let found = whole_row(old, Kind::Process, id).and_then(|()| entry(old, "processes", "id", id));
    if let Ok(Some(mut process)) = found {
        process.retain(|(name, _)| name != "id");
        without_wishes(&mut process);
        return process;
    }
    let words = ["boot", "namespace", "start", "version", "build"];
    let counts = [
        "pid",
        "started_at",
        "heartbeat",
        "physics_version",
        "threads",
    ];
    let unknown = ("host", Value::Text("unknown".into()));
    std::iter::once(unknown)
        .chain(words.map(|name| (name, Value::Text(String::new()))))
        .chain(counts.map(|name| (name, Value::Integer(0))))
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
}

/// Makes sure that a row is what was written, in a store that has checksums.
fn whole_row(old: &Connection, kind: Kind, id: i64) -> Result<(), rusqlite::Error> {
    if schema::version_of(old)? < schema::FIRST_WITH_CHECKSUMS {
        return Ok(());
    }
    checksum::check_if_there(old, kind, id)
}

/// The samples of a case, if they are what was written as far as the store can tell.
pub(super) fn samples_of(
    old: &Connection,
    id: i64,
) -> Result<Vec<(u64, sd_core::Sample)>, rusqlite::Error> {
    whole_row(old, Kind::Samples, id)?;
    unchecked(old, id, None)
}

/// Takes over the frames of a case that are whole and not there yet, into the case `to`. Frames of one step are the same,
/// whoever computed them. Says how many were whole, and how many could not be read.
pub(super) fn take_frames(
    old: &Connection,
    id: i64,
    transaction: &Transaction<'_>,
    to: i64,
) -> Result<(u64, u64), rusqlite::Error> {
    let (mut whole, mut damaged) = (0, 0);
    let (steps, is_all) = steps_of_frames(old, id);
    damaged += u64::from(!is_all);
    for step in steps {
        let frame: Result<(f64, Vec<u8>), _> = old
            .prepare_cached("SELECT strain, data FROM frames WHERE case_id = ?1 AND step = ?2")
            .and_then(|mut query| {
                query.query_row([id, step], |row| Ok((row.get(0)?, row.get(1)?)))
            });
        match frame {
            Ok((strain, data)) if crate::trajectory::decode(&data).is_some() => {
                transaction
                    .prepare_cached("INSERT OR IGNORE INTO frames VALUES (?1, ?2, ?3, ?4)")?
                    .execute(rusqlite::params![to, step, strain, data])?;
                whole += 1;
            }
            _ => damaged += 1,
        }
    }
    Ok((whole, damaged))
}

/// Steps of the frames of a case, and whether these are all that can be there.
fn steps_of_frames(old: &Connection, id: i64) -> (Vec<i64>, bool) {
    // A store of the first schema has no frames.
    let Ok(mut query) =
        old.prepare_cached("SELECT step FROM frames WHERE case_id = ?1 ORDER BY step")
    else {
        return (Vec::new(), true);
    };
    let Ok(mut rows) = query.query([id]) else {
        return (Vec::new(), false);
    };
    let mut steps = Vec::new();
    loop {
        match rows.next() {
            Ok(None) => return (steps, true),
            Ok(Some(row)) => match row.get(0) {
                Ok(step) => steps.push(step),
                Err(_) => return (steps, false),
            },
            // Those before a damaged page are whole.
            Err(_) => return (steps, false),
        }
    }
}

/// Whether the last state of a run, if it was kept, is whole and of its last step.
fn last_state_fits(end: &Entry, steps: u64) -> bool {
    match get(end, "state") {
        None | Some(Value::Null) => true,
        Some(Value::Blob(state)) => {
            match Checkpoint::decode(state) {
                Ok(state) => state.snapshot.steps == steps,
                // Of an older program: the run cannot go on from it, but its result stands.
                Err(damage) => damage.is_older(),
            }
        }
        Some(_) => false,
    }
}

impl ComputedRun {
    /// Steps discarded from the averages of its result.
    pub(super) fn discarded(&self) -> u64 {
        whole(&self.result, "discard_step").map_or(0, count)
    }

    /// Whether its last state was kept, so that it can go on from there.
    pub(super) fn continues(&self) -> bool {
        matches!(get(&self.end, "state"), Some(Value::Blob(_)))
    }

    /// Writes it into a store in place of any other of the case, whose row is `case` there.
    pub(super) fn write(
        &mut self,
        transaction: &Transaction<'_>,
        case: i64,
    ) -> Result<(), rusqlite::Error> {
        set(&mut self.result, "case_id", case);
        set(&mut self.end, "case_id", case);
        put(transaction, "results", &self.result)?;
        put(transaction, "ends", &self.end)?;
        checksum::seal(transaction, Kind::End, case)?;
        write_samples(transaction, case, &self.samples)
    }
}

/// All failures of a case.
pub(super) fn failures(old: &Connection, id: i64) -> Result<Vec<Entry>, rusqlite::Error> {
    // Without the index, which may be what is damaged.
    let ids: Vec<i64> = old
        .prepare_cached("SELECT id FROM failures NOT INDEXED WHERE case_id = ?1")?
        .query_map([id], |row| row.get(0))?
        .collect::<Result<_, _>>()?;
    ids.into_iter()
        .filter_map(|id| {
            let failure =
                whole_row(old, Kind::Failure, id).and_then(|()| entry(old, "failures", "id", id));
            failure.transpose()
        })
        .collect()
}

/// A checkpoint of a case and its steps, if its checksum agrees.
pub(super) fn checkpoint(old: &Connection, id: i64, generation: i64) -> Option<(Entry, i64)> {
    let row: i64 = old
        .prepare_cached(
            "SELECT rowid FROM checkpoints NOT INDEXED WHERE case_id = ?1 AND generation = ?2",
        )
        .ok()?
        .query_row([id, generation], |row| row.get(0))
        .ok()?;
    let row = entry(old, "checkpoints", "rowid", row).ok()??;
    let Some(Value::Blob(data)) = get(&row, "data") else {
        return None;
    };
    let steps = Checkpoint::decode(data).ok()?.snapshot.steps;
    Some((row, integer(steps)))
}
