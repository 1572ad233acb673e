//! The mobility as an operator, M never formed: `M x` takes O(N log N) in a periodic cell, and in
//! unbounded fluid a sum over all pairs.
//!
//! In a cell the short-ranged part is a sum over near pairs, their blocks kept; the long-ranged
//! part goes through a grid (`wave_grid`). Kernels and modes are those of the dense mobility, but
//! **without the uniform force mode** of a periodic layer: a force common to all spheres moves none
//! of them here, where the dense matrix has an arbitrary constant.

use super::far_space::{
    FarSpace, NearPair, NearPairs, NearPart, SideBySide, components, near_pair,
};
use super::wave_grid::Grid;
use super::wave_grid::sampling::sampling;
use super::{check, check_content};
use crate::error::Error;
use crate::hydrodynamics::free_space::kernels::FiniteSize;
use crate::hydrodynamics::free_space::planar::RadialChain;
use crate::hydrodynamics::free_space::spatial::{couplings, finite_size, self_mobility};
use crate::hydrodynamics::part_of_pairs::list_starts;
use crate::linalg::simd::vectorised;
use crate::space::cell::{Cell, Lattice};
use crate::space::neighbours::NeighbourList;
use crate::space::{FixedArray, Space};
use crate::threads;
use std::f64::consts::PI;

/// Fewest pairs for which a thread computes blocks.
const LEAST_PAIRS: usize = 2000;

/// The mobility, planned for a cell's area or volume, radii and a tolerance; applied at the
/// positions last given.
pub(crate) struct FarOperator<S: FarSpace> {
    sizes: Vec<FiniteSize>,
    /// The sums over images; `None` in unbounded fluid.
    periodic: Option<Periodic<S>>,
    pairs: NearPairs<S>,
    /// Self mobility minus the grid's part of a sphere's own image: a diagonal.
    own: Vec<S::PerAnyMode<f64>>,
    work: SideBySide<S>,
}

/// The sums over all images.
struct Periodic<S: FarSpace> {
    /// Area or volume of the cell that was planned for, in a² or a³.
    content: f64,
    /// Range of the near pairs, in a.
    reach: f64,
    near: S::NearPart,
    grid: Grid<S>,
    list: NeighbourList<S>,
    /// Unit radii for the list of pairs, so that its range is a distance.
    units: Vec<f64>,
}

impl<S: FarSpace> FarOperator<S> {
    /// Makes the plan with the cheapest applications.
    ///
    /// # Arguments
    /// - `cell`: may differ in every call of [`FarOperator::update`], if its area or volume stays
    ///   the same.
    /// - `radii`: one per sphere, in a.
    /// - `tolerance`: of M, relative to its largest entry, 1e-8 to 1e-3: the grid's window leaves a
    ///   few 1e-9.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for a radius or tolerance.
    pub(crate) fn new(cell: &Cell<S>, radii: &[f64], tolerance: f64) -> Result<Self, Error> {
        check_plan(radii, tolerance)?;
        let Some(lattice) = cell.lattice() else {
            return Self::with_splitting(cell, radii, tolerance, 0.0);
        };
        let (n, content) = (radii.len() as f64, lattice.content());
        let mut best = (f64::INFINITY, 0.0);
        for step in 0..80 {
            let alpha = S::LEAST_SPLITTING / lattice.reach() * 1.05_f64.powi(step);
            let cut = S::splitting(alpha, content, radii, tolerance);
            if !S::COUNTS_IMAGES && !is_within_one_image(cut.distance, lattice) {
                continue;
            }
            let ball = match S::DIMENSIONS {
                2 => PI * cut.distance.powi(2),
                _ => 4.0 / 3.0 * PI * cut.distance.powi(3),
            };
            let pairs = 0.5 * n * n * ball / content;
            let grid = sampling::<S>(lattice, radii.len(), cut.wave, tolerance).1;
            let cost = S::PAIR_COST * pairs + grid;
            if cost < best.0 {
                best = (cost, alpha);
            }
        }
        Self::with_splitting(cell, radii, tolerance, best.1)
    }

    /// As [`FarOperator::new`] with a given splitting parameter α, in 1/a; 0 in unbounded fluid.
    ///
    /// # Errors
    /// As [`FarOperator::new`].
    pub(crate) fn with_splitting(
        cell: &Cell<S>,
        radii: &[f64],
        tolerance: f64,
        alpha: f64,
    ) -> Result<Self, Error> {
        check_plan(radii, tolerance)?;
        let sizes: Vec<_> = radii.iter().map(|&a| FiniteSize::new(a)).collect();
        let image = couplings(&RadialChain::own_image(alpha));
        let own = sizes.iter().zip(radii).map(|(size, &radius)| {
            let (alone, image) = (self_mobility(radius), finite_size(&image, size, size));
            let numbers = [
                alone.force_velocity[0] - image.force_velocity[0],
                alone.torque_rotation[0] - image.torque_rotation[0],
                alone.stress_strain[0] - image.stress_strain[0],
            ];
            S::restricted(&std::array::from_fn(|k| numbers[(k / 3).min(2)]))
        });
        let periodic = cell.lattice().map(|lattice| {
            let content = lattice.content();
            let splitting = S::splitting(alpha, content, radii, tolerance);
            Periodic {
                content,
                reach: splitting.distance,
                near: S::NearPart::new(splitting, radii, tolerance),
                grid: Grid::new(lattice, &sizes, splitting, tolerance),
                list: NeighbourList::new(radii.len()),
                units: vec![1.0; radii.len()],
            }
        });
        Ok(Self {
            periodic,
            pairs: NearPairs {
                list: Vec::new(),
                starts: vec![0; sizes.len() + 1],
            },
            own: own.collect(),
            work: SideBySide {
                vectors: vec![FixedArray::each([0.0; 2]); sizes.len()],
                products: vec![FixedArray::each([0.0; 2]); sizes.len()],
            },
            sizes,
        })
    }

