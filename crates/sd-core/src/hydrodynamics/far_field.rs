//! The far field: mobility of the force and dipole modes of all spheres, and its inverse, the
//! far-field resistance.
//!
//! Velocity modes of sphere i from force modes of sphere j are derivatives of one Green's function,
//! summed over all images in a doubly periodic layer, or without images in unbounded fluid:
//!
//! ```text
//! (U − u∞, Ω − Ω∞, −E∞) = M (F, T, S~),   R_far = M⁻¹,   M symmetric and positive definite
//! ```
//! The rows of the grand matrices here are ordered **strain first**: the 3N strain or stresslet
//! rows `(e1, e2, e3)` of sphere 0, of sphere 1, …, then the 3N velocity or force rows
//! `(U_x, U_y, Ω)` of sphere 0, …. So the block of the inverse that is needed explicitly, force
//! from velocity, is the trailing one.

mod ewald;
pub(crate) mod far_operator;
pub(crate) mod far_resistance;
pub(crate) mod far_space;
pub(crate) mod pressure;
mod real_space;
pub(crate) mod suspension;
mod wave_grid;
mod wave_space;

use crate::error::Error;
use crate::hydrodynamics::free_space::kernels::{self, FiniteSize, LANES};
use crate::hydrodynamics::free_space::planar;
use crate::linalg::cholesky::tiled::TiledMatrix;
use crate::linalg::whole;
use crate::space::Space;
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use ewald::{Ewald, Target, cut_offs};
pub use far_resistance::FarResistance;
use real_space::RealSpace;
use std::f64::consts::PI;
use wave_space::WaveSpace;

/// The grand mobility of a set of spheres, planned for a cell's area, radii and tolerance.
#[derive(Debug, Clone)]
pub struct FarField {
    /// Finite-size coefficients of each sphere.
    sizes: Vec<FiniteSize>,
    radii: Vec<f64>,
    /// The periodic sums; `None` in unbounded fluid.
    ewald: Option<Ewald>,
    /// Where the rows of each sphere are in M.
    rows: Vec<[usize; 2]>,
}

impl FarField {
    /// Default accuracy of the periodic sums, relative to the largest entry of M.
    pub const DEFAULT_TOLERANCE: f64 = 1e-8;

    /// Chooses the splitting of the sums that costs least.
    ///
    /// # Arguments
    /// - `cell`: may differ in every call of [`FarField::fill`], if its area stays the same.
    /// - `radii`: one per sphere, in a.
    /// - `tolerance`: of the periodic sums, relative to the largest entry of M, 1e-14 to 1e-3.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for a radius or tolerance.
    pub fn new(cell: &Cell, radii: &[f64], tolerance: f64) -> Result<Self, Error> {
        let mut best = (f64::INFINITY, 0.0);
        if let Some(area) = cell.content() {
            check(radii, tolerance)?;
            // Measured nanoseconds per pair for each image and for each wave vector.
            for step in 0..60 {
                let alpha = 0.6 / area.sqrt() * 1.06_f64.powi(step);
                let cut_offs = cut_offs(alpha, area, radii, tolerance);
                let images = PI * cut_offs.distance.powi(2) / area;
                let vectors = area * cut_offs.wave.powi(2) / (8.0 * PI);
                let cost = 16.0 * images + 1.5 * vectors;
                if cost < best.0 {
                    best = (cost, alpha);
                }
            }
        }
        Self::with_splitting(cell, radii, tolerance, best.1)
    }

    /// As [`FarField::new`] with a given splitting parameter α, in 1/a: for tests of the sums.
    ///
    /// # Errors
    /// As [`FarField::new`].
    pub fn with_splitting(
        cell: &Cell,
        radii: &[f64],
        tolerance: f64,
        alpha: f64,
    ) -> Result<Self, Error> {
        check(radii, tolerance)?;
        let sizes: Vec<_> = radii
            .iter()
            .map(|&radius| FiniteSize::new(radius))
            .collect();
        let ewald = match cell.content() {
            None => None,
            Some(area) => {
                let cut_offs = cut_offs(alpha, area, radii, tolerance);
                let equal = radii
                    .iter()
                    .all(|&radius| radius.to_bits() == radii[0].to_bits());
                let factors = equal.then(|| sizes[0].factors(&sizes[0]));
                let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
                let mean = radii.iter().sum::<f64>() / radii.len() as f64;
                Some(Ewald {
                    area,
                    alpha,
                    equal,
                    uniform: 0.5 / (mean * radii.len() as f64),
                    real: RealSpace::new(
                        alpha,
                        cut_offs.distance,
                        1.99 * smallest,
                        tolerance,
                        factors,
                    ),
                    wave: WaveSpace::new(alpha, cut_offs.wave, factors),
                    chunks: ewald::chunks(radii.len()),
                    sums: ewald::Sums::default(),
                })
            }
        };
        Ok(Self {
            sizes,
            radii: radii.to_vec(),
            ewald,
            rows: Vec::new(),
        })
    }

