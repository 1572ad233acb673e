//! Failures: storing and listing them.

use super::digest::{Digest, names_before};
use super::statements::Statements;
use super::{Store, StoreError, runs};
use crate::system::process;
use rusqlite::{Connection, Row, ToSql, params};
use sd_core::Params;
use serde::Serialize;
use std::collections::HashMap;

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
pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Vec<Attempt>> {
    let of_case = format!("SELECT {COLUMNS} FROM failures WHERE case_id = ?1 ORDER BY id");
    connection.all(&of_case, [case], |row| attempt(row, 0))
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
        self.read(runs::check(&self.connection, "c.state = 'failed'", &[]))?;
        let columns = COLUMNS.replace(", ", ", f.");
        let columns = columns.replace("f.snapshot", snapshot);
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
