//! Methods in time: Runge-Kutta of order four, and two stages per step for forces that depend on the gaps.

pub mod rosenbrock;
mod runge_kutta;
mod state;

use crate::geometry::modes::Vec2;
use rosenbrock::Rosenbrock;
pub use runge_kutta::RungeKutta;
pub use state::{Stage, State};

/// The method of a run, with its workspace.
#[derive(Debug)]
pub(crate) enum Stepper {
    /// For forces that do not depend on gaps, or hold them.
    RungeKutta(RungeKutta),
    /// For forces that depend on gaps, however stiffly.
    Rosenbrock(Rosenbrock),
}

impl Default for Stepper {
    fn default() -> Self {
        Self::RungeKutta(RungeKutta::default())
    }
}

impl Stepper {
    /// One step. `rhs(stage, centres, velocities)` fills in the velocities `[3N]` at the given centres.
    ///
    /// # Errors
    /// Whatever `rhs` returns; the state is then unchanged.
    pub(crate) fn step<E>(
        &mut self,
        state: &mut State,
        time: f64,
        dt: f64,
        rhs: impl FnMut(Stage, &[Vec2], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        match self {
            Self::RungeKutta(method) => method.step(state, time, dt, rhs),
            Self::Rosenbrock(method) => method.step(state, time, dt, rhs),
        }
    }

    /// A step with the velocities of the first stage alone: of order one.
    ///
    /// # Errors
    /// Whatever `rhs` returns; the state is then unchanged.
    pub(crate) fn first_stage_alone<E>(
        &mut self,
        state: &mut State,
        time: f64,
        dt: f64,
        rhs: impl FnOnce(Stage, &[Vec2], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        match self {
            Self::RungeKutta(method) => method.first_stage_alone(state, time, dt, rhs),
            Self::Rosenbrock(_) => unreachable!("forces that depend on gaps let them overlap"),
        }
    }
}
