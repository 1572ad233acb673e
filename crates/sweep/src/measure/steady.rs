//! Steadiness of a run: drift of the viscosity and of order between its kept parts, the initial
//! transient to discard, and the correlation time of the viscosity.

use super::{Estimate, mean, student};

/// Number of parts of the kept strain that are compared.
pub(crate) const PARTS: usize = 4;
/// Significance level of a difference, two-sided 1 %.
const BEYOND_CHANCE: f64 = 0.995;
/// Minimum number of runs for a test.
pub(super) const MIN_RUNS: usize = 3;
/// Window of the sum of correlations, in correlation times.
const WINDOW: f64 = 5.0;
/// Samples of a batch.
const BATCH: usize = 5;

/// Measures of steadiness of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Steadiness {
    /// Means over the four equal parts of the kept samples, the earliest first.
    pub parts: [f64; PARTS],
    /// Correlation time in samples: see [`correlation_samples`].
    pub correlation: f64,
    /// Variance of the samples.
    pub variance: f64,
}

impl Steadiness {
    /// Computes them from the kept samples of a run; `None` for fewer than eight, or for values
    /// that are not finite.
    pub(crate) fn of(values: &[f64]) -> Option<Self> {
        if values.len() < 2 * PARTS || values.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let bound = |part: usize| part * values.len() / PARTS;
        let part = |part: usize| mean(&values[bound(part)..bound(part + 1)]).unwrap_or(f64::NAN);
        let centre = mean(values)?;
        let squares: f64 = values.iter().map(|value| (value - centre).powi(2)).sum();
        Some(Self {
            parts: std::array::from_fn(part),
            correlation: correlation_samples(values)?,
            variance: squares / (values.len() as f64 - 1.0),
        })
    }
}

/// Integrated autocorrelation time of a series, in samples: a mean over n of them has the error of
/// one over n/τ independent ones.
///
/// ```text
/// τ = 1 + 2 Σ_{t=1}^{W} ρ(t),   W the first with W ≥ 5 τ(W)
/// ```
/// `None` for fewer than two values; 1 for a constant.
///
/// # Source
/// A. Sokal, Monte Carlo methods in statistical mechanics (1997), section 3.
pub(crate) fn correlation_samples(values: &[f64]) -> Option<f64> {
    let n = values.len();
    let centre = mean(values)?;
    let deviations: Vec<f64> = values.iter().map(|value| value - centre).collect();
    let covariance = |lag: usize| -> f64 {
        let pairs = deviations.iter().zip(&deviations[lag..]);
        pairs.map(|(a, b)| a * b).sum::<f64>() / n as f64
    };
    let variance = covariance(0);
    if n < 2 || variance.is_nan() {
        return None;
    }
    if variance <= 0.0 {
        return Some(1.0);
    }
    let mut time = 1.0;
    for lag in 1..n {
        time += 2.0 * covariance(lag) / variance;
        if lag as f64 >= WINDOW * time {
            break;
        }
    }
    // The estimate is noisy, and no series is much better than independent samples.
    Some(time.max(0.5))
}

/// The optimal start of a series to discard, in samples, and whether it is the maximum allowed:
/// then nothing indicates that the rest is steady.
///
/// ```text
/// d = argmin_{d ≤ m/2} Σ_{j≥d} (y_j − ȳ_d)² / (m − d)²      of the means y_j over batches of five samples
/// ```
/// `None` for fewer than four batches, or for values that are not finite.
///
/// # Source
/// MSER-5: K. P. White, Simulation 69, 323 (1997); K. P. White, M. J. Cobb and S. C. Spratt, Proc.
/// Winter Simulation Conf. (2000), 755; at most half, as K. Hoad, S. Robinson and R. Davies, J.
/// Oper. Res. Soc. 61, 1642 (2010).
pub(crate) fn mser_5(values: &[f64]) -> Option<(usize, bool)> {
    let batches: Vec<f64> = values.chunks_exact(BATCH).filter_map(mean).collect();
    if batches.len() < 4 || batches.iter().any(|batch| !batch.is_finite()) {
        return None;
    }
    let most = batches.len() / 2;
    let score = |left_out: usize| {
        let rest = &batches[left_out..];
        let centre = mean(rest).unwrap_or(f64::NAN);
        let squares: f64 = rest.iter().map(|batch| (batch - centre).powi(2)).sum();
        squares / (rest.len() as f64).powi(2)
    };
    let best = (0..=most).min_by(|a, b| score(*a).total_cmp(&score(*b)))?;
    Some((best * BATCH, best == most))
}

