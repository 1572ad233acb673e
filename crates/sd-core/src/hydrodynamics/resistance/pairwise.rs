//! `R_FU` of Ball-Melrose hydrodynamics pair by pair: products with it in O(N), and its near part
//! for a sparse factor.

use super::fluid::{Fluid, NearTerm as _};
use super::isolated::isolated;
use super::near_matrix::{NearMatrix, NearPattern};
use super::reach::Reach;
use crate::error::Error;
use crate::linalg::simd::vectorised;
use crate::space::pair::{Neighbours, PairKey};
use crate::space::{FixedArray, Layer, Space};

/// `R_FU` of all spheres: the block of each sphere with itself, and of each pair in range.
pub struct PairwiseResistance<S: Fluid = Layer> {
    /// Block of each sphere with itself.
    own: Vec<S::Block>,
    /// Pairs (i, j) and their blocks: rows of j, columns of i. Products read all of them, so the
    /// numbers are short.
    couplings: Vec<([u32; 2], S::Block)>,
    /// Number in the pattern of each pair that is in it.
    numbers: Vec<Option<usize>>,
    /// Pairs of the pattern, ordered.
    pattern_pairs: Vec<PairKey>,
    pattern: NearPattern<S>,
    /// Pairs and pattern at the last [`PairwiseResistance::save_pattern`], if others replaced them.
    saved: Option<(Vec<PairKey>, NearPattern<S>)>,
    reach: Reach,
}

