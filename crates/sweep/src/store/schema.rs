//! The schema of a store: how its tables are made and recognized, and what columns hold that several of them have.

use super::digest::DigestMismatch;
use crate::axes::{AXES, Kind, Value as AxisValue};
use crate::case::State;
use crate::model::sampled::{Number, listed};
use rusqlite::types::{Type, Value, ValueRef};
use rusqlite::{Connection, OptionalExtension, Row};
use sd_core::Params;

/// Marks the file as ours: `SWEP`.
const APPLICATION_ID: i32 = 0x5357_4550;
/// Version of the schema. A store of another one is refused.
pub(super) const VERSION: i32 = 1;
/// The statements, with places for the columns that are declared elsewhere.
const STATEMENTS: &str = include_str!("schema.sql");
/// How the statement of an index begins, which is one line.
const INDEX: &str = "CREATE INDEX";
/// Tables that a reader copies for itself to see a store as another version of its campaign requests it.
const SHADOWED: [&str; 6] = [
    "campaign", "points", "cases", "results", "failures", "rules",
];

/// The version of the schema of a store; `None` of anything else.
pub(super) fn identify(connection: &Connection) -> rusqlite::Result<Option<i32>> {
    let pragma = |name| connection.pragma_query_value(None, name, |row| row.get::<_, i32>(0));
    if pragma("application_id")? == APPLICATION_ID && has_plain_tables(connection)? {
        return pragma("user_version").map(Some);
    }
    Ok(None)
}

/// The statements that make the tables.
fn statements() -> String {
    let axes = AXES.iter().map(|axis| match axis.kind() {
        Kind::Word => format!("{} TEXT", axis.key),
        Kind::Count => format!("{} INTEGER", axis.key),
        Kind::Number => format!("{} REAL", axis.key),
    });
    let reals = |which| listed(which, "", " REAL");
    STATEMENTS
        .replace("{network}", &reals(Number::is_of_network))
        .replace("{axes}", &axes.collect::<Vec<_>>().join(", "))
        .replace("{axes_of_points}", &axis_columns("p."))
        .replace("{parts}", &reals(Number::is_part))
        .replace(
            "{stresses}",
            &reals(|number| number.is_sum() || number.is_part()),
        )
}

/// Makes the tables, without indices.
pub(super) fn create(connection: &Connection) -> rusqlite::Result<()> {
    let statements = statements();
    let tables: Vec<&str> = statements
        .lines()
        .filter(|line| !line.starts_with(INDEX))
        .collect();
    connection.execute_batch(&tables.join("\n"))?;
    connection.pragma_update(None, "application_id", APPLICATION_ID)?;
    connection.pragma_update(None, "user_version", VERSION)
}

/// Makes the indices: faster once the tables are filled.
pub(super) fn index(connection: &Connection) -> rusqlite::Result<()> {
    let indices: Vec<&str> = STATEMENTS
        .lines()
        .filter(|line| line.starts_with(INDEX))
        .collect();
    connection.execute_batch(&indices.join("\n"))
}

/// Names of the indices of some cases, each with the condition that these meet.
pub(super) fn partial_indices() -> impl Iterator<Item = (&'static str, &'static str)> {
    STATEMENTS.lines().filter_map(|line| {
        let index = line.strip_prefix("CREATE INDEX IF NOT EXISTS ")?;
        let (name, of) = index.split_once(" ON cases ")?;
        Some((name, of.split_once(" WHERE ")?.1.trim_end_matches(';')))
    })
}

/// Lets a connection that only reads change some tables for itself.
pub(super) fn shadow(connection: &Connection) -> rusqlite::Result<()> {
    for statement in statements().split_inclusive(";\n") {
        for table in SHADOWED {
            let begins = format!("CREATE TABLE {table} (");
            if let Some(at) = statement.find(&begins) {
                let columns = &statement[at + begins.len()..];
                connection.execute_batch(&format!(
                    "CREATE TEMP TABLE {table} ({columns} INSERT INTO temp.{table} SELECT *
                         FROM main.{table}"
                ))?;
            }
        }
    }
    connection.execute_batch(
        "CREATE INDEX temp.cases_of_point ON cases (point);
         CREATE INDEX temp.cases_of_rule ON cases (rule, position) WHERE rule IS NOT NULL;
         CREATE INDEX temp.failures_of_case ON failures (case_id)",
    )
}

/// Names of the columns of the axes, each with something before it.
pub(super) fn axis_columns(before: &str) -> String {
    let names: Vec<String> = AXES
        .iter()
        .map(|axis| format!("{before}{}", axis.key))
        .collect();
    names.join(", ")
}

/// What these columns hold.
pub(super) fn axis_cells(params: &Params) -> impl Iterator<Item = Value> {
    AXES.iter().map(|axis| match axis.value(params) {
        // Either the rate is imposed or the stress, and either an area is filled or a volume.
        _ if axis.is_alternative() && !axis.means_something(params) => Value::Null,
        AxisValue::Word(word) => Value::Text(word.into()),
        AxisValue::Count(count) => super::digest::whole(count),
        AxisValue::Number(number) => Value::Real(number),
    })
}

/// The parameters in a column of JSON.
pub(super) fn params(row: &Row<'_>, column: usize) -> rusqlite::Result<Params> {
    let text: String = row.get(column)?;
    serde_json::from_str(&text).map_err(|error| {
        rusqlite::Error::FromSqlConversionFailure(column, Type::Text, Box::new(error))
    })
}

/// The state of this name.
pub(super) fn state(name: ValueRef<'_>) -> rusqlite::Result<State> {
    let name = name.as_str()?;
    State::of(name)
        .ok_or_else(|| DigestMismatch::error(format!("there is no state {name:?} of a case")))
}

/// Makes sure that what has the name of a table of ours is a table with values in it: no view, no virtual table, no columns
/// that are computed when they are read.
fn has_plain_tables(connection: &Connection) -> rusqlite::Result<bool> {
    let names = STATEMENTS
        .lines()
        .filter_map(|line| line.strip_prefix("CREATE TABLE "));
    for table in names.filter_map(|line| line.strip_suffix(" (")) {
        let found: Option<(String, i64)> = connection
            .query_row(
                "SELECT type, rootpage FROM main.sqlite_schema WHERE name = ?1 COLLATE NOCASE",
                [table],
                |row| Ok((row.get(0)?, row.get(1)?)),
            )
            .optional()?;
        let computed: i64 = connection.query_row(
            "SELECT count(*) FROM pragma_table_xinfo(?1, 'main') WHERE hidden != 0",
            [table],
            |row| row.get(0),
        )?;
        if found.is_some_and(|(kind, root)| kind != "table" || root < 2) || computed > 0 {
            return Ok(false);
        }
    }
    Ok(true)
}
