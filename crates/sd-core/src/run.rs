//! Runs: start layers, time stepping, simulation; single instants and pairs.

mod balance;
pub(crate) mod cell_path;
pub(crate) mod compiled;
pub(crate) mod instant;
pub mod pair;
pub mod products;
pub mod simulation;
pub(crate) mod spaces;
pub mod start;
pub(crate) mod steppers;
pub mod transport;
