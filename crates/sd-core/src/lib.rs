//! Stokesian Dynamics of a sheared layer of rough, frictional spheres.

pub mod cell;
pub mod contact;
pub mod error;
pub mod far_field;
pub mod instant;
pub mod integrate;
pub mod linalg;
pub mod modes;
pub mod motion;
pub mod pair;
pub mod params;
pub mod resistance;
pub mod simulation;
pub mod start;
pub mod stress;
pub mod two_sphere;

pub use error::Error;
pub use params::{ContactScheme, Hydrodynamics, Params};
pub use resistance::NearFields;
pub use simulation::{Flow, Sample, Simulation, Snapshot};
