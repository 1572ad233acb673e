//! The runs of the points for reports, each checked by its digest.

use super::digest::{Digest, DigestMismatch};
use super::results::{self, COVERED};
use super::schema::{are_axes_of, params, state};
use super::statements::Statements;
use super::{Store, StoreError, campaign, processes, request, rules};
use crate::data::Kind;
use crate::measure::PointRun;
use crate::measure::doubt::Doubt;
use crate::measure::numbers::{self, Level};
use crate::model::case::{CaseKey, State};
use crate::model::protocol::Protocol;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, Row};
use sd_core::Params;
use std::collections::HashMap;
use std::sync::Arc;

impl Store {
    /// All cases of the grid in the order of the file, each checked by its digest.
    pub(crate) fn point_runs(&self) -> Result<Vec<PointRun>, StoreError> {
        self.read(point_runs(&self.connection))
    }
}

impl Store {
    /// Checks what commands show of all cases, their points, results and processes, but not the
    /// numbers of results.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub(crate) fn verify(&self) -> Result<(), StoreError> {
        let connection = &self.connection;
        let checked = campaign::SEALED
            .check(connection, "true", [])
            .and_then(|()| processes::SEALED.check(connection, "true", []))
            .and_then(|()| rules::check(connection))
            .and_then(|()| look(connection, "c.id", "true", |_, known| known.map(drop)));
        self.read(checked)
    }
}

/// See [`Store::point_runs`].
fn point_runs(connection: &Connection) -> rusqlite::Result<Vec<PointRun>> {
    campaign::SEALED.check(connection, "true", [])?;
    rules::check(connection)?;
    let mut runs = Vec::new();
    look(
        connection,
        &COVERED,
        "c.position IS NOT NULL",
        |row, known| {
            let (key, point) = known?;
            if row.get(6)? {
                runs.push(point_run(row, key, point)?);
            }
            Ok(())
        },
    )?;
    // Sorted here: SQLite would copy all columns.
    runs.sort_unstable_by_key(|run: &PointRun| run.position);
    Ok(runs)
}

