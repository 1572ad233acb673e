//! Whether two results of one case have the same bits.

use crate::store::entries::{Entry, whole};
use rusqlite::Connection;
use rusqlite::types::Value;

/// A case of a database, and the steps to which it was computed there.
pub(super) type Attempt<'c> = (&'c Connection, i64, u64);

/// Where two runs of a case differ first, if they do, as far as both were computed. Averages follow from the samples and need no
/// look; times may differ.
pub(super) fn difference(
    one: Attempt<'_>,
    two: Attempt<'_>,
) -> Result<Option<String>, rusqlite::Error> {
    let common = one.2.min(two.2);
    let samples = |(connection, case, _): Attempt<'_>| {
        rows(
            connection,
            &format!("SELECT * FROM samples WHERE case_id = ?1 AND step < {common} ORDER BY step"),
            case,
        )
    };
    let (a, b) = (samples(one)?, samples(two)?);
    if a.len() != b.len() {
        return Ok(Some(format!("{} samples, and {}", a.len(), b.len())));
    }
    for (one, two) in a.iter().zip(&b) {
        if let Some(what) = first_difference(one, two) {
            let step = whole(one, "step").unwrap_or(0);
            return Ok(Some(format!("at step {step}: {what}")));
        }
    }
    if one.2 != two.2 {
        return Ok(None);
    }
    let (a, b) = (counters(one)?, counters(two)?);
    Ok(a.iter()
        .zip(&b)
        .find_map(|(one, two)| first_difference(one, two)))
}

/// Counters of all steps computed. A store of schema 4 or before has them in its result.
fn counters((connection, case, _): Attempt<'_>) -> Result<Vec<Entry>, rusqlite::Error> {
    let of = |table: &str| {
        format!(
            "SELECT minimum_gap, stages, unconverged_stages, worst_residual, worst_friction_error, jam_events
             FROM {table} WHERE case_id = ?1"
        )
    };
    rows(connection, &of("ends"), case).or_else(|_| rows(connection, &of("results"), case))
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
