//! Changes of the state of a case, and its rank among pending ones.

use super::failures;
use super::statements::Statements;
use crate::model::case::State;
use crate::system::process::now;
use rusqlite::{Connection, params, params_from_iter};

/// After this many successive deaths a case waits until no other is pending.
pub(super) const SUSPECT: u32 = 3;
/// Offset added to the rank of a case that waits for all others, and subtracted for a started one.
const AHEAD: i64 = 1 << 40;

/// Sets a final state of a case.
pub(super) fn end(
    connection: &Connection,
    case: i64,
    state: State,
    steps: u64,
) -> rusqlite::Result<()> {
    connection.run(
        "UPDATE cases SET state = ?2, owner = NULL, steps_done = ?3, changed_at = ?4 WHERE id = ?1",
        params![case, state.name(), steps, now()],
    )
}

/// Sets all running cases of a process to pending.
pub(super) fn free(connection: &Connection, process: i64) -> rusqlite::Result<usize> {
    free_where(connection, "owner = ?2 AND state = 'running'", &[process])
}

/// Sets cases that meet a condition to pending, with parameters from ?2 on; started ones continue
/// first.
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

/// Sets cases that ended or whose data changed to pending: earlier deaths are reset, and they
/// continue from the last stored state.
pub(super) fn reopen(
    connection: &Connection,
    condition: &str,
    parameters: &[i64],
) -> rusqlite::Result<usize> {
    failures::mark_retried(connection, condition, parameters)?;
    connection.run(
        &format!(
            "UPDATE cases SET deaths = ?1, steps_done = max(
                 coalesce((SELECT max(steps) FROM checkpoints WHERE case_id = cases.id), 0),
                 coalesce((SELECT e.steps FROM ends e WHERE case_id = cases.id AND e.state IS NOT NULL), 0))
             WHERE {condition}"
        ),
        params_from_iter([&[0], parameters].concat()),
    )?;
    free_where(connection, condition, parameters)
}

/// Deletes all of a case but its failures, to be computed again from its start; it keeps frames if
/// it did before.
pub(super) fn delete_data(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    for table in ["samples", "frames", "checkpoints", "results", "ends"] {
        connection.run(&format!("DELETE FROM {table} WHERE case_id = ?1"), [case])?;
    }
    connection.run(
        "UPDATE cases SET steps_done = 0, samples_digest = NULL,
             frames_from = frames_from * 0, frames_until = frames_until * 0 WHERE id = ?1",
        [case],
    )
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
