//! The one error type of this crate.

use std::fmt;

/// Why a computation was refused or could not be finished.
///
/// Fields carry what is needed to locate and to replay the failure.
///
/// ```
/// use sd_core::{Error, Params};
///
/// let dense = Params::builder().spheres(90).area_fraction(0.9).roughness(0.01).friction(0.5);
/// let message = match dense.shear_rate(1.0).build() {
///     Ok(_) => "can be packed".into(),
///     Err(Error::Refused(refusal)) => format!("{}: {}", refusal.key, refusal.allowed),
///     Err(other) => other.to_string(),
/// };
/// assert_eq!(message, "area_fraction: above 0 and at most 0.84");
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter outside its range.
    #[error("{field} = {value} is out of range: {allowed}")]
    OutOfRange {
        /// Name of the parameter, as written in input files.
        field: &'static str,
        /// The value given.
        value: f64,
        /// Description of the range.
        allowed: &'static str,
    },
    /// A parameter of a run that is out of range or conflicts with others.
    #[error(transparent)]
    Refused(#[from] Box<Refusal>),
    /// Required parameters without a value.
    #[error("no value is given of {}", parameters.join(", "))]
    Missing {
        /// Their keys.
        parameters: Vec<&'static str>,
    },
    /// A list without exactly one entry per sphere.
    #[error("{field} has {found} entries for {expected} spheres")]
    Length {
        /// Name of the list.
        field: &'static str,
        /// Entries found.
        found: usize,
        /// Entries needed.
        expected: usize,
    },
    /// A number of one sphere that is out of range.
    #[error("{field} of sphere {sphere} must be {allowed}, got {value}")]
    OfSphere {
        /// Name of the list.
        field: &'static str,
        /// The sphere, from 0.
        sphere: usize,
        /// The number given.
        value: f64,
        /// Description of the range.
        allowed: &'static str,
    },
    /// Forces with a sum under which the spheres would move infinitely fast.
    #[error(
        "forces must sum to 0 along {direction} in a periodic layer under full Stokesian Dynamics, got {net:e}: the unbounded fluid about it does not resist a net force; subtract the mean force, or choose a suspension, or hydrodynamics without a far field"
    )]
    NetForce {
        /// `x` or `y`.
        direction: char,
        /// Their sum, in mu·a²·rate.
        net: f64,
    },
    /// The configuration has no sphere.
    #[error("a configuration needs at least one sphere")]
    NoSpheres,
    /// Surfaces that touch or overlap: the lubrication between them is undefined.
    #[error("spheres {i} and {j} overlap: gap {gap:.3e} (centres {separation:.6} apart)")]
    Overlap {
        /// First sphere.
        i: usize,
        /// Second sphere.
        j: usize,
        /// Surface-to-surface gap, in a.
        gap: f64,
        /// Distance of the centres, in a.
        separation: f64,
    },
    /// A cell in which a sphere could interact with two images of one neighbour.
    #[error(
        "the cell is {side:.4} wide along {direction}, less than {needed:.4}, twice the range of pairs: use more spheres or a larger cell"
    )]
    CellTooSmall {
        /// `x`, `y`, or in a suspension `z`.
        direction: char,
        /// Side of the cell, in a.
        side: f64,
        /// Smallest side allowed, in a.
        needed: f64,
    },
    /// A lattice in which a sphere could interact with two images of one neighbour.
    #[error(
        "the shortest vector of the `lattice` is {shortest:.4}, less than {needed:.4}, twice the range of pairs: use more spheres or a larger lattice"
    )]
    LatticeTooShort {
        /// Length of the lattice's shortest vector, in a.
        shortest: f64,
        /// Smallest length allowed, in a.
        needed: f64,
    },
    /// No layer or suspension of this fraction could be made.
    #[error(
        "no start could be made of {spheres} spheres at {kind} fraction {fraction} with gaps of at least {gap}: reached {reached:.4}; lower the {kind} fraction or the roughness, use other numbers of spheres, or two sizes"
    )]
    CannotPack {
        /// Number of spheres.
        spheres: usize,
        /// Kind of the fraction: "area" or "volume".
        kind: &'static str,
        /// Requested fraction.
        fraction: f64,
        /// Requested smallest gap, in a.
        gap: f64,
        /// Fraction reached.
        reached: f64,
    },
    /// A matrix that must be positive definite is not.
    #[error("the {matrix} matrix is not positive definite (pivot {pivot}, of sphere {sphere})")]
    NotPositiveDefinite {
        /// Which matrix.
        matrix: &'static str,
        /// Row at which the factorization broke down.
        pivot: usize,
        /// Sphere that row belongs to.
        sphere: usize,
    },
    /// An iteration that did not converge.
    #[error(
        "{quantity} did not converge: relative residual {residual:.1e} after {iterations} iterations, {wanted:.1e} wanted; the spheres may be too close, or the tolerance too small"
    )]
    NotConverged {
        /// What was iterated.
        quantity: &'static str,
        /// Iterations made.
        iterations: u32,
        /// Relative residual reached.
        residual: f64,
        /// Relative residual wanted.
        wanted: f64,
    },
    /// Out of memory.
    #[error("not enough memory for {purpose}")]
    OutOfMemory {
        /// Its purpose.
        purpose: &'static str,
    },
    /// Threads that could not be started.
    #[error("cannot start threads: {reason}; use fewer")]
    Threads {
        /// The reason, of the operating system.
        reason: String,
    },
    /// The paper's steps, which stop all pairs simultaneously, with a resistance that is stored
    /// pair by pair.
    #[error("the paper's steps need dense matrices: no resistance stored pair by pair")]
    ProcedureNeedsDense,
    /// A number that is not finite came out of a computation.
    #[error("{quantity} of sphere {sphere} is not finite")]
    NotFinite {
        /// Which quantity.
        quantity: &'static str,
        /// Sphere it belongs to.
        sphere: usize,
    },
    /// A step of a simulation failed.
    #[error("step {step} (strain {strain:.4}): {source}")]
    Step {
        /// Number of the step, from 0.
        step: u64,
        /// Strain at its start.
        strain: f64,
        /// The error.
        #[source]
        source: Box<Error>,
    },
    /// A snapshot that does not belong to these parameters.
    #[error("snapshot does not fit: {reason}")]
    Snapshot {
        /// The difference.
        reason: &'static str,
    },
    /// An invalid pair of spheres in the input.
    #[error("pair [{i}, {j}] {reason}")]
    BadPair {
        /// First sphere.
        i: usize,
        /// Second sphere.
        j: usize,
        /// The fault.
        reason: &'static str,
    },
}

/// A value that is out of range or conflicts with others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Key of the parameter.
    pub key: &'static str,
    /// Its value, as written.
    pub value: String,
    /// The fault.
    pub problem: String,
    /// What is allowed.
    pub allowed: String,
    /// Key of the parameter that it conflicts with.
    pub because: Option<&'static str>,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            key,
            value,
            problem,
            allowed,
            ..
        } = self;
        write!(f, "{key} = {value} {problem}: {allowed}")
    }
}

impl std::error::Error for Refusal {}

impl From<Refusal> for Error {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(Box::new(refusal))
    }
}
