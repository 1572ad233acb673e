//! Steps in time: Runge-Kutta of order four, and two stages per step for forces that depend on the gaps.

pub mod runge_kutta;
pub mod two_stage;
