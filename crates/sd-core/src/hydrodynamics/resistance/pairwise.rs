//! `R_FU` of Ball-Melrose hydrodynamics pair by pair: products with it in O(N), and its near part for a sparse factor.

use super::isolated;
use crate::error::Error;
use crate::hydrodynamics::two_sphere::PairTerm;
use crate::linalg::cholesky::sparse::{Block, BlockCholesky, BlockPattern};
use crate::linalg::simd::vectorised;
use crate::space::pair::{Neighbours, PairKey};

/// Which pairs the near part has, in s'. Others count by their diagonal blocks alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reach {
    /// Pairs closer than this must be in the pattern.
    pub(super) needed: f64,
    /// A new pattern takes in pairs up to this, so that it serves for a while.
    pub(super) taken: f64,
}

impl Reach {
    /// Pairs that touch or soon may: the factor is then small, and iterations on it are quick, if more of them.
    pub(super) const SHORT: Self = Self {
        needed: 2.1,
        taken: 2.2,
    };
    /// First neighbours too: each iteration then gains a factor of about thirty.
    pub(super) const LONG: Self = Self {
        needed: 2.4,
        taken: 2.7,
    };
    /// Gap, in s' − 2, that is needed beyond the height of contacts, which approach and are then stiff.
    const AHEAD: f64 = 0.08;

    /// The same, with all contacts of asperities of that height, in the mean radius of a pair.
    fn with_contacts(self, height: f64) -> Self {
        let needed = self.needed.max(2.0 + height + Self::AHEAD);
        Self {
            needed,
            taken: self.taken + (needed - self.needed),
        }
    }
}

/// `R_FU` of all spheres: the block of each sphere with itself, and of each pair in range.
pub struct PairwiseResistance {
    /// Block of each sphere with itself.
    own: Vec<Block>,
    /// Pairs (i, j) and their blocks: rows of j, columns of i. Products read all of them, so the numbers are short.
    couplings: Vec<([u32; 2], Block)>,
    /// Number in the pattern of each pair that is in it.
    numbers: Vec<Option<usize>>,
    /// Pairs of the pattern, ordered.
    pattern_pairs: Vec<PairKey>,
    pattern: BlockPattern,
    /// Whether the pattern was made for positions of these spheres; before the first ones it has no pair.
    has_positions: bool,
    reach: Reach,
}

