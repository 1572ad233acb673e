//! The runs of the points for reports, each checked by its digest.

use super::digest::DigestMismatch;
use super::entry::{self, Entered};
use super::runs::{self, ListedRun};
use super::schema::{params, state};
use super::{Store, StoreError, processes, rules};
use crate::data::{DataColumn, Kind};
use crate::measure::doubt::Doubt;
use crate::measure::numbers::{self, Level};
use crate::measure::{PointRun, run_table};
use crate::model::case::{CaseKey, State};
use crate::model::protocol::Protocol;
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
    /// All runs of the campaign in its order, one row each. Pending runs have no results.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], and I/O or SQLite errors.
    pub fn runs(&self) -> Result<Vec<DataColumn>, StoreError> {
        let runs = self.point_runs()?;
        let runs: Vec<&PointRun> = runs.iter().collect();
        Ok(run_table(&runs))
    }

    /// Checks what commands show of all cases, their points, results and processes.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub(crate) fn verify(&self) -> Result<(), StoreError> {
        let checked = processes::SEALED.check(&self.connection).and_then(|()| {
            look(&self.connection, |run, known| {
                known.and_then(|_| run.check())
            })
        });
        self.read(checked)
    }
}

/// See [`Store::point_runs`].
fn point_runs(connection: &Connection) -> rusqlite::Result<Vec<PointRun>> {
    let mut runs = Vec::new();
    look(connection, |run, known| {
        let (key, point) = known?;
        run.check()?;
        let position: Option<u64> = run.row.get(run.more + POSITION)?;
        if let Some(position) = position
            && run.row.get(run.more + COUNTS)?
        {
            runs.push(point_run(run, position, key, point)?);
        }
        Ok(())
    })?;
    // Sorted here: SQLite would copy all columns.
    runs.sort_unstable_by_key(|run: &PointRun| run.position);
    Ok(runs)
}

/// Further columns of [`look`], and their places.
const MORE: &str = ", c.seed, c.steps, c.sample_stride, c.state, c.position, c.counts, c.point";
const SEED: usize = 0;
const STEPS: usize = 1;
const STRIDE: usize = 2;
const STATE: usize = 3;
const POSITION: usize = 4;
const COUNTS: usize = 5;
const POINT: usize = 6;

/// Calls `each` for every case, with its key and point, or an error if these were changed. Checks
/// the campaign and the seeds that count.
pub(super) fn look(
    connection: &Connection,
    mut each: impl FnMut(
        &ListedRun<'_>,
        rusqlite::Result<(CaseKey, &KnownPoint)>,
    ) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    let Entered {
        protocol,
        grid,
        rules,
        ..
    } = Entered::read(connection)?;
    let mut points: HashMap<i64, rusqlite::Result<KnownPoint>> = HashMap::new();
    entry::POINTS.each(connection, "true", [], |id, row, altered| {
        let whole = DigestMismatch::unless(altered.is_none(), entry::POINTS.words);
        points.insert(id, whole.and_then(|()| KnownPoint::read(row, &protocol)));
        Ok(())
    })?;
    let (mut positions, mut keys) = (Vec::new(), Vec::new());
    runs::each(connection, MORE, "true", &[], |run| {
        let position: Option<u64> = run.row.get(run.more + POSITION)?;
        let known = match points.get(&run.row.get(run.more + POINT)?) {
            Some(Ok(point)) => point
                .checked_key(&run, position.is_some())
                .map(|key| (key, point)),
            Some(Err(error)) => Err(DigestMismatch::error(DigestMismatch::words(error))),
            None => Err(DigestMismatch::error("the point of a case is missing")),
        };
        if let (Ok((key, _)), Some(position)) = (&known, position) {
            positions.push(position);
            keys.push(key.number());
        }
        each(&run, known)
    })?;
    positions.sort_unstable();
    let numbers = 0..positions.len() as u64;
    if !positions.into_iter().eq(numbers) || entry::grid(keys.into_iter()) != grid {
        return Err(DigestMismatch::error(
            "the grid of the campaign is incomplete: a case is missing",
        ));
    }
    rules::check(connection, &rules)
}

/// The point of a case.
pub(super) struct KnownPoint {
    text: String,
    params: Arc<Params>,
    steps: u64,
}

impl KnownPoint {
    /// A row of the points.
    fn read(row: &Row<'_>, protocol: &Protocol) -> rusqlite::Result<Self> {
        let mut params = params(row, 0)?;
        // The store may be shown up to one of its segments.
        params.segments.truncate(protocol.segments.len());
        Ok(Self {
            text: row.get(0)?,
            steps: protocol.with_time_step(params.time_step).steps(),
            params: Arc::new(params),
        })
    }

    /// The key of a case of this point.
    ///
    /// # Errors
    /// [`DigestMismatch`] if the case was changed.
    fn checked_key(&self, run: &ListedRun<'_>, is_in_grid: bool) -> rusqlite::Result<CaseKey> {
        let (row, more) = (run.row, run.more);
        let key = CaseKey::of_text(&self.text, row.get(more + SEED)?, row.get(more + STRIDE)?);
        let written = row.get_ref(0)?.as_str()?;
        if key.to_string() != written {
            return Err(DigestMismatch::error(format!(
                "the parameters of case {written} are not those it was named for"
            )));
        }
        state(row.get_ref(more + STATE)?)?;
        if is_in_grid && row.get::<_, u64>(more + STEPS)? != self.steps {
            return Err(DigestMismatch::error(format!(
                "case {written} has another length than the campaign requests"
            )));
        }
        Ok(key)
    }
}

/// One of [`point_runs`].
fn point_run(
    run: &ListedRun<'_>,
    position: u64,
    key: CaseKey,
    point: &KnownPoint,
) -> rusqlite::Result<PointRun> {
    let (row, more) = (run.row, run.more);
    let state = state(row.get_ref(more + STATE)?)?;
    let (mut numbers, mut doubts) = (Vec::new(), Vec::new());
    // An open run may have the result of a shorter one.
    if matches!(state, State::Done | State::Jammed) {
        for (number, column) in numbers::columns(Level::Runs).zip(run.numbers..) {
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
        position,
        key: key.to_string(),
        sample_every: row.get::<_, u64>(more + STRIDE)? as f64 * params.time_step,
        params,
        seed: row.get(more + SEED)?,
        state,
        doubts,
        numbers: numbers.into(),
    })
}
