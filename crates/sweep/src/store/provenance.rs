//! Who computed what is stored, and how long the rest will take.

use super::digest::Altered;
use super::{Store, StoreError, processes};
use serde::Serialize;

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
    /// When it began, in milliseconds since 1970.
    pub started_at: i64,
    /// Results it finished.
    pub results: u64,
}

impl Provenance {
    /// The program, as people name it: version, version of its physics, beginning of its hash.
    pub fn program(&self) -> String {
        program(&self.version, self.physics_version, &self.build)
    }
}

/// A program, as people name it.
pub(super) fn program(version: &str, physics_version: u64, build: &str) -> String {
    let build = build.get(..12).unwrap_or(build);
    format!("sweep {version} (physics {physics_version}, build {build})")
}

impl Store {
    /// Processes that finished results, the latest first.
    pub(crate) fn provenance(&self) -> Result<Vec<Provenance>, StoreError> {
        self.read(processes::SEALED.check(&self.connection, "true", []))?;
        self.rows(
            "SELECT p.host, p.version, p.physics_version, p.build, p.threads, p.started_at,
                 r.results
             FROM (SELECT process, count(*) AS results FROM results GROUP BY process) r LEFT
             JOIN processes p ON p.id = r.process
             ORDER BY r.process DESC LIMIT 50",
            [],
            |row| {
                let nobody = || Altered::error("a result of a process that is not there");
                Ok(Provenance {
                    host: row.get::<_, Option<String>>(0)?.ok_or_else(nobody)?,
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
