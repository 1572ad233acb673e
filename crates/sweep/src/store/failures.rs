//! Failures: as they are kept, and those that are alike told once.

use super::FailureLine;
use super::digest::{self, number, whole};
use crate::process;
use rusqlite::types::Value;
use rusqlite::{Connection, params, params_from_iter};
use sd_core::Params;

/// Columns of a failure that its digest covers, after the key of its case.
pub(super) const COLUMNS: &str =
    "attempt, error, step, strain, sphere_i, sphere_j, gap, snapshot, process, failed_at, retried";

/// A failure as it is kept.
#[derive(Debug, Clone, Default)]
pub(super) struct Row {
    /// `None` for the last one of its case.
    pub(super) attempt: Option<u64>,
    pub(super) error: String,
    pub(super) step: u64,
    pub(super) strain: f64,
    pub(super) pair: Option<(u64, u64)>,
    pub(super) gap: Option<f64>,
    pub(super) snapshot: Option<String>,
    pub(super) process: i64,
    pub(super) failed_at: i64,
}

/// Keeps a failure of a case.
pub(super) fn insert(connection: &Connection, case: i64, row: Row) -> Result<(), rusqlite::Error> {
    let (key, attempts): (String, i64) = connection
        .prepare_cached("SELECT key, attempts FROM cases WHERE id = ?1")?
        .query_row([case], |row| Ok((row.get(0)?, row.get(1)?)))?;
    let optional = |value: Option<u64>| value.map_or(Value::Null, whole);
    let values = [
        Value::Text(key),
        row.attempt.map_or(Value::Integer(attempts), whole),
        Value::Text(row.error),
        whole(row.step),
        number(row.strain),
        optional(row.pair.map(|pair| pair.0)),
        optional(row.pair.map(|pair| pair.1)),
        number(row.gap),
        row.snapshot.map_or(Value::Null, Value::Text),
        Value::Integer(row.process),
        Value::Integer(row.failed_at),
        Value::Integer(0),
    ];
    let digest = Value::Integer(digest::of(&values));
    connection
        .prepare_cached(&format!(
            "INSERT INTO failures (case_id, {COLUMNS}, digest) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
        ))?
        .execute(params_from_iter(
            std::iter::once(&Value::Integer(case)).chain(&values[1..]).chain([&digest]),
        ))
        .map(|_| ())
}

/// The failures of a case.
pub(super) fn of(connection: &Connection, case: i64) -> Result<Vec<Row>, rusqlite::Error> {
    check(connection, "c.id = ?1", [case])?;
    let whole = |count: Option<i64>| count.map(super::count);
    connection
        .prepare_cached(&format!(
            "SELECT {COLUMNS} FROM failures NOT INDEXED WHERE case_id = ?1 ORDER BY id"
        ))?
        .query_map([case], |row| {
            Ok(Row {
                attempt: whole(row.get(0)?),
                error: row.get(1)?,
                step: super::count(row.get(2)?),
                strain: row.get(3)?,
                pair: whole(row.get(4)?).zip(whole(row.get(5)?)),
                gap: row.get(6)?,
                snapshot: row.get(7)?,
                process: row.get(8)?,
                failed_at: row.get(9)?,
            })
        })?
        .collect()
}

/// Makes sure that failures are what was written: those that meet a condition on `f` and `c`.
pub(super) fn check(
    connection: &Connection,
    condition: &str,
    parameters: impl rusqlite::Params,
) -> Result<(), rusqlite::Error> {
    let columns = COLUMNS.replace(", ", ", f.");
    digest::check(
        connection,
        &format!(
            "SELECT c.key, f.{columns}, f.digest FROM failures f JOIN cases c ON c.id = f.case_id WHERE {condition}"
        ),
        parameters,
        "a failure",
    )
}

/// Writes the digests of failures anew.
pub(super) fn seal(connection: &Connection, condition: &str) -> Result<(), rusqlite::Error> {
    let columns = COLUMNS.replace(", ", ", f.");
    let mut query = connection.prepare(&format!(
        "SELECT f.id, c.key, f.{columns} FROM failures f JOIN cases c ON c.id = f.case_id WHERE {condition}"
    ))?;
    let last = query.column_count();
    let digests: Vec<(i64, i64)> = query
        .query_map([], |row| {
            let digest = digest::Digest::default().with_row(row, 1..last)?;
            Ok((row.get(0)?, digest.finish()))
        })?
        .collect::<Result<_, _>>()?;
    let mut update = connection.prepare("UPDATE failures SET digest = ?2 WHERE id = ?1")?;
    for digest in digests {
        update.execute(params![digest.0, digest.1])?;
    }
    Ok(())
}

