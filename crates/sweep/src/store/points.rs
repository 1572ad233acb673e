//! The runs of the points for reports, each checked by its digest.

use super::digest::{Digest, DigestMismatch};
use super::results::COVERED;
use super::schema::{axis_cells, params, state};
use super::statements::Statements;
use super::{Store, StoreError, campaign, request, rules};
use crate::measure::Steadiness;
use crate::measure::doubt::Doubt;
use crate::measure::sampled::{self, MEANS, Number};
use crate::model::case::{CaseKey, State};
use crate::model::protocol::Protocol;
use rusqlite::types::{Value, ValueRef};
use rusqlite::{Connection, Row};
use sd_core::Params;
use std::collections::HashMap;
use std::sync::Arc;

/// One case with its result, if it has one.
#[derive(Debug, Clone)]
pub struct PointRun {
    /// Its position in the campaign file, from 0.
    pub position: u64,
    /// Its key.
    pub key: String,
    /// Its parameters.
    pub params: Arc<Params>,
    /// Its seed.
    pub seed: u64,
    /// Its state.
    pub state: State,
    /// Mean viscosity in full.
    pub viscosity: Option<f64>,
    /// Its median.
    pub viscosity_median: Option<f64>,
    /// Mean viscosity from the stresslets alone.
    pub viscosity_stresslet: Option<f64>,
    /// Mean first normal stress difference.
    pub normal_stress_difference: Option<f64>,
    /// Means of the components and parts of the stress, and of the numbers of the contact network
    /// where they were observed, in the order of [`sampled::means`].
    pub(crate) means: [Option<f64>; MEANS],
    /// Samples averaged.
    pub samples: u64,
    /// Sum of contacts over them.
    pub contacts: u64,
    /// Sum of activated contacts.
    pub activated: u64,
    /// Sum of rolling contacts.
    pub rolling: u64,
    /// Sum of approach velocities.
    pub approach: f64,
    /// Smallest gap of the run.
    pub minimum_gap: Option<f64>,
    /// Right-hand sides with contacts.
    pub stages: u64,
    /// Of these, unconverged ones.
    pub unconverged_stages: u64,
    /// Of these, with friction off by more than 1e-3 of the largest force.
    pub inexact_stages: u64,
    /// Reasons why its numbers are doubtful, if any.
    pub doubts: Vec<Doubt>,
    /// Contact problems without a solution.
    pub jammed_stages: u64,
    /// Worst residual of the run.
    pub worst_residual: Option<f64>,
    /// Seconds of computing.
    pub wall_time_s: Option<f64>,
    /// Seconds of CPU.
    pub cpu_time_s: Option<f64>,
    /// Strain discarded.
    pub discard: Option<f64>,
    /// Strain between samples.
    pub sample_every: f64,
    /// Measures of steadiness.
    pub steadiness: Option<Steadiness>,
}

impl PointRun {
    /// Whether it is finished, and broke a rule.
    pub fn is_doubtful(&self) -> bool {
        self.state == State::Done && !self.doubts.is_empty()
    }

    /// Whether it is finished and included in averages.
    pub fn is_sound(&self) -> bool {
        self.state == State::Done && self.doubts.is_empty()
    }
}

impl Store {
    /// All cases of the grid in the order of the file, each checked by its digest.
    pub(crate) fn point_runs(&self) -> Result<Vec<PointRun>, StoreError> {
        self.read(point_runs(&self.connection))
    }
}

/// See [`Store::point_runs`].
fn point_runs(connection: &Connection) -> rusqlite::Result<Vec<PointRun>> {
    campaign::SEALED.check(connection, "true", [])?;
    rules::check(connection)?;
    let more = format!(
        "r.viscosity, r.viscosity_median, r.viscosity_stresslet, r.samples, r.contacts, r.activated, r.rolling, r.approach,
         r.minimum_gap, r.stages, r.unconverged_stages, r.worst_residual, r.wall_time_s, r.normal_stress_difference,
         r.jammed_stages, r.doubts, r.cpu_time_s, r.discard_step, r.viscosity_part_1, r.viscosity_part_2,
         r.viscosity_part_3, r.viscosity_part_4, r.viscosity_variance, r.viscosity_correlation, r.inexact_stages, {}, {}",
        sampled::listed(Number::has_mean, "r.", ""),
        *COVERED
    );
    let mut runs = Vec::new();
    look(connection, &more, "c.position IS NOT NULL", |row, known| {
        let (key, point) = known?;
        if row.get(6)? {
            runs.push(point_run(row, key, point)?);
        }
        Ok(())
    })?;
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
        connection.all("SELECT * FROM points", [], |row| {
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
        "the grid is not what was written: a case is missing",
    ))
}

