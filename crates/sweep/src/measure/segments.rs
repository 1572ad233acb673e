//! Results of a segment of a run: averages, stress after a reversal, harmonics of an oscillation.

use super::steady::{PARTS, significant_mean};
use super::{Drift, RunData, Trend, mean};
use crate::model::protocol::PlannedSegment;
use sd_core::model::phase;
use sd_core::{Params, Sample};
use std::f64::consts::PI;

/// Minimum rise of a viscosity in a half cycle, over its largest value, for which the strain of the
/// rise is determined: spheres that do not touch make it vary by some per cent.
const MIN_RISE: f64 = 0.1;

/// Results of one run in a segment.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RunSegment {
    /// Numbers over the segment after its discarded strain, by their names.
    pub(crate) numbers: Vec<(&'static str, f64)>,
    /// Mean viscosities over the quarters of this strain.
    pub(crate) parts: Option<[f64; PARTS]>,
    /// Changes of layering and of bond orientation over it.
    pub(crate) order: [Option<f64>; 2],
    pub(crate) fraction_drift: Option<f64>,
    /// Strain since its start, and viscosity.
    pub(crate) trace: Vec<(f64, f64)>,
    /// After a reversal.
    pub(crate) reversal: Option<Reversal>,
    /// Of an oscillation, cycle by cycle.
    pub(crate) cycles: Vec<Cycle>,
    /// Number of last cycles that are averaged.
    pub(crate) averaged_cycles: usize,
}

/// Response of the stress to a reversal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reversal {
    /// The viscosity in the first sample after it over its mean before it.
    pub(crate) ratio: f64,
    /// Strain at which half of the drop has first recovered.
    pub(crate) recovery_strain: Option<f64>,
}

/// One cycle of an oscillation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cycle {
    /// η′ and η″ in mu: the stress is γ0 ω (η′ cos ωt + η″ sin ωt) and higher harmonics, where the
    /// strain is γ0 sin ωt.
    pub(crate) viscosity: [f64; 2],
    /// Coefficients of the third harmonic, cos 3ωt and sin 3ωt.
    pub(crate) third: [f64; 2],
    /// Strain from a turning point until the viscosity has risen half way from its minimum to its
    /// maximum in the half cycle.
    pub(crate) yield_strain: Option<f64>,
}

impl Cycle {
    /// Third over first harmonic of the stress.
    pub(crate) fn third_over_first(&self) -> f64 {
        self.third[0].hypot(self.third[1]) / self.viscosity[0].hypot(self.viscosity[1])
    }

    /// The cycle with the mean stress of several; `None` without cycles.
    pub(crate) fn mean(cycles: &[Self]) -> Option<Self> {
        let of = |value: fn(&Self) -> f64| mean(&cycles.iter().map(value).collect::<Vec<_>>());
        let yields: Vec<f64> = cycles
            .iter()
            .filter_map(|cycle| cycle.yield_strain)
            .collect();
        Some(Self {
            viscosity: [of(|c| c.viscosity[0])?, of(|c| c.viscosity[1])?],
            third: [of(|c| c.third[0])?, of(|c| c.third[1])?],
            yield_strain: mean(&yields),
        })
    }
}

