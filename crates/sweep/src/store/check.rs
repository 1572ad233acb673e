//! Whether all of a store is what was written; and what is damaged made pending again, to be computed with the same digits.

use super::campaign;
use super::digest::{DigestMismatch, altered, reseal};
use super::log::Mark;
use super::schema::{self, axis_columns};
use super::statements::Statements;
use super::{
    Store, StoreError, ends, failures, frames, points, processes, results, rules, samples, states,
};
use rusqlite::Connection;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Largest file whose structure is looked at before a run, in bytes: this takes less than half a second.
const CHEAP: u64 = 64 << 20;
/// Selects the size of a file, as it says itself, in bytes.
pub(super) const SIZE: &str =
    "SELECT page_count * page_size FROM pragma_page_count, pragma_page_size";
/// Tables with what was computed of a case.
pub(super) const OF_CASES: [&str; 6] = [
    "samples",
    "frames",
    "checkpoints",
    "results",
    "ends",
    "failures",
];

/// Tables with a digest in each row, what a row is in words, and a statement that selects of each row what the digest covers, the
/// digest, and its number.
fn kinds() -> Vec<(&'static str, &'static str, String)> {
    let sealed = [
        campaign::SEALED,
        processes::SEALED,
        rules::SEALED,
        ends::SEALED,
        failures::SEALED,
        frames::SEALED,
    ];
    let axes = axis_columns("");
    let of_points = format!("SELECT params, {axes}, digest, rowid FROM points");
    sealed
        .into_iter()
        .map(|kind| (kind.table, kind.words, kind.select()))
        .chain([
            ("points", "the parameters of a point", of_points),
            ("results", results::WORDS, results::select()),
        ])
        .collect()
}

/// Something that is not what was written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Key of the run it belongs to.
    pub key: Option<String>,
    /// What it is.
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

/// What was found in a store.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Runs that were looked at.
    pub runs: u64,
    /// What is damaged.
    pub findings: Vec<Finding>,
    /// What is lost with a log, in words.
    pub warning: Option<String>,
}

/// A part of a store that is forgotten as a whole, by its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    /// A run.
    Run(i64),
    /// The grid, which is entered anew.
    Grid,
    Process(i64),
    Point(i64),
}

/// All that is damaged in a store whose pages can be read, each part with the first that was found.
#[derive(Default)]
struct Damage {
    parts: BTreeMap<Part, String>,
    /// Runs whose rows among the cases are damaged themselves.
    rows: BTreeSet<i64>,
}

