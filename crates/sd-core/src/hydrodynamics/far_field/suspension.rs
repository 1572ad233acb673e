//! The far field of a suspension: mobility of force, torque and stresslet, eleven modes a sphere,
//! in unbounded fluid or periodic.
//!
//! ```text
//! (U − u∞, Ω − Ω∞, −E∞) = M (F, T, S~)
//! ```
//! In a periodic cell the wave vector k = 0 is left out: velocities are those in the frame in which
//! the whole suspension has no mean flow, and E∞ is the mean rate of strain.

mod bulk_grid;
mod dense_mobility;
mod mobility_operator;

pub(crate) use dense_mobility::DenseMobility;
pub(crate) use mobility_operator::MobilityOperator;

#[cfg(test)]
mod tests;
