//! A process at work on a store: entering, living, leaving, and taking over from those that are gone.

use super::processes::{ActiveProcess, Registered, SEALED, TaskName};
use super::statements::Statements;
use super::{Store, StoreError, checkpoints, failures, settle, states};
use crate::model::replay::replay;
use crate::system::process;
use rusqlite::config::DbConfig;
use rusqlite::{Connection, params};

/// A case whose processes died so many times in a row, with no new checkpoint between, counts as failed: most likely it
/// kills them.
pub const DEATH_LIMIT: u32 = 5;
/// What is true of a case under way whose owner is not there.
const ORPHANED_RUNNING: &str =
    "state = 'running' AND NOT EXISTS (SELECT 1 FROM processes p WHERE p.id = cases.owner)";

impl Store {
    /// Says which task this process works for, before it is entered with [`Store::register`].
    pub(crate) fn work_for(&mut self, task: TaskName) {
        self.task = Some(task);
    }

    /// Records how many threads this process computes with, and for which task of a scheduler. From now on it claims cases.
    ///
    /// # Errors
    /// [`StoreError::Displaced`], and trouble with the file.
    pub fn register(&mut self, threads: usize) -> Result<(), StoreError> {
        self.check_campaign()?;
        let me = self.me();
        let task = self.task.clone();
        self.write(|connection| {
            connection.execute(
                "UPDATE processes SET threads = ?2, job = ?3, task = ?4, restart = ?5,
                     node = ?6 WHERE id = ?1",
                params![
                    me,
                    threads,
                    task.as_ref().map(|task| &task.job),
                    task.as_ref().map(|task| task.task),
                    task.as_ref().map(|task| task.restart),
                    task.as_ref().map(|task| &task.node),
                ],
            )?;
            SEALED.seal(connection, "t.id = ?1", [me])
        })?;
        // In the file itself, so that a store that lost its log is recognized.
        self.read(
            self.connection
                .execute_batch("PRAGMA wal_checkpoint(PASSIVE)"),
        )
    }

    /// Records that this process lives.
    pub(crate) fn heartbeat(&mut self) -> Result<(), StoreError> {
        let me = self.me();
        self.write_relaxed(|connection| {
            connection.run(
                "UPDATE processes SET heartbeat = ?2 WHERE id = ?1",
                params![me, process::now()],
            )
        })
    }

    /// Gives back all that this process still owns, and records that it ended.
    pub(crate) fn leave(&mut self) -> Result<(), StoreError> {
        let me = self.me();
        self.write(|connection| {
            states::free(connection, me)?;
            end(connection, me)
        })?;
        self.process = None;
        self.make_sure_of_the_file()
    }

    /// Frees the cases of processes that are gone; they go on from their last checkpoint, but for those that died
    /// [`DEATH_LIMIT`] times in a row, which end as failed. Returns how many it took from them.
    pub(crate) fn release_dead(&mut self) -> Result<usize, StoreError> {
        let Some(Registered { id: me, identity }) = self.process.clone() else {
            return Ok(0);
        };
        let dead = |connection: &Connection| -> rusqlite::Result<Vec<ActiveProcess>> {
            let mut others = ActiveProcess::others(connection, me)?;
            others.retain(|other| !other.is_alive);
            Ok(others)
        };
        // A look without the lock first: nearly always there is nothing to do.
        let orphaned = format!("SELECT 1 FROM cases WHERE {ORPHANED_RUNNING}");
        if !self.read(self.connection.has(&orphaned, []))?
            && self.read(dead(&self.connection))?.is_empty()
        {
            return Ok(0);
        }
        self.write(|connection| {
            let mut freed = states::free_where(connection, ORPHANED_RUNNING, &[])?;
            for process in dead(connection)? {
                // A machine that went down is no fault of the case. Nor is a batch that of cases that were not begun.
                if process.identity.boot == identity.boot {
                    connection.execute(
                        "UPDATE cases SET deaths = deaths + 1 WHERE owner = ?1 AND state = 'running'",
                        [process.id],
                    )?;
                    freed += quarantine(connection, process.id)?;
                }
                freed += states::free(connection, process.id)?;
                end(connection, process.id)?;
            }
            Ok(freed)
        })
    }
}

impl Drop for Store {
    /// Gives back what the process still owns. `SQLite` moves the log into the file when the last one closes it, unless the file
    /// is not that of the log any more: then nothing of it stays beside the other.
    fn drop(&mut self) {
        if self.process.is_some() {
            let _ = self.leave();
        }
        if let Some(files) = self.files.as_ref().filter(|files| files.loss().is_some()) {
            let _ = self
                .connection
                .set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true);
            files.remove_own_log();
        }
    }
}

/// Records that a process ended.
fn end(connection: &Connection, id: i64) -> rusqlite::Result<()> {
    connection.run(
        "UPDATE processes SET ended_at = ?2 WHERE id = ?1",
        params![id, process::now()],
    )
}

/// Ends those cases of a dead process as failed that died too often. Returns how many.
fn quarantine(connection: &Connection, process: i64) -> rusqlite::Result<usize> {
    let condemned: Vec<(i64, sd_core::Params, u64)> = connection.all(
        "SELECT c.id, p.params, c.steps_done FROM cases c JOIN points p ON p.id = c.point
         WHERE c.owner = ?1 AND c.state = 'running' AND c.deaths >= ?2",
        params![process, DEATH_LIMIT],
        |row| Ok((row.get(0)?, super::schema::params(row, 1)?, row.get(2)?)),
    )?;
    for (id, params, step) in &condemned {
        let checkpoints = checkpoints::of(connection, *id)?;
        let last = checkpoints.into_iter().find_map(Result::ok);
        let failure = failures::Attempt {
            error: format!(
                "its process was killed or crashed {DEATH_LIMIT} times in a row before its next checkpoint \
                 (out of memory?); `sweep run --retry-failed` tries again"
            ),
            step: *step,
            strain: *step as f64 * params.time_step,
            snapshot: last.map(|last| replay(params, &last.snapshot)),
            ..failures::Attempt::default()
        };
        settle::fail(connection, *id, failure.by(process))?;
    }
    Ok(condemned.len())
}
