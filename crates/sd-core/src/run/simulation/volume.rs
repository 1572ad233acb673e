//! The volume of the cell under an imposed pressure.
//!
//! The cell dilates at the rate e of the contact problem, and carries the spheres along. Within a
//! step positions are those of the cell at its start; a stage multiplies them by the growth of the
//! cell since, and the step ends with the cell grown by its own rule:
//!
//! ```text
//! x(stage) = λ y,   λ = 1 + e τ/d;      dy/dt = L y + v(x)/λ
//! ```
//! with the e of the stage before and the time τ since the start of the step.

use super::Simulation;
use crate::contact::ImposedPressure;
use crate::error::Error;
use crate::hydrodynamics::resistance::Resistance;
use crate::run::spaces::Starts;
use crate::run::steppers::{Stage, Stepper};
use crate::space::Space;
use crate::space::cell::Cell;
use std::f64::consts::PI;

/// The rates of dilation in the stages of a step, or of a part of one.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Dilations {
    /// Time at its start.
    start: f64,
    rates: [f64; 4],
    stages: usize,
    /// Growth of the cell's sides since then, less 1.
    gain: f64,
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
}

impl Dilations {
    /// Growth of the cell's sides since the start of the step, at the stage solved last.
    pub(super) fn growth(&self) -> f64 {
        1.0 + self.gain
    }

    /// The rate in the first stage.
    pub(super) fn first(&self) -> f64 {
        self.rates[0]
    }
}

impl<S: Starts> Simulation<S> {
    /// Begins a stage: returns the growth of the cell since the start of the step, if it can grow.
    pub(super) fn begin_dilation(&mut self, stage: &Stage) -> Option<f64> {
        let number = self.params.viscous_number?;
        let dilations = &mut self.dilations;
        if stage.number == 0 {
            *dilations = Dilations {
                start: stage.time,
                ..Dilations::default()
            };
        } else {
            let last = dilations.rates[dilations.stages - 1];
            dilations.gain = last * (stage.time - dilations.start) / S::DIMENSIONS as f64;
        }
        let side = self.side * dilations.growth();
        let content = (0..S::DIMENSIONS).map(|_| side).product();
        let pressure = number.recip();
        let growth = dilations.growth();
        self.solver.contacts.pressure = Some(ImposedPressure {
            pressure,
            volume: S::volume(content, self.solver.resistance.radii()),
            resistance: pressure / self.settings.volume_rate,
        });
        Some(growth)
    }

    /// Ends a stage: the velocities become those relative to the cell at the start of the step.
    pub(super) fn end_dilation(&mut self, centres: &[S::Vector], velocities: &mut [f64]) {
        if self.params.viscous_number.is_none() {
            return;
        }
        let dilations = &mut self.dilations;
        dilations.rates[dilations.stages % 4] = self.solver.contacts.dilation;
        dilations.stages += 1;
        let shrunk = dilations.growth().recip();
        let carried = self.solver.contacts.dilation / S::DIMENSIONS as f64;
        let spheres = S::by_sphere_mut(velocities).iter_mut();
        let motions = S::by_sphere_mut(&mut self.motion).iter_mut();
        for ((u, motion), x) in spheres.zip(motions).zip(centres) {
            for k in 0..S::DIMENSIONS {
                u[k] *= shrunk;
                motion[k] += carried * x[k];
            }
        }
    }

    /// Grows cell and positions by the step, or the part of one, that was made.
    pub(super) fn end_growth(&mut self, rule: Growth, dt: f64, centres: &mut [S::Vector]) {
        let Dilations { rates, stages, .. } = std::mem::take(&mut self.dilations);
        if self.params.viscous_number.is_none() {
            return;
        }
        let [a, b, c, d] = rates;
        let rate = match (stages, rule) {
            (4, _) => (a + 2.0 * (b + c) + d) / 6.0,
            (2, Growth::Mean) => 0.5 * (a + b),
            (2, Growth::Midpoint) => b,
            _ => a,
        };
        let growth = 1.0 + rate * dt / S::DIMENSIONS as f64;
        self.side *= growth;
        for x in centres {
            *x = *x * growth;
        }
    }

    /// Restores the side of the cell before a step or a part of one that is not made.
    pub(super) fn restore_side(&mut self, side: f64) {
        self.side = side;
        self.dilations = Dilations::default();
    }

    /// Area fraction of a layer, volume fraction of a suspension.
    pub fn fraction(&self) -> f64 {
        if self.params.viscous_number.is_none() {
            return self
                .params
                .volume_fraction
                .unwrap_or(self.params.area_fraction);
        }
        let side = self.side * self.dilations.growth();
        let content: f64 = (0..S::DIMENSIONS).map(|_| side).product();
        let spheres = self.radii().iter().map(|a| match S::DIMENSIONS {
            2 => PI * a * a,
            _ => 4.0 / 3.0 * PI * a.powi(3),
        });
        spheres.sum::<f64>() / content
    }

    /// Refuses a cell that an imposed pressure has made too narrow.
    pub(super) fn check_width(&self, cell: &Cell<S>) -> Result<(), Error> {
        if self.params.viscous_number.is_none() {
            return Ok(());
        }
        let range = Resistance::<S>::range(self.params.hydrodynamics);
        cell.check_range(self.radii(), range)
    }
}
