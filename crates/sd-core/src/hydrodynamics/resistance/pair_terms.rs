//! The near-field terms of all pairs in range, and their contributions to matrices and vectors.

use super::fluid::{Fluid, NearTerm, modes_in_strain};
use crate::linalg::dense::Matrix;
use crate::space::pair::Neighbours;
use crate::space::{Space, Strains};

/// Adds the terms to the lower triangle of `R_FU`; `row` is the first row of a sphere there.
pub(super) fn add_to_matrix<S: Fluid>(
    pairs: &[Neighbours<S>],
    terms: &[S::Term],
    row: impl Fn(usize) -> usize,
    matrix: &mut Matrix,
) {
    for (pair, term) in pairs.iter().zip(terms) {
        let n = &pair.normal;
        let (i, j) = (row(pair.i), row(pair.j));
        for (first, block) in [(i, term.block(n, 0, 0)), (j, term.block(n, 1, 1))] {
            for (column, entries) in block.as_ref().chunks_exact(S::MODES).enumerate() {
                let own = &mut matrix.column_mut(first + column)[first..first + S::MODES];
                for row in column..S::MODES {
                    own[row] += entries[row];
                }
            }
        }
        // The coupling is below the diagonal, in the columns of the first sphere.
        let (first, second, block) = if i < j {
            (i, j, term.block(n, 1, 0))
        } else {
            (j, i, term.block(n, 0, 1))
        };
        for (column, entries) in block.as_ref().chunks_exact(S::MODES).enumerate() {
            let coupling = &mut matrix.column_mut(first + column)[second..second + S::MODES];
            for (value, entry) in coupling.iter_mut().zip(entries) {
                *value += entry;
            }
        }
    }
}

/// Adds `slope` n nᵀ of a pair's relative velocity to the lower triangle of `R_FU`, `rows` the
/// first rows of its spheres.
pub(super) fn add_spring<S: Space>(
    pair: &Neighbours<S>,
    slope: f64,
    rows: [usize; 2],
    matrix: &mut Matrix,
) {
    let [i, j] = rows;
    let (first, second) = if i < j { (i, j) } else { (j, i) };
    let n = pair.normal;
    for column in 0..S::DIMENSIONS {
        for row in 0..S::DIMENSIONS {
            let value = slope * n[row] * n[column];
            if row >= column {
                matrix[(first + row, first + column)] += value;
                matrix[(second + row, second + column)] += value;
            }
            matrix[(second + row, first + column)] -= value;
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
    for (pair, term) in pairs.iter().zip(terms) {
        let both = [pair.i, pair.j];
        let x = both.map(|sphere| modes_in_strain::<S>(&at_rest, strains.at(sphere)));
        for (sphere, y) in both.into_iter().zip(term.apply(&pair.normal, &x)) {
            for k in 0..S::MODES {
                forces[sphere][k] -= y[k];
            }
        }
    }
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
    for (pair, term) in pairs.iter().zip(terms) {
        let both = [pair.i, pair.j];
        let x = both.map(|sphere| modes_in_strain::<S>(&velocities[sphere], strains.at(sphere)));
        for (sphere, y) in both.into_iter().zip(term.apply(&pair.normal, &x)) {
            for k in 0..S::MODES {
                forces[sphere][k] += y[k];
            }
            for k in 0..S::STRAINS {
                stresslets[sphere][k] -= y[S::MODES + k];
            }
        }
    }
}
