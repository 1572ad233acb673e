//! The near-field terms of all pairs in range, and their contributions to matrices and vectors.

use super::fluid::{Fluid, NearTerm, modes_in_strain};
use crate::linalg::dense::Matrix;
use crate::linalg::simd::vectorised;
use crate::space::pair::Neighbours;
use crate::space::{Space, Strains};

/// Adds the terms to the lower triangle of `R_FU`.
pub(super) fn add_to_matrix<S: Fluid>(
    pairs: &[Neighbours<S>],
    terms: &[S::Term],
    matrix: &mut Matrix,
) {
    for (pair, term) in pairs.iter().zip(terms) {
        let (i, j) = (S::MODES * pair.i, S::MODES * pair.j);
        let blocks = term.blocks(&pair.normal);
        // The coupling is below the diagonal, in the columns of the first sphere.
        for ((row, column), block) in [(i, i), (j, i), (j, j)].into_iter().zip(&blocks) {
            for (k, entries) in block.as_ref().chunks_exact(S::MODES).enumerate() {
                let first = if row == column { k } else { 0 };
                let values = &mut matrix.column_mut(column + k)[row..row + S::MODES];
                for (value, entry) in values[first..].iter_mut().zip(&entries[first..]) {
                    *value += entry;
                }
            }
        }
    }
}

/// Adds `slope` n nᵀ of a pair's relative velocity to the lower triangle of `R_FU`.
pub(super) fn add_spring<S: Space>(pair: &Neighbours<S>, slope: f64, matrix: &mut Matrix) {
    let (i, j, n) = (S::MODES * pair.i, S::MODES * pair.j, pair.normal);
    for column in 0..S::DIMENSIONS {
        for row in 0..S::DIMENSIONS {
            let value = slope * n[row] * n[column];
            if row >= column {
                matrix[(i + row, i + column)] += value;
                matrix[(j + row, j + column)] += value;
            }
            matrix[(j + row, i + column)] -= value;
        }
    }
}

/// Adds the forces with which the incident strains drive the spheres through the terms.
pub(super) fn add_background_forces<S: Fluid>(
    pairs: &[Neighbours<S>],
    terms: &[S::Term],
    strains: Strains<'_, S>,
    forces: &mut [f64],
) {
    let (forces, at_rest) = (S::by_sphere_mut(forces), S::each(0.0));
    vectorised(
        #[inline(always)]
        || {
            for (pair, term) in pairs.iter().zip(terms) {
                let (i, j) = (pair.i, pair.j);
                let x = [
                    modes_in_strain::<S>(&at_rest, strains.at(i)),
                    modes_in_strain::<S>(&at_rest, strains.at(j)),
                ];
                let [of_i, of_j] = term.apply(&pair.normal, &x);
                for k in 0..S::MODES {
                    forces[i][k] -= of_i[k];
                    forces[j][k] -= of_j[k];
                }
            }
        },
    );
}

/// Adds the counterforces and the stresslets that the terms give disturbances `velocities` in the
/// incident strains.
pub(super) fn add_counterforces<S: Fluid>(
    pairs: &[Neighbours<S>],
    terms: &[S::Term],
    velocities: &[f64],
    strains: Strains<'_, S>,
    forces: &mut [f64],
    stresslets: &mut [S::Strain],
) {
    let (velocities, forces) = (S::by_sphere(velocities), S::by_sphere_mut(forces));
    vectorised(
        #[inline(always)]
        || {
            for (pair, term) in pairs.iter().zip(terms) {
                let (i, j) = (pair.i, pair.j);
                let x = [
                    modes_in_strain::<S>(&velocities[i], strains.at(i)),
                    modes_in_strain::<S>(&velocities[j], strains.at(j)),
                ];
                let [of_i, of_j] = term.apply(&pair.normal, &x);
                for k in 0..S::MODES {
                    forces[i][k] += of_i[k];
                    forces[j][k] += of_j[k];
                }
                for k in 0..S::STRAINS {
                    stresslets[i][k] -= of_i[S::MODES + k];
                    stresslets[j][k] -= of_j[S::MODES + k];
                }
            }
        },
    );
}
