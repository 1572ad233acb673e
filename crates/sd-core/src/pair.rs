//! Two spheres driven past each other in unbounded fluid: the paper's Fig. 8.

use crate::error::Error;
use serde::Serialize;

/// The scenario: radii 1 and L, forces +1 and −1 along x, from (−X, Y) and (X, −Y).
#[derive(Debug, Clone, PartialEq)]
pub struct Passing {
    /// Radius of the second sphere, in a.
    pub size_ratio: f64,
    /// Roughness height and friction coefficient; `None` without contact.
    pub contact: Option<(f64, f64)>,
    /// Y, in a.
    pub offset: f64,
    /// X, in a.
    pub start: f64,
    /// Time step, in mu·a²/force.
    pub time_step: f64,
}

/// The answer, as `sweep pair` prints it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Passed {
    /// y of the first sphere at the end.
    pub final_offset: f64,
    /// Rotation of each sphere, in degrees.
    pub rotation_degrees: [f64; 2],
    /// Smallest gap met, in a.
    pub minimum_gap: f64,
    /// Time taken.
    pub time: f64,
    /// `[t, x1, y1, θ1, x2, y2, θ2]` at each step.
    pub path: Vec<[f64; 7]>,
}

/// Moves the spheres until x1 − x2 = 2X.
///
/// # Errors
/// Parameters out of range; spheres that overlap at the start or do not pass.
pub fn pass(passing: &Passing) -> Result<Passed, Error> {
    let _ = passing;
    Err(Error::NoSpheres)
}
