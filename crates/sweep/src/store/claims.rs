//! Claims and checkpoints: the life of a running case.

use super::checksum::{self, Kind};
use super::process::{self, Identity, Life};
use super::{Checkpoint, Damage, Registered, Store, StoreError, count, integer};
use crate::case::{Case, PHYSICS_VERSION};
use crate::replay::replay;
use rusqlite::{Connection, OptionalExtension, Transaction, params};

/// A case whose processes died so many times in a row, with no new checkpoint between, counts as failed: most likely it
/// kills them.
pub const DEATH_LIMIT: u32 = 5;
/// After so many deaths in a row a case waits until there is no other.
const SUSPECT: u32 = 3;

/// What is true of a case under way whose owner is not there.
const OF_NOBODY: &str =
    "state = 'running' AND NOT EXISTS (SELECT 1 FROM processes p WHERE p.id = cases.owner)";

/// A case this process owns.
#[derive(Debug)]
pub struct Claim {
    pub(crate) id: i64,
    /// Its key.
    pub key: String,
    /// The case.
    pub case: Case,
    /// What its checkpoints hold, the newest first; then its last state, if it was finished when less was asked of it.
    pub checkpoints: Vec<Result<Checkpoint, Damage>>,
}

impl Store {
    /// Enters this process, which from now on may claim cases.
    ///
    /// # Errors
    /// [`StoreError::Displaced`], and trouble with the file.
    pub fn register(&mut self, threads: usize) -> Result<(), StoreError> {
        let identity = Identity::of_this_process();
        let (build, now) = (process::build(), process::now());
        let task = self.task.clone();
        let asks = self.asks.clone();
        let registered = self.write(|transaction| {
            // Another process may have taken another version of the campaign into the store meanwhile.
            let displaced = match &asks {
                Some(asks) => asks.displaced_by(transaction)?,
                None => None,
            };
            if displaced.is_some() {
                return Ok(None);
            }
            transaction.execute(
                "INSERT INTO processes (host, boot, namespace, pid, start, started_at, heartbeat, version,
                     physics_version, build, threads, job, task, restart, node, file, asks)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16)",
                params![
                    identity.host,
                    identity.boot,
                    identity.namespace,
                    identity.pid,
                    identity.start,
                    now,
                    env!("CARGO_PKG_VERSION"),
                    PHYSICS_VERSION,
                    build,
                    integer(threads as u64),
                    task.as_ref().map(|task| &task.job),
                    task.as_ref().map(|task| integer(task.task as u64)),
                    task.as_ref().map(|task| task.restart),
                    task.as_ref().map(|task| &task.node),
                    asks.as_ref().map(|asks| asks.file.to_string_lossy()),
                    asks.as_ref().map(|asks| &asks.hash),
                ],
            )?;
            let id = transaction.last_insert_rowid();
            checksum::seal(transaction, Kind::Process, id)?;
            Ok(Some(id))
        })?;
        let Some(id) = registered else {
            return self.check_campaign();
        };
        self.process = Some(Registered { id, identity });
        Ok(())
    }

    /// Row of this process; no row has the number 0.
    pub(super) fn me(&self) -> i64 {
        self.process.as_ref().map_or(0, |process| process.id)
    }

    /// Says that this process lives.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn heartbeat(&mut self) -> Result<(), StoreError> {
        let me = self.me();
        self.relaxed(|transaction| {
            transaction.execute(
                "UPDATE processes SET heartbeat = ?2 WHERE id = ?1",
                params![me, process::now()],
            )?;
            Ok(())
        })
    }

    /// Gives back all that this process still owns, and says that it ended.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn leave(&mut self) -> Result<(), StoreError> {
        let me = self.me();
        self.write(|transaction| {
            free(transaction, me)?;
            transaction.execute(
                "UPDATE processes SET ended_at = ?2, heartbeat = ?2 WHERE id = ?1",
                params![me, process::now()],
            )?;
            Ok(())
        })?;
        self.check_place()
    }

    /// Frees the cases of processes that are gone; they go on from their last checkpoint, but for those that died
    /// [`DEATH_LIMIT`] times in a row, which end as failed. Says how many it took from them.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn release_dead(&mut self) -> Result<usize, StoreError> {
        let Some(Registered { id: me, identity }) = self.process.clone() else {
            return Ok(0);
        };
        let owners =
            |connection: &Connection| -> Result<Vec<(i64, Identity, i64)>, rusqlite::Error> {
                connection
                    .prepare_cached(
                        "SELECT id, host, boot, namespace, pid, start, heartbeat FROM processes
                     WHERE id IN (SELECT owner FROM cases WHERE state = 'running') AND id != ?1",
                    )?
                    .query_map([me], |row| {
                        let identity = Identity {
                            host: row.get(1)?,
                            boot: row.get(2)?,
                            namespace: row.get(3)?,
                            pid: row.get(4)?,
                            start: row.get(5)?,
                        };
                        Ok((row.get(0)?, identity, row.get(6)?))
                    })?
                    .collect()
            };
        let dead = |owners: Vec<(i64, Identity, i64)>| -> Vec<(i64, bool)> {
            owners
                .into_iter()
                .filter(|(_, owner, heartbeat)| {
                    identity.judge(owner, process::silence(*heartbeat)) == Life::Dead
                })
                // A machine that went down is no fault of the case.
                .map(|(id, owner, _)| (id, owner.boot == identity.boot))
                .collect()
        };
        let nobody: bool = self.read(
            self.connection
                .prepare_cached(&format!("SELECT 1 FROM cases WHERE {OF_NOBODY}"))
                .and_then(|mut query| query.exists([])),
        )?;
        // A look without the lock first: nearly always there is nothing to do.
        if !nobody && dead(self.read(owners(&self.connection))?).is_empty() {
            return Ok(0);
        }
        self.write(|transaction| {
            let mut freed = transaction.execute(
                &format!(
                    "UPDATE cases SET state = 'pending', owner = NULL, changed_at = ?1 WHERE {OF_NOBODY}"
                ),
                [process::now()],
            )?;
            for (process, blame) in dead(owners(transaction)?) {
                if blame {
                    transaction.execute(
                        "UPDATE cases SET deaths = deaths + 1 WHERE owner = ?1 AND state = 'running'",
                        [process],
                    )?;
                    freed += quarantine(transaction, process)?;
                }
                freed += free(transaction, process)?;
            }
            Ok(freed)
        })
    }

    /// A process that is still at work on the store, as far as can be seen: its number and its host.
    pub(super) fn worker(&self) -> Option<(u32, String)> {
        let here = Identity::of_this_process();
        let mut query = self
            .connection
            .prepare(
                "SELECT host, boot, namespace, pid, start, heartbeat FROM processes WHERE ended_at IS NULL",
            )
            .ok()?;
        let mut rows = query.query([]).ok()?;
        // What cannot be read any more is no process.
        while let Ok(Some(row)) = rows.next() {
            let process = || -> Result<_, rusqlite::Error> {
                let identity = Identity {
                    host: row.get(0)?,
                    boot: row.get(1)?,
                    namespace: row.get(2)?,
                    pid: row.get(3)?,
                    start: row.get(4)?,
                };
                Ok((identity, row.get::<_, i64>(5)?))
            };
            if let Ok((process, heartbeat)) = process()
                && here.judge(&process, process::silence(heartbeat)) == Life::Alive
            {
                return Some((process.pid, process.host));
            }
        }
        None
    }

    /// Claims the next case: one that was begun before any that was not.
    ///
    /// # Errors
    /// Trouble with the file, or a case that cannot be read.
    pub fn claim(&mut self) -> Result<Option<Claim>, StoreError> {
        let me = self.me();
        let claimed = self.write(|transaction| {
            let begun = transaction
                .prepare_cached(
                    "SELECT id FROM cases WHERE state = 'pending' AND steps_done > 0 AND position IS NOT NULL
                         AND deaths < ?1 ORDER BY rank LIMIT 1",
                )?
                .query_row([SUSPECT], |row| row.get::<_, i64>(0))
                .optional()?;
            let next = match begun {
                Some(id) => Some(id),
                None => transaction
                    .prepare_cached(
                        "SELECT id FROM cases WHERE state = 'pending' AND position IS NOT NULL
                         ORDER BY deaths >= ?1, rank LIMIT 1",
                    )?
                    .query_row([SUSPECT], |row| row.get(0))
                    .optional()?,
            };
            let Some(id) = next else {
                return Ok(None);
            };
            transaction
                .prepare_cached(
                    "UPDATE cases SET state = 'running', owner = ?2, attempts = attempts + 1, changed_at = ?3
                     WHERE id = ?1",
                )?
                .execute(params![id, me, process::now()])?;
            let row = transaction
                .prepare_cached(
                    "SELECT key, params, seed, steps, sample_stride FROM cases WHERE id = ?1",
                )?
                .query_row([id], |row| {
                    Ok((
                        row.get::<_, String>(0)?,
                        row.get::<_, String>(1)?,
                        count(row.get(2)?),
                        count(row.get(3)?),
                        count(row.get(4)?),
                    ))
                })?;
            let checkpoints: Vec<Vec<u8>> = transaction
                .prepare_cached(
                    "SELECT CASE WHEN length(data) <= ?2 THEN data ELSE x'' END FROM checkpoints
                     WHERE case_id = ?1 ORDER BY steps DESC, written_at DESC",
                )?
                .query_map(params![id, integer(Checkpoint::SIZE_LIMIT as u64)], |row| row.get(0))?
                .collect::<Result<_, _>>()?;
            Ok(Some((id, row, checkpoints)))
        })?;
        let Some((id, (key, params, seed, steps, sample_stride), checkpoints)) = claimed else {
            return Ok(None);
        };
        let case = Case {
            params: self.json("cases", serde_json::from_str(&params))?,
            seed,
            steps,
            sample_stride,
        };
        let mut checkpoints: Vec<_> = checkpoints
            .iter()
            .map(|bytes| Checkpoint::decode(bytes))
            .collect();
        // More may be asked than was computed to an end before.
        checkpoints.extend(self.end_to_go_on_from(id)?);
        Ok(Some(Claim {
            id,
            key,
            case,
            checkpoints,
        }))
    }

    /// Keeps a checkpoint of a running case in place of the older of the two kept so far.
    ///
    /// Not synced to the disk at once: a killed process loses nothing, a power cut the last few.
    ///
    /// # Errors
    /// [`StoreError::ClaimLost`], and trouble with the file.
    pub fn keep(&mut self, claim: &Claim, steps: u64, data: &[u8]) -> Result<(), StoreError> {
        let me = self.me();
        let owned = self.relaxed(|transaction| {
            let changed = transaction
                .prepare_cached(
                    "UPDATE cases SET steps_done = ?3, deaths = 0 WHERE id = ?1 AND owner = ?2 AND state = 'running'",
                )?
                .execute(params![claim.id, me, integer(steps)])?;
            if changed == 0 {
                return Ok(false);
            }
            let newest: Option<i64> = transaction
                .prepare_cached(
                    "SELECT generation FROM checkpoints WHERE case_id = ?1 ORDER BY steps DESC, written_at DESC LIMIT 1",
                )?
                .query_row([claim.id], |row| row.get(0))
                .optional()?;
            let slot = i64::from(newest == Some(0));
            transaction
                .prepare_cached(
                    "INSERT OR REPLACE INTO checkpoints (case_id, generation, steps, process, written_at, data)
                     VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
                )?
                .execute(params![claim.id, slot, integer(steps), me, process::now(), data])?;
            Ok(true)
        })?;
        owned.then_some(()).ok_or_else(|| claim.lost())
    }

    /// Drops the checkpoints of a running case and its last state, none of which can be used.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn drop_checkpoints(&mut self, claim: &Claim) -> Result<(), StoreError> {
        self.write(|transaction| {
            drop_checkpoints(transaction, claim.id)?;
            // Nor can its end be used, which was tried last.
            transaction.execute(
                "UPDATE ends SET state = NULL WHERE case_id = ?1",
                [claim.id],
            )?;
            checksum::seal(transaction, Kind::End, claim.id)
        })
    }

    /// Gives a case back: it waits to go on from its last checkpoint.
    ///
    /// # Errors
    /// Trouble with the file. A claim already lost is none.
    pub fn release(&mut self, claim: &Claim) -> Result<(), StoreError> {
        let me = self.me();
        self.write(|transaction| {
            transaction.execute(
                "UPDATE cases SET state = 'pending', owner = NULL, changed_at = ?3 WHERE id = ?1 AND owner = ?2",
                params![claim.id, me, process::now()],
            )?;
            Ok(())
        })
    }

    /// A transaction that need not be on the disk when it returns.
    fn relaxed<T>(
        &mut self,
        work: impl FnOnce(&Transaction<'_>) -> Result<T, rusqlite::Error>,
    ) -> Result<T, StoreError> {
        self.read(self.connection.pragma_update(None, "synchronous", "NORMAL"))?;
        let result = self.write(work);
        self.read(self.connection.pragma_update(None, "synchronous", "FULL"))?;
        result
    }
}

