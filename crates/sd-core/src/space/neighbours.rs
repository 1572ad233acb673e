//! All pairs within a range: found by a cell list in O(N), and reused while the spheres have not
//! moved far.

use super::cell::Cell;
use super::pair::Neighbours;
use super::verlet::VerletList;
use super::{Layer, Space};
use crate::error::Error;
use crate::linalg::simd::vectorised;
use crate::threads;

/// Bins are wider than the range by this factor's distance from 1, so that rounding of coordinates
/// hides no pair.
const ROUNDING: f64 = 1.0 - 1e-12;
/// Fewest pairs that a thread looks through, and fewest spheres whose neighbours it searches.
const LEAST_PAIRS: usize = 2000;
const LEAST_SPHERES: usize = 100;

/// All pairs within range, ordered by (i, j): found by a cell list, O(N).
#[derive(Debug)]
pub struct NeighbourList<S: Space = Layer> {
    pairs: Vec<Neighbours<S>>,
    /// Spheres sorted by bin.
    sorted: Vec<usize>,
    /// Start of each bin in `sorted`; one more than there are bins.
    starts: Vec<usize>,
    /// Bin of each sphere: column, row, plane.
    bins: Vec<[usize; 3]>,
    /// Pairs found by the other threads.
    others: Vec<Vec<Neighbours<S>>>,
    /// Verlet list of pairs that may come within range.
    kept: VerletList<S>,
    /// The overlap of two surfaces, in a, from which on [`NeighbourList::update`] refuses them.
    deepest: f64,
}

impl<S: Space> Default for NeighbourList<S> {
    fn default() -> Self {
        Self::new(0)
    }
}

impl<S: Space> NeighbourList<S> {
    /// Maximum number of bins along a side: 2^24 in all.
    const MAX_BINS: f64 = (1_u32 << (24 / S::DIMENSIONS)) as f64;

    /// Reserves memory for all pairs within range of a number of equal spheres.
    pub fn new(spheres: usize) -> Self {
        let pairs = S::RESERVED_NEIGHBOURS * spheres / 2;
        Self {
            pairs: Vec::with_capacity(pairs),
            sorted: Vec::with_capacity(spheres),
            starts: Vec::new(),
            bins: Vec::with_capacity(spheres),
            others: Vec::new(),
            kept: VerletList::new(spheres, pairs),
            deepest: 0.0,
        }
    }

    /// Allows overlaps up to `deepest`, in a.
    pub(crate) fn allow_overlap(&mut self, deepest: f64) {
        self.deepest = deepest;
    }

    /// The pairs of the last [`NeighbourList::update`].
    pub fn pairs(&self) -> &[Neighbours<S>] {
        &self.pairs
    }

    /// Finds all pairs with `2r/(a_i + a_j) < range`, and checks that none overlaps (soft ones: too
    /// deeply, or with one centre).
    ///
    /// In a periodic cell the range must not exceed [`crate::cell::LUBRICATION_RANGE`] and the cell
    /// must pass [`Cell::check_range`].
    ///
    /// # Errors
    /// [`Error::Overlap`] names the first pair whose surfaces touch.
    pub fn update(
        &mut self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        range: f64,
    ) -> Result<(), Error> {
        self.find_all(cell, centres, radii, range);
        self.pairs.iter().try_for_each(|pair| self.admit(pair))
    }

    /// [`NeighbourList::update`] without the check: gaps may be negative.
    pub(crate) fn find_all(
        &mut self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        range: f64,
    ) {
        if !self.find_by_kept_pairs(cell, centres, radii, range) {
            self.find(cell, centres, radii, range);
        }
    }

    /// Checks that the pairs found last do not overlap at nearby positions.
    ///
    /// # Errors
    /// As [`NeighbourList::update`].
    pub(crate) fn check(
        &self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
    ) -> Result<(), Error> {
        self.pairs.iter().try_for_each(|pair| {
            let both = [pair.i, pair.j];
            match Neighbours::within(f64::INFINITY, cell, centres, radii, both) {
                Some(moved) => self.admit(&moved),
                None => Ok(()),
            }
        })
    }

    /// The closest of the pairs found last, at nearby positions.
    pub(crate) fn closest_at(
        &self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
    ) -> Option<Neighbours<S>> {
        let moved = self.pairs.iter().filter_map(|pair| {
            Neighbours::within(f64::INFINITY, cell, centres, radii, [pair.i, pair.j])
        });
        moved.min_by(|a, b| a.gap.total_cmp(&b.gap))
    }

    /// Refuses a pair that overlaps.
    fn admit(&self, pair: &Neighbours<S>) -> Result<(), Error> {
        if pair.gap <= -self.deepest || pair.distance == 0.0 {
            Err(pair.overlap())
        } else {
            Ok(())
        }
    }

