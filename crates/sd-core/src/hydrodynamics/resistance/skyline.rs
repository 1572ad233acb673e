//! Ball-Melrose hydrodynamics with `R_FU` factored: spheres ordered along the gradient, where only near ones couple.

use super::{isolated, pair_terms};
use crate::hydrodynamics::two_sphere::PairTerm;
use crate::linalg::cholesky::skyline::SkylineCholesky;
use crate::linalg::error::BadPivot;
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use crate::space::pair::Neighbours;

/// `R_FU` in the order of the spheres' heights, then its factor.
pub(super) struct SkylineResistance {
    order: Order,
    /// `R_FU`, then its factor.
    factor: SkylineCholesky,
}

impl SkylineResistance {
    pub(super) fn new(spheres: usize) -> Self {
        Self {
            order: Order::new(spheres),
            factor: SkylineCholesky::new(3 * spheres),
        }
    }

    /// First row of a sphere in the factor.
    pub(super) fn row(&self, sphere: usize) -> usize {
        self.order.rows[sphere]
    }

    /// The spheres in the order of their rows.
    pub(super) fn spheres(&self) -> &[usize] {
        &self.order.spheres
    }

    /// `R_FU` of isolated spheres and the pair terms.
    pub(super) fn assemble(
        &mut self,
        cell: &Cell,
        centres: &[Vec2],
        radii: &[f64],
        pairs: &[Neighbours],
        terms: &[PairTerm],
    ) {
        self.order.update(cell, centres, pairs);
        let (order, n) = (&self.order, 3 * radii.len());
        let ends = (0..n).map(|row| order.ends[row / 3]);
        let matrix = self.factor.matrix_of_skyline(n, ends, order.tail);
        for (&row, &a) in order.rows.iter().zip(radii) {
            let drag = isolated::drag(a);
            for m in 0..3 {
                matrix[(row + m, row + m)] = drag[m];
            }
        }
        pair_terms::add_to_matrix(pairs, terms, |sphere| order.rows[sphere], matrix);
    }

    /// Adds `slope` n nᵀ of a pair's relative velocity.
    pub(super) fn add_spring(&mut self, pair: &Neighbours, slope: f64) {
        let rows = [pair.i, pair.j].map(|sphere| self.row(sphere));
        pair_terms::add_spring(pair, slope, rows, self.factor.filled_matrix());
    }

    pub(super) fn factor(&mut self) -> Result<(), BadPivot> {
        self.factor.factor()
    }

    pub(super) fn solver(&self) -> &SkylineCholesky {
        &self.factor
    }
}

/// An order of the spheres, and which of them couple in it.
#[derive(Debug, Default)]
struct Order {
    /// The spheres from the lowest to the highest.
    spheres: Vec<usize>,
    /// First row of each sphere: three times its place.
    rows: Vec<usize>,
    /// By place, the end of the rows it couples to before `tail`.
    ends: Vec<usize>,
    /// First row of the spheres that couple across the boundary of the cell to lower ones.
    tail: usize,
    /// Height of each sphere in the cell.
    heights: Vec<f64>,
}

impl Order {
    /// The order in which the spheres are numbered.
    fn new(spheres: usize) -> Self {
        Self {
            spheres: (0..spheres).collect(),
            rows: (0..spheres).map(|i| 3 * i).collect(),
            ends: vec![3 * spheres; spheres],
            tail: 3 * spheres,
            heights: Vec::with_capacity(spheres),
        }
    }

    /// Orders the spheres by their heights in the cell.
    fn update(&mut self, cell: &Cell, centres: &[Vec2], pairs: &[Neighbours]) {
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
            Cell::Periodic { sides, .. } => 0.5 * sides.y,
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
