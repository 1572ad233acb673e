//! All pairs within a range: found by a list of bins in O(N), and kept while the spheres have not moved far.

use crate::error::Error;
use crate::geometry::cell::Cell;
use crate::geometry::modes::Vec2;
use crate::geometry::pair::Neighbours;
use crate::geometry::verlet::VerletList;
use crate::linalg::simd::vectorised;

/// Neighbours of a sphere within the lubrication range that room is made for; equal ones have 18 at most.
pub(crate) const MOST_NEIGHBOURS: usize = 20;

/// All pairs within range, ordered by (i, j): found by a cell list, O(N).
#[derive(Debug, Default)]
pub struct NeighbourList {
    pairs: Vec<Neighbours>,
    /// Spheres sorted by bin.
    sorted: Vec<usize>,
    /// Start of each bin in `sorted`; one more than there are bins.
    starts: Vec<usize>,
    /// Bin of each sphere, as (column, row).
    bins: Vec<(usize, usize)>,
    /// Neighbours of the sphere that is being searched for.
    found: Vec<Neighbours>,
    /// Pairs that may come within range for a while.
    kept: VerletList,
    /// The overlap of two surfaces, in a, from which on [`NeighbourList::update`] refuses them.
    deepest: f64,
}

impl NeighbourList {
    /// Makes room for all pairs within range that so many equal spheres can have.
    pub fn new(spheres: usize) -> Self {
        Self {
            pairs: Vec::with_capacity(MOST_NEIGHBOURS * spheres / 2),
            sorted: Vec::with_capacity(spheres),
            starts: Vec::new(),
            bins: Vec::with_capacity(spheres),
            found: Vec::with_capacity(MOST_NEIGHBOURS),
            kept: VerletList::new(spheres, MOST_NEIGHBOURS * spheres / 2),
            deepest: 0.0,
        }
    }

    /// Lets surfaces overlap by less than `deepest`, in a.
    pub(crate) fn allow_overlap(&mut self, deepest: f64) {
        self.deepest = deepest;
    }

    /// The pairs of the last [`NeighbourList::update`].
    pub fn pairs(&self) -> &[Neighbours] {
        &self.pairs
    }

    /// Finds all pairs with `2r/(a_i + a_j) < range`, and checks that none overlaps (soft ones: too deeply, or with one centre).
    ///
    /// In a periodic cell the range must not exceed [`crate::cell::LUBRICATION_RANGE`] and the cell must pass [`Cell::check_range`].
    ///
    /// # Errors
    /// [`Error::Overlap`] names the first pair whose surfaces touch.
    pub fn update(
        &mut self,
        cell: &Cell,
        centres: &[Vec2],
        radii: &[f64],
        range: f64,
    ) -> Result<(), Error> {
        if !self.find_by_kept_pairs(cell, centres, radii, range) {
            self.find(cell, centres, radii, range);
        }
        self.pairs.iter().try_for_each(|pair| self.admit(pair))
    }

    /// Checks that the pairs found last do not overlap at other positions either, to which the spheres moved by little.
    ///
    /// # Errors
    /// As [`NeighbourList::update`].
    pub(crate) fn check(&self, cell: &Cell, centres: &[Vec2], radii: &[f64]) -> Result<(), Error> {
        self.pairs.iter().try_for_each(|pair| {
            let both = [pair.i, pair.j];
            match Neighbours::within(f64::INFINITY, cell, centres, radii, both) {
                Some(moved) => self.admit(&moved),
                None => Ok(()),
            }
        })
    }

    /// The nearest of the pairs found last, at other positions, to which the spheres moved by little.
    pub(crate) fn closest_at(
        &self,
        cell: &Cell,
        centres: &[Vec2],
        radii: &[f64],
    ) -> Option<Neighbours> {
        let moved = self.pairs.iter().filter_map(|pair| {
            Neighbours::within(f64::INFINITY, cell, centres, radii, [pair.i, pair.j])
        });
        moved.min_by(|a, b| a.gap.total_cmp(&b.gap))
    }

