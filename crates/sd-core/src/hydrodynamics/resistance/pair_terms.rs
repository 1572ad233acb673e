//! The near-field terms of all pairs in range, and what they add to matrices and vectors.

use crate::hydrodynamics::two_sphere::PairTerm;
use crate::linalg::dense::Matrix;
use crate::space::pair::Neighbours;
use nalgebra::{SVector, Vector3};

/// Adds the terms to the lower triangle of `R_FU`; `row` is the first row of a sphere there.
pub(super) fn add_to_matrix(
    pairs: &[Neighbours],
    terms: &[PairTerm],
    row: impl Fn(usize) -> usize,
    matrix: &mut Matrix,
) {
    for (pair, term) in pairs.iter().zip(terms) {
        let n = pair.normal;
        let (i, j) = (row(pair.i), row(pair.j));
        for (first, block) in [(i, term.block(n, 0, 0)), (j, term.block(n, 1, 1))] {
            for (column, entries) in block.into_iter().enumerate() {
                let own = &mut matrix.column_mut(first + column)[first..first + 3];
                for row in column..3 {
                    own[row] += entries[row];
                }
            }
        }
        // The coupling stands below the diagonal, in the columns of the sphere that comes first.
        let (first, second, block) = if i < j {
            (i, j, term.block(n, 1, 0))
        } else {
            (j, i, term.block(n, 0, 1))
        };
        for (column, entries) in block.into_iter().enumerate() {
            let coupling = &mut matrix.column_mut(first + column)[second..second + 3];
            for (value, entry) in coupling.iter_mut().zip(entries) {
                *value += entry;
            }
        }
    }
}

/// Adds `slope` n nᵀ of a pair's relative velocity to the lower triangle of `R_FU`, `rows` the first rows of its spheres.
pub(super) fn add_spring(pair: &Neighbours, slope: f64, rows: [usize; 2], matrix: &mut Matrix) {
    let [i, j] = rows;
    let (first, second) = if i < j { (i, j) } else { (j, i) };
    let n = pair.normal;
    for column in 0..2 {
        for row in 0..2 {
            let value = slope * n[row] * n[column];
            if row >= column {
                matrix[(first + row, first + column)] += value;
                matrix[(second + row, second + column)] += value;
            }
            matrix[(second + row, first + column)] -= value;
        }
    }
}

/// Adds the forces `[3N]` with which the background strain drives the spheres through the terms.
pub(super) fn add_background_forces(
    pairs: &[Neighbours],
    terms: &[PairTerm],
    strain: &Vector3<f64>,
    forces: &mut [f64],
) {
    for (pair, term) in pairs.iter().zip(terms) {
        add_pair(
            forces,
            pair,
            &term.force_from_strain(pair.normal, strain, strain),
        );
    }
}

/// Adds the counterforces `[3N]` and the stresslets that the terms give disturbances `velocities` `[3N]` in the background strain.
pub(super) fn add_counterforces(
    pairs: &[Neighbours],
    terms: &[PairTerm],
    velocities: &[f64],
    strain: &Vector3<f64>,
    forces: &mut [f64],
    stresslets: &mut [Vector3<f64>],
) {
    for (pair, term) in pairs.iter().zip(terms) {
        let (i, j) = (pair.i, pair.j);
        let mut v = SVector::<f64, 6>::zeros();
        v.as_mut_slice()[..3].copy_from_slice(&velocities[3 * i..3 * i + 3]);
        v.as_mut_slice()[3..].copy_from_slice(&velocities[3 * j..3 * j + 3]);
        let n = pair.normal;
        let force = term.force_velocity(n) * v - term.force_from_strain(n, strain, strain);
        add_pair(forces, pair, &force);
        let s = term.stresslet_from_strain(n, strain, strain) - term.stresslet_from_velocity(n, &v);
        stresslets[i] += s.fixed_rows::<3>(0);
        stresslets[j] += s.fixed_rows::<3>(3);
    }
}

/// Adds the forces on both spheres of a pair.
fn add_pair(forces: &mut [f64], pair: &Neighbours, force: &SVector<f64, 6>) {
    for m in 0..3 {
        forces[3 * pair.i + m] += force[m];
        forces[3 * pair.j + m] += force[3 + m];
    }
}
