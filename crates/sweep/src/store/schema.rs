//! The schema of a store: its versions one after the other, and how an older store is brought up to date, in its file or
//! for a reader that may not write to it.

use super::{Store, StoreError, axis_columns, checksum, count, ends, log};
use crate::case::{Case, PHYSICS_VERSION};
use rusqlite::{Connection, params};
use std::collections::HashMap;

/// Marks the file as ours: `SWEP`.
const APPLICATION_ID: i32 = 0x5357_4550;

/// What one version of the schema adds to the one before.
struct Migration {
    tables: &'static str,
    /// Changes to what is in them.
    content: fn(&Connection) -> Result<(), rusqlite::Error>,
}

/// The first version of the schema with checksums.
pub(super) const FIRST_WITH_CHECKSUMS: i32 = 7;

/// All versions; the first one makes a new store.
const MIGRATIONS: [Migration; 10] = [
    Migration::of_tables(include_str!("schema.sql")),
    Migration::of_tables(include_str!("schema_2.sql")),
    Migration::of_tables(include_str!("schema_3.sql")),
    // Columns of the axes, which are now made from their table.
    Migration::of_tables(""),
    Migration {
        tables: include_str!("schema_5.sql"),
        content: without_strain_in_keys,
    },
    Migration::of_tables(include_str!("schema_6.sql")),
    Migration {
        tables: include_str!("schema_7.sql"),
        content: log::begin,
    },
    Migration::of_tables(include_str!("schema_8.sql")),
    Migration::of_tables(include_str!("schema_9.sql")),
    Migration::of_tables(include_str!("schema_10.sql")),
];

/// Version of the schema this program reads and writes.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "a handful of versions"
)]
pub(super) const VERSION: i32 = MIGRATIONS.len() as i32;

impl Migration {
    /// One that changes tables only.
    const fn of_tables(tables: &'static str) -> Self {
        Self {
            tables,
            content: |_| Ok(()),
        }
    }
}

/// What a file is.
pub(super) enum Kind {
    /// Nothing yet.
    Empty,
    /// A store of this version of the schema.
    Ours(i32),
    /// Something else.
    Foreign,
}

/// Says what a database is.
pub(super) fn identify(connection: &Connection) -> Result<Kind, rusqlite::Error> {
    let application =
        || connection.pragma_query_value(None, "application_id", |row| row.get::<_, i32>(0));
    if application()? == APPLICATION_ID {
        return Ok(Kind::Ours(version_of(connection)?));
    }
    let tables: i64 =
        connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))?;
    Ok(match tables {
        0 if application()? == 0 => Kind::Empty,
        // Another process may have made the store between the two looks: tables and mark appear at once.
        _ if application()? == APPLICATION_ID => Kind::Ours(version_of(connection)?),
        _ => Kind::Foreign,
    })
}

/// Version of the schema in a database, 0 if there is none.
pub(super) fn version_of(connection: &Connection) -> Result<i32, rusqlite::Error> {
    connection.pragma_query_value(None, "user_version", |row| row.get(0))
}

/// The migrations a database of this version lacks.
fn missing(version: i32) -> &'static [Migration] {
    usize::try_from(version)
        .ok()
        .and_then(|version| MIGRATIONS.get(version..))
        .unwrap_or_default()
}

/// Brings a database up to date, or makes its tables.
pub(super) fn bring_up_to_date(connection: &Connection) -> Result<(), rusqlite::Error> {
    let version = version_of(connection)?;
    check_before(connection, version)?;
    for migration in missing(version) {
        connection.execute_batch(migration.tables)?;
        (migration.content)(connection)?;
    }
    axis_columns::bring_up_to_date(connection)?;
    ends::judge_all(connection)?;
    checksum::seal_all(connection)?;
    // The chain of a store that had none begins with all of this.
    if version >= FIRST_WITH_CHECKSUMS {
        log::go_on(connection)?;
    }
    connection.pragma_update(None, "application_id", APPLICATION_ID)?;
    connection.pragma_update(None, "user_version", VERSION)
}

