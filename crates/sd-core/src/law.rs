//! The constitutive laws of contact: pure functions of numbers, one file each.
//!
//! A file states its equation, units and source, its keyword in campaign files, and its parameters.
//! A law is added in a file of its own and by one line in the list of its kind: [`normal`] or
//! [`tangential`]. Everything that lists laws (reading and checking of parameters, campaign files,
//! tables, pages) reads these declarations.
//!
//! This module is at the lowest level of the crate: it depends on no sphere, matrix or other
//! module.

pub mod adhesion;
pub mod colloid_unit;
mod custom;
pub mod hydrodynamic_friction;
mod keywords;
pub mod normal;
pub mod onset;
pub mod quantity;
pub mod repulsion;
pub mod rolling_friction;
pub mod stiffness_unit;
pub mod tangential;
pub mod van_der_waals;

pub use colloid_unit::ColloidUnit;
pub use custom::CustomNormalLaw;
pub(crate) use keywords::words;
pub use keywords::{Keyword, Keywords};
pub use normal::NormalLaw;
pub use onset::FrictionOnset;
pub use quantity::{Quantity, Range};
pub use stiffness_unit::StiffnessUnit;
pub use tangential::{FrictionConstraint, TangentialLaw};