    /// [`NeighbourList::find_all`] from the pairs of an earlier search; `false` if the cell is
    /// too small for a skin, or unbounded.
    fn find_by_kept_pairs(
        &mut self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        range: f64,
    ) -> bool {
        let Cell::Periodic(lattice) = cell else {
            return false;
        };
        let longer = VerletList::<S>::longer(range);
        let largest = radii.iter().copied().fold(0.0, f64::max);
        if lattice.reach() < longer * largest {
            return false;
        }
        let good = vectorised(
            #[inline(always)]
            || self.kept.is_good(cell, centres, radii, range),
        );
        if !good {
            self.find(cell, centres, radii, longer);
            self.kept.keep(&self.pairs, cell, centres, radii, range);
        }
        let kept = self.kept.pairs();
        let lists = (&mut self.pairs, &mut self.others);
        threads::gather(kept.len(), LEAST_PAIRS, lists, &|part, pairs| {
            vectorised(
                #[inline(always)]
                || {
                    for &pair in &kept[part] {
                        pairs.extend(Neighbours::within(range, cell, centres, radii, pair));
                    }
                },
            );
        });
        true
    }

    /// [`NeighbourList::find_all`] by a new search.
    pub(crate) fn find(
        &mut self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        range: f64,
    ) {
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let mut counts = [1; 3];
        if let Cell::Periodic(lattice) = cell {
            let reciprocal = lattice.reciprocal();
            for (count, b) in counts.iter_mut().zip(&reciprocal).take(S::DIMENSIONS) {
                // Distance of the lattice planes across this coordinate.
                let height = S::norm_squared(b).sqrt().recip();
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "at least 1 and bounded by the clamp"
                )]
                let bins = (height * ROUNDING / (range * largest))
                    .floor()
                    .clamp(1.0, Self::MAX_BINS) as usize;
                *count = bins;
            }
        }
        // Vectorised code rounds by one instruction where other code calls a function.
        vectorised(
            #[inline(always)]
            || self.fill_bins(cell, centres, counts),
        );
        let (bins, sorted, starts) = (&self.bins, &self.sorted, &self.starts);
        let lists = (&mut self.pairs, &mut self.others);
        threads::gather(centres.len(), LEAST_SPHERES, lists, &|spheres, pairs| {
            vectorised(
                #[inline(always)]
                || {
                    for i in spheres {
                        let first = pairs.len();
                        for bin in bins_around(bins[i], counts) {
                            for &j in &sorted[starts[bin]..starts[bin + 1]] {
                                if j > i {
                                    let both = [i, j];
                                    let found =
                                        Neighbours::within(range, cell, centres, radii, both);
                                    pairs.extend(found);
                                }
                            }
                        }
                        pairs[first..].sort_unstable_by_key(|pair| pair.j);
                    }
                },
            );
        });
    }

    /// Sorts the spheres into bins, by counting.
    #[inline(always)]
    fn fill_bins(&mut self, cell: &Cell<S>, centres: &[S::Vector], counts: [usize; 3]) {
        self.bins.clear();
        self.starts.clear();
        self.starts.resize(counts.iter().product::<usize>() + 1, 0);
        for &centre in centres {
            let mut bin = [0; 3];
            if let Cell::Periodic(lattice) = cell {
                let coordinates = lattice.coordinates(&centre);
                for k in 0..S::DIMENSIONS {
                    let coordinate = coordinates[k] - coordinates[k].floor();
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "wrapped into the cell; rounding at its edge is clamped"
                    )]
                    let index = (coordinate * counts[k] as f64) as usize;
                    bin[k] = index.min(counts[k] - 1);
                }
            }
            self.bins.push(bin);
            self.starts[number(bin, counts) + 1] += 1;
        }
        for bin in 1..self.starts.len() {
            self.starts[bin] += self.starts[bin - 1];
        }
        self.sorted.clear();
        self.sorted.resize(centres.len(), 0);
        // The end of each bin is counted down to its start.
        for (i, &bin) in self.bins.iter().enumerate().rev() {
            let end = &mut self.starts[number(bin, counts) + 1];
            *end -= 1;
            self.sorted[*end] = i;
        }
        // Each entry now holds the start of the bin before it; shift back.
        self.starts.rotate_left(1);
        if let Some(last) = self.starts.last_mut() {
            *last = centres.len();
        }
    }
}

/// Numbers of the bins around one, itself included.
#[inline(always)]
fn bins_around(
    [column, row, plane]: [usize; 3],
    counts: [usize; 3],
) -> impl Iterator<Item = usize> {
    around(plane, counts[2]).flat_map(move |plane| {
        around(row, counts[1]).flat_map(move |row| {
            around(column, counts[0]).map(move |column| number([column, row, plane], counts))
        })
    })
}