impl Damage {
    fn of(connection: &Connection) -> rusqlite::Result<Self> {
        let mut damage = Self::default();
        for (table, words, query) in kinds() {
            for (row, _) in altered(connection, &query, [])? {
                let part = match table {
                    "processes" => Part::Process(row),
                    "points" => Part::Point(row),
                    _ if OF_CASES.contains(&table) => {
                        let case = format!("SELECT case_id FROM {table} WHERE rowid = ?1");
                        Part::Run(connection.one(&case, [row], |row| row.get(0))?)
                    }
                    _ => Part::Grid,
                };
                damage.add(part, words);
            }
        }
        damage.look_at_cases(connection)?;
        damage.look_at_samples(connection)?;
        // Every result has a process that computed it.
        let orphaned: Vec<i64> = connection.values(
            "SELECT case_id FROM ends WHERE process NOT IN (SELECT id FROM processes)
             UNION SELECT case_id FROM results WHERE process NOT IN (SELECT id FROM processes)",
            [],
        )?;
        for case in orphaned {
            damage.add(Part::Run(case), "the process that computed it is not there");
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
        damage.unless_altered(rules::check(connection))?;
        Ok(damage)
    }

    fn add(&mut self, part: Part, what: &str) {
        self.parts.entry(part).or_insert_with(|| what.to_owned());
    }

    /// Takes an error about the grid or the campaign for damage of the grid.
    fn unless_altered(&mut self, result: rusqlite::Result<()>) -> rusqlite::Result<()> {
        match result {
            Err(error) if DigestMismatch::in_error(&error).is_some() => {
                self.add(Part::Grid, &DigestMismatch::words(&error));
                Ok(())
            }
            other => other,
        }
    }

    /// That every case has its point and its key, and the state that goes with its result and its failures.
    fn look_at_cases(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        let looked = points::look(connection, "c.id", "true", |row, known| {
            if let Err(error) = known {
                let case = row.get(12)?;
                self.add(Part::Run(case), &DigestMismatch::words(&error));
                self.rows.insert(case);
            }
            Ok(())
        });
        self.unless_altered(looked)
    }

    /// That the samples of every case are what was written.
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
            self.add(Part::Run(case), "the samples of a run");
        }
        Ok(())
    }

    /// As it is told.
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

    /// Forgets what is damaged: runs are pending again, cases and points are entered anew with the campaign.
    fn forget(&self, connection: &Connection) -> rusqlite::Result<()> {
        for part in self.parts.keys() {
            match part {
                Part::Run(case) => forget_case(connection, *case)?,
                Part::Point(point) => {
                    let cases = "SELECT id FROM cases WHERE point = ?1";
                    let cases: Vec<i64> = connection.values(cases, [point])?;
                    for case in cases {
                        forget_case(connection, case)?;
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
            // What the store was last run with is entered again.
            connection.run("UPDATE campaign SET request = '', digest = 0", [])?;
        }
        Ok(())
    }
}

/// Makes a case pending with nothing to it.
fn forget_case(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    for table in OF_CASES {
        connection.execute(&format!("DELETE FROM {table} WHERE case_id = ?1"), [case])?;
    }
    connection.execute(
        "UPDATE cases SET samples_digest = NULL WHERE id = ?1",
        [case],
    )?;
    states::reopen(connection, "id = ?2", &[case]).map(|_| ())
}

/// What `SQLite` finds wrong with the structure of a store.
fn structure(connection: &Connection) -> rusqlite::Result<Vec<String>> {
    let mut found: Vec<String> = connection.values("PRAGMA main.integrity_check(20)", [])?;
    // Values that no column of ours can have are found by other means.
    found.retain(|line| line != "ok" && !line.contains("CHECK constraint"));
    // SQLite looks whether an index of some cases has all of its rows, and not whether it has more.
    for (index, which) in schema::partial_indices() {
        let entries = |how: &str| {
            let count = format!("SELECT count(*) FROM cases {how} WHERE {which}");
            connection.one(&count, [], |row| row.get::<_, i64>(0))
        };
        if entries(&format!("INDEXED BY {index}"))? != entries("NOT INDEXED")? {
            found.push(format!("the index {index} has other cases"));
        }
    }
    Ok(found)
}

/// Compares all of a store with what was written, and looks at its structure. Only reads.
///
/// # Errors
/// A file that is missing, no store, of another schema, or cannot be read at all.
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
    /// Makes damaged runs pending again, so that they are computed again, with the same digits. Says which.
    pub(crate) fn forget_damaged(&mut self) -> Result<Vec<Finding>, StoreError> {
        let mut findings = Vec::new();
        if self.number(SIZE, [])? <= CHEAP {
            let found = self.read(structure(&self.connection))?;
            if !found.is_empty() {
                // Indices are made anew from the tables; what is wrong then is beyond that.
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
            // All of it is of one moment.
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

/// Takes what a store holds now for what was written: for whoever changed it by other means than this program, and means it.
///
/// # Errors
/// Trouble with the file.
pub fn accept_changes(path: &Path) -> Result<(), StoreError> {
    let accepted = || -> rusqlite::Result<()> {
        let connection = Connection::open(path)?;
        connection.execute_batch("BEGIN IMMEDIATE")?;
        let keys = "SELECT key FROM cases WHERE position IS NOT NULL";
        let keys: Vec<String> = connection.values(keys, [])?;
        let keys = keys
            .iter()
            .map(|key| u128::from_str_radix(key, 16).unwrap_or(0));
        let grid = super::request::grid(keys);
        connection.execute("UPDATE campaign SET grid = ?1", [grid])?;
        connection.execute("UPDATE cases SET samples_digest = NULL", [])?;
        for case in samples::digests(&connection)? {
            let digest = "UPDATE cases SET samples_digest = ?2 WHERE id = ?1";
            connection.run(digest, case)?;
        }
        for (table, _, query) in kinds() {
            reseal(&connection, table, &query, [])?;
        }
        Mark::renew(&connection)?;
        connection.execute_batch("COMMIT")
    };
    accepted().map_err(|error| StoreError::sqlite(path, error, false))
}
