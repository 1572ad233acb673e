//! The schema of a store: creation and recognition of its tables, and copies of them for a reader.

use super::points;
use super::statements::Statements as _;
use crate::data::Kind;
use crate::measure::numbers;
use crate::measure::numbers::{Level, Number};
use crate::model::axes::AXES;
use rusqlite::Connection;

/// Application id of the file: `SWEP`.
const APPLICATION_ID: i32 = 0x5357_4550;
/// Version of the schema. Stores of other versions are refused; new numbers and axes need no other
/// one, see [`Lack`].
pub(super) const VERSION: i32 = 3;
/// The statements, with placeholders for columns that are declared elsewhere.
const STATEMENTS: &str = include_str!("schema.sql");
/// First words of the statement of an index, which is one line.
const INDEX: &str = "CREATE INDEX";
/// Tables that a reader copies in order to show another version of the campaign.
const SHADOWED: [&str; 5] = ["campaign", "points", "cases", "results", "failures"];

/// The version of the schema of a store; `None` for other files.
pub(super) fn identify(connection: &Connection) -> rusqlite::Result<Option<i32>> {
    let pragma = |name| connection.pragma_query_value(None, name, |row| row.get::<_, i32>(0));
    if pragma("application_id")? == APPLICATION_ID {
        return pragma("user_version").map(Some);
    }
    Ok(None)
}

/// The statements that create the tables, with a column for each number.
fn statements() -> String {
    fn typed(numbers: impl Iterator<Item = &'static Number>, level: Level) -> String {
        let typed = numbers.map(|number| match number.kind(level) {
            Kind::Count => format!("{} INTEGER", number.name),
            _ => format!("{} REAL", number.name),
        });
        typed.collect::<Vec<_>>().join(",\n    ")
    }
    let samples = typed(numbers::kept(), Level::Samples);
    let results = typed(numbers::columns(Level::Runs), Level::Runs);
    STATEMENTS
        .replace("{samples}", &samples)
        .replace("{results}", &results)
}

/// The views, each with its name: the axes of each point, and the runs that count.
fn views() -> [(&'static str, String); 2] {
    let listed = |column: &dyn Fn(&str) -> String| {
        let columns: Vec<String> = AXES.iter().map(|axis| column(axis.key)).collect();
        columns.join(", ")
    };
    let axes = listed(&|key| format!("json_extract(axes, '$.{key}') AS {key}"));
    let of_runs = listed(&|key| format!("a.{key}"));
    [
        (
            "axes",
            format!("CREATE VIEW axes AS SELECT id, {axes} FROM points"),
        ),
        (
            "runs",
            format!(
                "CREATE VIEW runs AS SELECT c.key, c.state, {of_runs}, c.seed, r.*
                 FROM cases c JOIN axes a ON a.id = c.point
                 LEFT JOIN results r ON r.case_id = c.id AND c.state IN ('done', 'jammed')
                 WHERE c.counts ORDER BY c.position"
            ),
        ),
    ]
}

/// What a store of another program lacks.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Lack {
    /// A column or an axis that this program does not know: a later program wrote it.
    pub(super) unknown: Option<String>,
    /// Statements that make the store one of this program: numbers that it lacks become empty
    /// columns, and the views get the axes that they lack. For a reader such columns are in
    /// temporary views.
    pub(super) statements: Vec<String>,
    /// Whether its points lack axes.
    has_other_axes: bool,
}

