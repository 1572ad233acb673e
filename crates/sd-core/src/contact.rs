//! Contact between rough spheres: which pairs touch, with what forces.
//!
//! ```text
//! normal force f ≥ 0:  −f n on i, +f n on j             v_n = n·(U_j − U_i)
//! friction F_t:        +F_t t on i, −F_t t on j,         u_t = t·(U_j − U_i) − (l_i Ω_i + l_j Ω_j)
//!                      torques l_i F_t, l_j F_t          t = (−n_y, n_x), l = a + g/2
//! ```
//!
//! Every law is entries of one problem, stated at the top of `contact/solve.rs`. [`laws`] says what a law comes to at a stage, [`solver`] chooses the pairs that
//! take part, poses the problem and takes its solution. [`procedure`] stays apart: it is a protocol, not a law.

pub mod laws;
pub mod pair;
pub mod procedure;
pub mod repulsion;
mod row;
mod solve;
pub mod solver;
pub mod springs;
pub mod warm_start;

pub use crate::model::Surface;
pub use pair::{Contact, ContactState, tangent};
pub use solver::{ContactMemory, ContactSolver};

/// How well a stage's contact problem was solved.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quality {
    /// Largest violation of the conditions, in a·rate: `max |min(G f, w)|` and its like for friction, G the mobility of a contact.
    pub residual: f64,
    /// Largest distance between a friction force and what the law gives, over the largest force.
    pub friction_error: f64,
    /// Whether the problem has no solution, so that the layer is jammed at this instant: forces and velocities are then those of contacts
    /// that give way, and residual and friction error say by how much.
    pub jammed: bool,
    /// Linear systems solved.
    pub systems: u32,
}

impl Quality {
    /// Residual above which a stage counts as unconverged.
    pub const RESIDUAL_LIMIT: f64 = 1e-8;
    /// Friction error above which a stage counts as unconverged.
    pub const FRICTION_LIMIT: f64 = 1e-6;

    /// Whether the problem was solved, or found to have no solution.
    pub fn converged(&self) -> bool {
        self.jammed || Self::holds(self.residual, self.friction_error)
    }

    /// Whether the conditions hold with such a residual and friction error.
    pub(crate) fn holds(residual: f64, friction_error: f64) -> bool {
        residual <= Self::RESIDUAL_LIMIT && friction_error <= Self::FRICTION_LIMIT
    }
}

/// Most spheres for which room is made in advance for all contacts there can be.
const MOST_RESERVED: usize = 1000;

/// Most contacts of equal spheres in a plane: six for each sphere. Unequal ones hardly have more.
pub fn most_contacts(spheres: usize) -> usize {
    3 * spheres.min(MOST_RESERVED)
}