impl RunSegment {
    /// The results of a segment, by its number from 0, from the samples of the run.
    pub(crate) fn of(
        params: &Params,
        segments: &[PlannedSegment],
        number: usize,
        samples: &[(u64, Sample)],
    ) -> Option<Self> {
        let segment = segments.get(number)?;
        let of_strain = |strain: f64| {
            samples.partition_point(|(_, sample)| sample.strain < strain - 0.5 * params.time_step)
        };
        let start = of_strain(segment.imposed.start);
        let own = &samples[start..of_strain(segment.end())];
        let kept = &samples[of_strain(segment.kept_from())..of_strain(segment.end())];
        let trace: Vec<(f64, f64)> = own
            .iter()
            .map(|(_, sample)| (sample.strain - segment.imposed.start, sample.viscosity))
            .collect();
        let before = number.checked_sub(1).map(|number| &segments[number]);
        let turns = |before: &&PlannedSegment| {
            let direction = |of: &PlannedSegment| of.imposed.direction.unwrap_or(params.direction);
            let is_steady =
                before.imposed.amplitude.is_none() && segment.imposed.amplitude.is_none();
            is_steady && direction(before) != direction(segment)
        };
        let reversal = before.filter(turns).and_then(|before| {
            let kept = &samples[of_strain(before.kept_from())..start];
            let viscosities: Vec<f64> = kept.iter().map(|(_, sample)| sample.viscosity).collect();
            let (before, (_, after)) = (mean(&viscosities)?, *trace.first()?);
            let middle = 0.5 * (before + after);
            Some(Reversal {
                ratio: after / before,
                recovery_strain: first_above(&trace, middle).filter(|_| after < before),
            })
        });
        let cycles = segment.imposed.amplitude.map(|amplitude| {
            let cycle = 4.0 * amplitude;
            let all = cycles(&trace, amplitude, params.time_step, segment.strain / cycle);
            (all, (segment.strain - segment.discard) / cycle)
        });
        let (cycles, averaged) = cycles.unwrap_or_default();
        let run = RunData::of(params, kept, 0);
        Some(Self {
            numbers: numbers(&run),
            parts: run.steadiness.map(|steadiness| steadiness.parts),
            order: [run.order_drift(0), run.order_drift(1)],
            fraction_drift: run.fraction_drift(),
            trace,
            reversal,
            cycles,
            averaged_cycles: crate::text::format::count(averaged),
        })
    }

    /// How the runs of a point change over the segment, where they are known not to be in steady
    /// state.
    pub(crate) fn trend(runs: &[Self]) -> Option<Trend> {
        let parts: Vec<_> = runs.iter().filter_map(|run| run.parts).collect();
        // A quarter of an odd number of cycles has other phases than the rest.
        let is_oscillation = runs.iter().any(|run| !run.cycles.is_empty());
        let drifts = |drift: Drift| drift.drifts() || !is_oscillation && drift.remembers_start();
        let changes = [0, 1].map(|place| {
            let changes = runs.iter().filter_map(|run| run.order[place]);
            significant_mean(&changes.collect::<Vec<_>>())
        });
        let changes: Vec<f64> = changes.into_iter().flatten().collect();
        let fractions: Vec<f64> = runs.iter().filter_map(|run| run.fraction_drift).collect();
        let is_drifting =
            Drift::of(&parts).is_some_and(drifts) || significant_mean(&fractions).is_some();
        Trend::of(&changes, is_drifting)
    }

    /// A number by its name.
    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        let found = self.numbers.iter().find(|(known, _)| *known == name);
        found.map(|(_, number)| *number)
    }

    /// The mean of the averaged last cycles of an oscillation.
    pub(crate) fn oscillation(&self) -> Option<Cycle> {
        let first = self.cycles.len().checked_sub(self.averaged_cycles)?;
        Cycle::mean(&self.cycles[first..])
    }
}

/// The numbers of a segment that are averaged in time.
fn numbers(run: &RunData<'_>) -> Vec<(&'static str, f64)> {
    [
        "samples",
        "viscosity",
        "viscosity_stresslet",
        "normal_stress_difference",
        "contacts_per_sphere",
    ]
    .into_iter()
    .filter_map(|name| Some((name, run.number(name)?)))
    .collect()
}

/// The strain at which a viscosity first reaches a value from below, between its samples.
fn first_above(trace: &[(f64, f64)], value: f64) -> Option<f64> {
    let pair = trace
        .windows(2)
        .find(|pair| pair[0].1 < value && pair[1].1 >= value)?;
    let [(from, low), (to, high)] = [pair[0], pair[1]];
    Some(from + (to - from) * (value - low) / (high - low))
}

