//! Verlet list (1967): pairs that may come within range before the spheres have moved far, kept
//! between searches.
//!
//! A search with a range extended by a skin is valid until a pair can have crossed the skin.
//! Displacements are relative to the shear given by the cell's offset:
//!
//! ```text
//! w = x − x₀ − Δγ y₀ x̂,  Δγ = Δoffset/sides[1]:      d − d₀ = w_j − w_i + Δγ d₀_y x̂
//! valid while   2 max |w| + |Δγ| (1 + s) r ≤ s r       for the shortest range r and the skin s r of any pair
//! ```
//! Under cross shear Δγ x̂ is the vector of both strains, along x and along z.

use super::Space;
use super::cell::Cell;
use super::pair::Neighbours;

/// Skin s, over the range.
const SKIN: f64 = 0.1;

/// Pairs within the extended range, and the positions of the search.
#[derive(Debug)]
pub(super) struct VerletList<S: Space> {
    /// The pairs, ordered by (i, j).
    pairs: Vec<[usize; 2]>,
    /// Centres at the search; empty before the first.
    centres: Vec<S::Vector>,
    radii: Vec<f64>,
    /// Range of the search, without skin.
    range: f64,
    cell: Option<Cell<S>>,
}

impl<S: Space> VerletList<S> {
    /// Allocates memory for that many spheres and pairs.
    pub(super) fn new(spheres: usize, pairs: usize) -> Self {
        Self {
            pairs: Vec::with_capacity(pairs),
            centres: Vec::with_capacity(spheres),
            radii: Vec::with_capacity(spheres),
            range: 0.0,
            cell: None,
        }
    }

    /// The range with its skin that a search for this list must have.
    pub(super) fn longer(range: f64) -> f64 {
        (1.0 + SKIN) * range
    }

    /// The pairs kept, ordered by (i, j).
    pub(super) fn pairs(&self) -> &[[usize; 2]] {
        &self.pairs
    }

    /// Stores the pairs of a search with the extended range.
    pub(super) fn keep(
        &mut self,
        found: &[Neighbours<S>],
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        range: f64,
    ) {
        self.pairs.clear();
        self.pairs.extend(found.iter().map(|pair| [pair.i, pair.j]));
        self.centres.clear();
        self.centres.extend_from_slice(centres);
        self.radii.clear();
        self.radii.extend_from_slice(radii);
        self.range = range;
        self.cell = Some(*cell);
    }

    /// Whether no pair can have crossed the skin since the search.
    #[inline(always)]
    pub(super) fn is_good(
        &self,
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        range: f64,
    ) -> bool {
        let (
            Some(Cell::Periodic {
                sides: old_sides,
                offset: old,
                cross_offset: old_cross,
            }),
            &Cell::Periodic {
                sides,
                offset,
                cross_offset,
            },
        ) = (self.cell, cell)
        else {
            return false;
        };
        if old_sides != sides || self.range != range || self.radii != radii {
            return false;
        }
        // Offsets are known up to whole cells.
        let strain_over =
            |moved: f64, side: f64| (moved - (moved / side).round() * side) / sides[1];
        let strain = strain_over(offset - old, sides[0]);
        let cross_strain = if S::DIMENSIONS > 2 {
            strain_over(cross_offset - old_cross, sides[2])
        } else {
            0.0
        };
        let mut square: f64 = 0.0;
        for (&x, &x0) in centres.iter().zip(&self.centres) {
            let mut affine = x0;
            affine[0] += strain * x0[1];
            if S::DIMENSIONS > 2 {
                affine[2] += cross_strain * x0[1];
            }
            square = square.max(S::norm_squared(&cell.nearest(x - affine).0));
        }
        let shortest = range * radii.iter().copied().fold(f64::INFINITY, f64::min);
        let strain = strain.hypot(cross_strain);
        2.0 * square.sqrt() + strain * (1.0 + SKIN) * shortest <= SKIN * shortest
    }
}
