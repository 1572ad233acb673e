//! Methods in time: Runge-Kutta of order four, and two stages per step for rigid contacts and for forces that depend on the gaps.

mod midpoint;
pub mod rosenbrock;
mod runge_kutta;
mod state;

use crate::space::modes::Vec2;
pub(crate) use midpoint::Midpoint;
use rosenbrock::Rosenbrock;
pub use runge_kutta::RungeKutta;
pub(crate) use state::Bearing;
pub use state::{Stage, State};

/// The method of a run, with its workspace.
#[derive(Debug)]
pub(crate) enum Stepper {
    /// For contacts whose gaps are held by no law.
    RungeKutta(RungeKutta),
    /// For rigid contacts.
    Midpoint(Midpoint),
    /// For forces that depend on gaps, however stiffly.
    Rosenbrock(Rosenbrock),
}

impl Default for Stepper {
    fn default() -> Self {
        Self::RungeKutta(RungeKutta::default())
    }
}

impl Stepper {
    /// One step. `rhs(stage, centres, velocities)` fills in the velocities `[3N]` at the given centres, and says whether contacts bear forces
    /// there.
    ///
    /// # Errors
    /// Whatever `rhs` returns; the state is then unchanged.
    pub(crate) fn step<E>(
        &mut self,
        state: &mut State,
        time: f64,
        dt: f64,
        mut rhs: impl FnMut(Stage, &[Vec2], &mut [f64]) -> Result<Bearing, E>,
    ) -> Result<(), E> {
        match self {
            Self::RungeKutta(method) => {
                method.step(state, time, dt, |stage, x, u| rhs(stage, x, u).map(|_| ()))
            }
            Self::Midpoint(method) => method.step(state, time, dt, rhs),
            Self::Rosenbrock(method) => {
                method.step(state, time, dt, |stage, x, u| rhs(stage, x, u).map(|_| ()))
            }
        }
    }
}
