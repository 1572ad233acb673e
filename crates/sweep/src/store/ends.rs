//! The ends of runs: steps computed, and last states from which runs continue.

use super::digest::{Sealed, whole};
use super::statements::Statements;
use super::{Checkpoint, Damage, samples};
use rusqlite::{Connection, Row};
use sd_core::Sample;
use sd_core::simulation::Counters;

/// The ends of runs.
pub(super) const SEALED: Sealed = Sealed {
    table: "ends",
    columns: "steps, jammed, minimum_gap, stages, unconverged_stages, worst_residual, worst_friction_error, jam_events, \
              jammed_steps, jammed_stages, inexact_stages, wall_time_s, cpu_time_s, resumed, process, finished_at, state",
    with_key: true,
    words: "the end of a run",
};

/// Steps computed of a run.
#[derive(Debug, Clone)]
pub(super) struct RunEnd {
    pub(super) steps: u64,
    pub(super) jammed: bool,
    /// Counters of these steps.
    pub(super) counters: Counters,
    pub(super) wall_time_s: f64,
    pub(super) cpu_time_s: f64,
    /// Number of times it was resumed from a checkpoint.
    pub(super) resumed: u32,
    pub(super) process: i64,
    pub(super) finished_at: i64,
    /// A checkpoint of the last state, without samples.
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
        let counters = &self.counters;
        let values = [
            whole(self.steps),
            self.jammed.into(),
            counters.minimum_gap.into(),
            whole(counters.stages),
            whole(counters.unconverged_stages),
            counters.worst_residual.into(),
            counters.worst_friction_error.into(),
            whole(counters.jam_events),
            whole(counters.jammed_steps),
            whole(counters.jammed_stages),
            whole(counters.inexact_stages),
            self.wall_time_s.into(),
            self.cpu_time_s.into(),
            self.resumed.into(),
            self.process.into(),
            self.finished_at.into(),
            self.state.clone().into(),
        ];
        SEALED.put(connection, Some(key), &values, &[("case_id", case.into())])
    }

    /// The end of the run of a case, if it was completed.
    ///
    /// # Errors
    /// Those of the query, and [`DigestMismatch`](super::digest::DigestMismatch) if it was changed.
    pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Option<Self>> {
        Ok(SEALED
            .all(connection, "t.case_id = ?1", [case], Self::read)?
            .pop())
    }

    fn read(row: &Row<'_>) -> rusqlite::Result<Self> {
        let number = |column| row.get(column).map(|n: Option<f64>| n.unwrap_or(f64::NAN));
        Ok(Self {
            steps: row.get(0)?,
            jammed: row.get(1)?,
            counters: Counters {
                minimum_gap: number(2)?,
                stages: row.get(3)?,
                unconverged_stages: row.get(4)?,
                worst_residual: number(5)?,
                worst_friction_error: number(6)?,
                jam_events: row.get(7)?,
                jammed_steps: row.get(8)?,
                jammed_stages: row.get(9)?,
                inexact_stages: row.get(10)?,
                ..Counters::default()
            },
            wall_time_s: number(11)?,
            cpu_time_s: number(12)?,
            resumed: row.get(13)?,
            process: row.get(14)?,
            finished_at: row.get(15)?,
            state: row.get(16)?,
        })
    }

    /// Counters of its first steps: for a cut run those of its last sample.
    pub(super) fn counters_at(&self, steps: u64, samples: &[(u64, Sample)]) -> Counters {
        match samples.last() {
            Some((_, last)) if steps < self.steps => last.counters,
            _ => self.counters,
        }
    }
}

/// Number of steps of a completed run.
pub(super) fn steps_of(connection: &Connection, case: i64) -> rusqlite::Result<Option<u64>> {
    connection.value("SELECT steps FROM ends WHERE case_id = ?1", [case])
}

/// Deletes the unusable last state of a run.
pub(super) fn drop_state(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    connection.run("UPDATE ends SET state = NULL WHERE case_id = ?1", [case])?;
    SEALED.seal(connection, "t.case_id = ?1", [case])
}

/// The last state of a completed run, with all its samples, from which it can continue.
pub(super) fn resumable_end(
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
    end.samples.retain(|(step, _)| *step < end.snapshot.steps());
    Ok(Some(Ok(end)))
}
