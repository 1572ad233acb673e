//! Structure of the spheres at an instant: pair distributions, contacts, networks; averaged over
//! frames and runs.
//!
//! ```text
//! network     spheres in their cell and their loaded contacts, of a layer or a suspension
//! pairs       g(r), g(r, θ)
//! contacts    directions, fabric, distributions of forces
//! clusters    clusters of contacts, and whether they percolate in the sheared cell
//! core        k-core, rattlers
//! pebble      rigid clusters of a layer
//! order       lanes, bond orientation, waves of number and shear rate
//! constraints degree of hyperstaticity
//! profiles    velocity and fraction along gradient and vorticity
//! sampled     the numbers of these that every run samples
//! scalars     one number each of an instant
//! outside     frames of other programs
//! average     sums over the frames of a run, and means over runs with their intervals
//! ```

mod average;
mod bins;
mod clusters;
mod constraints;
mod contacts;
mod core;
mod network;
mod order;
mod outside;
mod pairs;
mod pebble;
mod profiles;
mod sampled;
mod scalars;
#[cfg(test)]
mod tests;

pub(crate) use average::{Curve, RunStructure, Structure};
pub(crate) use clusters::clusters;
pub(crate) use network::{Link, Network};
pub use outside::OutsideFrame;
pub(crate) use pairs::reach;
pub(crate) use sampled::{Reference, sampled};
pub(crate) use scalars::{NAMED, observe};
