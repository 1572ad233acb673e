//! Pair matrices in the frame of the line of centres, as their 34 independent entries.
//!
//! x̂ = n points from i to j. The mirror in x̂ splits the twelve modes into
//!
//! ```text
//! axial       U_x, a of i;  U_x, a of j                 a = (√3/2) e1 + (1/2) e3     10 entries
//! transverse  w of i;  w of j                           w = −(1/2) e1 + (√3/2) e3     3
//! odd         U_y, Ω, e2 of i;  U_y, Ω, e2 of j                                      21
//! ```
//!
//! Each block is stored as its upper triangle, row by row, in this order.

use super::Scalars;
use crate::hydrodynamics::free_space::planar::{pair_mobility, self_mobility};
use crate::space::modes::Vec2;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::PI;

/// Number of independent entries of a pair matrix.
pub(super) const ENTRIES: usize = 34;
/// Start of the transverse block.
pub(super) const TRANSVERSE: usize = 10;
/// Start of the odd block.
pub(super) const ODD: usize = 13;

/// Mode vectors of both spheres, or a coupling of them, in the frame of the pair.
pub type PairMatrix = SMatrix<f64, 12, 12>;

/// Place of `(row, column)` in an upper triangle of dimension n.
#[inline(always)]
const fn upper(n: usize, row: usize, column: usize) -> usize {
    let (r, c) = if row < column {
        (row, column)
    } else {
        (column, row)
    };
    r * (2 * n - r + 1) / 2 + c - r
}

/// Place of an axial entry: 0, 1 = `U_x`, a of i; 2, 3 of j.
#[inline(always)]
pub(super) const fn axial(row: usize, column: usize) -> usize {
    upper(4, row, column)
}

/// Place of a transverse entry: 0 = w of i, 1 of j.
#[inline(always)]
pub(super) const fn transverse(row: usize, column: usize) -> usize {
    TRANSVERSE + upper(2, row, column)
}

/// Place of an odd entry: 0, 1, 2 = `U_y`, Ω, e2 of i; 3, 4, 5 of j.
#[inline(always)]
pub(super) const fn odd(row: usize, column: usize) -> usize {
    ODD + upper(6, row, column)
}

/// Power of length that each reduced mode carries: velocities 1/2, the others 3/2, doubled.
const AXIAL_POWER: [usize; 4] = [0, 1, 0, 1];
/// The powers of the odd modes.
const ODD_POWER: [usize; 6] = [0, 1, 1, 0, 1, 1];

/// The power of length of every entry, less one: 0, 1 or 2.
pub(super) static LENGTH_POWER: [usize; ENTRIES] = {
    let mut power = [2; ENTRIES];
    let mut row = 0;
    while row < 6 {
        let mut column = row;
        while column < 6 {
            power[odd(row, column)] = ODD_POWER[row] + ODD_POWER[column];
            if row < 4 && column < 4 {
                power[axial(row, column)] = AXIAL_POWER[row] + AXIAL_POWER[column];
            }
            column += 1;
        }
        row += 1;
    }
    power
};

/// For every entry of the pair (j, i), the entry of (i, j) it equals up to sign.
///
/// Exchanging the spheres reverses n, which changes the sign of velocities only.
pub(super) static EXCHANGED: [(usize, f64); ENTRIES] = {
    let mut map = [(0, 1.0); ENTRIES];
    let mut row = 0;
    while row < 6 {
        let mut column = row;
        while column < 6 {
            let sign = if (ODD_POWER[row] + ODD_POWER[column]) % 2 == 1 {
                -1.0
            } else {
                1.0
            };
            map[odd(row, column)] = (odd((row + 3) % 6, (column + 3) % 6), sign);
            if row < 4 && column < 4 {
                let sign = if (row + column) % 2 == 1 { -1.0 } else { 1.0 };
                map[axial(row, column)] = (axial((row + 2) % 4, (column + 2) % 4), sign);
            }
            if row < 2 && column < 2 {
                map[transverse(row, column)] = (transverse(1 - row, 1 - column), 1.0);
            }
            column += 1;
        }
        row += 1;
    }
    map
};

/// Entries of the two-sphere resistance from its functions: with i as sphere 1, with j as sphere 1.
///
/// Linear in the functions, so it also applies to their singular coefficients.
pub(super) fn resistance_entries(scalars: &[Scalars; 2], radii: [f64; 2]) -> [f64; ENTRIES] {
    let mut out = [0.0; ENTRIES];
    for one in 0..2 {
        let (a, f) = (radii[one], &scalars[one]);
        // d points from the sphere labelled 1 to the other: along x̂ for i, against it for j.
        let sign = if one == 0 { 1.0 } else { -1.0 };
        let (force, couple, torque, stress) = (
            6.0 * PI * a,
            sign * 4.0 * PI * a * a,
            8.0 * PI * a.powi(3),
            20.0 / 3.0 * PI * a.powi(3),
        );
        let axial_shape = (2.0_f64 / 3.0).sqrt();
        let shear_shape = 2.0_f64.sqrt();
        for other in 0..2 {
            let two = if other == 0 { one } else { 1 - one };
            let ((u, e), (u2, e2)) = ((2 * one, 2 * one + 1), (2 * two, 2 * two + 1));
            out[axial(u, u2)] = force * f.x_a[other];
            out[axial(e, u2)] = couple * axial_shape * f.x_g[other];
            out[axial(e, e2)] = stress * f.x_m[other];
            out[transverse(one, two)] = stress * f.z_m[other];
            let (row, column) = (3 * one, 3 * two);
            out[odd(row, column)] = force * f.y_a[other];
            out[odd(row + 1, column)] = -couple * f.y_b[other];
            out[odd(row + 2, column)] = couple * shear_shape * f.y_g[other];
            out[odd(row + 1, column + 1)] = torque * f.y_c[other];
            out[odd(row + 2, column + 1)] = torque * shear_shape * f.y_h[other];
            out[odd(row + 2, column + 2)] = stress * f.y_m[other];
        }
    }
    out
}

