//! The model of Wyart and Cates (PRL 112, 098302 (2014)) fitted to viscosities.
//!
//! ```text
//! η = A (1 − c/c_J)⁻²,    c_J = f c_m + (1 − f) c_0,    f = exp(−(σ_c/σ)^β)
//! ```
//!
//! A layer jams at `c_0` without friction, and at `c_m` with friction at all contacts; `f` is the
//! fraction of contacts above the critical load. The fit uses logarithms of viscosities, weighted
//! by the scatter of runs.

use crate::measure::{quantile, student_95};
use nalgebra::{SMatrix, SVector};

/// Number of parameters.
pub(crate) const PARAMETERS: usize = 5;
/// Their names, in the order of [`Fit::values`].
pub(crate) const NAMES: [&str; PARAMETERS] = ["c_0", "c_m", "sigma_c", "beta", "prefactor"];
/// Relative error of a viscosity added to the scatter of its runs, since the model is approximate.
const FLOOR: f64 = 0.01;
/// Maximum steps of a fit, and the relative gain of a step below which it has converged.
const STEPS: usize = 200;
const CONVERGED: f64 = 1e-10;
/// The quantile of the normal distribution for a 95 % interval.
const NORMAL_95: f64 = 1.959_963_984_540_054;
/// Standard errors above which the points do not determine a parameter: of a fraction, and of a
/// logarithm, whose 95 % interval then covers two decades. Intervals must be as narrow.
const VAGUE_FRACTION: f64 = 0.1;
const VAGUE_LOGARITHM: f64 = 1.2;
/// Number of starts that are iterated to convergence.
const FOLLOWED: usize = 6;

/// Fitted parameters: c_0, c_m, ln σ_c, ln β, ln A.
type Inner = SVector<f64, PARAMETERS>;
type Normal = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// A point: its area or volume fraction, its shear stress in F_crit/a², 0 and infinity included,
/// and the viscosities of its runs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Datum {
    /// c or φ.
    pub fraction: f64,
    /// σ*.
    pub stress: f64,
    /// One or more, above 0.
    pub runs: Vec<f64>,
}

impl Datum {
    /// Mean of its runs.
    pub(crate) fn mean(&self) -> f64 {
        mean(&self.runs)
    }
}

/// A fit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fit {
    /// c_0, c_m, σ_c, β, A.
    pub values: [f64; PARAMETERS],
    /// Their 95 % intervals by bootstrap over runs; `None` if no point has two runs.
    pub intervals: Option<[[f64; 2]; PARAMETERS]>,
    /// ln η of each point minus that of the fit.
    pub residuals: Vec<f64>,
    /// Number of bootstrap replicates of the intervals.
    pub replicates: usize,
    /// Names of the parameters that the points do not determine.
    pub undetermined: Vec<&'static str>,
}

impl Fit {
    /// The viscosity of the fit; infinite where it diverges.
    pub(crate) fn viscosity(&self, fraction: f64, stress: f64) -> f64 {
        let [c_0, c_m, sigma_c, beta, prefactor] = self.values;
        let inner = Inner::from([c_0, c_m, sigma_c.ln(), beta.ln(), prefactor.ln()]);
        logarithm(&inner, fraction, stress).map_or(f64::INFINITY, f64::exp)
    }
}

/// Fits the model, with intervals by a number of bootstrap replicates. `None` if no parameters
/// describe the points.
pub(crate) fn fit(data: &[Datum], replicates: usize) -> Option<Fit> {
    let problem = Problem {
        data,
        heights: data.iter().map(|datum| datum.mean().ln()).collect(),
        errors: errors(data),
    };
    let best = problem.solve()?;
    let mut found: Vec<Inner> = Vec::with_capacity(replicates);
    let freedom: usize = data.iter().map(|datum| datum.runs.len() - 1).sum();
    if freedom > 0 {
        for replicate in 0..replicates {
            let problem = Problem {
                heights: resampled(data, replicate as u64),
                ..problem.clone()
            };
            found.extend(problem.descend(best).map(|(inner, _)| inner));
        }
    }
    // Quantiles, since single replicates may be outliers; widened by the ratio of Student's
    // quantile to the normal one.
    let factor = student_95(freedom as f64).filter(|_| found.len() > 1);
    let factor = factor.map(|quantile| quantile / NORMAL_95);
    let intervals = factor.map(|factor| {
        std::array::from_fn(|k| {
            let mut values: Vec<f64> = found.iter().map(|inner| inner[k]).collect();
            values.sort_by(f64::total_cmp);
            [0.025, 0.975].map(|share| {
                let end = quantile(&values, share).unwrap_or(f64::NAN);
                outer(k, best[k] + factor * (end - best[k]))
            })
        })
    });
    let residual = |(datum, own): (&Datum, &f64)| {
        own - logarithm(&best, datum.fraction, datum.stress).unwrap_or(f64::NAN)
    };
    let values: [f64; PARAMETERS] = std::array::from_fn(|k| outer(k, best[k]));
    Some(Fit {
        undetermined: problem.undetermined(&best, &values, intervals.as_ref()),
        values,
        intervals,
        residuals: data.iter().zip(&problem.heights).map(residual).collect(),
        replicates: found.len(),
    })
}

