//! The processes that work on a store: registration, heartbeat, end, and release of the cases of
//! dead ones.

use super::database::Statements;
use super::digest::{Sealed, whole};
use super::entry::Entered;
use super::{Store, StoreError, runs, settle};
use crate::model::case::PHYSICS_VERSION;
use crate::model::precision::Precision;
use crate::model::replay::replay;
use crate::system::process;
use crate::system::process::{Identity, ProcessState};
use rusqlite::config::DbConfig;
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params};
use serde::{Deserialize, Serialize};

/// The processes, with the columns that describe one.
pub(super) const SEALED: Sealed = Sealed {
    table: "processes",
    columns: "host, boot, namespace, pid, start, started_at, version, physics_version, build, threads, job, task, restart, node",
    with_key: false,
    words: "a process that computed",
};
/// This process in the store.
#[derive(Debug, Clone)]
pub(super) struct Registered {
    pub(super) id: i64,
    pub(super) identity: Identity,
}

/// The task of a scheduler a process works for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TaskName {
    /// The job, by its name at the scheduler.
    pub job: String,
    /// Number of the task, from 0.
    pub task: usize,
    /// Number of restarts of the task.
    pub restart: u32,
    /// The node it runs on.
    pub node: String,
}

/// A process that has not ended according to the store.
pub(super) struct ActiveProcess {
    pub(super) id: i64,
    pub(super) identity: Identity,
    pub(super) file: Option<String>,
    request: Option<String>,
    pub(super) is_alive: bool,
}

impl ActiveProcess {
    /// All of them but the process `me`.
    pub(super) fn others(connection: &Connection, me: i64) -> rusqlite::Result<Vec<Self>> {
        let here = Identity::of_this_process();
        let read = |row: &Row<'_>| -> rusqlite::Result<Self> {
            let identity = Identity {
                host: row.get(1)?,
                boot: row.get(2)?,
                namespace: row.get(3)?,
                pid: row.get(4)?,
                start: row.get(5)?,
            };
            let life = here.judge(&identity, process::silence(row.get(6)?));
            Ok(Self {
                id: row.get(0)?,
                identity,
                file: row.get(7)?,
                request: row.get(8)?,
                is_alive: life == ProcessState::Alive,
            })
        };
        let others = "SELECT id, host, boot, namespace, pid, start, heartbeat, file, request
             FROM processes
             WHERE ended_at IS NULL AND id != ?1";
        connection.all(others, [me], read)
    }

    /// A live process that computes another version of the campaign.
    pub(super) fn conflicting(
        connection: &Connection,
        me: i64,
        request: &str,
    ) -> rusqlite::Result<Option<Self>> {
        let differs = |other: &Self| other.request.as_ref().is_some_and(|other| other != request);
        Ok(Self::others(connection, me)?
            .into_iter()
            .find(|other| other.is_alive && differs(other)))
    }

    fn name(self) -> (u32, String) {
        (self.identity.pid, self.identity.host)
    }
}

/// Another process that works on the store.
pub(super) fn other_worker(
    connection: &Connection,
    me: i64,
) -> rusqlite::Result<Option<(u32, String)>> {
    let mut others = ActiveProcess::others(connection, me)?.into_iter();
    Ok(others.find(|other| other.is_alive).map(ActiveProcess::name))
}

/// Writes the row of a process with this description. Returns its number.
pub(super) fn put(
    connection: &Connection,
    described: &[Value],
    more: &[(&str, Value)],
) -> rusqlite::Result<i64> {
    SEALED.put(connection, None, described, more)
}