/// Mean of the second half of some values less that of the first; `None` for fewer than eight.
pub(super) fn rise(values: &[f64]) -> Option<f64> {
    let (first, second) = values.split_at(values.len() / 2);
    let rise = mean(second)? - mean(first)?;
    (values.len() >= 2 * PARTS && rise.is_finite()).then_some(rise)
}

/// Whether a mean over runs differs from 0 significantly.
pub(super) fn is_significant(difference: &Estimate, runs: usize) -> bool {
    let limit = difference
        .standard_error
        .zip(student(runs as f64 - 1.0, BEYOND_CHANCE))
        .map(|(error, student)| error * student);
    runs >= MIN_RUNS && limit.is_some_and(|limit| difference.mean.abs() > limit)
}

/// The mean of a change over runs, if it differs from 0 significantly.
pub(super) fn significant_mean(changes: &[f64]) -> Option<f64> {
    let change = Estimate::of(changes)?;
    is_significant(&change, changes.len()).then_some(change.mean)
}

/// How the averaged runs of a point change over the kept strain, where they are not in steady
/// state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Trend {
    /// The viscosity drifts or remembers the start, order falls, or the fraction under an imposed
    /// pressure drifts.
    NotSteady,
    /// Order rises.
    Ordering,
}

impl Trend {
    /// That of runs whose order changes so, and whose viscosity drifts or not; `None` of those that
    /// may be in steady state.
    pub(super) fn of(changes_of_order: &[f64], is_drifting: bool) -> Option<Self> {
        if changes_of_order.iter().any(|change| *change > 0.0) {
            return Some(Self::Ordering);
        }
        (is_drifting || !changes_of_order.is_empty()).then_some(Self::NotSteady)
    }

    /// Its name in tables, figures and on pages.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::NotSteady => "not steady",
            Self::Ordering => "ordering",
        }
    }
}

/// Whether the runs of a point drift, judged from the same parts of all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Drift {
    /// Second half of the kept strain minus the first, over the mean.
    pub halves: Estimate,
    /// First quarter of the kept strain minus the rest, over the mean.
    pub start: Estimate,
    runs: usize,
}

impl Drift {
    /// Computes it from the parts of every run; `None` without runs.
    pub(crate) fn of(runs: &[[f64; PARTS]]) -> Option<Self> {
        let whole: Vec<f64> = runs.iter().filter_map(|parts| mean(parts)).collect();
        let centre = mean(&whole)?.abs();
        let relative = |difference: fn(&[f64; PARTS]) -> f64| {
            let differences: Vec<f64> = runs.iter().map(|p| difference(p) / centre).collect();
            Estimate::of(&differences)
        };
        Some(Self {
            halves: relative(|p| 0.5 * (p[2] + p[3]) - 0.5 * (p[0] + p[1]))?,
            start: relative(|p| p[0] - (p[1] + p[2] + p[3]) / 3.0)?,
            runs: runs.len(),
        })
    }

    /// Whether the halves differ significantly.
    pub(crate) fn drifts(&self) -> bool {
        is_significant(&self.halves, self.runs)
    }