    /// Refuses a pair that overlaps.
    fn admit(&self, pair: &Neighbours) -> Result<(), Error> {
        if pair.gap <= -self.deepest || pair.distance == 0.0 {
            Err(pair.overlap())
        } else {
            Ok(())
        }
    }

    /// [`NeighbourList::find`] by way of pairs kept from an earlier search; `false` if the cell is too small for a skin, or unbounded.
    fn find_by_kept_pairs(
        &mut self,
        cell: &Cell,
        centres: &[Vec2],
        radii: &[f64],
        range: f64,
    ) -> bool {
        let Cell::Periodic {
            length_x, length_y, ..
        } = *cell
        else {
            return false;
        };
        let longer = VerletList::longer(range);
        let largest = radii.iter().copied().fold(0.0, f64::max);
        if length_x.min(length_y) < 2.0 * longer * largest {
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
        let (kept, pairs) = (&self.kept, &mut self.pairs);
        pairs.clear();
        vectorised(
            #[inline(always)]
            || {
                for &pair in kept.pairs() {
                    pairs.extend(Neighbours::within(range, cell, centres, radii, pair));
                }
            },
        );
        true
    }

    /// [`NeighbourList::update`] without the check: gaps may be negative.
    pub(crate) fn find(&mut self, cell: &Cell, centres: &[Vec2], radii: &[f64], range: f64) {
        // Vectorised code rounds by one instruction where other code calls a function.
        vectorised(
            #[inline(always)]
            || self.find_inline(cell, centres, radii, range),
        );
    }

    /// [`NeighbourList::find`] for the caller's instruction set.
    #[inline(always)]
    fn find_inline(&mut self, cell: &Cell, centres: &[Vec2], radii: &[f64], range: f64) {
        self.pairs.clear();
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let (columns, rows, length_x, offset) = match *cell {
            Cell::Unbounded => (1, 1, f64::INFINITY, 0.0),
            Cell::Periodic {
                length_x,
                length_y,
                offset,
            } => {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "at least 1 and bounded by the clamp"
                )]
                let bins =
                    |side: f64| (side / (range * largest)).floor().clamp(1.0, 4096.0) as usize;
                (bins(length_x), bins(length_y), length_x, offset)
            }
        };
        self.fill_bins(cell, centres, columns, rows);
        let width = length_x / columns as f64;
        for i in 0..centres.len() {
            self.found.clear();
            let (column, row) = self.bins[i];
            // The rows of bins below, at and above this one; where there are fewer than three rows, each of them once.
            let row_count = rows.min(3);
            for k in 0..row_count {
                let other_row = if rows < 3 {
                    k
                } else {
                    (row + rows + k - 1) % rows
                };
                // Across the top or bottom of the cell the bins are shifted by the offset.
                let shift = if rows < 3 {
                    None
                } else if row + k == 0 {
                    Some(offset)
                } else if row + k == rows + 1 {
                    Some(-offset)
                } else {
                    Some(0.0)
                };
                let (first, span) = match shift {
                    Some(shift) if shift == 0.0 && columns > 3 => (column + columns - 1, 3),
                    Some(shift) if columns > 4 => {
                        let start = (column as f64 + shift / width).floor();
                        #[expect(
                            clippy::cast_possible_truncation,
                            clippy::cast_sign_loss,
                            reason = "rem_euclid makes it a bin number"
                        )]
                        let first = (start - 1.0).rem_euclid(columns as f64) as usize;
                        (first, 4)
                    }
                    _ => (0, columns),
                };
                for bin_column in first..first + span {
                    let bin = other_row * columns + bin_column % columns;
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
            self.found.sort_unstable_by_key(|pair| pair.j);
            self.pairs.extend_from_slice(&self.found);
        }
    }

    /// Sorts the spheres into bins, by counting.
    fn fill_bins(&mut self, cell: &Cell, centres: &[Vec2], columns: usize, rows: usize) {
        self.bins.clear();
        self.starts.clear();
        self.starts.resize(columns * rows + 1, 0);
        for &centre in centres {
            let bin = match *cell {
                Cell::Unbounded => (0, 0),
                Cell::Periodic {
                    length_x, length_y, ..
                } => {
                    let x = cell.wrap(centre);
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "wrapped into the cell; rounding at its edge is clamped"
                    )]
                    let index = |x: f64, side: f64, count: usize| {
                        ((x / side * count as f64) as usize).min(count - 1)
                    };
                    (index(x.x, length_x, columns), index(x.y, length_y, rows))
                }
            };
            self.bins.push(bin);
            self.starts[bin.1 * columns + bin.0 + 1] += 1;
        }
        for bin in 1..self.starts.len() {
            self.starts[bin] += self.starts[bin - 1];
        }
        self.sorted.clear();
        self.sorted.resize(centres.len(), 0);
        // Filling from the back leaves `starts` shifted by one bin if done in place, so walk the spheres
        // backwards and count each bin's end down to its start.
        for (i, &(column, row)) in self.bins.iter().enumerate().rev() {
            let end = &mut self.starts[row * columns + column + 1];
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cell::LUBRICATION_RANGE;
    use proptest::prelude::*;

    #[test]
    fn lists_kept_under_shear_find_what_new_ones_find() {
        // Points that drift, at random and with the flow, and are wrapped now and then.
        let (side, n) = (14.0, 40);
        let mut list = NeighbourList::new(n);
        let radii: Vec<f64> = (0..n).map(|i| if i % 3 == 0 { 1.4 } else { 1.0 }).collect();
        let mut centres: Vec<Vec2> = (0..n)
            .map(|i| Vec2::new((7 * i) as f64 % side, (3.3 * i as f64) % side))
            .collect();
        list.allow_overlap(f64::INFINITY);
        for step in 0..600 {
            let cell = Cell::periodic(side, side, 0.003 * f64::from(step) * side).unwrap();
            list.update(&cell, &centres, &radii, LUBRICATION_RANGE)
                .unwrap();
            let mut new = NeighbourList::default();
            new.find(&cell, &centres, &radii, LUBRICATION_RANGE);
            assert_eq!(list.pairs, new.pairs);
            for (i, x) in centres.iter_mut().enumerate() {
                let wave = (f64::from(step) * 0.01 + i as f64).sin();
                *x += Vec2::new(0.003 * x.y + 0.01 * wave, 0.02 * wave);
                if step % 4 == 3 {
                    *x = Cell::periodic(side, side, 0.003 * f64::from(step + 1) * side)
                        .unwrap()
                        .wrap(*x);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn cell_list_finds_what_brute_force_finds(
            seed in 0u64..1000, sides in (8.0..60.0f64, 8.0..60.0f64), offset in -30.0..30.0f64,
        ) {
            // Points, not spheres: gaps may be negative.
            let cell = Cell::periodic(sides.0, sides.1, offset).unwrap();
            let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
            let mut random = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 11) as f64 / (1u64 << 53) as f64
            };
            let n = 60;
            let centres: Vec<Vec2> = (0..n)
                .map(|_| Vec2::new(random() * 3.0 * sides.0 - sides.0, random() * 3.0 * sides.1 - sides.1))
                .collect();
            let radii = vec![1.0; n];
            let mut list = NeighbourList::default();
            list.find(&cell, &centres, &radii, LUBRICATION_RANGE);
            let mut expected = Vec::new();
            for i in 0..n {
                for j in i + 1..n {
                    if cell.nearest(centres[j] - centres[i]).0.norm() < 4.0 {
                        expected.push((i, j));
                    }
                }
            }
            let found: Vec<_> = list.pairs().iter().map(|p| (p.i, p.j)).collect();
            prop_assert_eq!(found, expected);
        }
    }
}
