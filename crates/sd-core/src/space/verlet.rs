//! Verlet list (1967): pairs that may come within range before the spheres have moved far, kept
//! between searches.
//!
//! A search with a range extended by a skin is valid until a pair can have crossed the skin.
//! Displacements are relative to the deformation of the lattice since the search, which is that of
//! the flow:
//!
//! ```text
//! H = H₀ F,   w = x F⁻¹ − x₀:      d − d₀ = w_j − w_i + d (1 − F⁻¹)
//! valid while   2 max |w| + ‖1 − F⁻¹‖ r ≤ s r       for the shortest range r and the skin s r of any pair
//! ```
//! H₀ is, of all bases of the earlier lattice, the one closest to the present basis H: the offset
//! of a sheared cell is known up to whole sides, and another lattice may have been reduced since.

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
        let (Some(Cell::Periodic(before)), Cell::Periodic(now)) = (self.cell, cell) else {
            return false;
        };
        if self.range != range || self.radii != radii {
            return false;
        }
        let mut change = [S::Vector::default(); 3];
        for (change, a) in change.iter_mut().zip(now.reduced_vectors()) {
            *change = *a;
            let coordinates = before.coordinates(a);
            for (coordinate, &vector) in coordinates.into_iter().zip(before.reduced_vectors()) {
                *change -= vector * coordinate.round();
            }
        }
        let reciprocal = now.reciprocal();
        // x (1 − F⁻¹)
        let carried = |x: &S::Vector| {
            let mut carried = change[0] * S::dot(x, &reciprocal[0]);
            for k in 1..S::DIMENSIONS {
                carried += change[k] * S::dot(x, &reciprocal[k]);
            }
            carried
        };
        let mut strain = 0.0;
        for k in 0..S::DIMENSIONS {
            let mut axis = S::Vector::default();
            axis[k] = 1.0;
            strain += S::norm_squared(&carried(&axis));
        }
        let strain = strain.sqrt();
        if strain > SKIN {
            return false;
        }
        let mut square: f64 = 0.0;
        for (&x, &x0) in centres.iter().zip(&self.centres) {
            let moved = before.nearest(x - carried(&x) - x0).0;
            square = square.max(S::norm_squared(&moved));
        }
        let shortest = range * radii.iter().copied().fold(f64::INFINITY, f64::min);
        2.0 * square.sqrt() + strain * shortest <= SKIN * shortest
    }
}