/// Checksums of a store are written anew where its tables change: what they were of must be whole then.
fn check_before(connection: &Connection, version: i32) -> Result<(), rusqlite::Error> {
    if version < FIRST_WITH_CHECKSUMS {
        return Ok(());
    }
    for kind in checksum::KINDS {
        checksum::check_all(connection, kind)?;
    }
    Ok(())
}

/// Lets a reader see a store of an older schema as one of today. Nothing is written to it: what differs is put into tables
/// of the connection alone, which take the place of those in the file.
pub(super) fn show_up_to_date(connection: &Connection) -> Result<(), rusqlite::Error> {
    let version = version_of(connection)?;
    if version >= VERSION {
        return Ok(());
    }
    check_before(connection, version)?;
    for table in tables_of_today()? {
        let there = columns(connection, &table.name)?;
        // Keys of cases change with the content, and checksums with the columns.
        if there != table.columns || matches!(table.name.as_str(), "cases" | "checksums") {
            table.put_before(connection, &there)?;
        }
    }
    missing(version)
        .iter()
        .try_for_each(|migration| (migration.content)(connection))?;
    ends::judge_all(connection)?;
    checksum::seal_all(connection)
}

/// Lets a connection that only reads change some tables for itself.
pub(super) fn put_before(connection: &Connection, names: &[&str]) -> Result<(), rusqlite::Error> {
    for table in tables_of_today()? {
        let is_there = connection
            .prepare("SELECT 1 FROM temp.sqlite_schema WHERE name = ?1")?
            .exists([&table.name])?;
        if names.contains(&table.name.as_str()) && !is_there {
            table.put_before(connection, &table.columns)?;
        }
    }
    Ok(())
}

/// A table as it is made today.
pub(super) struct Table {
    pub(super) name: String,
    /// The statement that makes it.
    statement: String,
    columns: Vec<String>,
    /// Types of the columns, as they are declared.
    types: Vec<String>,
}

impl Table {
    /// Its columns with their types.
    pub(super) fn columns_with_types(&self) -> impl Iterator<Item = (&str, &str)> {
        let types = self.types.iter().map(String::as_str);
        self.columns.iter().map(String::as_str).zip(types)
    }
}

impl Table {
    /// Makes a table of the connection with the same name, and copies the columns into it that the file has.
    fn put_before(&self, connection: &Connection, there: &[String]) -> Result<(), rusqlite::Error> {
        let statement = self
            .statement
            .replacen("CREATE TABLE", "CREATE TEMP TABLE", 1);
        connection.execute_batch(&statement)?;
        let common: Vec<&str> = self
            .columns
            .iter()
            .filter(|column| there.contains(column))
            .map(String::as_str)
            .collect();
        if common.is_empty() {
            return Ok(());
        }
        let (name, common) = (&self.name, common.join(", "));
        connection.execute_batch(&format!(
            "INSERT INTO temp.{name} ({common}) SELECT {common} FROM main.{name}"
        ))
    }
}

/// The tables of a new store.
pub(super) fn tables_of_today() -> Result<Vec<Table>, rusqlite::Error> {
    let new = Connection::open_in_memory()?;
    bring_up_to_date(&new)?;
    let tables: Vec<(String, String)> = new
        .prepare("SELECT name, sql FROM sqlite_schema WHERE type = 'table'")?
        .query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?
        .collect::<Result<_, _>>()?;
    tables
        .into_iter()
        .map(|(name, statement)| {
            Ok(Table {
                columns: columns(&new, &name)?,
                types: new
                    .prepare("SELECT type FROM pragma_table_info(?1, 'main') ORDER BY cid")?
                    .query_map([&name], |row| row.get(0))?
                    .collect::<Result<_, _>>()?,
                name,
                statement,
            })
        })
        .collect()
}