/// A parameter in its own unit: all but the two fractions are fitted by their logarithms.
fn outer(place: usize, inner: f64) -> f64 {
    if place < 2 { inner } else { inner.exp() }
}

/// ln η of the model; `None` above jamming.
fn logarithm(inner: &Inner, fraction: f64, stress: f64) -> Option<f64> {
    let f = (-(inner[2].exp() / stress).powf(inner[3].exp())).exp();
    let room = 1.0 - fraction / (f * inner[1] + (1.0 - f) * inner[0]);
    (room > 0.0).then(|| inner[4] - 2.0 * room.ln())
}

/// Relative error of the viscosity of each point, from the pooled scatter of runs about the means
/// of their points.
fn errors(data: &[Datum]) -> Vec<f64> {
    let (mut squares, mut freedom) = (0.0, 0.0);
    for datum in data {
        let mean = datum.mean();
        let deviations = datum.runs.iter().map(|run| (run / mean - 1.0).powi(2));
        squares += deviations.sum::<f64>();
        freedom += datum.runs.len() as f64 - 1.0;
    }
    let variance = squares / f64::max(freedom, 1.0);
    let error = |datum: &Datum| (variance / datum.runs.len() as f64 + FLOOR * FLOOR).sqrt();
    data.iter().map(error).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Logarithms of bootstrap means. Deviations are scaled by √(n/(n−1)), so that they scatter like
/// the mean of n runs.
fn resampled(data: &[Datum], replicate: u64) -> Vec<f64> {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"bootstrap");
    hasher.update(&replicate.to_le_bytes());
    let mut random = hasher.finalize_xof();
    let mut draw = |below: usize| {
        let mut bytes = [0; 8];
        random.fill(&mut bytes);
        // The bias of a remainder is negligible at any number of replicates.
        usize::try_from(u64::from_le_bytes(bytes) % below as u64).unwrap_or(0)
    };
    data.iter()
        .map(|datum| {
            let n = datum.runs.len();
            let own = datum.mean();
            if n < 2 {
                return own.ln();
            }
            let drawn: f64 = (0..n).map(|_| datum.runs[draw(n)]).sum::<f64>() / n as f64;
            let moved = own + (n as f64 / (n as f64 - 1.0)).sqrt() * (drawn - own);
            // Too few runs, with a scatter above their mean.
            if moved > 0.0 { moved.ln() } else { drawn.ln() }
        })
        .collect()
}

/// The data of the fit.
#[derive(Clone)]
struct Problem<'d> {
    data: &'d [Datum],
    /// ln η of each point.
    heights: Vec<f64>,
    errors: Vec<f64>,
}

