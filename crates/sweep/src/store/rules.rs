//! Seeds under a requested precision: which of them count, and the order of their batches.
//!
//! All seeds that a point may get are in the store from the beginning. The rule marks those that
//! count whenever a case of the point ends, in the same transaction, so that they depend only on
//! the results.

use super::digest::{DigestMismatch, Sealed, whole};
use super::statements::Statements;
use super::{Store, StoreError};
use crate::measure::{Decision, Outcome};
use crate::model::campaign::Campaign;
use crate::model::precision::{Precision, Quantity};
use rusqlite::{Connection, Row, params};
use sd_core::Params;

/// State of a point with a requested precision.
#[derive(Debug, Clone)]
pub struct PointState {
    /// Its parameters.
    pub params: Params,
    /// The requested precision.
    pub rule: Precision,
    /// Decision of the rule.
    pub decision: Decision,
}

/// A seed of such a point, for its rule.
struct Seed {
    id: i64,
    outcome: Outcome,
    counts: bool,
    cost: f64,
}

/// The rules.
pub(super) const SEALED: Sealed = Sealed {
    table: "rules",
    columns: "number, precision, quantity, at_least, at_most",
    with_key: false,
    words: "the precision requested at a point",
};

/// Description of the damage if the seeds that count contradict the rules.
const COUNTED_SEEDS: &str = "which seeds count";

/// Replaces the rules by those of a campaign. Its cases are in the store, and all count:
/// [`apply_all`] then excludes seeds.
pub(super) fn enter(connection: &Connection, campaign: &Campaign) -> rusqlite::Result<()> {
    connection.execute("DELETE FROM rules", [])?;
    connection.execute(
        "UPDATE cases SET rule = NULL, gain = 0.0 WHERE rule IS NOT NULL",
        [],
    )?;
    let mut give = connection.prepare("UPDATE cases SET rule = ?2 WHERE key = ?1")?;
    for (number, rule) in (0_i64..).zip(&campaign.rules) {
        let precision = rule.precision;
        let row = [
            number.into(),
            precision.precision.into(),
            precision.quantity.name().to_owned().into(),
            whole(precision.at_least as u64),
            whole(precision.at_most as u64),
        ];
        SEALED.put(connection, None, &row, &[])?;
        for (key, _) in &campaign.cases[rule.cases.clone()] {
            give.execute(params![key.to_string(), number])?;
        }
    }
    Ok(())
}

/// Applies every rule.
pub(super) fn apply_all(connection: &Connection) -> rusqlite::Result<()> {
    for (point, rule) in rules(connection, "true", [])? {
        apply(connection, point, &rule)?;
    }
    Ok(())
}

/// Applies the rule of a case, if it has one.
pub(super) fn apply_to_case(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    let of_case = "t.number = (SELECT rule FROM cases WHERE id = ?1)";
    for (point, rule) in rules(connection, of_case, [case])? {
        apply(connection, point, &rule)?;
    }
    Ok(())
}

/// Marks the seeds of a point that count, and no others.
fn apply(connection: &Connection, point: i64, rule: &Precision) -> rusqlite::Result<()> {
    let seeds = seeds(connection, point, rule)?;
    let decision = decide(rule, &seeds);
    let batch = &seeds[decision.complete.min(seeds.len())..decision.wanted.min(seeds.len())];
    let cost: f64 = batch.iter().map(|seed| seed.cost).sum();
    // The first batches of all points come before any second one, in the order of their ranks.
    let gain = match rule.gain(&decision) {
        gain if gain.is_finite() => gain / cost.max(1e-9),
        _ => 0.0,
    };
    for (place, seed) in seeds.iter().enumerate() {
        let counts = place < decision.wanted;
        if counts != seed.counts || (counts && place >= decision.complete) {
            connection.run(
                "UPDATE cases SET counts = ?2, gain = ?3 WHERE id = ?1",
                params![seed.id, counts, gain],
            )?;
        }
    }
    Ok(())
}

fn decide(rule: &Precision, seeds: &[Seed]) -> Decision {
    let outcomes: Vec<Outcome> = seeds.iter().map(|seed| seed.outcome).collect();
    rule.decide(&outcomes)
}

