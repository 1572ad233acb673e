//! The plan of a campaign: runs, estimated time on this machine, and size on disk.

mod cache;
pub(crate) mod costs;
mod memory;
mod pilot;
mod scatter;
mod starts;
mod work;

use crate::data::Value;
use crate::model::axes::{AXES, Axis, identity};
use crate::model::campaign::Campaign;
use crate::model::case::Case;
use crate::model::protocol::PlannedSegment;
use crate::store::{CASE_BYTES, SAMPLE_BYTES, Store, StoreError};
use crate::text::format::{count, significant};
use costs::{COMPARABLE, Costs};
use pilot::{Trial, trials};
use scatter::Sum;
use sd_core::Params;
use sd_core::model::Words as _;
use serde::{Serialize, Serializer};
use serde_json::json;
use std::collections::{HashMap, HashSet};
use std::time::Instant;
use work::Work;

/// CPU seconds of the program apart from its cases: start, store and report; measured.
const PROGRAM_S: f64 = 0.15;
/// The plan of a campaign.
#[derive(Debug, Serialize)]
pub struct Plan {
    /// Name of the campaign.
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
    /// Runs computed in parallel.
    pub(crate) workers: usize,
    /// Kinds of runs.
    pub(crate) kinds: Vec<Kind>,
    /// Estimated CPU seconds of the remaining work.
    pub(crate) computing_time_s: f64,
    /// Estimated wall time with that many workers.
    pub(crate) elapsed_s: f64,
    /// Size of the finished store.
    pub(crate) disk_bytes: f64,
    /// Memory with that many workers at the largest kind, in bytes.
    pub(crate) memory_bytes: f64,
    /// Warnings: start layers that could not be made.
    pub(crate) warnings: Vec<String>,
}

/// An axis and its values.
pub(crate) type Values = (&'static str, Vec<serde_json::Value>);

/// Axes as one JSON object.
fn as_object<S: Serializer>(axes: &[Values], s: S) -> Result<S::Ok, S::Error> {
    s.collect_map(axes.iter().map(|(name, values)| (name, values)))
}

/// The source of the cost of a kind of runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Source {
    /// Runs measured on this machine.
    Runs,
    /// A short run made now.
    Trial,
    /// Runs of other parameters.
    Rough,
}

/// Runs of one kind.
#[derive(Debug, Serialize)]
pub(crate) struct Kind {
    /// Number of spheres.
    pub(crate) spheres: usize,
    /// Word of the hydrodynamics.
    pub(crate) hydrodynamics: &'static str,
    /// Word of the contact scheme.
    pub(crate) contact: &'static str,
    /// Word of the tangential law.
    pub(crate) tangential: &'static str,
    /// A step, in strain.
    pub(crate) time_step: f64,
    /// Steps of a run.
    pub(crate) steps: u64,
    /// Number of runs to compute.
    pub(crate) cases: usize,
    /// CPU seconds per step, mean over its points.
    pub(crate) step_s: f64,
    /// Half width of its 95 % interval, from the scatter of similar measured runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) step_ci95_s: Option<f64>,
    /// CPU seconds of all its runs.
    pub(crate) computing_time_s: f64,
    /// Memory of one of its runs, in bytes.
    pub(crate) memory_bytes: f64,
    /// Whether the time was measured here.
    pub(crate) measured: bool,
    /// Source of the estimate, for its least certain point.
    pub(crate) source: Source,
    /// Why a short run that was needed could not be made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) reason: Option<String>,
}

/// Memory in bytes of a program that computes this many cases of a campaign in parallel.
pub(crate) fn memory_bytes(campaign: &Campaign, workers: usize) -> f64 {
    let runs = campaign
        .cases
        .iter()
        .map(|(_, case)| memory::run_bytes(&case.params));
    memory::resident_bytes() + workers as f64 * runs.fold(0.0, f64::max)
}

/// Plans a campaign with an empty store. Writes nothing.
///
/// # Errors
/// None where there is no store.
pub fn plan(campaign: &Campaign, workers: usize) -> Result<Plan, StoreError> {
    make(campaign, workers, false, None)
}