impl Lack {
    /// What this program finds missing in a store.
    pub(super) fn of(connection: &Connection, may_change: bool) -> rusqlite::Result<Self> {
        let (mut lack, model) = (Self::default(), model()?);
        let tables = "SELECT name FROM sqlite_schema WHERE type = 'table'";
        for table in model.values::<String, Vec<_>>(tables, [])? {
            let own = columns_of(&model, &table)?;
            let there = columns_of(connection, &table)?;
            let lacks = |these: &TableColumns, name| these.iter().all(|(known, _)| known != name);
            let unknown = there.iter().find(|(name, _)| lacks(&own, name));
            lack.unknown = lack
                .unknown
                .or(unknown.map(|(name, _)| format!("{table}.{name}")));
            let missing = own.iter().filter(|(name, _)| lacks(&there, name));
            let missing: Vec<_> = missing.filter(|_| !there.is_empty()).collect();
            if may_change {
                lack.statements.extend(missing.iter().map(|(name, kind)| {
                    format!("ALTER TABLE main.{table} ADD COLUMN {name} {kind}")
                }));
            } else if !missing.is_empty() {
                let empty = missing.iter().map(|(name, _)| format!(", NULL AS {name}"));
                let empty: String = empty.collect();
                lack.statements.push(format!(
                    "CREATE TEMP VIEW {table} AS SELECT t.*{empty} FROM main.{table} t"
                ));
            }
        }
        for (name, view) in views() {
            let there = view_of(connection, name)?;
            let later = there
                .as_deref()
                .filter(|_| name == "axes")
                .and_then(later_axis);
            lack.unknown = lack.unknown.or(later.map(|key| format!("the axis {key}")));
            if may_change && there.is_none_or(|there| there != view) {
                lack.has_other_axes = true;
                lack.statements
                    .push(format!("DROP VIEW IF EXISTS main.{name}; {view}"));
            }
        }
        Ok(lack)
    }

    /// Supplies it.
    pub(super) fn supply(&self, connection: &Connection) -> rusqlite::Result<()> {
        let mut statements = self.statements.iter();
        statements.try_for_each(|statement| connection.execute_batch(statement))?;
        if self.has_other_axes {
            points::renew_axes(connection)?;
        }
        Ok(())
    }
}

/// Names and types of columns.
type TableColumns = Vec<(String, String)>;

/// The columns of a table.
fn columns_of(connection: &Connection, table: &str) -> rusqlite::Result<TableColumns> {
    let columns = "SELECT name, type FROM pragma_table_info(?1, 'main')";
    connection.all(columns, [table], |row| row.try_into())
}

/// The statement of a view.
fn view_of(connection: &Connection, name: &str) -> rusqlite::Result<Option<String>> {
    let view = "SELECT sql FROM main.sqlite_schema WHERE type = 'view' AND name = ?1";
    connection.value(view, [name])
}

/// An empty store of this program in memory, to compare others with.
fn model() -> rusqlite::Result<Connection> {
    let model = Connection::open_in_memory()?;
    create(&model)?;
    index(&model)?;
    Ok(model)
}

/// An axis in the view of a store that this program does not know.
fn later_axis(view: &str) -> Option<&str> {
    let keys = view.split("'$.").skip(1);
    let mut keys = keys.filter_map(|rest| rest.split_once('\'').map(|(key, _)| key));
    keys.find(|key| AXES.iter().all(|axis| axis.key != *key))
}

/// Creates the tables, without indices.
pub(super) fn create(connection: &Connection) -> rusqlite::Result<()> {
    let statements = statements();
    let tables: Vec<&str> = statements
        .lines()
        .filter(|line| !line.starts_with(INDEX))
        .collect();
    connection.execute_batch(&tables.join("\n"))?;
    for (_, view) in views() {
        connection.execute_batch(&view)?;
    }
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
/// connection can change; unless they are there.
pub(super) fn shadow(connection: &Connection) -> rusqlite::Result<()> {
    let is_there = "SELECT 1 FROM temp.sqlite_schema WHERE type = 'table' AND name = 'campaign'";
    if connection.has(is_there, [])? {
        return Ok(());
    }
    let model = model()?;
    for table in SHADOWED {
        connection.execute_batch(&format!("DROP VIEW IF EXISTS temp.{table}"))?;
        let statements = "SELECT sql FROM sqlite_schema WHERE tbl_name = ?1 AND sql IS NOT NULL
             ORDER BY type DESC";
        for statement in model.values::<String, Vec<_>>(statements, [table])? {
            let temporary = statement
                .replacen("CREATE TABLE ", "CREATE TABLE temp.", 1)
                .replacen("CREATE INDEX ", "CREATE INDEX temp.", 1);
            connection.execute_batch(&temporary)?;
        }
        let names = columns_of(connection, table)?.into_iter();
        let names = names.map(|(name, _)| name).collect::<Vec<_>>().join(", ");
        connection.execute_batch(&format!(
            "INSERT INTO temp.{table} ({names}) SELECT {names} FROM main.{table}"
        ))?;
    }
    let [(axes, view), _] = views();
    if view_of(connection, axes)?.is_none_or(|there| there != view) {
        points::renew_axes(connection)?;
    }
    Ok(())
}
