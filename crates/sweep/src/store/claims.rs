//! Claims and checkpoints: the life of a running case.

use super::statements::Statements;
use super::states::{self, SUSPECT};
use super::{Checkpoint, Damage, Store, StoreError, checkpoints, ends};
use crate::case::Case;
use crate::system::process::now;
use rusqlite::{Connection, params};
use std::time::Duration;

/// Most short cases that are claimed together.
const BATCH_CASES: usize = 1024;
/// Cases looked at to tell whether those that are pending keep the other workers busy.
const CASES_EXAMINED: usize = 4096;

/// A case this process owns.
#[derive(Debug)]
pub struct Claim {
    pub(crate) id: i64,
    /// Its key.
    pub key: String,
    /// The case.
    pub case: Case,
    /// What its checkpoints hold, the newest first; then its last state, if it was finished when less was requested of it.
    pub checkpoints: Vec<Result<Checkpoint, Damage>>,
}

impl Store {
    /// Claims the next cases: those that were begun before any that was not, and otherwise by the order of work, but that a case
    /// is not left for last which would then keep one of `workers` busy while the others have nothing to do. Short cases are
    /// claimed together, as many as `batch` takes by their estimates; a case that was begun, or takes longer, alone.
    ///
    /// # Errors
    /// Trouble with the file, or a case that cannot be read.
    pub fn claim(&mut self, workers: usize, batch: Duration) -> Result<Vec<Claim>, StoreError> {
        let me = self.me();
        self.write(|connection| {
            let ids = match overdue(connection, workers)? {
                Some(id) => vec![id],
                None => next(connection, workers, batch.as_secs_f64())?,
            };
            let mut own = connection.prepare_cached(
                "UPDATE cases SET state = 'running', owner = ?2, attempts = attempts + 1,
                     changed_at = ?3
                 WHERE id = ?1 RETURNING key, point, seed, steps, sample_stride, steps_done",
            )?;
            let mut point: Option<(i64, sd_core::Params)> = None;
            let mut claims = Vec::with_capacity(ids.len());
            for id in ids {
                let (key, of_point, seed, steps, sample_stride, steps_done): (
                    _,
                    i64,
                    _,
                    _,
                    _,
                    u64,
                ) = own.query_row(params![id, me, now()], |row| row.try_into())?;
                let params = match point.take() {
                    Some((known, params)) if known == of_point => params,
                    _ => {
                        let query = "SELECT params FROM points WHERE id = ?1";
                        connection.one(query, [of_point], |row| super::schema::params(row, 0))?
                    }
                };
                point = Some((of_point, params.clone()));
                let mut kept = Vec::new();
                if steps_done > 0 {
                    kept = checkpoints::of(connection, id)?;
                    // More may be requested than was computed to an end before.
                    kept.extend(ends::end_to_go_on_from(connection, id)?);
                }
                let case = Case {
                    params,
                    seed,
                    steps,
                    sample_stride,
                };
                claims.push(Claim {
                    id,
                    key,
                    case,
                    checkpoints: kept,
                });
            }
            Ok(claims)
        })
    }

    /// Keeps a checkpoint of a running case in place of the older of the two kept so far.
    ///
    /// Not synced to the disk at once: a killed process loses nothing, a power cut the last few.
    ///
    /// # Errors
    /// [`StoreError::ClaimLost`], and trouble with the file.
    pub fn keep(&mut self, claim: &Claim, steps: u64, data: &[u8]) -> Result<(), StoreError> {
        let me = self.me();
        let owned = self.write_relaxed(|connection| {
            let changed = connection.change(
                "UPDATE cases SET steps_done = ?3, deaths = 0
                 WHERE id = ?1 AND owner = ?2 AND state = 'running'",
                params![claim.id, me, steps],
            )?;
            if changed == 0 {
                return Ok(false);
            }
            let newest: Option<i64> = connection.value(
                "SELECT generation FROM checkpoints WHERE case_id = ?1
                 ORDER BY steps DESC, written_at DESC LIMIT 1",
                [claim.id],
            )?;
            let generation = i64::from(newest == Some(0));
            checkpoints::put(connection, claim.id, (generation, steps, me, data))?;
            Ok(true)
        })?;
        owned.then_some(()).ok_or_else(|| claim.lost())
    }

