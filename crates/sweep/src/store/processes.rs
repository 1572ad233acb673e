//! The processes that ever worked on a store, as it describes them.

use super::digest::{Sealed, whole};
use super::entered::Entered;
use super::statements::Statements;
use crate::model::case::PHYSICS_VERSION;
use crate::system::process;
use crate::system::process::{ProcessIdentity, ProcessState};
use rusqlite::Connection;
use rusqlite::types::Value;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

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
    pub(super) identity: ProcessIdentity,
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
#[derive(Deserialize)]
pub(super) struct ActiveProcess {
    pub(super) id: i64,
    #[serde(flatten)]
    pub(super) identity: ProcessIdentity,
    heartbeat: i64,
    pub(super) file: Option<String>,
    request: Option<String>,
}

impl ActiveProcess {
    /// All of them but the process `me`, each with whether it lives.
    pub(super) fn others(connection: &Connection, me: i64) -> rusqlite::Result<Vec<(Self, bool)>> {
        let here = ProcessIdentity::of_this_process();
        let others = "SELECT id, host, boot, namespace, pid, start, heartbeat, file, request
             FROM processes WHERE ended_at IS NULL AND id != ?1";
        let others: Vec<Self> = connection.named(others, [me])?;
        let judged = others.into_iter().map(|other| {
            let life = here.judge(&other.identity, process::silence(other.heartbeat));
            (other, life == ProcessState::Alive)
        });
        Ok(judged.collect())
    }

    /// The numbers of those that live.
    pub(super) fn living(connection: &Connection) -> rusqlite::Result<HashSet<i64>> {
        let others = Self::others(connection, 0)?.into_iter();
        let living = others.filter(|(_, is_alive)| *is_alive);
        Ok(living.map(|(process, _)| process.id).collect())
    }

    /// One that lives.
    pub(super) fn alive(connection: &Connection, me: i64) -> rusqlite::Result<Option<Self>> {
        let mut others = Self::others(connection, me)?.into_iter();
        Ok(others.find_map(|(other, is_alive)| is_alive.then_some(other)))
    }

    /// One that lives and computes another version of the campaign.
    pub(super) fn conflicting(
        connection: &Connection,
        me: i64,
        request: &str,
    ) -> rusqlite::Result<Option<Self>> {
        let differs = |other: &Self| other.request.as_ref().is_some_and(|other| other != request);
        let mut others = Self::others(connection, me)?.into_iter();
        Ok(others.find_map(|(other, is_alive)| (is_alive && differs(&other)).then_some(other)))
    }
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
    let identity = ProcessIdentity::of_this_process();
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
    let id = SEALED.put(connection, None, &described, &more)?;
    Ok(Registered { id, identity })
}

/// Whether the attempt of a process is later than that of another. Processes of the store itself
/// count as the latest.
pub(super) fn is_later(connection: &Connection, one: i64, other: i64) -> rusqlite::Result<bool> {
    // The name of a job starts with its number.
    let attempt = "SELECT coalesce(CAST(job AS INTEGER), 0x7fffffffffffffff), coalesce(restart, 0), started_at, host, pid
         FROM processes WHERE id";
    let later = format!("SELECT ({attempt} = ?1) > ({attempt} = ?2)");
    connection.one(&later, [one, other], |row| row.get(0))
}

/// The attempt of a process in words.
pub(super) fn name(connection: &Connection, id: i64) -> rusqlite::Result<String> {
    let name = "SELECT CASE WHEN job IS NULL THEN 'process ' || pid
             ELSE 'job ' || job || ' task ' || task || ' restart ' || restart END || ' on ' || host
         FROM processes WHERE id = ?1";
    connection.one(name, [id], |row| row.get(0))
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

    /// Description of the process: its program, host, threads and results.
    pub(crate) fn words(&self) -> String {
        let (program, host) = (self.program(), &self.host);
        let (threads, results) = (self.threads, self.results);
        format!("{program} on {host}, {threads} threads, {results} results")
    }
}

/// Description of a program.
pub(super) fn program(version: &str, physics_version: u64, build: &str) -> String {
    let build = build.get(..12).unwrap_or(build);
    format!("sweep {version} (physics {physics_version}, build {build})")
}
