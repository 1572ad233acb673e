//! Random forces whose covariance is the resistance, as Brownian motion needs them.
//!
//! R_FU is a sum of pair terms and of the drags of isolated spheres, or in place of these the far
//! field's resistance, each positive semidefinite. So these forces have exactly its covariance, at
//! a cost in O(N) without a far field:
//!
//! ```text
//! F = Σ_pairs L z_ij + Σ_i √(drag of i) z_i        L Lᵀ = pair term,   z of independent components
//! F = Σ_pairs L z_ij + (M^(−1/2) z)_F              M: mobility of the far field, all modes
//! ```
//! Full matrices have a factor of M; for the iterated far field see
//! [`crate::hydrodynamics::iterative::IterativeFarField::add_random_forces`].
//!
//! Where the rate of the flow is free, it is one more velocity, and has a random force of its own,
//! the work per strain of random stresslets. L then has one more row, of which all columns but the
//! last belong to the forces; the last ones of all terms together are one more random number.

use super::fluid::{FarMatrix as _, Fluid, NearTerm as _, modes_in_strain};
use super::isolated::isolated;
use super::{Form, Resistance};
use crate::linalg::simd::vectorised;
use crate::space::Space;

/// The random force on the rate of a flow, in mu·a³·rate.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RandomStress {
    /// What belongs to random forces.
    pub(crate) force: f64,
    /// Variance of the rest, over that of a unit resistance: the resistance of the spheres to the
    /// flow that is no part of the other.
    pub(crate) rest: f64,
}

/// Pivot, over the diagonal entry that it is left of, that is zero but for rounding: rigid motions
/// of a pair are not resisted.
const ROUNDING: f64 = 1e-12;

impl<S: Fluid> Resistance<S> {
    /// Adds random forces and torques on all spheres, `[3N]`, whose covariance is `scale`² `R_FU`,
    /// without what an iterated far field contributes.
    ///
    /// `normal`: independent numbers of mean 0 and variance 1; `flow`: rates of strain of a flow
    /// whose rate is free.
    pub(crate) fn add_random_forces(
        &mut self,
        scale: f64,
        mut normal: impl FnMut() -> f64,
        flow: Option<&S::Strain>,
        forces: &mut [f64],
    ) -> RandomStress {
        let mut stress = RandomStress::default();
        let far = match &mut self.form {
            Form::Dense(dense) => dense.far(),
            Form::Pairwise(_) => None,
        };
        if let Some((far, vector)) = far {
            let strains = S::STRAINS * self.radii.len();
            vector.clear();
            vector.resize_with(strains + forces.len(), &mut normal);
            far.take_root(vector);
            for (strain, x) in flow
                .iter()
                .cycle()
                .zip(vector[..strains].chunks(S::STRAINS))
            {
                for (k, x) in x.iter().enumerate() {
                    stress.force -= scale * strain[k] * x;
                }
            }
            for (force, x) in forces.iter_mut().zip(&vector[strains..]) {
                *force += scale * x;
            }
        } else if self.far_pairs.is_none() {
            let spheres = S::by_sphere_mut(forces).iter_mut();
            for (force, &radius) in spheres.zip(&self.radii) {
                let drag = isolated::<S>(radius);
                for k in 0..S::MODES {
                    force[k] += scale * drag[k].sqrt() * normal();
                }
                if let Some(strain) = flow {
                    stress.rest += drag[S::MODES] * S::strain_dot(strain, strain);
                }
            }
        }
        let forces = S::by_sphere_mut(forces);
        let far_terms = self.far_pairs.as_ref().map_or(&[][..], |far| far.terms());
        let mut far_terms = far_terms.iter().peekable();
        let (mut roots, mut number) = (Roots::NONE, 0);
        let all = self.neighbours.pairs().chunks(LANES);
        for (pairs, given) in all.zip(self.terms.chunks(LANES)) {
            let mut terms = [given[0]; LANES];
            terms[..given.len()].copy_from_slice(given);
            for term in &mut terms[..given.len()] {
                if let Some((_, far)) = far_terms.next_if(|(of, _)| *of == number) {
                    // The far field as a whole has a share of its own.
                    term.add(&far.scaled(-1.0));
                }
                number += 1;
            }
            vectorised(
                #[inline(always)]
                || {
                    for lane in 0..pairs.len() {
                        let blocks = terms[lane].blocks(&pairs[lane].normal);
                        roots.set::<S>(lane, &blocks);
                    }
                    roots.take::<S>();
                },
            );
            for (lane, (pair, term)) in pairs.iter().zip(&terms).enumerate() {
                let row = flow.map(|strain| {
                    let (row, rest) = row_of_flow::<S>(term, &pair.normal, strain, &roots, lane);
                    stress.rest += rest;
                    row
                });
                let mut both = [forces[pair.i], forces[pair.j]];
                for at in 0..2 * S::MODES {
                    // A mode that is not resisted has no force, but the same numbers follow.
                    let z = scale * normal();
                    if let Some(row) = &row {
                        stress.force += z * row[at];
                    }
                    for row in at..2 * S::MODES {
                        both[row / S::MODES][row % S::MODES] += z * roots.0[at][row][lane];
                    }
                }
                [forces[pair.i], forces[pair.j]] = both;
            }
        }
        stress
    }
}

