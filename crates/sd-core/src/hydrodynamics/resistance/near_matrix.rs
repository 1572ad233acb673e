//! Sparse matrices with a block for each sphere and each pair of them, and their factors.
//!
//! The factor has 3 × 3 blocks: a sphere of a layer is one block row, one of a suspension two, for
//! its velocity and its angular velocity.

use crate::error::Error;
use crate::linalg::cholesky::sparse::{Block, BlockCholesky, BlockPattern};
use crate::linalg::error::BadPivot;
use crate::space::Space;
use crate::space::pair::PairKey;
use std::marker::PhantomData;

/// Rows of a block of the factor.
const ROWS: usize = 3;

/// The pattern: pairs of spheres with a block.
#[derive(Debug)]
pub(crate) struct NearPattern<S: Space> {
    blocks: BlockPattern,
    space: PhantomData<S>,
}

impl<S: Space> NearPattern<S> {
    /// Block rows of a sphere.
    const PARTS: usize = S::MODES / ROWS;
    /// Couplings of the block rows of one sphere.
    const WITHIN: usize = Self::PARTS * (Self::PARTS - 1) / 2;

    /// The pattern of these pairs, which are numbered in this order.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn new(spheres: usize, pairs: &[PairKey]) -> Result<Self, Error> {
        let parts = Self::PARTS;
        let mut couplings =
            Vec::with_capacity(spheres * Self::WITHIN + parts * parts * pairs.len());
        for sphere in 0..spheres {
            for q in 0..parts {
                for p in q + 1..parts {
                    couplings.push((parts * sphere + q, parts * sphere + p));
                }
            }
        }
        for &(i, j) in pairs {
            for q in 0..parts {
                for p in 0..parts {
                    couplings.push((parts * i as usize + q, parts * j as usize + p));
                }
            }
        }
        let blocks = BlockPattern::new(parts * spheres, &couplings).ok_or(Error::OutOfMemory {
            purpose: "the sparse factor of the resistance",
        })?;
        Ok(Self {
            blocks,
            space: PhantomData,
        })
    }

    /// Number of spheres.
    pub(crate) fn spheres(&self) -> usize {
        self.blocks.spheres() / Self::PARTS
    }

    /// Number of the coupling of the parts q < p of one sphere.
    fn within(sphere: usize) -> usize {
        Self::WITHIN * sphere
    }

    /// Number of the first coupling of a pair.
    fn between(&self, number: usize) -> usize {
        Self::WITHIN * self.spheres() + Self::PARTS * Self::PARTS * number
    }
}

/// A matrix of a [`NearPattern`] and its factor, in single precision.
#[derive(Default)]
pub(crate) struct NearMatrix<S: Space> {
    blocks: BlockCholesky,
    space: PhantomData<S>,
}

/// Rows of part p and columns of part q.
#[inline(always)]
fn part<S: Space>(block: &S::Block, p: usize, q: usize) -> Block {
    let entries = block.as_ref();
    std::array::from_fn(|k| entries[S::MODES * (ROWS * q + k / ROWS) + ROWS * p + k % ROWS])
}

impl<S: Space> NearMatrix<S> {
    /// Sets the matrix to zero.
    pub(crate) fn reset(&mut self, pattern: &NearPattern<S>) {
        self.blocks.reset(&pattern.blocks);
    }

    /// Copies another matrix of the same pattern.
    pub(crate) fn copy_matrix(&mut self, other: &Self) {
        self.blocks.copy_matrix(&other.blocks);
    }

    /// Copies the block of a sphere from another matrix of the same pattern.
    pub(crate) fn copy_own(&mut self, pattern: &NearPattern<S>, other: &Self, sphere: usize) {
        let parts = NearPattern::<S>::PARTS;
        for p in 0..parts {
            self.blocks
                .copy_own(&pattern.blocks, &other.blocks, parts * sphere + p);
        }
        let first = NearPattern::<S>::within(sphere);
        for coupling in first..first + NearPattern::<S>::WITHIN {
            self.blocks
                .copy_coupling(&pattern.blocks, &other.blocks, coupling);
        }
    }

    /// Copies the block of a pair from another matrix of the same pattern.
    pub(crate) fn copy_coupling(&mut self, pattern: &NearPattern<S>, other: &Self, number: usize) {
        let (first, parts) = (pattern.between(number), NearPattern::<S>::PARTS);
        for coupling in first..first + parts * parts {
            self.blocks
                .copy_coupling(&pattern.blocks, &other.blocks, coupling);
        }
    }

