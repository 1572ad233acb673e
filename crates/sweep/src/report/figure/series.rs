//! Runs in time as figures show them: the curves of single runs, and their means over the runs of a
//! point.

use super::{Kind, Trace, refused};
use crate::measure::{Estimate, PointRun};
use crate::model::axes::identity;
use crate::model::protocol::Protocol;
use crate::report::error::ReportError;
use crate::report::points::selected_runs;
use crate::report::selection::Selection;
use crate::store::Store;
use crate::text::format::count;
use sd_core::model::phase;
use sd_core::{Sample, StressComponents};
use std::collections::{BTreeMap, HashMap};
use std::f64::consts::PI;

/// Bins of a distribution, and of a cycle.
const BINS: usize = 40;
/// Parts of a run of which a spectrum is the mean, at least, and the most samples of one.
const PARTS: usize = 4;
const LONGEST: usize = 1024;

/// A run: its strain and samples since the start of the segment shown, and how many of these are
/// not averaged.
struct Shown<'r> {
    run: &'r PointRun,
    samples: Vec<(f64, Sample)>,
    discarded: usize,
}

impl Shown<'_> {
    /// The viscosities that are averaged.
    fn kept(&self) -> Vec<f64> {
        let kept = self.samples[self.discarded..].iter();
        kept.map(|(_, sample)| sample.viscosity).collect()
    }
}

/// A curve of a point: its name among those of the point, and that of each run.
type Named = (&'static str, Vec<Vec<(f64, f64)>>);

/// A part of the shear stress, by its name.
type Part = (&'static str, fn(&StressComponents) -> f64);

const OF_STRESS: [Part; 4] = [
    ("stresslets", |s| s.shear.hydrodynamic),
    ("normal contact forces", |s| s.shear.normal_contact),
    ("friction", |s| s.shear.tangential_contact),
    ("repulsion", |s| s.shear.repulsion),
];

/// The curves of the points selected, of a figure of runs in time; none of other kinds.
///
/// They are those of the `cases`, each named by its number in the campaign file or by the beginning
/// of its key, or else for each point the mean over its runs that averages count, where all of them
/// have a value. While none of these is finished, the first run with samples is shown. At most some
/// more than a figure can hold.
///
/// # Errors
/// An I/O or SQLite error; [`crate::store::StoreError::Case`] on a name that does not identify one
/// selected run; [`ReportError::Argument`] without an oscillation where one is shown.
pub fn traces(
    store: &Store,
    selection: &Selection,
    cases: &[String],
    kind: Kind,
) -> Result<Vec<Trace>, ReportError> {
    if !kind.is_in_time() {
        return Ok(Vec::new());
    }
    let runs = selected_runs(store, selection)?;
    let mut keys = Vec::with_capacity(cases.len());
    for case in cases {
        let key = store.key_of(case)?;
        if !runs.iter().any(|run| run.key == key) {
            return Err(store.no_case(case, "no case of these points").into());
        }
        keys.push(key);
    }
    let protocol = store.protocol()?;
    // Runs of a point, or the cases one by one.
    let mut groups: Vec<Vec<&PointRun>> = Vec::new();
    let mut place_of = HashMap::new();
    for run in &runs {
        if keys.contains(&run.key) {
            groups.push(vec![run]);
        } else if keys.is_empty() {
            let place = *place_of
                .entry(identity(&run.params))
                .or_insert(groups.len());
            if place == groups.len() {
                groups.push(Vec::new());
            }
            groups[place].push(run);
        }
    }
    let mut all: Vec<Trace> = Vec::new();
    for group in groups {
        let is_counted = |run: &&PointRun| keys.is_empty() && selection.averages(run);
        let is_mean = group.iter().any(is_counted);
        let mut shown: Vec<Shown<'_>> = Vec::new();
        for run in group {
            if is_mean && !selection.averages(run) || !is_mean && !shown.is_empty() {
                continue;
            }
            shown.extend(of_run(store, run, &protocol)?);
        }
        let Some(first) = shown.first() else {
            continue;
        };
        let (params, seed) = (first.run.params.clone(), first.run.seed);
        let discards = shown.iter().map(|shown| shown.samples.get(shown.discarded));
        let discards = discards.map(|first| first.map_or(0.0, |first| first.0));
        let discard = discards.reduce(f64::max);
        let runs = shown.len();
        for (name, of_runs) in curves(kind, &shown, &protocol)? {
            let points = mean_trace(of_runs.into_iter());
            all.push(Trace {
                params: (*params).clone(),
                name,
                seed: (!is_mean).then_some(seed),
                runs,
                discard: discard.filter(|_| matches!(kind, Kind::Trace | Kind::Parts)),
                points: places(kind, points),
            });
        }
        if all.len() > super::palette::ORDERED_CURVES {
            break;
        }
    }
    Ok(all)
}

/// The samples of a run in the segment shown, which is the last; `None` without samples.
fn of_run<'r>(
    store: &Store,
    run: &'r PointRun,
    protocol: &Protocol,
) -> Result<Option<Shown<'r>>, ReportError> {
    let last = protocol.segments.last();
    let start = last.map_or(0.0, |last| last.imposed.start);
    let samples = store.samples(&run.key)?.into_iter();
    let samples = samples.map(|(_, sample)| (sample.strain, sample));
    let is_shown = |(strain, sample): &(f64, Sample)| {
        // Strains are sums of steps.
        let is_inside = (start - 1e-9..protocol.strain - 1e-9).contains(strain);
        sample.viscosity.is_finite() && (last.is_none() || is_inside)
    };
    let samples = samples.filter(is_shown);
    let samples: Vec<_> = samples.map(|(strain, s)| (strain - start, s)).collect();
    let discard = run.discard().unwrap_or(protocol.discard) - start;
    let discarded = samples.partition_point(|(strain, _)| *strain < discard - 1e-9);
    Ok((!samples.is_empty()).then_some(Shown {
        run,
        samples,
        discarded,
    }))
}

