//! Adhesion: a constant attraction of touching surfaces, equal to their pull-off force.
//!
//! ```text
//! contact force f ≥ 0 of the normal law, plus −F_A while the surfaces touch:    f − F_A ≥ −F_A
//! springs touch while g < h,   rigid asperities while g < 1.01 h
//! ```
//!
//! along the line of centres. A pulled pair stays in contact until the pull reaches F_A. It then
//! opens, and the attraction vanishes. The load for friction is f, so that adhesion adds to it: two
//! spheres without other forces have f = F_A. Source: the force in contact of Pednekar, Chun &
//! Morris, Soft Matter 13, 1773 (2017), and Singh et al., Phys. Rev. Lett. 122, 098004 (2019),
//! whose van der Waals attraction is constant there, without its range.

use super::Quantity;
use super::quantity::Range;

/// F_A, in units in which it is a property of the material while Γ varies.
pub static ADHESION: Quantity = Quantity {
    key: "adhesion",
    unit: "F_crit",
    meaning: "adhesion F_A",
    range: Range::from_to(0.0, 1e6),
    note: "in F_crit, the force that pulls a contact apart",
};

/// Separation up to which rigid asperities count as touching, over the roughness height: gaps are
/// held at h up to the error of a step, which is 2e-3 of h at default steps.
const RIGID_RANGE: f64 = 0.01;

/// Gap, in a, below which surfaces touch.
pub fn range(roughness: f64, is_rigid: bool) -> f64 {
    if is_rigid {
        (1.0 + RIGID_RANGE) * roughness
    } else {
        roughness
    }
}