/// The row of L for the rate of a flow, without its last column, and the square of that.
fn row_of_flow<S: Fluid>(
    term: &S::Term,
    normal: &S::Vector,
    strain: &S::Strain,
    roots: &Roots,
    lane: usize,
) -> ([f64; PAIR_MODES], f64) {
    let still = modes_in_strain::<S>(&S::each(0.0), strain);
    let forces = term.apply(normal, &[still, still]);
    let mut row = [0.0; PAIR_MODES];
    let mut rest = 0.0;
    for (sphere, forces) in forces.iter().enumerate() {
        row[sphere * S::MODES..][..S::MODES].copy_from_slice(&forces.as_ref()[..S::MODES]);
        for k in S::MODES..S::ALL_MODES {
            rest += forces[k] * still[k];
        }
    }
    for k in 0..2 * S::MODES {
        for other in 0..k {
            row[k] -= roots.0[other][k][lane] * row[other];
        }
        let pivot = roots.0[k][k][lane];
        // A mode that is not resisted does no work.
        row[k] = if pivot > 0.0 { row[k] / pivot } else { 0.0 };
        rest -= row[k] * row[k];
    }
    (row, rest)
}

/// Most velocities of a pair.
const PAIR_MODES: usize = 12;
/// Pairs whose roots are taken side by side.
const LANES: usize = 4;

/// L of `L Lᵀ` of several positive semidefinite pair matrices, by columns, and the pairs side by
/// side. Above the diagonal entries are of no meaning.
struct Roots([[[f64; LANES]; PAIR_MODES]; PAIR_MODES]);

impl Roots {
    const NONE: Self = Self([[[0.0; LANES]; PAIR_MODES]; PAIR_MODES]);

    /// Sets the matrix of a pair from its blocks (i, i), (j, i) and (j, j).
    #[inline(always)]
    fn set<S: Space>(&mut self, lane: usize, blocks: &[S::Block; 3]) {
        for column in 0..S::MODES {
            for row in 0..S::MODES {
                let at = S::MODES * column + row;
                if row >= column {
                    self.0[column][row][lane] = blocks[0][at];
                    self.0[S::MODES + column][S::MODES + row][lane] = blocks[2][at];
                }
                self.0[column][S::MODES + row][lane] = blocks[1][at];
            }
        }
    }

    /// Replaces the matrices by their roots.
    #[inline(always)]
    fn take<S: Space>(&mut self) {
        let (size, columns) = (2 * S::MODES, &mut self.0);
        let mut diagonal = [[0.0; LANES]; PAIR_MODES];
        for k in 0..size {
            diagonal[k] = columns[k][k];
        }
        for k in 0..size {
            let (before, later) = columns.split_at_mut(k + 1);
            let column = &mut before[k];
            let (pivot, mut scale) = (column[k], [0.0; LANES]);
            for lane in 0..LANES {
                if pivot[lane] > ROUNDING * diagonal[k][lane] {
                    scale[lane] = pivot[lane].sqrt().recip();
                }
            }
            for entries in &mut column[k..size] {
                for lane in 0..LANES {
                    entries[lane] *= scale[lane];
                }
            }
            for other in k + 1..size {
                let factor = column[other];
                let target = &mut later[other - k - 1];
                for row in other..size {
                    for lane in 0..LANES {
                        target[row][lane] -= factor[lane] * column[row][lane];
                    }
                }
            }
        }
    }
}