/// The curves of the runs of a point.
fn curves(kind: Kind, shown: &[Shown<'_>], protocol: &Protocol) -> Result<Vec<Named>, ReportError> {
    let each = |of: &dyn Fn(&Sample) -> f64| -> Vec<Vec<(f64, f64)>> {
        let of_run = |run: &Shown<'_>| run.samples.iter().map(|(x, s)| (*x, of(s))).collect();
        shown.iter().map(of_run).collect()
    };
    let kept: Vec<Vec<f64>> = shown.iter().map(Shown::kept).collect();
    Ok(match kind {
        Kind::Parts => {
            let parts = OF_STRESS.map(|(name, of)| (name, each(&|sample| of(&sample.stress))));
            let is_there = |(_, runs): &Named| runs.iter().flatten().any(|point| point.1 != 0.0);
            let all = [("in all", each(&|sample| sample.viscosity))];
            all.into_iter()
                .chain(parts.into_iter().filter(is_there))
                .collect()
        }
        Kind::Lissajous => {
            let oscillation = protocol.segments.last();
            let amplitude = oscillation.and_then(|last| last.imposed.amplitude);
            let amplitude = amplitude.ok_or_else(|| {
                refused("only an oscillation has a Lissajous curve: choose one (segment)")
            })?;
            let of_run = |run: &Shown<'_>| {
                let kept = run.samples[run.discarded..].iter();
                // A sample is taken in a step, or at its start, and represents its middle.
                let half = 0.5 * run.run.params.time_step;
                cycle(kept.map(|(strain, s)| (phase((strain + half) / amplitude), s.viscosity)))
            };
            vec![("", shown.iter().map(of_run).collect())]
        }
        Kind::Distribution => vec![("", distributions(&kept))],
        Kind::Spectrum => {
            let every = shown.iter().map(|shown| shown.run.sample_every);
            vec![("", spectra(&kept, every.fold(0.0, f64::max)))]
        }
        _ => vec![("", each(&|sample| sample.viscosity))],
    })
}

/// The points of a curve where they are drawn: a closed curve goes by its phase until then, and
/// nothing is drawn where no run has a value.
fn places(kind: Kind, mut points: Vec<(f64, Estimate)>) -> Vec<(f64, Estimate)> {
    match kind {
        Kind::Lissajous => {
            points.extend(points.first().copied());
            let place =
                |(phase, stress): (f64, Estimate)| (phase.sin(), Estimate::bare(stress.mean));
            points.into_iter().map(place).collect()
        }
        Kind::Distribution => {
            points.retain(|(_, density)| density.mean > 0.0);
            points
        }
        _ => points,
    }
}