/// Calls `each` with the row of every case that meets a condition, and with its key and point, or
/// an error if these were changed. Columns of `more` start at 12.
pub(super) fn look(
    connection: &Connection,
    more: &str,
    condition: &str,
    mut each: impl FnMut(&Row<'_>, rusqlite::Result<(CaseKey, &KnownPoint)>) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    let (protocol, grid): (String, String) = connection
        .one("SELECT protocol, grid FROM campaign", [], |row| {
            row.try_into()
        })
        .map_err(|_| DigestMismatch::error("the campaign"))?;
    let protocol: Protocol =
        serde_json::from_str(&protocol).map_err(|_| DigestMismatch::error("the campaign"))?;
    let points: HashMap<i64, rusqlite::Result<KnownPoint>> =
        connection.all("SELECT id, params, axes, digest FROM points", [], |row| {
            Ok((row.get(0)?, KnownPoint::read(row, &protocol)))
        })?;
    let mut query = connection.prepare(&format!(
        "SELECT c.key, c.seed, c.steps, c.sample_stride, c.state, c.position, c.counts, c.point,
             r.case_id, e.steps, e.jammed,
             EXISTS (SELECT 1 FROM failures WHERE case_id = c.id AND NOT retried),
             {more}
         FROM cases c LEFT JOIN points p ON p.id = c.point
         LEFT JOIN results r ON r.case_id = c.id AND c.state IN ('done', 'jammed')
         LEFT JOIN ends e ON e.case_id = c.id AND c.state NOT IN ('done', 'jammed')
         WHERE {condition}"
    ))?;
    let (mut positions, mut keys) = (Vec::new(), Vec::new());
    let mut rows = query.query([])?;
    while let Some(row) = rows.next()? {
        let position: Option<u64> = row.get(5)?;
        let known = match points.get(&row.get(7)?) {
            Some(Ok(point)) => point
                .checked_key(row, position.is_some())
                .map(|key| (key, point)),
            Some(Err(error)) => Err(DigestMismatch::error(DigestMismatch::words(error))),
            None => Err(DigestMismatch::error("the point of a case is missing")),
        };
        if let (Ok((key, _)), Some(position)) = (&known, position) {
            positions.push(position);
            keys.push(key.number());
        }
        each(row, known)?;
    }
    positions.sort_unstable();
    let numbers = 0..positions.len() as u64;
    if positions.into_iter().eq(numbers) && request::grid(keys.into_iter()) == grid {
        return Ok(());
    }
    Err(DigestMismatch::error(
        "the grid of the campaign is incomplete: a case is missing",
    ))
}

/// The point of a case.
pub(super) struct KnownPoint {
    text: String,
    params: Arc<Params>,
    steps: u64,
}

impl KnownPoint {
    /// A row of the points.
    ///
    /// # Errors
    /// [`DigestMismatch`] if it was changed.
    fn read(row: &Row<'_>, protocol: &Protocol) -> rusqlite::Result<Self> {
        let mut params = params(row, 1)?;
        let digest = Digest::default().with_row(row, 1..2)?.finish();
        if digest != row.get::<_, i64>(3)? || !are_axes_of(row.get_ref(2)?.as_str()?, &params) {
            return Err(DigestMismatch::error(
                "checksum mismatch in the parameters of a point",
            ));
        }
        // The store may be shown up to one of its segments.
        params.segments.truncate(protocol.segments.len());
        Ok(Self {
            text: row.get(1)?,
            steps: protocol.with_time_step(params.time_step).steps(),
            params: Arc::new(params),
        })
    }

    /// The key of a row whose first columns are key, seed, steps, sample stride, state; then from 8
    /// on whether there is a result, the end of an open case, and whether there is a failure that
    /// was not retried.
    ///
    /// # Errors
    /// [`DigestMismatch`] if these are inconsistent.
    fn checked_key(&self, row: &Row<'_>, is_in_grid: bool) -> rusqlite::Result<CaseKey> {
        let (seed, steps, stride): (u64, u64, u64) = (row.get(1)?, row.get(2)?, row.get(3)?);
        let key = CaseKey::of_text(&self.text, seed, stride);
        let written = row.get_ref(0)?.as_str()?;
        if key.to_string() != written {
            return Err(DigestMismatch::error(format!(
                "the parameters of case {written} are not those it was named for"
            )));
        }
        let has_result = row.get_ref(8)? != ValueRef::Null;
        let (end, jammed): (Option<u64>, Option<bool>) = (row.get(9)?, row.get(10)?);
        let is_covered = end.is_some_and(|end| end >= steps) || jammed == Some(true);
        let has_failed: bool = row.get(11)?;
        let fits = match state(row.get_ref(4)?)? {
            State::Done | State::Jammed => has_result,
            State::Failed => has_failed && !has_result && !is_covered,
            State::Pending | State::Running => !has_failed && !has_result && !is_covered,
        };
        if !fits || (is_in_grid && steps != self.steps) {
            return Err(DigestMismatch::error(format!(
                "the state of case {written} contradicts its result or its length"
            )));
        }
        Ok(key)
    }
}

/// First of the columns that the digest of a result covers in a row of [`point_runs`].
const OF_RESULT: usize = 12;

/// One row of [`point_runs`].
fn point_run(row: &Row<'_>, key: CaseKey, point: &KnownPoint) -> rusqlite::Result<PointRun> {
    let last = row.as_ref().column_count() - 1;
    let has_result = row.get_ref(8)? != ValueRef::Null;
    if has_result
        && Digest::default().with_row(row, OF_RESULT..last)?.finish() != row.get::<_, i64>(last)?
    {
        return Err(DigestMismatch::error(format!(
            "checksum mismatch in the result of run {key}"
        )));
    }
    let mut numbers = Vec::new();
    let mut doubts = Vec::new();
    if has_result {
        let first = OF_RESULT + results::OF_CASE;
        for (number, column) in numbers::columns(Level::Runs).zip(first..) {
            let value: Option<f64> = match number.kind(Level::Runs) {
                Kind::Count => row.get::<_, Option<u64>>(column)?.map(|count| count as f64),
                _ => row.get(column)?,
            };
            numbers.push(value.unwrap_or(f64::NAN));
        }
        doubts = Doubt::read(row.get_ref("doubts")?.as_str()?);
    }
    let params = point.params.clone();
    Ok(PointRun {
        position: row.get::<_, Option<u64>>(5)?.unwrap_or(0),
        key: key.to_string(),
        sample_every: row.get::<_, u64>(3)? as f64 * params.time_step,
        params,
        seed: row.get(1)?,
        state: state(row.get_ref(4)?)?,
        doubts,
        numbers: numbers.into(),
    })
}