    /// Adds to the block of a sphere.
    #[inline(always)]
    pub(crate) fn add_own(&mut self, pattern: &NearPattern<S>, sphere: usize, block: &S::Block) {
        let parts = NearPattern::<S>::PARTS;
        let mut coupling = NearPattern::<S>::within(sphere);
        for q in 0..parts {
            let own = part::<S>(block, q, q);
            self.blocks
                .add_own(&pattern.blocks, parts * sphere + q, &own);
            for p in q + 1..parts {
                let between = part::<S>(block, p, q);
                self.blocks
                    .add_coupling(&pattern.blocks, coupling, &between);
                coupling += 1;
            }
        }
    }

    /// Adds to the block of a pair (i, j): rows of j, columns of i.
    #[inline(always)]
    pub(crate) fn add_coupling(
        &mut self,
        pattern: &NearPattern<S>,
        number: usize,
        block: &S::Block,
    ) {
        let (mut coupling, parts) = (pattern.between(number), NearPattern::<S>::PARTS);
        for q in 0..parts {
            for p in 0..parts {
                let between = part::<S>(block, p, q);
                self.blocks
                    .add_coupling(&pattern.blocks, coupling, &between);
                coupling += 1;
            }
        }
    }

    /// Factors the matrix, which is unchanged.
    ///
    /// # Errors
    /// [`BadPivot`] with `S::MODES × sphere + component`.
    pub(crate) fn factor(&mut self, pattern: &NearPattern<S>) -> Result<(), BadPivot> {
        self.blocks.factor(&pattern.blocks)
    }

    /// Refactors a matrix of the same pattern as at the last factorization: updates only what
    /// changed values affect.
    ///
    /// # Errors
    /// [`BadPivot`] with the row of the pivot.
    pub(crate) fn factor_again(&mut self, pattern: &NearPattern<S>) -> Result<(), BadPivot> {
        self.blocks.factor_again(&pattern.blocks)
    }

    /// `z ≈ A⁻¹ r` by the factor; vectors in the order of the spheres.
    pub(crate) fn solve(&mut self, pattern: &NearPattern<S>, r: &[f64], z: &mut [f64]) {
        self.blocks.solve(&pattern.blocks, r, z);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hydrodynamics::resistance::{Fluid, NearFields, Resistance};
    use crate::linalg::cholesky::sparse::tests::times;
    use crate::model::{Hydrodynamics, Params};
    use crate::run::start::{self, Start};
    use crate::space::cell::Cell;

    fn print<S: Fluid>(name: &str, start: &Start<S>) {
        let (kind, tables) = (Hydrodynamics::BallMelrose, NearFields::default());
        let cell = Cell::<S>::equal_sides(start.side, 0.0).unwrap();
        let all = Resistance::new_pairwise(kind, &cell, &start.radii, &tables, &[]);
        let mut all = all.unwrap();
        all.update(&cell, &start.centres).unwrap();
        let (pairs, mut near) = (all.pairwise().unwrap(), NearMatrix::default());
        pairs.fill(pairs.pattern(), &mut near);
        let [ours, library] = times(&pairs.pattern().blocks, &mut near.blocks);
        let [factor, solve] = [0, 1].map(|k| library[k] / ours[k]);
        println!(
            "{name}, {}: {:.3} and {:.4} ms; the library takes {factor:.2} and {solve:.2} times",
            start.radii.len(),
            1e3 * ours[0],
            1e3 * ours[1]
        );
    }

    #[test]
    #[ignore = "a measurement, of which nothing is asserted"]
    fn times_of_a_factorization_and_of_a_solve() {
        for spheres in [200, 1000] {
            let params = Params::builder()
                .spheres(spheres)
                .roughness(0.01)
                .friction(0.5)
                .shear_rate(f64::INFINITY)
                .hydrodynamics(Hydrodynamics::BallMelrose)
                .time_step(0.01);
            let layer = params.clone().area_fraction(0.7).build().unwrap();
            print("layer", &start::layer(&layer, 1).unwrap());
            let suspension = params.volume_fraction(0.5).build().unwrap();
            print("suspension", &start::suspension(&suspension, 1).unwrap());
        }
    }
}
