//! The far field of a suspension: mobility of force, torque and stresslet, eleven modes a sphere,
//! in unbounded fluid or periodic.
//!
//! ```text
//! (U − u∞, Ω − Ω∞, −E∞) = M (F, T, S~)
//! ```
//! In a periodic cell the wave vector k = 0 is left out: velocities are those in the frame in which
//! the whole suspension has no mean flow, and E∞ is the mean rate of strain.

pub(super) mod dense_mobility;

pub(crate) use dense_mobility::DenseMobility;

#[cfg(test)]
mod tests;
