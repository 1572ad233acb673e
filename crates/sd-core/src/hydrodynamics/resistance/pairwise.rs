//! `R_FU` of Ball-Melrose hydrodynamics pair by pair: products with it in O(N), and its near part
//! for a sparse factor.
//!
//! In a product each of several threads computes the spheres of a slab, so that few pairs are read
//! by two: with two threads a right-hand side of a layer of 4000 takes 12 % less by it, one of a
//! suspension of 2000 the same. Every sphere adds its pairs in their order, whoever computes it.

use super::fluid::{Fluid, NearTerm as _};
use super::isolated::isolated;
use super::near_matrix::{NearMatrix, NearPattern};
use super::reach::Reach;
use crate::error::Error;
use crate::hydrodynamics::part_of_pairs::{
    LEAST_SPHERES, divide_spheres, for_pairs_of, list_starts,
};
use crate::linalg::simd::vectorised;
use crate::space::pair::{Neighbours, PairKey};
use crate::space::{FixedArray, Layer, Space};
use crate::threads;

/// `R_FU` of all spheres: the block of each sphere with itself, and of each pair in range.
pub struct PairwiseResistance<S: Fluid = Layer> {
    /// Block of each sphere with itself.
    own: Vec<S::Block>,
    /// Pairs (i, j) and their blocks: rows of j, columns of i. Products read all of them, so the
    /// numbers are short.
    couplings: Vec<([u32; 2], S::Block)>,
    /// Where the pairs (i, j) of each sphere i start, then their number.
    starts: Vec<usize>,
    slabs: Slabs,
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
            starts: Vec::with_capacity(spheres + 1),
            slabs: Slabs::default(),
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
    /// `place`: coordinate of a sphere across slabs.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(super) fn assemble(
        &mut self,
        (pairs, terms): (&[Neighbours<S>], &[S::Term]),
        radii: &[f64],
        place: impl Fn(usize) -> f64,
    ) -> Result<(), Error> {
        let slabs = threads::parts(radii.len(), LEAST_SPHERES);
        self.slabs.divide(slabs, radii.len(), pairs, place);
        list_starts(
            radii.len(),
            pairs.iter().map(|pair| pair.i),
            &mut self.starts,
        );
        self.couplings
            .resize(pairs.len(), ([0; 2], FixedArray::each(0.0)));
        self.own.resize(radii.len(), FixedArray::each(0.0));
        let second = |at: usize| pairs[at].j;
        divide_spheres(
            (&mut self.own, &mut self.couplings),
            &self.starts,
            LEAST_SPHERES,
            &|range, own, couplings| {
                for (block, &a) in own.iter_mut().zip(&radii[range.clone()]) {
                    let drag = isolated::<S>(a);
                    *block = FixedArray::each(0.0);
                    for k in 0..S::MODES {
                        block[(S::MODES + 1) * k] = drag[k];
                    }
                }
                let (first, first_pair) = (range.start, self.starts[range.start]);
                vectorised(
                    #[inline(always)]
                    || {
                        for_pairs_of(
                            &range,
                            &self.starts,
                            second,
                            #[inline(always)]
                            |at, [has_i, has_j]| {
                                let pair = &pairs[at];
                                let [of_i, coupling, of_j] = terms[at].blocks(&pair.normal);
                                if has_j {
                                    add_block::<S>(&mut own[pair.j - first], &of_j);
                                }
                                if has_i {
                                    add_block::<S>(&mut own[pair.i - first], &of_i);
                                    let (i, j) = pair.key();
                                    let entry = &mut couplings[at - first_pair];
                                    entry.0 = [i, j];
                                    entry.1 = coupling;
                                }
                            },
                        );
                    },
                );
            },
        );
        let closer = |pair: &Neighbours<S>, limit: f64| {
            pair.distance < 0.5 * limit * (radii[pair.i] + radii[pair.j])
        };
        let Reach {
            required, included, ..
        } = self.reach;
        // An empty pattern is rebuilt each time: a snapshot does not distinguish it from a missing
        // one.
        let serves = self.number(pairs, |pair| closer(pair, required));
        if !serves || self.pattern_pairs.is_empty() {
            let near = pairs.iter().filter(|pair| closer(pair, included));
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

    /// `y = R_FU v`, vectors `[3N]`; `work` is workspace.
    pub fn apply(&self, v: &[f64], y: &mut [f64], work: &mut Vec<Motion<S, 1>>) {
        self.multiply(side_by_side::<S>(v), side_by_side_mut::<S>(y), work);
    }

    /// `R_FU v` for L motions together, interleaved by sphere, which reads the blocks once.
    pub(crate) fn multiply<const L: usize>(
        &self,
        v: &[Motion<S, L>],
        y: &mut [Motion<S, L>],
        work: &mut Vec<Motion<S, L>>,
    ) {
        let (slabs, spheres) = (self.slabs.count, y.len());
        if slabs == 1 {
            return vectorised(
                #[inline(always)]
                || self.multiply_all(v, y),
            );
        }
        // Each slab has a vector of its own.
        work.resize(slabs * spheres, S::each([0.0; L]));
        let mut none = [(); Slabs::MOST];
        let none = &mut none[..slabs];
        threads::divide_with((&mut *work, spheres), none, &|first, own, (): &mut ()| {
            for (slab, y) in (first..).zip(own.chunks_exact_mut(spheres)) {
                vectorised(
                    #[inline(always)]
                    || self.multiply_slab(slab, v, y),
                );
            }
        });
        let work = &*work;
        threads::divide(y, LEAST_SPHERES, &|first, y| {
            let of_sphere = (first..).zip(&self.slabs.of_sphere[first..]);
            for (y, (sphere, &slab)) in y.iter_mut().zip(of_sphere) {
                *y = work[spheres * usize::from(slab) + sphere];
            }
        });
    }

    /// [`PairwiseResistance::multiply`] on one thread.
    #[inline(always)]
    fn multiply_all<const L: usize>(&self, v: &[Motion<S, L>], y: &mut [Motion<S, L>]) {
        for ((y, v), b) in y.iter_mut().zip(v).zip(&self.own) {
            for k in 0..S::MODES {
                y[k] = product::<S, L>(|m| b[S::MODES * m + k], v);
            }
        }
        for (i, bounds) in self.starts.windows(2).enumerate() {
            // All pairs of a sphere i are consecutive: their contributions are summed before
            // writing.
            let (v_i, mut y_i) = (v[i], y[i]);
            for ([_, j], b) in &self.couplings[bounds[0]..bounds[1]] {
                let j = *j as usize;
                add_both::<S, L>(b, [&v_i, &v[j]], [&mut y_i, &mut y[j]]);
            }
            y[i] = y_i;
        }
    }

    /// The spheres of a slab in [`PairwiseResistance::multiply`]; others are left as they are.
    #[inline(always)]
    fn multiply_slab<const L: usize>(
        &self,
        slab: usize,
        v: &[Motion<S, L>],
        y: &mut [Motion<S, L>],
    ) {
        let is_here = |sphere: usize| usize::from(self.slabs.of_sphere[sphere]) == slab;
        for (i, b) in self.own.iter().enumerate().filter(|(i, _)| is_here(*i)) {
            for k in 0..S::MODES {
                y[i][k] = product::<S, L>(|m| b[S::MODES * m + k], &v[i]);
            }
        }
        for (i, bounds) in self.starts.windows(2).enumerate() {
            if is_here(i) {
                let (v_i, mut y_i) = (v[i], y[i]);
                for ([_, j], b) in &self.couplings[bounds[0]..bounds[1]] {
                    let j = *j as usize;
                    if is_here(j) {
                        add_both::<S, L>(b, [&v_i, &v[j]], [&mut y_i, &mut y[j]]);
                    } else {
                        add::<S, L>(|k, m| b[S::MODES * k + m], &v[j], &mut y_i);
                    }
                }
                y[i] = y_i;
            } else {
                for &at in self.slabs.across(i) {
                    let ([_, j], b) = &self.couplings[at as usize];
                    if is_here(*j as usize) {
                        add::<S, L>(|k, m| b[S::MODES * m + k], &v[i], &mut y[*j as usize]);
                    }
                }
            }
        }
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

/// Spheres divided by a coordinate, as many in each slab.
#[derive(Debug)]
struct Slabs {
    count: usize,
    /// Slab of each sphere; empty where there is one.
    of_sphere: Vec<u16>,
    /// Pairs of spheres in different slabs, by first sphere, and where those of each start.
    across: Vec<u32>,
    starts: Vec<usize>,
    /// Coordinates and spheres, in order of the coordinates.
    sorted: Vec<(f64, u32)>,
}

impl Default for Slabs {
    fn default() -> Self {
        Self {
            count: 1,
            of_sphere: Vec::new(),
            across: Vec::new(),
            starts: Vec::new(),
            sorted: Vec::new(),
        }
    }
}

impl Slabs {
    /// Most slabs.
    const MOST: usize = 64;

    #[expect(
        clippy::cast_possible_truncation,
        reason = "numbers of spheres and pairs fit 32 bits, and there are few slabs"
    )]
    fn divide<S: Space>(
        &mut self,
        count: usize,
        spheres: usize,
        pairs: &[Neighbours<S>],
        place: impl Fn(usize) -> f64,
    ) {
        self.count = count.min(Self::MOST);
        if self.count == 1 {
            return;
        }
        self.sorted.clear();
        let places = (0..spheres).map(|sphere| (place(sphere), sphere as u32));
        self.sorted.extend(places);
        self.sorted
            .sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.of_sphere.resize(spheres, 0);
        for (rank, &(_, sphere)) in self.sorted.iter().enumerate() {
            self.of_sphere[sphere as usize] = (rank * self.count / spheres) as u16;
        }
        let is_across = |pair: &Neighbours<S>| self.of_sphere[pair.i] != self.of_sphere[pair.j];
        let across = || pairs.iter().enumerate().filter(|(_, pair)| is_across(pair));
        self.across.clear();
        self.across.extend(across().map(|(at, _)| at as u32));
        let firsts = across().map(|(_, pair)| pair.i);
        list_starts(spheres, firsts, &mut self.starts);
    }

    /// Pairs of a sphere, as the first, with those of other slabs.
    #[inline(always)]
    fn across(&self, first: usize) -> &[u32] {
        &self.across[self.starts[first]..self.starts[first + 1]]
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

#[inline(always)]
fn add_block<S: Space>(to: &mut S::Block, block: &S::Block) {
    for (x, entry) in to.as_mut().iter_mut().zip(block.as_ref()) {
        *x += entry;
    }
}

/// Adds the coupling of a pair (i, j), rows of j and columns of i, in both directions.
#[inline(always)]
fn add_both<S: Space, const L: usize>(
    b: &S::Block,
    [v_i, v_j]: [&Motion<S, L>; 2],
    [y_i, y_j]: [&mut Motion<S, L>; 2],
) {
    for k in 0..S::MODES {
        let of_j = product::<S, L>(|m| b[S::MODES * m + k], v_i);
        let of_i = product::<S, L>(|m| b[S::MODES * k + m], v_j);
        for lane in 0..L {
            y_j[k][lane] += of_j[lane];
            y_i[k][lane] += of_i[lane];
        }
    }
}

/// Adds a block, given by row and column, times the velocities of a sphere.
#[inline(always)]
fn add<S: Space, const L: usize>(
    entry: impl Fn(usize, usize) -> f64,
    v: &Motion<S, L>,
    y: &mut Motion<S, L>,
) {
    for k in 0..S::MODES {
        let sums = product::<S, L>(|m| entry(k, m), v);
        for lane in 0..L {
            y[k][lane] += sums[lane];
        }
    }
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
