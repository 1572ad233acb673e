//! Failures: as they are kept, and as they are listed.

use super::digest::{Sealed, number, whole};
use super::statements::Statements;
use super::{Store, StoreError, count};
use crate::system::process;
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params};
use sd_core::Params;
use serde::Serialize;

/// The failures.
pub(super) const SEALED: Sealed = Sealed {
    table: "failures",
    columns: "attempt, error, step, strain, sphere_i, sphere_j, gap, snapshot, process, failed_at, retried",
    with_key: true,
    words: "a failure",
};

/// A failed attempt at a case.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Attempt {
    /// Its number, from 1.
    pub attempt: u64,
    /// Its error.
    pub error: String,
    /// The step that failed.
    pub step: u64,
    /// Strain at its start.
    pub strain: f64,
    /// Pair of spheres it failed at, if it is known.
    pub pair: Option<(u64, u64)>,
    /// Gap of that pair.
    pub gap: Option<f64>,
    /// The state before that step, as input of `sweep solve`; `None` if it failed before it had a state.
    #[serde(skip)]
    pub snapshot: Option<String>,
    #[serde(skip)]
    pub(crate) process: i64,
    #[serde(skip)]
    pub(crate) failed_at: i64,
}

/// A case that failed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FailureLine {
    /// Its key.
    pub key: String,
    /// Its seed.
    pub seed: u64,
    /// Its parameters.
    pub params: Params,
    /// Its last attempt.
    #[serde(flatten)]
    pub failed: Attempt,
}

/// Keeps a failure of a case; that of its last attempt has the number 0.
pub(super) fn insert(connection: &Connection, case: i64, failed: Attempt) -> rusqlite::Result<()> {
    let (key, attempts): (String, i64) = connection.one(
        "SELECT key, attempts FROM cases WHERE id = ?1",
        [case],
        |row| Ok((row.get(0)?, row.get(1)?)),
    )?;
    let optional = |value: Option<u64>| value.map_or(Value::Null, whole);
    let values = [
        match failed.attempt {
            0 => Value::Integer(attempts),
            attempt => whole(attempt),
        },
        Value::Text(failed.error),
        whole(failed.step),
        number(failed.strain),
        optional(failed.pair.map(|pair| pair.0)),
        optional(failed.pair.map(|pair| pair.1)),
        number(failed.gap),
        failed.snapshot.map_or(Value::Null, Value::Text),
        Value::Integer(failed.process),
        Value::Integer(failed.failed_at),
        Value::Integer(0),
    ];
    let case = [("case_id", Value::Integer(case))];
    SEALED.put(connection, Some(&key), &values, &case)
}

/// The failures of a case.
pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Vec<Attempt>> {
    SEALED.check(connection, "t.case_id = ?1", [case])?;
    let columns = SEALED.columns;
    connection.all(
        &format!("SELECT {columns} FROM failures NOT INDEXED WHERE case_id = ?1 ORDER BY id"),
        [case],
        |row| attempt(row, 0),
    )
}

/// A failure in a row, from a column on.
fn attempt(row: &Row<'_>, from: usize) -> rusqlite::Result<Attempt> {
    let whole = |column| -> rusqlite::Result<Option<u64>> {
        Ok(row.get::<_, Option<i64>>(from + column)?.map(count))
    };
    Ok(Attempt {
        attempt: whole(0)?.unwrap_or(0),
        error: row.get(from + 1)?,
        step: whole(2)?.unwrap_or(0),
        strain: row.get(from + 3)?,
        pair: whole(4)?.zip(whole(5)?),
        gap: row.get(from + 6)?,
        snapshot: row.get(from + 7)?,
        process: row.get(from + 8)?,
        failed_at: row.get(from + 9)?,
    })
}

impl Store {
    /// The last failure of every failed case of the grid, at most `limit` of them, without states.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], and trouble with the file.
    pub fn failures(&self, limit: u32) -> Result<Vec<FailureLine>, StoreError> {
        self.last_failures("c.counts", "NULL", params![limit])
    }

    /// The same with states, or that of the case with this key.
    pub(crate) fn replays(
        &self,
        key: Option<&str>,
        limit: u32,
    ) -> Result<Vec<FailureLine>, StoreError> {
        let which = "c.key IS coalesce(?2, c.key) AND (?2 IS NOT NULL OR c.counts)";
        self.last_failures(which, "f.snapshot", params![limit, key])
    }

    fn last_failures(
        &self,
        which: &str,
        snapshot: &str,
        parameters: impl rusqlite::Params,
    ) -> Result<Vec<FailureLine>, StoreError> {
        self.read(SEALED.check(&self.connection, "c.state = 'failed'", []))?;
        let columns = SEALED
            .columns
            .replace(", ", ", f.")
            .replace("f.snapshot", snapshot);
        let query = format!(
            "SELECT c.key, c.seed, p.params, f.{columns} FROM cases c
                 JOIN points p ON p.id = c.point
             JOIN failures f ON f.id = (SELECT max(id) FROM failures WHERE case_id = c.id)
             WHERE c.state = 'failed' AND {which} ORDER BY c.position LIMIT ?1"
        );
        self.rows(&query, parameters, |row| {
            Ok(FailureLine {
                key: row.get(0)?,
                seed: count(row.get(1)?),
                params: super::points::params(row, 2)?,
                failed: attempt(row, 3)?,
            })
        })
    }
}

/// Records that cases that meet a condition are pending again after their failures.
pub(super) fn mark_retried(connection: &Connection, condition: &str) -> rusqlite::Result<()> {
    let cases = format!("(SELECT id FROM cases WHERE {condition})");
    let changed = connection.execute(
        &format!("UPDATE failures SET retried = 1 WHERE retried = 0 AND case_id IN {cases}"),
        [],
    )?;
    if changed > 0 {
        SEALED.seal(connection, &format!("t.retried AND t.case_id IN {cases}"))?;
    }
    Ok(())
}

/// Makes failed cases that meet a condition pending again: they begin anew, or where they were computed to an end before, go on
/// from there. Returns how many.
pub(super) fn reopen(connection: &Connection, condition: &str) -> rusqlite::Result<usize> {
    let failed = format!("state = 'failed' AND {condition}");
    mark_retried(connection, &failed)?;
    connection.execute(
        &format!(
            "UPDATE cases SET state = 'pending', deaths = 0, changed_at = ?1, turn = {turn},
                 steps_done = coalesce(
                 (SELECT e.steps FROM ends e WHERE e.case_id = cases.id AND e.state IS NOT NULL), 0)
             WHERE {failed}",
            turn = super::claims::turn(
                "(SELECT count(*) FROM ends e WHERE e.case_id = cases.id AND e.state IS NOT NULL)"
            )
            .replace("deaths", "0")
        ),
        [process::now()],
    )
}
