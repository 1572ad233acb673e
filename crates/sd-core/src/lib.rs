//! Stokesian Dynamics of a sheared layer of rough, frictional spheres.

pub mod cell;
pub mod error;
pub mod far_field;
pub mod instant;
pub mod linalg;
pub mod modes;
pub mod pair;
pub mod params;
pub mod simulation;
pub mod two_sphere;

pub use error::Error;
pub use params::{ContactScheme, Hydrodynamics, Params};
pub use simulation::{Sample, Simulation, Snapshot};