/// Plans the runs of a campaign that a store lacks; with frames of every run where a `trajectory`
/// is kept.
pub(crate) fn make(
    campaign: &Campaign,
    workers: usize,
    trajectory: bool,
    store: Option<&Store>,
) -> Result<Plan, StoreError> {
    let resident = memory::resident_bytes();
    let mut costs = Costs::of_this_machine();
    if let Some(store) = store {
        for record in work::measured(store)? {
            costs.learn(&record);
        }
    }
    let work = Work::of(campaign, store)?;
    let open = work.points.iter().filter(|point| point.open > 0.0);
    let starts = starts::tried(open.map(|point| (&point.case.params, point.case.seed)));
    let cannot_start = |params: &Params| {
        let of = starts.iter().find(|tried| tried.is_of(params));
        of.is_some_and(starts::StartTrial::has_failed)
    };
    let points: Vec<(&Case, f64)> = work
        .points
        .iter()
        .filter(|point| !cannot_start(&point.case.params))
        .map(|point| (point.case, point.runs()))
        .collect();
    let trials = trials(&costs, &points, Instant::now());
    let tried = trials
        .iter()
        .filter_map(|(_, outcome, _)| outcome.as_ref().ok());
    tried.for_each(|record| costs.learn(record));
    let reasons: Vec<(&Params, &String)> = trials
        .iter()
        .filter_map(|(params, outcome, _)| Some((params, outcome.as_ref().err()?)))
        .collect();
    let kinds = kinds(&work, &costs, &trials, &reasons);
    let program_s = if kinds.is_empty() { 0.0 } else { PROGRAM_S };
    let computing_time_s = kinds
        .iter()
        .fold(program_s, |sum, kind| sum + kind.computing_time_s);
    let longest = work
        .points
        .iter()
        .map(|point| costs.step(&point.case.params).seconds * point.case.steps as f64)
        .fold(0.0, f64::max);
    let samples = (campaign.protocol.strain / campaign.protocol.sample_every).ceil();
    let frames = if trajectory { samples } else { 0.0 };
    let largest = kinds
        .iter()
        .map(|kind| kind.memory_bytes)
        .fold(0.0, f64::max);
    let frame_bytes = |point: &work::Point<'_>| memory::frame_bytes(&point.case.params);
    let frames_bytes: f64 = work
        .points
        .iter()
        .map(|point| point.all * frames * frame_bytes(point))
        .sum();
    let all = work.points.iter().map(|point| point.all).sum::<f64>();
    Ok(Plan {
        campaign: campaign.name.clone(),
        cases: count(all),
        ended: work.ended,
        folded: campaign.folded,
        points: work.points.len(),
        precision: work.expected,
        axes: axes(campaign),
        segments: campaign
            .protocol
            .segments
            .iter()
            .map(PlannedSegment::words)
            .collect(),
        workers,
        computing_time_s,
        elapsed_s: (computing_time_s / workers as f64).max(longest.min(computing_time_s)),
        disk_bytes: all * (f64::from(CASE_BYTES) + samples * f64::from(SAMPLE_BYTES))
            + frames_bytes,
        memory_bytes: resident + workers as f64 * largest,
        warnings: starts
            .iter()
            .filter_map(starts::StartTrial::warning)
            .chain(measured_early(&trials))
            .collect(),
        kinds,
    })
}

/// A warning that steps were measured before contacts form, when they cost less than later.
fn measured_early(trials: &[Trial]) -> Option<String> {
    let measured = trials.iter().filter(|(_, outcome, _)| outcome.is_ok());
    let strain = measured.filter_map(|trial| trial.2).reduce(f64::min)?;
    Some(format!(
        "steps were measured at a strain of {} only, where contacts are still few: dense runs may take several times as long",
        significant(strain, 2)
    ))
}

/// The word of a choice.
fn word(params: &Params, key: &str) -> &'static str {
    match Axis::of_key(key).map(|axis| axis.value(params)) {
        Some(Value::Word(word)) => word,
        _ => "",
    }
}

/// The kinds of runs there are to compute, the cheapest first.
fn kinds(
    work: &Work<'_>,
    costs: &Costs,
    trials: &[Trial],
    reasons: &[(&Params, &String)],
) -> Vec<Kind> {
    let tried: HashSet<_> = trials
        .iter()
        .filter(|(_, outcome, _)| outcome.is_ok())
        .map(|(params, ..)| identity(params))
        .collect();
    let mut kinds: Vec<Kind> = Vec::new();
    let mut sums: Vec<Sum> = Vec::new();
    let mut place_of = HashMap::new();
    for point in &work.points {
        let (p, steps) = (&point.case.params, point.case.steps);
        let (contact, tangential) = (word(p, "contact"), word(p, "tangential"));
        let hydrodynamics = p.hydrodynamics.word();
        let place = *place_of
            .entry((
                p.spheres,
                hydrodynamics,
                contact,
                tangential,
                p.time_step.to_bits(),
                steps,
            ))
            .or_insert_with(|| {
                kinds.push(Kind {
                    spheres: p.spheres,
                    hydrodynamics,
                    contact,
                    tangential,
                    time_step: p.time_step,
                    steps,
                    cases: 0,
                    step_s: 0.0,
                    step_ci95_s: None,
                    computing_time_s: 0.0,
                    memory_bytes: 0.0,
                    measured: true,
                    source: Source::Runs,
                    reason: None,
                });
                sums.push(Sum::default());
                kinds.len() - 1
            });
        let (kind, cost) = (&mut kinds[place], costs.step(p));
        kind.cases += count(point.open);
        kind.computing_time_s += cost.seconds * steps as f64 * point.runs();
        sums[place].add(cost, steps as f64, point.runs());
        kind.memory_bytes = kind.memory_bytes.max(memory::run_bytes(p));
        kind.source = match kind.source {
            _ if cost.distance > COMPARABLE => Source::Rough,
            Source::Runs if tried.contains(&identity(p)) => Source::Trial,
            source => source,
        };
        kind.measured = kind.source != Source::Rough;
        if let Some((_, reason)) = reasons.iter().find(|(of, _)| *of == p) {
            kind.reason = Some((*reason).clone());
        }
    }
    for (kind, sum) in kinds.iter_mut().zip(sums) {
        if sum.steps > 0.0 {
            kind.step_s = kind.computing_time_s / sum.steps;
            let half = sum.half().filter(|_| kind.measured);
            kind.step_ci95_s = half.map(|half| half / sum.steps);
        }
    }
    kinds.retain(|kind| kind.cases > 0);
    kinds.sort_by(|a, b| a.step_s.total_cmp(&b.step_s));
    kinds
}

/// Axes with all their values in the order of first use, without those that have no effect on these
/// cases.
fn axes(campaign: &Campaign) -> Vec<Values> {
    let params = || campaign.cases.iter().map(|(_, case)| &case.params);
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