impl Claim {
    /// The error that this case is no longer ours.
    pub(super) fn lost(&self) -> StoreError {
        StoreError::ClaimLost {
            key: self.key.clone(),
        }
    }
}

/// Ends those cases of a dead process as failed that died too often. Says how many.
fn quarantine(transaction: &Transaction<'_>, process: i64) -> Result<usize, rusqlite::Error> {
    let condemned: Vec<(i64, String, u64, i64)> = transaction
        .prepare("SELECT id, params, seed, steps_done FROM cases WHERE owner = ?1 AND state = 'running' AND deaths >= ?2")?
        .query_map(params![process, DEATH_LIMIT], |row| {
            Ok((row.get(0)?, row.get(1)?, count(row.get(2)?), row.get(3)?))
        })?
        .collect::<Result<_, _>>()?;
    let number = condemned.len();
    for (id, params, seed, steps_done) in condemned {
        let last = transaction
            .prepare("SELECT data FROM checkpoints WHERE case_id = ?1 ORDER BY steps DESC, written_at DESC")?
            .query_map([id], |row| row.get::<_, Vec<u8>>(0))?
            .filter_map(Result::ok)
            .find_map(|bytes| Checkpoint::decode(&bytes).ok());
        let case = serde_json::from_str(&params).ok().map(|params| Case {
            params,
            seed,
            steps: 0,
            sample_stride: 1,
        });
        let time_step = case.as_ref().map_or(0.0, |case| case.params.time_step);
        let snapshot = case
            .zip(last)
            .map(|(case, last)| replay(&case.params, &last.snapshot));
        transaction.execute(
            "INSERT INTO failures (case_id, attempt, error, step, strain, snapshot, process, failed_at)
             SELECT ?1, attempts, ?2, ?3, ?4, ?5, ?6, ?7 FROM cases WHERE id = ?1",
            params![
                id,
                format!(
                    "its process was killed or crashed {DEATH_LIMIT} times in a row before its next checkpoint \
                     (out of memory?); `sweep run --retry-failed` tries again"
                ),
                steps_done,
                count(steps_done) as f64 * time_step,
                snapshot,
                process,
                process::now(),
            ],
        )?;
        checksum::seal(transaction, Kind::Failure, transaction.last_insert_rowid())?;
        transaction.execute(
            "UPDATE cases SET state = 'failed', owner = NULL, changed_at = ?2 WHERE id = ?1",
            params![id, process::now()],
        )?;
        drop_checkpoints(transaction, id)?;
    }
    Ok(number)
}

/// Makes all running cases of a process pending.
fn free(transaction: &Transaction<'_>, process: i64) -> Result<usize, rusqlite::Error> {
    transaction.execute(
        "UPDATE cases SET state = 'pending', owner = NULL, changed_at = ?2 WHERE owner = ?1 AND state = 'running'",
        params![process, process::now()],
    )
}

/// Drops all checkpoints of a case.
pub(super) fn drop_checkpoints(
    transaction: &Transaction<'_>,
    case: i64,
) -> Result<(), rusqlite::Error> {
    transaction
        .prepare_cached("DELETE FROM checkpoints WHERE case_id = ?1")?
        .execute([case])?;
    Ok(())
}
