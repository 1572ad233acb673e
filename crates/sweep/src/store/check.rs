//! Checks the integrity of a store, and resets damaged runs to pending, to be recomputed with the
//! same digits.

use super::digest::{DigestMismatch, Sealed};
use super::entered::{self, Entered};
use super::runs::{LAST, OF_CASES};
use super::statements::Statements;
use super::{
    BadCheckpoint, Checkpoint, Store, StoreError, frames, points, processes, runs, samples, show,
};
use rusqlite::Connection;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Largest file whose structure is checked before a run, in bytes: this takes less than half a
/// second.
const CHEAP: u64 = 64 << 20;
/// Selects the size of a file in bytes, from its header.
const SIZE: &str = "SELECT page_count * page_size FROM pragma_page_count, pragma_page_size";
/// Tables with a digest in each row.
const SEALED: [Sealed; 4] = [
    entered::SEALED,
    points::SEALED,
    processes::SEALED,
    frames::SEALED,
];

/// A damaged entry.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Key of the run it belongs to.
    pub key: Option<String>,
    /// Description.
    pub what: String,
}

impl Finding {
    fn of_no_run(what: &str) -> Self {
        Self {
            key: None,
            what: what.to_owned(),
        }
    }
}

/// Findings of a check.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Number of runs checked.
    pub runs: u64,
    /// Damaged entries.
    pub findings: Vec<Finding>,
    /// Description of changes in a log that cannot be read.
    pub warning: Option<String>,
}

/// A part of a store that is deleted as a whole, by its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    /// A run.
    Run(i64),
    /// The grid, which is entered again.
    Grid,
    Process(i64),
    Point(i64),
}

/// All damage in a store with readable pages, each part with its first finding.
#[derive(Default)]
struct Damage {
    parts: BTreeMap<Part, String>,
    /// Runs with damaged rows in the table of cases.
    rows: BTreeSet<i64>,
}

impl Damage {
    fn of(connection: &Connection) -> rusqlite::Result<Self> {
        let mut damage = Self::default();
        for sealed in SEALED {
            let mut rows = Vec::new();
            sealed.each(connection, "true", [], |row, _, altered| {
                rows.extend(altered.map(|_| row));
                Ok(())
            })?;
            for row in rows {
                let part = match sealed.table {
                    "processes" => Part::Process(row),
                    "points" => Part::Point(row),
                    "frames" => {
                        let case = "SELECT case_id FROM frames WHERE rowid = ?1";
                        Part::Run(connection.one(case, [row], |row| row.get(0))?)
                    }
                    _ => Part::Grid,
                };
                damage.add(part, sealed.words);
            }
        }
        damage.look_at_cases(connection)?;
        damage.look_at_samples(connection)?;
        for case in frames::incomplete(connection, "true", [])? {
            damage.add(Part::Run(case), "frames of a run are missing");
        }
        damage.look_at_last_states(connection)?;
        // Every result has a process that computed it.
        let orphaned: Vec<i64> = connection.values(
            "SELECT case_id FROM results WHERE process NOT IN (SELECT id FROM processes)",
            [],
        )?;
        for case in orphaned {
            damage.add(Part::Run(case), "the process that computed it is missing");
        }
        for table in OF_CASES {
            let astray = format!(
                "SELECT DISTINCT case_id FROM {table} WHERE case_id NOT IN (SELECT id FROM cases)"
            );
            let astray: Vec<i64> = connection.values(&astray, [])?;
            for case in astray {
                damage.add(Part::Run(case), "there is no such run");
            }
        }
        Ok(damage)
    }

    fn add(&mut self, part: Part, what: &str) {
        self.parts.entry(part).or_insert_with(|| what.to_owned());
    }

    /// Records an error about the grid or the campaign as damage of the grid.
    fn unless_altered(&mut self, result: rusqlite::Result<()>) -> rusqlite::Result<()> {
        match result {
            Err(error) if DigestMismatch::in_error(&error).is_some() => {
                self.add(Part::Grid, &DigestMismatch::words(&error));
                Ok(())
            }
            other => other,
        }
    }

