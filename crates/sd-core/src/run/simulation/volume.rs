//! The size of the cell under an imposed pressure.
//!
//! The cell dilates at the rate e of the contact problem, and carries the spheres along. Within a
//! step positions are those of the cell at its start; a stage multiplies them by the growth of the
//! cell since, and the step ends with the cell grown by its own rule:
//!
//! ```text
//! x(stage) = λ y,   λ = 1 + e τ/d;      dy/dt = L y + v(x)/λ
//! ```
//! with the e of the previous stage and the time τ since the start of the step. Where the cell
//! dilates along the gradient alone, λ = 1 + e τ multiplies that component alone. The images above
//! then travel by the integral of their height over the strain, which follows the rule of the
//! step, as positions do.
//!
//! Where the ratio of stress and pressure is imposed, the pressure of a step is that of the stress
//! at the last stage of the step before. So the mean of the pressure is exactly in that ratio to
//! the mean of the stress, and a step costs no more than under a given pressure.
//!
//! Under a stress imposed on Brownian spheres the rate of shear of the stages adds up likewise.

use super::Simulation;
use crate::contact::ImposedPressure;
use crate::error::Error;
use crate::hydrodynamics::resistance::Resistance;
use crate::model::PressureKind;
use crate::run::spaces::Starts;
use crate::run::steppers::{Stage, Stepper};
use crate::space::Space;
use crate::space::cell::Cell;
use std::f64::consts::PI;

/// The size of the cell.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extent {
    /// Side of the square or cubic cell, or of one with the content of the lattice, in a; where it
    /// dilates along the gradient alone, the side across that.
    pub(crate) side: f64,
    /// Height along the gradient over the side.
    pub(crate) height: f64,
    /// Distances along x and z by which the images above have travelled at the time `since`, not
    /// wrapped, where the height changes or the rate of shear is free.
    pub(crate) travelled: [f64; 2],
    pub(crate) since: f64,
    /// Viscosity of the last stage of the step before, where the ratio of stress and pressure is
    /// imposed.
    pub(crate) viscosity: f64,
}

impl Extent {
    /// The viscosity from which the pressure of a run's first step follows.
    pub(super) const FIRST_VISCOSITY: f64 = 10.0;
    /// Largest factor by which that pressure changes from step to step.
    const STRIDE: f64 = 2.0;
}

/// Strain over which the pressure rises at the start of a run. Spheres that do not touch yet would
/// otherwise make most of their contacts in the first step, whose contact problems then need
/// hundreds of linear systems.
const RISE: f64 = 0.2;

/// The viscous number below which a suspension counts as at rest where the ratio of stress and
/// pressure is imposed: the pressure rises no further, and a run that stays there for
/// [`JAM_STRAIN`](super::JAM_STRAIN) ends as arrested.
pub const ARREST_NUMBER: f64 = 1e-4;

/// A rate that the stages of a step determine, or of a part of one: of dilation or of shear.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StageRates {
    /// Time at its start.
    start: f64,
    /// The rates.
    rates: [f64; 4],
    /// What they have gained since the start, at the stages that were solved: growth of the cell's
    /// sides, less 1, or strain.
    gains: [f64; 4],
    stages: usize,
    /// That at the present stage.
    gain: f64,
    /// Viscosity of the stage solved last, where the ratio of stress and pressure is imposed.
    pub(super) viscosity: f64,
}

/// How a step of two stages grows the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Growth {
    /// At the rate of the second stage.
    Midpoint,
    /// At the mean of both rates.
    Mean,
}

impl Growth {
    /// The rule of a method.
    pub(super) fn of<S: Space>(stepper: &Stepper<S>) -> Self {
        match stepper {
            Stepper::Rosenbrock(_) => Self::Mean,
            Stepper::RungeKutta(_) | Stepper::Midpoint(_) => Self::Midpoint,
        }
    }

    /// The value of the step, from those of its stages.
    fn mean(self, [a, b, c, d]: [f64; 4], stages: usize) -> f64 {
        match (stages, self) {
            (4, _) => (a + 2.0 * (b + c) + d) / 6.0,
            (2, Self::Mean) => 0.5 * (a + b),
            (2, Self::Midpoint) => b,
            _ => a,
        }
    }
}

impl StageRates {
    /// Begins a stage, to which the rate of the previous stage, divided by `dimensions`, has led.
    fn begin(&mut self, stage: &Stage, dimensions: f64) {
        if stage.number == 0 {
            *self = Self {
                start: stage.time,
                ..Self::default()
            };
        } else {
            let last = self.rates[self.stages - 1];
            self.gain = last * (stage.time - self.start) / dimensions;
        }
    }

    /// Records the rate of the stage.
    pub(super) fn record(&mut self, rate: f64) {
        self.rates[self.stages % 4] = rate;
        self.gains[self.stages % 4] = self.gain;
        self.stages += 1;
    }