/// The cycles of an oscillation from the viscosities in it: each represents the strain up to the
/// midpoints to its neighbours, over which the flow is integrated exactly.
fn cycles(trace: &[(f64, f64)], amplitude: f64, time_step: f64, number: f64) -> Vec<Cycle> {
    // A sample is taken in a step, or at its start, and represents its middle.
    let middle = |k: usize| trace[k].0 + 0.5 * time_step;
    (0..crate::text::format::count(number))
        .filter_map(|cycle| {
            let [start, end] = [cycle, cycle + 1].map(|n| 4.0 * amplitude * n as f64);
            let is_in = |k: &usize| (start..end).contains(&middle(*k));
            let own: Vec<usize> = (0..trace.len()).filter(is_in).collect();
            let (first, last) = (*own.first()?, *own.last()?);
            let mut sums = [0.0; 4];
            for k in own {
                let low = if k == first {
                    start
                } else {
                    0.5 * (middle(k - 1) + middle(k))
                };
                let high = if k == last {
                    end
                } else {
                    0.5 * (middle(k) + middle(k + 1))
                };
                let weights = weights(phase(low / amplitude), phase(high / amplitude));
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum += trace[k].1 * weight;
                }
            }
            // The first half cycle began in the cycle before.
            let turns = [-1.0, 1.0].map(|quarters| start + quarters * amplitude);
            let yields: Vec<f64> = turns
                .into_iter()
                .filter(|turn| *turn > 0.0)
                .filter_map(|turn| {
                    let half = |k: &usize| (turn..turn + 2.0 * amplitude).contains(&middle(*k));
                    rise(
                        (0..trace.len())
                            .filter(half)
                            .map(|k| (middle(k) - turn, trace[k].1)),
                    )
                })
                .collect();
            Some(Cycle {
                viscosity: [sums[0], sums[1]],
                third: [sums[2], sums[3]],
                yield_strain: mean(&yields),
            })
        })
        .collect()
}

/// The strain at which the viscosity of a half cycle has risen half way from its minimum to its
/// maximum.
fn rise(half: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let own: Vec<(f64, f64)> = half.collect();
    let least = own.iter().map(|spot| spot.1).reduce(f64::min)?;
    let most = own.iter().map(|spot| spot.1).reduce(f64::max)?;
    if most - least < MIN_RISE * most {
        return None;
    }
    let from = own.iter().position(|spot| spot.1 == least)?;
    first_above(&own[from..], 0.5 * (least + most))
}