/// The stress of an oscillation over μ γ0 ω by its phase, mean over its cycles in bins of it.
fn cycle(samples: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut bins = vec![(0.0, 0_u32); BINS];
    for (phase, viscosity) in samples {
        let part = (phase / (2.0 * PI)).rem_euclid(1.0);
        let bin = &mut bins[count((part * BINS as f64).floor()).min(BINS - 1)];
        bin.0 += viscosity * phase.cos();
        bin.1 += 1;
    }
    let bins = bins.into_iter().enumerate().filter(|(_, bin)| bin.1 > 0);
    let middle = |k: usize| 2.0 * PI * (k as f64 + 0.5) / BINS as f64;
    bins.map(|(k, (sum, number))| (middle(k), sum / f64::from(number)))
        .collect()
}

/// Probability densities of some series, in the same bins from the least value of all to the
/// largest.
fn distributions(all: &[Vec<f64>]) -> Vec<Vec<(f64, f64)>> {
    let [low, high] = super::scale::extent(all.iter().flatten().copied());
    let width = (high - low) / BINS as f64;
    let of = |values: &Vec<f64>| {
        let mut bins = vec![0_u32; BINS];
        for value in values {
            bins[count(((value - low) / width).floor()).min(BINS - 1)] += 1;
        }
        let density = |number: u32| f64::from(number) / (values.len() as f64 * width);
        let bins = bins.into_iter().enumerate();
        bins.map(|(k, number)| (low + (k as f64 + 0.5) * width, density(number)))
            .collect()
    };
    let has_width = width > 0.0;
    all.iter().filter(|_| has_width).map(of).collect()
}

/// Power spectra of series of samples at equal distances, against the frequency in cycles per unit
/// of strain. Their integrals are the variances.
///
/// # Source
/// P. D. Welch, IEEE Trans. Audio Electroacoust. 15, 70 (1967): the mean over parts that overlap by
/// half, each less its mean and times the window sin².
fn spectra(all: &[Vec<f64>], every: f64) -> Vec<Vec<(f64, f64)>> {
    let shortest = all.iter().map(Vec::len).min().unwrap_or(0);
    let length = (shortest / PARTS).min(LONGEST);
    if length < 4 {
        return Vec::new();
    }
    let window = |k: usize| (PI * (k as f64 + 0.5) / length as f64).sin().powi(2);
    let power: f64 = (0..length).map(|k| window(k).powi(2)).sum();
    let turn = |k: usize| 2.0 * PI * (k % length) as f64 / length as f64;
    let waves: Vec<[f64; 2]> = (0..length)
        .map(|k| [turn(k).cos(), turn(k).sin()])
        .collect();
    let of = |values: &Vec<f64>| {
        let mut sums = vec![0.0; length / 2];
        let starts = (0..=values.len() - length).step_by(length / 2);
        let number = starts.clone().count() as f64;
        for start in starts {
            let part = &values[start..start + length];
            let mean = part.iter().sum::<f64>() / length as f64;
            let part = part.iter().enumerate();
            let part: Vec<f64> = part.map(|(k, value)| window(k) * (value - mean)).collect();
            for (n, sum) in sums.iter_mut().enumerate() {
                let mut wave = [0.0; 2];
                for (k, value) in part.iter().enumerate() {
                    let [cos, sin] = waves[(n + 1) * k % length];
                    wave[0] += value * cos;
                    wave[1] += value * sin;
                }
                *sum += wave[0].powi(2) + wave[1].powi(2);
            }
        }
        let frequency = |n: usize| (n + 1) as f64 / (length as f64 * every);
        // Both signs of a frequency count, but for the highest, where they are the same.
        let both = |n: usize| if 2 * (n + 1) == length { 1.0 } else { 2.0 };
        let sums = sums.into_iter().enumerate();
        let scaled =
            |(n, sum): (usize, f64)| (frequency(n), both(n) * sum * every / (number * power));
        sums.map(scaled).collect()
    };
    all.iter().map(of).collect()
}

