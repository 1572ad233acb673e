//! Whether all of a store is what was written; and what is damaged made pending again, to be computed with the same digits.

use super::campaign;
use super::digest::{Altered, altered, reseal};
use super::log::Mark;
use super::schema::axis_columns;
use super::statements::Statements;
use super::{
    Store, StoreError, ends, failures, frames, points, processes, results, rules, samples, states,
};
use rusqlite::Connection;
use serde::Serialize;
use std::collections::BTreeMap;
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

/// All that is damaged in a store whose pages can be read.
#[derive(Default)]
struct Damage {
    /// Of runs, by their numbers: what it is, and whether the row of the case itself is damaged.
    cases: BTreeMap<i64, (String, bool)>,
    /// Of no run.
    others: Vec<String>,
    processes: Vec<i64>,
    points: Vec<i64>,
    /// Whether the grid has to be entered anew.
    grid: bool,
}

impl Damage {
    fn of(connection: &Connection) -> rusqlite::Result<Self> {
        let mut damage = Self::default();
        for (table, words, query) in kinds() {
            for (row, _) in altered(connection, &query, [])? {
                match table {
                    "processes" => damage.processes.push(row),
                    "points" => damage.points.push(row),
                    _ if OF_CASES.contains(&table) => {
                        let case = format!("SELECT case_id FROM {table} WHERE rowid = ?1");
                        damage.case(
                            connection.one(&case, [row], |row| row.get(0))?,
                            words,
                            false,
                        );
                    }
                    _ => damage.grid(words),
                }
            }
        }
        damage.look_at_cases(connection)?;
        damage.look_at_samples(connection)?;
        damage.look_at_processes(connection)?;
        let fits = rules::check(connection);
        if let Some(altered) = fits.as_ref().err().and_then(Altered::in_error) {
            damage.grid(&altered.to_string());
        } else {
            fits?;
        }
        Ok(damage)
    }

    fn case(&mut self, case: i64, what: &str, is_row: bool) {
        let known = self
            .cases
            .entry(case)
            .or_insert_with(|| (what.to_owned(), is_row));
        known.1 |= is_row;
    }

    fn grid(&mut self, what: &str) {
        self.grid = true;
        self.others.push(what.to_owned());
    }

    /// That every case has its point and its key, and the state that goes with its result and its failures.
    fn look_at_cases(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        let is_whole = points::look(connection, "c.id", "true", |row, known| {
            if let Err(error) = known {
                self.case(row.get(12)?, &Altered::words(&error), true);
            }
            Ok(())
        });
        match is_whole {
            Ok(true) => {}
            Ok(false) => self.grid("a case of the grid is missing"),
            Err(error) if Altered::in_error(&error).is_some() => self.grid("the campaign"),
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// That the samples of every case are what was written.
    fn look_at_samples(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        let mut digests = samples::digests(connection)?;
        let written: Vec<(i64, i64)> = connection.all(
            "SELECT id, samples_digest FROM cases WHERE samples_digest IS NOT NULL",
            [],
            |row| row.try_into(),
        )?;
        for (case, written) in written {
            if digests.remove(&case) != Some(written) {
                self.case(case, "the samples of a run", false);
            }
        }
        for case in digests.into_keys() {
            self.case(case, "the samples of a run", false);
        }
        Ok(())
    }

    /// That every result has a process that computed it.
    fn look_at_processes(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        let cases: Vec<i64> = connection.values(
            "SELECT case_id FROM ends WHERE process NOT IN (SELECT id FROM processes)
             UNION SELECT case_id FROM results WHERE process NOT IN (SELECT id FROM processes)",
            [],
        )?;
        for case in cases {
            self.case(case, "the process that computed it is not there", false);
        }
        Ok(())
    }

    fn is_none(&self) -> bool {
        self.cases.is_empty()
            && self.others.is_empty()
            && self.processes.is_empty()
            && self.points.is_empty()
    }

    /// As it is told.
    fn findings(&self, connection: &Connection) -> Vec<Finding> {
        let key = |case| {
            let key = connection.value("SELECT key FROM cases WHERE id = ?1", [case]);
            key.ok().flatten()
        };
        let of_cases = self.cases.iter().map(|(case, (what, _))| Finding {
            key: key(*case),
            what: what.clone(),
        });
        let processes = vec!["a process that computed"; self.processes.len()];
        let points = vec!["the parameters of a point"; self.points.len()];
        let others = self.others.iter().map(String::as_str);
        let others = others.chain(processes).chain(points);
        of_cases.chain(others.map(Finding::of_no_run)).collect()
    }

    /// Forgets what is damaged: runs are pending again, cases and points are entered anew with the campaign.
    fn forget(&self, connection: &Connection) -> rusqlite::Result<()> {
        for (case, (_, is_row)) in &self.cases {
            forget_case(connection, *case)?;
            if *is_row {
                connection.execute("DELETE FROM cases WHERE id = ?1", [case])?;
            }
        }
        for point in &self.points {
            let cases = "SELECT id FROM cases WHERE point = ?1";
            let cases: Vec<i64> = connection.values(cases, [point])?;
            for case in cases {
                forget_case(connection, case)?;
            }
            connection.execute("DELETE FROM cases WHERE point = ?1", [point])?;
            connection.execute("DELETE FROM points WHERE id = ?1", [point])?;
        }
        for process in &self.processes {
            connection.execute(
                "UPDATE processes SET host = 'unknown', build = '', version = '' WHERE id = ?1",
                [process],
            )?;
            processes::SEALED.seal(connection, "t.id = ?1", [process])?;
        }
        if self.grid || !self.points.is_empty() || self.cases.values().any(|(_, is_row)| *is_row) {
            // What the store was last run with is entered again.
            connection.execute("UPDATE campaign SET request = '', digest = 0", [])?;
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
                        Some(what) => Err(Altered::error(what.trim().replace('\n', " "))),
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
        if self.read(damage())?.is_none() {
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
