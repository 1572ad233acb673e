//! The plan of a campaign: runs, estimated time on this machine, memory, and size on disk.
//!
//! Time is that of a step, times the steps, times the runs. A step is timed for each class of runs
//! and each fraction of spheres: by runs of the store that this machine has computed, or else by a
//! trial, which also shows whether the spheres can be placed at all. `step_cost`, which knows how
//! the methods scale with the number of spheres, carries it over to similar runs.

mod memory;
mod precision;
mod trials;

pub use memory::beyond_memory;

use crate::data::Value;
use crate::model::axes::{AXES, Axis, Identity, identity};
use crate::model::campaign::Campaign;
use crate::model::case::{Case, step_cost};
use crate::model::protocol::PlannedSegment;
use crate::store::{CASE_BYTES, SAMPLE_BYTES, Store, StoreError};
use crate::text::format::count;
use sd_core::model::Keywords as _;
use sd_core::{Method, Params, memory_bytes};
use serde::{Serialize, Serializer};
use serde_json::json;
use std::collections::{HashMap, HashSet};
use std::num::NonZeroUsize;

/// Bytes of the program, the cache of its store and a report; measured.
const PROGRAM_BYTES: f64 = 13.0e6;
/// Bytes of a thread apart from the layer it computes: stack, samples, checkpoints; measured.
const THREAD_BYTES: f64 = 1.0e6;

/// The plan of a campaign.
#[derive(Debug, Serialize)]
pub struct Plan {
    pub(crate) campaign: String,
    /// Number of runs; where a precision is requested, the expected number.
    pub(crate) cases: usize,
    /// Of these, runs that have ended.
    pub(crate) ended: usize,
    /// Further runs of the file that are identical to one of these: they differ in the friction at
    /// Γ = 0, or in its laws or the shear rate without friction, which have no effect.
    pub(crate) folded: usize,
    /// Points: runs that differ only in their seed are one.
    pub(crate) points: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) precision: Option<precision::Expected>,
    #[serde(serialize_with = "as_object")]
    pub(crate) axes: Vec<Values>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) segments: Vec<String>,
    pub(crate) workers: usize,
    /// Threads that `sweep run` gives each run. Times are those of one.
    pub(crate) threads_per_run: usize,
    /// Kinds of runs that are still to be computed, the cheapest step first.
    pub(crate) kinds: Vec<RunKind>,
    pub(crate) computing_time_s: f64,
    /// Estimated wall time with that many workers of one thread each.
    pub(crate) elapsed_s: f64,
    pub(crate) disk_bytes: f64,
    pub(crate) memory_bytes: f64,
    /// Starts that could not be made, steps that could not be timed.
    pub(crate) warnings: Vec<String>,
}

type Values = (&'static str, Vec<serde_json::Value>);

fn as_object<S: Serializer>(axes: &[Values], s: S) -> Result<S::Ok, S::Error> {
    s.collect_map(axes.iter().map(|(name, values)| (name, values)))
}

/// The source of the time of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Source {
    /// Runs of the store, computed by this build on this machine.
    Runs,
    /// A trial made now.
    Trial,
    /// The rough estimate, scaled by measured runs of other classes.
    Rough,
}

/// Runs that differ only in numbers that affect the cost of a step little.
#[derive(Debug, Serialize)]
pub(crate) struct RunKind {
    pub(crate) spheres: usize,
    pub(crate) hydrodynamics: &'static str,
    pub(crate) contact: &'static str,
    pub(crate) tangential: &'static str,
    pub(crate) time_step: f64,
    pub(crate) steps: u64,
    pub(crate) cases: usize,
    pub(crate) step_s: f64,
    pub(crate) computing_time_s: f64,
    pub(crate) memory_bytes: f64,
    pub(crate) source: Source,
}

#[derive(Debug)]
struct PlannedPoint<'c> {
    case: &'c Case,
    all: f64,
    /// Runs that have not ended.
    open: f64,
    /// These, less the parts of them that are done.
    left: f64,
}

