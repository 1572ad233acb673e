//! Steps in time: Runge-Kutta of order four, and two stages per step for forces that depend on the gaps.

pub mod rosenbrock;
pub mod runge_kutta;