/// Number of a bin.
#[inline(always)]
fn number([column, row, plane]: [usize; 3], counts: [usize; 3]) -> usize {
    (plane * counts[1] + row) * counts[0] + column
}

/// The bins before, at and after one along a periodic axis; with fewer than three bins, each once.
#[inline(always)]
fn around(bin: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count.min(3)).map(move |k| {
        if count < 3 {
            k
        } else {
            (bin + count + k - 1) % count
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Bulk;
    use crate::space::cell::LUBRICATION_RANGE;
    use nalgebra::{Vector2, Vector3};
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Points that drift, at random and with the flow, and are occasionally wrapped.
    fn drift<S: Space>(side: f64, n: usize, amplitude: f64) {
        let mut sides = S::Vector::default();
        for k in 0..S::DIMENSIONS {
            sides[k] = side;
        }
        let mut list = NeighbourList::new(n);
        let radii: Vec<f64> = (0..n).map(|i| if i % 3 == 0 { 1.4 } else { 1.0 }).collect();
        let mut centres: Vec<S::Vector> = (0..n)
            .map(|i| {
                let mut x = S::Vector::default();
                for k in 0..S::DIMENSIONS {
                    x[k] = ([7.0, 3.3, 5.7][k] * i as f64) % side;
                }
                x
            })
            .collect();
        list.allow_overlap(f64::INFINITY);
        let cross = |step: i32| amplitude * (0.05 * f64::from(step)).sin();
        let at = |step: i32| {
            let cell = Cell::<S>::periodic(sides, 0.003 * f64::from(step) * side).unwrap();
            cell.with_cross_offset(cross(step) * side).unwrap()
        };
        for step in 0..600 {
            let cell = at(step);
            list.update(&cell, &centres, &radii, LUBRICATION_RANGE)
                .unwrap();
            let mut new = NeighbourList::default();
            new.find(&cell, &centres, &radii, LUBRICATION_RANGE);
            assert_eq!(list.pairs, new.pairs);
            for (i, x) in centres.iter_mut().enumerate() {
                let wave = (f64::from(step) * 0.01 + i as f64).sin();
                let y = x[1];
                for k in 0..S::DIMENSIONS {
                    let crossed = (cross(step + 1) - cross(step)) * y;
                    x[k] += [0.003 * y + 0.01 * wave, 0.02 * wave, crossed - 0.01 * wave][k];
                }
                if step % 4 == 3 {
                    *x = at(step + 1).wrap(*x);
                }
            }
        }
    }

    #[test]
    fn lists_kept_under_shear_find_what_new_ones_find() {
        drift::<Layer>(14.0, 40, 0.0);
        drift::<Bulk>(13.0, 60, 0.0);
        drift::<Bulk>(13.0, 60, 0.3);
    }

    /// Points in and around a cell, found by bins and by trying all pairs. Points, not spheres:
    /// gaps may be negative.
    fn compare<S: Space>(sides: S::Vector, [offset, cross]: [f64; 2], seed: u64) {
        let cell = Cell::<S>::periodic(sides, offset)
            .and_then(|cell| cell.with_cross_offset(cross))
            .unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let n = 60;
        let centres: Vec<S::Vector> = (0..n)
            .map(|_| {
                let mut x = S::Vector::default();
                for k in 0..S::DIMENSIONS {
                    x[k] = (random.random::<f64>() * 3.0 - 1.0) * sides[k];
                }
                x
            })
            .collect();
        let radii = vec![1.0; n];
        let mut list = NeighbourList::default();
        list.find(&cell, &centres, &radii, LUBRICATION_RANGE);
        let mut expected = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                if S::norm_squared(&cell.nearest(centres[j] - centres[i]).0) < 16.0 {
                    expected.push((i, j));
                }
            }
        }
        let found: Vec<_> = list.pairs().iter().map(|p| (p.i, p.j)).collect();
        assert_eq!(found, expected);
    }

    proptest! {
        #[test]
        fn bins_find_what_brute_force_finds(
            seed in 0u64..1000, x in 8.0..60.0f64, y in 8.0..60.0f64, z in 8.0..40.0f64, offset in -30.0..30.0f64,
            cross in -20.0..20.0f64,
        ) {
            compare::<Layer>(Vector2::new(x, y), [offset, 0.0], seed);
            compare::<Bulk>(Vector3::new(x, y, z), [offset, 0.0], seed);
            compare::<Bulk>(Vector3::new(x, y, z), [offset, cross], seed);
        }
    }
}
