//! Averages of samples over a run, and means over runs with their errors.

pub mod doubt;
pub mod numbers;
mod point_run;
mod result;
mod run;
mod runs;
pub(crate) mod segments;
mod steady;
mod stopping;
mod tables;

pub use point_run::PointRun;
pub(crate) use run::RunData;
pub(crate) use runs::Runs;
pub(crate) use steady::{Drift, Steadiness, Trend, mser_5};
pub(crate) use stopping::{Decision, Outcome, Verdict, relative_half_width};
pub use tables::sample_table;
pub(crate) use tables::{axis_column, key_column, run_table, seed_column};

use statrs::distribution::{ContinuousCDF, StudentsT};
use std::cell::RefCell;
use std::collections::HashMap;

/// Mean and quartiles of one quantity over the samples of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Distribution {
    pub mean: f64,
    pub quartile_1: f64,
    /// Median: near jamming a few spikes dominate the mean, but not the median.
    pub median: f64,
    pub quartile_3: f64,
}

impl Distribution {
    /// Computes it from values; `None` without values.
    pub(crate) fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        Some(Self {
            mean: mean(&values)?,
            quartile_1: quantile(&values, 0.25)?,
            median: quantile(&values, 0.5)?,
            quartile_3: quantile(&values, 0.75)?,
        })
    }
}

/// Arithmetic mean; `None` without values.
pub(crate) fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Quantile of sorted values, interpolated between neighbours (type 7 of Hyndman and Fan, the
/// default of R and `NumPy`).
pub(crate) fn quantile(sorted: &[f64], probability: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = probability * last as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and the last index"
    )]
    let below = place.floor() as usize;
    let (low, high) = (sorted[below], sorted[(below + 1).min(last)]);
    // Equal neighbours may be infinite: their difference is not a number.
    Some(if low.total_cmp(&high).is_eq() {
        low
    } else {
        low + (place - below as f64) * (high - low)
    })
}

/// Mean over runs with its error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Mean of the runs.
    pub mean: f64,
    /// Standard error of the mean; `None` for a single run.
    pub standard_error: Option<f64>,
    /// Half width of the 95 % interval of Student's distribution; `None` for a single run.
    pub ci95: Option<f64>,
}

impl Estimate {
    /// A value without an error.
    pub(crate) fn bare(mean: f64) -> Self {
        Self {
            mean,
            standard_error: None,
            ci95: None,
        }
    }

    /// Computes it from one value per run; `None` without runs.
    pub fn of(runs: &[f64]) -> Option<Self> {
        let n = runs.len() as f64;
        let mean = mean(runs)?;
        let standard_error = (runs.len() > 1).then(|| {
            let squares: f64 = runs.iter().map(|run| (run - mean).powi(2)).sum();
            (squares / (n - 1.0) / n).sqrt()
        });
        let ci95 = standard_error
            .zip(student_95(n - 1.0))
            .map(|(error, student)| error * student);
        Some(Self {
            mean,
            standard_error,
            ci95,
        })
    }
}

/// The quantile of Student's distribution for a 95 % interval, by degrees of freedom.
pub(crate) fn student_95(freedom: f64) -> Option<f64> {
    student(freedom, 0.975)
}

thread_local! {
    /// Cache of quantiles, by the bits of degrees of freedom and probability, for thousands of
    /// points with equal numbers of runs.
    static QUANTILES: RefCell<HashMap<(u64, u64), Option<f64>>> = RefCell::default();
}

/// A quantile of Student's distribution; `None` without degrees of freedom.
fn student(freedom: f64, probability: f64) -> Option<f64> {
    let find = || {
        StudentsT::new(0.0, 1.0, freedom)
            .ok()
            .map(|t| t.inverse_cdf(probability))
    };
    QUANTILES.with_borrow_mut(|found| {
        *found
            .entry((freedom.to_bits(), probability.to_bits()))
            .or_insert_with(find)
    })
}

/// A quotient; `None` where it is undefined.
pub(crate) fn ratio(numerator: f64, denominator: f64) -> Option<f64> {
    (denominator > 0.0).then(|| numerator / denominator)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn student_interval_of_a_small_sample() {
        // t(0.975, 3) = 3.182446305284263; the standard deviation of 1, 2, 3, 4 is sqrt(5/3).
        let estimate = Estimate::of(&[1.0, 2.0, 3.0, 4.0]).unwrap();
        let error = (5.0_f64 / 3.0).sqrt() / 2.0;
        assert!((estimate.mean - 2.5).abs() < 1e-15);
        assert!((estimate.standard_error.unwrap() - error).abs() < 1e-15);
        assert!((estimate.ci95.unwrap() - 3.182446305284263 * error).abs() < 1e-9);
        // t(0.975, 1) = 12.706204736432095
        let pair = Estimate::of(&[0.0, 2.0]).unwrap();
        assert!((pair.ci95.unwrap() - 12.706204736432095).abs() < 1e-8);
    }

    #[test]
    fn one_run_has_no_interval_and_none_no_mean() {
        let single = Estimate::of(&[3.0]).unwrap();
        assert_eq!((single.standard_error, single.ci95), (None, None));
        assert_eq!(Estimate::of(&[]), None);
    }

    #[test]
    fn quartiles_as_in_r() {
        let quartiles = Distribution::of(vec![4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!(
            (quartiles.quartile_1, quartiles.median, quartiles.quartile_3),
            (1.75, 2.5, 3.25)
        );
        let spikes = Distribution::of(vec![1.0, f64::INFINITY, f64::INFINITY]).unwrap();
        assert!(spikes.median.is_infinite());
    }
}
