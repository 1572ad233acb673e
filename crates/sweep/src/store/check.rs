//! Whether all of a store is what was written; and what is damaged made pending again, to be computed with the same digits.

use super::campaign;
use super::digest::{Altered, altered, rewrite};
use super::log::Mark;
use super::results::COVERED;
use super::schema::axis_columns;
use super::statements::Statements;
use super::{Store, StoreError, claims, ends, failures, frames, points, registry, rules, samples};
use rusqlite::{Connection, params};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Largest file whose structure is looked at before a run, in bytes: this takes less than half a second.
const CHEAP: i64 = 64 << 20;
/// Tables with what was computed of a case.
pub(super) const OF_CASES: [&str; 6] = [
    "samples",
    "frames",
    "checkpoints",
    "results",
    "ends",
    "failures",
];

/// Tables with a digest in each row, what a row is in words, and a statement that selects of each row its number, what the digest
/// covers, and the digest.
fn kinds() -> Vec<(&'static str, &'static str, String)> {
    let sealed = [
        campaign::SEALED,
        registry::SEALED,
        rules::SEALED,
        ends::SEALED,
        failures::SEALED,
        frames::SEALED,
    ];
    let axes = axis_columns("");
    let of_results = format!(
        "SELECT r.rowid, {} FROM results r JOIN cases c ON c.id = r.case_id
             JOIN points p ON p.id = c.point
         WHERE c.state IN ('done', 'jammed')",
        *COVERED
    );
    sealed
        .into_iter()
        .map(|kind| (kind.table, kind.words, kind.select("t.rowid, ")))
        .chain([
            (
                "points",
                "the parameters of a point",
                format!("SELECT rowid, params, {axes}, digest FROM points"),
            ),
            ("results", "the result of a run", of_results),
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
            for (row, _) in altered(connection, &query)? {
                match table {
                    "processes" => damage.processes.push(row),
                    "points" => damage.points.push(row),
                    _ if OF_CASES.contains(&table) => {
                        let case = format!("SELECT case_id FROM {table} WHERE rowid = ?1");
                        let case = connection.query_row(&case, [row], |row| row.get(0))?;
                        damage.case(case, words, false);
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
        let more = "c.id, EXISTS (SELECT 1 FROM failures WHERE case_id = c.id AND NOT retried)";
        let is_whole = points::look(connection, more, "true", |row, known| {
            let (id, has_failed): (i64, bool) = (row.get(11)?, row.get(12)?);
            let fits = match row.get_ref(4)?.as_str()? {
                "failed" => has_failed,
                "pending" | "running" => !has_failed,
                _ => true,
            };
            match known {
                Err(error) => self.case(id, &Altered::words(&error), true),
                Ok(_) if fits => {}
                Ok(_) => self.case(id, "its state is not that of its failures", true),
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
        let mut query = connection
            .prepare("SELECT id, samples_digest FROM cases WHERE samples_digest IS NOT NULL")?;
        let mut rows = query.query([])?;
        while let Some(row) = rows.next()? {
            let case = row.get(0)?;
            if digests.remove(&case).flatten() != row.get(1)? {
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
        let mut query = connection.prepare(
            "SELECT case_id FROM ends WHERE process NOT IN (SELECT id FROM processes)
             UNION SELECT case_id FROM results WHERE process NOT IN (SELECT id FROM processes)",
        )?;
        let mut rows = query.query([])?;
        while let Some(row) = rows.next()? {
            self.case(
                row.get(0)?,
                "the process that computed it is not there",
                false,
            );
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
        let of_case = |(case, (what, _)): (&i64, &(String, bool))| Finding {
            key: connection
                .query_row("SELECT key FROM cases WHERE id = ?1", [case], |row| {
                    row.get(0)
                })
                .ok(),
            what: what.clone(),
        };
        let other = |what: &str| Finding {
            key: None,
            what: what.to_owned(),
        };
        let processes = self
            .processes
            .iter()
            .map(|_| other("a process that computed"));
        let points = self
            .points
            .iter()
            .map(|_| other("the parameters of a point"));
        let others = self.others.iter().map(|what| other(what));
        self.cases
            .iter()
            .map(of_case)
            .chain(others)
            .chain(processes)
            .chain(points)
            .collect()
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
            let cases: Vec<i64> =
                connection.all("SELECT id FROM cases WHERE point = ?1", [point], |row| {
                    row.get(0)
                })?;
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
            registry::SEALED.seal(connection, &format!("t.id = {process}"))?;
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
        "UPDATE cases SET state = 'pending', owner = NULL, steps_done = 0, deaths = 0,
             samples_digest = NULL WHERE id = ?1",
        [case],
    )?;
    claims::free_where(connection, "id = ?2", &[&case]).map(|_| ())
}

/// What `SQLite` finds wrong with the structure of a store.
fn structure(connection: &Connection) -> rusqlite::Result<Vec<String>> {
    let mut found: Vec<String> =
        connection.all("PRAGMA main.integrity_check(20)", [], |row| row.get(0))?;
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
        let structure = structure(connection)?.into_iter();
        let mut findings: Vec<Finding> =
            structure.map(|what| Finding { key: None, what }).collect();
        match Damage::of(connection) {
            Ok(damage) => findings.extend(damage.findings(connection)),
            // Pages that cannot be read are among the findings already.
            Err(error) if findings.is_empty() => return Err(error),
            Err(_) => {}
        }
        let runs: i64 = connection.query_row("SELECT count(*) FROM cases", [], |row| row.get(0))?;
        Ok((super::count(runs), findings))
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
        let size = || {
            self.connection.query_row(
                "SELECT page_count * page_size FROM pragma_page_count, pragma_page_size",
                [],
                |row| row.get::<_, i64>(0),
            )
        };
        let mut findings = Vec::new();
        if self.read(size())? <= CHEAP {
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
                let index = |what| Finding { key: None, what };
                findings.extend(found.into_iter().map(index));
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
        let keys: Vec<String> = connection.all(
            "SELECT key FROM cases WHERE position IS NOT NULL",
            [],
            |row| row.get(0),
        )?;
        let keys = keys
            .iter()
            .map(|key| u128::from_str_radix(key, 16).unwrap_or(0));
        connection.execute(
            "UPDATE campaign SET grid = ?1",
            [super::request::grid(keys)],
        )?;
        connection.execute("UPDATE cases SET samples_digest = NULL", [])?;
        for (case, digest) in samples::digests(&connection)? {
            connection.execute(
                "UPDATE cases SET samples_digest = ?2 WHERE id = ?1",
                params![case, digest],
            )?;
        }
        for (table, _, query) in kinds() {
            for (row, digest) in altered(&connection, &query)? {
                rewrite(&connection, table, row, digest)?;
            }
        }
        Mark::renew(&connection)?;
        connection.execute_batch("COMMIT")
    };
    accepted().map_err(|error| StoreError::sqlite(path, error, false))
}
