//! Pairs that may come within range before the spheres have moved far, kept from one search to the next (Verlet 1967).
//!
//! A search with a range longer by a skin is good until a pair can have crossed the skin. Displacements count beyond those of the
//! shear that the cell's offset tells:
//!
//! ```text
//! w = x − x₀ − Δγ y₀ x̂,  Δγ = Δoffset/length_y:      d − d₀ = w_j − w_i + Δγ d₀_y x̂
//! good while   2 max |w| + |Δγ| (1 + s) r ≤ s r       for the shortest range r and the skin s r of any pair
//! ```

use super::{Cell, NeighbourList, neighbours};
use crate::geometry::modes::Vec2;
use crate::linalg::simd::vectorised;

/// Skin s, over the range.
const SKIN: f64 = 0.1;

/// Pairs within the longer range, and when they were.
#[derive(Debug, Default)]
pub(super) struct NearPairs {
    /// The pairs, ordered by (i, j).
    pairs: Vec<[usize; 2]>,
    /// Centres at the search; none if there was none.
    centres: Vec<Vec2>,
    /// Radii at the search.
    radii: Vec<f64>,
    /// Range asked for at the search, without skin.
    range: f64,
    /// Cell at the search.
    cell: Option<Cell>,
}

impl NearPairs {
    /// Room for the pairs of so many spheres.
    pub(super) fn new(spheres: usize) -> Self {
        Self {
            pairs: Vec::with_capacity(super::MOST_NEIGHBOURS * spheres / 2),
            centres: Vec::with_capacity(spheres),
            radii: Vec::with_capacity(spheres),
            ..Self::default()
        }
    }

    /// Whether no pair can have crossed the skin since the search.
    #[inline(always)]
    fn is_good(&self, cell: &Cell, centres: &[Vec2], radii: &[f64], range: f64) -> bool {
        let (
            Some(Cell::Periodic {
                length_x: old_x,
                length_y: old_y,
                offset: old,
            }),
            &Cell::Periodic {
                length_x,
                length_y,
                offset,
            },
        ) = (self.cell, cell)
        else {
            return false;
        };
        if [old_x, old_y, self.range] != [length_x, length_y, range] || self.radii != radii {
            return false;
        }
        // Offsets are known up to whole cells.
        let moved = offset - old;
        let strain = (moved - (moved / length_x).round() * length_x) / length_y;
        let mut square: f64 = 0.0;
        for (x, x0) in centres.iter().zip(&self.centres) {
            let affine = Vec2::new(x0.x + strain * x0.y, x0.y);
            square = square.max(cell.nearest(x - affine).0.norm_squared());
        }
        let shortest = range * radii.iter().copied().fold(f64::INFINITY, f64::min);
        2.0 * square.sqrt() + strain.abs() * (1.0 + SKIN) * shortest <= SKIN * shortest
    }
}

impl NeighbourList {
    /// [`NeighbourList::find`] by way of pairs kept from an earlier search; `false` if the cell is too small for a skin, or unbounded.
    pub(super) fn find_near(
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
        let longer = (1.0 + SKIN) * range;
        let largest = radii.iter().copied().fold(0.0, f64::max);
        if length_x.min(length_y) < 2.0 * longer * largest {
            return false;
        }
        let good = vectorised(
            #[inline(always)]
            || self.near.is_good(cell, centres, radii, range),
        );
        if !good {
            self.find(cell, centres, radii, longer);
            let near = &mut self.near;
            near.pairs.clear();
            near.pairs
                .extend(self.pairs.iter().map(|pair| [pair.i, pair.j]));
            near.centres.clear();
            near.centres.extend_from_slice(centres);
            near.radii.clear();
            near.radii.extend_from_slice(radii);
            near.range = range;
            near.cell = Some(*cell);
        }
        let (near, pairs) = (&self.near.pairs, &mut self.pairs);
        pairs.clear();
        vectorised(
            #[inline(always)]
            || {
                for &pair in near {
                    pairs.extend(neighbours(cell, centres, radii, range, pair));
                }
            },
        );
        true
    }
}