/// The mean of traces at the strains that all of them have.
pub(in crate::report) fn mean_trace(
    traces: impl Iterator<Item = Vec<(f64, f64)>>,
) -> Vec<(f64, Estimate)> {
    let mut at: BTreeMap<u64, (f64, Vec<f64>)> = BTreeMap::new();
    let mut number = 0;
    for trace in traces {
        number += 1;
        for (strain, viscosity) in trace {
            // Strains are sums of steps: those of the same step are the same.
            let (_, values) = at.entry(strain.to_bits()).or_insert((strain, Vec::new()));
            values.push(viscosity);
        }
    }
    let of_all = at.into_values().filter(|of| of.1.len() == number);
    of_all
        .filter_map(|(strain, values)| Some((strain, Estimate::of(&values)?)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn traces_are_averaged_at_the_strains_that_all_runs_have() {
        let long = vec![(0.1, 1.0), (0.2, 4.0), (0.3, 5.0)];
        let gap = vec![(0.1, 3.0), (0.3, 7.0)];
        let mean = mean_trace([long.clone(), gap].into_iter());
        let means: Vec<(f64, f64)> = mean.iter().map(|(strain, e)| (*strain, e.mean)).collect();
        assert_eq!(means, [(0.1, 2.0), (0.3, 6.0)]);
        // t(0.975, 1) = 12.7062, and the standard error of 1 and 3 is 1.
        assert!((mean[0].1.ci95.unwrap() - 12.7062).abs() < 1e-4);
        let alone = mean_trace(std::iter::once(long));
        assert!(alone.len() == 3 && alone.iter().all(|(_, e)| e.ci95.is_none()));
    }

    /// Sums of 1.
    fn integral(curve: &[(f64, f64)]) -> f64 {
        let width = curve[1].0 - curve[0].0;
        curve.iter().map(|point| width * point.1).sum()
    }

    #[test]
    fn a_distribution_is_that_of_the_values_and_has_the_integral_1() {
        // The square of a uniform number has the density 1/(2√x).
        let uniform = |k: u32| (f64::from(k) + 0.5) / 4000.0;
        let squares: Vec<f64> = (0..4000).map(|k| uniform(k).powi(2)).collect();
        let [one, other] = &distributions(&[squares, vec![0.1, 0.9]])[..] else {
            panic!("two series");
        };
        for curve in [one, other] {
            assert!((integral(curve) - 1.0).abs() < 1e-9);
        }
        for (x, density) in &one[4..] {
            assert!(
                (density * 2.0 * x.sqrt() - 1.0).abs() < 0.02,
                "{x} {density}"
            );
        }
        assert!(distributions(&[vec![1.0; 9]]).is_empty());
    }

    #[test]
    fn a_spectrum_has_the_variance_and_the_peak_of_a_wave() {
        let (every, frequency) = (0.05, 1.25);
        let wave = |k: u32| 3.0 + 2.0 * (2.0 * PI * frequency * every * f64::from(k)).sin();
        let wave: Vec<f64> = (0..4096).map(wave).collect();
        // Alternating numbers have the highest frequency, 1/(2 × 0.05).
        let highest: Vec<f64> = (0..4096).map(|k| f64::from(k % 2)).collect();
        let all = spectra(&[wave, highest], every);
        for (curve, [variance, peak]) in all.iter().zip([[2.0, frequency], [0.25, 10.0]]) {
            let top = curve.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            assert!((top.0 - peak).abs() < 0.02, "{top:?}");
            assert!(
                (integral(curve) / variance - 1.0).abs() < 0.01,
                "{}",
                integral(curve)
            );
        }
        assert!(spectra(&[vec![1.0; 15]], every).is_empty());
    }

    #[test]
    fn a_cycle_of_a_fluid_is_an_ellipse() {
        let phases = (0..4000).map(|k| 2.0 * PI * f64::from(k) / 400.0);
        let cycle = cycle(phases.map(|phase| (phase, 5.0)));
        assert_eq!(cycle.len(), BINS);
        for (phase, stress) in &cycle {
            assert!(
                (stress - 5.0 * phase.cos()).abs() < 0.05,
                "{phase} {stress}"
            );
        }
        let cycle: Vec<_> = cycle
            .into_iter()
            .map(|(x, y)| (x, Estimate::bare(y)))
            .collect();
        let drawn = places(Kind::Lissajous, cycle);
        assert!(drawn.len() == BINS + 1 && drawn[0].0 == drawn[BINS].0);
        for (strain, stress) in drawn {
            let radius = strain.hypot(stress.mean / 5.0);
            assert!((radius - 1.0).abs() < 0.01, "{radius}");
        }
    }
}
