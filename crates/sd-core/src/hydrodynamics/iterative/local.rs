//! P, the far field's resistance as far as near pairs alone have it: see `far_pairs` of the resistance.

use crate::hydrodynamics::resistance::Resistance;
use crate::linalg::simd::vectorised;

/// Rows and columns `(s1, s2, s3, F_x, F_y, T)` from `(−e1, −e2, −e3, U_x, U_y, Ω)`, by columns.
type Block = [[f64; 6]; 6];

/// `P [6N × 6N]` in blocks, at one set of positions.
#[derive(Default)]
pub(super) struct LocalResistance {
    /// Block of each sphere with itself.
    own: Vec<Block>,
    /// Pairs (i, j) and their blocks: rows of j, columns of i.
    couplings: Vec<([usize; 2], Block)>,
}

impl LocalResistance {
    /// Takes the drag of isolated spheres `[6N]`, strains first, and what near pairs of `near` add to it.
    pub(super) fn update(&mut self, drag: &[f64], near: &Resistance) {
        let (strains, velocities) = drag.split_at(drag.len() / 2);
        self.own.clear();
        let spheres = strains.chunks_exact(3).zip(velocities.chunks_exact(3));
        self.own.extend(spheres.map(|(e, v)| {
            let mut block = Block::default();
            for k in 0..3 {
                (block[k][k], block[3 + k][3 + k]) = (e[k], v[k]);
            }
            block
        }));
        self.couplings.clear();
        for (pair, term) in near.far_pairs() {
            for (p, sphere) in [pair.i, pair.j].into_iter().enumerate() {
                let added = term.mode_block(pair.normal, p, p);
                for (own, added) in self.own[sphere].iter_mut().zip(added) {
                    for (own, added) in own.iter_mut().zip(added) {
                        *own += added;
                    }
                }
            }
            let coupling = term.mode_block(pair.normal, 1, 0);
            self.couplings.push(([pair.i, pair.j], coupling));
        }
    }

    /// `y = P x`, `[6N]`, strains first.
    pub(super) fn apply(&self, x: &[f64], y: &mut [f64]) {
        let half = x.len() / 2;
        let read = |sphere: usize| -> [f64; 6] {
            std::array::from_fn(|k| x[half * (k / 3) + 3 * sphere + k % 3])
        };
        vectorised(
            #[inline(always)]
            || {
                for (sphere, block) in self.own.iter().enumerate() {
                    let from = read(sphere);
                    let to: [f64; 6] =
                        std::array::from_fn(|k| (0..6).map(|c| block[c][k] * from[c]).sum());
                    y[3 * sphere..3 * sphere + 3].copy_from_slice(&to[..3]);
                    y[half + 3 * sphere..half + 3 * sphere + 3].copy_from_slice(&to[3..]);
                }
                for ([i, j], block) in &self.couplings {
                    let (of_i, of_j) = (read(*i), read(*j));
                    for (k, column) in block.iter().enumerate() {
                        let at = half * (k / 3) + k % 3;
                        let to_j: f64 = (0..6).map(|c| block[c][k] * of_i[c]).sum();
                        let to_i: f64 = (0..6).map(|c| column[c] * of_j[c]).sum();
                        y[at + 3 * j] += to_j;
                        y[at + 3 * i] += to_i;
                    }
                }
            },
        );
    }
}
