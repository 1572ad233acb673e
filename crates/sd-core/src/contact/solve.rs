//! The one contact problem, and its solution.
//!
//! Unknown are the velocities v, the normal forces f and the friction t of the candidate pairs; C and D are the rows that read v_n and
//! u_t off v, b and d what the background, gaps and springs add:
//!
//! ```text
//! R_FU v = F + Cᵀ f − Dᵀ t
//! normal      f ≥ 0,  w = C v + b + κ f ≥ 0,  f·w = 0
//! tangential  |t| ≤ ρ(f);   z = D v + d − μ t;   z = 0 inside the bound,  z > 0 only where t = ρ,  z < 0 only where t = −ρ
//! ```
//!
//! | law | κ | μ | ρ(f) |
//! | --- | --- | --- | --- |
//! | rigid | 0 | | |
//! | spring of stiffness k, over the time ahead s | 1/(k s); Hertz: its slope, iterated | | |
//! | roll-slip | | 1/K, D reads the motion that normal forces alone leave | ν f |
//! | coulomb | | 0 | ν f |
//! | stick-slide with springs k_t | | 1/(k_t s), d holds the stretch | ν f |
//! | stick-rotate | | 0, a second row for the spin | no bound |
//!
//! with f − F_crit in place of f for the reduced onset, and ρ = 0 where friction does not act. In the plane Coulomb's cone is this box: the
//! problem is linear once each contact is known to be open, to stick or to slide. [`newton`] finds that out; the linear algebra behind it is
//! [`dense`] in small layers and [`sparse`] in large ones.

mod cone;
pub(crate) mod dense;
pub(crate) mod newton;
pub(crate) mod path;
pub(crate) mod problem;
pub(crate) mod sparse;
mod tableau;
mod ways;

#[cfg(test)]
mod tests;
