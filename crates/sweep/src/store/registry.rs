//! The processes that work on a store: entering, living, leaving, and taking over from those that are gone.

use super::digest::{Sealed, whole};
use super::statements::Statements;
use super::{Checkpoint, Store, StoreError, claims, count, failures, integer, rules};
use crate::case::PHYSICS_VERSION;
use crate::model::replay::replay;
use crate::system::process::{self, Identity, Life};
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params};

/// A case whose processes died so many times in a row, with no new checkpoint between, counts as failed: most likely it
/// kills them.
pub const DEATH_LIMIT: u32 = 5;
/// The processes; the columns are what describes one.
pub(super) const SEALED: Sealed = Sealed {
    table: "processes",
    columns: "host, boot, namespace, pid, start, started_at, version, physics_version, build, threads, job, task, restart, node",
    with_key: false,
    words: "a process that computed",
};
/// What is true of a case under way whose owner is not there.
const ORPHANED_RUNNING: &str =
    "state = 'running' AND NOT EXISTS (SELECT 1 FROM processes p WHERE p.id = cases.owner)";

/// This process as the store knows it.
#[derive(Debug, Clone)]
pub(super) struct Registered {
    pub(super) id: i64,
    identity: Identity,
}

/// A process that has not left, as far as the store knows.
pub(super) struct AtWork {
    id: i64,
    pub(super) identity: Identity,
    pub(super) file: Option<String>,
    request: Option<String>,
    is_alive: bool,
}

impl AtWork {
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
                is_alive: life == Life::Alive,
            })
        };
        let others = "SELECT id, host, boot, namespace, pid, start, heartbeat, file, request
             FROM processes
             WHERE ended_at IS NULL AND id != ?1";
        connection.all(others, [me], read)
    }

    /// One that lives and computes what another version of the campaign requests.
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

/// A process that did not leave in order, if nobody else works on the store.
pub(super) fn abandoned(connection: &Connection) -> rusqlite::Result<Option<(u32, String)>> {
    let others = AtWork::others(connection, 0)?;
    if others.iter().any(|other| other.is_alive) {
        return Ok(None);
    }
    Ok(others.into_iter().next_back().map(AtWork::name))
}

/// Another process that works on the store.
pub(super) fn other_worker(
    connection: &Connection,
    me: i64,
) -> rusqlite::Result<Option<(u32, String)>> {
    let mut others = AtWork::others(connection, me)?.into_iter();
    Ok(others.find(|other| other.is_alive).map(AtWork::name))
}

/// Writes the row of a process. Gives its number.
pub(super) fn put(
    connection: &Connection,
    described: &[Value],
    more: &[(&str, Value)],
) -> rusqlite::Result<i64> {
    SEALED.put(connection, None, described, more)?;
    Ok(connection.last_insert_rowid())
}

/// What describes the process of a number; `None` if that is not what was written.
pub(super) fn described(connection: &Connection, id: i64) -> Option<Vec<Value>> {
    SEALED.check(connection, "t.id = ?1", [id]).ok()?;
    let columns = SEALED.columns;
    let mut query = connection
        .prepare_cached(&format!("SELECT {columns} FROM processes WHERE id = ?1"))
        .ok()?;
    let number = query.column_count();
    query
        .query_row([id], |row| {
            (0..number).map(|column| row.get(column)).collect()
        })
        .ok()
}

impl Store {
    /// Row of this process; no row has the number 0.
    pub(super) fn me(&self) -> i64 {
        self.process.as_ref().map_or(0, |process| process.id)
    }

    /// Enters this process, which computes what a version of the campaign requests.
    pub(super) fn enter_process(
        connection: &Connection,
        request: &super::Request,
    ) -> rusqlite::Result<Registered> {
        let identity = Identity::of_this_process();
        let now = process::now();
        let text = |text: &str| Value::Text(text.to_owned());
        let mut described = vec![
            text(&identity.host),
            text(&identity.boot),
            text(&identity.namespace),
            Value::Integer(identity.pid.into()),
            text(&identity.start),
            Value::Integer(now),
            text(env!("CARGO_PKG_VERSION")),
            Value::Integer(PHYSICS_VERSION.into()),
            Value::Text(process::build()),
            Value::Integer(0),
        ];
        described.resize(14, Value::Null);
        let more = [
            ("heartbeat", Value::Integer(now)),
            ("file", text(&request.file.to_string_lossy())),
            ("request", text(&request.hash)),
        ];
        let id = put(connection, &described, &more)?;
        Ok(Registered { id, identity })
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
                    integer(threads as u64),
                    task.as_ref().map(|task| &task.job),
                    task.as_ref().map(|task| integer(task.task as u64)),
                    task.as_ref().map(|task| task.restart),
                    task.as_ref().map(|task| &task.node),
                ],
            )?;
            SEALED.seal(connection, &format!("t.id = {me}"))
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
            claims::free(connection, me)?;
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
        let dead = |connection: &Connection| -> rusqlite::Result<Vec<AtWork>> {
            let mut others = AtWork::others(connection, me)?;
            others.retain(|other| !other.is_alive);
            Ok(others)
        };
        // A look without the lock first: nearly always there is nothing to do.
        let orphaned: bool = self.read(
            self.connection
                .prepare_cached(&format!("SELECT 1 FROM cases WHERE {ORPHANED_RUNNING}"))
                .and_then(|mut query| query.exists([])),
        )?;
        if !orphaned && self.read(dead(&self.connection))?.is_empty() {
            return Ok(0);
        }
        self.write(|connection| {
            let mut freed = claims::free_where(connection, ORPHANED_RUNNING, &[])?;
            for process in dead(connection)? {
                // A machine that went down is no fault of the case. Nor is a batch that of cases that were not begun.
                if process.identity.boot == identity.boot {
                    connection.execute(
                        "UPDATE cases SET deaths = deaths + 1 WHERE owner = ?1 AND state = 'running'",
                        [process.id],
                    )?;
                    freed += quarantine(connection, process.id)?;
                }
                freed += claims::free(connection, process.id)?;
                end(connection, process.id)?;
            }
            Ok(freed)
        })
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
        |row| {
            Ok((
                row.get(0)?,
                super::points::params(row, 1)?,
                count(row.get(2)?),
            ))
        },
    )?;
    for (id, params, steps_done) in &condemned {
        let last = claims::checkpoints(connection, *id)?
            .into_iter()
            .find_map(Result::ok);
        let failure = failures::Attempt {
            error: format!(
                "its process was killed or crashed {DEATH_LIMIT} times in a row before its next checkpoint \
                 (out of memory?); `sweep run --retry-failed` tries again"
            ),
            step: *steps_done,
            strain: *steps_done as f64 * params.time_step,
            snapshot: last.map(|last: Checkpoint| replay(params, &last.snapshot)),
            process,
            failed_at: process::now(),
            ..failures::Attempt::default()
        };
        failures::insert(connection, *id, failure)?;
        claims::end(connection, *id, crate::case::State::Failed, *steps_done)?;
        claims::drop_checkpoints(connection, *id)?;
        rules::apply_to_case(connection, *id)?;
    }
    Ok(condemned.len())
}

/// The values that describe a process that is not known.
pub(super) fn unknown() -> Vec<Value> {
    let empty = |column| match column {
        "pid" | "started_at" | "physics_version" | "threads" => whole(0),
        "job" | "task" | "restart" | "node" => Value::Null,
        "host" => Value::Text("unknown".into()),
        _ => Value::Text(String::new()),
    };
    SEALED.columns.split(", ").map(empty).collect()
}