/// Names of the columns of a table in the file; none if there is no such table.
fn columns(connection: &Connection, table: &str) -> Result<Vec<String>, rusqlite::Error> {
    connection
        .prepare("SELECT name FROM pragma_table_info(?1, 'main') ORDER BY cid")?
        .query_map([table], |row| row.get(0))?
        .collect()
}

/// A case of a store in which the length of a run still was a part of its key.
struct OldCase {
    id: i64,
    key: String,
    /// Its place in the campaign file.
    position: Option<i64>,
    /// Its place in the order of work.
    rank: i64,
    steps: i64,
    /// Whether it is finished, then how far it is: what is worth keeping most comes last.
    worth: (bool, i64),
}

/// Takes the length of the run out of all keys, and records how far finished runs were computed. Of two cases that differ in
/// nothing but their length the one with more to it gets the new key and the place in the grid; the other stays as it is, in
/// no grid.
fn without_strain_in_keys(connection: &Connection) -> Result<(), rusqlite::Error> {
    connection.execute_batch(
        "INSERT INTO ends (case_id, steps, jammed, minimum_gap, stages, unconverged_stages, worst_residual,
             worst_friction_error, jam_events, jammed_steps)
         SELECT c.id, c.steps_done, c.state = 'jammed', r.minimum_gap, r.stages, r.unconverged_stages, r.worst_residual,
             r.worst_friction_error, r.jam_events,
             CAST(round(r.jammed_strain / json_extract(c.params, '$.time_step')) AS INTEGER)
         FROM results r JOIN cases c ON c.id = r.case_id WHERE c.state IN ('done', 'jammed')",
    )?;
    let rows: Vec<(OldCase, String, String, i64, i64)> = connection
        .prepare(
            "SELECT id, key, position, rank, steps, state IN ('done', 'jammed'), steps_done, params, seed, sample_stride
             FROM cases ORDER BY id",
        )?
        .query_map([], |row| {
            let case = OldCase {
                id: row.get(0)?,
                key: String::new(),
                position: row.get(2)?,
                rank: row.get(3)?,
                steps: row.get(4)?,
                worth: (row.get(5)?, row.get(6)?),
            };
            Ok((case, row.get(1)?, row.get(7)?, row.get(8)?, row.get(9)?))
        })?
        .collect::<Result<_, _>>()?;
    let mut of_key: HashMap<String, Vec<OldCase>> = HashMap::new();
    for (case, old_key, params, seed, stride) in rows {
        let row = CaseRow {
            key: &old_key,
            params: &params,
            seed: count(seed),
            steps: count(case.steps),
            sample_stride: count(stride),
        };
        if let Some(key) = row.key_of_today() {
            let known = of_key.entry(key.clone()).or_default();
            known.push(OldCase { key, ..case });
        }
    }
    let mut change = connection
        .prepare("UPDATE cases SET key = ?2, position = ?3, rank = ?4, steps = ?5 WHERE id = ?1")?;
    for mut alike in of_key.into_values() {
        alike.sort_by_key(|case| case.worth);
        let in_grid = alike
            .iter()
            .rfind(|case| case.position.is_some())
            .map(|case| (case.position, case.rank, case.steps));
        let Some(best) = alike.pop() else { continue };
        let (position, rank, steps) = in_grid.unwrap_or((None, best.rank, best.steps));
        for other in alike {
            connection.execute("UPDATE cases SET position = NULL WHERE id = ?1", [other.id])?;
        }
        change.execute(params![best.id, best.key, position, rank, steps])?;
        if best.worth.0 && best.worth.1 < steps {
            // It had a longer sister that was not finished; without its last state it begins anew.
            connection.execute(
                "UPDATE cases SET state = 'pending', steps_done = 0
                 WHERE id = ?1 AND state = 'done'",
                [best.id],
            )?;
        }
    }
    Ok(())
}

/// A case as a row of a store describes it.
pub(super) struct CaseRow<'d> {
    /// The key it has there.
    pub(super) key: &'d str,
    /// Its parameters as JSON, to the letter.
    pub(super) params: &'d str,
    pub(super) seed: u64,
    pub(super) steps: u64,
    /// Steps from one sample to the next.
    pub(super) sample_stride: u64,
}

