//! `sweep plan`.

use super::Output;
use crate::axes::{AXES, Axis, Value};
use crate::campaign::Campaign;
use crate::case::Case;
use crate::cli::Error;
use crate::exit;
use crate::format::{bytes, duration, significant};
use crate::tables;
use sd_core::model::Words as _;
use sd_core::{NearFields, Params, Simulation, memory_bytes};
use serde::{Serialize, Serializer};
use std::collections::{HashMap, HashSet};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Time all calibration together may take.
const BUDGET: Duration = Duration::from_millis(1200);
/// Time one kind of run is calibrated for at most.
const SHARE: Duration = Duration::from_millis(300);
/// Bytes of a stored sample, index included; measured.
const SAMPLE_BYTES: f64 = 145.0;
/// Bytes of a case without its samples; measured.
const CASE_BYTES: f64 = 1200.0;

/// Say what a campaign would do: its axes, its runs, how long they take here, how much they store
///
/// Writes nothing. Times come from a few steps of each kind of run on this machine; a layer just started has fewer contacts
/// than a sheared one, so dense campaigns take longer than said.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep plan sweeps/quickstart.toml\n  sweep plan sweeps/quickstart.toml --json"
)]
pub(crate) struct Arguments {
    /// The campaign file
    campaign: PathBuf,
    /// Cases computed at a time [default: the cores of the machine]
    #[arg(
        long,
        short,
        value_name = "N",
        visible_alias = "jobs",
        visible_short_alias = 'j'
    )]
    workers: Option<NonZeroUsize>,
}

/// What a campaign would do.
#[derive(Debug, Serialize)]
pub struct Plan {
    /// Name of the campaign.
    campaign: String,
    /// Number of runs.
    cases: usize,
    /// Points: runs that differ only in their seed are one.
    points: usize,
    /// Axes and their values.
    #[serde(serialize_with = "as_object")]
    axes: Vec<Values>,
    /// Runs computed at a time.
    workers: usize,
    /// Kinds of runs, that cost the same.
    kinds: Vec<Kind>,
    /// Computing time of all runs, in seconds; `null` if nothing could be calibrated.
    computing_time_s: Option<f64>,
    /// Time from start to end with that many workers.
    elapsed_s: Option<f64>,
    /// Size of the finished store.
    disk_bytes: f64,
    /// Memory with that many workers at the largest kind, in bytes, estimated.
    memory_bytes: f64,
}

/// An axis and its values.
type Values = (&'static str, Vec<serde_json::Value>);

/// Axes as one JSON object.
fn as_object<S: Serializer>(axes: &[Values], s: S) -> Result<S::Ok, S::Error> {
    s.collect_map(axes.iter().map(|(name, values)| (name, values)))
}

/// Runs that cost the same.
#[derive(Debug, Serialize)]
struct Kind {
    /// Number of spheres.
    spheres: usize,
    /// Word of the hydrodynamics.
    hydrodynamics: &'static str,
    /// Word of the contact scheme.
    contact: &'static str,
    /// Word of the tangential law.
    tangential: &'static str,
    /// Steps of a run.
    steps: u64,
    /// Number of runs.
    cases: usize,
    /// Cost of one of its runs over that of the cheapest.
    weight: f64,
    /// Seconds of a step, measured or estimated.
    step_s: Option<f64>,
    /// Memory of one of its runs, in bytes, estimated.
    memory_bytes: f64,
    /// Whether the time was measured here.
    measured: bool,
    /// Why they could not be measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    /// Its densest case, which is calibrated.
    #[serde(skip)]
    example: Case,
}

impl Kind {
    /// Seconds of a run.
    fn run_s(&self) -> Option<f64> {
        Some(self.step_s? * self.steps as f64)
    }
}

/// Writes the plan.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let campaign = Campaign::read(&arguments.campaign)?;
    let workers = arguments
        .workers
        .or_else(|| std::thread::available_parallelism().ok())
        .map_or(1, NonZeroUsize::get);
    let plan = plan(&campaign, workers);
    if output.json {
        output.json(&plan)?;
    } else {
        write_text(&plan, output)?;
    }
    Ok(exit::DONE)
}

/// Seconds of this machine for a unit of [`Case::cost`], if they can be measured, and bytes of memory.
pub(super) fn forecast(campaign: &Campaign, workers: usize) -> (Option<f64>, f64) {
    let plan = plan(campaign, workers);
    let cost: f64 = campaign.cases.iter().map(|(_, case)| case.cost()).sum();
    let seconds = plan.computing_time_s.map(|seconds| seconds / cost);
    (seconds, plan.memory_bytes)
}

