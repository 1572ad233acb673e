//! The ends of runs: steps computed, and last states from which runs continue.

use super::digest::{Sealed, whole};
use super::results::{read, stored};
use super::{Checkpoint, Damage};
use crate::measure::numbers::{self, Level, Number};
use rusqlite::{Connection, Row};
use sd_core::Sample;
use sd_core::simulation::Counters;
use std::sync::LazyLock;

/// The columns before the counters.
pub(super) const BEFORE: &str =
    "steps, jammed, wall_time_s, cpu_time_s, resumed, process, finished_at, state";

/// The ends of runs.
pub(super) fn sealed() -> Sealed {
    static COLUMNS: LazyLock<String> = LazyLock::new(|| {
        let names = counters().map(|counter| counter.name);
        std::iter::once(BEFORE)
            .chain(names)
            .collect::<Vec<_>>()
            .join(", ")
    });
    Sealed {
        table: "ends",
        columns: &COLUMNS,
        with_key: true,
        words: "the end of a run",
    }
}

/// The numbers that concern all steps of a run.
pub(super) fn counters() -> impl Iterator<Item = &'static Number> {
    numbers::kept().filter(|number| number.is_counter())
}

/// Steps computed of a run.
#[derive(Debug, Clone)]
pub(super) struct RunEnd {
    pub(super) steps: u64,
    pub(super) jammed: bool,
    pub(super) counters: Counters,
    pub(super) wall_time_s: f64,
    pub(super) cpu_time_s: f64,
    pub(super) resumed: u32,
    pub(super) process: i64,
    pub(super) finished_at: i64,
    /// A checkpoint of the last state.
    pub(super) state: Option<Vec<u8>>,
}

impl RunEnd {
    /// Stores it for the case with this key, replacing any other.
    pub(super) fn write(
        &self,
        connection: &Connection,
        case: i64,
        key: &str,
    ) -> rusqlite::Result<()> {
        let values = [
            whole(self.steps),
            self.jammed.into(),
            self.wall_time_s.into(),
            self.cpu_time_s.into(),
            self.resumed.into(),
            self.process.into(),
            self.finished_at.into(),
            self.state.clone().into(),
        ];
        let last = Sample {
            counters: self.counters,
            ..Sample::default()
        };
        let counters = counters().map(|counter| stored(counter.of_sample(&last)));
        let values: Vec<_> = values.into_iter().chain(counters).collect();
        sealed().put(connection, Some(key), &values, &[("case_id", case.into())])
    }

    /// The end of the run of a case, if it was completed.
    ///
    /// # Errors
    /// Those of the query, and [`DigestMismatch`](super::digest::DigestMismatch) if it was changed.
    pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Option<Self>> {
        Ok(sealed()
            .all(connection, "t.case_id = ?1", [case], Self::read)?
            .pop())
    }

    fn read(row: &Row<'_>) -> rusqlite::Result<Self> {
        let seconds = |column| row.get(column).map(|n: Option<f64>| n.unwrap_or(f64::NAN));
        let mut last = Sample::default();
        for (counter, column) in counters().zip(8..) {
            counter.put(&mut last, read(row, column, counter.kind(Level::Samples))?);
        }
        Ok(Self {
            steps: row.get(0)?,
            jammed: row.get(1)?,
            counters: last.counters,
            wall_time_s: seconds(2)?,
            cpu_time_s: seconds(3)?,
            resumed: row.get(4)?,
            process: row.get(5)?,
            finished_at: row.get(6)?,
            state: row.get(7)?,
        })
    }
}

/// The last state of a completed run, from which it can continue.
pub(super) fn resumable_end(
    connection: &Connection,
    case: i64,
) -> rusqlite::Result<Option<Result<Checkpoint, Damage>>> {
    let state = RunEnd::of(connection, case)?.and_then(|end| end.state);
    Ok(state.map(|state| Checkpoint::decode(&state)))
}
