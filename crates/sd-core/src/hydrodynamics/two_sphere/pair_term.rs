//! The resistance of one pair, applied to modes in the frame of the layer.

use super::pair_frame::{self, ENTRIES, PairMatrix, axial, odd, transverse};
use crate::space::modes::Vec2;
use nalgebra::{SMatrix, SVector, Vector3};

/// `(U_x, U_y, Ω)` of i, then of j, or the forces and torque conjugate to them.
pub type PairVector = SVector<f64, 6>;

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

/// Strains of both spheres as seen along n: axial, transverse, shear.
struct Strains {
    /// Components a.
    axial: [f64; 2],
    /// Components w.
    transverse: [f64; 2],
    /// Components e2.
    shear: [f64; 2],
}

/// cos 2θ and sin 2θ of n.
fn double_angle(n: Vec2) -> (f64, f64) {
    (n.x * n.x - n.y * n.y, 2.0 * n.x * n.y)
}

/// √3/2.
const ROOT: f64 = 0.866_025_403_784_438_6;

impl Strains {
    /// Rotates components from the layer's frame to that of the pair.
    fn along(n: Vec2, e_i: &Vector3<f64>, e_j: &Vector3<f64>) -> Self {
        let (c, s) = double_angle(n);
        let both = [e_i, e_j];
        let along = both.map(|e| c * e[0] + s * e[1]);
        Self {
            axial: [0, 1].map(|k| ROOT * along[k] + 0.5 * both[k][2]),
            transverse: [0, 1].map(|k| -0.5 * along[k] + ROOT * both[k][2]),
            shear: both.map(|e| c * e[1] - s * e[0]),
        }
    }

    /// Rotates components from the frame of the pair to the layer's.
    fn to_layer(&self, n: Vec2) -> PairVector {
        let (c, s) = double_angle(n);
        let mut out = PairVector::zeros();
        for k in 0..2 {
            let along = ROOT * self.axial[k] - 0.5 * self.transverse[k];
            out[3 * k] = c * along - s * self.shear[k];
            out[3 * k + 1] = s * along + c * self.shear[k];
            out[3 * k + 2] = 0.5 * self.axial[k] + ROOT * self.transverse[k];
        }
        out
    }
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

    /// `R_FU [6 × 6]`, forces and torques of both from velocities of both.
    #[inline]
    pub fn force_velocity(&self, n: Vec2) -> SMatrix<f64, 6, 6> {
        let mut out = SMatrix::<f64, 6, 6>::zeros();
        for p in 0..2 {
            for q in 0..2 {
                for (column, entries) in self.block(n, p, q).into_iter().enumerate() {
                    for (row, entry) in entries.into_iter().enumerate() {
                        out[(3 * p + row, 3 * q + column)] = entry;
                    }
                }
            }
        }
        out
    }

