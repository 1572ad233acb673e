//! The periodic mobility as an operator: `M x` in O(N log N), M never formed.
//!
//! The short-ranged part is a sum over near pairs, their blocks kept; the long-ranged part goes
//! through a grid (`grid`). Same kernels, same modes, same order of rows as [`super::FarField`],
//! but **without the uniform force mode**: a force common to all spheres moves none of them here,
//! where the dense matrix has an arbitrary constant.

use super::check;
use super::ewald::{CutOffs, cut_offs};
use super::planar_grid::Grid;
use super::real_space::RealSpace;
use crate::error::Error;
use crate::hydrodynamics::free_space::kernels::{self, FiniteSize};
use crate::hydrodynamics::free_space::planar::{self, RadialChain, self_mobility};
use crate::linalg::join::join;
use crate::linalg::simd::vectorised;
use crate::space::cell::{Cell, Lattice};
use crate::space::modes::Vec2;
use crate::space::neighbours::NeighbourList;
use std::f64::consts::PI;

/// A near pair: its spheres, and the 6 × 6 block of velocity modes of i from force modes of j, by
/// columns; modes are `(s1, s2, s3, F_x, F_y, T)`.
#[derive(Debug, Clone, Copy)]
struct NearPair {
    /// Sphere that moves.
    i: usize,
    /// Sphere with the force.
    j: usize,
    block: [[f64; 6]; 6],
}

/// The periodic mobility, planned for a cell, radii and a tolerance; applied at the positions last
/// given.
pub struct FarOperator {
    /// Radii, in a.
    radii: Vec<f64>,
    /// Finite-size coefficients of each sphere.
    sizes: Vec<FiniteSize>,
    /// Area of the cell that was planned for, in a².
    area: f64,
    equal: bool,
    /// Kernels of the short-ranged part.
    real: RealSpace,
    /// The long-ranged part.
    grid: Grid,
    list: NeighbourList,
    /// Cut-off of the short-ranged part, in a.
    reach: f64,
    /// Unit radii for the list of pairs, so that its range is a distance.
    units: Vec<f64>,
    pairs: Vec<NearPair>,
    /// Self mobility minus the grid's part of a sphere's own image: a diagonal, modes as in
    /// [`NearPair`].
    own: Vec<[f64; 6]>,
    /// Force modes of each sphere, for all current vectors.
    sources: Vec<[f64; 6]>,
    /// Velocity modes of each sphere, for all current vectors.
    results: Vec<[f64; 6]>,
    /// Contribution of the long-ranged part.
    waves: Vec<[f64; 6]>,
}

impl FarOperator {
    /// Makes the plan with the cheapest applications.
    ///
    /// # Arguments
    /// - `cell`: periodic; may differ in every call of [`FarOperator::update`], if its area stays
    ///   the same.
    /// - `radii`: one per sphere, in a.
    /// - `tolerance`: of M, relative to its largest entry, 1e-8 to 1e-3: the grid's window leaves a
    ///   few 1e-9.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for a radius or tolerance, or a cell without
    /// bounds.
    pub(crate) fn new(cell: &Cell, radii: &[f64], tolerance: f64) -> Result<Self, Error> {
        check_plan(radii, tolerance)?;
        let lattice = periodic(cell)?;
        let (n, area) = (radii.len() as f64, lattice.content());
        let longest = longest(lattice);
        let mut best = (f64::INFINITY, 0.0);
        for step in 0..80 {
            let alpha = 3.0 / longest * 1.05_f64.powi(step);
            let cut_offs = cut_offs(alpha, area, radii, tolerance);
            if cut_offs.distance > longest {
                continue;
            }
            // Measured nanoseconds for each near pair, and for each wave vector on its share of the
            // grid.
            let pairs = 0.5 * n * n * PI * cut_offs.distance.powi(2) / area;
            let points = 1.12 * 2.5 * area * (cut_offs.wave / PI).powi(2);
            let cost = 40.0 * pairs + 50.0 * points;
            if cost < best.0 {
                best = (cost, alpha);
            }
        }
        Self::with_splitting(cell, radii, tolerance, best.1)
    }

