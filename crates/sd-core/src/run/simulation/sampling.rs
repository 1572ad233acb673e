//! Sampling of the stress in a step.
//!
//! Contacts that close within a step already have a force at its first stage, so that the viscosity
//! there is too high by about the step: 3 % at 0.025. With loaded rigid contacts the middle of the
//! step is sampled, whose forces hold the initial gaps over the whole step and so are their mean.
//! In all other cases the first stage is sampled.
//!
//! A step that is not measured has of its sample only what later steps depend on.

use super::{Sample, Simulation};
use crate::contact::{Quality, Status};
use crate::run::spaces::Starts;
use crate::run::steppers::Stage;
use crate::space::{IncidentFlow, VelocityGradient};
use crate::stress::{ContactCounts, Stress};
use std::f64::consts::PI;

/// What a step records.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepRecord {
    /// Strain at its start.
    pub(super) strain: f64,
    /// The sample, once taken.
    pub(super) sample: Option<Sample>,
    /// The smallest gap at its start, in a.
    pub(super) gap: f64,
    /// Whether a contact problem of it had no solution.
    pub(super) jammed: bool,
}

impl StepRecord {
    /// An empty record.
    pub(super) fn at(strain: f64) -> Self {
        Self {
            strain,
            sample: None,
            gap: f64::INFINITY,
            jammed: false,
        }
    }
}

impl<S: Starts> Simulation<S> {
    /// Counts a contact problem.
    pub(super) fn count(&mut self, quality: Quality) {
        let inexact = self.is_inexact(quality);
        let counters = &mut self.counters;
        counters.stages += 1;
        let unconverged = matches!(quality.status, Status::InexactFriction | Status::Failed);
        counters.unconverged_stages += u64::from(unconverged);
        counters.inexact_stages += u64::from(inexact);
        counters.jammed_stages += u64::from(quality.jammed());
        if !quality.jammed() {
            counters.worst_residual = counters.worst_residual.max(quality.residual);
            counters.worst_friction_error =
                counters.worst_friction_error.max(quality.friction_error);
        }
    }

    /// The flow that viscosities refer to.
    pub(super) fn primary_flow(&self) -> VelocityGradient<S> {
        VelocityGradient::of_type(self.params.flow, self.params.direction)
    }

    /// Stress of the contact problem solved last.
    pub(super) fn stress_of_stage(&mut self) -> Stress {
        let (content, primary) = (self.content(), self.primary_flow());
        let flow = self.background.into();
        let mut stress = self.stress.stress(&self.solver, &flow, &primary, content);
        if self.params.at_rest || self.shear_control.is_thermal() {
            (stress.viscosity, stress.viscosity_stresslet) = (f64::NAN, f64::NAN);
        }
        stress
    }

    /// Chooses whether the next step is measured.
    pub(in crate::run) fn measure(&mut self, is_measured: bool) {
        self.is_measured = is_measured;
    }

    /// Records a stage of the current step before its sample: at the first stage the smallest gap.
    pub(super) fn begin_sample(&self, jammed: bool, record: &mut StepRecord) {
        if record.sample.is_some() {
            return;
        }
        record.jammed |= jammed;
        if record.gap == f64::INFINITY {
            record.gap = self.solver.closest().map_or(f64::INFINITY, |pair| pair.gap);
        }
    }

    /// Samples the current step at the stage solved last, unless it has a sample.
    pub(super) fn take_sample(
        &mut self,
        stage: &Stage,
        centres: &[S::Vector],
        record: &mut StepRecord,
    ) {
        if record.sample.is_some() {
            return;
        }
        if !self.is_measured {
            // Jams show in the viscosity, but not under random forces.
            record.sample = Some(Sample {
                viscosity: match self.brownian {
                    Some(_) => f64::NAN,
                    None => self.stress_of_stage().viscosity,
                },
                ..Sample::default()
            });
            return;
        }
        let mut stress = self.stress_of_stage();
        if let Some(brownian) = &self.brownian {
            brownian.take_out(stage, &mut stress, self.primary_flow().rate_of_strain());
        }
        if self.frame.is_some() {
            self.fill_frame(stage, centres);
        }
        let pressure = self.brownian.is_none().then(|| {
            let flow = IncidentFlow::from(self.background);
            let work = &mut self.stress.pressure;
            self.solver.hydrodynamic_pressure(flow.strains(), work) / stress.volume
        });
        let counts = ContactCounts::of(&self.solver.contacts.list);
        record.sample = Some(Sample {
            strain: record.strain,
            viscosity: stress.viscosity,
            viscosity_stresslet: stress.viscosity_stresslet,
            normal_stress_difference: stress.components.n1.total(),
            stress: stress.components,
            shear_rate: self.shear_control.shear_rate(&self.params),
            dissipation: stress.dissipation,
            applied_power: self.forces.power(self.solver.velocities()) / stress.volume,
            contacts: counts.contacts,
            activated: counts.activated,
            sticking: counts.sticking,
            slipping: counts.slipping,
            normal_velocity: counts.normal_velocity,
            minimum_gap: record.gap,
            counters: self.counters,
            network: None,
            structure: None,
            pressure_hydrodynamic: pressure,
            fraction: self.params.imposes_pressure().then(|| self.fraction()),
        });
    }

    /// Ends the step: its sample, with the counters of the run so far.
    pub(super) fn count_step(&mut self, record: &StepRecord) -> Sample {
        let mut sample = record.sample.expect("every step is sampled");
        let (content, spheres) = (self.content(), self.params.spheres as f64);
        if let Some(brownian) = self.brownian.as_ref().filter(|_| self.is_measured) {
            let volume = S::volume(content, self.solver.resistance.radii());
            let strain = self.primary_flow().rate_of_strain();
            brownian.finish(&mut sample, [spheres, volume], strain, S::DIMENSIONS);
        }
        if let Some(stress) = self.shear_control.thermal_stress() {
            let side = self.extent.side * self.params.direction;
            let travelled = self.extent.travelled[0] - self.before.extent.travelled[0];
            let rate = travelled / (side * self.params.time_step);
            sample.shear_rate = 6.0 * PI * stress * rate;
        }
        let arrest = self.arrest_viscosity();
        let counters = &mut self.counters;
        counters.minimum_gap = counters.minimum_gap.min(record.gap);
        // Under random forces the viscosity of an instant says nothing of a jam.
        let viscosity = if self.brownian.is_some() {
            0.0
        } else {
            sample.viscosity
        };
        let rests = arrest.is_some_and(|arrest| viscosity >= arrest);
        counters.count_jam(viscosity, record.jammed || rests);
        sample.counters = *counters;
        sample
    }
}