    /// Growth of the cell's sides since the start of the step, at the stage solved last.
    pub(super) fn growth(&self) -> f64 {
        1.0 + self.gain
    }

    /// The rate in the first stage.
    pub(super) fn first(&self) -> f64 {
        self.rates[0]
    }
}

/// A position or velocity in the cell grown by a factor.
pub(super) fn grown<S: Space>(kind: PressureKind, mut x: S::Vector, growth: f64) -> S::Vector {
    match kind {
        PressureKind::Isotropic => x * growth,
        PressureKind::Gradient => {
            x[1] *= growth;
            x
        }
    }
}

impl<S: Starts> Simulation<S> {
    /// Whether the height of the cell changes alone.
    pub(super) fn dilates_along_gradient(&self) -> bool {
        self.params.imposes_pressure() && self.params.pressure == PressureKind::Gradient
    }

    /// The dimensions in which the cell dilates.
    fn dilating(&self) -> f64 {
        match self.params.pressure {
            PressureKind::Isotropic => S::DIMENSIONS as f64,
            PressureKind::Gradient => 1.0,
        }
    }

    /// The sides of a sheared cell, in a, at the stage solved last.
    pub(super) fn sides(&self) -> S::Vector {
        let (Extent { side, height, .. }, growth) = (self.extent, self.dilations.growth());
        let mut sides = S::Vector::default();
        for k in 0..S::DIMENSIONS {
            sides[k] = match self.params.pressure {
                PressureKind::Isotropic => side * growth,
                PressureKind::Gradient if k == 1 => side * height * growth,
                PressureKind::Gradient => side,
            };
        }
        sides
    }

    /// Area or volume of the cell.
    pub(super) fn content(&self) -> f64 {
        let sides = self.sides();
        (0..S::DIMENSIONS).map(|k| sides[k]).product()
    }

    /// Begins a stage: returns the growth of the cell since the start of the step, if it can grow.
    pub(super) fn begin_dilation(&mut self, stage: &Stage) -> Option<f64> {
        if self.shear_control.is_thermal() {
            self.shears.begin(stage, 1.0);
        }
        if !self.params.imposes_pressure() {
            return None;
        }
        let dimensions = self.dilating();
        self.dilations.begin(stage, dimensions);
        Some(self.dilations.growth())
    }

    /// Share of the imposed pressure that acts: it rises over a strain from the start.
    fn risen(&self) -> f64 {
        let strain = self.dilations.start + self.params.time_step;
        (strain / RISE).min(1.0)
    }

    /// The pressure that is imposed on the present stage, if one is.
    pub(super) fn imposed_pressure(&self) -> Option<ImposedPressure> {
        let by_stress = |ratio: f64| self.extent.viscosity / ratio;
        let by_rate = self.params.viscous_number.map(f64::recip);
        let pressure = by_rate.or_else(|| self.params.macroscopic_friction.map(by_stress))?;
        Some(ImposedPressure {
            pressure: pressure * self.risen(),
            volume: S::volume(self.content(), self.solver.resistance.radii()),
            resistance: pressure / self.settings.volume_rate,
            kind: self.params.pressure,
        })
    }

    /// Ends a stage: the velocities become those relative to the cell at the start of the step.
    pub(super) fn end_dilation(&mut self, centres: &[S::Vector], velocities: &mut [f64]) {
        if !self.params.imposes_pressure() {
            return;
        }
        let (kind, dimensions) = (self.params.pressure, self.dilating());
        self.dilations.record(self.solver.contacts.dilation);
        let shrunk = self.dilations.growth().recip();
        let carried = self.solver.contacts.dilation / dimensions;
        let grows = |k: usize| kind == PressureKind::Isotropic || k == 1;
        let spheres = S::by_sphere_mut(velocities).iter_mut();
        let motions = S::by_sphere_mut(&mut self.motion).iter_mut();
        for ((u, motion), x) in spheres.zip(motions).zip(centres) {
            for k in (0..S::DIMENSIONS).filter(|&k| grows(k)) {
                u[k] *= shrunk;
                motion[k] += carried * x[k];
            }
        }
    }