/// Reduced modes as vectors of the twelve: axial, transverse, odd.
fn reduced_modes() -> [SVector<f64, 12>; 12] {
    let (half, root) = (0.5, 0.75_f64.sqrt());
    let mut modes = [SVector::<f64, 12>::zeros(); 12];
    for sphere in 0..2 {
        let at = 6 * sphere;
        modes[2 * sphere][at] = 1.0;
        modes[2 * sphere + 1][at + 3] = root;
        modes[2 * sphere + 1][at + 5] = half;
        modes[4 + sphere][at + 3] = -half;
        modes[4 + sphere][at + 5] = root;
        for (k, mode) in [1, 2, 4].into_iter().enumerate() {
            modes[6 + 3 * sphere + k][at + mode] = 1.0;
        }
    }
    modes
}

/// The full matrix of entries; modes of i, then of j.
pub(super) fn expand(entries: &[f64; ENTRIES]) -> PairMatrix {
    let mut reduced = PairMatrix::zeros();
    for row in 0..6 {
        for column in 0..6 {
            reduced[(6 + row, 6 + column)] = entries[odd(row, column)];
            if row < 4 && column < 4 {
                reduced[(row, column)] = entries[axial(row, column)];
            }
            if row < 2 && column < 2 {
                reduced[(4 + row, 4 + column)] = entries[transverse(row, column)];
            }
        }
    }
    let basis = PairMatrix::from_columns(&reduced_modes());
    basis * reduced * basis.transpose()
}

/// Entries of the drag of both spheres, each alone.
pub(super) fn isolated_entries(radii: [f64; 2]) -> [f64; ENTRIES] {
    let mut out = [0.0; ENTRIES];
    for (sphere, radius) in radii.into_iter().enumerate() {
        let drag = self_mobility(radius).map(f64::recip);
        let (velocity, strain) = (2 * sphere, 2 * sphere + 1);
        out[axial(velocity, velocity)] = drag[0];
        out[axial(strain, strain)] = drag[3];
        out[transverse(sphere, sphere)] = drag[3];
        for (row, mode) in [1, 2, 4].into_iter().enumerate() {
            out[odd(3 * sphere + row, 3 * sphere + row)] = drag[mode];
        }
    }
    out
}

/// Entries of the inverse of the far-field mobility of the pair alone.
///
/// Positive definite and finite at every gap, contact included.
pub(super) fn far_field_entries(radii: [f64; 2], distance: f64) -> [f64; ENTRIES] {
    let mut mobility = PairMatrix::zeros();
    let x = Vec2::new(distance, 0.0);
    for (sphere, radius) in radii.into_iter().enumerate() {
        let own = self_mobility(radius);
        for k in 0..6 {
            mobility[(6 * sphere + k, 6 * sphere + k)] = own[k];
        }
    }
    let coupling = pair_mobility(-x, radii[0], radii[1]);
    mobility.fixed_view_mut::<6, 6>(0, 6).copy_from(&coupling);
    mobility
        .fixed_view_mut::<6, 6>(6, 0)
        .copy_from(&coupling.transpose());
    let basis = PairMatrix::from_columns(&reduced_modes());
    let reduced = basis.transpose() * mobility * basis;
    let mut out = [0.0; ENTRIES];
    let regular = "the far-field mobility of separated spheres is positive definite";
    let inverse = reduced
        .fixed_view::<4, 4>(0, 0)
        .try_inverse()
        .expect(regular);
    for row in 0..4 {
        for column in row..4 {
            out[axial(row, column)] = inverse[(row, column)];
        }
    }
    let inverse = reduced
        .fixed_view::<2, 2>(4, 4)
        .try_inverse()
        .expect(regular);
    for row in 0..2 {
        for column in row..2 {
            out[transverse(row, column)] = inverse[(row, column)];
        }
    }
    let inverse = reduced
        .fixed_view::<6, 6>(6, 6)
        .try_inverse()
        .expect(regular);
    for row in 0..6 {
        for column in row..6 {
            out[odd(row, column)] = inverse[(row, column)];
        }
    }
    out
}

/// Resistance to slip at the contact point of a free pair.
///
/// ```text
/// K = 1 / (cᵀ R⁻¹ c),   c = (−1, −l_i, 1, −l_j) on (U_y, Ω of i; U_y, Ω of j),   l = a + g/2
/// ```
/// R is the odd velocity block of the two-sphere resistance; in mu·a.
pub(super) fn slip_resistance(resistance: &[f64; ENTRIES], radii: [f64; 2], gap: f64) -> f64 {
    let half_gap = 0.5 * gap;
    let modes = [0, 1, 3, 4];
    let block = SMatrix::<f64, 4, 4>::from_fn(|r, c| resistance[odd(modes[r], modes[c])]);
    let slip = SVector::<f64, 4>::new(-1.0, -radii[0] - half_gap, 1.0, -radii[1] - half_gap);
    let inverse = block
        .try_inverse()
        .expect("the resistance of separated spheres is positive definite");
    1.0 / slip.dot(&(inverse * slip))
}