    /// As [`FarOperator::new`] with a given splitting parameter α, in 1/a: for tests of the sums.
    ///
    /// # Errors
    /// As [`FarOperator::new`]; also where the near part would reach beyond half a side.
    pub(crate) fn with_splitting(
        cell: &Cell,
        radii: &[f64],
        tolerance: f64,
        alpha: f64,
    ) -> Result<Self, Error> {
        check_plan(radii, tolerance)?;
        let lattice = periodic(cell)?;
        let longest = longest(lattice);
        if !(alpha * longest >= 1.0 && alpha.is_finite()) {
            return Err(narrow(longest));
        }
        let area = lattice.content();
        let CutOffs { distance, wave } = cut_offs(alpha, area, radii, tolerance);
        if distance > longest {
            return Err(narrow(longest));
        }
        let sizes: Vec<_> = radii.iter().map(|&a| FiniteSize::new(a)).collect();
        let equal = radii.iter().all(|a| a.to_bits() == radii[0].to_bits());
        let factors = equal.then(|| sizes[0].factors(&sizes[0]));
        let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
        let own = RadialChain::own_image(alpha).radial_functions();
        let own = [own.0, own.1]
            .map(|radial| planar::lanes(&radial, Vec2::zeros()).map(|v| v / (8.0 * PI)));
        let mut diagonal = vec![[0.0; 6]; radii.len()];
        for ((size, &radius), diagonal) in sizes.iter().zip(radii).zip(&mut diagonal) {
            let image = kernels::finite_size(&own[0], &own[1], &size.factors(size));
            let image = kernels::blocks(&image, &image);
            let single = self_mobility(radius);
            for k in 0..3 {
                diagonal[k] = single[3 + k] - image.strain_stresslet[k][k];
                diagonal[3 + k] = single[k] - image.velocity_force[k][k];
            }
        }
        Ok(Self {
            radii: radii.to_vec(),
            area,
            equal,
            real: RealSpace::new(alpha, distance, 1.99 * smallest, 0.1 * tolerance, factors),
            grid: Grid::new(lattice, &sizes, alpha, wave, tolerance),
            sources: Vec::with_capacity(2 * radii.len()),
            results: Vec::with_capacity(2 * radii.len()),
            waves: Vec::with_capacity(2 * radii.len()),
            sizes,
            list: NeighbourList::new(radii.len()),
            reach: distance,
            units: vec![1.0; radii.len()],
            pairs: Vec::new(),
            own: diagonal,
        })
    }

    /// Sets new positions. Allocates only when the number of near pairs exceeds its previous
    /// maximum.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of another area, or too narrow for the
    /// near part.
    pub(crate) fn update(&mut self, cell: &Cell, centres: &[Vec2]) -> Result<(), Error> {
        let n = self.radii.len();
        if centres.len() != n {
            return Err(Error::Length {
                field: "centres",
                found: centres.len(),
                expected: n,
            });
        }
        super::check_content(cell, Some(self.area))?;
        let lattice = periodic(cell)?;
        if self.reach > longest(lattice) {
            return Err(narrow(longest(lattice)));
        }
        self.grid.update(lattice, centres);
        self.real.update(lattice);
        self.list.find(cell, centres, &self.units, self.reach);
        let Self {
            pairs,
            list,
            real,
            sizes,
            equal,
            ..
        } = self;
        pairs.clear();
        vectorised(
            #[inline(always)]
            || {
                for pair in list.pairs() {
                    let (i, j) = (pair.i, pair.j);
                    let [point, laplacian] = real.single(-pair.normal * pair.distance);
                    let blocks = if *equal {
                        kernels::blocks(&point, &point)
                    } else {
                        let (a, b) = (&sizes[i], &sizes[j]);
                        let ij = kernels::finite_size(&point, &laplacian, &a.factors(b));
                        let ji = kernels::finite_size(&point, &laplacian, &b.factors(a));
                        kernels::blocks(&ij, &ji)
                    };
                    let mut block = [[0.0; 6]; 6];
                    for c in 0..3 {
                        for r in 0..3 {
                            block[c][r] = blocks.strain_stresslet[r][c];
                            block[c][3 + r] = blocks.velocity_stresslet[r][c];
                            block[3 + c][r] = blocks.strain_force[r][c];
                            block[3 + c][3 + r] = blocks.velocity_force[r][c];
                        }
                    }
                    pairs.push(NearPair { i, j, block });
                }
            },
        );
        Ok(())
    }

