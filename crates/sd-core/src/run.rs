//! Runs: start layers, time stepping, simulation; single instants and pairs.

mod balance;
pub mod instant;
pub mod pair;
pub mod products;
pub mod simulation;
pub mod start;
pub(crate) mod started;
pub(crate) mod steppers;
pub mod verify;