/// The description of the process with a number, or that of an unknown one if it was changed.
pub(super) fn described(connection: &Connection, id: i64) -> Vec<Value> {
    let number = SEALED.columns.split(", ").count();
    let found = SEALED.all(connection, "t.id = ?1", [id], |row| {
        (0..number).map(|column| row.get(column)).collect()
    });
    let unknown = SEALED.columns.split(", ").map(|column| match column {
        "pid" | "started_at" | "physics_version" | "threads" => whole(0),
        "job" | "task" | "restart" | "node" => Value::Null,
        "host" => Value::Text("unknown".into()),
        _ => Value::Text(String::new()),
    });
    let found: Option<Vec<Value>> = found.ok().and_then(|mut found| found.pop());
    found.unwrap_or_else(|| unknown.collect())
}

/// Registers this process, which computes a version of the campaign.
pub(super) fn enter(connection: &Connection, entered: &Entered) -> rusqlite::Result<Registered> {
    let identity = Identity::of_this_process();
    let now = process::now();
    let mut described = vec![
        identity.host.clone().into(),
        identity.boot.clone().into(),
        identity.namespace.clone().into(),
        identity.pid.into(),
        identity.start.clone().into(),
        now.into(),
        env!("CARGO_PKG_VERSION").to_owned().into(),
        PHYSICS_VERSION.into(),
        process::build().into(),
        whole(0),
    ];
    described.resize(14, Value::Null);
    let more = [
        ("heartbeat", now.into()),
        ("file", entered.file.clone().into()),
        ("request", entered.request.clone().into()),
    ];
    let id = put(connection, &described, &more)?;
    Ok(Registered { id, identity })
}

/// A process that worked on the store.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Its host.
    pub host: String,
    /// Version of the program.
    pub version: String,
    /// Version of its physics.
    pub physics_version: u64,
    /// Hash of its executable.
    pub build: String,
    /// Its threads.
    pub threads: u64,
    /// Its start, in milliseconds since 1970.
    pub started_at: i64,
    /// Results it finished.
    pub results: u64,
}

impl Provenance {
    /// Description of the program: version, version of its physics, beginning of its hash.
    pub fn program(&self) -> String {
        program(&self.version, self.physics_version, &self.build)
    }
}

/// Description of a program.
pub(super) fn program(version: &str, physics_version: u64, build: &str) -> String {
    let build = build.get(..12).unwrap_or(build);
    format!("sweep {version} (physics {physics_version}, build {build})")
}

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
}

/// A case fails after this many successive deaths of its processes without a new checkpoint: it
/// probably causes them.
pub const DEATH_LIMIT: u32 = 5;
/// Condition on a running case without an owner.
const ORPHANED_RUNNING: &str =
    "state = 'running' AND NOT EXISTS (SELECT 1 FROM processes p WHERE p.id = cases.owner)";

impl Store {
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
            let mut others = ActiveProcess::others(connection, me)?;
            others.retain(|other| !other.is_alive);
            Ok(others)
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

/// Ends cases of a dead process with too many deaths as failed. Returns their number.
fn quarantine(
    connection: &Connection,
    rules: &[Precision],
    process: i64,
) -> rusqlite::Result<usize> {
    let condemned: Vec<(i64, sd_core::Params, u64)> = connection.all(
        "SELECT c.id, p.params, c.steps_done FROM cases c JOIN points p ON p.id = c.point
         WHERE c.owner = ?1 AND c.state = 'running' AND c.deaths >= ?2",
        params![process, DEATH_LIMIT],
        |row| Ok((row.get(0)?, super::schema::params(row, 1)?, row.get(2)?)),
    )?;
    for (id, params, step) in &condemned {
        let checkpoints = runs::checkpoints(connection, *id)?;
        let last = checkpoints.into_iter().find_map(Result::ok);
        let failure = runs::Attempt {
            error: format!(
                "its process was killed or crashed {DEATH_LIMIT} times in a row before its next checkpoint \
                 (out of memory?); `sweep run --retry-failed` tries again"
            ),
            step: *step,
            strain: *step as f64 * params.time_step,
            snapshot: last.map(|last| replay(params, &last.snapshot)),
            ..runs::Attempt::default()
        };
        settle::fail(connection, rules, *id, &failure.by(process))?;
    }
    Ok(condemned.len())
}
