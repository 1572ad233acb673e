//! The parts of the hydrodynamics that differ between layers and suspensions.

use super::reach::Reach;
use crate::error::Error;
use crate::hydrodynamics::far_field::far_space::FarSpace;
use crate::hydrodynamics::two_sphere::PairTerm;
use crate::linalg::dense::Matrix;
use crate::space::cell::Cell;
use crate::space::{FixedArray as _, Space};

/// A space with its hydrodynamics.
pub trait Fluid: FarSpace {
    /// The resistance of one pair.
    type Term: NearTerm<Self>;
    /// The far field of all spheres in full matrices.
    type Far: FarMatrix<Self>;
    /// Whether spheres twist about their line of centres.
    const TWISTS: bool;
    /// Whether pairs beyond the cutoff of leading-order lubrication, of which a sphere has many in
    /// three dimensions, are left out of the list.
    const ENDS_AT_CUTOFF: bool;
    /// Directions of uniform translation that the far field does not resist.
    const DRIFTS: usize;
    /// Range of pairs of the near part under Ball-Melrose and lubrication, and under an iterated
    /// far field.
    const REACHES: [Reach; 2];

    /// The resistance of a pair; `twist`: entries (i, i), (i, j), (j, j) of X^C in mu·a³.
    fn term(term: &PairTerm, twist: [f64; 3]) -> Self::Term;
}

/// Modes of one sphere from those of another, by columns.
pub(crate) type ModeBlock<S> = <S as Space>::PerAnyMode<<S as Space>::PerAnyMode<f64>>;

/// The resistance of one pair; n is the unit vector from i to j.
pub trait NearTerm<S: Fluid>: Copy + Send + Sync {
    /// Adds another term of the same pair.
    fn add(&mut self, other: &Self);

    /// This term times a factor.
    fn scaled(&self, factor: f64) -> Self;

    /// Forces and torques from velocities: of i from i, of j from i, and of j from j.
    fn blocks(&self, n: &S::Vector) -> [S::Block; 3];

    /// All modes of i from those of i, of j from i, and of j from j.
    fn mode_blocks(&self, n: &S::Vector) -> [ModeBlock<S>; 3];

    /// Force modes of both spheres from their velocity modes, `(U, Ω, −e)`.
    fn apply(&self, n: &S::Vector, x: &[S::PerAnyMode<f64>; 2]) -> [S::PerAnyMode<f64>; 2];
}

/// The velocity modes `(v, −e)` of a sphere in an incident strain.
#[inline(always)]
pub(crate) fn modes_in_strain<S: Space>(
    v: &S::PerMode<f64>,
    strain: &S::Strain,
) -> S::PerAnyMode<f64> {
    let mut modes = S::PerAnyMode::each(0.0);
    for k in 0..S::MODES {
        modes[k] = v[k];
    }
    for k in 0..S::STRAINS {
        modes[S::MODES + k] = -strain[k];
    }
    modes
}

/// The far field in full matrices.
pub trait FarMatrix<S: Fluid>: Sized + Send + Sync {
    /// Accuracy of the periodic sums unless said otherwise.
    const TOLERANCE: f64;

    /// Workspace for spheres in cells of the given area or volume.
    ///
    /// # Errors
    /// A radius or tolerance out of range.
    fn new(cell: &Cell<S>, radii: &[f64], tolerance: f64) -> Result<Self, Error>;

    /// Fills in the far field's part of `R_FU`, its lower triangle.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] for the far-field mobility.
    fn fill(
        &mut self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        matrix: &mut Matrix,
    ) -> Result<(), Error>;

    /// `x ← R_far x`, all modes of all spheres, strains first.
    fn apply(&self, x: &mut [f64]);

    /// The forces and torques of `R_far x` alone.
    fn apply_for_forces(&self, x: &mut [f64]);

    /// `x ← B x` with `B Bᵀ = R_far`, all modes of all spheres, strains first.
    fn take_root(&self, x: &mut [f64]);
}
