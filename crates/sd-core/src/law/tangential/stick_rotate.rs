//! Spheres in loaded contact move as one rigid body.
//!
//! ```text
//! f > 0 (and f > F_crit):   u_t = 0,   Ω_i = Ω_j
//! ```
//!
//! They neither slip nor roll: a friction force without limit and a couple ±M hold them until the
//! normal force vanishes. The friction coefficient has no effect. Source: the stick-rotate model of
//! the paper's introduction (its ref. 19). The couple does no work, as Ω_i = Ω_j, and adds nothing
//! to the symmetric stress.

use super::FrictionConstraint;
use crate::law::Quantity;

/// Keyword in campaign files.
pub const KEYWORD: &str = "stick-rotate";
/// Description.
pub const MEANING: &str = "Loaded contacts neither slip nor roll.";
/// It has no parameters.
pub const PARAMETERS: &[&Quantity] = &[];
/// Slip and rotation.
pub const CONSTRAINT: FrictionConstraint = FrictionConstraint::SlipAndRotation;

/// There is no limit in loaded contact.
pub fn bound(_friction: f64, load: f64) -> f64 {
    if load > 0.0 { f64::INFINITY } else { 0.0 }
}
