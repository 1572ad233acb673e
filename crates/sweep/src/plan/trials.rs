//! Trials within seconds before a campaign: whether its starts can be made, and the time of a step.

use super::{Costs, Source, class, fraction, grouped};
use crate::model::case::Case;
use crate::model::spaces::AnySimulation;
use crate::near_field_cache as tables;
use crate::system::clock::Clock;
use crate::system::lock;
use crate::text::format::significant;
use sd_core::Params;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Maximum wall time of all trials.
const TIME: Duration = Duration::from_secs(8);
/// Time after which none begins.
const LAST_BEGIN: Duration = Duration::from_secs(5);
/// Wall time of the steps of all trials.
const STEPS_TIME: Duration = Duration::from_secs(3);
/// Strain after which a layer has formed its contacts.
const CONTACTS: f64 = 0.5;

/// What a trial has reached.
#[derive(Default, Clone)]
struct Trial {
    /// What it does now: nothing yet, a start, a step.
    doing: &'static str,
    times: Vec<f64>,
    /// The strain after the last; infinite once all steps of the run were made.
    strain: f64,
    error: Option<String>,
}

/// Tries a case of each class, fraction and roughness: makes its start and, where the time of a
/// step is unknown, some steps, of which the second half counts. Returns warnings.
pub(super) fn time<'c>(cases: impl Iterator<Item = &'c Case>, costs: &mut Costs) -> Vec<String> {
    let cases = ranked(cases).into_iter().cloned();
    let cases: Vec<_> = cases
        .map(|case| (!costs.knows(&case.params), case))
        .collect();
    let (mut warnings, mut least) = (Vec::new(), f64::INFINITY);
    for ((is_timed, case), trial) in cases.iter().zip(run(&cases)) {
        let p = &case.params;
        let what = format!("{} spheres at a fraction of {}", p.spheres, fraction(p));
        let second = &trial.times[trial.times.len() / 2..];
        if !second.is_empty() {
            let mean = second.iter().sum::<f64>() / second.len() as f64;
            costs.learn(p, Source::Trial, 1.0, mean);
            if !p.at_rest && !p.has_free_rate() {
                least = least.min(trial.strain);
            }
        } else if let Some(error) = trial.error {
            warnings.push(error);
        } else if trial.doing == "start" || (trial.doing == "step" && *is_timed) {
            let (doing, limit) = (trial.doing, TIME.as_secs());
            warnings.push(format!(
                "no {doing} of {what} was made within {limit} s: they may be too dense, or too many"
            ));
        }
    }
    if least < CONTACTS {
        warnings.push(format!(
            "steps were timed up to a strain of {} only, where contacts are still few: dense runs may take several times as long",
            significant(least, 2)
        ));
    }
    warnings
}

/// A case of each class, fraction and roughness, the densest of every class first.
fn ranked<'c>(cases: impl Iterator<Item = &'c Case>) -> Vec<&'c Case> {
    let mut ranked = Vec::new();
    for class in grouped(cases, |case| class(&case.params)) {
        let of_start = |case: &&Case| {
            let p = &case.params;
            [fraction(p), p.roughness, p.size_ratio, p.large_fraction].map(f64::to_bits)
        };
        let starts = grouped(class.into_iter(), of_start);
        let mut ones: Vec<&Case> = starts.into_iter().map(|cases| cases[0]).collect();
        ones.sort_by(|a, b| covered(&b.params).total_cmp(&covered(&a.params)));
        ranked.extend(ones.into_iter().enumerate());
    }
    ranked.sort_by_key(|(rank, _)| *rank);
    ranked.into_iter().map(|(_, case)| case).collect()
}

/// The fraction that the spheres with their roughness cover, which tells how hard a start is.
fn covered(params: &Params) -> f64 {
    let dimensions = if params.volume_fraction.is_some() {
        3
    } else {
        2
    };
    fraction(params) * (1.0 + 0.5 * params.roughness).powi(dimensions)
}