/// The point of a case.
pub(super) struct KnownPoint {
    text: String,
    params: Arc<Params>,
    /// Requested steps.
    steps: u64,
}

impl KnownPoint {
    /// A row of the points.
    ///
    /// # Errors
    /// [`DigestMismatch`] if it was changed.
    fn read(row: &Row<'_>, protocol: &Protocol) -> rusqlite::Result<Self> {
        let last = row.as_ref().column_count() - 1;
        let mut params = params(row, 1)?;
        let digest = Digest::default().with_row(row, 1..last)?.finish();
        let cells: Vec<Value> = (2..last)
            .map(|column| row.get(column))
            .collect::<Result<_, _>>()?;
        if digest != row.get::<_, i64>(last)? || !axis_cells(&params).eq(cells) {
            return Err(DigestMismatch::error(
                "the parameters of a point are not what was written",
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
                "the state of case {written} is not what was written"
            )));
        }
        Ok(key)
    }
}

/// First column of the means in a row of [`point_runs`].
const OF_MEANS: usize = 37;

/// One row of [`point_runs`].
fn point_run(row: &Row<'_>, key: CaseKey, point: &KnownPoint) -> rusqlite::Result<PointRun> {
    let covered = OF_MEANS + MEANS;
    let last = row.as_ref().column_count() - 1;
    let has_result = row.get_ref(8)? != ValueRef::Null;
    if has_result
        && Digest::default().with_row(row, covered..last)?.finish() != row.get::<_, i64>(last)?
    {
        return Err(DigestMismatch::error(format!(
            "the result of run {key} is not what was written"
        )));
    }
    let whole = |column| row.get(column).map(|n: Option<u64>| n.unwrap_or(0));
    let mut means = [None; MEANS];
    for (mean, column) in means.iter_mut().zip(OF_MEANS..) {
        *mean = row.get(column)?;
    }
    let params = point.params.clone();
    let discarded: Option<u64> = row.get(29)?;
    Ok(PointRun {
        position: whole(5)?,
        means,
        key: key.to_string(),
        sample_every: whole(3)? as f64 * params.time_step,
        discard: discarded.map(|steps| steps as f64 * params.time_step),
        params,
        seed: whole(1)?,
        state: state(row.get_ref(4)?)?,
        viscosity: row.get(12)?,
        viscosity_median: row.get(13)?,
        viscosity_stresslet: row.get(14)?,
        samples: whole(15)?,
        contacts: whole(16)?,
        activated: whole(17)?,
        rolling: whole(18)?,
        approach: row.get(19).map(|n: Option<f64>| n.unwrap_or(0.0))?,
        minimum_gap: row.get(20)?,
        stages: whole(21)?,
        unconverged_stages: whole(22)?,
        inexact_stages: whole(36)?,
        worst_residual: row.get(23)?,
        wall_time_s: row.get(24)?,
        normal_stress_difference: row.get(25)?,
        jammed_stages: whole(26)?,
        doubts: row
            .get_ref(27)?
            .as_str_or_null()?
            .map(Doubt::read)
            .unwrap_or_default(),
        cpu_time_s: row.get(28)?,
        steadiness: steadiness(row)?,
    })
}

/// The measures of steadiness of a run, if present.
fn steadiness(row: &Row<'_>) -> rusqlite::Result<Option<Steadiness>> {
    let number = |column: usize| row.get::<_, Option<f64>>(column);
    let parts = [number(30)?, number(31)?, number(32)?, number(33)?];
    let ([Some(a), Some(b), Some(c), Some(d)], Some(variance), Some(correlation)) =
        (parts, number(34)?, number(35)?)
    else {
        return Ok(None);
    };
    Ok(Some(Steadiness {
        parts: [a, b, c, d],
        correlation,
        variance,
    }))
}
