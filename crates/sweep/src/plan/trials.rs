//! What is tried within seconds before a campaign: whether its densest starts can be made, and the
//! time of a step.

use crate::model::case::Case;
use crate::model::spaces::{AnySimulation, try_start};
use crate::near_field_cache as tables;
use crate::system::clock::Clock;
use crate::text::format::significant;
use sd_core::Params;
use sd_core::model::Sizes;
use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

/// Maximum wall time of all starts together.
const STARTS_TIME: Duration = Duration::from_secs(6);
/// Maximum wall time of all short runs together.
const RUNS_TIME: Duration = Duration::from_secs(4);
/// Maximum number of short runs.
const MAX_RUNS: usize = 8;
/// Strain after which a layer has formed its contacts.
pub(super) const CONTACTS: f64 = 0.5;

/// Does something for each item on all cores and returns what was sent about each of them in time;
/// what takes longer is abandoned. `work` gets the time at which it should end.
fn in_time<T, R>(
    items: Vec<T>,
    time: Duration,
    work: impl Fn(&T, Instant, &dyn Fn(R)) + Send + Sync + 'static,
) -> Vec<(T, Vec<R>)>
where
    T: Clone + Send + Sync + 'static,
    R: Send + 'static,
{
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = threads.min(items.len());
    let rounds = u32::try_from(items.len().div_ceil(threads.max(1))).unwrap_or(u32::MAX);
    let end = Instant::now() + time;
    let shared = Arc::new((items.clone(), AtomicUsize::new(0), work));
    let (send, received) = mpsc::channel();
    for _ in 0..threads {
        let (shared, send) = (Arc::clone(&shared), send.clone());
        std::thread::spawn(move || {
            let (items, next, work) = &*shared;
            while Instant::now() < end {
                let at = next.fetch_add(1, Ordering::Relaxed);
                let Some(item) = items.get(at) else { return };
                let until = (Instant::now() + time * 4 / (5 * rounds)).min(end);
                // After the deadline nobody receives it.
                work(item, until, &|result| drop(send.send((at, result))));
            }
        });
    }
    drop(send);
    let mut results: Vec<(T, Vec<R>)> = items.into_iter().map(|item| (item, Vec::new())).collect();
    while let Ok((at, result)) =
        received.recv_timeout(end.saturating_duration_since(Instant::now()))
    {
        results[at].1.push(result);
    }
    results
}

/// A short run.
pub(super) struct ShortRun {
    pub(super) case: Case,
    /// CPU seconds of a step, or why none was timed.
    pub(super) step_s: Result<f64, String>,
    /// The strain it has reached.
    pub(super) strain: f64,
}

/// Makes a short run of each case, of which the second half of the steps is timed. Of too many, the
/// last get no run.
pub(super) fn short_runs(mut cases: Vec<Case>) -> Vec<ShortRun> {
    cases.truncate(MAX_RUNS);
    let runs = in_time(cases, RUNS_TIME, |case, until, tell| {
        let make = || -> Result<(), sd_core::Error> {
            let ratios = tables::ratios(std::iter::once(&case.params))?;
            let tables = tables::make(&ratios, |_| {})?;
            let mut run = AnySimulation::new(&case.params, case.seed, &tables)?;
            // The first step allocates memory.
            run.step()?;
            let mut before = None;
            while run.steps() < case.steps && Instant::now() < until {
                let clock = Clock::of_thread();
                // Runs keep the state before every step.
                before.replace(run.snapshot());
                run.step()?;
                tell(Ok((clock.cpu_s(), run.strain())));
            }
            drop(before);
            Ok(())
        };
        if let Err(error) = make() {
            tell(Err(error.to_string()));
        }
    });
    runs.into_iter()
        .map(|(case, told)| {
            let strain = told.iter().rev().find_map(|step| step.as_ref().ok());
            let strain = strain.map_or(0.0, |(_, strain)| *strain);
            let times: Vec<f64> = told.iter().flatten().map(|(time, _)| *time).collect();
            let second = &times[times.len() / 2..];
            let step_s = match told.into_iter().find_map(Result::err) {
                _ if !second.is_empty() => Ok(second.iter().sum::<f64>() / second.len() as f64),
                Some(reason) => Err(reason),
                None => Err("no step was completed in the available time".to_owned()),
            };
            ShortRun {
                strain: if times.len() as u64 + 1 < case.steps {
                    strain
                } else {
                    f64::INFINITY
                },
                case,
                step_s,
            }
        })
        .collect()
}

