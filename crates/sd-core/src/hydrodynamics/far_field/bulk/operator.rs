//! The periodic mobility of a suspension as an operator: `M x` in O(N log N), M never formed.
//!
//! The short-ranged part is a sum over near pairs, their couplings kept; the long-ranged part goes through a grid.

use super::dense::Splitting;
use super::grid::Grid;
use super::kernels::{couplings, finite_size, self_mobility};
use crate::error::Error;
use crate::hydrodynamics::far_field::check;
use crate::hydrodynamics::far_field::kernels::FiniteSize;
use crate::hydrodynamics::far_field::unbounded::RadialChain;
use crate::hydrodynamics::two_sphere::{Coupling, Modes};
use crate::linalg::simd::vectorised;
use crate::space::Bulk;
use crate::space::cell::Cell;
use crate::space::neighbours::NeighbourList;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// The modes of sphere i from those of sphere j, n from j to i.
struct NearPair {
    i: usize,
    j: usize,
    n: Vector3<f64>,
    coupling: Coupling,
}

/// The periodic mobility, planned for a cell's sides, radii and tolerance; applied at the positions last given.
pub(crate) struct MobilityOperator {
    sizes: Vec<FiniteSize>,
    sides: Vector3<f64>,
    splitting: Splitting,
    grid: Grid,
    list: NeighbourList<Bulk>,
    /// Radii of one for all spheres, which the list is given so that its range is a distance.
    units: Vec<f64>,
    pairs: Vec<NearPair>,
    /// Self mobility less what the grid holds of a sphere's own image.
    own: Vec<Modes>,
}

impl MobilityOperator {
    /// Makes the plan whose applications cost least.
    ///
    /// # Arguments
    /// - `cell`: periodic; its offset may differ in every call of [`MobilityOperator::update`].
    /// - `radii`: one per sphere, in a.
    /// - `tolerance`: of M, relative to its largest entry, 1e-8 to 1e-3.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for a radius or tolerance, or a cell without bounds or too narrow.
    pub(crate) fn new(cell: &Cell<Bulk>, radii: &[f64], tolerance: f64) -> Result<Self, Error> {
        check(radii, tolerance)?;
        let narrow = |value| Error::OutOfRange {
            field: "cell",
            value,
            allowed: "periodic, and wide enough for the near part of the mobility",
        };
        let Cell::Periodic { sides, .. } = *cell else {
            return Err(narrow(f64::INFINITY));
        };
        let volume = sides.product();
        let longest = 0.499 * sides.min();
        let n = radii.len() as f64;
        let mut best: Option<(f64, Splitting)> = None;
        for step in 0..80 {
            let alpha = 2.0 / longest * 1.05_f64.powi(step);
            let splitting = Splitting::new(alpha, volume, radii, tolerance);
            if splitting.distance > longest {
                continue;
            }
            // Nanoseconds for each near pair and each grid point.
            let pairs = 2.0 / 3.0 * PI * n * n * splitting.distance.powi(3) / volume;
            let points = 4.0 * volume * (splitting.wave / PI).powi(3);
            let cost = 100.0 * pairs + 150.0 * points;
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, splitting));
            }
        }
        let (_, splitting) = best.ok_or_else(|| narrow(sides.min()))?;
        let sizes: Vec<_> = radii.iter().map(|&a| FiniteSize::new(a)).collect();
        let image = couplings(&RadialChain::own_image(splitting.alpha));
        let own = sizes
            .iter()
            .zip(radii)
            .map(|(size, &radius)| {
                let (alone, image) = (self_mobility(radius), finite_size(&image, size, size));
                let numbers = [
                    alone.force_velocity[0] - image.force_velocity[0],
                    alone.torque_rotation[0] - image.torque_rotation[0],
                    alone.stress_strain[0] - image.stress_strain[0],
                ];
                std::array::from_fn(|k| numbers[(k / 3).min(2)])
            })
            .collect();
        Ok(Self {
            grid: Grid::new(sides, &sizes, splitting.alpha, splitting.wave, tolerance),
            sizes,
            sides,
            splitting,
            list: NeighbourList::default(),
            units: vec![1.0; radii.len()],
            pairs: Vec::new(),
            own,
        })
    }

    /// Takes new positions.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of other sides.
    pub(crate) fn update(
        &mut self,
        cell: &Cell<Bulk>,
        centres: &[Vector3<f64>],
    ) -> Result<(), Error> {
        if centres.len() != self.sizes.len() {
            return Err(Error::Length {
                field: "centres",
                found: centres.len(),
                expected: self.sizes.len(),
            });
        }
        let offset = match *cell {
            Cell::Periodic { sides, offset } if sides == self.sides => offset,
            _ => {
                return Err(Error::OutOfRange {
                    field: "cell",
                    value: self.sides.x,
                    allowed: "of the sides the far field was planned for",
                });
            }
        };
        self.grid.update(offset, centres);
        self.list
            .find(cell, centres, &self.units, self.splitting.distance);
        let Self {
            list,
            pairs,
            sizes,
            splitting,
            ..
        } = self;
        pairs.clear();
        for pair in list.pairs() {
            let (i, j) = (pair.i, pair.j);
            let chain = RadialChain::screened(pair.distance * pair.distance, splitting.alpha);
            pairs.push(NearPair {
                i,
                j,
                n: -pair.normal,
                coupling: finite_size(&couplings(&chain), &sizes[i], &sizes[j]),
            });
        }
        Ok(())
    }

    /// `y ← M x`, modes of each sphere.
    ///
    /// # Accuracy
    /// The tolerance of the plan, relative to the largest entry of M; test `operator_is_the_dense_mobility`.
    pub(crate) fn apply(&mut self, x: &[Modes], y: &mut [Modes]) {
        for ((y, x), own) in y.iter_mut().zip(x).zip(&self.own) {
            *y = std::array::from_fn(|k| own[k] * x[k]);
        }
        let pairs = &self.pairs;
        vectorised(
            #[inline(always)]
            || {
                for NearPair { i, j, n, coupling } in pairs {
                    coupling.add(n, &x[*j], &mut y[*i]);
                    coupling.transposed().add(n, &x[*i], &mut y[*j]);
                }
            },
        );
        self.grid.add(x, y);
    }
}
