//! One run: what its result is made from, and the result.

use super::doubt::Doubt;
use super::numbers::{Level, Number, columns};
use super::{Distribution, Steadiness, ratio};
use crate::data::Value;
use crate::model::case::State;
use sd_core::simulation::Counters;
use sd_core::{Params, Sample};
use std::collections::HashMap;
use std::sync::{Arc, LazyLock};

/// What the result of a run is made from: its samples are added in their order, and not kept.
#[derive(Debug)]
pub(crate) struct RunData<'p> {
    pub(crate) params: &'p Params,
    pub(crate) discard_step: u64,
    pub(crate) steps: u64,
    /// Counters of all steps.
    pub(crate) counters: Counters,
    pub(crate) wall_time_s: f64,
    pub(crate) cpu_time_s: f64,
    pub(crate) resumed: u64,
    pub(crate) finished_at: u64,
    /// Viscosities of the averaged samples, all of them for quartiles and correlations.
    pub(crate) viscosities: Vec<f64>,
    pub(crate) stresslet_viscosities: Vec<f64>,
    pub(super) contacts: u64,
    pub(super) activated: u64,
    pub(super) sticking: u64,
    /// Approach velocities, summed over the contacts of all samples.
    pub(super) approach: f64,
    /// Means in time of the numbers of results.
    means: Vec<Mean>,
    pub(super) viscosity: Option<Distribution>,
    pub(super) viscosity_stresslet: Option<Distribution>,
    pub(super) steadiness: Option<Steadiness>,
}

/// A mean in progress.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    number: u64,
}

impl<'p> RunData<'p> {
    /// Without samples: those before step `discard_step` are left out.
    pub(crate) fn new(params: &'p Params, discard_step: u64) -> Self {
        Self {
            params,
            discard_step,
            steps: 0,
            counters: Counters::default(),
            wall_time_s: 0.0,
            cpu_time_s: 0.0,
            resumed: 0,
            finished_at: 0,
            viscosities: Vec::new(),
            stresslet_viscosities: Vec::new(),
            contacts: 0,
            activated: 0,
            sticking: 0,
            approach: 0.0,
            means: vec![Mean::default(); columns(Level::Runs).count()],
            viscosity: None,
            viscosity_stresslet: None,
            steadiness: None,
        }
    }

    /// The samples from step `discard_step` on.
    pub(crate) fn of(params: &'p Params, samples: &[(u64, Sample)], discard_step: u64) -> Self {
        let mut run = Self::new(params, discard_step);
        for (step, sample) in samples {
            run.add(*step, sample);
        }
        run.finish();
        run
    }

    /// Adds a sample.
    pub(crate) fn add(&mut self, step: u64, sample: &Sample) {
        if step < self.discard_step {
            return;
        }
        self.viscosities.push(sample.viscosity);
        self.stresslet_viscosities.push(sample.viscosity_stresslet);
        self.contacts += u64::from(sample.contacts);
        self.activated += u64::from(sample.activated);
        self.sticking += u64::from(sample.sticking);
        self.approach += -sample.normal_velocity * f64::from(sample.contacts);
        for (mean, number) in self.means.iter_mut().zip(columns(Level::Runs)) {
            if let Some(value) = number.averaged_value(sample) {
                mean.sum += value;
                mean.number += 1;
            }
        }
    }

    /// Computes what needs all samples.
    pub(crate) fn finish(&mut self) {
        self.steadiness = Steadiness::of(&self.viscosities);
        self.viscosity = Distribution::of(self.viscosities.clone());
        self.viscosity_stresslet = Distribution::of(self.stresslet_viscosities.clone());
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> u64 {
        self.viscosities.len() as u64
    }

    /// The mean in time of a number over the samples that have it.
    pub(super) fn mean(&self, name: &str) -> Option<f64> {
        let mean = self.means.get(place_of(name)?)?;
        ratio(mean.sum, mean.number as f64)
    }

    /// Strain after some steps.
    pub(super) fn strain(&self, steps: u64) -> f64 {
        steps as f64 * self.params.time_step
    }

    /// The numbers of its result, in the order of [`NUMBERS`].
    pub(crate) fn result(&self) -> impl Iterator<Item = Option<Value>> {
        columns(Level::Runs).map(|number| number.of_run(self))
    }

    /// One of these numbers.
    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        Some(Number::named(name)?.of_run(self)?.number())
    }
}

/// One run of a point, with its result if it has one.
#[derive(Debug, Clone)]
pub struct PointRun {
    /// Its position in the campaign file, from 0.
    pub position: u64,
    /// Its key.
    pub key: String,
    /// Its parameters.
    pub params: Arc<Params>,
    /// Its seed.
    pub seed: u64,
    /// Its state.
    pub state: State,
    /// Reasons why its numbers are doubtful, if any.
    pub doubts: Vec<Doubt>,
    /// Strain between samples.
    pub sample_every: f64,
    /// Numbers of its result, in the order of [`NUMBERS`]; NaN for missing ones, empty without a
    /// result.
    pub(crate) numbers: Box<[f64]>,
}

impl PointRun {
    /// Whether it is finished, and broke a rule.
    pub fn is_doubtful(&self) -> bool {
        self.state == State::Done && !self.doubts.is_empty()
    }

    /// Whether it is finished and included in averages.
    pub fn is_sound(&self) -> bool {
        self.state == State::Done && self.doubts.is_empty()
    }

    /// A number of its result by its name; `None` if it has none.
    pub fn number(&self, name: &str) -> Option<f64> {
        let number = self.numbers.get(place_of(name)?)?;
        (!number.is_nan()).then_some(*number)
    }

    /// Strain discarded.
    pub fn discard(&self) -> Option<f64> {
        Some(self.number("discard_step")? * self.params.time_step)
    }

    /// Measures of steadiness.
    pub(crate) fn steadiness(&self) -> Option<Steadiness> {
        let part = |name| self.number(name);
        Some(Steadiness {
            parts: [
                part("viscosity_part_1")?,
                part("viscosity_part_2")?,
                part("viscosity_part_3")?,
                part("viscosity_part_4")?,
            ],
            variance: part("viscosity_variance")?,
            correlation: part("viscosity_correlation")?,
        })
    }
}

/// Place of a number among those of results.
pub(super) fn place_of(name: &str) -> Option<usize> {
    static PLACES: LazyLock<HashMap<&str, usize>> = LazyLock::new(|| {
        let of_runs = columns(Level::Runs).enumerate();
        of_runs
            .map(|(place, number)| (number.name, place))
            .collect()
    });
    PLACES.get(name).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{params, sample};

    #[test]
    fn discarded_samples_do_not_count() {
        let mut samples = vec![(0, sample(0.0)), (4, sample(0.02)), (8, sample(0.04))];
        samples[0].1.viscosity = 1e6;
        let params = params();
        let run = RunData::of(&params, &samples, 4);
        assert_eq!(run.number("samples"), Some(2.0));
        assert!(run.number("viscosity").unwrap() < 100.0);
        assert_eq!(run.contacts, 2 * u64::from(sample(0.0).contacts));
    }

    #[test]
    fn no_contacts_no_fractions() {
        let params = params();
        let run = RunData::of(&params, &[], 0);
        for name in [
            "activated_fraction",
            "contacts_per_sphere",
            "viscosity",
            "n1",
        ] {
            assert_eq!(run.number(name), None, "{name}");
        }
    }
}
