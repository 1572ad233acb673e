//! A constant attraction of surfaces that touch: what it takes to pull them apart.
//!
//! ```text
//! contact force f ≥ 0 of the normal law, and −F_A besides while the surfaces touch:    f − F_A ≥ −F_A
//! springs touch while g < h,   rigid asperities while g < 1.01 h
//! ```
//!
//! along the line of centres. A pair that is pulled keeps touching until the pull is F_A. It then opens, and the attraction is gone. The load
//! that friction knows is f, so that adhesion presses: two spheres that nothing else pushes bear f = F_A. Source: the force in contact of
//! Pednekar, Chun & Morris, Soft Matter 13, 1773 (2017), and Singh et al., Phys. Rev. Lett. 122, 098004 (2019), whose van der Waals attraction
//! is constant there, without its range.

use super::Quantity;
use super::quantity::Range;

/// F_A, in units in which it is a property of the material while Γ varies.
pub static ADHESION: Quantity = Quantity {
    key: "adhesion",
    symbol: "F_A",
    unit: "F_crit",
    meaning: "adhesion F_A",
    range: Range::from_to(0.0, 1e6),
    note: "in F_crit, the force that pulls a contact apart",
    example: "1",
    logarithmic: false,
};

/// Share of the roughness height by which rigid asperities may be apart and touch still: gaps are held at h but for what a step leaves,
/// which is 2e-3 of h at the usual steps.
const RIGID_RANGE: f64 = 0.01;

/// Gap, in a, below which surfaces touch.
pub fn range(roughness: f64, is_rigid: bool) -> f64 {
    if is_rigid {
        (1.0 + RIGID_RANGE) * roughness
    } else {
        roughness
    }
}
