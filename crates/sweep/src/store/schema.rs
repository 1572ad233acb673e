//! The schema of a store: creation and recognition of its tables, and values of common columns.

use super::digest::DigestMismatch;
use super::ends;
use super::statements::Statements as _;
use crate::data::{Kind, Value as AxisValue};
use crate::measure::numbers::{self, Level, Number};
use crate::model::axes::AXES;
use crate::model::case::State;
use rusqlite::types::{Type, Value, ValueRef};
use rusqlite::{Connection, Row};
use sd_core::Params;

/// Application id of the file: `SWEP`.
const APPLICATION_ID: i32 = 0x5357_4550;
/// Version of the schema. Stores of other versions are refused.
pub(super) const VERSION: i32 = 2;
/// The statements, with placeholders for columns that are declared elsewhere.
const STATEMENTS: &str = include_str!("schema.sql");
/// First words of the statement of an index, which is one line.
const INDEX: &str = "CREATE INDEX";
/// Tables that a reader copies in order to show another version of the campaign.
const SHADOWED: [&str; 6] = [
    "campaign", "points", "cases", "results", "failures", "rules",
];

/// The version of the schema of a store; `None` for other files.
pub(super) fn identify(connection: &Connection) -> rusqlite::Result<Option<i32>> {
    let pragma = |name| connection.pragma_query_value(None, name, |row| row.get::<_, i32>(0));
    if pragma("application_id")? == APPLICATION_ID {
        return pragma("user_version").map(Some);
    }
    Ok(None)
}

/// The statements that create the tables.
fn statements() -> String {
    let axes = AXES.iter().map(|axis| match axis.kind() {
        Kind::Word => format!("{} TEXT", axis.key),
        Kind::Count => format!("{} INTEGER", axis.key),
        Kind::Number => format!("{} REAL", axis.key),
    });
    let ends: Vec<String> = ends::counters()
        .map(|number| typed(number, Level::Samples))
        .collect();
    STATEMENTS
        .replace("{axes}", &axes.collect::<Vec<_>>().join(", "))
        .replace("{axes_of_points}", &axis_columns("p."))
        .replace(
            "{samples}",
            &numbers::kept()
                .map(|n| typed(n, Level::Samples))
                .collect::<Vec<_>>()
                .join(",\n    "),
        )
        .replace("{ends}", &ends.join(",\n    "))
        .replace(
            "{results}",
            &numbers::columns(Level::Runs)
                .map(|n| typed(n, Level::Runs))
                .collect::<Vec<_>>()
                .join(",\n    "),
        )
}

/// The declaration of the column of a number.
fn typed(number: &Number, level: Level) -> String {
    let kind = match number.kind(level) {
        Kind::Count => "INTEGER",
        _ => "REAL",
    };
    format!("{} {kind}", number.name)
}

/// Creates the tables, without indices.
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

/// Creates the indices, which is faster once the tables are filled.
pub(super) fn index(connection: &Connection) -> rusqlite::Result<()> {
    let indices: Vec<&str> = STATEMENTS
        .lines()
        .filter(|line| line.starts_with(INDEX))
        .collect();
    connection.execute_batch(&indices.join("\n"))
}

/// Copies some tables, with their indices, into temporary ones of the same names, which a read-only
/// connection can change.
pub(super) fn shadow(connection: &Connection) -> rusqlite::Result<()> {
    for table in SHADOWED {
        let statements: Vec<String> = connection.values(
            "SELECT sql FROM main.sqlite_schema WHERE tbl_name = ?1 AND sql IS NOT NULL
             ORDER BY type DESC",
            [table],
        )?;
        for statement in statements {
            let temporary = statement
                .replacen("CREATE TABLE ", "CREATE TABLE temp.", 1)
                .replacen("CREATE INDEX ", "CREATE INDEX temp.", 1);
            connection.execute_batch(&temporary)?;
        }
        connection.execute_batch(&format!(
            "INSERT INTO temp.{table} SELECT * FROM main.{table}"
        ))?;
    }
    Ok(())
}

/// Names of the columns of the axes, each with a prefix.
pub(super) fn axis_columns(before: &str) -> String {
    let names: Vec<String> = AXES
        .iter()
        .map(|axis| format!("{before}{}", axis.key))
        .collect();
    names.join(", ")
}

/// Values of these columns.
pub(super) fn axis_cells(params: &Params) -> impl Iterator<Item = Value> {
    AXES.iter().map(|axis| match axis.value(params) {
        // Rate and stress are alternatives, and so are area fraction and volume fraction.
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