    /// Drops the checkpoints of a running case and its last state, none of which can be used.
    pub(crate) fn drop_checkpoints(&mut self, claim: &Claim) -> Result<(), StoreError> {
        self.write(|connection| {
            checkpoints::drop_all(connection, claim.id)?;
            // Nor can its end be used, which was tried last.
            ends::drop_state(connection, claim.id)
        })
    }

    /// Whether cases are pending or under way, perhaps with others, who may die and leave them to us.
    pub(crate) fn has_open_cases(&self) -> Result<bool, StoreError> {
        self.read(self.connection.has(
            "SELECT 1 WHERE EXISTS (SELECT 1 FROM cases WHERE state = 'pending' AND counts)
                 OR EXISTS (SELECT 1 FROM cases WHERE state = 'running' AND counts)",
            [],
        ))
    }

    /// Gives cases back: they wait to go on from their last checkpoints.
    pub(crate) fn release<'c>(
        &mut self,
        claims: impl IntoIterator<Item = &'c Claim>,
    ) -> Result<(), StoreError> {
        let me = self.me();
        self.write(|connection| {
            for claim in claims {
                states::free_where(connection, "id = ?2 AND owner = ?3", &[claim.id, me])?;
            }
            Ok(())
        })
    }
}

impl Claim {
    /// The error that this case is no longer ours.
    pub(crate) fn lost(&self) -> StoreError {
        StoreError::ClaimLost {
            key: self.key.clone(),
        }
    }
}

/// The cases that come next in the order of work: one, or as many short ones as make a batch.
fn next(connection: &Connection, workers: usize, batch_s: f64) -> rusqlite::Result<Vec<i64>> {
    let mut query = connection.prepare_cached(
        "SELECT id, cost, steps_done > 0 OR deaths > 0 FROM cases WHERE state = 'pending' AND counts
         ORDER BY turn, gain DESC, position LIMIT ?1",
    )?;
    let mut rows = query.query([BATCH_CASES * workers.max(1)])?;
    let (mut batch, mut work, mut others) = (Vec::new(), 0.0, 0.0);
    while let Some(row) = rows.next()? {
        // One that was begun, or whose process died, is taken alone: it is known then which one kills processes.
        let (id, cost, is_alone): (i64, f64, bool) = (row.get(0)?, row.get(1)?, row.get(2)?);
        if batch.is_empty() {
            (work, batch) = (cost, vec![id]);
            if is_alone {
                break;
            }
        } else if others < work * (workers as f64 - 1.0) {
            // Each of the others gets as much.
            others += cost;
        } else if is_alone || work + cost > batch_s || batch.len() >= BATCH_CASES {
            break;
        } else {
            work += cost;
            batch.push(id);
        }
    }
    Ok(batch)
}

/// The most expensive pending case, if the rest of what is pending would not keep the other workers busy for as long as it takes.
fn overdue(connection: &Connection, workers: usize) -> rusqlite::Result<Option<i64>> {
    if workers < 2 {
        return Ok(None);
    }
    let mut query = connection.prepare_cached(
        "SELECT id, cost, steps_done > 0 OR deaths >= ?2 FROM cases WHERE state = 'pending'
             AND counts
         ORDER BY cost DESC LIMIT ?1",
    )?;
    let mut rows = query.query(params![CASES_EXAMINED, SUSPECT])?;
    let Some(first) = rows.next()? else {
        return Ok(None);
    };
    let (id, cost, has_its_turn): (i64, f64, bool) = (first.get(0)?, first.get(1)?, first.get(2)?);
    // Those that were begun come first in any case, and those that kill their processes last.
    if has_its_turn {
        return Ok(None);
    }
    let mut others = 0.0;
    while let Some(row) = rows.next()? {
        others += row.get::<_, f64>(1)?;
        if others > cost * (workers as f64 - 1.0) {
            return Ok(None);
        }
    }
    Ok(Some(id))
}
