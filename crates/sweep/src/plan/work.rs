//! The remaining work of a campaign.

use crate::measure::{Verdict, mean, student_95};
use crate::model::axes::identity;
use crate::model::campaign::Campaign;
use crate::model::case::Case;
use crate::store::{PointState, PointWork, Store, StoreError};
use serde::Serialize;
use std::collections::HashMap;

/// Assumed relative scatter between runs where none is measured yet.
const DEFAULT_SCATTER: f64 = 0.12;

/// The runs of one point.
#[derive(Debug)]
pub(super) struct Point<'c> {
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
    /// Scatter between runs over their mean.
    pub(crate) scatter: f64,
    pub(crate) measured: bool,
}

/// The remaining work.
#[derive(Debug)]
pub(super) struct Work<'c> {
    pub(super) points: Vec<Point<'c>>,
    pub(super) ended: usize,
    pub(super) expected: Option<Expected>,
}

impl<'c> Work<'c> {
    /// The work of a campaign that a store does not hold.
    pub(super) fn of(campaign: &'c Campaign, store: Option<&Store>) -> Result<Self, StoreError> {
        let (mut points, mut place_of) = (Vec::<Point<'c>>::new(), HashMap::new());
        let mut last = None;
        let mut enter = |case: &'c Case, [all, open, done]: [f64; 3]| {
            // Seeds of a point follow each other, perhaps a million of them.
            let known = last.filter(|place: &usize| points[*place].case.params == case.params);
            let place = known.unwrap_or_else(|| {
                *place_of.entry(identity(&case.params)).or_insert_with(|| {
                    let [all, open, done] = [0.0; 3];
                    points.push(Point {
                        case,
                        all,
                        open,
                        done,
                    });
                    points.len() - 1
                })
            });
            last = Some(place);
            points[place].all += all;
            points[place].open += open;
            points[place].done += done;
        };
        if let Some(store) = store {
            // Cases keep the order of the campaign file.
            for PointWork {
                position,
                runs,
                open,
                done,
            } in store.point_work()?
            {
                if let Some((_, case)) = campaign.cases.get(position) {
                    enter(case, [runs, open, done]);
                }
            }
        } else {
            for (_, case) in campaign.certain() {
                enter(case, [1.0, 1.0, 0.0]);
            }
        }
        let ended: f64 = points.iter().map(|point| point.all - point.open).sum();
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
            let counted = state.map_or(least, |state| state.decision.wanted);
            let is_open = state.is_none_or(|state| state.decision.verdict == Verdict::Open);
            let scatter = state.and_then(scatter_of).unwrap_or(expected.scatter);
            let foreseen = if is_open {
                precision.foreseen(scatter).max(counted)
            } else {
                counted
            };
            expected.settled += usize::from(!is_open);
            expected.at_least += least;
            expected.at_most += precision.at_most;
            expected.seeds += foreseen;
            let case = &campaign.cases[rule.cases.start].1;
            if let Some(place) = place_of.get(&identity(&case.params)) {
                points[*place].all += (foreseen - counted) as f64;
                points[*place].open += (foreseen - counted) as f64;
            }
        }
        Ok(Self {
            points,
            ended: crate::text::format::count(ended),
            expected: (expected.points > 0).then_some(expected),
        })
    }
}

/// Scatter between the runs of a point, over their mean, where it is measured.
fn scatter_of(state: &PointState) -> Option<f64> {
    let n = state.decision.complete as f64;
    let width = state.decision.reached.filter(|width| width.is_finite())?;
    Some(width * n.sqrt() / student_95(n - 1.0)?)
}
