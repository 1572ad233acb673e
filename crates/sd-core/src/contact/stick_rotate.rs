//! Spheres that touch move as one rigid body while they are pressed.
//!
//! ```text
//! f > 0 (and f > F_crit):   u_t = 0,   Ω_i = Ω_j
//! ```
//!
//! They neither slip nor roll: a friction force without limit and a couple ±M hold them, until the normal force would have to
//! pull. The friction coefficient has no part in it. Source: the stick-rotate model of the paper's introduction (its ref. 19).
//! The couple does no work, as Ω_i = Ω_j, and adds nothing to the symmetric stress.

/// Adds the transpose of the row Ω_j − Ω_i, times `f`, to forces `[3N]` whose first rows of i and j are given: the couple −f on i, f on j.
pub(super) fn add_spin(f: f64, [i, j]: [usize; 2], forces: &mut [f64]) {
    forces[i + 2] -= f;
    forces[j + 2] += f;
}