    /// Whether no sphere has two images of another in range.
    #[cfg(test)]
    pub(super) fn is_within_one_image(&self, cell: &Cell<S>) -> bool {
        is_within_one_image(
            self.periodic.as_ref().unwrap().reach,
            cell.lattice().unwrap(),
        )
    }

    /// Sets new positions. Allocates only when the number of near pairs exceeds its previous
    /// maximum.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of another area or volume.
    pub(crate) fn update(&mut self, cell: &Cell<S>, centres: &[S::Vector]) -> Result<(), Error> {
        if centres.len() != self.sizes.len() {
            return Err(Error::Length {
                field: "centres",
                found: centres.len(),
                expected: self.sizes.len(),
            });
        }
        let planned = self.periodic.as_ref();
        check_content(cell, planned.map(|periodic| periodic.content))?;
        let (all, sizes) = (&mut self.pairs, &self.sizes);
        let (pairs, starts) = (&mut all.list, &mut all.starts);
        let n = centres.len();
        let list_starts =
            |pairs: &[NearPair<S>], starts| list_starts(n, pairs.iter().map(|pair| pair.0), starts);
        let (Some(periodic), Some(lattice)) = (&mut self.periodic, cell.lattice()) else {
            pairs.clear();
            for i in 0..centres.len() {
                pairs.extend((i + 1..centres.len()).map(|j| {
                    let x = centres[i] - centres[j];
                    (i, j, S::NearPart::unbounded(&x, &sizes[i], &sizes[j]))
                }));
            }
            list_starts(pairs, starts);
            return Ok(());
        };
        let Periodic {
            reach,
            near,
            grid,
            list,
            units,
            ..
        } = periodic;
        grid.update(lattice, centres);
        if is_within_one_image(*reach, lattice) {
            list.find(cell, centres, units, *reach);
            let found = list.pairs();
            pairs.truncate(found.len());
            if let Some(first) = found.first() {
                pairs.resize(found.len(), near_pair(near, sizes, first));
            }
            threads::divide(pairs, LEAST_PAIRS, &|first, pairs| {
                vectorised(
                    #[inline(always)]
                    || {
                        for (pair, found) in pairs.iter_mut().zip(&found[first..]) {
                            *pair = near_pair(near, sizes, found);
                        }
                    },
                );
            });
            list_starts(pairs, starts);
            return Ok(());
        }
        pairs.clear();
        vectorised(
            #[inline(always)]
            || {
                // In small or thin cells a sphere has several images of another, and of itself, in
                // range. Of its own images, each pair of opposite ones counts once.
                for i in 0..centres.len() {
                    for j in i..centres.len() {
                        let of_pair = lattice.images_within(centres[i] - centres[j], *reach);
                        for x in of_pair.filter(|x| i != j || is_first(&components::<S>(x))) {
                            pairs.push((i, j, near.block(&x, &sizes[i], &sizes[j])));
                        }
                    }
                }
            },
        );
        list_starts(pairs, starts);
        Ok(())
    }

    /// `y ← M x` for all modes sphere by sphere; or for several such vectors in sequence, for which
    /// the near pairs are read once.
    ///
    /// # Accuracy
    /// The tolerance of the plan, relative to the largest entry of M; tests
    /// `operator_is_the_dense_mobility` of layers and of suspensions.
    pub(crate) fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        let (n, x, y) = (self.sizes.len(), S::all_modes(x), S::all_modes_mut(y));
        let (pairs, own, work) = (&self.pairs, &self.own, &mut self.work);
        for (x, y) in x.chunks_exact(n).zip(y.chunks_exact_mut(n)) {
            for ((x, y), own) in x.iter().zip(y).zip(own) {
                for k in 0..S::ALL_MODES {
                    y[k] = x[k] * own[k];
                }
            }
        }
        S::NearPart::add_all(pairs, x, y, work);
        if let Some(periodic) = &mut self.periodic {
            for (x, y) in x.chunks_exact(n).zip(y.chunks_exact_mut(n)) {
                periodic.grid.add(x, y);
            }
        }
    }
}

/// Whether a range is less than half of every side, or half the shortest lattice vector, so that no
/// sphere has two images of another in range.
fn is_within_one_image<S: Space>(reach: f64, lattice: &Lattice<S>) -> bool {
    reach < 0.998 * lattice.reach()
}

/// Whether a vector is the first of itself and its opposite.
fn is_first(&[x, y, z]: &[f64; 3]) -> bool {
    (z, y, x) > (0.0, 0.0, 0.0)
}

/// Refuses radii out of range, and tolerances below the accuracy of the grid.
fn check_plan(radii: &[f64], tolerance: f64) -> Result<(), Error> {
    check(radii, tolerance)?;
    if tolerance < 1e-8 {
        return Err(Error::OutOfRange {
            field: "tolerance",
            value: tolerance,
            allowed: "1e-8 to 1e-3",
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