    /// Number of spheres.
    pub fn spheres(&self) -> usize {
        self.radii.len()
    }

    /// Whether the plan is for a periodic cell.
    pub fn is_periodic(&self) -> bool {
        self.ewald.is_some()
    }

    /// Splitting parameter α in use, in 1/a; `None` in unbounded fluid.
    pub fn splitting(&self) -> Option<f64> {
        self.ewald.as_ref().map(|ewald| ewald.alpha)
    }

    /// Fills the grand mobility `[6N × 6N]`, its lower triangle, in 1/(mu a), 1/(mu a²), 1/(mu a³).
    ///
    /// In a periodic cell the mobility of a uniform force, which is infinite, is replaced by a
    /// finite constant: use M only as [`FarResistance`] does. Allocates nothing after the first
    /// call.
    ///
    /// # Arguments
    /// - `cell`: of the area that was planned for.
    /// - `centres`: one per sphere, in a; any images.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of another area.
    pub fn fill(
        &mut self,
        cell: &Cell,
        centres: &[Vec2],
        mobility: &mut TiledMatrix,
    ) -> Result<(), Error> {
        let n = self.radii.len();
        if centres.len() != n {
            return Err(Error::Length {
                field: "centres",
                found: centres.len(),
                expected: n,
            });
        }
        self.check_cell(cell)?;
        let mut target = Target::new(mobility, &mut self.rows, n);
        match &mut self.ewald {
            None => {
                for j in 0..n {
                    target.write_self(j, &[0.0; LANES], self.radii[j]);
                    for i in j + 1..n {
                        let separation = centres[i] - centres[j];
                        let [ij, ji] =
                            planar::pair_lanes(separation, &self.sizes[i], &self.sizes[j]);
                        target.write_pair(i, j, &kernels::blocks(&ij, &ji));
                    }
                }
            }
            Some(ewald) => {
                let Cell::Periodic(lattice) = cell else {
                    return Ok(());
                };
                ewald.fill(&self.sizes, &self.radii, lattice, centres, &mut target);
            }
        }
        Ok(())
    }

    /// Computes only the real-space half of the sums in [`FarField::fill`], to measure its cost.
    /// Periodic cells only.
    pub fn real_space_sums(&mut self, cell: &Cell, centres: &[Vec2]) {
        if let (Some(ewald), Cell::Periodic(lattice)) = (&mut self.ewald, cell) {
            ewald.real_sums(lattice, centres);
        }
    }

    /// Computes only the wave-space half of the sums in [`FarField::fill`], to measure its cost.
    /// Periodic cells only.
    pub fn wave_space_sums(&mut self, cell: &Cell, centres: &[Vec2]) {
        if let (Some(ewald), Cell::Periodic(lattice)) = (&mut self.ewald, cell) {
            ewald.wave_sums(lattice, centres);
        }
    }

    fn check_cell(&self, cell: &Cell) -> Result<(), Error> {
        check_content(cell, self.ewald.as_ref().map(|ewald| ewald.area))
    }
}

/// Refuses a cell of another area or volume than planned, which is `None` in unbounded fluid. Flows
/// keep it to rounding.
fn check_content<S: Space>(cell: &Cell<S>, planned: Option<f64>) -> Result<(), Error> {
    let found = cell.content();
    let fits = match (found, planned) {
        (Some(found), Some(planned)) => (found / planned - 1.0).abs() < CONTENT_TOLERANCE,
        (found, planned) => found == planned,
    };
    if fits {
        return Ok(());
    }
    Err(Error::OutOfRange {
        field: if S::DIMENSIONS < 3 {
            "area of the cell"
        } else {
            "volume of the cell"
        },
        value: found.unwrap_or(f64::INFINITY),
        allowed: "the one that the far field was planned for",
    })
}

/// Splitting of the periodic sums.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Splitting {
    /// α, in 1/a.
    alpha: f64,
    /// Largest separation of the real sum, in a.
    distance: f64,
    /// Largest wave number, in 1/a.
    wave: f64,
}

/// Relative change of a cell's area or volume that a far field admits: that of rounding.
const CONTENT_TOLERANCE: f64 = 1e-6;

fn check(radii: &[f64], tolerance: f64) -> Result<(), Error> {
    if radii.is_empty() {
        return Err(Error::NoSpheres);
    }
    for &radius in radii {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::OutOfRange {
                field: "radii",
                value: radius,
                allowed: "positive and finite",
            });
        }
    }
    if !(1e-14..=1e-3).contains(&tolerance) {
        return Err(Error::OutOfRange {
            field: "tolerance",
            value: tolerance,
            allowed: "1e-14 to 1e-3",
        });
    }
    Ok(())
}

/// The largest wave number of wave vectors up to `cut_off` along a lattice vector of that length.
fn highest(length: f64, cut_off: f64) -> usize {
    whole((cut_off * length / (2.0 * PI)).floor())
}

#[cfg(test)]
mod tests;
