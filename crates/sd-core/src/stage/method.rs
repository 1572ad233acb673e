//! Choice of the method for a stage: dense, pairwise, or with an iterative far field. This choice
//! is made only here.

use super::StageSolver;
use crate::error::Error;
use crate::hydrodynamics::iterative::IterativeFarField;
use crate::hydrodynamics::resistance::{Fluid, NearFields, Resistance};
use crate::model::{ContactScheme, Hydrodynamics, Params, SolverSettings};
use crate::space::Space;
use crate::space::cell::Cell;
use crate::space::pair::PairKey;
use std::f64::consts::PI;

/// Minimum number of spheres for pairwise resistance. Compared with dense matrices, whole runs take
/// 0.7 to 1.0 times the time at 59 spheres and 1.0 to 1.6 times at 30.
const MIN_PAIRWISE: usize = 60;
/// Minimum number of spheres for an iterative far field. It takes 1.2 times the time of dense
/// matrices at 90 spheres, and 0.65 to 0.9 times at 150.
const MIN_ITERATED: usize = 120;
/// Minimum number of spheres for an iterative far field near jamming with rigid contacts: a contact
/// problem then costs more than the far field, and every evaluation of the iteration solves one.
const MIN_ITERATED_NEAR_JAMMING: usize = 300;
/// Area fraction above which a layer of rigid contacts is near jamming.
const NEAR_JAMMING: f64 = 0.72;

/// Minimum number of spheres for pairwise resistance at a single instant of a suspension.
const MIN_SPARSE: usize = 100;

/// Method of computation of a stage; an example is at [`memory_bytes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// Dense factor of `R_FU`, contacts reduced to dense matrices.
    Dense,
    /// `R_FU` as a sum over pairs, contacts by one sparse factor.
    Pairwise,
    /// Pairwise, with an iterative far field in addition.
    Iterated,
}

impl Method {
    /// Maximum number of spheres with this method: those that were tried, and of dense matrices
    /// those that take a gigabyte under Stokesian Dynamics, and several else.
    pub const fn most_spheres(self, hydrodynamics: Hydrodynamics) -> usize {
        match (self, hydrodynamics) {
            (Self::Dense, Hydrodynamics::StokesianDynamics) => 2_000,
            (Self::Dense | Self::Iterated, _) => 10_000,
            (Self::Pairwise, _) => Params::MAX_SPHERES,
        }
    }

    /// The least expensive method for runs with these parameters.
    pub fn of(params: &Params) -> Self {
        if params.contact == ContactScheme::Procedure {
            // The procedure stops all pairs at once, which is a dense problem at any number of
            // spheres.
            return Self::Dense;
        }
        if params.volume_fraction.is_some() {
            return Self::of_suspension(params.hydrodynamics);
        }
        let is_soft = params.contact.laws().is_soft();
        let area_fraction = params.area_fraction;
        Self::choose(params.hydrodynamics, params.spheres, area_fraction, is_soft)
    }

    /// The least expensive method for suspensions, whose periodic cells contain many spheres.
    fn of_suspension(hydrodynamics: Hydrodynamics) -> Self {
        match hydrodynamics {
            Hydrodynamics::BallMelrose | Hydrodynamics::Lubrication(_) => Self::Pairwise,
            Hydrodynamics::StokesianDynamics => Self::Iterated,
        }
    }

    /// The least expensive method for a single instant.
    pub(crate) fn of_instant<S: Space>(
        hydrodynamics: Hydrodynamics,
        cell: &Cell<S>,
        radii: &[f64],
        is_soft: bool,
    ) -> Self {
        if S::DIMENSIONS == 3 {
            let is_full = hydrodynamics == Hydrodynamics::StokesianDynamics;
            let is_sparse = radii.len() >= MIN_SPARSE && (cell.content().is_some() || !is_full);
            return if is_sparse {
                Self::of_suspension(hydrodynamics)
            } else {
                Self::Dense
            };
        }
        cell.content().map_or(Self::Dense, |area| {
            let discs: f64 = radii.iter().map(|a| PI * a * a).sum();
            Self::choose(hydrodynamics, radii.len(), discs / area, is_soft)
        })
    }

    /// The least expensive method for a layer, with soft or rigid contacts.
    fn choose(
        hydrodynamics: Hydrodynamics,
        spheres: usize,
        area_fraction: f64,
        is_soft: bool,
    ) -> Self {
        let least_iterated = if is_soft || area_fraction <= NEAR_JAMMING {
            MIN_ITERATED
        } else {
            MIN_ITERATED_NEAR_JAMMING
        };
        let (iterates, is_pairwise) = (spheres >= least_iterated, spheres >= MIN_PAIRWISE);
        match hydrodynamics {
            Hydrodynamics::BallMelrose | Hydrodynamics::Lubrication(_) if is_pairwise => {
                Self::Pairwise
            }
            Hydrodynamics::StokesianDynamics if iterates => Self::Iterated,
            Hydrodynamics::BallMelrose
            | Hydrodynamics::Lubrication(_)
            | Hydrodynamics::StokesianDynamics => Self::Dense,
        }
    }