/// Makes the plan: measures a few steps of each kind of run, and writes nothing.
pub fn plan(campaign: &Campaign, workers: usize) -> Plan {
    let mut kinds = kinds(campaign);
    calibrate(&mut kinds);
    let computing_time_s = kinds
        .iter()
        .map(|kind| kind.run_s().map(|s| s * kind.cases as f64))
        .sum::<Option<f64>>();
    let longest = kinds.iter().filter_map(Kind::run_s).fold(0.0, f64::max);
    let samples = (campaign.protocol.strain / campaign.protocol.sample_every).ceil();
    let cases = campaign.cases.len();
    let points = 1 + campaign
        .cases
        .windows(2)
        .filter(|pair| pair[0].1.params != pair[1].1.params)
        .count();
    Plan {
        campaign: campaign.name.clone(),
        cases,
        points,
        axes: axes(campaign),
        workers,
        computing_time_s,
        elapsed_s: computing_time_s.map(|time| (time / workers as f64).max(longest)),
        disk_bytes: cases as f64 * (CASE_BYTES + samples * SAMPLE_BYTES),
        memory_bytes: workers as f64 * kinds.iter().map(|k| k.memory_bytes).fold(0.0, f64::max),
        kinds,
    }
}

/// The word of a choice.
fn word(params: &Params, key: &str) -> &'static str {
    match Axis::of_key(key).map(|axis| axis.value(params)) {
        Some(Value::Word(word)) => word,
        _ => "",
    }
}

/// The kinds of runs of a campaign, the cheapest first.
fn kinds(campaign: &Campaign) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = Vec::new();
    let mut place_of = HashMap::new();
    for (_, case) in &campaign.cases {
        let p = &case.params;
        let contact = word(p, "contact");
        let tangential = word(p, "tangential");
        let hydrodynamics = p.hydrodynamics.word();
        let place = *place_of
            .entry((p.spheres, hydrodynamics, contact, tangential, case.steps))
            .or_insert_with(|| {
                kinds.push(Kind {
                    spheres: p.spheres,
                    hydrodynamics,
                    contact,
                    tangential,
                    steps: case.steps,
                    cases: 0,
                    weight: 1.0,
                    step_s: None,
                    memory_bytes: memory_bytes(p),
                    measured: false,
                    reason: None,
                    example: case.clone(),
                });
                kinds.len() - 1
            });
        let kind = &mut kinds[place];
        kind.cases += 1;
        if p.area_fraction > kind.example.params.area_fraction {
            kind.example = case.clone();
        }
    }
    kinds.sort_by(|a, b| a.example.cost().total_cmp(&b.example.cost()));
    let cheapest = kinds.first().map_or(1.0, |kind| kind.example.cost());
    for kind in &mut kinds {
        kind.weight = kind.example.cost() / cheapest;
    }
    kinds
}

/// Measures kinds from the cheapest on while there is time; estimates the others from the nearest measured one.
fn calibrate(kinds: &mut [Kind]) {
    let begun = Instant::now();
    for kind in kinds.iter_mut() {
        let left = BUDGET.saturating_sub(begun.elapsed());
        // What will not get through its first steps in time is estimated.
        if left.is_zero() || Duration::from_secs_f64(5.0 * kind.example.step_cost()) > left * 2 {
            continue;
        }
        let Ok(ratios) = tables::ratios(std::iter::once(&kind.example.params)) else {
            continue;
        };
        // Tables still to be solved would take longer than there is.
        let tables = tables::cached(&ratios);
        if !ratios.iter().all(|ratio| tables.contains(*ratio)) {
            continue;
        }
        match measure(&kind.example, &tables, left.min(SHARE)) {
            Ok(seconds) => {
                kind.step_s = Some(seconds);
                kind.measured = true;
            }
            Err(error) => kind.reason = Some(error.to_string()),
        }
    }
    let measured: Vec<(&str, f64, f64)> = kinds
        .iter()
        .filter_map(|k| Some((k.hydrodynamics, k.example.step_cost(), k.step_s?)))
        .collect();
    for kind in kinds.iter_mut().filter(|kind| kind.step_s.is_none()) {
        let cost = kind.example.step_cost();
        // The most expensive one measured is the nearest; of the same hydrodynamics if there is one.
        let nearest = measured
            .iter()
            .filter(|(hydrodynamics, ..)| *hydrodynamics == kind.hydrodynamics)
            .chain(&measured)
            .max_by(|a, b| {
                let same = |k: &&(&str, f64, f64)| k.0 == kind.hydrodynamics;
                same(a).cmp(&same(b)).then(a.1.total_cmp(&b.1))
            });
        kind.step_s = nearest.map(|(_, known, seconds)| seconds * cost / known);
    }
}

