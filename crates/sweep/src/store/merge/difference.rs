//! Whether two results of one case have the same bits.

use crate::store::entries::{Entry, whole};
use rusqlite::Connection;
use rusqlite::types::Value;

/// Where two results of a case differ first, if they do. Averages follow from the samples and need no look; times may differ.
pub(super) fn difference(
    one: &Connection,
    in_one: i64,
    two: &Connection,
    in_two: i64,
) -> Result<Option<String>, rusqlite::Error> {
    let samples = |connection: &Connection, case: i64| {
        rows(
            connection,
            "SELECT * FROM samples WHERE case_id = ?1 ORDER BY step",
            case,
        )
    };
    let (a, b) = (samples(one, in_one)?, samples(two, in_two)?);
    if a.len() != b.len() {
        return Ok(Some(format!("{} samples, and {}", a.len(), b.len())));
    }
    for (one, two) in a.iter().zip(&b) {
        if let Some(what) = first_difference(one, two) {
            let step = whole(one, "step").unwrap_or(0);
            return Ok(Some(format!("at step {step}: {what}")));
        }
    }
    let counters = |connection: &Connection, case: i64| {
        let query = "SELECT minimum_gap, stages, unconverged_stages, worst_residual, worst_friction_error, jam_events,
                         jammed_strain, final_strain FROM results WHERE case_id = ?1";
        rows(connection, query, case)
    };
    let (a, b) = (counters(one, in_one)?, counters(two, in_two)?);
    Ok(a.iter()
        .zip(&b)
        .find_map(|(one, two)| first_difference(one, two)))
}

/// Rows of a query about one case.
fn rows(connection: &Connection, query: &str, case: i64) -> Result<Vec<Entry>, rusqlite::Error> {
    let mut query = connection.prepare_cached(query)?;
    let names: Vec<String> = query.column_names().map(String::from).collect();
    query
        .query_map([case], |row| {
            let values = names.iter().enumerate();
            values
                .map(|(column, name)| Ok((name.clone(), row.get(column)?)))
                .collect()
        })?
        .collect()
}

/// The first value two rows differ in, bit for bit, other than the number of the case.
fn first_difference(one: &Entry, two: &Entry) -> Option<String> {
    let pairs = one.iter().zip(two).filter(|(one, _)| one.0 != "case_id");
    for ((name, one), (_, two)) in pairs {
        let same = match (one, two) {
            (Value::Real(one), Value::Real(two)) => one.to_bits() == two.to_bits(),
            (one, two) => one == two,
        };
        if !same {
            return Some(format!("{name} is {}, and {}", shown(one), shown(two)));
        }
    }
    None
}

/// A value as it is read by people, with all its digits.
fn shown(value: &Value) -> String {
    match value {
        Value::Real(real) => format!("{real:?}"),
        Value::Integer(whole) => whole.to_string(),
        Value::Text(text) => text.clone(),
        Value::Null | Value::Blob(_) => "nothing".into(),
    }
}
