//! Claims and checkpoints: the life of a running case.

use super::statements::Statements;
use super::{Checkpoint, Damage, Store, StoreError, count, ends, integer};
use crate::case::{Case, State};
use crate::system::process;
use rusqlite::{Connection, ToSql, params, params_from_iter};
use std::fmt::Write as _;
use std::time::Duration;

/// After so many deaths in a row a case waits until there is no other.
const SUSPECT: u32 = 3;
/// What is added to the turn of a case that waits until there is no other, and taken from that of one that was begun.
const AHEAD: i64 = 1 << 40;
/// Most short cases that are claimed together.
const BATCH_CASES: usize = 1024;
/// Cases looked at to tell whether those that are pending keep the other workers busy.
const LOOKED_AT: usize = 4096;

/// A case this process owns.
#[derive(Debug)]
pub struct Claim {
    pub(crate) id: i64,
    /// Its key.
    pub key: String,
    /// The case.
    pub case: Case,
    /// Its point in the store, and the digest of that.
    pub(super) point: (i64, i64),
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
            let mut known: Option<(i64, i64, sd_core::Params)> = None;
            ids.into_iter()
                .map(|id| {
                    let (mut claim, steps_done) =
                        own.query_row(params![id, me, process::now()], |row| {
                            let point = row.get(1)?;
                            let (digest, params) = match &known {
                                Some((id, digest, params)) if *id == point => {
                                    (*digest, params.clone())
                                }
                                _ => point_of(connection, point)?,
                            };
                            known = Some((point, digest, params.clone()));
                            let claim = Claim {
                                id,
                                key: row.get(0)?,
                                case: Case {
                                    params,
                                    seed: count(row.get(2)?),
                                    steps: count(row.get(3)?),
                                    sample_stride: count(row.get(4)?),
                                },
                                point: (point, digest),
                                checkpoints: Vec::new(),
                            };
                            Ok((claim, row.get::<_, i64>(5)?))
                        })?;
                    if steps_done > 0 {
                        claim.checkpoints = checkpoints(connection, id)?;
                        // More may be requested than was computed to an end before.
                        claim
                            .checkpoints
                            .extend(ends::end_to_go_on_from(connection, id)?);
                    }
                    Ok(claim)
                })
                .collect()
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
                params![claim.id, me, integer(steps)],
            )?;
            if changed == 0 {
                return Ok(false);
            }
            let newest: Option<i64> = connection.find(
                "SELECT generation FROM checkpoints WHERE case_id = ?1
                 ORDER BY steps DESC, written_at DESC LIMIT 1",
                [claim.id],
                |row| row.get(0),
            )?;
            put_checkpoint(
                connection,
                claim.id,
                i64::from(newest == Some(0)),
                steps,
                me,
                data,
            )?;
            Ok(true)
        })?;
        owned.then_some(()).ok_or_else(|| claim.lost())
    }

    /// Drops the checkpoints of a running case and its last state, none of which can be used.
    pub(crate) fn drop_checkpoints(&mut self, claim: &Claim) -> Result<(), StoreError> {
        self.write(|connection| {
            drop_checkpoints(connection, claim.id)?;
            // Nor can its end be used, which was tried last.
            ends::drop_state(connection, claim.id)
        })
    }

    /// Whether cases are pending or under way, perhaps with others, who may die and leave them to us.
    pub(crate) fn anything_left(&self) -> Result<bool, StoreError> {
        let left = self
            .connection
            .prepare_cached(
                "SELECT 1 WHERE EXISTS (SELECT 1 FROM cases WHERE state = 'pending' AND counts)
                     OR EXISTS (SELECT 1 FROM cases WHERE state = 'running' AND counts)",
            )
            .and_then(|mut query| query.exists([]));
        self.read(left)
    }

    /// Gives cases back: they wait to go on from their last checkpoints.
    pub(crate) fn release<'c>(
        &mut self,
        claims: impl IntoIterator<Item = &'c Claim>,
    ) -> Result<(), StoreError> {
        let me = self.me();
        self.write(|connection| {
            for claim in claims {
                free_where(connection, "id = ?2 AND owner = ?3", &[&claim.id, &me])?;
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

/// The digest and the parameters of a point.
fn point_of(connection: &Connection, point: i64) -> rusqlite::Result<(i64, sd_core::Params)> {
    connection.one(
        "SELECT digest, params FROM points WHERE id = ?1",
        [point],
        |row| Ok((row.get(0)?, super::points::params(row, 1)?)),
    )
}

/// The cases that come next in the order of work: one, or as many short ones as make a batch.
fn next(connection: &Connection, workers: usize, batch_s: f64) -> rusqlite::Result<Vec<i64>> {
    let mut query = connection.prepare_cached(
        "SELECT id, cost, steps_done > 0 OR deaths > 0 FROM cases WHERE state = 'pending' AND counts
         ORDER BY turn, gain DESC, position LIMIT ?1",
    )?;
    let mut rows = query.query([integer((BATCH_CASES * workers.max(1)) as u64)])?;
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
    let mut rows = query.query(params![integer(LOOKED_AT as u64), SUSPECT])?;
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

/// The checkpoints of a case, the newest first.
pub(super) fn checkpoints(
    connection: &Connection,
    case: i64,
) -> rusqlite::Result<Vec<Result<Checkpoint, Damage>>> {
    connection.all(
        "SELECT CASE WHEN length(data) <= ?2 THEN data ELSE x'' END FROM checkpoints
             WHERE case_id = ?1 ORDER BY steps DESC, written_at DESC",
        params![case, integer(Checkpoint::SIZE_LIMIT as u64)],
        |row| Ok(Checkpoint::decode(row.get_ref(0)?.as_blob()?)),
    )
}

/// Writes a checkpoint in place of another one.
pub(super) fn put_checkpoint(
    connection: &Connection,
    case: i64,
    generation: i64,
    steps: u64,
    process: i64,
    data: &[u8],
) -> rusqlite::Result<()> {
    connection.run(
        "INSERT OR REPLACE INTO checkpoints (case_id, generation, steps, process, written_at, data)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
        params![
            case,
            generation,
            integer(steps),
            process,
            process::now(),
            data
        ],
    )
}

/// Drops all checkpoints of a case.
pub(super) fn drop_checkpoints(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    connection.run("DELETE FROM checkpoints WHERE case_id = ?1", [case])
}

/// Gives a case a state that is an end.
pub(super) fn end(
    connection: &Connection,
    case: i64,
    state: State,
    steps: u64,
) -> rusqlite::Result<()> {
    connection.run(
        "UPDATE cases SET state = ?2, owner = NULL, steps_done = ?3, changed_at = ?4 WHERE id = ?1",
        params![case, state.name(), integer(steps), process::now()],
    )
}

/// Makes all running cases of a process pending.
pub(super) fn free(connection: &Connection, process: i64) -> rusqlite::Result<usize> {
    free_where(connection, "owner = ?2 AND state = 'running'", &[&process])
}

/// Makes cases pending that meet a condition, with parameters from ?2 on: those that were begun go on before any other.
pub(super) fn free_where(
    connection: &Connection,
    condition: &str,
    parameters: &[&dyn ToSql],
) -> rusqlite::Result<usize> {
    let mut statement =
        String::from("UPDATE cases SET state = 'pending', owner = NULL, changed_at = ?1, ");
    let _ = write!(statement, "turn = {} WHERE {condition}", turn("steps_done"));
    let now = process::now();
    connection.change(
        &statement,
        params_from_iter(std::iter::once(&now as &dyn ToSql).chain(parameters.iter().copied())),
    )
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
    integer(rank).min(AHEAD - 1)
}