impl PairwiseResistance {
    /// A resistance without blocks yet, with the pattern of the given pairs; if there are none, the first positions make the pattern.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(super) fn new(
        spheres: usize,
        reach: Reach,
        pattern_pairs: &[PairKey],
    ) -> Result<Self, Error> {
        Ok(Self {
            own: Vec::with_capacity(spheres),
            couplings: Vec::new(),
            numbers: Vec::new(),
            pattern_pairs: pattern_pairs.to_vec(),
            pattern: pattern(spheres, pattern_pairs)?,
            has_positions: !pattern_pairs.is_empty(),
            reach,
        })
    }

    /// Takes all pairs into the near part that touch at asperities of that height, in a.
    pub(super) fn expect_contacts(&mut self, height: f64, radii: &[f64]) {
        let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
        self.reach = self.reach.with_contacts(height / smallest);
    }

    /// Takes over the pair terms, and makes a new pattern where a near pair is not in the old one.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(super) fn assemble(
        &mut self,
        pairs: &[Neighbours],
        terms: &[PairTerm],
        radii: &[f64],
    ) -> Result<(), Error> {
        self.own.clear();
        self.own.extend(radii.iter().map(|&a| {
            let [x, y, spin] = isolated::drag(a);
            [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, spin]
        }));
        self.couplings.clear();
        let (own, couplings) = (&mut self.own, &mut self.couplings);
        vectorised(
            #[inline(always)]
            || {
                for (pair, term) in pairs.iter().zip(terms) {
                    let block = |p: usize, q: usize| term.block(pair.normal, p, q);
                    for (sphere, block) in [(pair.i, block(0, 0)), (pair.j, block(1, 1))] {
                        for (x, entry) in own[sphere].iter_mut().zip(block.as_flattened()) {
                            *x += entry;
                        }
                    }
                    let mut coupling = [0.0; 9];
                    coupling.copy_from_slice(block(1, 0).as_flattened());
                    let (i, j) = pair.key();
                    couplings.push(([i, j], coupling));
                }
            },
        );
        let closer = |pair: &Neighbours, limit: f64| {
            pair.distance < 0.5 * limit * (radii[pair.i] + radii[pair.j])
        };
        let Reach { needed, taken } = self.reach;
        if !self.number(pairs, |pair| closer(pair, needed)) || !self.has_positions {
            let near = pairs.iter().filter(|pair| closer(pair, taken));
            self.pattern_pairs.clear();
            self.pattern_pairs.extend(near.map(Neighbours::key));
            self.pattern = pattern(radii.len(), &self.pattern_pairs)?;
            self.has_positions = true;
            self.number(pairs, |_| false);
        }
        Ok(())
    }

    /// Finds each pair in the pattern; `false` if one that the pattern needs is not there.
    fn number(&mut self, pairs: &[Neighbours], needs: impl Fn(&Neighbours) -> bool) -> bool {
        self.numbers.clear();
        let mut listed = self.pattern_pairs.iter().enumerate().peekable();
        for pair in pairs {
            let key = pair.key();
            while listed.next_if(|(_, other)| **other < key).is_some() {}
            match listed.peek() {
                Some(&(number, other)) if *other == key => self.numbers.push(Some(number)),
                _ if needs(pair) => return false,
                _ => self.numbers.push(None),
            }
        }
        true
    }

    /// Adds `slope` n nᵀ of a pair's relative velocity, for a pair that was assembled.
    pub(super) fn add_spring(&mut self, pair: &Neighbours, slope: f64) {
        let (n, spheres) = (pair.normal, [pair.i, pair.j]);
        let (i, j) = pair.key();
        let at = self
            .couplings
            .binary_search_by_key(&[i, j], |(key, _)| *key)
            .expect("springs join pairs in range, which were all assembled");
        for column in 0..2 {
            for row in 0..2 {
                let value = slope * n[row] * n[column];
                for sphere in spheres {
                    self.own[sphere][3 * column + row] += value;
                }
                self.couplings[at].1[3 * column + row] -= value;
            }
        }
    }

    /// The pattern of the near part.
    pub fn pattern(&self) -> &BlockPattern {
        &self.pattern
    }

    /// Pairs of the pattern, ordered.
    pub fn pattern_pairs(&self) -> &[PairKey] {
        &self.pattern_pairs
    }

    /// Number of a pair in the pattern, which has all pairs near contact.
    pub fn number_of(&self, pair: PairKey) -> Option<usize> {
        self.pattern_pairs.binary_search(&pair).ok()
    }

    /// Number of spheres.
    pub fn spheres(&self) -> usize {
        self.own.len()
    }

    /// `y = R_FU v`, vectors `[3N]`.
    pub fn apply(&self, v: &[f64], y: &mut [f64]) {
        self.multiply(side_by_side(v), side_by_side_mut(y));
    }

    /// The same for L motions at once, of which each sphere has its velocities side by side: that reads the blocks once.
    pub(crate) fn multiply<const L: usize>(&self, v: &[Motion<L>], y: &mut [Motion<L>]) {
        vectorised(
            #[inline(always)]
            || {
                for ((y, v), b) in y.iter_mut().zip(v).zip(&self.own) {
                    for k in 0..3 {
                        y[k] = product([b[k], b[3 + k], b[6 + k]], v);
                    }
                }
                // All pairs of a sphere i follow each other: what they do to it is summed before it is written.
                for of_one in self.couplings.chunk_by(|([a, _], _), ([b, _], _)| a == b) {
                    let i = of_one[0].0[0] as usize;
                    let (v_i, mut y_i) = (v[i], y[i]);
                    for ([_, j], b) in of_one {
                        let (v_j, y_j) = (v[*j as usize], &mut y[*j as usize]);
                        for k in 0..3 {
                            let of_j = product([b[k], b[3 + k], b[6 + k]], &v_i);
                            let of_i = product([b[3 * k], b[3 * k + 1], b[3 * k + 2]], &v_j);
                            for lane in 0..L {
                                y_j[k][lane] += of_j[lane];
                                y_i[k][lane] += of_i[lane];
                            }
                        }
                    }
                    y[i] = y_i;
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
            if let Some(number) = number {
                matrix.add_coupling(pattern, number, block);
            }
        }
    }
}

/// `(U_x, U_y, Ω)` of a sphere, or the forces on it, of each of L motions.
pub(crate) type Motion<const L: usize> = [[f64; L]; 3];

/// A vector `[3N]`, as one motion.
pub(crate) fn side_by_side(x: &[f64]) -> &[Motion<1>] {
    x.as_chunks().0.as_chunks().0
}

/// The same, to write.
pub(crate) fn side_by_side_mut(x: &mut [f64]) -> &mut [Motion<1>] {
    x.as_chunks_mut().0.as_chunks_mut().0
}

/// A row of a block times the velocities of a sphere.
#[inline(always)]
fn product<const L: usize>(row: [f64; 3], v: &Motion<L>) -> [f64; L] {
    let mut sums = [0.0; L];
    for (lane, sum) in sums.iter_mut().enumerate() {
        *sum = row[0] * v[0][lane] + row[1] * v[1][lane] + row[2] * v[2][lane];
    }
    sums
}

/// The pattern of these pairs.
///
/// # Errors
/// [`Error::OutOfMemory`].
fn pattern(spheres: usize, pairs: &[PairKey]) -> Result<BlockPattern, Error> {
    let couplings: Vec<_> = pairs
        .iter()
        .map(|&(i, j)| (i as usize, j as usize))
        .collect();
    BlockPattern::new(spheres, &couplings).ok_or(Error::OutOfMemory {
        purpose: "the sparse factor of the resistance",
    })
}
