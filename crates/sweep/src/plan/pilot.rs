//! Short runs that measure the cost of a step: long enough for contacts to form, if time permits.

use super::costs::{Costs, NEAR, Record, distance, values};
use crate::model::case::{Case, step_cost};
use crate::model::spaces::AnySimulation;
use crate::near_field_cache;
use crate::system::clock::Clock;
use crate::system::lock;
use sd_core::{Error, NearFields, Params};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Maximum wall time of all of them together.
const PILOT_TIME: Duration = Duration::from_millis(3400);
/// Time after which a run that is within a long step is abandoned.
const PATIENCE: Duration = Duration::from_millis(500);
/// Maximum number of points that are tried.
const MAX_POINTS: usize = 6;
/// Strain after which a layer has formed its contacts.
const LEAD_IN: f64 = 0.5;
/// Maximum fraction of the time until then.
const LEAD_IN_SHARE: f64 = 0.4;
/// Largest step up to that strain, and its largest ratio to the step of the runs.
const LEAD_IN_STEP: f64 = 0.02;
const LEAD_IN_FACTOR: u32 = 4;
/// Minimum number of steps of a run.
const SHORTEST: f64 = 8.0;
/// Minimum number of measured steps, and of preceding steps that allocate memory for them.
const MIN_MEASURED: u32 = 2;

/// The parameters of a short run; its outcome or the reason for its failure; and, where there was
/// no time for contacts to form, the strain from which it was measured.
pub(crate) type Trial = (Params, Result<Record, String>, Option<f64>);

/// Progress of a short run.
#[derive(Debug, Default)]
struct Progress {
    /// Measured steps.
    steps: u32,
    /// CPU seconds of these steps.
    cpu_s: f64,
    /// Start of the current step.
    step_begun: Option<Instant>,
    /// Whether it has ended, or why it failed.
    ended: Option<Result<(), String>>,
    /// The strain from which it is measured, if contacts had no time to form.
    early: Option<f64>,
}

/// A short run: a case, possibly with another seed.
struct ShortRun {
    case: Case,
    seed: u64,
    progress: Mutex<Progress>,
    has_ended: Condvar,
}

/// Makes short runs of points without similar measured runs, those with the most work first.
/// `points` are cases with their multiplicity.
///
/// Near jamming a single step can exceed the available time. Such a step counts with the time it
/// has taken so far, and its thread is abandoned.
pub(crate) fn trials(costs: &Costs, points: &[(&Case, f64)], begun: Instant) -> Vec<Trial> {
    let chosen = choose(costs, points);
    if chosen.is_empty() {
        return Vec::new();
    }
    let threads = std::thread::available_parallelism()
        .map_or(1, std::num::NonZero::get)
        .min(4);
    // Several seeds of a point where the limit allows, as their costs differ.
    let number = chosen.len().max(threads);
    let runs: Vec<Arc<ShortRun>> = (0..number)
        .zip(1..)
        .map(|(at, seed)| {
            let seed = if number > chosen.len() { seed } else { 1 };
            Arc::new(ShortRun::new(chosen[at % chosen.len()], seed))
        })
        .collect();
    let rounds = u32::try_from(number.div_ceil(threads)).unwrap_or(u32::MAX);
    let share = PILOT_TIME.saturating_sub(begun.elapsed()) / rounds;
    for round in runs.chunks(threads) {
        let deadline = Instant::now() + share + PATIENCE / rounds;
        for run in round {
            let run = Arc::clone(run);
            std::thread::spawn(move || {
                let ended = run.make(share);
                run.progress().ended = Some(ended);
                run.has_ended.notify_all();
            });
        }
        for run in round {
            run.wait(deadline);
        }
    }
    runs.iter().map(|run| run.trial()).collect()
}

impl ShortRun {
    fn new(case: &Case, seed: u64) -> Self {
        Self {
            case: case.clone(),
            seed,
            progress: Mutex::default(),
            has_ended: Condvar::new(),
        }
    }

    /// Waits until it has ended or time is up.
    fn wait(&self, deadline: Instant) {
        let time = deadline.saturating_duration_since(Instant::now());
        let is_running = |progress: &mut Progress| progress.ended.is_none();
        let waited = self
            .has_ended
            .wait_timeout_while(self.progress(), time, is_running);
        drop(waited);
    }

