//! Spheres in unbounded fluid at the level of force, torque and stresslet: their modes, the
//! coupling of two, and the mobility of one and of two.
//!
//! - `kernels`: radial functions and lanes of the planar modes, and the effect of finite size
//! - `planar`: mobility in the plane of a layer
//! - `coupling`: the modes of two spheres in three dimensions, by fifteen numbers
//! - `spatial`: mobility in three dimensions

pub(crate) mod coupling;
pub(crate) mod kernels;
pub(crate) mod planar;
pub(crate) mod spatial;
