//! The processes that work on a store, and those that computed its results.

use super::digest::{DigestMismatch, Sealed, whole};
use super::entry::Entered;
use super::statements::Statements;
use super::{Store, StoreError};
use crate::model::case::PHYSICS_VERSION;
use crate::system::process::{self, Identity, ProcessState};
use rusqlite::types::Value;
use rusqlite::{Connection, Row};
use serde::Serialize;

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
#[derive(Debug, Clone, PartialEq, Serialize)]
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
        self.rows(
            "SELECT p.host, p.version, p.physics_version, p.build, p.threads, p.started_at,
                 r.results
             FROM (SELECT process, count(*) AS results FROM results GROUP BY process) r LEFT
             JOIN processes p ON p.id = r.process
             ORDER BY r.process DESC LIMIT 50",
            [],
            |row| {
                let missing_process = || DigestMismatch::error("a result of a missing process");
                Ok(Provenance {
                    host: row
                        .get::<_, Option<String>>(0)?
                        .ok_or_else(missing_process)?,
                    version: row.get(1)?,
                    physics_version: row.get(2)?,
                    build: row.get(3)?,
                    threads: row.get(4)?,
                    started_at: row.get(5)?,
                    results: row.get(6)?,
                })
            },
        )
    }
}
