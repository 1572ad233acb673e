//! Failures: storing and listing them.

use super::digest::{Sealed, whole};
use super::statements::Statements;
use super::{Store, StoreError};
use crate::system::process;
use rusqlite::{Connection, Row, params, params_from_iter};
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
    /// Pair of spheres at which it failed, if known.
    pub pair: Option<(u64, u64)>,
    /// Gap of that pair.
    pub gap: Option<f64>,
    /// The state before that step, as input of `sweep solve`; `None` if it failed before there was
    /// one.
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
pub(super) fn insert(connection: &Connection, case: i64, failed: Attempt) -> rusqlite::Result<()> {
    let (key, attempts): (String, u64) = connection.one(
        "SELECT key, attempts FROM cases WHERE id = ?1",
        [case],
        |row| row.try_into(),
    )?;
    let values = [
        whole(if failed.attempt == 0 {
            attempts
        } else {
            failed.attempt
        }),
        failed.error.into(),
        whole(failed.step),
        failed.strain.into(),
        failed.pair.map(|pair| whole(pair.0)).into(),
        failed.pair.map(|pair| whole(pair.1)).into(),
        failed.gap.into(),
        failed.snapshot.into(),
        failed.process.into(),
        failed.failed_at.into(),
        false.into(),
    ];
    SEALED.put(connection, Some(&key), &values, &[("case_id", case.into())])
}

/// The failures of a case.
pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Vec<Attempt>> {
    let of_case = "t.case_id = ?1 ORDER BY t.id";
    SEALED.all(connection, of_case, [case], |row| attempt(row, 0))
}

/// Reads a failure from a row, starting at a column.
fn attempt(row: &Row<'_>, from: usize) -> rusqlite::Result<Attempt> {
    let (i, j): (Option<u64>, Option<u64>) = (row.get(from + 4)?, row.get(from + 5)?);
    Ok(Attempt {
        attempt: row.get(from)?,
        error: row.get(from + 1)?,
        step: row.get(from + 2)?,
        strain: row.get(from + 3)?,
        pair: i.zip(j),
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
    /// [`StoreError::Damaged`], and I/O or SQLite errors.
    pub fn failures(&self, limit: u32) -> Result<Vec<FailureLine>, StoreError> {
        self.last_failures("c.counts", "NULL", params![limit])
    }

    /// The last failures with the states before them, or that of the case with this key.
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
                seed: row.get(1)?,
                params: super::schema::params(row, 2)?,
                failed: attempt(row, 3)?,
            })
        })
    }
}

/// Records that cases that meet a condition, with parameters from ?2 on, are pending again after
/// their failures.
pub(super) fn mark_retried(
    connection: &Connection,
    condition: &str,
    parameters: &[i64],
) -> rusqlite::Result<()> {
    let parameters = [&[1], parameters].concat();
    let cases = format!("case_id IN (SELECT id FROM cases WHERE {condition})");
    let retried = format!("UPDATE failures SET retried = ?1 WHERE NOT retried AND {cases}");
    if connection.change(&retried, params_from_iter(&parameters))? > 0 {
        let which = format!("t.retried = ?1 AND t.{cases}");
        SEALED.seal(connection, &which, params_from_iter(&parameters))?;
    }
    Ok(())
}