impl CaseRow<'_> {
    /// The key it has today if its key is one of schema 4 or before, with the length of the run in it.
    pub(super) fn key_of_today(&self) -> Option<String> {
        let Self {
            params,
            seed,
            steps,
            sample_stride,
            ..
        } = self;
        let physics = (1..=PHYSICS_VERSION).rev().find(|physics| {
            let canonical = format!(
                r#"{{"physics":{physics},"params":{params},"seed":{seed},"steps":{steps},"sample_stride":{sample_stride}}}"#
            );
            has_hash(&canonical, self.key)
        })?;
        let case = self.case()?;
        if physics == case.physics() {
            return Some(case.key().to_string());
        }
        Some(hash(&format!(
            r#"{{"physics":{physics},"params":{params},"seed":{seed},"sample_stride":{sample_stride}}}"#
        )))
    }

    /// Whether its key is the one its contents give, under the physics of today or any before.
    pub(super) fn has_its_key(&self) -> bool {
        let Self {
            params,
            seed,
            sample_stride,
            ..
        } = self;
        let of_physics = |physics: u32| {
            has_hash(
                &format!(
                    r#"{{"physics":{physics},"params":{params},"seed":{seed},"sample_stride":{sample_stride}}}"#
                ),
                self.key,
            )
        };
        (1..=PHYSICS_VERSION).rev().any(of_physics) || self.key_of_today().is_some()
    }

    pub(super) fn case(&self) -> Option<Case> {
        Some(Case {
            params: serde_json::from_str(self.params).ok()?,
            seed: self.seed,
            steps: self.steps,
            sample_stride: self.sample_stride.max(1),
        })
    }
}

/// The key made from a canonical form.
fn hash(canonical: &str) -> String {
    blake3::hash(canonical.as_bytes()).to_hex()[..32].to_owned()
}

/// Whether a key is the one made from a canonical form.
fn has_hash(canonical: &str, key: &str) -> bool {
    blake3::hash(canonical.as_bytes()).to_hex()[..32] == *key
}

impl Store {
    /// The error about a store of another schema.
    pub(super) fn other_schema(&self, found: i32) -> StoreError {
        StoreError::Schema {
            path: self.path.clone(),
            found,
            known: VERSION,
            what: if found > VERSION {
                "made by a newer version of sweep: use that version"
            } else {
                "made by an older version of sweep: use that version, or another --store"
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Protocol;

    #[test]
    fn keys_with_the_length_of_the_run_in_them_become_those_of_today() {
        let case = Case::new(crate::test_support::params(), 7, &Protocol::default());
        let params = serde_json::to_string(&case.params).unwrap();
        let row = CaseRow {
            // As the last program of schema 4 had it.
            key: "3f949698a4415327756d2afbb6aff0ee",
            params: &params,
            seed: case.seed,
            steps: case.steps,
            sample_stride: case.sample_stride,
        };
        // The same case under the physics of that program, which need not be that of today.
        let without_steps = format!(
            r#"{{"physics":3,"params":{params},"seed":{},"sample_stride":{}}}"#,
            case.seed, case.sample_stride
        );
        assert_eq!(row.key_of_today(), Some(hash(&without_steps)));
        let of_today = format!(r#"{{"physics":{},"#, case.physics());
        let of_today = without_steps.replacen(r#"{"physics":3,"#, &of_today, 1);
        assert_eq!(case.key().to_string(), hash(&of_today));
        let other = CaseRow { steps: 1, ..row };
        assert_eq!(other.key_of_today(), None);
    }

    #[test]
    fn versions_of_the_schema_follow_one_another() {
        let connection = Connection::open_in_memory().unwrap();
        bring_up_to_date(&connection).unwrap();
        assert_eq!(version_of(&connection).unwrap(), VERSION);
        assert!(matches!(
            identify(&connection).unwrap(),
            Kind::Ours(VERSION)
        ));
    }
}