/// 1/π times the integrals of cos φ times cos φ, sin φ, cos 3φ and sin 3φ.
fn weights(from: f64, to: f64) -> [f64; 4] {
    let integral = |f: fn(f64) -> f64| (f(to) - f(from)) / PI;
    [
        integral(|x| 0.5 * x + 0.25 * (2.0 * x).sin()),
        integral(|x| 0.5 * x.sin().powi(2)),
        integral(|x| 0.125 * (4.0 * x).sin() + 0.25 * (2.0 * x).sin()),
        integral(|x| -0.125 * (4.0 * x).cos() - 0.25 * (2.0 * x).cos()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use sd_core::model::Segment;

    const STEP: f64 = 0.01;

    /// A trace with a viscosity that depends on the strain since the start, in which `every` step
    /// is sampled.
    fn trace(strain: f64, every: usize, viscosity: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let steps = crate::text::format::count(strain / STEP);
        (0..steps)
            .step_by(every)
            .map(|step| (step as f64 * STEP, viscosity((step as f64 + 0.5) * STEP)))
            .collect()
    }

    #[test]
    fn a_fluid_has_one_viscosity_and_nothing_else() {
        for every in [1, 2, 7] {
            for cycle in cycles(&trace(6.0, every, |_| 3.0), 0.5, STEP, 3.0) {
                assert!((cycle.viscosity[0] - 3.0).abs() < 1e-12);
                let others = [cycle.viscosity[1], cycle.third[0], cycle.third[1]];
                assert!(others.iter().all(|other| other.abs() < 1e-12), "{others:?}");
                assert_eq!(cycle.yield_strain, None);
            }
        }
    }

    #[test]
    fn harmonics_are_those_of_a_known_stress() {
        let viscosity = |strain: f64| {
            let x = phase(strain / 0.5);
            4.0 + 0.5 * x.sin() + 0.3 * (2.0 * x).cos()
        };
        // Times cos φ: ½ sin 2φ is no odd harmonic, and cos φ cos 2φ = ½ (cos φ + cos 3φ).
        for cycle in cycles(&trace(4.0, 1, viscosity), 0.5, STEP, 2.0) {
            assert!((cycle.viscosity[0] - 4.15).abs() < 1e-3, "{cycle:?}");
            assert!(cycle.viscosity[1].abs() < 1e-3);
            assert!((cycle.third[0] - 0.15).abs() < 1e-3);
            assert!((cycle.third_over_first() - 0.15 / 4.15).abs() < 1e-3);
        }
    }

    #[test]
    fn a_stress_that_follows_the_strain_is_elastic() {
        // The viscosity after each turning point rises with the strain since then: η = 1 + s, s = 1
        // ± sin ωt in units of γ0.
        let viscosity = |strain: f64| {
            let x = phase(strain / 0.5);
            1.0 + if x.cos() > 0.0 {
                1.0 + x.sin()
            } else {
                1.0 - x.sin()
            }
        };
        let all = cycles(&trace(4.0, 1, viscosity), 0.5, STEP, 2.0);
        // (1/π)∫|cos φ| sin² φ dφ = 4/(3π), and (1/π)∫ 2 cos² φ dφ = 2.
        let cycle = all[1];
        assert!((cycle.viscosity[0] - 2.0).abs() < 2e-3, "{cycle:?}");
        assert!(
            (cycle.viscosity[1] - 4.0 / (3.0 * PI)).abs() < 2e-3,
            "{cycle:?}"
        );
        // Half way between 1 and 3 after one amplitude.
        assert!((cycle.yield_strain.unwrap() - 0.5).abs() < 2.0 * STEP);
    }

    #[test]
    fn runs_that_drift_or_order_are_not_steady() {
        let run = |scatter: f64, drift: f64, ordering: f64| RunSegment {
            numbers: Vec::new(),
            parts: Some([0.0, 1.0, 2.0, 3.0].map(|k| 10.0 + scatter + drift * k)),
            order: [Some(ordering + 0.01 * scatter), None],
            fraction_drift: None,
            trace: Vec::new(),
            reversal: None,
            cycles: Vec::new(),
            averaged_cycles: 0,
        };
        let runs = |drift: f64, ordering: f64| {
            [-0.4, 0.1, 0.3].map(|scatter| run(scatter, drift * (1.0 + 0.1 * scatter), ordering))
        };
        assert_eq!(RunSegment::trend(&runs(0.0, 0.0)), None);
        assert_eq!(RunSegment::trend(&runs(0.5, 0.0)), Some(Trend::NotSteady));
        assert_eq!(RunSegment::trend(&runs(0.5, 0.2)), Some(Trend::Ordering));
        assert_eq!(RunSegment::trend(&runs(0.0, -0.2)), Some(Trend::NotSteady));
        // Too few to know.
        assert_eq!(RunSegment::trend(&runs(0.5, 0.2)[..2]), None);
        // Under an imposed pressure the fraction has to be steady too.
        let mut loosening = runs(0.0, 0.0);
        for (run, drift) in loosening.iter_mut().zip([-0.010, -0.011, -0.012]) {
            run.fraction_drift = Some(drift);
        }
        assert_eq!(RunSegment::trend(&loosening), Some(Trend::NotSteady));
    }

    #[test]
    fn a_reversal_drops_the_stress_and_recovers() {
        let planned = |start, strain, discard, direction| PlannedSegment {
            imposed: Segment {
                start,
                direction,
                ..Segment::default()
            },
            strain,
            discard,
        };
        let segments = [
            planned(0.0, 2.0, 1.0, None),
            planned(2.0, 3.0, 1.0, Some(-1.0)),
        ];
        let params = Params {
            time_step: STEP,
            ..crate::test_support::params()
        };
        let viscosity = |strain: f64| match strain {
            s if s < 2.0 => 10.0,
            s => (4.0 + 3.0 * (s - 2.0)).min(10.0),
        };
        let samples: Vec<(u64, Sample)> = (0..500_u32)
            .map(|step| {
                let strain = f64::from(step) * STEP;
                let sample = Sample {
                    strain,
                    viscosity: viscosity(strain),
                    ..Sample::default()
                };
                (u64::from(step), sample)
            })
            .collect();
        let first = RunSegment::of(&params, &segments, 0, &samples).unwrap();
        assert_eq!(first.reversal, None);
        assert_eq!(first.number("samples"), Some(100.0));
        let second = RunSegment::of(&params, &segments, 1, &samples).unwrap();
        let reversal = second.reversal.unwrap();
        assert!((reversal.ratio - 0.4).abs() < 1e-12);
        assert!((reversal.recovery_strain.unwrap() - 1.0).abs() < 1e-9);
        assert_eq!(second.number("samples"), Some(200.0));
        assert_eq!(second.oscillation(), None);
    }
}