/// Runs whose steps cost the same multiple of [`step_cost`] at one fraction: of one method, one
/// choice of hydrodynamics and contacts, one space, and numbers of spheres between two powers of
/// two.
fn class(params: &Params) -> String {
    let (method, space) = (Method::of(params), params.volume_fraction.is_some());
    let size = params.spheres.max(1).ilog2();
    format!("{method:?} {space} {size} {:?}", words(params))
}

/// The words of hydrodynamics, contact scheme and tangential law.
fn words(params: &Params) -> [&'static str; 3] {
    let word = |key: &str| match Axis::of_key(key).map(|axis| axis.value(params)) {
        Some(Value::Word(word)) => word,
        _ => "",
    };
    [
        params.hydrodynamics.word(),
        word("contact"),
        word("tangential"),
    ]
}

fn fraction(params: &Params) -> f64 {
    params.volume_fraction.unwrap_or(params.area_fraction)
}

/// Timed steps of each class and fraction: their source, CPU seconds and rough estimate.
#[derive(Debug, Default)]
struct Costs(Vec<(String, f64, Source, [f64; 2])>);

impl Costs {
    fn learn(&mut self, params: &Params, source: Source, steps: f64, cpu_s: f64) {
        let (class, fraction) = (class(params), fraction(params));
        let rough_s = steps * step_cost(params);
        if rough_s <= 0.0 || cpu_s <= 0.0 {
            return;
        }
        let mut all = self.0.iter_mut();
        match all.find(|known| known.0 == class && known.1 == fraction) {
            Some((.., sums)) => *sums = [sums[0] + cpu_s, sums[1] + rough_s],
            None => self.0.push((class, fraction, source, [cpu_s, rough_s])),
        }
    }

    /// The fraction nearest to that of a run at which its class was timed, and the times over the
    /// estimate.
    fn nearest(&self, params: &Params) -> Option<(f64, Source, f64)> {
        let (class, fraction) = (class(params), fraction(params));
        let own = self.0.iter().filter(|known| known.0 == class);
        let distance = |known: f64| (known - fraction).abs();
        let nearest = own.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))?;
        let (_, fraction, source, [cpu_s, rough_s]) = nearest;
        Some((*fraction, *source, cpu_s / rough_s))
    }

    /// Whether steps of this class and fraction were timed.
    fn knows(&self, params: &Params) -> bool {
        (self.nearest(params)).is_some_and(|(known, ..)| known == fraction(params))
    }

    /// CPU seconds of a step, and how they are known: from the nearest fraction of its class, or
    /// from all other classes.
    fn step(&self, params: &Params) -> (f64, Source) {
        let (ratio, source) = if let Some((_, source, ratio)) = self.nearest(params) {
            (ratio, source)
        } else {
            let logs = self
                .0
                .iter()
                .map(|(.., [cpu_s, rough_s])| (cpu_s / rough_s).ln());
            let mean = logs.sum::<f64>() / self.0.len().max(1) as f64;
            (mean.exp(), Source::Rough)
        };
        (ratio * step_cost(params), source)
    }
}

/// Threads of each case unless said otherwise: one, or more where there are fewer cases than
/// workers.
pub(crate) fn threads_per_case(cores: usize, workers: usize, cases: usize) -> usize {
    let in_parallel = workers.min(cases).max(1);
    (workers.min(cores) / in_parallel).max(1)
}

