//! The resistance of one pair, applied to modes in the frame of the layer.

use super::pair_frame::{self, ENTRIES, ODD, PairMatrix, TRANSVERSE, axial, odd, transverse};
use crate::space::modes::Vec2;
use std::f64::consts::FRAC_1_SQRT_2;

/// A pair matrix in the frame of its line of centres, symmetric, in mu·a, mu·a², mu·a³.
///
/// ```text
/// (F, T, S~) = R (U − u∞, Ω − Ω∞, −E∞)
/// ```
/// All methods take the unit vector `n` from i to j and use modes in the frame of the layer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairTerm {
    /// The independent entries, numbered in `pair_frame`.
    entries: [f64; ENTRIES],
}

/// cos 2θ and sin 2θ of n.
fn double_angle(n: Vec2) -> (f64, f64) {
    (n.x * n.x - n.y * n.y, 2.0 * n.x * n.y)
}

/// √3/2.
const ROOT: f64 = 0.866_025_403_784_438_6;

/// Modes rotated by the angle of the unit vector n.
#[inline(always)]
fn rotated([x, y, spin, e1, e2, e3]: [f64; 6], n: Vec2) -> [f64; 6] {
    let (c, s) = double_angle(n);
    [
        n.x * x - n.y * y,
        n.y * x + n.x * y,
        spin,
        c * e1 - s * e2,
        s * e1 + c * e2,
        e3,
    ]
}

/// The product of a vector and a symmetric matrix, whose upper triangle is given row by row.
#[inline(always)]
fn symmetric<const N: usize>(upper: &[f64], x: [f64; N]) -> [f64; N] {
    let (mut y, mut at) = ([0.0; N], 0);
    for row in 0..N {
        y[row] += upper[at] * x[row];
        at += 1;
        for column in row + 1..N {
            y[row] += upper[at] * x[column];
            y[column] += upper[at] * x[row];
            at += 1;
        }
    }
    y
}

impl PairTerm {
    #[inline(always)]
    pub(super) fn new(entries: &[f64; ENTRIES]) -> Self {
        Self { entries: *entries }
    }

    #[inline(always)]
    pub(super) fn entries(&self) -> &[f64; ENTRIES] {
        &self.entries
    }

