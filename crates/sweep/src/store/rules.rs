//! Seeds that a precision decides on: which of them count, and in which order their batches are computed.
//!
//! All seeds that a point may get are in the store from the beginning, without a position. The rule gives positions to those
//! that count, whenever a case of the point ends, in the same transaction: what counts is a function of the results alone.

use super::checksum::{self, Kind};
use super::{Store, StoreError, count, integer};
use crate::campaign::Campaign;
use crate::statistics::{Decision, Measure, Outcome, Precision};
use rusqlite::{Connection, OptionalExtension, Row, params};
use sd_core::Params;

/// How a point stands at which a precision is asked for.
#[derive(Debug, Clone)]
pub struct PointState {
    /// Its parameters.
    pub params: Params,
    /// What is asked for.
    pub rule: Precision,
    /// What the rule says.
    pub decision: Decision,
}

/// A seed of such a point, as its rule sees it.
struct Seed {
    id: i64,
    outcome: Outcome,
    is_wanted: bool,
    cost: f64,
}

/// Enters the rules of a campaign in place of those that are there. Its cases are in the store, and those of a rule have their
/// positions: see [`apply_all`], which takes them from seeds that do not count.
pub(super) fn enter(connection: &Connection, campaign: &Campaign) -> Result<(), rusqlite::Error> {
    connection.execute("DELETE FROM rules", [])?;
    connection.execute(
        "UPDATE cases SET point = NULL, reserve = NULL, gain = 0.0 WHERE point IS NOT NULL",
        [],
    )?;
    let mut insert = connection.prepare("INSERT INTO rules VALUES (?1, ?2, ?3, ?4, ?5)")?;
    let mut give =
        connection.prepare("UPDATE cases SET point = ?2, reserve = position WHERE key = ?1")?;
    for (point, rule) in campaign.rules.iter().enumerate() {
        let point = integer(point as u64);
        let precision = rule.precision;
        insert.execute(params![
            point,
            precision.precision,
            precision.quantity.name(),
            integer(precision.at_least as u64),
            integer(precision.at_most as u64),
        ])?;
        for (key, _) in &campaign.cases[rule.cases.clone()] {
            give.execute(params![key.to_string(), point])?;
        }
    }
    Ok(())
}

/// Lets every rule decide.
pub(super) fn apply_all(connection: &Connection) -> Result<(), rusqlite::Error> {
    for (point, rule) in rules(connection)? {
        apply(connection, point, &rule)?;
    }
    Ok(())
}

/// Lets the rule decide that a case belongs to, if it belongs to one.
pub(super) fn apply_to_case(connection: &Connection, case: i64) -> Result<(), rusqlite::Error> {
    let found = connection
        .prepare_cached(
            "SELECT r.point, r.precision, r.quantity, r.at_least, r.at_most
             FROM cases c JOIN rules r ON r.point = c.point WHERE c.id = ?1",
        )?
        .query_row([case], rule)
        .optional()?;
    match found {
        Some((point, rule)) => apply(connection, point, &rule),
        None => Ok(()),
    }
}

/// Gives positions to the seeds of a point that count, and takes those of the others.
fn apply(connection: &Connection, point: i64, rule: &Precision) -> Result<(), rusqlite::Error> {
    let seeds = seeds(connection, point, rule)?;
    let decision = decide(rule, &seeds);
    let batch = &seeds[decision.complete.min(seeds.len())..decision.wanted.min(seeds.len())];
    let cost: f64 = batch.iter().map(|seed| seed.cost).sum();
    // The first batches of all points come before any second one, in the order of their ranks.
    let gain = match rule.gain(&decision) {
        gain if gain.is_finite() => gain / cost.max(1e-9),
        _ => 0.0,
    };
    let mut changed = false;
    for (place, seed) in seeds.iter().enumerate() {
        let is_wanted = place < decision.wanted;
        let is_new = is_wanted && place >= decision.complete;
        changed |= is_wanted != seed.is_wanted;
        if is_wanted != seed.is_wanted || is_new {
            connection
                .prepare_cached(
                    "UPDATE cases SET position = CASE WHEN ?2 THEN reserve END, gain = ?3 WHERE id = ?1",
                )?
                .execute(params![seed.id, is_wanted, gain])?;
        }
    }
    if changed {
        // The number of runs is sealed with the campaign.
        checksum::seal(connection, Kind::Campaign, 1)?;
    }
    Ok(())
}

