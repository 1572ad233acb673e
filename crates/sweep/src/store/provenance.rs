//! Who computed what is stored, and how long the rest will take.

use super::{Store, StoreError, count, process};
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
    /// The campaign file last run, to the letter.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn campaign_text(&self) -> Result<String, StoreError> {
        self.of_campaign("SELECT text FROM campaign")
    }

    /// One text of the campaign.
    pub(super) fn of_campaign(&self, query: &str) -> Result<String, StoreError> {
        match self.connection.query_row(query, [], |row| row.get(0)) {
            Err(rusqlite::Error::QueryReturnedNoRows) => Err(StoreError::NoCampaign {
                path: self.path.clone(),
            }),
            result => self.read(result),
        }
    }

    /// Processes that finished results, the latest first.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn provenance(&self) -> Result<Vec<Provenance>, StoreError> {
        let rows = self
            .connection
            .prepare(
                "SELECT p.host, p.version, p.physics_version, p.build, p.threads, p.started_at, r.results
                 FROM processes p JOIN (SELECT process, count(*) AS results FROM results GROUP BY process) r ON r.process = p.id
                 ORDER BY p.id DESC LIMIT 50",
            )
            .and_then(|mut query| {
                query
                    .query_map([], |row| {
                        Ok(Provenance {
                            host: row.get(0)?,
                            version: row.get(1)?,
                            physics_version: count(row.get(2)?),
                            build: row.get(3)?,
                            threads: count(row.get(4)?),
                            started_at: row.get(5)?,
                            results: count(row.get(6)?),
                        })
                    })?
                    .collect()
            });
        self.read(rows)
    }

    /// Seconds until the cases at work and those waiting are done, judged by what finished ones took; `None` if nobody
    /// works or nothing is finished yet.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn time_left(&self) -> Result<Option<f64>, StoreError> {
        let (seconds, cost): (f64, f64) = self.read(self.connection.query_row(
            "SELECT total(r.wall_time_s), total(c.cost * e.steps / c.steps) FROM results r
                 JOIN cases c ON c.id = r.case_id JOIN ends e ON e.case_id = c.id",
            [],
            |row| Ok((row.get(0)?, row.get(1)?)),
        ))?;
        let heard_since = process::now()
            - i64::try_from(process::HEARTBEAT_LIMIT.as_millis()).unwrap_or(i64::MAX);
        let (running, left): (i64, f64) = self.read(self.connection.query_row(
            "SELECT total(c.state = 'running' AND p.heartbeat >= ?1),
                 total(CASE WHEN c.state IN ('pending', 'running') THEN c.cost * (1.0 - 1.0 * c.steps_done / c.steps) END)
             FROM cases c LEFT JOIN processes p ON p.id = c.owner WHERE c.position IS NOT NULL",
            [heard_since],
            |row| Ok((row.get::<_, f64>(0)?, row.get(1)?)),
        ))
        .map(|(running, left)| {
            #[expect(clippy::cast_possible_truncation, reason = "a count")]
            let running = running as i64;
            (running, left)
        })?;
        Ok((running > 0 && cost > 0.0).then(|| left * seconds / cost / running as f64))
    }
}
