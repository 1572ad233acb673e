//! Short runs that tell what a step costs: long enough for contacts, where there is time for that.

use super::{Costs, NEAR, Record, distance, values};
use crate::case::Case;
use crate::clock::Clock;
use crate::tables;
use sd_core::{Error, NearFields, Params, Simulation};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Time by the wall that all of them together take at most.
const PILOT_TIME: Duration = Duration::from_millis(3400);
/// Points that are tried at most.
const MOST_POINTS: usize = 6;
/// Strain after which a layer has its contacts.
const LEAD_IN: f64 = 0.5;
/// Share of the time that may go by until then.
const LEAD_IN_SHARE: f64 = 0.4;
/// The longest step on the way there, a strain, and by how much it may be longer than that of the runs.
const LEAD_IN_STEP: f64 = 0.02;
const LEAD_IN_FACTOR: f64 = 4.0;
/// Steps that the shortest run takes.
const SHORTEST: f64 = 8.0;
/// Steps measured at least, and those before them that pay for memory the others find ready.
const LEAST_MEASURED: u32 = 2;

/// A point of which a short run was made.
#[derive(Debug, Clone)]
pub(crate) struct Trial {
    /// Its parameters.
    pub(crate) params: Params,
    /// What came of it, or why nothing did.
    pub(crate) outcome: Result<Record, String>,
}

/// Makes short runs of points of which no measured run is near: those behind which most of the work is. `points` are cases with
/// the number of their like.
pub(crate) fn trials(costs: &Costs, points: &[(&Case, f64)], begun: Instant) -> Vec<Trial> {
    let chosen = choose(costs, points);
    if chosen.is_empty() {
        return Vec::new();
    }
    let threads = std::thread::available_parallelism()
        .map_or(1, std::num::NonZero::get)
        .min(4);
    // Several seeds of a point where there is room, as runs of different seeds cost differently.
    let jobs: Vec<(&Case, u64)> = if chosen.len() < threads {
        let again = chosen.iter().cycle().take(threads);
        (1..).zip(again).map(|(seed, case)| (*case, seed)).collect()
    } else {
        chosen.iter().map(|case| (*case, 1)).collect()
    };
    let rounds = u32::try_from(jobs.len().div_ceil(threads)).unwrap_or(u32::MAX);
    let share = PILOT_TIME.saturating_sub(begun.elapsed()) / rounds;
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..threads.min(jobs.len()) {
            scope.spawn(|| {
                while let Some((case, seed)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let outcome = try_case(case, *seed, share);
                    let trial = Trial {
                        params: case.params.clone(),
                        outcome,
                    };
                    if let Ok(mut done) = done.lock() {
                        done.push(trial);
                    }
                }
            });
        }
    });
    done.into_inner().unwrap_or_default()
}

/// The points to try: again and again the one behind which most of the work is that is not near to any known or chosen one.
fn choose<'c>(costs: &Costs, points: &[(&'c Case, f64)]) -> Vec<&'c Case> {
    let mut open: Vec<(&Case, f64, Vec<_>)> = points
        .iter()
        .filter(|(case, _)| costs.step(&case.params).distance > NEAR)
        .map(|(case, number)| (*case, case.cost() * number, values(&case.params)))
        .collect();
    let mut chosen = Vec::new();
    while chosen.len() < MOST_POINTS {
        let most = open.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((case, _, of_chosen)) = most.cloned() else {
            break;
        };
        chosen.push(case);
        open.retain(|(_, _, of_case)| {
            distance(of_case, &of_chosen).is_none_or(|distance| distance > NEAR)
        });
    }
    chosen
}

/// What a run of this case would cost, from its beginning.
fn try_case(case: &Case, seed: u64, time: Duration) -> Result<Record, String> {
    let begun = Instant::now();
    if Duration::from_secs_f64(SHORTEST * case.step_cost()) > time {
        return Err(format!(
            "a step takes about {} s, which is too long for one",
            crate::format::significant(case.step_cost(), 2)
        ));
    }
    let ratios = tables::ratios(std::iter::once(&case.params)).map_err(|e| e.to_string())?;
    // Solved in a fraction of a second where they are not in the cache.
    let tables = tables::make(&ratios, |_| {}).map_err(|e| e.to_string())?;
    let mut layer =
        lead_in(case, seed, &tables, time.mul_f64(LEAD_IN_SHARE)).map_err(|e| e.to_string())?;
    layer.step().map_err(|e| e.to_string())?;
    let clock = Clock::of_thread();
    let mut steps = 0;
    let mut before = None;
    while steps < LEAST_MEASURED || (begun.elapsed() < time && layer.steps() < case.steps) {
        // As in a run, which keeps the state before every step.
        before.replace(layer.snapshot());
        if let Err(error) = layer.step() {
            if steps == 0 {
                return Err(error.to_string());
            }
            break;
        }
        steps += 1;
    }
    Ok(Record {
        params: case.params.clone(),
        steps: steps.into(),
        cpu_s: clock.cpu_s(),
    })
}

/// A layer with contacts, as near to [`LEAD_IN`] as there is time for, which is sheared on in the steps of the case.
fn lead_in(
    case: &Case,
    seed: u64,
    tables: &NearFields,
    time: Duration,
) -> Result<Simulation, Error> {
    let begun = Instant::now();
    let params = &case.params;
    let factor = (LEAD_IN_STEP / params.time_step)
        .floor()
        .clamp(1.0, LEAD_IN_FACTOR);
    let strain = LEAD_IN.min(0.25 * case.strain());
    let coarse = Params {
        time_step: factor * params.time_step,
        ..params.clone()
    };
    let mut layer = Simulation::new(&coarse, seed, tables)?;
    while layer.strain() < strain && begun.elapsed() < time {
        if layer.step().is_err() {
            // Such steps are too long for it.
            return Simulation::new(params, seed, tables);
        }
    }
    let mut there = layer.snapshot();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 1 to 4"
    )]
    let factor = factor as u64;
    // Strain is counted in steps.
    there.steps *= factor;
    Simulation::from_snapshot(params, there, tables)
}
