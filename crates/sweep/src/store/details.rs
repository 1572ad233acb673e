//! All stored data of one case.

use super::failures::{self, Attempt};
use super::processes::program;
use super::schema::params;
use super::statements::Statements;
use super::{Store, StoreError, runs, samples};
use crate::measure::doubt::Doubt;
use rusqlite::Row;
use sd_core::{Params, Sample};
use serde::Serialize;

/// One case with its state and data.
#[derive(Debug, Clone, Serialize)]
pub struct CaseDetails {
    /// Its key.
    pub key: String,
    /// Its number in the campaign file, from 1; `None` once it has left the grid.
    pub number: Option<u64>,
    /// Its parameters.
    pub params: Params,
    /// Its seed.
    pub seed: u64,
    /// Its state.
    pub state: String,
    /// Steps of the whole run.
    pub steps: u64,
    /// Steps done, as of the last checkpoint.
    pub steps_done: u64,
    /// Number of attempts.
    pub attempts: u64,
    /// Reasons why its numbers are doubtful, if any.
    pub doubts: Vec<String>,
    /// Wall seconds, once it is done.
    pub wall_time_s: Option<f64>,
    /// Seconds of CPU.
    pub cpu_time_s: Option<f64>,
    /// Number of times it was resumed from a checkpoint.
    pub resumed: Option<u64>,
    /// The process that computed it, or computes it.
    pub origin: Option<Origin>,
    /// Its failed attempts, the last one last.
    pub failures: Vec<Attempt>,
    /// Number of frames.
    pub frames: u64,
    /// Its samples so far, with their steps.
    pub samples: Vec<(u64, Sample)>,
}

/// Where a run was computed.
#[derive(Debug, Clone, Serialize)]
pub struct Origin {
    /// Host.
    pub host: String,
    /// Version of the program.
    pub version: String,
    /// Version of its physics.
    pub physics_version: u64,
    /// Hash of its executable.
    pub build: String,
    /// Its end or last heartbeat, in milliseconds since 1970.
    pub at: i64,
}

impl Store {
    /// The key of the case identified by the beginning of a key or by a number of the campaign
    /// file; an exact number takes precedence.
    ///
    /// # Errors
    /// [`StoreError::Case`] if no case or several match, and I/O or SQLite errors.
    pub fn key_of(&self, given: &str) -> Result<String, StoreError> {
        let mut keys = self.find_cases(given)?;
        match (keys.pop(), keys.as_slice()) {
            (None, _) => Err(self.no_case(given, "no case")),
            (Some(key), []) => Ok(key),
            (Some(_), _) => Err(self.no_case(given, "the beginning of several cases")),
        }
    }

    /// The error about a name that does not match exactly one case.
    pub(crate) fn no_case(&self, given: &str, what: &'static str) -> StoreError {
        StoreError::Case {
            path: self.path.clone(),
            given: given.to_owned(),
            what,
        }
    }

    /// Keys of the cases that match a name, at most two.
    fn find_cases(&self, given: &str) -> Result<Vec<String>, StoreError> {
        let number = given.parse::<i64>().ok().filter(|_| given.len() < 8);
        let by_number = "SELECT key FROM cases WHERE position = ?1 - 1";
        let by_number: Vec<String> = self.read(self.connection.values(by_number, [number]))?;
        if !by_number.is_empty() {
            return Ok(by_number);
        }
        let by_key = "SELECT key FROM cases WHERE substr(key, 1, length(?1)) = lower(?1) ORDER BY key LIMIT 2";
        self.read(self.connection.values(by_key, [given]))
    }

    /// The details of a case, by a name as for [`Store::key_of`].
    pub(crate) fn details(&self, given: &str) -> Result<CaseDetails, StoreError> {
        self.verify()?;
        let key = self.key_of(given)?;
        let query = "SELECT c.id, c.key, c.position, q.params, c.seed, c.state, c.steps, c.steps_done, c.attempts,
                 r.wall_time_s, r.resumed, p.host, p.version, p.physics_version, p.build,
                 coalesce(r.finished_at, p.heartbeat), coalesce(r.doubts, ''), r.cpu_time_s
             FROM cases c JOIN points q ON q.id = c.point
             LEFT JOIN results r ON r.case_id = c.id AND c.state IN ('done', 'jammed')
             LEFT JOIN processes p ON p.id = coalesce(r.process, c.owner,
                 (SELECT process FROM failures f WHERE f.case_id = c.id ORDER BY f.id DESC LIMIT 1))
             WHERE c.key = ?1";
        let (id, mut details) = self.read(self.connection.one(query, [&key], case))?;
        self.read(runs::check(&self.connection, "c.id = ?1", &[&id]))?;
        details.failures = self.read(failures::of(&self.connection, id))?;
        details.samples = self.read(samples::of(&self.connection, id, details.steps))?;
        details.frames = self.frame_count(&key)?;
        Ok(details)
    }

    /// Samples of a case so far, with their steps.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub fn samples(&self, key: &str) -> Result<Vec<(u64, Sample)>, StoreError> {
        let case = "SELECT id, steps FROM cases WHERE key = ?1";
        let found = self.connection.find(case, [key], |row| row.try_into());
        match self.read(found)? {
            Some((id, steps)) => self.read(samples::of(&self.connection, id, steps)),
            None => Ok(Vec::new()),
        }
    }

    /// Strain and viscosity of a case at its samples so far.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub fn trace(&self, key: &str) -> Result<Vec<(f64, f64)>, StoreError> {
        Ok(self
            .samples(key)?
            .into_iter()
            .map(|(_, sample)| (sample.strain, sample.viscosity))
            .filter(|(_, viscosity)| viscosity.is_finite())
            .collect())
    }
}

impl Origin {
    /// Name and version of the program.
    pub fn program(&self) -> String {
        program(&self.version, self.physics_version, &self.build)
    }
}

/// One row of [`Store::details`], and the number of its case.
fn case(row: &Row<'_>) -> rusqlite::Result<(i64, CaseDetails)> {
    let host: Option<String> = row.get(11)?;
    let origin = match host {
        None => None,
        Some(host) => Some(Origin {
            host,
            version: row.get(12)?,
            physics_version: row.get(13)?,
            build: row.get(14)?,
            at: row.get(15)?,
        }),
    };
    let details = CaseDetails {
        key: row.get(1)?,
        number: row.get::<_, Option<u64>>(2)?.map(|position| position + 1),
        params: params(row, 3)?,
        seed: row.get(4)?,
        state: row.get(5)?,
        steps: row.get(6)?,
        steps_done: row.get(7)?,
        attempts: row.get(8)?,
        doubts: Doubt::read(&row.get::<_, String>(16)?)
            .into_iter()
            .map(Doubt::meaning)
            .collect(),
        wall_time_s: row.get(9)?,
        cpu_time_s: row.get(17)?,
        resumed: row.get(10)?,
        origin,
        failures: Vec::new(),
        frames: 0,
        samples: Vec::new(),
    };
    Ok((row.get(0)?, details))
}
