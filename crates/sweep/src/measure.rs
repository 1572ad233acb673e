//! Averages of samples over a run, and means over runs with their errors.

pub mod doubt;
pub mod sampled;
pub(crate) mod segments;
mod steady;
mod stopping;
pub(crate) mod wyart_cates;

pub(crate) use steady::{Drift, Steadiness, mser_5};
pub(crate) use stopping::{Decision, Outcome, Verdict, relative_half_width};

use sampled::MEANS;
use sd_core::Sample;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::cell::RefCell;
use std::collections::HashMap;

/// Mean and quartiles of one quantity over the samples of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Distribution {
    /// Mean.
    pub mean: f64,
    /// First quartile.
    pub quartile_1: f64,
    /// Median: near jamming a few spikes dominate the mean, but not the median.
    pub median: f64,
    /// Third quartile.
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
fn quantile(sorted: &[f64], probability: f64) -> Option<f64> {
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

/// Averages over the samples of a run from the discarded strain on.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Averages {
    /// Number of samples.
    pub samples: u64,
    /// Viscosity in full.
    pub viscosity: Option<Distribution>,
    /// Viscosity from the stresslets alone.
    pub viscosity_stresslet: Option<Distribution>,
    /// First normal stress difference.
    pub normal_stress_difference: Option<f64>,
    /// Components and parts of the stress, and numbers of the contact network over the samples that
    /// have them, in the order of [`sampled::means`].
    pub(crate) means: [Option<f64>; MEANS],
    /// Dissipation.
    pub dissipation: Option<f64>,
    /// Contacts, summed over the samples.
    pub contacts: u64,
    /// Friction-activated contacts, summed.
    pub activated: u64,
    /// Rolling contacts, summed.
    pub rolling: u64,
    /// Approach velocity, summed over the contacts of all samples; positive for approach.
    pub approach: f64,
    /// Steadiness and correlation time of the viscosity.
    pub steadiness: Option<Steadiness>,
}

impl Averages {
    /// Averages the samples from step `discard_step` on.
    pub(crate) fn of(samples: &[(u64, Sample)], discard_step: u64) -> Self {
        let kept: Vec<&Sample> = samples
            .iter()
            .filter(|(step, _)| *step >= discard_step)
            .map(|(_, sample)| sample)
            .collect();
        let values = |quantity: fn(&Sample) -> f64| -> Vec<f64> {
            kept.iter().map(|sample| quantity(sample)).collect()
        };
        let mut means = [None; MEANS];
        for (of_number, number) in means.iter_mut().zip(sampled::means()) {
            let values = kept.iter().map(|sample| number.value(sample).number());
            let mut values: Vec<f64> = values.collect();
            if number.is_of_network() {
                values.retain(|value| !value.is_nan());
            }
            *of_number = mean(&values);
        }
        let sum = |count: fn(&Sample) -> u32| kept.iter().map(|s| u64::from(count(s))).sum();
        Self {
            samples: kept.len() as u64,
            viscosity: Distribution::of(values(|s| s.viscosity)),
            viscosity_stresslet: Distribution::of(values(|s| s.viscosity_stresslet)),
            normal_stress_difference: mean(&values(|s| s.normal_stress_difference)),
            means,
            dissipation: mean(&values(|s| s.dissipation)),
            contacts: sum(|s| s.contacts),
            activated: sum(|s| s.activated),
            rolling: sum(|s| s.sticking),
            approach: values(|s| -s.normal_velocity * f64::from(s.contacts))
                .iter()
                .sum(),
            steadiness: Steadiness::of(&values(|s| s.viscosity)),
        }
    }

    /// Contacts per sphere, averaged over the samples.
    pub(crate) fn contacts_per_sphere(&self, spheres: usize) -> Option<f64> {
        ratio(self.contacts as f64, (self.samples * spheres as u64) as f64)
    }

    /// Activated contacts over contacts.
    pub(crate) fn activated_fraction(&self) -> Option<f64> {
        ratio(self.activated as f64, self.contacts as f64)
    }

    /// Rolling contacts over activated ones.
    pub(crate) fn rolling_fraction(&self) -> Option<f64> {
        ratio(self.rolling as f64, self.activated as f64)
    }

    /// Mean approach velocity of a contact.
    pub(crate) fn mean_approach_velocity(&self) -> Option<f64> {
        ratio(self.approach, self.contacts as f64)
    }
}

/// A quotient; `None` where it is undefined.
pub(crate) fn ratio(numerator: f64, denominator: f64) -> Option<f64> {
    (denominator > 0.0).then(|| numerator / denominator)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::sample;

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

    #[test]
    fn discarded_samples_do_not_count() {
        let mut samples = vec![(0, sample(0.0)), (4, sample(0.02)), (8, sample(0.04))];
        samples[0].1.viscosity = 1e6;
        let averages = Averages::of(&samples, 4);
        assert_eq!(averages.samples, 2);
        assert!(averages.viscosity.unwrap().mean < 100.0);
        assert_eq!(averages.contacts, 2 * u64::from(sample(0.0).contacts));
    }

    #[test]
    fn no_contacts_no_fractions() {
        let averages = Averages::of(&[], 0);
        assert_eq!(averages.activated_fraction(), None);
        assert_eq!(averages.contacts_per_sphere(10), None);
        assert_eq!(averages.viscosity, None);
    }
}
