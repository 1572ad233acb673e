//! `R_FU` of Ball-Melrose hydrodynamics pair by pair: products with it in O(N), and its near part for a sparse factor.

use crate::error::Error;
use crate::geometry::pair::Neighbours;
use crate::hydrodynamics::two_sphere::PairTerm;
use crate::linalg::cholesky::sparse::{Block, BlockCholesky, BlockPattern};
use crate::linalg::simd::vectorised;

/// Pairs closer than this, in s', must be in the pattern of the near part. What is left out counts by its diagonal blocks; with these
/// limits conjugate gradients then gain a factor of about thirty in each iteration.
const NEAR: f64 = 2.4;
/// A new pattern takes in pairs up to this, in s', so that it serves for a while.
const PATTERN: f64 = 2.7;

/// What a pair outside the pattern has for a number in it.
const NONE: usize = usize::MAX;

/// The resistance of all spheres, pair by pair.
#[derive(Default)]
pub struct Network {
    /// Block of each sphere with itself.
    own: Vec<Block>,
    /// Pairs (i, j) and their blocks: rows of j, columns of i.
    couplings: Vec<([usize; 2], Block)>,
    /// Number of each pair in the pattern, or [`NONE`].
    numbers: Vec<usize>,
    /// Pairs of the pattern, ordered.
    listed: Vec<(usize, usize)>,
    /// The pattern of the near part.
    pattern: Option<BlockPattern>,
}

impl Network {
    /// An empty one, with the pattern of the given pairs; empty: with a new one at the first positions.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(super) fn new(spheres: usize, listed: &[(u32, u32)]) -> Result<Self, Error> {
        let mut network = Self::default();
        if !listed.is_empty() {
            let pairs = listed.iter().map(|&(i, j)| (i as usize, j as usize));
            network.list(spheres, pairs)?;
        }
        Ok(network)
    }

    /// Takes over the pair terms, and makes a new pattern where a near pair is not in the old one.
    ///
    /// `drags`: by sphere, what resists its motion alone.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(super) fn assemble(
        &mut self,
        pairs: &[Neighbours],
        terms: &[PairTerm],
        radii: &[f64],
        drags: impl Iterator<Item = [f64; 3]>,
    ) -> Result<(), Error> {
        self.own.clear();
        self.own
            .extend(drags.map(|[x, y, spin]| [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, spin]));
        self.couplings.clear();
        let (own, couplings) = (&mut self.own, &mut self.couplings);
        vectorised(
            #[inline(always)]
            || {
                for (pair, term) in pairs.iter().zip(terms) {
                    let block = term.force_velocity(pair.normal);
                    let mut coupling = [0.0; 9];
                    for column in 0..3 {
                        for row in 0..3 {
                            own[pair.i][3 * column + row] += block[(row, column)];
                            own[pair.j][3 * column + row] += block[(3 + row, 3 + column)];
                            coupling[3 * column + row] = block[(3 + row, column)];
                        }
                    }
                    couplings.push(([pair.i, pair.j], coupling));
                }
            },
        );
        let closer = |pair: &Neighbours, limit: f64| {
            pair.distance < 0.5 * limit * (radii[pair.i] + radii[pair.j])
        };
        if !self.number(pairs, |pair| closer(pair, NEAR)) {
            let near = pairs.iter().filter(|pair| closer(pair, PATTERN));
            self.list(radii.len(), near.map(|pair| (pair.i, pair.j)))?;
            self.number(pairs, |_| false);
        }
        Ok(())
    }

    /// Makes the pattern of these pairs.
    fn list(
        &mut self,
        spheres: usize,
        pairs: impl Iterator<Item = (usize, usize)>,
    ) -> Result<(), Error> {
        self.listed.clear();
        self.listed.extend(pairs);
        let pattern = BlockPattern::new(spheres, &self.listed).ok_or(Error::OutOfMemory {
            purpose: "the sparse factor of the resistance",
        })?;
        self.pattern = Some(pattern);
        Ok(())
    }

    /// Finds each pair in the pattern; whether there is one with all that it needs.
    fn number(&mut self, pairs: &[Neighbours], needs: impl Fn(&Neighbours) -> bool) -> bool {
        self.numbers.clear();
        let mut listed = self.listed.iter().enumerate().peekable();
        for pair in pairs {
            let key = (pair.i, pair.j);
            while listed.next_if(|(_, other)| **other < key).is_some() {}
            match listed.peek() {
                Some(&(number, other)) if *other == key => self.numbers.push(number),
                _ if needs(pair) => return false,
                _ => self.numbers.push(NONE),
            }
        }
        self.pattern.is_some()
    }

    /// The pattern of the near part; `None` before the first positions.
    pub fn pattern(&self) -> Option<&BlockPattern> {
        self.pattern.as_ref()
    }

    /// Pairs of the pattern, ordered.
    pub fn listed(&self) -> &[(usize, usize)] {
        &self.listed
    }

    /// Number of a pair in the pattern, which has all pairs near contact.
    pub fn number_of(&self, pair: &Neighbours) -> Option<usize> {
        self.listed.binary_search(&(pair.i, pair.j)).ok()
    }

    /// `y = R_FU v`, vectors `[3N]`.
    pub fn apply(&self, v: &[f64], y: &mut [f64]) {
        vectorised(
            #[inline(always)]
            || {
                let spheres = y.chunks_exact_mut(3).zip(v.chunks_exact(3));
                for ((y, v), b) in spheres.zip(&self.own) {
                    for k in 0..3 {
                        y[k] = b[k] * v[0] + b[3 + k] * v[1] + b[6 + k] * v[2];
                    }
                }
                for ([i, j], b) in &self.couplings {
                    let [i, j] = [3 * i, 3 * j];
                    let [v_i, v_j] = [i, j].map(|at| [v[at], v[at + 1], v[at + 2]]);
                    for k in 0..3 {
                        y[j + k] += b[k] * v_i[0] + b[3 + k] * v_i[1] + b[6 + k] * v_i[2];
                        let rows = [b[3 * k], b[3 * k + 1], b[3 * k + 2]];
                        y[i + k] += rows[0] * v_j[0] + rows[1] * v_j[1] + rows[2] * v_j[2];
                    }
                }
            },
        );
    }

    /// Puts the near part into a matrix of the pattern: all diagonal blocks, couplings of the pattern.
    pub fn fill(&self, pattern: &BlockPattern, matrix: &mut BlockCholesky) {
        matrix.reset(pattern);
        for (sphere, block) in self.own.iter().enumerate() {
            matrix.add_own(pattern, sphere, block);
        }
        for ((_, block), &number) in self.couplings.iter().zip(&self.numbers) {
            if number != NONE {
                matrix.add_coupling(pattern, number, block);
            }
        }
    }
}
