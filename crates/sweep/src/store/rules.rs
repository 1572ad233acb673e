//! Seeds under a requested precision: which of them count, and the order of their batches.
//!
//! All seeds that a point may get are in the store from the beginning. The rule marks those that
//! count whenever a case of the point ends, in the same transaction, so that they depend only on
//! the results.

use super::digest::DigestMismatch;
use super::statements::Statements;
use super::{Store, StoreError, points};
use crate::measure::{Decision, Outcome};
use crate::model::campaign::Campaign;
use crate::model::precision::Precision;
use rusqlite::{Connection, params};
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

/// Gives their rules to the cases of a campaign, which are in the store. All count: [`apply_all`]
/// then excludes seeds.
pub(super) fn enter(connection: &Connection, campaign: &Campaign) -> rusqlite::Result<()> {
    connection.execute(
        "UPDATE cases SET rule = NULL, gain = 0.0 WHERE rule IS NOT NULL",
        [],
    )?;
    let mut give = connection.prepare("UPDATE cases SET rule = ?2 WHERE key = ?1")?;
    for (number, rule) in campaign.rules.iter().enumerate() {
        for (key, _) in &campaign.cases[rule.cases.clone()] {
            give.execute(params![key.to_string(), number])?;
        }
    }
    Ok(())
}

/// Applies every rule.
pub(super) fn apply_all(connection: &Connection, rules: &[Precision]) -> rusqlite::Result<()> {
    let mut rules = rules.iter().enumerate();
    rules.try_for_each(|(point, rule)| apply(connection, point, rule))
}

/// Applies the rule of a case, if it has one.
pub(super) fn apply_to_case(
    connection: &Connection,
    rules: &[Precision],
    case: i64,
) -> rusqlite::Result<()> {
    match of_case(connection, rules, case)? {
        Some((point, rule)) => apply(connection, point, rule),
        None => Ok(()),
    }
}

/// The rule of a case, and its number.
fn of_case<'r>(
    connection: &Connection,
    rules: &'r [Precision],
    case: i64,
) -> rusqlite::Result<Option<(usize, &'r Precision)>> {
    let rule = "SELECT rule FROM cases WHERE id = ?1";
    let number: Option<usize> = connection.value(rule, [case])?.flatten();
    Ok(number.and_then(|number| Some((number, rules.get(number)?))))
}

/// Marks the seeds of a point that count, and no others.
fn apply(connection: &Connection, point: usize, rule: &Precision) -> rusqlite::Result<()> {
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

/// The seeds of a point in their order.
fn seeds(connection: &Connection, point: usize, rule: &Precision) -> rusqlite::Result<Vec<Seed>> {
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

/// Checks that the seeds that count are those of the rule at each point, and elsewhere all of the
/// grid.
pub(super) fn check(connection: &Connection, rules: &[Precision]) -> rusqlite::Result<()> {
    for (point, rule) in rules.iter().enumerate() {
        let seeds = seeds(connection, point, rule)?;
        let wanted = decide(rule, &seeds).wanted;
        let fits = |(place, seed): (usize, &Seed)| seed.counts == (place < wanted);
        // All possible seeds of a point are in the store.
        let are_all = seeds.len() == rule.at_most;
        if !(are_all && seeds.iter().enumerate().all(fits)) {
            return Err(not_by_rule());
        }
    }
    let left_out = connection.has(
        "SELECT 1 FROM cases WHERE CASE WHEN rule IS NULL THEN counts != (position IS NOT NULL)
             ELSE rule < 0 OR rule >= ?1 END",
        [rules.len()],
    )?;
    if left_out {
        return Err(not_by_rule());
    }
    Ok(())
}

fn not_by_rule() -> rusqlite::Error {
    DigestMismatch::error("the seeds marked as counting do not follow from the stopping rule")
}

impl Store {
    /// States of the points with a requested precision, in the order of the file.
    pub(crate) fn point_states(&self) -> Result<Vec<PointState>, StoreError> {
        let rules = self.entered()?.rules;
        let state = |(point, rule): (usize, Precision)| {
            let params = self.connection.one(
                "SELECT p.params FROM cases c JOIN points p ON p.id = c.point WHERE c.rule = ?1 LIMIT 1",
                [point],
                |row| points::params(row, "params"),
            )?;
            let decision = decide(&rule, &seeds(&self.connection, point, &rule)?);
            Ok(PointState {
                params,
                rule,
                decision,
            })
        };
        self.read(rules.into_iter().enumerate().map(state).collect())
    }
}
