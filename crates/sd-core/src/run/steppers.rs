//! Methods in time: Runge-Kutta of order four, and two stages per step for rigid contacts and for
//! forces that depend on the gaps.

mod midpoint;
pub(crate) mod rosenbrock;
mod runge_kutta;
mod state;

use crate::space::Space;
pub(crate) use midpoint::{Midpoint, Stages};
use rosenbrock::Rosenbrock;
pub use runge_kutta::RungeKutta;
pub(crate) use state::Stage;
pub use state::State;

/// The method of a run, with its workspace.
#[derive(Debug)]
pub(crate) enum Stepper<S: Space> {
    /// For contacts without constrained gaps.
    RungeKutta(RungeKutta<S>),
    /// For rigid contacts.
    Midpoint(Midpoint<S>),
    /// For gap-dependent forces of any stiffness.
    Rosenbrock(Rosenbrock<S>),
}

impl<S: Space> Default for Stepper<S> {
    fn default() -> Self {
        Self::RungeKutta(RungeKutta::default())
    }
}

impl<S: Space> Stepper<S> {
    /// One step. `rhs(stage, centres, velocities)` fills in the velocities at the given centres,
    /// and returns whether contacts have forces there.
    ///
    /// # Errors
    /// Errors of `rhs`; the state is then unchanged.
    pub(crate) fn step<E>(
        &mut self,
        state: &mut State<S>,
        time: f64,
        dt: f64,
        mut rhs: impl FnMut(Stage, &[S::Vector], &mut [f64]) -> Result<bool, E>,
    ) -> Result<(), E> {
        match self {
            Self::RungeKutta(method) => {
                method.step(state, time, dt, |stage, x, u| rhs(stage, x, u).map(|_| ()))
            }
            Self::Midpoint(method) => method.step(state, [time, dt], Stages::Both, rhs),
            Self::Rosenbrock(method) => {
                method.step(state, time, dt, |stage, x, u| rhs(stage, x, u).map(|_| ()))
            }
        }
    }
}
