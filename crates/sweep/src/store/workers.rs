//! This process at work on a store: registration, heartbeat, end, and release of the cases of dead
//! processes.

use super::processes::{ActiveProcess, Provenance, Registered, SEALED, TaskName};
use super::statements::{Statements, json};
use super::{Store, StoreError, runs, settle};
use crate::model::precision::Precision;
use crate::model::replay::replay;
use crate::system::process;
use rusqlite::config::DbConfig;
use rusqlite::{Connection, params};
use sd_core::Params;
use serde::Deserialize;

/// A case fails after this many successive deaths of its processes without a new checkpoint: it
/// probably causes them.
pub const DEATH_LIMIT: u32 = 5;
/// Condition on a running case without an owner.
const ORPHANED_RUNNING: &str =
    "state = 'running' AND NOT EXISTS (SELECT 1 FROM processes p WHERE p.id = cases.owner)";

impl Store {
    /// Processes that finished results, the latest first.
    pub(crate) fn provenance(&self) -> Result<Vec<Provenance>, StoreError> {
        self.read(SEALED.check(&self.connection))?;
        self.named(
            "SELECT p.host, p.version, p.physics_version, p.build, p.threads, p.started_at, r.results
             FROM (SELECT process, count(*) AS results FROM results GROUP BY process) r
             LEFT JOIN processes p ON p.id = r.process ORDER BY r.process DESC LIMIT 50",
            [],
        )
    }

    /// Sets the task of this process, before [`Store::register`].
    pub(crate) fn work_for(&mut self, task: TaskName) {
        self.task = Some(task);
    }

    /// Records the number of threads of this process, and its task of a scheduler. After this it
    /// can claim cases.
    ///
    /// # Errors
    /// [`StoreError::Displaced`], and I/O or SQLite errors.
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
        })
    }

    /// Records a heartbeat of this process.
    pub(crate) fn heartbeat(&mut self) -> Result<(), StoreError> {
        let me = self.me();
        self.write_relaxed(|connection| {
            connection.run(
                "UPDATE processes SET heartbeat = ?2 WHERE id = ?1",
                params![me, process::now()],
            )
        })
    }

    /// Releases all cases of this process, and records its end.
    pub(crate) fn leave(&mut self) -> Result<(), StoreError> {
        let me = self.me();
        self.write(|connection| {
            runs::free(connection, me)?;
            end(connection, me)
        })?;
        self.process = None;
        self.make_sure_of_the_file()
    }

    /// Releases the cases of dead processes, which continue from their last checkpoint; those with
    /// [`DEATH_LIMIT`] successive deaths end as failed. Returns the number of released cases.
    pub(crate) fn release_dead(&mut self) -> Result<usize, StoreError> {
        let Some(Registered { id: me, identity }) = self.process.clone() else {
            return Ok(0);
        };
        let dead = |connection: &Connection| -> rusqlite::Result<Vec<ActiveProcess>> {
            let others = ActiveProcess::others(connection, me)?.into_iter();
            Ok(others
                .filter_map(|(other, is_alive)| (!is_alive).then_some(other))
                .collect())
        };
        // Checked without the lock first, since there is rarely anything to do.
        let orphaned = format!("SELECT 1 FROM cases WHERE {ORPHANED_RUNNING}");
        if !self.read(self.connection.has(&orphaned, []))?
            && self.read(dead(&self.connection))?.is_empty()
        {
            return Ok(0);
        }
        let rules = self.entered()?.rules;
        self.write(|connection| {
            let mut freed = runs::free_where(connection, ORPHANED_RUNNING, &[])?;
            for process in dead(connection)? {
                // Deaths do not count if the machine restarted, or for cases of a batch that were
                // not started.
                if process.identity.boot == identity.boot {
                    connection.execute(
                        "UPDATE cases SET deaths = deaths + 1 WHERE owner = ?1 AND state = 'running'",
                        [process.id],
                    )?;
                    freed += quarantine(connection, &rules, process.id)?;
                }
                freed += runs::free(connection, process.id)?;
                end(connection, process.id)?;
            }
            Ok(freed)
        })
    }
}

impl Drop for Store {
    /// Releases the cases of the process. `SQLite` moves the log into the file at the last close,
    /// unless the file was replaced: then the log is deleted.
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

/// A case that its processes died of.
#[derive(Deserialize)]
struct Condemned {
    id: i64,
    #[serde(deserialize_with = "json")]
    params: Params,
    steps_done: u64,
}

/// Ends cases of a dead process with too many deaths as failed. Returns their number.
fn quarantine(
    connection: &Connection,
    rules: &[Precision],
    process: i64,
) -> rusqlite::Result<usize> {
    let condemned: Vec<Condemned> = connection.named(
        "SELECT c.id, p.params, c.steps_done FROM cases c JOIN points p ON p.id = c.point
         WHERE c.owner = ?1 AND c.state = 'running' AND c.deaths >= ?2",
        params![process, DEATH_LIMIT],
    )?;
    for case in &condemned {
        let checkpoints = runs::checkpoints(connection, case.id)?;
        let last = checkpoints.into_iter().find_map(Result::ok);
        let failure = runs::Attempt {
            error: format!(
                "its process was killed or crashed {DEATH_LIMIT} times in a row before its next checkpoint \
                 (out of memory?); `sweep run --retry-failed` tries again"
            ),
            step: case.steps_done,
            strain: case.steps_done as f64 * case.params.time_step,
            snapshot: last.map(|last| replay(&case.params, &last.snapshot)),
            ..runs::Attempt::default()
        };
        settle::fail(connection, rules, case.id, &failure.by(process))?;
    }
    Ok(condemned.len())
}
