//! All pairs within a range, by a list of bins in O(N).

use super::Space;
use super::cell::Cell;
use crate::error::Error;

/// Two spheres within range of each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Neighbours<S: Space> {
    /// First sphere, `i < j`.
    pub(crate) i: usize,
    /// Second sphere.
    pub(crate) j: usize,
    /// The image of j that is meant.
    pub(crate) image: [i32; 3],
    /// Distance of the centres r, in a.
    pub(crate) distance: f64,
    /// Unit vector n from i to that image of j.
    pub(crate) normal: S::Vector,
    /// Surface-to-surface gap g = r − a_i − a_j, in a.
    pub(crate) gap: f64,
}

impl<S: Space> Neighbours<S> {
    /// The spheres `[i, j]`, i < j, if `s' = 2r/(a_i + a_j)` is below `range`.
    #[inline(always)]
    fn within(
        range: f64,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        [i, j]: [usize; 2],
    ) -> Option<Self> {
        let (r, image) = cell.nearest(centres[j] - centres[i]);
        let sum = radii[i] + radii[j];
        let square = S::norm_squared(&r);
        let reach = 0.5 * range * sum;
        (square < reach * reach).then(|| {
            let distance = square.sqrt();
            Self {
                i,
                j,
                image,
                distance,
                normal: r / distance,
                gap: distance - sum,
            }
        })
    }

    /// The error that names the pair as overlapping.
    pub(crate) fn overlap(&self) -> Error {
        Error::Overlap {
            i: self.i,
            j: self.j,
            gap: self.gap,
            separation: self.distance,
        }
    }
}

/// All pairs within range, ordered by (i, j).
#[derive(Debug)]
pub(crate) struct NeighbourList<S: Space> {
    pairs: Vec<Neighbours<S>>,
    /// Spheres sorted by bin.
    sorted: Vec<usize>,
    /// Start of each bin in `sorted`; one more than there are bins.
    starts: Vec<usize>,
    /// Bin of each sphere along the axes.
    bins: Vec<[usize; 3]>,
    /// Neighbours of the sphere that is being searched for.
    found: Vec<Neighbours<S>>,
}

impl<S: Space> Default for NeighbourList<S> {
    fn default() -> Self {
        Self {
            pairs: Vec::new(),
            sorted: Vec::new(),
            starts: Vec::new(),
            bins: Vec::new(),
            found: Vec::new(),
        }
    }
}

impl<S: Space> NeighbourList<S> {
    /// The pairs of the last [`NeighbourList::find`].
    pub(crate) fn pairs(&self) -> &[Neighbours<S>] {
        &self.pairs
    }

    /// Finds all pairs with `2r/(a_i + a_j) < range`; gaps may be negative. Sides must be at least twice the longest distance.
    pub(crate) fn find(
        &mut self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        range: f64,
    ) {
        self.pairs.clear();
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let mut counts = [1; 3];
        if let Cell::Periodic { sides, .. } = cell {
            for (k, count) in counts.iter_mut().enumerate().take(S::DIMENSIONS) {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "at least 1 and bounded by the clamp"
                )]
                let bins = (sides[k] / (range * largest)).floor().clamp(1.0, 1024.0) as usize;
                *count = bins;
            }
        }
        self.fill_bins(cell, centres, counts);
        for i in 0..centres.len() {
            self.found.clear();
            let [column, row, plane] = self.bins[i];
            for other_plane in around(plane, counts[2]) {
                for (k, other_row) in around(row, counts[1]).enumerate() {
                    // Across the top or bottom of the cell the bins are shifted by the offset.
                    let shift = match cell {
                        Cell::Periodic { sides, offset } if counts[1] >= 3 => {
                            let cells = match row + k {
                                0 => *offset,
                                up if up == counts[1] + 1 => -offset,
                                _ => 0.0,
                            };
                            Some(cells / sides[0] * counts[0] as f64)
                        }
                        _ => None,
                    };
                    let (first, span) = match shift {
                        Some(shift) if shift == 0.0 && counts[0] > 3 => (column + counts[0] - 1, 3),
                        Some(shift) if counts[0] > 4 => {
                            let start = (column as f64 + shift).floor();
                            #[expect(
                                clippy::cast_possible_truncation,
                                clippy::cast_sign_loss,
                                reason = "rem_euclid makes it a bin number"
                            )]
                            let first = (start - 1.0).rem_euclid(counts[0] as f64) as usize;
                            (first, 4)
                        }
                        _ => (0, counts[0]),
                    };
                    for other in first..first + span {
                        let bin =
                            (other_plane * counts[1] + other_row) * counts[0] + other % counts[0];
                        for &j in &self.sorted[self.starts[bin]..self.starts[bin + 1]] {
                            if j > i {
                                self.found.extend(Neighbours::within(
                                    range,
                                    cell,
                                    centres,
                                    radii,
                                    [i, j],
                                ));
                            }
                        }
                    }
                }
            }
            self.found.sort_unstable_by_key(|pair| pair.j);
            self.pairs.extend_from_slice(&self.found);
        }
    }

    /// Sorts the spheres into bins, by counting.
    fn fill_bins(&mut self, cell: &Cell<S>, centres: &[S::Vector], counts: [usize; 3]) {
        self.bins.clear();
        self.starts.clear();
        self.starts.resize(counts.iter().product::<usize>() + 1, 0);
        for &centre in centres {
            let mut bin = [0; 3];
            if let Cell::Periodic { sides, .. } = cell {
                let x = cell.wrap(centre);
                for k in 0..S::DIMENSIONS {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "wrapped into the cell; rounding at its edge is clamped"
                    )]
                    let index = (x[k] / sides[k] * counts[k] as f64) as usize;
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

/// Number of a bin.
fn number([column, row, plane]: [usize; 3], counts: [usize; 3]) -> usize {
    (plane * counts[1] + row) * counts[0] + column
}

/// The bins before, at and after one along a periodic axis; where there are fewer than three, each once.
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
    use crate::geometry::cell::LUBRICATION_RANGE;
    use crate::space::{Bulk, Layer};
    use nalgebra::{Vector2, Vector3};
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};

    /// Points in and around a cell, found by bins and by trying all pairs.
    fn compare<S: Space>(cell: &Cell<S>, sides: S::Vector, seed: u64) {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
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
        list.find(cell, &centres, &radii, LUBRICATION_RANGE);
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
            seed in 0u64..1000, x in 8.0..40.0f64, y in 8.0..40.0f64, z in 8.0..40.0f64, offset in -30.0..30.0f64,
        ) {
            let sides = Vector3::new(x, y, z);
            compare(&Cell::<Bulk>::periodic(sides, offset).unwrap(), sides, seed);
            let sides = Vector2::new(x, y);
            compare(&Cell::<Layer>::periodic(sides, offset).unwrap(), sides, seed);
        }
    }
}
