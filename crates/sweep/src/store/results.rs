//! Results: averages of runs and their storage.

use super::digest::{self, Digest, DigestMismatch, whole};
use super::ends::RunEnd;
use super::samples;
use super::statements::Statements;
use crate::data::{self, Kind};
use crate::measure::RunData;
use crate::measure::doubt::Doubt;
use crate::measure::numbers::{self, Level};
use crate::model::case::State;
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params_from_iter};
use sd_core::{Params, Sample};
use std::sync::LazyLock;

/// Description of a result.
pub(super) const WORDS: &str = "the result of a run";

/// Number of columns of the case among those in front of the numbers that the digest covers.
pub(super) const OF_CASE: usize = 5;

/// The columns covered by the digest of a result, from the tables `c` of cases, `p` of points and
/// `r` of results; then the digest.
pub(super) static COVERED: LazyLock<String> = LazyLock::new(|| {
    format!(
        "c.key, p.digest AS point_digest, c.state, c.steps_done, c.samples_digest, r.{}, r.digest",
        columns().replace(", ", ", r.")
    )
});

/// The columns of a result.
pub(super) fn columns() -> String {
    let numbers = numbers::columns(Level::Runs).map(|number| number.name);
    let columns: Vec<&str> = numbers.chain(["process", "doubts"]).collect();
    columns.join(", ")
}

/// A value of a column in its stored form.
pub(super) fn stored(value: data::Value) -> Value {
    match value {
        data::Value::Number(number) => number.into(),
        data::Value::Count(count) => whole(count),
        data::Value::Word(word) => Value::Text(word.to_owned()),
    }
}

/// A number of a row; 0 for a missing count, NaN for another missing number.
pub(super) fn read(row: &Row<'_>, column: usize, kind: Kind) -> rusqlite::Result<data::Value> {
    Ok(match kind {
        Kind::Count => data::Value::Count(row.get::<_, Option<u64>>(column)?.unwrap_or(0)),
        _ => data::Value::Number(row.get::<_, Option<f64>>(column)?.unwrap_or(f64::NAN)),
    })
}

/// Writes a result.
static INSERT: LazyLock<String> = LazyLock::new(|| {
    let columns = columns();
    let places = vec!["?"; columns.split(", ").count() + 2].join(", ");
    format!("INSERT OR REPLACE INTO results (case_id, {columns}, digest) VALUES ({places})")
});

/// The part of a case that the digest of its result covers.
pub(super) struct Covered {
    pub(super) id: i64,
    pub(super) key: String,
    pub(super) point: i64,
    pub(super) params: Params,
    pub(super) samples: Option<i64>,
}

/// Writes the result of the first `steps` of the run of a case, some of them discarded, and its
/// state. Its samples are read from the store unless they are given.
pub(super) fn put(
    connection: &Connection,
    case: &Covered,
    (state, steps, discard): (State, u64, u64),
    end: &RunEnd,
    samples: Option<&[(u64, Sample)]>,
) -> rusqlite::Result<()> {
    let (mut run, mut last) = (RunData::new(&case.params, discard), None);
    let mut add = |step, sample: &Sample| {
        if step < steps {
            last = Some(sample.counters);
            run.add(step, sample);
        }
    };
    match samples {
        Some(samples) => samples.iter().for_each(|(step, sample)| add(*step, sample)),
        None => samples::each(connection, case.id, |step, sample| {
            add(step, &sample);
            Ok(())
        })?,
    }
    // Of a run cut short those of its last sample.
    run.counters = last.filter(|_| steps < end.steps).unwrap_or(end.counters);
    run.steps = steps;
    run.wall_time_s = end.wall_time_s;
    run.cpu_time_s = end.cpu_time_s;
    run.resumed = end.resumed.into();
    run.finished_at = u64::try_from(end.finished_at).unwrap_or(0);
    run.finish();
    let doubts = Doubt::write(&Doubt::of(&run));
    let numbers = run.result().map(|value| value.map_or(Value::Null, stored));
    let values: Vec<Value> = numbers
        .chain([end.process.into(), Value::Text(doubts)])
        .collect();
    let covered = [
        Value::Text(case.key.clone()),
        case.point.into(),
        Value::Text(state.name().to_owned()),
        whole(steps),
        case.samples.into(),
    ];
    let digest = Digest::default().with(&covered).with(&values).finish();
    let (id, digest) = (case.id.into(), digest.into());
    let row = std::iter::once(&id).chain(&values).chain([&digest]);
    connection.run(&INSERT, params_from_iter(row))
}

/// Checks the digest of the result of a case.
pub(super) fn check(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    let query = format!("{} AND c.id = ?1", select());
    digest::each(connection, &query, [case], |_, is_whole, _| {
        DigestMismatch::unless(is_whole, WORDS)
    })
}

/// Selects the columns covered by the digests of all results that count, the digests, and the row
/// numbers.
pub(super) fn select() -> String {
    format!(
        "SELECT {}, r.rowid FROM results r JOIN cases c ON c.id = r.case_id JOIN points p ON p.id = c.point
         WHERE c.state IN ('done', 'jammed')",
        *COVERED
    )
}
