//! One instant of one configuration: velocities, stresslets, contact forces.

use crate::cell::Cell;
use crate::error::Error;
use crate::modes::{Background, Vec2};
use crate::params::Hydrodynamics;
use serde::Serialize;

/// Spheres, where they are and what drives them.
#[derive(Debug, Clone)]
pub struct Configuration {
    /// Centres, in a.
    pub centres: Vec<Vec2>,
    /// Radii, in a; one per centre.
    pub radii: Vec<f64>,
    /// Periodic cell or unbounded fluid.
    pub cell: Cell,
    /// Hydrodynamics.
    pub hydrodynamics: Hydrodynamics,
    /// Imposed flow.
    pub background: Background,
    /// External forces, in mu·a²·rate; one per centre.
    pub forces: Vec<Vec2>,
    /// External torques, in mu·a³·rate; one per centre.
    pub torques: Vec<f64>,
}

/// Which contact problem to solve.
#[derive(Debug, Clone)]
pub enum ContactRequest {
    /// None.
    None,
    /// These pairs are halted all at once by eqs. (12)-(13), negative forces set to zero afterwards, no friction.
    Listed {
        /// Pairs of sphere numbers.
        pairs: Vec<[usize; 2]>,
    },
    /// The rigid scheme.
    Rigid {
        /// Roughness height h, in a.
        roughness: f64,
        /// Friction coefficient ν.
        friction: f64,
        /// Critical load, in mu·a²·rate.
        critical_load: f64,
        /// Time span τ, in strain.
        time_span: f64,
    },
    /// The paper's procedure; every approaching pair with gap ≤ roughness counts as listed.
    Procedure {
        /// Roughness height h, in a.
        roughness: f64,
        /// Friction coefficient ν.
        friction: f64,
        /// Critical load, in mu·a²·rate.
        critical_load: f64,
    },
}

/// What a contact does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactState {
    /// No friction: no force, or one below the critical load.
    Frictionless,
    /// Friction makes the surfaces roll on each other.
    Rolling,
    /// Friction at its limit.
    Slipping,
}

/// One candidate pair of the contact problem.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contact {
    /// First sphere.
    pub i: usize,
    /// Second sphere.
    pub j: usize,
    /// Image of j.
    pub image: [i32; 2],
    /// Gap, in a.
    pub gap: f64,
    /// Unit vector from i to j.
    pub normal: [f64; 2],
    /// Normal force f ≥ 0, in mu·a²·rate.
    pub normal_force: f64,
    /// Tangential force F_t.
    pub tangential_force: f64,
    /// n·(U_j − U_i) in the final motion.
    pub normal_velocity: f64,
    /// Slip in the final motion.
    pub slip_velocity: f64,
    /// State.
    pub state: ContactState,
}

/// The answer, as `sweep solve` prints it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Instant {
    /// Velocities minus the background at the own centre.
    pub velocity_disturbance: Vec<[f64; 2]>,
    /// Angular velocities minus the background's.
    pub angular_velocity_disturbance: Vec<f64>,
    /// Stresslets S of eq. (20), xx.
    pub stresslet_xx: Vec<f64>,
    /// yy.
    pub stresslet_yy: Vec<f64>,
    /// xy.
    pub stresslet_xy: Vec<f64>,
    /// Relative viscosity in full; periodic only.
    pub viscosity: Option<f64>,
    /// From the stresslets alone; periodic only.
    pub viscosity_stresslet: Option<f64>,
    /// v'Rv / (V rate); periodic only.
    pub dissipation: Option<f64>,
    /// All candidate pairs.
    pub contacts: Vec<Contact>,
}

/// Solves one instant.
///
/// # Errors
/// Bad lengths, radii, overlaps, a cell too small, pairs out of range, an indefinite matrix.
pub fn solve(configuration: &Configuration, contact: &ContactRequest) -> Result<Instant, Error> {
    let _ = (configuration, contact);
    Err(Error::NoSpheres)
}
