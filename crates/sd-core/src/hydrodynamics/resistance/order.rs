//! The order of the spheres in the factor of `R_FU`: along the gradient, where only near ones couple.

use crate::geometry::cell::Cell;
use crate::geometry::modes::Vec2;
use crate::geometry::pair::Neighbours;

/// An order of the spheres, and what couples in it.
#[derive(Debug, Default)]
pub(super) struct Order {
    /// Sphere at each place.
    pub(super) spheres: Vec<usize>,
    /// First row of each sphere: three times its place.
    pub(super) rows: Vec<usize>,
    /// By place, the end of the rows it couples to before `tail`.
    pub(super) ends: Vec<usize>,
    /// First row of the spheres that couple across the boundary of the cell to lower ones.
    pub(super) tail: usize,
    /// Height of each sphere in the cell.
    heights: Vec<f64>,
}

impl Order {
    /// The spheres as they are numbered.
    pub(super) fn new(spheres: usize) -> Self {
        Self {
            spheres: (0..spheres).collect(),
            rows: (0..spheres).map(|i| 3 * i).collect(),
            ends: vec![3 * spheres; spheres],
            tail: 3 * spheres,
            heights: Vec::with_capacity(spheres),
        }
    }

    /// Orders by height in the cell.
    pub(super) fn update(&mut self, cell: &Cell, centres: &[Vec2], pairs: &[Neighbours]) {
        let heights = &mut self.heights;
        heights.clear();
        heights.extend(centres.iter().map(|&x| cell.wrap(x).y));
        self.spheres
            .sort_unstable_by(|&i, &j| heights[i].total_cmp(&heights[j]).then(i.cmp(&j)));
        for (place, &sphere) in self.spheres.iter().enumerate() {
            self.rows[sphere] = 3 * place;
            self.ends[place] = 3 * place + 3;
        }
        self.tail = 3 * centres.len();
        let half = match *cell {
            Cell::Unbounded => f64::INFINITY,
            Cell::Periodic { length_y, .. } => 0.5 * length_y,
        };
        for pair in pairs {
            let (i, j) = (self.rows[pair.i], self.rows[pair.j]);
            let (lower, upper) = (i.min(j), i.max(j));
            if (heights[pair.i] - heights[pair.j]).abs() > half {
                self.tail = self.tail.min(upper);
            } else {
                let end = &mut self.ends[lower / 3];
                *end = upper.max(*end - 3) + 3;
            }
        }
    }
}