impl<S: Fluid> PairwiseResistance<S> {
    /// A resistance without blocks, with the pattern of the given pairs.
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
            pattern: NearPattern::new(spheres, pattern_pairs)?,
            saved: None,
            reach,
        })
    }

    /// Includes in the near part all pairs that touch at asperities of this height, in a.
    pub(super) fn expect_contacts(&mut self, height: f64, radii: &[f64]) {
        let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
        self.reach = self.reach.with_contacts(height / smallest);
    }

    /// Discards the pattern: the next positions get a new one.
    pub(super) fn forget_pattern(&mut self) {
        self.pattern_pairs.clear();
    }

    /// Sets the pair terms, and makes a new pattern if a near pair is not in the old one.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(super) fn assemble(
        &mut self,
        pairs: &[Neighbours<S>],
        terms: &[S::Term],
        radii: &[f64],
    ) -> Result<(), Error> {
        self.own.clear();
        self.own.extend(radii.iter().map(|&a| {
            let (drag, mut block): (_, S::Block) = (isolated::<S>(a), FixedArray::each(0.0));
            for k in 0..S::MODES {
                block[(S::MODES + 1) * k] = drag[k];
            }
            block
        }));
        self.couplings.clear();
        let (own, couplings) = (&mut self.own, &mut self.couplings);
        vectorised(
            #[inline(always)]
            || {
                for (pair, term) in pairs.iter().zip(terms) {
                    let [of_i, coupling, of_j] = term.blocks(&pair.normal);
                    for (sphere, block) in [(pair.i, of_i), (pair.j, of_j)] {
                        for (x, entry) in own[sphere].as_mut().iter_mut().zip(block.as_ref()) {
                            *x += entry;
                        }
                    }
                    let (i, j) = pair.key();
                    couplings.push(([i, j], coupling));
                }
            },
        );
        let closer = |pair: &Neighbours<S>, limit: f64| {
            pair.distance < 0.5 * limit * (radii[pair.i] + radii[pair.j])
        };
        let Reach { needed, taken, .. } = self.reach;
        // An empty pattern is rebuilt each time: a snapshot does not distinguish it from a missing
        // one.
        let serves = self.number(pairs, |pair| closer(pair, needed));
        if !serves || self.pattern_pairs.is_empty() {
            let near = pairs.iter().filter(|pair| closer(pair, taken));
            let pattern_pairs: Vec<PairKey> = near.map(Neighbours::key).collect();
            let pattern = NearPattern::new(radii.len(), &pattern_pairs)?;
            let replaced_pairs = std::mem::replace(&mut self.pattern_pairs, pattern_pairs);
            let replaced = std::mem::replace(&mut self.pattern, pattern);
            self.saved.get_or_insert((replaced_pairs, replaced));
            self.number(pairs, |_| false);
        }
        Ok(())
    }

    /// Makes the present pattern the one that [`PairwiseResistance::restore_pattern`] restores.
    pub(crate) fn save_pattern(&mut self) {
        self.saved = None;
    }

    /// Restores the saved pattern. The resistance must be assembled again before it is used.
    pub(crate) fn restore_pattern(&mut self) {
        if let Some((pairs, pattern)) = self.saved.take() {
            (self.pattern_pairs, self.pattern) = (pairs, pattern);
        }
    }

    /// Finds each pair in the pattern; `false` if a required one is missing.
    fn number(&mut self, pairs: &[Neighbours<S>], needs: impl Fn(&Neighbours<S>) -> bool) -> bool {
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
    pub(super) fn add_spring(&mut self, pair: &Neighbours<S>, slope: f64) {
        let (n, spheres) = (pair.normal, [pair.i, pair.j]);
        let (i, j) = pair.key();
        let at = self
            .couplings
            .binary_search_by_key(&[i, j], |(key, _)| *key)
            .expect("springs join pairs in range, which were all assembled");
        for column in 0..S::DIMENSIONS {
            for row in 0..S::DIMENSIONS {
                let value = slope * n[row] * n[column];
                for sphere in spheres {
                    self.own[sphere][S::MODES * column + row] += value;
                }
                self.couplings[at].1[S::MODES * column + row] -= value;
            }
        }
    }

    /// The pattern of the near part.
    pub(crate) fn pattern(&self) -> &NearPattern<S> {
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
        self.multiply(side_by_side::<S>(v), side_by_side_mut::<S>(y));
    }

    /// `R_FU v` for L motions together, interleaved by sphere, which reads the blocks once.
    pub(crate) fn multiply<const L: usize>(&self, v: &[Motion<S, L>], y: &mut [Motion<S, L>]) {
        vectorised(
            #[inline(always)]
            || {
                for ((y, v), b) in y.iter_mut().zip(v).zip(&self.own) {
                    for k in 0..S::MODES {
                        y[k] = product::<S, L>(|m| b[S::MODES * m + k], v);
                    }
                }
                // All pairs of a sphere i are consecutive: their contributions are summed before
                // writing.
                for of_one in self.couplings.chunk_by(|([a, _], _), ([b, _], _)| a == b) {
                    let i = of_one[0].0[0] as usize;
                    let (v_i, mut y_i) = (v[i], y[i]);
                    for ([_, j], b) in of_one {
                        let (v_j, y_j) = (v[*j as usize], &mut y[*j as usize]);
                        for k in 0..S::MODES {
                            let of_j = product::<S, L>(|m| b[S::MODES * m + k], &v_i);
                            let of_i = product::<S, L>(|m| b[S::MODES * k + m], &v_j);
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

    /// Copies the near part to a matrix of the pattern: all diagonal blocks, and couplings of the
    /// pattern.
    pub(crate) fn fill(&self, pattern: &NearPattern<S>, matrix: &mut NearMatrix<S>) {
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

/// Velocities of a sphere, or the forces on it, of each of L motions.
pub(crate) type Motion<S, const L: usize> = <S as Space>::PerMode<[f64; L]>;

/// A vector of all spheres, as one motion.
pub(crate) fn side_by_side<S: Space>(x: &[f64]) -> &[Motion<S, 1>] {
    S::by_sphere(x.as_chunks().0)
}

/// A mutable vector of all spheres, as one motion.
pub(crate) fn side_by_side_mut<S: Space>(x: &mut [f64]) -> &mut [Motion<S, 1>] {
    S::by_sphere_mut(x.as_chunks_mut().0)
}

/// A row of a block times the velocities of a sphere.
#[inline(always)]
fn product<S: Space, const L: usize>(row: impl Fn(usize) -> f64, v: &Motion<S, L>) -> [f64; L] {
    let mut sums = [0.0; L];
    for (lane, sum) in sums.iter_mut().enumerate() {
        *sum = row(0) * v[0][lane];
        for m in 1..S::MODES {
            *sum += row(m) * v[m][lane];
        }
    }
    sums
}
