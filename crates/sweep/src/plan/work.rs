//! The remaining work of a campaign.

use crate::measure::{Verdict, student_95};
use crate::model::axes::identity;
use crate::model::campaign::Campaign;
use crate::model::case::Case;
use crate::plan::costs::Record;
use crate::store::{PointState, PointWork, Store, StoreError};
use serde::Serialize;
use std::collections::HashMap;

/// Assumed relative scatter between runs where none is measured yet.
const DEFAULT_SCATTER: f64 = 0.12;
/// Above this number of seeds, the seeds that a precision needs are not counted.
const MAX_SEEDS: usize = 100_000;
/// Lengths of runs that are compared, over the length requested.
const LENGTHS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];

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
    /// Lengths of runs and the total strain that the precision needs with each, over that of the
    /// requested length; empty where nothing is measured.
    pub(crate) lengths: Vec<Length>,
}

/// A length of runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Length {
    /// Strain of a run.
    pub(crate) strain: f64,
    /// Seeds that the precision needs.
    pub(crate) seeds: usize,
    /// Total strain of all of them, over that of the requested length.
    pub(crate) work: f64,
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
            let new = |runs| PointWork {
                position: 0,
                runs,
                open: runs,
                done: 0.0,
            };
            // Cases of a point come one after the other.
            let mut last: Option<(&'c Case, f64)> = None;
            for (_, case) in campaign.certain() {
                match &mut last {
                    Some((first, runs)) if first.params == case.params => *runs += 1.0,
                    _ => {
                        if let Some((first, runs)) = last.replace((case, 1.0)) {
                            enter(first, new(runs));
                        }
                    }
                }
            }
            if let Some((first, runs)) = last {
                enter(first, new(runs));
            }
        }
        let states = store
            .map(Store::point_states)
            .transpose()?
            .unwrap_or_default();
        let expected = expected(campaign, &states, store)?;
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
fn seeds_of(
    point: usize,
    rule: crate::model::precision::Precision,
    states: &[PointState],
    scatter: f64,
) -> (usize, usize) {
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

fn expected(
    campaign: &Campaign,
    states: &[PointState],
    store: Option<&Store>,
) -> Result<Option<Expected>, StoreError> {
    let Some(first) = campaign.rules.first() else {
        return Ok(None);
    };
    let scatters: Vec<f64> = states.iter().filter_map(scatter_of).collect();
    let measured = !scatters.is_empty();
    let scatter = crate::measure::mean(&scatters).unwrap_or(DEFAULT_SCATTER);
    let sum = |of: &dyn Fn(usize, crate::model::precision::Precision) -> usize| {
        let rules = campaign.rules.iter().enumerate();
        rules.map(|(point, rule)| of(point, rule.precision)).sum()
    };
    let lengths = match store {
        Some(store) if measured => lengths(campaign, store, first.precision)?,
        _ => Vec::new(),
    };
    Ok(Some(Expected {
        points: campaign.rules.len(),
        settled: states
            .iter()
            .filter(|state| state.decision.verdict != Verdict::Open)
            .count(),
        at_least: sum(&|_, rule| rule.at_least.min(rule.at_most)),
        at_most: sum(&|_, rule| rule.at_most),
        seeds: sum(&|point, rule| seeds_of(point, rule, states, scatter).1),
        scatter,
        measured,
        lengths,
    }))
}

/// The cost of runs of other lengths. The scatter between runs has a part that does not depend on
/// their length, and one that falls with the number of independent samples of a run:
/// ```text
/// s² = b² + σ² τ/n
/// ```
fn lengths(
    campaign: &Campaign,
    store: &Store,
    rule: crate::model::precision::Precision,
) -> Result<Vec<Length>, StoreError> {
    let mut points: HashMap<_, Vec<(f64, f64, f64)>> = HashMap::new();
    for run in store.point_runs()? {
        if let (Some(mean), Some(steady), Some(discard)) =
            (run.viscosity, run.steadiness, run.discard)
            && run.samples > 0
        {
            let within = steady.variance * steady.correlation / run.samples as f64;
            let of_point = points.entry(identity(&run.params)).or_default();
            of_point.push((mean, within, discard));
        }
    }
    let strain = campaign.protocol.strain;
    // Not limited by the allowed number: runs of different lengths are compared.
    let rule = crate::model::precision::Precision {
        at_most: MAX_SEEDS,
        ..rule
    };
    let mut lengths: Vec<(f64, usize, f64)> = LENGTHS
        .iter()
        .map(|factor| (factor * strain, 0, 0.0))
        .collect();
    for runs in points.values().filter(|runs| runs.len() > 2) {
        let part = |of: fn(&(f64, f64, f64)) -> f64| -> f64 {
            runs.iter().map(of).sum::<f64>() / runs.len() as f64
        };
        let (mean, within, discard) = (part(|r| r.0), part(|r| r.1), part(|r| r.2));
        let squares: f64 = runs.iter().map(|run| (run.0 - mean).powi(2)).sum();
        let between = (squares / (runs.len() as f64 - 1.0) - within).max(0.0);
        for (length, seeds, work) in &mut lengths {
            if *length <= discard {
                *work = f64::INFINITY;
                continue;
            }
            let variance = between + within * (strain - discard) / (*length - discard);
            let needed = rule.foreseen(variance.sqrt() / mean.abs());
            *seeds += needed;
            *work += needed as f64 * *length;
        }
    }
    let asked = lengths
        .iter()
        .find(|(length, ..)| *length == strain)
        .map_or(0.0, |l| l.2);
    if asked <= 0.0 {
        return Ok(Vec::new());
    }
    Ok(lengths
        .into_iter()
        .filter(|(.., work)| work.is_finite())
        .map(|(strain, seeds, work)| Length {
            strain,
            seeds,
            work: work / asked,
        })
        .collect())
}

/// Runs of a store that this build has measured on this machine.
pub(super) fn measured(store: &Store) -> Result<Vec<Record>, StoreError> {
    Ok(store
        .measured_runs()?
        .into_iter()
        .map(|(params, steps, cpu_s)| Record {
            params,
            steps,
            cpu_s,
        })
        .collect())
}
