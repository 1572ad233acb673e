//! A run: its first layer, its steps in time, the simulation of them, and the instants and pairs that check it.

mod balance;
pub mod instant;
pub mod pair;
pub mod simulation;
pub mod start;
pub(crate) mod started;
pub(crate) mod steppers;
pub mod verify;