/// Seconds of a step: the mean over as many as there is time for, at most 40.
fn measure(case: &Case, tables: &NearFields, time: Duration) -> Result<f64, sd_core::Error> {
    let mut simulation = Simulation::new(&case.params, case.seed, tables)?;
    // The first step pays for tables and memory that the others find ready.
    simulation.step()?;
    let begun = Instant::now();
    let mut steps = 0_u32;
    while steps == 0 || (steps < 40 && begun.elapsed() < time) {
        simulation.step()?;
        steps += 1;
    }
    Ok(begun.elapsed().as_secs_f64() / f64::from(steps))
}

/// Axes with all their values in the order of their first use, without those that say nothing of these cases.
fn axes(campaign: &Campaign) -> Vec<Values> {
    let params = || campaign.cases.iter().map(|(_, case)| &case.params);
    let different = |all: &mut dyn Iterator<Item = serde_json::Value>| {
        let mut seen = HashSet::new();
        all.filter(|value| seen.insert(value.to_string())).collect()
    };
    let seeds = different(&mut campaign.cases.iter().map(|(_, case)| case.seed.into()));
    AXES.iter()
        .filter(|axis| axis.matters(params()))
        .map(|axis| {
            let mut values = params().map(|p| serde_json::json!(axis.value(p)));
            (axis.key, different(&mut values))
        })
        .chain([("seeds", seeds)])
        .collect()
}

/// Writes the plan as tables.
fn write_text(plan: &Plan, output: &mut Output<'_>) -> Result<(), Error> {
    let mut axes = crate::report::table(output.width);
    axes.set_header(["axis", "values", ""]);
    for (name, values) in &plan.axes {
        let words: Vec<String> = values
            .iter()
            .map(|value| {
                value
                    .as_str()
                    .map_or_else(|| value.to_string(), str::to_owned)
            })
            .collect();
        let shown = if words.len() > 12 {
            format!("{}, … {}", words[..10].join(", "), words[words.len() - 1])
        } else {
            words.join(", ")
        };
        axes.add_row([(*name).to_owned(), words.len().to_string(), shown]);
    }
    let out = &mut *output.out;
    writeln!(
        out,
        "{}: {} runs at {} points",
        plan.campaign, plan.cases, plan.points
    )?;
    writeln!(out, "{axes}")?;
    let mut kinds = crate::report::table(output.width);
    kinds.set_header([
        "spheres",
        "hydrodynamics",
        "contact",
        "steps",
        "runs",
        "weight",
        "step",
        "run",
        "memory",
    ]);
    for kind in &plan.kinds {
        let time = |seconds: f64, mark: &str| format!("{mark}{}", duration(seconds));
        let mark = if kind.measured { "" } else { "≈ " };
        kinds.add_row([
            kind.spheres.to_string(),
            kind.hydrodynamics.into(),
            match kind.tangential {
                "roll-slip" => kind.contact.into(),
                other => format!("{}, {other}", kind.contact),
            },
            kind.steps.to_string(),
            kind.cases.to_string(),
            significant(kind.weight, 3),
            kind.step_s.map_or_else(
                || "–".into(),
                |s| format!("{mark}{} ms", significant(1e3 * s, 3)),
            ),
            kind.run_s().map_or_else(|| "–".into(), |s| time(s, mark)),
            bytes(kind.memory_bytes),
        ]);
    }
    writeln!(out, "{kinds}")?;
    for kind in &plan.kinds {
        if let Some(reason) = &kind.reason {
            writeln!(
                out,
                "{} spheres could not be calibrated: {reason}",
                kind.spheres
            )?;
        }
    }
    match (plan.computing_time_s, plan.elapsed_s) {
        (Some(computing), Some(elapsed)) => writeln!(
            out,
            "about {} of computing, {} with {} at a time; about {} on disk, {} of memory",
            duration(computing),
            duration(elapsed),
            plan.workers,
            bytes(plan.disk_bytes),
            bytes(plan.memory_bytes)
        )?,
        _ => writeln!(
            out,
            "the time could not be estimated; about {} on disk, {} of memory",
            bytes(plan.disk_bytes),
            bytes(plan.memory_bytes)
        )?,
    }
    Ok(())
}
