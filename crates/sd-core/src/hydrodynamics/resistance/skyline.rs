//! Ball-Melrose hydrodynamics with `R_FU` factored: with spheres ordered along the gradient, only
//! near ones couple.

use super::fluid::Fluid;
use super::pair_terms;
use crate::linalg::cholesky::skyline::SkylineCholesky;
use crate::linalg::error::BadPivot;
use crate::space::Space;
use crate::space::cell::Cell;
use crate::space::pair::Neighbours;
use std::marker::PhantomData;

/// `R_FU` in the order of the spheres' heights, then its factor.
pub(super) struct SkylineResistance<S: Fluid> {
    order: Order<S>,
    /// `R_FU`, then its factor.
    factor: SkylineCholesky,
}

impl<S: Fluid> SkylineResistance<S> {
    pub(super) fn new(spheres: usize) -> Self {
        Self {
            order: Order::new(spheres),
            factor: SkylineCholesky::new(S::MODES * spheres),
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
        cell: &Cell<S>,
        centres: &[S::Vector],
        radii: &[f64],
        pairs: &[Neighbours<S>],
        terms: &[S::Term],
    ) {
        self.order.update(cell, centres, pairs);
        let (order, n) = (&self.order, S::MODES * radii.len());
        let ends = (0..n).map(|row| order.ends[row / S::MODES]);
        let matrix = self.factor.matrix_of_skyline(n, ends, order.tail);
        for (&row, &a) in order.rows.iter().zip(radii) {
            let drag = S::isolated(a).0;
            for m in 0..S::MODES {
                matrix[(row + m, row + m)] = drag[m];
            }
        }
        pair_terms::add_to_matrix(pairs, terms, |sphere| order.rows[sphere], matrix);
    }

    /// Adds `slope` n nᵀ of a pair's relative velocity.
    pub(super) fn add_spring(&mut self, pair: &Neighbours<S>, slope: f64) {
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
#[derive(Debug)]
struct Order<S> {
    /// The spheres from the lowest to the highest.
    spheres: Vec<usize>,
    /// First row of each sphere.
    rows: Vec<usize>,
    /// By position, the end of the rows it couples to before `tail`.
    ends: Vec<usize>,
    /// First row of the spheres that couple across the boundary of the cell to lower ones.
    tail: usize,
    /// Height of each sphere in the cell.
    heights: Vec<f64>,
    space: PhantomData<S>,
}

impl<S: Space> Order<S> {
    /// The order by sphere number.
    fn new(spheres: usize) -> Self {
        Self {
            spheres: (0..spheres).collect(),
            rows: (0..spheres).map(|i| S::MODES * i).collect(),
            ends: vec![S::MODES * spheres; spheres],
            tail: S::MODES * spheres,
            heights: Vec::with_capacity(spheres),
            space: PhantomData,
        }
    }

    /// Orders the spheres by their heights in the cell.
    fn update(&mut self, cell: &Cell<S>, centres: &[S::Vector], pairs: &[Neighbours<S>]) {
        let heights = &mut self.heights;
        heights.clear();
        heights.extend(centres.iter().map(|&x| cell.wrap(x)[1]));
        self.spheres
            .sort_unstable_by(|&i, &j| heights[i].total_cmp(&heights[j]).then(i.cmp(&j)));
        for (place, &sphere) in self.spheres.iter().enumerate() {
            self.rows[sphere] = S::MODES * place;
            self.ends[place] = S::MODES * (place + 1);
        }
        self.tail = S::MODES * centres.len();
        let half = cell
            .lattice()
            .map_or(f64::INFINITY, |lattice| 0.5 * lattice.lengths()[1]);
        for pair in pairs {
            let (i, j) = (self.rows[pair.i], self.rows[pair.j]);
            let (lower, upper) = (i.min(j), i.max(j));
            if (heights[pair.i] - heights[pair.j]).abs() > half {
                self.tail = self.tail.min(upper);
            } else {
                let end = &mut self.ends[lower / S::MODES];
                *end = upper.max(*end - S::MODES) + S::MODES;
            }
        }
    }
}