/// Makes trials on all cores; returns what each reached in time. What takes longer is abandoned.
fn run(cases: &[(bool, Case)]) -> Vec<Trial> {
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = threads.min(cases.len()).max(1);
    let rounds = u32::try_from(cases.len().div_ceil(threads)).unwrap_or(u32::MAX);
    let trials = Arc::new(Trials {
        cases: cases.to_vec(),
        next: AtomicUsize::new(0),
        reached: Mutex::new(vec![Trial::default(); cases.len()]),
        begun: Instant::now(),
        share: STEPS_TIME / rounds.max(1),
    });
    let spawn = |_| {
        let trials = Arc::clone(&trials);
        std::thread::spawn(move || trials.work())
    };
    let threads: Vec<_> = (0..threads).map(spawn).collect();
    while trials.begun.elapsed() < TIME && threads.iter().any(|thread| !thread.is_finished()) {
        std::thread::sleep(Duration::from_millis(5));
    }
    std::mem::take(&mut *lock(&trials.reached))
}

struct Trials {
    /// Each with whether its steps are timed.
    cases: Vec<(bool, Case)>,
    next: AtomicUsize,
    reached: Mutex<Vec<Trial>>,
    begun: Instant,
    share: Duration,
}

impl Trials {
    fn work(&self) {
        while self.begun.elapsed() < LAST_BEGIN {
            let at = self.next.fetch_add(1, Ordering::Relaxed);
            if at >= self.cases.len() {
                return;
            }
            if let Err(error) = self.attempt(at) {
                self.tell(at, |trial| trial.error = Some(error.to_string()));
            }
        }
    }

    /// Of an abandoned trial nothing is kept.
    fn tell(&self, at: usize, change: impl FnOnce(&mut Trial)) {
        lock(&self.reached).get_mut(at).map(change);
    }

    fn attempt(&self, at: usize) -> Result<(), sd_core::Error> {
        let (is_timed, case) = &self.cases[at];
        let ratios = tables::ratios(std::iter::once(&case.params))?;
        let tables = tables::make(&ratios, |_| {})?;
        self.tell(at, |trial| trial.doing = "start");
        let mut run = AnySimulation::new(&case.params, case.seed, &tables)?;
        self.tell(at, |trial| trial.doing = "step");
        if !is_timed {
            return Ok(());
        }
        // The first step allocates memory.
        run.step()?;
        let (begun, mut before) = (Instant::now(), None);
        while run.steps() < case.steps && begun.elapsed() < self.share {
            let clock = Clock::of_thread();
            // Runs keep the state before every step.
            before.replace(run.snapshot());
            if run.steps().is_multiple_of(case.sample_stride) {
                run.step()?;
            } else {
                run.step_unmeasured()?;
            }
            let cpu_s = clock.cpu_s();
            let is_last = run.steps() == case.steps;
            let strain = if is_last { f64::INFINITY } else { run.strain() };
            self.tell(at, |trial| {
                trial.times.push(cpu_s);
                trial.strain = strain;
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    #[test]
    fn steps_are_timed_and_only_a_layer_too_dense_to_start_is_reported() {
        let dense = Params {
            area_fraction: 0.84,
            spheres: 20,
            roughness: 0.07,
            ..params()
        };
        let case = |params| Case {
            params,
            seed: 1,
            steps: 20,
            sample_stride: 1,
        };
        let cases = [params(), dense.clone(), params()].map(case);
        let mut costs = Costs::default();
        let warnings = time(cases.iter(), &mut costs);
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].contains("20 spheres at area fraction 0.84"));
        assert!(costs.knows(&params()) && !costs.knows(&dense));
        let (step_s, source) = costs.step(&params());
        assert_eq!(source, Source::Trial);
        assert!((1e-6..1.0).contains(&step_s), "{step_s}");
    }
}