    /// Checks that every case has its point and key, and the state, result and failures that were
    /// written.
    fn look_at_cases(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        let looked = show::look(connection, |run, known| {
            if known.is_err() {
                self.rows.insert(run.id);
            }
            if let Err(error) = known.and_then(|_| run.check()) {
                self.add(Part::Run(run.id), &DigestMismatch::words(&error));
            }
            Ok(())
        });
        self.unless_altered(looked)
    }

    /// Checks the last state of every completed run. One of another format is whole: the result
    /// stands, and only to a larger strain is the run computed from its beginning.
    fn look_at_last_states(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        let last = "SELECT k.case_id, k.data, r.computed FROM checkpoints k
             JOIN results r ON r.case_id = k.case_id WHERE k.generation = ?1";
        let mut query = connection.prepare_cached(last)?;
        let mut rows = query.query([LAST])?;
        while let Some(row) = rows.next()? {
            let is_whole = match Checkpoint::decode(row.get_ref(1)?.as_blob()?) {
                Ok(last) => last.snapshot.steps() == row.get::<_, u64>(2)?,
                Err(BadCheckpoint::Version { .. }) => true,
                Err(_) => false,
            };
            if !is_whole {
                self.add(Part::Run(row.get(0)?), "the last state of a run");
            }
        }
        Ok(())
    }

    /// Checks the digest of the samples of every case.
    fn look_at_samples(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        let mut digests = samples::digests(connection)?;
        let written: Vec<(i64, i64)> = connection.all(
            "SELECT id, samples_digest FROM cases WHERE samples_digest IS NOT NULL",
            [],
            |row| row.try_into(),
        )?;
        let missed = written
            .into_iter()
            .filter(|(case, written)| digests.remove(case) != Some(*written));
        let cases: Vec<i64> = missed.map(|(case, _)| case).collect();
        for case in cases.into_iter().chain(digests.into_keys()) {
            self.add(Part::Run(case), samples::WORDS);
        }
        Ok(())
    }

    /// As a finding.
    fn findings(&self, connection: &Connection) -> Vec<Finding> {
        let key = |case: &i64| {
            let key = connection.value("SELECT key FROM cases WHERE id = ?1", [case]);
            key.ok().flatten()
        };
        let parts = self.parts.iter();
        let finding = |(part, what): (&Part, &String)| Finding {
            key: if let Part::Run(case) = part {
                key(case)
            } else {
                None
            },
            what: what.clone(),
        };
        parts.map(finding).collect()
    }

    /// Deletes damaged parts: runs become pending, cases and points are entered again with the
    /// campaign.
    fn forget(&self, connection: &Connection) -> rusqlite::Result<()> {
        for part in self.parts.keys() {
            match part {
                Part::Run(case) => runs::forget(connection, *case)?,
                Part::Point(point) => {
                    let cases = "SELECT id FROM cases WHERE point = ?1";
                    let cases: Vec<i64> = connection.values(cases, [point])?;
                    for case in cases {
                        runs::forget(connection, case)?;
                    }
                    connection.run("DELETE FROM cases WHERE point = ?1", [point])?;
                    connection.run("DELETE FROM points WHERE id = ?1", [point])?;
                }
                Part::Process(process) => {
                    connection.run(
                        "UPDATE processes SET host = 'unknown', build = '', version = '' WHERE id = ?1",
                        [process],
                    )?;
                    processes::SEALED.seal(connection, "t.id = ?1", [process])?;
                }
                Part::Grid => {}
            }
        }
        for case in &self.rows {
            connection.run("DELETE FROM cases WHERE id = ?1", [case])?;
        }
        let is_of_grid = |part: &Part| matches!(part, Part::Grid | Part::Point(_));
        if !self.rows.is_empty() || self.parts.keys().any(is_of_grid) {
            // The version last run is entered again.
            connection.run("UPDATE campaign SET digest = 0", [])?;
        }
        Ok(())
    }
}

