//! Contact between rough spheres: which pairs touch, with what forces.
//!
//! ```text
//! normal force f ≥ 0:  −f n on i, +f n on j             v_n = n·(U_j − U_i)
//! friction F_t:        +F_t t on i, −F_t t on j,         u_t = t·(U_j − U_i) − (l_i Ω_i + l_j Ω_j)
//!                      torques l_i F_t, l_j F_t          t = (−n_y, n_x), l = a + g/2
//! rolling friction:    torques +a_ij F_r on i, −a_ij F_r on j,        u_r = a_ij (Ω_j − Ω_i)
//! ```
//!
//! In a suspension slip, friction and rolling are vectors across the line of centres, with d any direction there:
//!
//! ```text
//! u_d = d·(U_j − U_i) − (n × d)·(l_i Ω_i + l_j Ω_j)          u_r,d = a_ij (n × d)·(Ω_j − Ω_i);  twist about n is free
//! ```
//!
//! Every law is entries of one problem, stated at the top of `contact/solve.rs`. `laws` says what a law comes to at a stage, `solver` chooses the pairs that
//! take part, poses the problem and takes its solution. `procedure` stays apart: it is a protocol, not a law.

pub(crate) mod adhesion;
pub(crate) mod laws;
pub(crate) mod memory;
pub(crate) mod pair;
pub(crate) mod repulsion;
mod row;
pub(crate) mod solve;
pub(crate) mod solver;
pub(crate) mod springs;

pub use crate::model::Surface;
pub use laws::{ForceLaw, Laws, NormalForce};
pub(crate) use memory::ContactMemory;
pub use memory::PairForces;
pub use pair::{Contact, ContactState};
pub(crate) use solver::{ContactSolver, Pass};

/// What became of a contact problem. The same for every law and for dense, sparse and iterated
/// hydrodynamics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Status {
    /// All conditions hold.
    #[default]
    Solved,
    /// Gaps hold, but the bound of friction is not that of the present load everywhere; by how
    /// much is [`Quality::friction_error`].
    InexactFriction,
    /// No motion keeps the gaps: forces grow without bound, and the layer is jammed at this instant.
    NoAdmissibleMotion,
    /// The solver failed: a linear system had no solution, curved springs or the far field did not converge.
    Failed,
}

/// How well a stage's contact problem was solved.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quality {
    /// What became of it.
    pub status: Status,
    /// Largest violation of the conditions on normal forces and gaps, in a·rate: `max |min(G f, w)|`, G the mobility of
    /// a contact.
    pub residual: f64,
    /// Largest distance between a friction force and what the law gives, over the largest force.
    pub friction_error: f64,
    /// Linear systems solved.
    pub systems: u32,
}

impl Quality {
    /// Residual up to which gaps hold, in a·rate: 5e-9 a in a step of 0.005.
    pub const RESIDUAL_LIMIT: f64 = 1e-6;
    /// Friction error up to which friction is exact.
    pub const FRICTION_LIMIT: f64 = 1e-6;
    /// Normal force, in mu·a²·rate, that counts as unbounded: its stress is some thousand times that above which a layer counts as
    /// jammed.
    pub(crate) const UNBOUNDED: f64 = 1e7;

    /// Whether all conditions hold.
    pub fn converged(&self) -> bool {
        self.status == Status::Solved
    }

    /// Whether the layer is jammed at this instant.
    pub fn jammed(&self) -> bool {
        self.status == Status::NoAdmissibleMotion
    }
}

use crate::space::Space;

/// Most spheres for which room is made in advance for all contacts there can be.
const MOST_RESERVED: usize = 1000;

/// Contacts for which room is made in advance.
pub(crate) fn most_contacts<S: Space>(spheres: usize) -> usize {
    S::MOST_CONTACTS / 2 * spheres.min(MOST_RESERVED)
}