/// A row of the rules.
fn rule(row: &Row<'_>) -> rusqlite::Result<(i64, Precision)> {
    let quantity: String = row.get(2)?;
    Ok((
        row.get(0)?,
        Precision {
            precision: row.get(1)?,
            quantity: Quantity::of_name(&quantity).ok_or(rusqlite::Error::InvalidQuery)?,
            at_least: row.get(3)?,
            at_most: row.get(4)?,
        },
    ))
}

/// All rules with their numbers, in the order of the campaign file.
pub(super) fn all(connection: &Connection) -> rusqlite::Result<Vec<(i64, Precision)>> {
    rules(connection, "true", [])
}

/// The rules that meet a condition, in the order of the campaign file.
fn rules(
    connection: &Connection,
    condition: &str,
    parameters: impl rusqlite::Params,
) -> rusqlite::Result<Vec<(i64, Precision)>> {
    let ordered = format!("{condition} ORDER BY t.number");
    SEALED.all(connection, &ordered, parameters, rule)
}

/// The seeds of a point in their order.
fn seeds(connection: &Connection, point: i64, rule: &Precision) -> rusqlite::Result<Vec<Seed>> {
    // The name of a quantity is one of a few keywords, not user text.
    let quantity = rule.quantity.name();
    connection.all(
        &format!(
            "SELECT c.id, c.state, c.counts, c.cost,
                 CASE WHEN r.doubts = '' THEN r.{quantity} END FROM cases c
             LEFT JOIN results r ON r.case_id = c.id AND c.state = 'done'
             WHERE c.rule = ?1 ORDER BY c.position"
        ),
        [point],
        |row| {
            let state: String = row.get(1)?;
            let value: Option<f64> = row.get(4)?;
            Ok(Seed {
                id: row.get(0)?,
                outcome: match (state.as_str(), value) {
                    ("done", Some(value)) => Outcome::Value(value),
                    ("done" | "jammed" | "failed", _) => Outcome::Lost,
                    _ => Outcome::Open,
                },
                counts: row.get(2)?,
                cost: row.get(3)?,
            })
        },
    )
}

/// The cases of the first batch of the point of a case, if it has a rule.
pub(super) fn first_batch(
    connection: &Connection,
    case: i64,
) -> rusqlite::Result<Option<Vec<i64>>> {
    let of_case = "t.number = (SELECT rule FROM cases WHERE id = ?1)";
    let rule = rules(connection, of_case, [case])?.pop();
    rule.map(|(point, rule)| {
        let batch = "SELECT id FROM cases WHERE rule = ?1 ORDER BY position LIMIT ?2";
        connection.values(batch, params![point, rule.at_least])
    })
    .transpose()
}

/// Checks that the seeds that count are those of the rule at each point, and elsewhere all of the
/// grid.
pub(super) fn check(connection: &Connection) -> rusqlite::Result<()> {
    for (point, rule) in rules(connection, "true", [])? {
        let seeds = seeds(connection, point, &rule)?;
        let wanted = decide(&rule, &seeds).wanted;
        let fits = |(place, seed): (usize, &Seed)| seed.counts == (place < wanted);
        // All possible seeds of a point are in the store.
        let are_all = seeds.len() == rule.at_most;
        DigestMismatch::unless(are_all && seeds.iter().enumerate().all(fits), COUNTED_SEEDS)?;
    }
    let left_out = connection.has(
        "SELECT 1 FROM cases WHERE CASE WHEN rule IS NULL THEN counts != (position IS NOT NULL)
             ELSE rule NOT IN (SELECT number FROM rules) END",
        [],
    )?;
    DigestMismatch::unless(!left_out, COUNTED_SEEDS)
}

impl Store {
    /// States of the points with a requested precision, in the order of the file.
    pub(crate) fn point_states(&self) -> Result<Vec<PointState>, StoreError> {
        let state = |(point, rule): (i64, Precision)| {
            let params = self.connection.one(
                "SELECT p.params FROM cases c JOIN points p ON p.id = c.point WHERE c.rule = ?1 LIMIT 1",
                [point],
                |row| super::schema::params(row, 0),
            )?;
            let decision = decide(&rule, &seeds(&self.connection, point, &rule)?);
            Ok(PointState {
                params,
                rule,
                decision,
            })
        };
        let rules = self.read(rules(&self.connection, "true", []))?;
        self.read(rules.into_iter().map(state).collect())
    }
}