    /// Whether the first quarter differs significantly from the rest: the initial transient
    /// persists.
    pub(crate) fn remembers_start(&self) -> bool {
        is_significant(&self.start, self.runs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    /// An autoregressive series of coefficient `memory`, whose correlation time is (1 + memory)/(1
    /// − memory).
    fn series(memory: f64, length: usize, seed: u64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut noise = || {
            let uniform = |word: u64| (word >> 11) as f64 / (1_u64 << 53) as f64;
            // A sum of twelve uniform numbers is approximately normal.
            (0..12).map(|_| uniform(random.next_u64())).sum::<f64>() - 6.0
        };
        let mut value = noise() / (1.0 - memory * memory).sqrt();
        (0..length)
            .map(|_| {
                value = memory * value + noise();
                10.0 + value
            })
            .collect()
    }

    #[test]
    fn correlation_time_is_that_of_an_autoregressive_series() {
        for memory in [0.0, 0.5, 0.9] {
            let known = (1.0 + memory) / (1.0 - memory);
            let found = correlation_samples(&series(memory, 100_000, 3)).unwrap();
            assert!(
                (found / known - 1.0).abs() < 0.1,
                "{memory}: {found} {known}"
            );
        }
        assert_eq!(correlation_samples(&[2.0; 9]), Some(1.0));
        assert_eq!(correlation_samples(&[]), None);
    }

    #[test]
    fn error_by_correlation_is_the_scatter_of_means() {
        let runs: Vec<Vec<f64>> = (0..400).map(|seed| series(0.8, 400, seed)).collect();
        let means: Vec<f64> = runs.iter().map(|run| mean(run).unwrap()).collect();
        let centre = mean(&means).unwrap();
        let scatter = means.iter().map(|m| (m - centre).powi(2)).sum::<f64>() / 399.0;
        let of_run = |run: &Vec<f64>| {
            let s = Steadiness::of(run).unwrap();
            s.variance * s.correlation / 400.0
        };
        let estimated = mean(&runs.iter().map(of_run).collect::<Vec<_>>()).unwrap();
        // Correlations within a run are relative to its own mean, which reduces them slightly.
        assert!(
            (0.8..1.1).contains(&(estimated / scatter)),
            "{estimated} {scatter}"
        );
    }

    #[test]
    fn start_that_decays_is_left_out_and_a_steady_series_keeps_nearly_all() {
        let steady = mean(
            &(0..50)
                .map(|seed| mser_5(&series(0.5, 250, seed)).unwrap().0 as f64)
                .collect::<Vec<_>>(),
        );
        assert!(steady.unwrap() < 40.0, "{steady:?}");
        let mut decaying = series(0.5, 250, 7);
        for (n, value) in decaying.iter_mut().enumerate() {
            *value += 40.0 * (-(n as f64) / 15.0).exp();
        }
        let (left_out, limit) = mser_5(&decaying).unwrap();
        // The start falls to the scatter of a batch after 15 ln(40/1) = 55 samples.
        assert!((30..=90).contains(&left_out) && !limit, "{left_out}");
        let ramp: Vec<f64> = (0..250).map(f64::from).collect();
        assert_eq!(mser_5(&ramp), Some((125, true)));
        assert_eq!(mser_5(&[1.0; 19]), None);
    }

    #[test]
    fn drift_is_distinguished_from_chance() {
        let runs = |slope: f64| -> Vec<[f64; PARTS]> {
            let run = |seed| {
                let mut values = series(0.5, 200, seed);
                for (n, value) in values.iter_mut().enumerate() {
                    *value += slope * n as f64;
                }
                Steadiness::of(&values).unwrap().parts
            };
            (0..8).map(run).collect()
        };
        let steady = Drift::of(&runs(0.0)).unwrap();
        assert!(!steady.drifts() && !steady.remembers_start());
        let rising = Drift::of(&runs(0.02)).unwrap();
        assert!(rising.drifts());
        // Second half minus first: 100 samples apart, over a mean of 12.
        assert!((rising.halves.mean - 2.0 / 12.0).abs() < 0.05);
        let two = Drift::of(&runs(0.02)[..2]).unwrap();
        assert!(!two.drifts(), "two runs are too few");
        // One in a hundred steady points is flagged by chance.
        let flagged = (0..300)
            .filter(|point| {
                let run = |seed| Steadiness::of(&series(0.5, 200, seed)).unwrap().parts;
                let parts: Vec<_> = (0..6).map(|seed| run(1000 + 6 * point + seed)).collect();
                Drift::of(&parts).unwrap().drifts()
            })
            .count();
        assert!(flagged < 12, "{flagged}");
    }
}