impl Problem<'_> {
    /// The best parameters from many starts.
    fn solve(&self) -> Option<Inner> {
        let starts = self.starts().into_iter();
        let starts = starts.filter_map(|start| Some((self.cost(&start)?, start)));
        let mut starts: Vec<(f64, Inner)> = starts.collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ends = starts.iter().take(FOLLOWED);
        let ends = ends.filter_map(|(_, start)| self.descend(*start));
        let best = ends.min_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(inner, _)| inner)
    }

    /// Initial parameters: c_0 and c_m above all fractions by different amounts, σ_c within the
    /// stresses.
    fn starts(&self) -> Vec<Inner> {
        let fractions = self.data.iter().map(|datum| datum.fraction);
        let densest = fractions.fold(0.0, f64::max);
        let mut stresses: Vec<f64> = self.data.iter().map(|datum| datum.stress).collect();
        stresses.retain(|stress| *stress > 0.0 && stress.is_finite());
        stresses.sort_by(f64::total_cmp);
        let mut starts = Vec::new();
        let quarters = (1..4).filter_map(|quarter| stresses.get(stresses.len() * quarter / 4));
        let stresses: Vec<f64> = quarters.copied().collect();
        for above in [0.01, 0.03, 0.06, 0.12, 0.25].map(|above| densest + above) {
            for below in [-0.02, 0.005, 0.02, 0.06, 0.12].map(|below| above - below) {
                for stress in &stresses {
                    for beta in [0.6_f64, 1.2] {
                        let mut start = Inner::from([above, below, stress.ln(), beta.ln(), 0.0]);
                        // The prefactor follows from the others.
                        if let Some(residuals) = self.residuals(&start) {
                            let off = residuals.iter().zip(&self.errors).map(|(r, e)| r * e);
                            start[4] += off.sum::<f64>() / self.data.len() as f64;
                            starts.push(start);
                        }
                    }
                }
            }
        }
        starts
    }

    /// Residuals over their errors; `None` where a point would be jammed.
    fn residuals(&self, inner: &Inner) -> Option<Vec<f64>> {
        let points = self.data.iter().zip(&self.heights).zip(&self.errors);
        points
            .map(|((datum, height), error)| {
                let fitted = logarithm(inner, datum.fraction, datum.stress)?;
                Some((height - fitted) / error).filter(|residual| residual.is_finite())
            })
            .collect()
    }

    fn cost(&self, inner: &Inner) -> Option<f64> {
        let residuals = self.residuals(inner)?;
        Some(residuals.iter().map(|residual| residual * residual).sum())
    }

    /// The Levenberg-Marquardt method from these parameters: final parameters and cost.
    fn descend(&self, start: Inner) -> Option<(Inner, f64)> {
        let (mut inner, mut cost) = (start, self.cost(&start)?);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let (normal, gradient) = self.normal(&inner)?;
            let before = cost;
            while damping < 1e12 {
                let mut damped = normal;
                for k in 0..PARAMETERS {
                    damped[(k, k)] += damping * (normal[(k, k)] + 1e-12);
                }
                let tried = damped.lu().solve(&gradient).map(|step| inner - step);
                match tried.and_then(|tried| Some((tried, self.cost(&tried)?))) {
                    Some((tried, less)) if less < cost => {
                        (inner, cost) = (tried, less);
                        damping *= 0.2;
                        break;
                    }
                    _ => damping *= 5.0,
                }
            }
            if before - cost <= CONVERGED * before {
                return Some((inner, cost));
            }
        }
        Some((inner, cost))
    }

    /// The normal matrix and the gradient of half the cost.
    fn normal(&self, inner: &Inner) -> Option<(Normal, Inner)> {
        let residuals = self.residuals(inner)?;
        let (mut normal, mut gradient) = (Normal::zeros(), Inner::zeros());
        let columns: Vec<Vec<f64>> = (0..PARAMETERS)
            .map(|k| self.derivative(inner, &residuals, k))
            .collect::<Option<_>>()?;
        for (place, residual) in residuals.iter().enumerate() {
            for a in 0..PARAMETERS {
                gradient[a] += columns[a][place] * residual;
                for b in 0..PARAMETERS {
                    normal[(a, b)] += columns[a][place] * columns[b][place];
                }
            }
        }
        Some((normal, gradient))
    }

    /// The parameters with a large error, a fraction above 1, or an interval without them.
    fn undetermined(
        &self,
        inner: &Inner,
        values: &[f64; PARAMETERS],
        intervals: Option<&[[f64; 2]; PARAMETERS]>,
    ) -> Vec<&'static str> {
        let normal = self.normal(inner);
        let covariance = normal.and_then(|(normal, _)| normal.try_inverse());
        let is_vague = |&k: &usize| {
            let most = [VAGUE_FRACTION, VAGUE_LOGARITHM][usize::from(k > 1)];
            let variance = covariance.map_or(f64::INFINITY, |matrix| matrix[(k, k)]);
            let is_known = (0.0..most * most).contains(&variance);
            // The bootstrap sees more than the curvature at the best parameters.
            let is_wide = |of: &[[f64; 2]; PARAMETERS]| {
                let [low, high] = of[k];
                let width = if k < 2 { high - low } else { (high / low).ln() };
                let is_narrow = (0.0..2.0 * NORMAL_95 * most).contains(&width);
                !is_narrow || !(low..=high).contains(&values[k])
            };
            !is_known || (k < 2 && values[k] > 1.0) || intervals.is_some_and(is_wide)
        };
        (0..PARAMETERS).filter(is_vague).map(|k| NAMES[k]).collect()
    }

    /// Derivatives of the residuals by a parameter, with a difference in the direction away from
    /// jamming.
    fn derivative(&self, inner: &Inner, residuals: &[f64], place: usize) -> Option<Vec<f64>> {
        [1e-7, -1e-7].into_iter().find_map(|step| {
            let mut moved = *inner;
            moved[place] += step;
            let there = self.residuals(&moved)?;
            let pairs = there.iter().zip(residuals);
            Some(pairs.map(|(there, here)| (there - here) / step).collect())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    const TRUTH: [f64; PARAMETERS] = [0.84, 0.73, 0.4, 1.1, 1.3];

    /// Runs of layers that follow the model, with a scatter.
    fn synthetic(seed: u64, scatter: f64, runs: usize) -> Vec<Datum> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let truth = Fit {
            values: TRUTH,
            intervals: None,
            residuals: Vec::new(),
            replicates: 0,
            undetermined: Vec::new(),
        };
        let mut data = Vec::new();
        for fraction in [0.5, 0.58, 0.64, 0.68, 0.7] {
            for stress in [0.0, 0.03, 0.1, 0.2, 0.5, 1.0, 3.0, 10.0, f64::INFINITY] {
                let viscosity = truth.viscosity(fraction, stress);
                // A sum of uniform numbers is nearly normal; of twelve the variance is 1.
                let mut normal =
                    || (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0;
                let runs = (0..runs)
                    .map(|_| viscosity * (1.0 + scatter * normal()))
                    .collect();
                data.push(Datum {
                    fraction,
                    stress,
                    runs,
                });
            }
        }
        data
    }

    #[test]
    fn parameters_of_exact_data_are_recovered() {
        let fit = fit(&synthetic(1, 0.0, 1), 20).unwrap();
        for ((name, value), truth) in NAMES.iter().zip(fit.values).zip(TRUTH) {
            assert!((value / truth - 1.0).abs() < 1e-5, "{name}: {value}");
        }
        assert_eq!((fit.intervals, fit.replicates), (None, 0));
        assert_eq!(fit.undetermined, [""; 0]);
        assert!(fit.residuals.iter().all(|residual| residual.abs() < 1e-6));
        // Both plateaus.
        let high = fit.viscosity(0.6, f64::INFINITY);
        assert!((high / (1.3 / (1.0 - 0.6 / 0.73_f64).powi(2)) - 1.0).abs() < 1e-4);
        assert_eq!(fit.viscosity(0.75, f64::INFINITY), f64::INFINITY);
    }

    #[test]
    fn intervals_hold_the_parameters_as_often_as_they_say() {
        let mut inside = [0; PARAMETERS];
        for seed in 0..100 {
            let fit = fit(&synthetic(seed, 0.08, 6), 150).unwrap();
            let intervals = fit.intervals.unwrap();
            for (k, [low, high]) in intervals.into_iter().enumerate() {
                inside[k] += u32::from(low < TRUTH[k] && TRUTH[k] < high);
            }
        }
        // Of 100 about 95: fewer than 89 happen in one of 200 sets.
        for (name, number) in NAMES.iter().zip(inside) {
            assert!((89..=100).contains(&number), "{name}: {number} of 100");
        }
    }

    #[test]
    fn the_same_data_have_the_same_intervals() {
        let data = synthetic(7, 0.1, 4);
        assert_eq!(fit(&data, 30), fit(&data, 30));
    }

    #[test]
    fn parameters_that_the_points_do_not_determine_are_named() {
        // Both plateaus, and one stress just above the lower: neither onset nor its steepness.
        let mut data = synthetic(3, 0.02, 3);
        data.retain(|datum| [0.0, 0.03, f64::INFINITY].contains(&datum.stress));
        let found = fit(&data, 40).unwrap().undetermined;
        assert!(
            found.contains(&"sigma_c") && found.contains(&"beta"),
            "{found:?}"
        );
        assert!(!found.contains(&"c_m"), "{found:?}");
        // The lower plateau alone.
        data.retain(|datum| datum.stress < 1.0);
        let found = fit(&data, 40).map(|fit| fit.undetermined);
        assert!(found.is_none_or(|found| found.contains(&"c_m")));
        assert_eq!(
            fit(&synthetic(3, 0.08, 6), 40).unwrap().undetermined,
            [""; 0]
        );
    }
}
