//! Spheres that touch do not slip at all within Coulomb's limit.
//!
//! ```text
//! |F_t| < ν f: u_t = 0 (sticks);   else F_t = ν f sign(u_t) (slips)
//! ```
//!
//! u_t is the slip of the pair among other spheres. Source: Coulomb (1785); as the rigid limit of
//! tangential springs in Cundall & Strack, Géotechnique 29, 47 (1979).

use super::FrictionConstraint;
use crate::law::Quantity;

/// Keyword in campaign files.
pub const KEYWORD: &str = "coulomb";
/// Description.
pub const MEANING: &str = "Coulomb's law: `|F_t| ≤ ν f`, without slip inside the bound.";
/// It has no parameters.
pub const PARAMETERS: &[&Quantity] = &[];
/// The slip of the pair among other spheres.
pub const CONSTRAINT: FrictionConstraint = FrictionConstraint::Slip;

/// Coulomb's limit.
pub fn bound(friction: f64, load: f64) -> f64 {
    friction * load
}