/// Records that cases that meet a condition are pending again after their failures.
pub(super) fn mark_retried(
    connection: &Connection,
    condition: &str,
) -> Result<(), rusqlite::Error> {
    let cases = format!("(SELECT id FROM cases WHERE {condition})");
    let changed = connection.execute(
        &format!("UPDATE failures SET retried = 1 WHERE retried = 0 AND case_id IN {cases}"),
        [],
    )?;
    if changed > 0 {
        seal(connection, &format!("f.retried AND f.case_id IN {cases}"))?;
    }
    Ok(())
}

/// Makes failed cases that meet a condition pending again: they begin anew, or where they were computed to an end before, go on
/// from there. Returns how many.
pub(super) fn reopen(connection: &Connection, condition: &str) -> Result<usize, rusqlite::Error> {
    let failed = format!("state = 'failed' AND {condition}");
    mark_retried(connection, &failed)?;
    connection.execute(
        &format!(
            "UPDATE cases SET state = 'pending', deaths = 0, changed_at = ?1, turn = {turn}, steps_done = coalesce(
                 (SELECT e.steps FROM ends e WHERE e.case_id = cases.id AND e.state IS NOT NULL), 0)
             WHERE {failed}",
            turn = super::claims::turn("(SELECT count(*) FROM ends e WHERE e.case_id = cases.id AND e.state IS NOT NULL)")
                .replace("deaths", "0")
        ),
        [process::now()],
    )
}

/// Runs that failed in the same way: with the same message and the same parameters but for the shear rate and the seed.
#[derive(Debug, Clone, PartialEq)]
pub struct FailureGroup {
    /// The first of them.
    pub first: FailureLine,
    /// How many there are.
    pub runs: usize,
    /// Their shear rates, or stresses where these are imposed, in the order of the campaign file.
    pub shear_rates: Vec<f64>,
}

impl FailureGroup {
    /// Groups of some failures, in the order of the first of each.
    pub fn of(failures: Vec<FailureLine>) -> Vec<Self> {
        let mut groups: Vec<Self> = Vec::new();
        for failure in failures {
            let alike = |group: &&mut Self| {
                group.first.error == failure.error
                    && same_but_shear_rate(&group.first.params, &failure.params)
            };
            let params = &failure.params;
            let shear_rate = params.shear_stress.unwrap_or(params.shear_rate);
            if let Some(group) = groups.iter_mut().find(alike) {
                group.runs += 1;
                if !group.shear_rates.contains(&shear_rate) {
                    group.shear_rates.push(shear_rate);
                }
            } else {
                groups.push(Self {
                    first: failure,
                    runs: 1,
                    shear_rates: vec![shear_rate],
                });
            }
        }
        groups
    }

    /// In words: which runs, where, and why.
    pub fn text(&self) -> String {
        let FailureLine {
            key,
            seed,
            strain,
            attempt,
            error,
            ..
        } = &self.first;
        if self.runs == 1 {
            return format!(
                "failed: {key} seed {seed} at strain {strain:.3}, attempt {attempt}: {error}"
            );
        }
        let shear_rates: Vec<String> = self.shear_rates.iter().map(f64::to_string).collect();
        format!(
            "failed: {} runs at {} = {}, the first {key} seed {seed} at strain {strain:.3}, attempt {attempt}: {error}",
            self.runs,
            if self.first.params.shear_stress.is_some() {
                "σ*"
            } else {
                "Γ"
            },
            shear_rates.join(", ")
        )
    }
}

/// Whether two runs differ in their shear rates, or in the stresses imposed, at most.
fn same_but_shear_rate(one: &Params, other: &Params) -> bool {
    let other = Params {
        shear_rate: one.shear_rate,
        shear_stress: match (one.shear_stress, other.shear_stress) {
            (Some(stress), Some(_)) => Some(stress),
            (_, different) => different,
        },
        ..other.clone()
    };
    *one == other
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    #[test]
    fn failures_that_are_the_same_for_every_shear_rate_are_one() {
        let failure = |shear_rate, friction, error: &str| FailureLine {
            key: format!("{shear_rate}-{friction}"),
            seed: 1,
            params: Params {
                shear_rate,
                friction,
                ..params()
            },
            error: error.into(),
            step: 0,
            strain: 0.0,
            attempt: 1,
            pair: None,
            gap: None,
        };
        let groups = FailureGroup::of(vec![
            failure(0.1, 0.3, "no start layer"),
            failure(1.0, 0.3, "no start layer"),
            failure(1.0, 0.5, "no start layer"),
            failure(f64::INFINITY, 0.3, "no start layer"),
            failure(0.1, 0.3, "overlap"),
        ]);
        let runs: Vec<usize> = groups.iter().map(|group| group.runs).collect();
        assert_eq!(runs, [3, 1, 1]);
        let text = groups[0].text();
        assert!(
            text.contains("3 runs at Γ = 0.1, 1, inf, the first 0.1-0.3"),
            "{text}"
        );
    }
}
