//! The plan of a campaign: runs, estimated time on this machine, memory, and size on disk.
//!
//! The time of a step is measured: by runs of the store that this build has computed on this
//! machine, or else by a short run. It is measured for each class of runs and each fraction of
//! spheres, as its ratio to the rough estimate `step_cost`, which knows how the methods scale with
//! the number of spheres. Between measured fractions the ratio is interpolated.

mod memory;
mod trials;
mod work;

use crate::data::Value;
use crate::model::axes::{AXES, Axis};
use crate::model::campaign::Campaign;
use crate::model::case::{Case, step_cost};
use crate::model::protocol::PlannedSegment;
use crate::store::{CASE_BYTES, SAMPLE_BYTES, Store, StoreError};
use crate::text::format::{count, significant};
use sd_core::model::Words as _;
use sd_core::{Method, Params};
use serde::{Serialize, Serializer};
use serde_json::json;
use std::collections::HashSet;
use work::Work;

/// The plan of a campaign.
#[derive(Debug, Serialize)]
pub struct Plan {
    pub(crate) campaign: String,
    /// Number of runs; where a precision is requested, the expected number.
    pub(crate) cases: usize,
    /// Of these, runs that have ended.
    pub(crate) ended: usize,
    /// Further runs of the file that are identical to one of these: they differ in the friction at
    /// Γ = 0, or in the shear rate without friction, which have no effect.
    pub(crate) folded: usize,
    /// Points: runs that differ only in their seed are one.
    pub(crate) points: usize,
    /// Points with a requested precision.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) precision: Option<work::Expected>,
    /// Axes and their values.
    #[serde(serialize_with = "as_object")]
    pub(crate) axes: Vec<Values>,
    /// Segments of a run, in words.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) segments: Vec<String>,
    pub(crate) workers: usize,
    /// Kinds of runs that are still to be computed, the cheapest step first.
    pub(crate) kinds: Vec<Kind>,
    /// Estimated CPU seconds of the remaining work.
    pub(crate) computing_time_s: f64,
    /// Estimated wall time with that many workers.
    pub(crate) elapsed_s: f64,
    /// Size of the finished store.
    pub(crate) disk_bytes: f64,
    /// Memory with that many workers at the largest kind, in bytes.
    pub(crate) memory_bytes: f64,
    /// Warnings: starts that could not be made, estimates from few steps.
    pub(crate) warnings: Vec<String>,
}

/// An axis and its values.
pub(crate) type Values = (&'static str, Vec<serde_json::Value>);

/// Axes as one JSON object.
fn as_object<S: Serializer>(axes: &[Values], s: S) -> Result<S::Ok, S::Error> {
    s.collect_map(axes.iter().map(|(name, values)| (name, values)))
}

/// The source of the time of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Source {
    /// Runs of the store, computed by this build on this machine.
    Runs,
    /// A short run made now.
    Trial,
    /// The rough estimate, scaled by measured runs of other classes.
    Rough,
}

/// Runs that differ only in numbers that affect the cost of a step little.
#[derive(Debug, Serialize)]
pub(crate) struct Kind {
    pub(crate) spheres: usize,
    pub(crate) hydrodynamics: &'static str,
    pub(crate) contact: &'static str,
    pub(crate) tangential: &'static str,
    /// A step, in strain.
    pub(crate) time_step: f64,
    pub(crate) steps: u64,
    pub(crate) cases: usize,
    /// CPU seconds per step, mean over its points.
    pub(crate) step_s: f64,
    pub(crate) computing_time_s: f64,
    /// Memory of one of its runs, in bytes.
    pub(crate) memory_bytes: f64,
    pub(crate) source: Source,
}

/// Runs whose steps cost the same multiple of [`step_cost`]: of one method, one choice of
/// hydrodynamics and contacts, one space, and numbers of spheres between two powers of two.
#[derive(Debug, Clone, PartialEq)]
struct Class {
    method: Method,
    words: [&'static str; 3],
    is_suspension: bool,
    size: u32,
}

impl Class {
    fn of(params: &Params) -> Self {
        Self {
            method: Method::of(params),
            words: words(params),
            is_suspension: params.volume_fraction.is_some(),
            size: params.spheres.max(1).ilog2(),
        }
    }
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

/// Area fraction of a layer, volume fraction of a suspension.
fn fraction(params: &Params) -> f64 {
    params.volume_fraction.unwrap_or(params.area_fraction)
}

/// Steps of one class and fraction: their CPU seconds, and their rough estimate.
#[derive(Debug)]
struct Measured {
    class: Class,
    fraction: f64,
    source: Source,
    cpu_s: f64,
    rough_s: f64,
}

impl Measured {
    fn log_ratio(&self) -> f64 {
        (self.cpu_s / self.rough_s).ln()
    }
}

#[derive(Debug, Default)]
struct Costs(Vec<Measured>);

impl Costs {
    fn learn(&mut self, params: &Params, source: Source, steps: f64, cpu_s: f64) {
        let (class, fraction) = (Class::of(params), fraction(params));
        let rough_s = steps * step_cost(params);
        if rough_s <= 0.0 || cpu_s <= 0.0 {
            return;
        }
        let is_same = |known: &&mut Measured| known.class == class && known.fraction == fraction;
        match self.0.iter_mut().find(is_same) {
            Some(known) => {
                known.cpu_s += cpu_s;
                known.rough_s += rough_s;
            }
            None => self.0.push(Measured {
                class,
                fraction,
                source,
                cpu_s,
                rough_s,
            }),
        }
    }