    /// This term times a factor.
    #[inline]
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        Self {
            entries: self.entries.map(|entry| factor * entry),
        }
    }

    /// Adds another term of the same pair.
    #[inline]
    pub(crate) fn add(&mut self, other: &Self) {
        for (entry, other) in self.entries.iter_mut().zip(other.entries) {
            *entry += other;
        }
    }

    /// Adds the resistance K to the slip between the surfaces, which meet at the given distances
    /// from the centres.
    ///
    /// ```text
    /// u_t = w·(U_y, Ω, −e2) of i and j,   w = (−1, −l_i, −l_i/√2, 1, −l_j, −l_j/√2),   R ← R + K w wᵀ
    /// ```
    pub(crate) fn resist_slip(&mut self, resistance: f64, [l_i, l_j]: [f64; 2]) {
        let [e_i, e_j] = [l_i, l_j].map(|lever| -lever * FRAC_1_SQRT_2);
        let w = [-1.0, -l_i, e_i, 1.0, -l_j, e_j];
        for row in 0..6 {
            for column in row..6 {
                self.entries[odd(row, column)] += resistance * w[row] * w[column];
            }
        }
    }

    #[inline]
    fn axial(&self, row: usize, column: usize) -> f64 {
        self.entries[axial(row, column)]
    }

    #[inline]
    fn odd(&self, row: usize, column: usize) -> f64 {
        self.entries[odd(row, column)]
    }

    /// The whole matrix in the frame of the pair: modes `(U_x, U_y, Ω, e1, e2, e3)` of i, then of
    /// j.
    pub fn matrix(&self) -> PairMatrix {
        pair_frame::expand(&self.entries)
    }

    /// Block (p, q) of `R_FU`, by columns: forces and torque on sphere p from the velocities of
    /// sphere q.
    #[inline(always)]
    pub(crate) fn block(&self, n: Vec2, p: usize, q: usize) -> [f64; 9] {
        let along = self.axial(2 * p, 2 * q);
        let across = self.odd(3 * p, 3 * q);
        let force_spin = self.odd(3 * p, 3 * q + 1);
        let torque_velocity = self.odd(3 * p + 1, 3 * q);
        let oblique = (along - across) * (n.x * n.y);
        let (xx, yy) = (n.x * n.x, n.y * n.y);
        [
            along * xx + across * yy,
            oblique,
            -torque_velocity * n.y,
            oblique,
            along * yy + across * xx,
            torque_velocity * n.x,
            -force_spin * n.y,
            force_spin * n.x,
            self.odd(3 * p + 1, 3 * q + 1),
        ]
    }

    /// Block (p, q) of the whole matrix, by columns: `(F_x, F_y, T, s1, s2, s3)` of sphere p from
    /// `(U_x, U_y, Ω, −e1, −e2, −e3)` of q.
    #[inline]
    pub(crate) fn mode_block(&self, n: Vec2, p: usize, q: usize) -> [[f64; 6]; 6] {
        let (velocity, strain) = (|k: usize| 2 * k, |k: usize| 2 * k + 1);
        let transverse = self.entries[transverse(p, q)];
        let stretch = self.axial(strain(p), strain(q));
        let mut block = [[0.0; 6]; 6];
        // In the frame of the pair, where the axial strain is (√3/2, ·, 1/2) and the transverse one
        // (−1/2, ·, √3/2).
        block[3][3] = 0.75 * stretch + 0.25 * transverse;
        block[5][5] = 0.25 * stretch + 0.75 * transverse;
        block[3][5] = 0.5 * ROOT * (stretch - transverse);
        block[5][3] = block[3][5];
        let push = self.axial(velocity(p), strain(q));
        (block[3][0], block[5][0]) = (ROOT * push, 0.5 * push);
        let pull = self.axial(strain(p), velocity(q));
        (block[0][3], block[0][5]) = (ROOT * pull, 0.5 * pull);
        block[0][0] = self.axial(velocity(p), velocity(q));
        let modes = [1, 2, 4];
        for (row, &to) in modes.iter().enumerate() {
            for (column, &from) in modes.iter().enumerate() {
                block[from][to] = self.odd(3 * p + row, 3 * q + column);
            }
        }
        // To the frame of the layer: velocities turn by θ, strains by 2θ.
        let turns = [(0, (n.x, n.y)), (3, double_angle(n))];
        for (first, (c, s)) in turns {
            for column in &mut block {
                let (x, y) = (column[first], column[first + 1]);
                (column[first], column[first + 1]) = (c * x - s * y, s * x + c * y);
            }
            let (x, y) = (block[first], block[first + 1]);
            block[first] = std::array::from_fn(|row| c * x[row] - s * y[row]);
            block[first + 1] = std::array::from_fn(|row| s * x[row] + c * y[row]);
        }
        block
    }

    /// `(F_x, F_y, T, s1, s2, s3)` of both spheres from `(U_x, U_y, Ω, −e1, −e2, −e3)` of both.
    #[inline(always)]
    pub fn apply(&self, n: Vec2, x: &[[f64; 6]; 2]) -> [[f64; 6]; 2] {
        let back = Vec2::new(n.x, -n.y);
        let (i, j) = (rotated(x[0], back), rotated(x[1], back));
        let stretches = [ROOT * i[3] + 0.5 * i[5], ROOT * j[3] + 0.5 * j[5]];
        let (of_axial, rest) = self.entries.split_at(TRANSVERSE);
        let (of_transverse, of_odd) = rest.split_at(ODD - TRANSVERSE);
        let axial = symmetric(of_axial, [i[0], stretches[0], j[0], stretches[1]]);
        let transverse = [ROOT * i[5] - 0.5 * i[3], ROOT * j[5] - 0.5 * j[3]];
        let transverse = symmetric(of_transverse, transverse);
        let odd = symmetric(of_odd, [i[1], i[2], i[4], j[1], j[2], j[4]]);
        let mut y = [[0.0; 6]; 2];
        for (p, y) in y.iter_mut().enumerate() {
            let (stretch, w, odd) = (axial[2 * p + 1], transverse[p], &odd[3 * p..]);
            let (e1, e3) = (ROOT * stretch - 0.5 * w, 0.5 * stretch + ROOT * w);
            *y = rotated([axial[2 * p], odd[0], odd[1], e1, odd[2], e3], n);
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::modes::rotation_to_frame;
    use nalgebra::SVector;

    #[test]
    fn parts_are_those_of_the_rotated_matrix() {
        let pair = PairTerm::new(&std::array::from_fn(|k| (1.0 + k as f64).sin()));
        let n = Vec2::new(0.8_f64.cos(), 0.8_f64.sin());
        let turn = rotation_to_frame(n);
        let mut both = PairMatrix::zeros();
        both.fixed_view_mut::<6, 6>(0, 0).copy_from(&turn);
        both.fixed_view_mut::<6, 6>(6, 6).copy_from(&turn);
        let lab = both.transpose() * pair.matrix() * both;
        let vector: [f64; 12] = std::array::from_fn(|k| (0.3 + k as f64).cos());
        let both = [0, 6].map(|at| std::array::from_fn(|k| vector[at + k]));
        let expected = lab * SVector::from(vector);
        for (found, expected) in pair.apply(n, &both).as_flattened().iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-13, "{found} {expected}");
        }
        for p in 0..2 {
            for q in 0..2 {
                for (column, entries) in pair.mode_block(n, p, q).into_iter().enumerate() {
                    for (row, entry) in entries.into_iter().enumerate() {
                        let expected = lab[(6 * p + row, 6 * q + column)];
                        assert!((entry - expected).abs() < 1e-13, "{row} {column}");
                    }
                }
                for (k, entry) in pair.block(n, p, q).into_iter().enumerate() {
                    let expected = lab[(6 * p + k % 3, 6 * q + k / 3)];
                    assert!((entry - expected).abs() < 1e-13, "{k}");
                }
            }
        }
    }
}