    fn progress(&self) -> MutexGuard<'_, Progress> {
        lock(&self.progress)
    }

    /// Its result so far.
    fn trial(&self) -> Trial {
        let progress = self.progress();
        let current_step = progress.step_begun.map(|begun| begun.elapsed());
        let steps = progress.steps + u32::from(current_step.is_some());
        let record = Record {
            params: self.case.params.clone(),
            steps: steps.into(),
            cpu_s: progress.cpu_s + current_step.unwrap_or_default().as_secs_f64(),
        };
        let outcome = match &progress.ended {
            Some(Err(reason)) => Err(reason.clone()),
            _ if steps == 0 => Err("no step was completed in the available time".into()),
            _ => Ok(record),
        };
        (self.case.params.clone(), outcome, progress.early)
    }

    /// Makes the run in about that time.
    fn make(&self, time: Duration) -> Result<(), String> {
        let (case, begun) = (&self.case, Instant::now());
        if Duration::from_secs_f64(SHORTEST * step_cost(&case.params)) > time {
            return Err(format!(
                "a step takes about {} s, which is too long",
                crate::text::format::significant(step_cost(&case.params), 2)
            ));
        }
        let ratios =
            near_field_cache::ratios(std::iter::once(&case.params)).map_err(|e| e.to_string())?;
        // Tables are computed in a fraction of a second where they are not in the cache.
        let tables = near_field_cache::make(&ratios, |_| {}).map_err(|e| e.to_string())?;
        let lead_in = self.lead_in(&tables, time.mul_f64(LEAD_IN_SHARE));
        let mut layer = lead_in.map_err(|e| e.to_string())?;
        layer.step().map_err(|e| e.to_string())?;
        // From here on steps are those of the case; the lead-in is not measured.
        *self.progress() = Progress {
            early: Some(layer.strain()).filter(|strain| *strain < self.lead_in_strain()),
            ..Progress::default()
        };
        let mut before = None;
        let mut measured = 0;
        while measured < MIN_MEASURED || (begun.elapsed() < time && layer.steps() < case.steps) {
            let step = self.measured(|| {
                // A run also keeps the state before every step.
                before.replace(layer.snapshot());
                layer.step()
            });
            match step {
                Err(error) if measured == 0 => return Err(error.to_string()),
                Err(_) => break,
                Ok(_) => measured += 1,
            }
        }
        Ok(())
    }

    /// Makes a step and records its time.
    fn measured<T>(&self, step: impl FnOnce() -> T) -> T {
        self.progress().step_begun = Some(Instant::now());
        let clock = Clock::of_thread();
        let done = step();
        let mut progress = self.progress();
        progress.step_begun = None;
        progress.steps += 1;
        progress.cpu_s += clock.cpu_s();
        done
    }

    /// The strain after which its layer has its contacts.
    fn lead_in_strain(&self) -> f64 {
        LEAD_IN.min(0.25 * self.case.strain())
    }

    /// A layer with contacts, sheared up to [`LEAD_IN`] if time permits, that continues with the
    /// steps of the case.
    fn lead_in(&self, tables: &NearFields, time: Duration) -> Result<AnySimulation, Error> {
        let begun = Instant::now();
        let (case, seed) = (&self.case, self.seed);
        let params = &case.params;
        let is_short = |factor: &u32| f64::from(*factor) * params.time_step <= LEAD_IN_STEP;
        let factor = (1..=LEAD_IN_FACTOR).rev().find(is_short).unwrap_or(1);
        let strain = self.lead_in_strain();
        let coarse = Params {
            time_step: f64::from(factor) * params.time_step,
            ..params.clone()
        };
        let mut layer = AnySimulation::new(&coarse, seed, tables)?;
        while layer.strain() < strain && begun.elapsed() < time {
            if self.measured(|| layer.step()).is_err() {
                // The lead-in steps are too long for this layer.
                return AnySimulation::new(params, seed, tables);
            }
        }
        let mut there = layer.snapshot();
        // Strain is counted in steps.
        *there.steps_mut() *= u64::from(factor);
        AnySimulation::from_snapshot(params, there, tables)
    }
}

/// The points to try: repeatedly the point with the most work among those unlike all known or
/// chosen ones.
fn choose<'c>(costs: &Costs, points: &[(&'c Case, f64)]) -> Vec<&'c Case> {
    let mut open: Vec<(&Case, f64, Vec<_>)> = points
        .iter()
        .filter(|(case, _)| costs.step(&case.params).distance > NEAR)
        .map(|(case, number)| (*case, case.cost() * number, values(&case.params)))
        .collect();
    let mut chosen = Vec::new();
    while chosen.len() < MAX_POINTS {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    #[test]
    fn step_that_does_not_end_counts_for_the_time_it_has_taken() {
        let case = Case {
            params: params(),
            seed: 1,
            steps: 10,
            sample_stride: 1,
        };
        let run = ShortRun::new(&case, 1);
        assert!(run.trial().1.is_err(), "nothing is known yet");
        run.progress().step_begun = Instant::now().checked_sub(Duration::from_secs(7));
        let record = run.trial().1.unwrap();
        assert_eq!(record.steps, 1);
        assert!(record.cpu_s >= 7.0);
        // Its thread is abandoned.
        run.wait(Instant::now());
        assert_eq!(run.measured(|| 3), 3);
        let progress = run.progress();
        assert_eq!((progress.steps, progress.step_begun), (1, None));
    }

    #[test]
    fn what_is_measured_before_contacts_have_formed_is_said_to_be() {
        let case = Case {
            params: params(),
            seed: 1,
            steps: 1000,
            sample_stride: 1,
        };
        for (time, is_early) in [(Duration::ZERO, true), (Duration::from_hours(1), false)] {
            let run = ShortRun::new(&case, 1);
            let layer = run.lead_in(&NearFields::default(), time).unwrap();
            assert_eq!(layer.strain() < run.lead_in_strain(), is_early);
        }
        let case = Case { steps: 2, ..case };
        let run = ShortRun::new(&case, 1);
        run.make(Duration::from_hours(1)).unwrap();
        assert_eq!(run.trial().2, None);
    }
}