    /// Whether steps of this class and fraction were measured.
    fn knows(&self, params: &Params) -> bool {
        let (class, fraction) = (Class::of(params), fraction(params));
        let is_same = |known: &Measured| known.class == class && known.fraction == fraction;
        self.0.iter().any(is_same)
    }

    /// CPU seconds of a step, and how they are known.
    fn step(&self, params: &Params) -> (f64, Source) {
        let (class, fraction) = (Class::of(params), fraction(params));
        let own = || self.0.iter().filter(|known| known.class == class);
        let by_fraction = |a: &&Measured, b: &&Measured| a.fraction.total_cmp(&b.fraction);
        let below = own().filter(|known| known.fraction <= fraction);
        let above = own().filter(|known| known.fraction >= fraction);
        let (log_ratio, source) = match (below.max_by(by_fraction), above.min_by(by_fraction)) {
            (Some(a), Some(b)) if a.fraction < b.fraction => {
                let weight = (fraction - a.fraction) / (b.fraction - a.fraction);
                let log_ratio = a.log_ratio() + weight * (b.log_ratio() - a.log_ratio());
                (log_ratio, a.source.max(b.source))
            }
            (Some(known), _) | (None, Some(known)) => (known.log_ratio(), known.source),
            (None, None) => {
                let sum: f64 = self.0.iter().map(Measured::log_ratio).sum();
                (sum / self.0.len().max(1) as f64, Source::Rough)
            }
        };
        (log_ratio.exp() * step_cost(params), source)
    }
}

/// Memory in bytes of a program that computes this many cases of a campaign in parallel.
pub(crate) fn memory_bytes(campaign: &Campaign, workers: usize) -> f64 {
    let runs = campaign
        .cases
        .iter()
        .map(|(_, case)| memory::run_bytes(&case.params));
    memory::resident_bytes() + workers as f64 * runs.fold(0.0, f64::max)
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
    let resident = memory::resident_bytes();
    let mut costs = Costs::default();
    for (params, steps, cpu_s) in store.map_or(Ok(Vec::new()), Store::measured_runs)? {
        costs.learn(&params, Source::Runs, steps as f64, cpu_s);
    }
    let work = Work::of(campaign, store)?;
    let open = || work.points.iter().filter(|point| point.open > 0.0);
    let (mut warnings, failed) = trials::starts(open().map(|point| point.case));
    let is_unknown = |case: &&Case| !costs.knows(&case.params) && !failed(&case.params);
    let unknown = open().map(|point| point.case).filter(is_unknown);
    let runs = trials::short_runs(to_time(unknown));
    let mut least = f64::INFINITY;
    for run in runs {
        match run.step_s {
            Ok(step_s) => {
                costs.learn(&run.case.params, Source::Trial, 1.0, step_s);
                least = least.min(run.strain);
            }
            Err(reason) => warnings.push(format!(
                "could not time a short run of {} spheres: {reason}",
                run.case.params.spheres
            )),
        }
    }
    if least < trials::CONTACTS {
        warnings.push(format!(
            "steps were timed up to a strain of {} only, where contacts are still few: dense runs may take several times as long",
            significant(least, 2)
        ));
    }
    let kinds = kinds(&work, &costs);
    let computing_time_s: f64 = kinds.iter().map(|kind| kind.computing_time_s).sum();
    let longest = open()
        .map(|point| costs.step(&point.case.params).0 * point.case.steps as f64)
        .fold(0.0, f64::max);
    let largest = kinds.iter().map(|kind| kind.memory_bytes);
    let samples = (campaign.protocol.strain / campaign.protocol.sample_every).ceil();
    let of_run = |case: &Case| {
        let frame = if trajectory {
            memory::frame_bytes(&case.params)
        } else {
            0.0
        };
        f64::from(CASE_BYTES) + samples * (f64::from(SAMPLE_BYTES) + frame)
    };
    Ok(Plan {
        campaign: campaign.name.clone(),
        cases: count(work.points.iter().map(|point| point.all).sum()),
        ended: work.ended,
        folded: campaign.folded,
        points: work.points.len(),
        axes: axes(campaign, &work.points),
        segments: campaign
            .protocol
            .segments
            .iter()
            .map(PlannedSegment::words)
            .collect(),
        workers,
        computing_time_s,
        elapsed_s: (computing_time_s / workers as f64).max(longest.min(computing_time_s)),
        disk_bytes: work
            .points
            .iter()
            .map(|point| point.all * of_run(point.case))
            .sum(),
        memory_bytes: resident + workers as f64 * largest.fold(0.0, f64::max),
        precision: work.expected,
        warnings,
        kinds,
    })
}

/// A case of each class and fraction, those first that tell most: the densest and the most dilute
/// of every class.
fn to_time<'c>(cases: impl Iterator<Item = &'c Case>) -> Vec<Case> {
    let mut ranked = Vec::new();
    for class in grouped(cases, |case| Class::of(&case.params)) {
        let fractions = grouped(class.into_iter(), |case| fraction(&case.params).to_bits());
        let mut ones: Vec<&Case> = fractions.into_iter().map(|cases| cases[0]).collect();
        ones.sort_by(|a, b| fraction(&b.params).total_cmp(&fraction(&a.params)));
        if ones.len() > 2 {
            let most_dilute = ones.remove(ones.len() - 1);
            ones.insert(1, most_dilute);
        }
        ranked.extend(ones.into_iter().enumerate());
    }
    ranked.sort_by_key(|(rank, _)| *rank);
    ranked.into_iter().map(|(_, case)| case.clone()).collect()
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
fn kinds(work: &Work<'_>, costs: &Costs) -> Vec<Kind> {
    let open = work.points.iter().filter(|point| count(point.open) > 0);
    let groups = grouped(open, |point| {
        let p = &point.case.params;
        (words(p), p.spheres, p.time_step.to_bits(), point.case.steps)
    });
    let kind = |points: Vec<&work::Point<'_>>| {
        let (p, steps) = (&points[0].case.params, points[0].case.steps);
        let [hydrodynamics, contact, tangential] = words(p);
        let known = points.iter().map(|point| costs.step(&point.case.params));
        let (step_s, sources): (Vec<f64>, Vec<Source>) = known.unzip();
        let left = |(point, step_s): (&&work::Point<'_>, f64)| step_s * point.runs();
        let computed = points.iter().zip(step_s.iter().copied()).map(left);
        let computing_time_s = steps as f64 * computed.sum::<f64>();
        let steps_left = steps as f64 * points.iter().map(|point| point.runs()).sum::<f64>();
        Kind {
            spheres: p.spheres,
            hydrodynamics,
            contact,
            tangential,
            time_step: p.time_step,
            steps,
            cases: points.iter().map(|point| count(point.open)).sum(),
            step_s: computing_time_s / steps_left.max(f64::MIN_POSITIVE),
            computing_time_s,
            memory_bytes: memory::run_bytes(p),
            source: sources.into_iter().max().unwrap_or(Source::Rough),
        }
    };
    let mut kinds: Vec<Kind> = groups.into_iter().map(kind).collect();
    kinds.sort_by(|a, b| a.step_s.total_cmp(&b.step_s));
    kinds
}

/// Axes with all their values in the order of first use, without those that have no effect on these
/// cases.
fn axes(campaign: &Campaign, points: &[work::Point<'_>]) -> Vec<Values> {
    let params = || points.iter().map(|point| &point.case.params);
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
        // Twice as dear at a larger fraction, and between them the geometric mean.
        let at = |area_fraction| Params {
            area_fraction,
            ..with(40)
        };
        let first = with(40).area_fraction;
        costs.learn(&at(first + 0.1), Source::Trial, 1000.0, 6.0);
        let ratio = |params: &Params| costs.step(params).0 / step_cost(params);
        let [low, middle, high, beyond] =
            [0.0, 0.05, 0.1, 0.2].map(|more| ratio(&at(first + more)));
        assert!((middle / (low * high).sqrt() - 1.0).abs() < 1e-12);
        assert_eq!(high, beyond);
        assert_eq!(costs.step(&at(first + 0.05)).1, Source::Trial);
        assert!(costs.knows(&at(first)) && !costs.knows(&at(first + 0.05)));
    }
}
