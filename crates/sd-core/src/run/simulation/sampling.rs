//! Samples: what the layer bears at the start of a step.
//!
//! Rigid contacts hold their gaps at the end of the time that a stage looks ahead. Contacts that will only close within it bear a force
//! already, so that the viscosity of a step's own first stage is too high by about the step: 3 % at 0.025. A sample of rigid contacts
//! therefore solves the contact problem once more, looking ahead by [`SAMPLE_SPAN`]. The motion knows nothing of it.

use super::drive::Pass;
use super::{Sample, Scheme, SchemeMemory, Simulation};
use crate::contact::Quality;
use crate::error::Error;
use crate::geometry::cell::Cell;
use crate::geometry::modes::Vec2;
use crate::run::steppers::Stage;
use crate::stress::{ContactCounts, Stress};

/// How far the contacts of a sample look ahead at most, in strain.
pub const SAMPLE_SPAN: f64 = 0.001;

impl Simulation {
    /// Whether a sample takes a contact problem of its own.
    pub(super) fn samples_apart(&self, stage: &Stage) -> bool {
        let rigid = matches!(&self.scheme, Scheme::Laws { laws, .. } if !laws.is_soft());
        self.sampling && rigid && stage.span > SAMPLE_SPAN
    }

    /// A sample with a contact problem of its own. The positions are taken; all else is as before.
    pub(super) fn sample_apart(
        &mut self,
        stage: Stage,
        cell: &Cell,
        centres: &[Vec2],
    ) -> Result<Sample, Error> {
        let drive = self.drive;
        if let SchemeMemory::Laws(memory) = &self.memory {
            self.remembered.copy_from(memory);
        }
        let short = Stage {
            span: SAMPLE_SPAN,
            ..stage
        };
        let quality = self.solve_driven(short, cell, centres, Pass::First)?;
        self.count(quality);
        let stress = self.stress_of_stage();
        let sample = self.measure(stage.time, &stress);
        if let SchemeMemory::Laws(memory) = &mut self.memory {
            std::mem::swap(memory, &mut self.remembered);
        }
        self.drive = drive;
        self.stage.begin_step();
        Ok(sample)
    }

    /// Counts a contact problem.
    pub(super) fn count(&mut self, quality: Quality) {
        let counters = &mut self.counters;
        counters.stages += 1;
        counters.unconverged_stages += u64::from(!quality.converged());
        counters.jammed_stages += u64::from(quality.jammed);
        if !quality.jammed {
            counters.worst_residual = counters.worst_residual.max(quality.residual);
            counters.worst_friction_error =
                counters.worst_friction_error.max(quality.friction_error);
        }
    }

    /// Counts what the first stage of a step says.
    pub(super) fn count_first(&mut self, viscosity: f64, jammed: bool) {
        let gap = self.minimum_gap();
        self.counters.minimum_gap = self.counters.minimum_gap.min(gap);
        self.counters.count_jam(viscosity, jammed);
    }

    /// The smallest gap, in a.
    fn minimum_gap(&self) -> f64 {
        self.stage.closest().map_or(f64::INFINITY, |pair| pair.gap)
    }

    /// Stress of the contact problem solved last.
    pub(super) fn stress_of_stage(&mut self) -> Stress {
        let area = self.side * self.side;
        let stress = self.stress.stress(&self.stage, &self.background, area);
        stress.along(self.params.direction)
    }

    /// What the contact problem solved last says of the layer.
    pub(super) fn measure(&mut self, strain: f64, stress: &Stress) -> Sample {
        let contacts = &self.stage.contacts.list;
        if let Some(frame) = &mut self.frame {
            frame.solved(&self.stress.stresslets, contacts);
        }
        let counts = ContactCounts::of(contacts);
        Sample {
            strain,
            viscosity: stress.viscosity,
            viscosity_stresslet: stress.viscosity_stresslet,
            normal_stress_difference: stress.components.n1.total(),
            stress: stress.components,
            shear_rate: self.drive.shear_rate(&self.params),
            dissipation: stress.dissipation,
            contacts: counts.contacts,
            activated: counts.activated,
            rolling: counts.rolling,
            slipping: counts.slipping,
            normal_velocity: counts.normal_velocity,
            minimum_gap: self.minimum_gap(),
            counters: self.counters,
        }
    }
}