    /// `y ← M x`; both `[6N]`, stresslets or strains of all spheres first, then forces and torques
    /// or velocities; or several such vectors in sequence, for which the near pairs are read once.
    /// Two threads may share the work, with the same bits.
    ///
    /// # Accuracy
    /// The tolerance of the plan, relative to the largest entry of M; test
    /// `operator_is_the_dense_mobility`.
    pub(crate) fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        let n = self.radii.len();
        self.sources.clear();
        self.results.clear();
        for x in x.chunks_exact(6 * n) {
            let (strains, velocities) = x.split_at(3 * n);
            let rows = strains.chunks_exact(3).zip(velocities.chunks_exact(3));
            for ((s, f), own) in rows.zip(&self.own) {
                let source = [s[0], s[1], s[2], f[0], f[1], f[2]];
                self.sources.push(source);
                self.results
                    .push(std::array::from_fn(|k| own[k] * source[k]));
            }
        }
        let Self {
            grid,
            pairs,
            sources,
            results,
            waves,
            ..
        } = self;
        waves.clear();
        waves.resize(sources.len(), [0.0; 6]);
        join(
            true,
            || {
                vectorised(
                    #[inline(always)]
                    || add_pairs(n, pairs, sources, results),
                );
            },
            || {
                let vectors = sources.chunks_exact(n).zip(waves.chunks_exact_mut(n));
                for (sources, waves) in vectors {
                    grid.add(sources, waves);
                }
            },
        );
        for (result, wave) in results.iter_mut().zip(waves) {
            for (result, wave) in result.iter_mut().zip(wave) {
                *result += *wave;
            }
        }
        for (y, results) in y.chunks_exact_mut(6 * n).zip(self.results.chunks_exact(n)) {
            let (strains, velocities) = y.split_at_mut(3 * n);
            let rows = strains
                .chunks_exact_mut(3)
                .zip(velocities.chunks_exact_mut(3));
            for ((e, u), result) in rows.zip(results) {
                e.copy_from_slice(&result[..3]);
                u.copy_from_slice(&result[3..]);
            }
        }
    }
}

/// Adds the contribution of near pairs, for vectors of n spheres in sequence.
#[inline(always)]
fn add_pairs(n: usize, pairs: &[NearPair], sources: &[[f64; 6]], results: &mut [[f64; 6]]) {
    for NearPair { i, j, block } in pairs {
        for (sources, results) in sources.chunks_exact(n).zip(results.chunks_exact_mut(n)) {
            let (of_i, of_j) = (sources[*i], sources[*j]);
            let (mut to_i, mut to_j) = (results[*i], [0.0; 6]);
            for c in 0..6 {
                for r in 0..6 {
                    to_i[r] = block[c][r].mul_add(of_j[c], to_i[r]);
                }
                to_j[c] = (block[c][0] * of_i[0] + block[c][1] * of_i[1])
                    + (block[c][2] * of_i[2] + block[c][3] * of_i[3])
                    + (block[c][4] * of_i[4] + block[c][5] * of_i[5]);
            }
            results[*i] = to_i;
            for (result, value) in results[*j].iter_mut().zip(to_j) {
                *result += value;
            }
        }
    }
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

/// Maximum range of the near part: beyond half a side, or half the shortest lattice vector, a
/// sphere would have two images of one neighbour in range.
fn longest(lattice: &Lattice) -> f64 {
    0.998 * lattice.reach()
}

/// The error of a cell that is too narrow for the near part.
fn narrow(longest: f64) -> Error {
    Error::OutOfRange {
        field: "cell",
        value: longest,
        allowed: "wide enough for the near part of the mobility",
    }
}

/// The lattice of a periodic cell.
fn periodic(cell: &Cell) -> Result<&Lattice, Error> {
    cell.lattice().ok_or(Error::OutOfRange {
        field: "cell",
        value: f64::INFINITY,
        allowed: "periodic",
    })
}

#[cfg(test)]
mod tests;
