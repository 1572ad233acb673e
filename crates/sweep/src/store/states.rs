//! Changes of the state of a case, and its turn among those that wait.

use super::failures;
use super::statements::Statements;
use crate::case::State;
use crate::system::process::now;
use rusqlite::{Connection, params, params_from_iter};

/// After so many deaths in a row a case waits until there is no other.
pub(super) const SUSPECT: u32 = 3;
/// What is added to the turn of a case that waits until there is no other, and taken from that of one that was begun.
const AHEAD: i64 = 1 << 40;

/// Gives a case a state that is an end.
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

/// Makes all running cases of a process pending.
pub(super) fn free(connection: &Connection, process: i64) -> rusqlite::Result<usize> {
    free_where(connection, "owner = ?2 AND state = 'running'", &[process])
}

/// Makes cases pending that meet a condition, with parameters from ?2 on: those that were begun go on before any other.
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

/// The same of cases that ended, or of which something else is kept than before: whatever became of them before is forgiven, and
/// they go on from the last of their states that is kept.
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

/// The turn of a case with so many steps done, as SQL: before the others if it was begun, after them if it kills its processes.
pub(super) fn turn(steps_done: &str) -> String {
    format!(
        "((turn + {AHEAD}) % {AHEAD} + CASE WHEN deaths >= {SUSPECT} THEN {AHEAD}
             WHEN {steps_done} > 0 THEN -{AHEAD} ELSE 0 END)"
    )
}

/// The turn of a case that is neither, by its rank.
pub(super) fn plain_turn(rank: u64) -> i64 {
    i64::try_from(rank).unwrap_or(i64::MAX).min(AHEAD - 1)
}