    #[doc(hidden)]
    /// A solver for spheres of the given radii.
    ///
    /// `pattern_pairs`: pairs of the near-field pattern of a resumed run, ordered; else empty.
    ///
    /// # Errors
    /// Those of [`Resistance::new`], [`Resistance::new_pairwise`] and [`IterativeFarField::new`].
    pub fn solver<S: Fluid>(
        self,
        hydrodynamics: Hydrodynamics,
        cell: &Cell<S>,
        radii: &[f64],
        tables: &NearFields,
        pattern_pairs: &[PairKey],
        settings: &SolverSettings,
    ) -> Result<StageSolver<S>, Error> {
        let pairwise =
            || Resistance::new_pairwise(hydrodynamics, cell, radii, tables, pattern_pairs);
        Ok(match self {
            Self::Dense => {
                let resistance = match (hydrodynamics, settings.far_field_tolerance) {
                    (Hydrodynamics::StokesianDynamics, Some(tolerance)) => {
                        Resistance::new_dense(cell, radii, tables, tolerance)?
                    }
                    _ => Resistance::new(hydrodynamics, cell, radii, tables)?,
                };
                StageSolver::new(resistance)
            }
            Self::Pairwise => StageSolver::new(pairwise()?),
            Self::Iterated => {
                let far = IterativeFarField::new(cell, radii, settings.far_field_residual)?;
                StageSolver::with_far_field(pairwise()?, far)
            }
        })
    }
}

/// Upper estimate of the memory of a run, in bytes (near jamming).
///
/// ```text
/// dense:    R_FU (3N)², columns of the contacts 3N × P, their products 3/4 P²;
///           Stokesian Dynamics: in addition M (6N)² and two matrices (3N)²
/// pairwise: 32 kB per sphere for pairs, two sparse factors, their pattern and vectors;
///           an iterative far field: 32 kB more;
///           112 and 80 kB in a suspension, with twice the velocities and neighbours per sphere
/// ```
///
/// Here K ≈ 1.5 N is the number of candidates and P = 2 K the number of contact forces, or 3 K
/// where a contact has two constrained motions.
///
/// ```
/// use sd_core::{Method, memory_bytes};
/// # use sd_core::{Hydrodynamics, Params};
/// # let params = Params::builder()
/// #     .spheres(40)
/// #     .area_fraction(0.6)
/// #     .roughness(0.01)
/// #     .friction(0.5)
/// #     .shear_rate(2.0)
/// #     .hydrodynamics(Hydrodynamics::BallMelrose)
/// #     .build()?;
///
/// assert!(memory_bytes(&params) < 1e8);
/// let large = Params { spheres: 4000, ..params };
/// assert_eq!(Method::of(&large), Method::Pairwise);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn memory_bytes(params: &Params) -> f64 {
    let n = params.spheres as f64;
    let motions = match params.contact {
        ContactScheme::Laws(laws) => {
            laws.tangential.constraint().motions() + usize::from(laws.rolling_friction > 0.0)
        }
        ContactScheme::Rigid | ContactScheme::Procedure => 1,
    };
    let [pairwise, iterated] = if params.volume_fraction.is_some() {
        [112.0, 80.0]
    } else {
        [32.0, 32.0]
    };
    match Method::of(params) {
        Method::Pairwise => 1024.0 * pairwise * n,
        Method::Iterated => 1024.0 * (pairwise + iterated) * n,
        Method::Dense => {
            // Coefficients of N².
            let forces = 1.5 * (1 + motions) as f64;
            let near = 9.0 + 3.0 * forces + 0.75 * forces * forces;
            let far = match params.hydrodynamics {
                Hydrodynamics::BallMelrose | Hydrodynamics::Lubrication(_) => 0.0,
                Hydrodynamics::StokesianDynamics => 36.0 + 2.0 * 9.0,
            };
            8.0 * (near + far) * n * n + 8192.0 * n
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::TangentialLaw;
    use crate::model::ContactLaws;

    #[test]
    fn method_follows_from_hydrodynamics_contacts_and_number_of_spheres() {
        let (near, full) = (Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics);
        let coulomb = ContactScheme::Laws(ContactLaws {
            tangential: TangentialLaw::Coulomb,
            ..ContactLaws::PAPER
        });
        let springs = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
        let springs = ContactScheme::Laws(springs);
        // The smallest number of spheres with the second method, at an area fraction.
        let rows = [
            (near, 0.5, [ContactScheme::Rigid, coulomb], 60),
            (near, 0.8, [ContactScheme::Rigid, coulomb], 60),
            (near, 0.5, [springs; 2], 60),
            (near, 0.8, [springs; 2], 60),
            (full, 0.5, [ContactScheme::Rigid, coulomb], 120),
            (full, 0.73, [ContactScheme::Rigid, coulomb], 300),
            (full, 0.5, [springs; 2], 120),
            (full, 0.8, [springs; 2], 120),
        ];
        for (hydrodynamics, area_fraction, schemes, first) in rows {
            let method = if hydrodynamics == near {
                Method::Pairwise
            } else {
                Method::Iterated
            };
            let at = |spheres, contact| {
                Method::of(&Params {
                    spheres,
                    area_fraction,
                    hydrodynamics,
                    contact,
                    ..Params::UNSET
                })
            };
            for contact in schemes {
                assert_eq!(at(first - 1, contact), Method::Dense);
                assert_eq!(at(first, contact), method);
            }
            assert_eq!(at(1000, ContactScheme::Procedure), Method::Dense);
        }
    }

    #[test]
    fn contacts_with_two_constrained_motions_take_larger_matrices() {
        let memory = |spheres, tangential| {
            memory_bytes(&Params {
                spheres,
                hydrodynamics: Hydrodynamics::BallMelrose,
                contact: ContactScheme::Laws(ContactLaws {
                    tangential,
                    ..ContactLaws::PAPER
                }),
                ..Params::UNSET
            })
        };
        let [welds, slides] = [TangentialLaw::StickRotate, TangentialLaw::Coulomb];
        let ratio = memory(50, welds) / memory(50, slides);
        assert!(ratio > 1.2 && ratio < 2.0, "{ratio}");
        // Pairwise methods have no such matrices.
        assert_eq!(memory(1000, welds), memory(1000, slides));
    }
}