fn decide(rule: &Precision, seeds: &[Seed]) -> Decision {
    let outcomes: Vec<Outcome> = seeds.iter().map(|seed| seed.outcome).collect();
    rule.decide(&outcomes)
}

/// A row of the rules.
fn rule(row: &Row<'_>) -> Result<(i64, Precision), rusqlite::Error> {
    let quantity: String = row.get(2)?;
    let seeds = |column: usize| -> Result<usize, rusqlite::Error> {
        Ok(usize::try_from(count(row.get(column)?)).unwrap_or(usize::MAX))
    };
    Ok((
        row.get(0)?,
        Precision {
            precision: row.get(1)?,
            quantity: Measure::of_name(&quantity).ok_or(rusqlite::Error::InvalidQuery)?,
            at_least: seeds(3)?,
            at_most: seeds(4)?,
        },
    ))
}

/// All rules.
fn rules(connection: &Connection) -> Result<Vec<(i64, Precision)>, rusqlite::Error> {
    connection
        .prepare_cached(
            "SELECT point, precision, quantity, at_least, at_most FROM rules ORDER BY point",
        )?
        .query_map([], rule)?
        .collect()
}

/// The seeds of a point in their order.
fn seeds(
    connection: &Connection,
    point: i64,
    rule: &Precision,
) -> Result<Vec<Seed>, rusqlite::Error> {
    // The name of a quantity is one of a few words, not what somebody wrote.
    let quantity = rule.quantity.name();
    connection
        .prepare_cached(&format!(
            "SELECT c.id, c.state, c.position IS NOT NULL, c.cost, CASE WHEN coalesce(r.doubts, '') = '' THEN r.{quantity} END
             FROM cases c LEFT JOIN results r ON r.case_id = c.id WHERE c.point = ?1 ORDER BY c.reserve"
        ))?
        .query_map([point], |row| {
            let state: String = row.get(1)?;
            let value: Option<f64> = row.get(4)?;
            Ok(Seed {
                id: row.get(0)?,
                outcome: match (state.as_str(), value) {
                    ("done", Some(value)) => Outcome::Value(value),
                    ("done" | "jammed" | "failed", _) => Outcome::Lost,
                    _ => Outcome::Open,
                },
                is_wanted: row.get(2)?,
                cost: row.get(3)?,
            })
        })?
        .collect()
}

/// The keys of the first batch of the point of a case, if a rule decides on it.
pub(super) fn first_batch(
    connection: &Connection,
    case: i64,
) -> Result<Option<Vec<i64>>, rusqlite::Error> {
    let found: Option<(i64, i64)> = connection
        .prepare_cached(
            "SELECT r.point, r.at_least FROM cases c JOIN rules r ON r.point = c.point WHERE c.id = ?1",
        )?
        .query_row([case], |row| Ok((row.get(0)?, row.get(1)?)))
        .optional()?;
    found
        .map(|(point, at_least)| {
            connection
                .prepare_cached("SELECT id FROM cases WHERE point = ?1 ORDER BY reserve LIMIT ?2")?
                .query_map([point, at_least], |row| row.get(0))?
                .collect()
        })
        .transpose()
}

impl Store {
    /// How the points stand at which a precision is asked for, in the order of the file.
    ///
    /// # Errors
    /// Trouble with the file, or an entry that cannot be read.
    pub fn point_states(&self) -> Result<Vec<PointState>, StoreError> {
        let read = || {
            rules(&self.connection)?
                .into_iter()
                .map(|(point, rule)| {
                    let seeds = seeds(&self.connection, point, &rule)?;
                    let params = self
                        .connection
                        .prepare_cached("SELECT params FROM cases WHERE point = ?1 LIMIT 1")?
                        .query_row([point], |row| super::query::params(row, 0))?;
                    Ok(PointState {
                        params,
                        rule,
                        decision: decide(&rule, &seeds),
                    })
                })
                .collect()
        };
        self.read(read())
    }
}