/// The fraction that the spheres with their roughness cover, which tells how hard a start is.
pub(super) fn covered(params: &Params) -> f64 {
    let grown = 1.0 + 0.5 * params.roughness;
    match params.volume_fraction {
        Some(volume_fraction) => volume_fraction * grown.powi(3),
        None => params.area_fraction * grown.powi(2),
    }
}

/// The parameters that the start of a seed depends on.
fn of_start(params: &Params) -> ([u64; 6], Option<String>) {
    let numbers = [
        params.spheres as u64,
        params.area_fraction.to_bits(),
        params.volume_fraction.unwrap_or(0.0).to_bits(),
        params.roughness.to_bits(),
        params.size_ratio.to_bits(),
        params.large_fraction.to_bits(),
    ];
    (numbers, params.sizes.as_ref().map(Sizes::to_string))
}

/// Makes a start for every point, the hardest to pack first. Returns warnings, and whether the runs
/// of some parameters cannot start.
pub(super) fn starts<'c>(
    cases: impl Iterator<Item = &'c Case>,
) -> (Vec<String>, impl Fn(&Params) -> bool) {
    let mut known = HashSet::new();
    let mut cases: Vec<Case> = cases
        .filter(|case| case.params.start.is_none() && known.insert(of_start(&case.params)))
        .cloned()
        .collect();
    cases.sort_by(|a, b| covered(&b.params).total_cmp(&covered(&a.params)));
    let (mut warnings, mut failed) = (Vec::new(), HashSet::new());
    for (case, told) in in_time(cases, STARTS_TIME, |case, _, tell| {
        tell(try_start(&case.params, case.seed).map_err(|error| error.to_string()));
    }) {
        let p = &case.params;
        match told.into_iter().next() {
            Some(Ok(())) => {}
            Some(Err(reason)) => {
                failed.insert(of_start(p));
                warnings.push(reason);
            }
            None => warnings.push(format!(
                "no start of {} spheres at {} was found within {} s: they may be too dense to start",
                p.spheres,
                match p.volume_fraction {
                    Some(volume_fraction) => format!("volume fraction {volume_fraction}"),
                    None => format!("area fraction {}", p.area_fraction),
                },
                significant(STARTS_TIME.as_secs_f64(), 2)
            )),
        }
    }
    (warnings, move |params: &Params| {
        failed.contains(&of_start(params))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    fn case(params: Params, steps: u64) -> Case {
        Case {
            params,
            seed: 1,
            steps,
            sample_stride: 1,
        }
    }

    #[test]
    fn only_a_layer_too_dense_to_start_is_reported() {
        let dense = Params {
            area_fraction: 0.84,
            spheres: 20,
            roughness: 0.07,
            ..params()
        };
        let cases = [params(), dense.clone(), params()].map(|params| case(params, 10));
        let (warnings, failed) = starts(cases.iter());
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].contains("20 spheres at area fraction 0.84"));
        assert!(failed(&dense) && !failed(&params()));
    }

    #[test]
    fn short_runs_are_timed_and_those_without_a_start_say_why() {
        let dense = Params {
            area_fraction: 0.84,
            spheres: 20,
            roughness: 0.07,
            ..params()
        };
        let runs = short_runs(vec![case(params(), 20), case(dense, 20)]);
        let step_s = *runs[0].step_s.as_ref().unwrap();
        assert!((1e-6..1.0).contains(&step_s), "{step_s}");
        assert_eq!(runs[0].strain, f64::INFINITY, "all its steps were made");
        assert!(runs[1].step_s.is_err());
    }

    #[test]
    fn what_takes_too_long_is_abandoned() {
        let begun = Instant::now();
        let time = Duration::from_millis(200);
        let results = in_time(vec![0_u64, 60], time, |seconds, _, tell| {
            tell("begun");
            std::thread::sleep(Duration::from_secs(*seconds));
            tell("ended");
        });
        assert!(begun.elapsed() < Duration::from_secs(30));
        assert_eq!(results[0].1, ["begun", "ended"]);
    }
}
