//! The seeds that a requested precision will need, as far as the scatter of runs tells.

use crate::measure::{Verdict, mean, student_95};
use crate::model::campaign::Campaign;
use crate::model::case::Case;
use crate::store::{PointState, Store, StoreError};
use serde::Serialize;

/// Assumed relative scatter between runs where none is measured yet.
const DEFAULT_SCATTER: f64 = 0.12;

/// The expected work where a precision is requested.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Expected {
    pub(crate) points: usize,
    /// Of these, points that have reached it or get no more seeds.
    pub(crate) settled: usize,
    pub(crate) at_least: usize,
    pub(crate) at_most: usize,
    pub(crate) seeds: usize,
    pub(crate) scatter: f64,
    pub(crate) measured: bool,
}

/// The expected work, if a precision is requested; `add` is told the seeds that each point will
/// need besides those it has.
pub(super) fn foresee(
    campaign: &Campaign,
    store: Option<&Store>,
    mut add: impl FnMut(&Case, f64),
) -> Result<Option<Expected>, StoreError> {
    let states = store.map_or(Ok(Vec::new()), Store::point_states)?;
    let scatters: Vec<f64> = states.iter().filter_map(scatter_of).collect();
    let mut expected = Expected {
        points: campaign.rules.len(),
        settled: 0,
        at_least: 0,
        at_most: 0,
        seeds: 0,
        scatter: mean(&scatters).unwrap_or(DEFAULT_SCATTER),
        measured: !scatters.is_empty(),
    };
    for (number, rule) in campaign.rules.iter().enumerate() {
        let (precision, state) = (rule.precision, states.get(number));
        let least = precision.at_least.min(precision.at_most);
        let mut seeds = state.map_or(least, |state| state.decision.wanted);
        if state.is_some_and(|state| state.decision.verdict != Verdict::Open) {
            expected.settled += 1;
        } else {
            let scatter = state.and_then(scatter_of).unwrap_or(expected.scatter);
            let foreseen = precision.foreseen(scatter).max(seeds);
            add(
                &campaign.cases[rule.cases.start].1,
                (foreseen - seeds) as f64,
            );
            seeds = foreseen;
        }
        expected.at_least += least;
        expected.at_most += precision.at_most;
        expected.seeds += seeds;
    }
    Ok((expected.points > 0).then_some(expected))
}

/// Scatter between the runs of a point, over their mean, where it is measured.
fn scatter_of(state: &PointState) -> Option<f64> {
    let n = state.decision.complete as f64;
    let width = state.decision.reached.filter(|width| width.is_finite())?;
    Some(width * n.sqrt() / student_95(n - 1.0)?)
}
