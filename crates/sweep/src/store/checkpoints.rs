//! Checkpoints of runs: the store keeps the last two of each.

use super::statements::Statements;
use super::{Checkpoint, Damage};
use crate::system::process::now;
use rusqlite::{Connection, params};

/// The checkpoints of a case, the newest first.
pub(super) fn of(
    connection: &Connection,
    case: i64,
) -> rusqlite::Result<Vec<Result<Checkpoint, Damage>>> {
    connection.all(
        "SELECT data FROM checkpoints WHERE case_id = ?1 ORDER BY steps DESC, written_at DESC",
        [case],
        |row| Ok(Checkpoint::decode(row.get_ref(0)?.as_blob()?)),
    )
}

/// Replaces a checkpoint: generation, steps, process and data.
pub(super) fn put(
    connection: &Connection,
    case: i64,
    (generation, steps, process, data): (i64, u64, i64, &[u8]),
) -> rusqlite::Result<()> {
    connection.run(
        "INSERT OR REPLACE INTO checkpoints (case_id, generation, steps, process, written_at, data)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
        params![case, generation, steps, process, now(), data],
    )
}

/// Drops all checkpoints of a case.
pub(super) fn drop_all(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    connection.run("DELETE FROM checkpoints WHERE case_id = ?1", [case])
}

/// Drops those of a case up to a step.
pub(super) fn drop_until(connection: &Connection, case: i64, steps: u64) -> rusqlite::Result<()> {
    let until = "DELETE FROM checkpoints WHERE case_id = ?1 AND steps <= ?2";
    connection.run(until, params![case, steps])
}

/// Drops those of a case after a step.
pub(super) fn drop_after(connection: &Connection, case: i64, steps: u64) -> rusqlite::Result<()> {
    let after = "DELETE FROM checkpoints WHERE case_id = ?1 AND steps > ?2";
    connection.run(after, params![case, steps])
}