    /// Grows cell and positions by the step, or the part of one, that was made.
    pub(super) fn end_growth(&mut self, rule: Growth, dt: f64, centres: &mut [S::Vector]) {
        let dilations = std::mem::take(&mut self.dilations);
        let shears = std::mem::take(&mut self.shears);
        if self.shear_control.is_thermal() {
            let strain = rule.mean(shears.rates, shears.stages) * dt;
            self.extent.travelled[0] += self.params.direction * strain * self.extent.side;
        }
        if !self.params.imposes_pressure() {
            return;
        }
        let StageRates {
            start,
            rates,
            gains,
            stages,
            viscosity,
            ..
        } = dilations;
        if self.params.macroscopic_friction.is_some() {
            let before = self.extent.viscosity;
            let highest = self.arrest_viscosity().unwrap_or(f64::INFINITY);
            self.extent.viscosity = viscosity
                .clamp(before / Extent::STRIDE, before * Extent::STRIDE)
                .min(highest);
        }
        let kind = self.params.pressure;
        let growth = 1.0 + rule.mean(rates, stages) * dt / self.dilating();
        match kind {
            PressureKind::Isotropic => self.extent.side *= growth,
            PressureKind::Gradient => {
                let lifted = 1.0 + rule.mean(gains, stages);
                self.extent.travelled = self.travelled_from(start, start + dt, lifted);
                self.extent.since = start + dt;
                self.extent.height *= growth;
            }
        }
        for x in centres {
            *x = grown::<S>(kind, *x, growth);
        }
    }

    /// Distances along x and z by which the images above have travelled at a later time of the
    /// step, from their mean height over that at its start.
    fn travelled_from(&self, from: f64, to: f64, lifted: f64) -> [f64; 2] {
        let (imposed, step) = (&self.imposed, self.params.time_step);
        let Extent {
            side,
            height,
            travelled: [along, cross],
            ..
        } = self.extent;
        let net = imposed.net_strain(to, step) - imposed.net_strain(from, step);
        let across = imposed.cross.at(to) - imposed.cross.at(from);
        let lifted = side * height * lifted;
        [along + net * lifted, cross + across * lifted]
    }

    /// Distances along x and z by which the upper image cell is shifted at a strain of the current
    /// step, not wrapped.
    pub(super) fn travelled_at(&self, strain: f64) -> [f64; 2] {
        if self.dilates_along_gradient() {
            // The stage before has moved the spheres to the present one.
            let before = self.dilations.stages.saturating_sub(1);
            let lifted = 1.0 + self.dilations.gains[before % 4];
            return self.travelled_from(self.extent.since, strain, lifted);
        }
        let side = self.extent.side;
        if self.shear_control.is_thermal() {
            let [along, cross] = self.extent.travelled;
            let gained = self.params.direction * self.shears.gain * side;
            return [self.offset + along + gained, cross];
        }
        let net = self.imposed.net_strain(strain, self.params.time_step);
        let travelled = net * side;
        [
            self.offset + travelled,
            self.imposed.cross.at(strain) * side,
        ]
    }

    /// Rate of the flow at the first stage of the step over that at the present one.
    pub(super) fn first_shear(&self) -> f64 {
        match self.shear_control.thermal_rate() {
            Some(rate) if self.shears.stages > 0 => self.shears.rates[0] / rate,
            _ => 1.0,
        }
    }

    /// Net strain of the shear, where its rate is free.
    pub(super) fn free_strain(&self) -> Option<f64> {
        let side = self.extent.side * self.params.direction;
        let is_free = self.shear_control.is_thermal();
        is_free.then(|| self.extent.travelled[0] / side)
    }

    /// Restores the size of the cell before a step or a part of one that is not made.
    pub(super) fn restore_extent(&mut self, extent: Extent) {
        self.extent = extent;
        self.dilations = StageRates::default();
        self.shears = StageRates::default();
    }

    /// Side of the square or cubic cell, or of one with the content of the cell, in a.
    pub fn side(&self) -> f64 {
        let Extent { side, height, .. } = self.extent;
        if height == 1.0 {
            side
        } else {
            side * height.powf((S::DIMENSIONS as f64).recip())
        }
    }

    /// Area fraction of a layer, volume fraction of a suspension.
    pub fn fraction(&self) -> f64 {
        if !self.params.imposes_pressure() {
            return self
                .params
                .volume_fraction
                .unwrap_or(self.params.area_fraction);
        }
        let spheres = self.radii().iter().map(|a| match S::DIMENSIONS {
            2 => PI * a * a,
            _ => 4.0 / 3.0 * PI * a.powi(3),
        });
        spheres.sum::<f64>() / self.content()
    }

    /// The viscosity at which a suspension counts as at rest, where the ratio of stress and
    /// pressure is imposed; none while the pressure rises.
    pub(super) fn arrest_viscosity(&self) -> Option<f64> {
        let ratio = self.params.macroscopic_friction?;
        (self.risen() >= 1.0).then_some(ratio / ARREST_NUMBER)
    }

    /// Refuses a cell that an imposed pressure has made too narrow.
    pub(super) fn check_width(&self, cell: &Cell<S>) -> Result<(), Error> {
        if !self.params.imposes_pressure() {
            return Ok(());
        }
        let range = Resistance::<S>::range(self.params.hydrodynamics);
        cell.check_range(self.radii(), range)
    }
}
