//! The remaining work of a campaign.

use crate::measure::{Verdict, student_95};
use crate::model::axes::identity;
use crate::model::campaign::Campaign;
use crate::model::case::Case;
use crate::model::precision::Precision;
use crate::store::{PointState, PointWork, Store, StoreError};
use serde::Serialize;
use std::collections::HashMap;

/// Assumed relative scatter between runs where none is measured yet.
const DEFAULT_SCATTER: f64 = 0.12;

/// The runs of one point that are to be computed.
#[derive(Debug)]
pub(super) struct Point<'c> {
    /// One of its cases.
    pub(super) case: &'c Case,
    /// All its runs, done or not.
    pub(super) all: f64,
    /// Runs that have not ended.
    pub(super) open: f64,
    /// The part of these that is done, in runs.
    done: f64,
}

impl Point<'_> {
    /// The part that remains, in runs.
    pub(super) fn runs(&self) -> f64 {
        (self.open - self.done).max(0.0)
    }
}

/// The expected work where a precision is requested.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Expected {
    /// Points with a requested precision.
    pub(crate) points: usize,
    /// Of these, points that have reached it or get no more seeds.
    pub(crate) settled: usize,
    /// Minimum and maximum total number of seeds.
    pub(crate) at_least: usize,
    pub(crate) at_most: usize,
    /// Expected total number of seeds.
    pub(crate) seeds: usize,
    /// Scatter between runs over their mean, measured where it could be.
    pub(crate) scatter: f64,
    /// Whether it was measured.
    pub(crate) measured: bool,
}

/// The remaining work.
#[derive(Debug)]
pub(super) struct Work<'c> {
    pub(super) points: Vec<Point<'c>>,
    /// Runs that have ended.
    pub(super) ended: usize,
    pub(super) expected: Option<Expected>,
}

impl<'c> Work<'c> {
    /// The work of a campaign that a store does not hold.
    pub(super) fn of(campaign: &'c Campaign, store: Option<&Store>) -> Result<Self, StoreError> {
        let mut points: Vec<Point<'c>> = Vec::new();
        let mut place_of = HashMap::new();
        let mut ended = 0.0;
        let mut enter = |case: &'c Case, of_point: PointWork| {
            let place = *place_of.entry(identity(&case.params)).or_insert_with(|| {
                points.push(Point {
                    case,
                    all: 0.0,
                    open: 0.0,
                    done: 0.0,
                });
                points.len() - 1
            });
            let point = &mut points[place];
            point.all += of_point.runs;
            point.open += of_point.open;
            point.done += of_point.done;
            ended += of_point.runs - of_point.open;
        };
        if let Some(store) = store {
            // Cases keep the order of the campaign file.
            for point in store.point_work()? {
                if let Some((_, case)) = campaign.cases.get(point.position) {
                    enter(case, point);
                }
            }
        } else {
            for (_, case) in campaign.certain() {
                let one = PointWork {
                    position: 0,
                    runs: 1.0,
                    open: 1.0,
                    done: 0.0,
                };
                enter(case, one);
            }
        }
        let states = store
            .map(Store::point_states)
            .transpose()?
            .unwrap_or_default();
        let expected = expected(campaign, &states);
        if let Some(expected) = &expected {
            for (point, rule) in campaign.rules.iter().enumerate() {
                let case = &campaign.cases[rule.cases.start].1;
                let (counted, total) = seeds_of(point, rule.precision, &states, expected.scatter);
                if let Some(place) = place_of.get(&identity(&case.params)) {
                    let more = (total - counted.min(total)) as f64;
                    points[*place].all += more;
                    points[*place].open += more;
                }
            }
        }
        Ok(Self {
            points,
            ended: crate::text::format::count(ended),
            expected,
        })
    }
}

/// Seeds of a point that count so far, and those that will count at the end.
fn seeds_of(point: usize, rule: Precision, states: &[PointState], scatter: f64) -> (usize, usize) {
    match states.get(point) {
        None => (rule.at_least.min(rule.at_most), rule.foreseen(scatter)),
        Some(state) => {
            let wanted = state.decision.wanted;
            let foreseen = match state.decision.verdict {
                Verdict::Open => rule
                    .foreseen(scatter_of(state).unwrap_or(scatter))
                    .max(wanted),
                _ => wanted,
            };
            (wanted, foreseen)
        }
    }
}

/// Scatter between the runs of a point, over their mean, where it is measured.
fn scatter_of(state: &PointState) -> Option<f64> {
    let n = state.decision.complete as f64;
    let width = state.decision.reached.filter(|width| width.is_finite())?;
    Some(width * n.sqrt() / student_95(n - 1.0)?)
}

fn expected(campaign: &Campaign, states: &[PointState]) -> Option<Expected> {
    if campaign.rules.is_empty() {
        return None;
    }
    let scatters: Vec<f64> = states.iter().filter_map(scatter_of).collect();
    let scatter = crate::measure::mean(&scatters).unwrap_or(DEFAULT_SCATTER);
    let sum = |of: &dyn Fn(usize, Precision) -> usize| {
        let rules = campaign.rules.iter().enumerate();
        rules.map(|(point, rule)| of(point, rule.precision)).sum()
    };
    let is_settled = |state: &&PointState| state.decision.verdict != Verdict::Open;
    Some(Expected {
        points: campaign.rules.len(),
        settled: states.iter().filter(is_settled).count(),
        at_least: sum(&|_, rule| rule.at_least.min(rule.at_most)),
        at_most: sum(&|_, rule| rule.at_most),
        seeds: sum(&|point, rule| seeds_of(point, rule, states, scatter).1),
        scatter,
        measured: !scatters.is_empty(),
    })
}