/// Plans the runs of a campaign that a store lacks; with frames of every run where a `trajectory`
/// is kept. Writes nothing.
///
/// # Errors
/// An I/O or SQLite error of the store.
pub fn plan(
    campaign: &Campaign,
    workers: usize,
    trajectory: bool,
    store: Option<&Store>,
) -> Result<Plan, StoreError> {
    let mut costs = Costs::default();
    for (params, steps, cpu_s) in store.map_or(Ok(Vec::new()), Store::measured_runs)? {
        costs.learn(&params, Source::Runs, steps as f64, cpu_s);
    }
    let (mut points, place_of) = points(campaign, store)?;
    let ended = count(points.iter().map(|point| point.all - point.open).sum());
    let precision = precision::foresee(campaign, store, |case, seeds| {
        if let Some(place) = place_of.get(&identity(&case.params)) {
            let point = &mut points[*place];
            point.all += seeds;
            point.open += seeds;
            point.left += seeds;
        }
    })?;
    let open = || points.iter().filter(|point| point.open > 0.0);
    let mut warnings = trials::time(open().map(|point| point.case), &mut costs);
    warnings.extend(campaign.warning());
    let kinds = kinds(open().filter(|point| count(point.open) > 0), &costs);
    let computing_time_s: f64 = kinds.iter().map(|kind| kind.computing_time_s).sum();
    let longest = open().map(|point| costs.step(&point.case.params).0 * point.case.steps as f64);
    let longest = longest.fold(0.0, f64::max).min(computing_time_s);
    let largest = kinds.iter().map(|kind| kind.memory_bytes);
    let samples = (campaign.protocol.strain / campaign.protocol.sample_every).ceil();
    let frame = |p| f64::from(u8::from(trajectory)) * frame_bytes(p);
    let of_run = |p| f64::from(CASE_BYTES) + samples * (f64::from(SAMPLE_BYTES) + frame(p));
    let disk_bytes = points
        .iter()
        .map(|point| point.all * of_run(&point.case.params));
    let segments = campaign.protocol.segments.iter();
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    Ok(Plan {
        campaign: campaign.name.clone(),
        cases: count(points.iter().map(|point| point.all).sum()),
        ended,
        folded: campaign.folded,
        points: points.len(),
        axes: axes(campaign),
        segments: segments.map(PlannedSegment::words).collect(),
        workers,
        threads_per_run: threads_per_case(cores, workers, campaign.cases.len()),
        computing_time_s,
        elapsed_s: (computing_time_s / workers as f64).max(longest),
        disk_bytes: disk_bytes.sum(),
        memory_bytes: PROGRAM_BYTES + workers as f64 * largest.fold(0.0, f64::max),
        precision,
        warnings,
        kinds,
    })
}

/// The points of a campaign, with the work that a store does not hold, and the place of each.
fn points<'c>(
    campaign: &'c Campaign,
    store: Option<&Store>,
) -> Result<(Vec<PlannedPoint<'c>>, HashMap<Identity, usize>), StoreError> {
    let (mut points, mut place_of) = (Vec::<PlannedPoint<'c>>::new(), HashMap::new());
    let mut enter = |case: &'c Case, all: f64, open: f64, left: f64| {
        // Seeds of a point follow each other, perhaps a million of them.
        let place = match points.last() {
            Some(last) if last.case.params == case.params => points.len() - 1,
            _ => *place_of
                .entry(identity(&case.params))
                .or_insert(points.len()),
        };
        if place == points.len() {
            points.push(PlannedPoint {
                case,
                all: 0.0,
                open: 0.0,
                left: 0.0,
            });
        }
        points[place].all += all;
        points[place].open += open;
        points[place].left += left;
    };
    if let Some(store) = store {
        for work in store.point_work()? {
            // Cases keep the order of the campaign file.
            if let Some((_, case)) = campaign.cases.get(work.position) {
                enter(case, work.runs, work.open, (work.open - work.done).max(0.0));
            }
        }
    } else {
        campaign
            .certain()
            .for_each(|(_, case)| enter(case, 1.0, 1.0, 1.0));
    }
    Ok((points, place_of))
}

