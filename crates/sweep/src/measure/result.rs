//! The result of a run, number by number: averages of its samples, and their places.

use super::numbers::{Level, Number, columns};
use super::point_run::PointRun;
use super::ratio;
use super::run::{Mean, RunData, Slope};
use crate::data::Value;
use sd_core::simulation::Counters;
use sd_core::{Params, Sample};
use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::LazyLock;

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
            final_fraction: None,
            order: [Vec::new(), Vec::new()],
            fractions: Vec::new(),
            displacements: [Slope::default(); 2],
            means: vec![Mean::default(); columns(Level::Runs).count()],
            last: None,
            free_viscosity: None,
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
        self.final_fraction = sample.fraction;
        let before = self.last.replace((step, sample.strain));
        if step < self.discard_step {
            return;
        }
        let [whole, of_stresslets] = self.viscosities_of(step, sample, before);
        self.viscosities.push(whole);
        self.stresslet_viscosities.push(of_stresslets);
        self.contacts += u64::from(sample.contacts);
        self.activated += u64::from(sample.activated);
        self.sticking += u64::from(sample.sticking);
        self.fractions.extend(sample.fraction);
        self.approach += -sample.normal_velocity * f64::from(sample.contacts);
        if let Some(structure) = &sample.structure {
            let time = if self.params.has_free_rate() {
                self.strain(step)
            } else {
                sample.strain
            };
            let [along_y, along_z] = &mut self.displacements;
            along_y.add(time, structure.displacement_yy);
            along_z.add(time, structure.displacement_zz);
            let [layering, bonds] = &mut self.order;
            layering.push(structure.layering);
            // One of them is of layers, and the other of suspensions.
            bonds.push(structure.psi_6.max(structure.q_6));
        }
        for (mean, number) in self.means.iter_mut().zip(columns(Level::Runs)) {
            if let Some(value) = number.averaged_value(sample) {
                mean.sum += value;
                mean.number += 1;
            }
        }
    }

    /// The viscosities of a sample, or where the rate is free the rate since the sample before, in
    /// σ/μ, and with it the stress of the stresslets, in σ.
    fn viscosities_of(&self, step: u64, sample: &Sample, before: Option<(u64, f64)>) -> [f64; 2] {
        let Some(stress) = self
            .params
            .shear_stress
            .filter(|_| self.params.has_free_rate())
        else {
            return [sample.viscosity, sample.viscosity_stresslet];
        };
        let rate = match before {
            Some((first, strain)) => (sample.strain - strain) / self.strain(step - first),
            None => sample.shear_rate / (6.0 * PI * stress),
        };
        [rate, rate + sample.stress.shear.hydrodynamic]
    }

    /// The mean in time of a number over the samples that have it.
    ///
    /// Where the rate is free stresses of samples are in σ, and those of the run in μ times its
    /// mean rate, as all stresses are.
    pub(super) fn mean(&self, name: &str) -> Option<f64> {
        let mean = self.means.get(place_of(name)?)?;
        let unit = match (self.free_viscosity, Number::named(name)?.unit) {
            (Some(viscosity), "mu rate") if name == "dissipation" => viscosity * viscosity,
            (Some(viscosity), "mu rate") => viscosity,
            _ => 1.0,
        };
        ratio(mean.sum, mean.number as f64).map(|mean| mean * unit)
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

impl PointRun {
    /// A number of its result by its name; `None` if it has none.
    pub fn number(&self, name: &str) -> Option<f64> {
        let number = self.numbers.get(place_of(name)?)?;
        (!number.is_nan()).then_some(*number)
    }
}

/// Place of a number among those of results.
fn place_of(name: &str) -> Option<usize> {
    static PLACES: LazyLock<HashMap<&str, usize>> = LazyLock::new(|| {
        let of_runs = columns(Level::Runs).enumerate();
        of_runs
            .map(|(place, number)| (number.name, place))
            .collect()
    });
    PLACES.get(name).copied()
}
