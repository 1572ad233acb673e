//! Contacts between rough spheres: which pairs touch, and with what forces.
//!
//! ```text
//! normal force f ≥ 0:  −f n on i, +f n on j             v_n = n·(U_j − U_i)
//! friction F_t:        +F_t t on i, −F_t t on j,         u_t = t·(U_j − U_i) − (l_i Ω_i + l_j Ω_j)
//!                      torques l_i F_t, l_j F_t          t = (−n_y, n_x), l = a + g/2
//! rolling friction:    torques +a_ij F_r on i, −a_ij F_r on j,        u_r = a_ij (Ω_j − Ω_i)
//! ```
//!
//! In a suspension, slip, friction and rolling are vectors perpendicular to the line of centres.
//! Along any direction d perpendicular to n:
//!
//! ```text
//! u_d = d·(U_j − U_i) − (n × d)·(l_i Ω_i + l_j Ω_j)
//! ```
//!
//! Every law supplies the coefficients of one problem, which is stated at the top of
//! `contact/problem.rs`. `laws` evaluates the laws at a stage; `contact_solver` chooses the pairs
//! that take part, sets up the problem and stores its solution. `procedure` is separate because it
//! is a time-stepping procedure and not a law.

pub(crate) mod contact_pair;
pub(crate) mod contact_solver;
pub(crate) mod distant_forces;
pub(crate) mod laws;
pub(crate) mod memory;
pub(crate) mod pair_forces;
pub(crate) mod problem;
mod row;
pub(crate) mod springs;

pub use crate::model::Surface;
pub use contact_pair::{Contact, ContactState};
pub(crate) use contact_solver::{ContactSolver, ImposedPressure, SolvePass};
pub use laws::{ForceLaw, Laws, NormalForce};
pub(crate) use memory::ContactMemory;
pub use pair_forces::PairForces;

/// Outcome of a contact problem, the same for every law and for dense, sparse and iterated
/// hydrodynamics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Status {
    /// All conditions hold.
    #[default]
    Solved,
    /// The normal conditions hold, but some friction bounds do not belong to the current loads;
    /// [`Quality::friction_error`] measures by how much.
    InexactFriction,
    /// No motion satisfies the gap conditions: forces grow without bound, and the spheres are
    /// jammed at this instant.
    NoAdmissibleMotion,
    /// The solver failed: a linear system had no solution, or the linearisation of curved springs
    /// or the far field did not converge.
    Failed,
}

/// How well a stage's contact problem was solved.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Quality {
    /// Outcome.
    pub status: Status,
    /// Largest violation of the conditions on normal forces and gaps, in a·rate:
    /// `max |min(G f, w)|`, where G = 0.02/(mu·a) is a typical mobility of a contact.
    pub residual: f64,
    /// Largest difference between a friction force and the force required by the law, over the
    /// largest normal force: `max |t − P(t + z/G)|`, where P projects onto the bound of friction.
    pub friction_error: f64,
    /// Number of linear systems solved.
    pub systems: u32,
}

impl Quality {
    /// Largest residual at which gaps are considered to hold, in a·rate: 5e-9 a in a step of 0.005.
    pub const RESIDUAL_LIMIT: f64 = 1e-6;
    /// Largest friction error at which friction is considered exact.
    pub const FRICTION_LIMIT: f64 = 1e-6;
    /// Normal force, in mu·a²·rate, that is considered unbounded: its stress is some thousand times
    /// the stress above which spheres are considered jammed.
    pub(crate) const UNBOUNDED: f64 = 1e7;

    /// Whether all conditions hold.
    pub fn converged(&self) -> bool {
        self.status == Status::Solved
    }

    /// Whether the spheres are jammed at this instant.
    pub fn jammed(&self) -> bool {
        self.status == Status::NoAdmissibleMotion
    }
}