/// Items with the same key, in the order of the first of each.
fn grouped<T, K: PartialEq>(items: impl Iterator<Item = T>, key: impl Fn(&T) -> K) -> Vec<Vec<T>> {
    let mut groups: Vec<(K, Vec<T>)> = Vec::new();
    for item in items {
        let own = key(&item);
        match groups.iter_mut().find(|(known, _)| *known == own) {
            Some((_, group)) => group.push(item),
            None => groups.push((own, vec![item])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// The kinds of runs there are to compute, the cheapest step first.
fn kinds<'p>(open: impl Iterator<Item = &'p PlannedPoint<'p>>, costs: &Costs) -> Vec<RunKind> {
    let groups = grouped(open, |point| {
        let p = &point.case.params;
        (words(p), p.spheres, p.time_step.to_bits(), point.case.steps)
    });
    let kind = |points: Vec<&PlannedPoint<'_>>| {
        let (p, steps) = (&points[0].case.params, points[0].case.steps);
        let [hydrodynamics, contact, tangential] = words(p);
        let (mut time_s, mut runs, mut source) = (0.0, 0.0, Source::Runs);
        for point in &points {
            let (step_s, known) = costs.step(&point.case.params);
            time_s += step_s * point.left;
            runs += point.left;
            source = source.max(known);
        }
        RunKind {
            spheres: p.spheres,
            hydrodynamics,
            contact,
            tangential,
            time_step: p.time_step,
            steps,
            cases: points.iter().map(|point| count(point.open)).sum(),
            step_s: time_s / f64::max(runs, f64::MIN_POSITIVE),
            computing_time_s: time_s * steps as f64,
            memory_bytes: memory_bytes(p) + THREAD_BYTES,
            source,
        }
    };
    let mut kinds: Vec<RunKind> = groups.into_iter().map(kind).collect();
    kinds.sort_by(|a, b| a.step_s.total_cmp(&b.step_s));
    kinds
}

/// Bytes of a stored frame with one contact for every sphere.
fn frame_bytes(params: &Params) -> f64 {
    let of_space = params.volume_fraction.map_or(76.0, |_| 132.0);
    let radius = f64::from(u8::from(params.is_mixed()) * 4);
    params.spheres as f64 * (of_space + radius)
}

/// Axes with all their values in the order of the file, without those that have no effect on these
/// cases.
fn axes(campaign: &Campaign) -> Vec<Values> {
    let points = campaign.written_points();
    let params = || points.iter().map(AsRef::as_ref);
    let mut seen = HashSet::new();
    let seeds = campaign.cases.iter().map(|(_, case)| case.seed);
    let seeds = seeds.filter(|seed| seen.insert(*seed)).map(Into::into);
    AXES.iter()
        .filter(|axis| axis.matters(params()))
        .map(|axis| {
            let values = axis.distinct(params()).into_iter();
            (axis.key, values.map(|value| json!(value)).collect())
        })
        .chain([("seeds", seeds.collect())])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    #[test]
    fn steps_cost_what_was_measured_and_scale_with_the_spheres_within_a_class() {
        let with = |spheres| Params {
            spheres,
            ..params()
        };
        let mut costs = Costs::default();
        assert_eq!(costs.step(&with(40)).1, Source::Rough);
        assert!((costs.step(&with(40)).0 / step_cost(&with(40)) - 1.0).abs() < 1e-12);
        costs.learn(&with(40), Source::Runs, 1000.0, 2.0);
        costs.learn(&with(40), Source::Runs, 1000.0, 4.0);
        let (step_s, source) = costs.step(&with(40));
        assert_eq!(source, Source::Runs);
        assert!((step_s / 3e-3 - 1.0).abs() < 1e-12, "{step_s}");
        let ratio = step_cost(&with(56)) / step_cost(&with(40));
        let (larger, source) = costs.step(&with(56));
        assert_eq!(source, Source::Runs);
        assert!((larger / step_s / ratio - 1.0).abs() < 1e-12);
        assert_eq!(costs.step(&with(64)).1, Source::Rough);
        // Twice as dear at a larger fraction; others cost what the nearest does.
        let at = |more| Params {
            area_fraction: with(40).area_fraction + more,
            ..with(40)
        };
        costs.learn(&at(0.1), Source::Trial, 1000.0, 6.0);
        let ratio = |more| costs.step(&at(more)).0 / step_cost(&at(more));
        assert!((ratio(0.1) / ratio(0.0) - 2.0).abs() < 1e-12);
        assert_eq!([ratio(0.04), ratio(0.06)], [ratio(0.0), ratio(0.1)]);
        assert_eq!(costs.step(&at(0.06)).1, Source::Trial);
        assert!(costs.knows(&at(0.1)) && !costs.knows(&at(0.05)));
    }
}
