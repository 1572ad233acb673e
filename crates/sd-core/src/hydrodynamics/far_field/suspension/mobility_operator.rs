//! The periodic mobility of a suspension as an operator: `M x` in O(N log N), M never formed.
//!
//! The short-ranged part is a sum over near pairs, their couplings kept; the long-ranged part goes
//! through a grid.

use super::bulk_grid::Grid;
use super::dense_mobility::{Splitting, images};
use crate::error::Error;
use crate::hydrodynamics::far_field::{check, check_content};
use crate::hydrodynamics::free_space::coupling::{Coupling, Modes};
use crate::hydrodynamics::free_space::kernels::FiniteSize;
use crate::hydrodynamics::free_space::planar::RadialChain;
use crate::hydrodynamics::free_space::spatial::{couplings, finite_size, self_mobility};
use crate::linalg::simd::vectorised;
use crate::space::Bulk;
use crate::space::cell::{Cell, Lattice};
use crate::space::neighbours::NeighbourList;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Measured nanoseconds of a near pair and of a grid point in an application.
const PAIR_COST: f64 = 140.0;
const POINT_COST: f64 = 120.0;

/// The modes of sphere i from those of sphere j, n from j to i.
struct NearPair {
    i: usize,
    j: usize,
    n: Vector3<f64>,
    coupling: Coupling,
}

/// The periodic mobility, planned for a cell's volume, radii and tolerance; applied at the
/// positions last given.
pub(crate) struct MobilityOperator {
    sizes: Vec<FiniteSize>,
    /// Volume of the cell that was planned for, in a³.
    volume: f64,
    splitting: Splitting,
    grid: Grid,
    list: NeighbourList<Bulk>,
    /// Unit radii for the list of pairs, so that its range is a distance.
    units: Vec<f64>,
    pairs: Vec<NearPair>,
    /// Self mobility minus the grid's part of a sphere's own image.
    own: Vec<Modes>,
}

impl MobilityOperator {
    /// Makes the plan with the cheapest applications.
    ///
    /// # Arguments
    /// - `cell`: periodic; may differ in every call of [`MobilityOperator::update`], if its volume
    ///   stays the same.
    /// - `radii`: one per sphere, in a.
    /// - `tolerance`: of M, relative to its largest entry, 1e-8 to 1e-3.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for a radius or tolerance, or a cell without
    /// bounds.
    pub(crate) fn new(cell: &Cell<Bulk>, radii: &[f64], tolerance: f64) -> Result<Self, Error> {
        check(radii, tolerance)?;
        let mut best = (f64::INFINITY, 0.0);
        if let Some(volume) = cell.content() {
            let n = radii.len() as f64;
            for step in 0..80 {
                let alpha = volume.cbrt().recip() * 1.05_f64.powi(step);
                let cut = Splitting::new(alpha, volume, radii, tolerance);
                let pairs = 2.0 / 3.0 * PI * n * n * cut.distance.powi(3) / volume;
                let points = 4.0 * volume * (cut.wave / PI).powi(3);
                let cost = PAIR_COST * pairs + POINT_COST * points;
                if cost < best.0 {
                    best = (cost, alpha);
                }
            }
        }
        Self::with_splitting(cell, radii, tolerance, best.1)
    }

    /// As [`MobilityOperator::new`] with a given splitting parameter α, in 1/a.
    ///
    /// # Errors
    /// As [`MobilityOperator::new`].
    pub(super) fn with_splitting(
        cell: &Cell<Bulk>,
        radii: &[f64],
        tolerance: f64,
        alpha: f64,
    ) -> Result<Self, Error> {
        check(radii, tolerance)?;
        let lattice = periodic(cell)?;
        let volume = lattice.content();
        let splitting = Splitting::new(alpha, volume, radii, tolerance);
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
            grid: Grid::new(lattice, &sizes, splitting.alpha, splitting.wave, tolerance),
            sizes,
            volume,
            splitting,
            list: NeighbourList::default(),
            units: vec![1.0; radii.len()],
            pairs: Vec::new(),
            own,
        })
    }

    /// Whether the range of near pairs is less than half of every side, or half the shortest
    /// lattice vector, so that no sphere has two images of another in range.
    pub(super) fn reaches_one_image(&self, lattice: &Lattice<Bulk>) -> bool {
        self.splitting.distance < 0.998 * lattice.reach()
    }

    /// Sets new positions.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of another volume.
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
        check_content(cell, Some(self.volume))?;
        let lattice = periodic(cell)?;
        self.grid.update(lattice, centres);
        self.pairs.clear();
        if self.reaches_one_image(lattice) {
            self.list
                .find(cell, centres, &self.units, self.splitting.distance);
            for k in 0..self.list.pairs().len() {
                let pair = &self.list.pairs()[k];
                let (i, j, x) = (pair.i, pair.j, pair.normal * -pair.distance);
                self.add_pair(i, j, &x);
            }
            return Ok(());
        }
        // In small or thin cells a sphere has several images of another, and of itself, in range.
        let reach = self.splitting.distance;
        for i in 0..centres.len() {
            for j in i..centres.len() {
                let separation = centres[i] - centres[j];
                for x in images(separation, lattice, reach) {
                    // Of the images of a sphere itself, each pair of opposite ones once.
                    if i != j || (x.z, x.y, x.x) > (0.0, 0.0, 0.0) {
                        self.add_pair(i, j, &x);
                    }
                }
            }
        }
        Ok(())
    }

    /// Adds the near part of spheres at the separation x from j to i.
    fn add_pair(&mut self, i: usize, j: usize, x: &Vector3<f64>) {
        let chain = RadialChain::screened(x.norm_squared(), self.splitting.alpha);
        self.pairs.push(NearPair {
            i,
            j,
            n: x.normalize(),
            coupling: finite_size(&couplings(&chain), &self.sizes[i], &self.sizes[j]),
        });
    }

    /// `y ← M x`, modes of each sphere.
    ///
    /// # Accuracy
    /// The tolerance of the plan, relative to the largest entry of M; test
    /// `operator_is_the_dense_mobility`.
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

/// The lattice of a periodic cell.
fn periodic(cell: &Cell<Bulk>) -> Result<&Lattice<Bulk>, Error> {
    cell.lattice().ok_or(Error::OutOfRange {
        field: "cell",
        value: f64::INFINITY,
        allowed: "periodic",
    })
}
