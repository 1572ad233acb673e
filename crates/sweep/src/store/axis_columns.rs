//! Columns and views of the axes, made from their declarations.
//!
//! The parameters of a case are one JSON text, which is what the program reads. For other programs each axis is a column of
//! `cases` as well, and the views `runs` and `viscosity_vs_shear_rate` name them. An axis that is new to a store gets its column
//! when the store is next opened for writing.

use crate::axes::{AXES, Axis, Kind, Value};
use rusqlite::{Connection, OptionalExtension, types};
use sd_core::Params;

/// Adds the columns that are missing, and makes the views anew where they are not those of today. Says whether anything was
/// changed.
pub(super) fn bring_up_to_date(connection: &Connection) -> Result<bool, rusqlite::Error> {
    let known: Vec<String> = connection
        .prepare("SELECT name FROM pragma_table_info('cases')")?
        .query_map([], |row| row.get(0))?
        .collect::<Result<_, _>>()?;
    let new: Vec<&Axis> = AXES
        .iter()
        .filter(|axis| !known.iter().any(|column| column == axis.key))
        .collect();
    for axis in &new {
        let kind = match axis.kind() {
            Kind::Word => "TEXT",
            Kind::Count => "INTEGER",
            Kind::Number => "REAL",
        };
        connection.execute_batch(&format!("ALTER TABLE cases ADD COLUMN {} {kind}", axis.key))?;
    }
    // A program that does not know an axis leaves its column empty.
    let empty: Vec<String> = AXES
        .iter()
        .filter(|axis| !axis.is_of_shear() || new.iter().any(|new| new.key == axis.key))
        .map(|axis| format!("{} IS NULL", axis.key))
        .collect();
    let cases: Vec<(i64, String)> = connection
        .prepare(&format!(
            "SELECT id, params FROM cases WHERE {}",
            empty.join(" OR ")
        ))?
        .query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?
        .collect::<Result<_, _>>()?;
    let places: Vec<String> = AXES
        .iter()
        .enumerate()
        .map(|(place, axis)| format!("{} = ?{}", axis.key, place + 2))
        .collect();
    let mut fill = connection.prepare(&format!(
        "UPDATE cases SET {} WHERE id = ?1",
        places.join(", ")
    ))?;
    let mut changed = !new.is_empty() || !cases.is_empty();
    for (case, text) in cases {
        // Parameters that cannot be read are complained about when they are needed.
        if let Ok(params) = serde_json::from_str::<Params>(&text) {
            let id = std::iter::once(types::Value::Integer(case));
            fill.execute(rusqlite::params_from_iter(id.chain(cells(&params))))?;
        }
    }
    for (name, text) in [("runs", runs()), ("viscosity_vs_shear_rate", curves())] {
        let made: Option<String> = connection
            .query_row(
                "SELECT sql FROM sqlite_schema WHERE type = 'view' AND name = ?1",
                [name],
                |row| row.get(0),
            )
            .optional()?;
        if made.as_deref() != Some(text.as_str()) {
            connection.execute_batch(&format!("DROP VIEW IF EXISTS {name}; {text}"))?;
            changed = true;
        }
    }
    Ok(changed)
}

/// Names of the columns, each with a table's name before it.
pub(super) fn names(before: &str) -> String {
    let names: Vec<String> = AXES
        .iter()
        .map(|axis| format!("{before}{}", axis.key))
        .collect();
    names.join(", ")
}

/// What the columns of a case hold.
pub(super) fn cells(params: &Params) -> impl Iterator<Item = types::Value> {
    AXES.iter().map(|axis| match axis.value(params) {
        // Either the rate is imposed or the stress.
        _ if axis.is_of_shear() && !axis.means_something(params) => types::Value::Null,
        Value::Word(word) => types::Value::Text(word.into()),
        Value::Count(count) => types::Value::Integer(super::integer(count)),
        Value::Number(number) => types::Value::Real(number),
    })
}

/// The view of runs.
fn runs() -> String {
    format!("CREATE VIEW runs AS\n{}", runs_query())
}

/// All runs: what each is and what came out of it; nothing came out yet of one that waits to go on.
pub(super) fn runs_query() -> String {
    format!(
        "SELECT c.key, c.state, {}, c.seed, r.*
FROM cases c LEFT JOIN results r ON r.case_id = c.id AND c.state IN ('done', 'jammed')
WHERE c.position IS NOT NULL
ORDER BY c.position",
        names("c.")
    )
}

/// The view of points: one row for all finished runs that differ only in their seed.
fn curves() -> String {
    let (axes, of_cases) = (names(""), names("c."));
    let sound = "FILTER (WHERE coalesce(r.doubts, '') = '')";
    format!(
        "CREATE VIEW viscosity_vs_shear_rate AS
-- The 95 % interval is viscosity ± t × standard_error, t of Student's distribution with runs - 1 degrees of freedom.
WITH points AS (
    SELECT min(c.position) AS position, {of_cases}, count(r.viscosity) {sound} AS runs,
           count(*) FILTER (WHERE r.doubts != '') AS doubtful,
           avg(r.viscosity) {sound} AS viscosity,
           CASE WHEN count(r.viscosity) {sound} > 1 THEN
               max(avg(r.viscosity * r.viscosity) {sound} - avg(r.viscosity) {sound} * avg(r.viscosity) {sound}, 0.0)
                   / (count(r.viscosity) {sound} - 1)
           END AS variance,
           min(r.viscosity) {sound} AS viscosity_minimum, max(r.viscosity) {sound} AS viscosity_maximum,
           avg(r.viscosity_stresslet) {sound} AS viscosity_stresslet,
           avg(r.normal_stress_difference) {sound} AS normal_stress_difference,
           avg(r.n2) {sound} AS n2, avg(r.particle_pressure) {sound} AS particle_pressure,
           total(r.contacts) {sound} / nullif(total(r.samples) {sound} * c.spheres, 0) AS contacts_per_sphere,
           total(r.activated) {sound} / nullif(total(r.contacts) {sound}, 0) AS activated_fraction,
           total(r.rolling) {sound} / nullif(total(r.activated) {sound}, 0) AS rolling_fraction
    FROM cases c JOIN results r ON r.case_id = c.id
    WHERE c.position IS NOT NULL AND c.state = 'done'
    GROUP BY {of_cases}
)
SELECT {axes}, runs, doubtful, viscosity,
       -- Square root by Newton's method: not every SQLite has one built in.
       CASE WHEN variance > 0.0 THEN
           (WITH RECURSIVE newton (n, x) AS (
                SELECT 0, 0.5 * (1.0 + variance) UNION ALL SELECT n + 1, 0.5 * (x + variance / x) FROM newton WHERE n < 60)
            SELECT x FROM newton WHERE n = 60)
       ELSE variance END AS standard_error,
       viscosity_minimum, viscosity_maximum, viscosity_stresslet, normal_stress_difference, contacts_per_sphere,
       n2, particle_pressure, activated_fraction, rolling_fraction
FROM points
ORDER BY position"
    )
}