/// Faults of the structure of a store found by `SQLite`.
fn structure(connection: &Connection) -> rusqlite::Result<Vec<String>> {
    let mut found: Vec<String> = connection.values("PRAGMA main.integrity_check(20)", [])?;
    // Invalid values of columns are found by other checks.
    found.retain(|line| line != "ok" && !line.contains("CHECK constraint"));
    Ok(found)
}

/// Checks all digests and the structure of a store. Reads only.
///
/// # Errors
/// A file that is missing, unreadable, not a store, or of another schema.
pub fn check(path: &Path) -> Result<Checked, StoreError> {
    let store = Store::open_read_only(path)?;
    let connection = &store.connection;
    let found = || {
        let structure = structure(connection)?;
        let mut findings: Vec<Finding> = structure
            .iter()
            .map(|what| Finding::of_no_run(what))
            .collect();
        match Damage::of(connection) {
            Ok(damage) => findings.extend(damage.findings(connection)),
            // Pages that cannot be read are among the findings already.
            Err(error) if findings.is_empty() => return Err(error),
            Err(_) => {}
        }
        let runs = connection.one("SELECT count(*) FROM cases", [], |row| row.get(0))?;
        Ok((runs, findings))
    };
    let (runs, findings) = store.read(found())?;
    Ok(Checked {
        runs,
        findings,
        warning: store.warning.clone(),
    })
}

impl Store {
    /// Resets damaged runs to pending, so that they are recomputed with the same digits. Returns
    /// these runs.
    pub(crate) fn forget_damaged(&mut self) -> Result<Vec<Finding>, StoreError> {
        let mut findings = Vec::new();
        if self.number(SIZE, [])? <= CHEAP {
            let found = self.read(structure(&self.connection))?;
            if !found.is_empty() {
                // Rebuilds indices from the tables; remaining faults cannot be repaired this way.
                self.write(|connection| {
                    connection.execute_batch("REINDEX")?;
                    match structure(connection)?.first() {
                        None => Ok(()),
                        Some(what) => Err(DigestMismatch::error(what.trim().replace('\n', " "))),
                    }
                })?;
                findings.extend(found.iter().map(|what| Finding::of_no_run(what)));
            }
        }
        let damage = || {
            // Reads one consistent state.
            let transaction = self.connection.unchecked_transaction()?;
            Damage::of(&transaction)
        };
        if self.read(damage())?.parts.is_empty() {
            return Ok(findings);
        }
        self.write(|connection| {
            let damage = Damage::of(connection)?;
            findings.extend(damage.findings(connection));
            damage.forget(connection)
        })?;
        Ok(findings)
    }
}

/// Accepts the present contents of a store as written: for tests and benches, which change stores
/// by hand.
///
/// # Errors
/// An I/O or SQLite error.
pub fn accept_changes(path: &Path) -> Result<(), StoreError> {
    let accepted = || -> rusqlite::Result<()> {
        let connection = Connection::open(path)?;
        connection.execute_batch("BEGIN IMMEDIATE")?;
        let keys = "SELECT key FROM cases WHERE position IS NOT NULL";
        let keys: Vec<String> = connection.values(keys, [])?;
        let keys = keys
            .iter()
            .map(|key| u128::from_str_radix(key, 16).unwrap_or(0));
        let grid = entered::grid(keys);
        for sealed in SEALED {
            sealed.seal(&connection, "true", [])?;
        }
        let entered = Entered::read(&connection)?;
        Entered { grid, ..entered }.write(&connection)?;
        connection.execute("UPDATE cases SET samples_digest = NULL", [])?;
        for case in samples::digests(&connection)? {
            let digest = "UPDATE cases SET samples_digest = ?2 WHERE id = ?1";
            connection.run(digest, case)?;
        }
        runs::seal(&connection, "true", &[])?;
        connection.execute_batch("COMMIT")
    };
    accepted().map_err(|error| StoreError::sqlite(path, error, false))
}
