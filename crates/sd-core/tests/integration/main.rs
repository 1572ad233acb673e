//! Tests of the library by its users: one module per subject, in one program, so that the library's
//! generics are compiled once. Counting allocations needs a program of its own.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod added_law;
mod brownian;
mod bulk;
mod common;
mod contact_laws;
mod contact_problems;
mod cross_shear;
mod examples;
mod flows;
mod imposed_stress;
mod incident_flow;
mod interface;
mod interrupted;
mod lattices;
mod layer;
mod lubrication;
mod motion;
mod pair;
mod pairwise;
mod pressure;
mod products;
mod recorded_laws;
mod reference;
mod sedimentation;
mod segments;
mod sizes;
mod soft_spheres;
mod stresses;
mod suspensions;
mod threads;
