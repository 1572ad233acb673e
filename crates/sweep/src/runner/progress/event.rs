//! Progress as lines of JSON, one object each, for programs that monitor a run. Names and meanings
//! are in `docs/json.md`.

use crate::model::case::Case;
use crate::store::{Claim, Counts};
use serde_json::{Value, json};
use std::time::Instant;

/// A running case.
pub(super) struct RunningCase {
    key: String,
    pub(super) case: Case,
    begun: Instant,
    begun_at: u64,
}

impl RunningCase {
    /// A running case at some step.
    pub(super) fn of(claim: &Claim, steps: u64) -> Self {
        Self {
            key: claim.key.clone(),
            case: claim.case.clone(),
            begun: Instant::now(),
            begun_at: steps,
        }
    }

    /// The line about it.
    pub(super) fn line(&self, steps: u64, viscosity: f64) -> String {
        let case = &self.case;
        let here = steps.saturating_sub(self.begun_at) as f64;
        let left = case.steps.saturating_sub(steps) as f64;
        let eta_s = (here > 0.0).then(|| self.begun.elapsed().as_secs_f64() * left / here);
        json!({
            "event": "case", "key": self.key, "case": case.label(), "seed": case.seed,
            "strain": steps as f64 * case.params.time_step, "strain_end": case.strain(),
            "viscosity": number(viscosity), "eta_s": eta_s,
        })
        .to_string()
    }
}

/// A number, or null for NaN.
fn number(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or(Value::Null, Value::Number)
}

/// The line about the campaign.
pub(super) fn campaign(counts: &Counts, work_done: f64, eta_s: Option<f64>) -> String {
    json!({"event": "campaign", "cases": counts, "work_done": work_done, "eta_s": eta_s})
        .to_string()
}

/// The line about a case that ended.
pub(super) fn ended(claim: &Claim, state: &str, steps: u64, cpu_time_s: f64) -> String {
    json!({
        "event": "ended", "key": claim.key, "case": claim.case.label(), "seed": claim.case.seed, "state": state,
        "strain": steps as f64 * claim.case.params.time_step, "cpu_time_s": cpu_time_s,
    })
    .to_string()
}

/// The line about anything else.
pub(super) fn note(text: &str) -> String {
    json!({"event": "note", "text": text}).to_string()
}