    /// Block (p, q) of [`PairTerm::force_velocity`], by columns: forces and torque on sphere p from
    /// the velocities of sphere q.
    #[inline(always)]
    pub(crate) fn block(&self, n: Vec2, p: usize, q: usize) -> [[f64; 3]; 3] {
        let along = self.axial(2 * p, 2 * q);
        let across = self.odd(3 * p, 3 * q);
        let force_spin = self.odd(3 * p, 3 * q + 1);
        let torque_velocity = self.odd(3 * p + 1, 3 * q);
        let oblique = (along - across) * (n.x * n.y);
        let (xx, yy) = (n.x * n.x, n.y * n.y);
        [
            [along * xx + across * yy, oblique, -torque_velocity * n.y],
            [oblique, along * yy + across * xx, torque_velocity * n.x],
            [
                -force_spin * n.y,
                force_spin * n.x,
                self.odd(3 * p + 1, 3 * q + 1),
            ],
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

    /// `R_FE e`: forces and torques of both from strains `(e1, e2, e3)` of both.
    pub fn force_from_strain(&self, n: Vec2, e_i: &Vector3<f64>, e_j: &Vector3<f64>) -> PairVector {
        let strains = Strains::along(n, e_i, e_j);
        let mut out = PairVector::zeros();
        for p in 0..2 {
            let (mut along, mut across, mut torque) = (0.0, 0.0, 0.0);
            for q in 0..2 {
                along += self.axial(2 * p, 2 * q + 1) * strains.axial[q];
                across += self.odd(3 * p, 3 * q + 2) * strains.shear[q];
                torque += self.odd(3 * p + 1, 3 * q + 2) * strains.shear[q];
            }
            out[3 * p] = along * n.x - across * n.y;
            out[3 * p + 1] = along * n.y + across * n.x;
            out[3 * p + 2] = torque;
        }
        out
    }

    /// `R_SU v`: stresslets `(s1, s2, s3)` of i, then of j, from velocities of both.
    pub fn stresslet_from_velocity(&self, n: Vec2, v: &PairVector) -> PairVector {
        let along = [0, 3].map(|k| n.x * v[k] + n.y * v[k + 1]);
        let across = [0, 3].map(|k| n.x * v[k + 1] - n.y * v[k]);
        let spin = [v[2], v[5]];
        let row = |p: usize| {
            let axial: f64 = (0..2)
                .map(|q| self.axial(2 * p + 1, 2 * q) * along[q])
                .sum();
            let shear: f64 = (0..2)
                .map(|q| {
                    self.odd(3 * p + 2, 3 * q) * across[q]
                        + self.odd(3 * p + 2, 3 * q + 1) * spin[q]
                })
                .sum();
            (axial, shear)
        };
        let rows = [row(0), row(1)];
        Strains {
            axial: rows.map(|r| r.0),
            transverse: [0.0; 2],
            shear: rows.map(|r| r.1),
        }
        .to_layer(n)
    }

    /// `R_SE e`: stresslets of i, then of j, from strains of both.
    pub fn stresslet_from_strain(
        &self,
        n: Vec2,
        e_i: &Vector3<f64>,
        e_j: &Vector3<f64>,
    ) -> PairVector {
        let strains = Strains::along(n, e_i, e_j);
        let sum = |entry: &dyn Fn(usize) -> f64, e: &[f64; 2]| entry(0) * e[0] + entry(1) * e[1];
        Strains {
            axial: [0, 1].map(|p| sum(&|q| self.axial(2 * p + 1, 2 * q + 1), &strains.axial)),
            transverse: [0, 1]
                .map(|p| sum(&|q| self.entries[transverse(p, q)], &strains.transverse)),
            shear: [0, 1].map(|p| sum(&|q| self.odd(3 * p + 2, 3 * q + 2), &strains.shear)),
        }
        .to_layer(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::modes::rotation_to_frame;

    #[test]
    fn parts_are_those_of_the_rotated_matrix() {
        let pair = PairTerm::new(&std::array::from_fn(|k| (1.0 + k as f64).sin()));
        let n = Vec2::new(0.8_f64.cos(), 0.8_f64.sin());
        let turn = rotation_to_frame(n);
        let mut both = PairMatrix::zeros();
        both.fixed_view_mut::<6, 6>(0, 0).copy_from(&turn);
        both.fixed_view_mut::<6, 6>(6, 6).copy_from(&turn);
        let lab = both.transpose() * pair.matrix() * both;
        let vector = SVector::<f64, 12>::from_fn(|k, _| (0.3 + k as f64).cos());
        let pick = |at: usize| Vector3::new(vector[at], vector[at + 1], vector[at + 2]);
        let (e_i, e_j) = (pick(3), pick(9));
        let v = PairVector::from_iterator([0, 1, 2, 6, 7, 8].map(|k| vector[k]));
        let only = |strain: bool| {
            SVector::<f64, 12>::from_fn(|k, _| {
                if (k % 6 >= 3) == strain {
                    vector[k]
                } else {
                    0.0
                }
            })
        };
        let (from_v, from_e) = (lab * only(false), lab * only(true));
        let part = |x: &SVector<f64, 12>, strain: bool| {
            let at = if strain { 3 } else { 0 };
            PairVector::from_fn(|k, _| x[6 * (k / 3) + at + k % 3])
        };
        let pairs = [
            (pair.force_velocity(n) * v, part(&from_v, false)),
            (pair.force_from_strain(n, &e_i, &e_j), part(&from_e, false)),
            (pair.stresslet_from_velocity(n, &v), part(&from_v, true)),
            (
                pair.stresslet_from_strain(n, &e_i, &e_j),
                part(&from_e, true),
            ),
        ];
        for (found, expected) in pairs {
            assert!((found - expected).norm() < 1e-13, "{found} {expected}");
        }
        for p in 0..2 {
            for q in 0..2 {
                for (column, entries) in pair.mode_block(n, p, q).into_iter().enumerate() {
                    for (row, entry) in entries.into_iter().enumerate() {
                        let expected = lab[(6 * p + row, 6 * q + column)];
                        assert!((entry - expected).abs() < 1e-13, "{row} {column}");
                    }
                }
            }
        }
    }
}
