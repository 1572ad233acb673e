//! The far field: mobility of the force and dipole modes of all spheres, and its inverse, the far-field resistance.
//!
//! Velocity modes of sphere i from force modes of sphere j are derivatives of one Green's function, summed over all
//! images in a doubly periodic layer, or without images in unbounded fluid:
//!
//! ```text
//! (U − u∞, Ω − Ω∞, −E∞) = M (F, T, S~),   R_far = M⁻¹,   M symmetric and positive definite
//! ```
//! The rows of the grand matrices here are ordered **strain first**: the 3N strain or stresslet rows
//! `(e1, e2, e3)` of sphere 0, of sphere 1, …, then the 3N velocity or force rows `(U_x, U_y, Ω)` of sphere 0, ….
//! So the block of the inverse that is needed explicitly, force from velocity, is the trailing one.

pub(crate) mod kernels;
mod real_space;
pub mod resistance;
pub mod unbounded;
mod wave_space;

use crate::cell::Cell;
use crate::error::Error;
use crate::linalg::dense::Matrix;
use crate::linalg::simd::vectorised;
use crate::modes::Vec2;
use kernels::{Blocks, FiniteSize, LANES, Lanes};
use real_space::RealSpace;
pub use resistance::FarResistance;
use std::f64::consts::PI;
use unbounded::{RadialChain, self_mobility};
use wave_space::{EVEN, ODD, WaveSpace};

/// Default accuracy of the periodic sums, relative to the largest entry of M.
pub const DEFAULT_TOLERANCE: f64 = 1e-8;

/// Pairs handled at once, unless one column of the matrix has more.
const CHUNK: usize = 256;

/// The grand mobility of a set of spheres, planned for a cell's sides, radii and tolerance.
#[derive(Debug, Clone)]
pub struct FarField {
    /// Finite-size coefficients of each sphere.
    sizes: Vec<FiniteSize>,
    /// Radii, in a.
    radii: Vec<f64>,
    /// The periodic sums; `None` in unbounded fluid.
    ewald: Option<Ewald>,
}

/// The two halves of the periodic sum.
#[derive(Debug, Clone)]
struct Ewald {
    /// Sides of the cell it was planned for, in a.
    sides: [f64; 2],
    /// Splitting parameter α, in 1/a.
    alpha: f64,
    /// Whether all radii are equal.
    equal: bool,
    /// Added to the uniform force mode, whose true mobility is infinite, in 1/(mu a).
    uniform: f64,
    /// Short-ranged part.
    real: RealSpace,
    /// Long-ranged part.
    wave: WaveSpace,
    /// Real-space sums of the pairs at hand.
    sums: Vec<Lanes>,
}

/// Cut-offs that reach the tolerance at one splitting parameter.
#[derive(Debug, Clone, Copy)]
struct CutOffs {
    /// Of the separation, in a.
    distance: f64,
    /// Of the wave vector, in 1/a.
    wave: f64,
}

impl FarField {
    /// Plans the sums for least cost.
    ///
    /// # Arguments
    /// - `cell`: sides in a; the offset may differ in every call of [`FarField::fill`].
    /// - `radii`: one per sphere, in a.
    /// - `tolerance`: of the periodic sums, relative to the largest entry of M, 1e-14 to 1e-3.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for a radius or tolerance.
    pub fn new(cell: &Cell, radii: &[f64], tolerance: f64) -> Result<Self, Error> {
        let mut best = (f64::INFINITY, 0.0);
        if let Some(area) = cell.area() {
            check(radii, tolerance)?;
            // Nanoseconds per pair: each image, each wave vector.
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
        let ewald = match *cell {
            Cell::Unbounded => None,
            Cell::Periodic {
                length_x, length_y, ..
            } => {
                let area = length_x * length_y;
                let cut_offs = cut_offs(alpha, area, radii, tolerance);
                let equal = radii
                    .iter()
                    .all(|&radius| radius.to_bits() == radii[0].to_bits());
                let factors = equal.then(|| sizes[0].factors(&sizes[0]));
                let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
                let mean = radii.iter().sum::<f64>() / radii.len() as f64;
                Some(Ewald {
                    sides: [length_x, length_y],
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
                    sums: Vec::new(),
                })
            }
        };
        Ok(Self {
            sizes,
            radii: radii.to_vec(),
            ewald,
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

    /// Fills the lower triangle of the grand mobility `[6N × 6N]`, in 1/(mu a), 1/(mu a²), 1/(mu a³).
    ///
    /// In a periodic cell the mobility of a uniform force, which is infinite, is replaced by a finite constant: use M
    /// only as [`FarResistance`] does. Allocates nothing after the first call.
    ///
    /// # Arguments
    /// - `cell`: any offset; the sides of the plan.
    /// - `centres`: one per sphere, in a; any images.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of other sides.
    pub fn fill(
        &mut self,
        cell: &Cell,
        centres: &[Vec2],
        mobility: &mut Matrix,
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
        mobility.reshape(6 * n, 6 * n);
        match &mut self.ewald {
            None => {
                for j in 0..n {
                    write_self(mobility, j, &[0.0; LANES], self.radii[j]);
                    for i in j + 1..n {
                        let separation = centres[i] - centres[j];
                        let [ij, ji] =
                            unbounded::pair_lanes(separation, &self.sizes[i], &self.sizes[j]);
                        write_pair(mobility.values_mut(), n, i, j, &kernels::blocks(&ij, &ji));
                    }
                }
            }
            Some(ewald) => ewald.fill(&self.sizes, &self.radii, cell, centres, mobility),
        }
        Ok(())
    }

    /// Refuses a cell other than the planned one.
    fn check_cell(&self, cell: &Cell) -> Result<(), Error> {
        let found = match *cell {
            Cell::Unbounded => [f64::INFINITY; 2],
            Cell::Periodic {
                length_x, length_y, ..
            } => [length_x, length_y],
        };
        let planned = self
            .ewald
            .as_ref()
            .map_or([f64::INFINITY; 2], |ewald| ewald.sides);
        for (k, field) in ["cell[0]", "cell[1]"].into_iter().enumerate() {
            if found[k].to_bits() != planned[k].to_bits() {
                return Err(Error::OutOfRange {
                    field,
                    value: found[k],
                    allowed: "the side the far field was planned for",
                });
            }
        }
        Ok(())
    }
}

/// Refuses radii and tolerances out of range.
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

/// The smallest cut-offs whose remainders stay below the tolerance.
///
/// The remainder in real space is that of the images in the ring where the summand falls by e, taken as random; in
/// wave space, where a sphere's own term adds up coherently, that of the ring in full.
fn cut_offs(alpha: f64, area: f64, radii: &[f64], tolerance: f64) -> CutOffs {
    let largest = radii.iter().copied().fold(0.0, f64::max);
    let size = FiniteSize::new(largest);
    let factors = size.factors(&size);
    let limit = 0.5 * tolerance * self_mobility(largest)[0];
    let magnitude = |lanes: [Lanes; 2]| {
        kernels::finite_size(&lanes[0].map(f64::abs), &lanes[1].map(f64::abs), &factors)
            .into_iter()
            .fold(0.0, f64::max)
    };
    let ring = (PI * radii.len() as f64 / (area * alpha * alpha))
        .sqrt()
        .max(1.0);
    let mut distance = 1.0 / alpha;
    loop {
        let x = Vec2::new(distance, 0.0);
        let (point, laplacian) =
            RadialChain::screened(distance * distance, alpha).radial_functions();
        let lanes = [unbounded::lanes(&point, x), unbounded::lanes(&laplacian, x)];
        if ring * magnitude(lanes) / (8.0 * PI) < limit {
            break;
        }
        distance += 0.02 / alpha;
    }
    let mut wave = 2.0 * alpha;
    while alpha * alpha / PI * magnitude(wave_space::weights(Vec2::new(wave, 0.0), alpha)) > limit {
        wave += 0.04 * alpha;
    }
    CutOffs { distance, wave }
}

impl Ewald {
    /// The periodic mobility.
    fn fill(
        &mut self,
        sizes: &[FiniteSize],
        radii: &[f64],
        cell: &Cell,
        centres: &[Vec2],
        mobility: &mut Matrix,
    ) {
        let n = radii.len();
        let real_self = self.real.update(cell);
        let wave_self = self.wave.update(cell, centres);
        self.fill_diagonal(sizes, radii, &real_self, &wave_self, mobility);
        let mut start = 0;
        while start + 1 < n {
            let mut end = start;
            let mut pairs = 0;
            while end + 1 < n && (pairs == 0 || pairs + n - 1 - end <= CHUNK) {
                pairs += n - 1 - end;
                end += 1;
            }
            self.fill_columns(sizes, centres, start..end, pairs, mobility);
            start = end;
        }
    }

    /// The blocks of each sphere with itself.
    fn fill_diagonal(
        &self,
        sizes: &[FiniteSize],
        radii: &[f64],
        real: &[Lanes; 2],
        wave: &[Lanes; 2],
        mobility: &mut Matrix,
    ) {
        let (point, laplacian) = RadialChain::own_image(self.alpha).radial_functions();
        let own = [point, laplacian]
            .map(|radial| unbounded::lanes(&radial, Vec2::zeros()).map(|v| v / (8.0 * PI)));
        for (i, size) in sizes.iter().enumerate() {
            let factors = size.factors(size);
            let own = kernels::finite_size(&own[0], &own[1], &factors);
            let mut sum = [0.0; LANES];
            let parts: [Lanes; 2] = std::array::from_fn(|layer| {
                std::array::from_fn(|q| real[layer][q] + wave[layer][q])
            });
            let image = if self.equal {
                parts[0]
            } else {
                kernels::finite_size(&parts[0], &parts[1], &factors)
            };
            for q in 0..LANES {
                sum[q] = image[q] - own[q];
            }
            sum[16] += self.uniform;
            write_self(mobility, i, &sum, radii[i]);
        }
    }

    /// The blocks of all pairs (i, j), i > j, with j in a range.
    fn fill_columns(
        &mut self,
        sizes: &[FiniteSize],
        centres: &[Vec2],
        range: std::ops::Range<usize>,
        pairs: usize,
        mobility: &mut Matrix,
    ) {
        let n = centres.len();
        let layers = if self.equal { 1 } else { 2 };
        self.wave.columns(range.clone());
        self.sums.resize(pairs * layers, [0.0; LANES]);
        let Self {
            real,
            wave,
            sums,
            uniform,
            ..
        } = self;
        // Streams of the even lanes, then of the odd, per layer; the second layer is empty for equal radii.
        let even: [[&[f64]; 12]; 2] = std::array::from_fn(|layer| {
            std::array::from_fn(|k| {
                if layer < layers {
                    wave.even_sums.column(12 * layer + k)
                } else {
                    &[]
                }
            })
        });
        let odd: [[&[f64]; 8]; 2] = std::array::from_fn(|layer| {
            std::array::from_fn(|k| {
                if layer < layers {
                    wave.odd_sums.column(8 * layer + k)
                } else {
                    &[]
                }
            })
        });
        let uniform = *uniform;
        vectorised(
            #[inline(always)]
            || {
                let mut start = 0;
                for j in range.clone() {
                    let end = start + n - 1 - j;
                    real.column(centres, j, &mut sums[start * layers..end * layers]);
                    start = end;
                }
            },
        );
        vectorised(
            #[inline(always)]
            || {
                let values = mobility.values_mut();
                let mut start = 0;
                for j in range {
                    let end = start + n - 1 - j;
                    let even =
                        even.map(|layer| layer.map(|stream| stream.get(start..end).unwrap_or(&[])));
                    let odd =
                        odd.map(|layer| layer.map(|stream| stream.get(start..end).unwrap_or(&[])));
                    let sums = &sums[start * layers..end * layers];
                    for i in j + 1..n {
                        let pair = i - j - 1;
                        let mut point = add_waves(&sums[pair * layers], &even[0], &odd[0], pair);
                        point[16] += uniform;
                        if layers == 1 {
                            write_pair(values, n, i, j, &kernels::blocks(&point, &point));
                        } else {
                            let laplacian =
                                add_waves(&sums[pair * layers + 1], &even[1], &odd[1], pair);
                            let (i_size, j_size) = (&sizes[i], &sizes[j]);
                            let ij =
                                kernels::finite_size(&point, &laplacian, &i_size.factors(j_size));
                            let ji =
                                kernels::finite_size(&point, &laplacian, &j_size.factors(i_size));
                            write_pair(values, n, i, j, &kernels::blocks(&ij, &ji));
                        }
                    }
                    start = end;
                }
            },
        );
    }
}

/// Lanes of one pair: its real-space sum, and its entry in each stream of wave-space sums.
#[expect(
    clippy::inline_always,
    reason = "must be compiled for the caller's instruction set"
)]
#[inline(always)]
fn add_waves(sum: &Lanes, even: &[&[f64]; 12], odd: &[&[f64]; 8], pair: usize) -> Lanes {
    let mut lanes = *sum;
    for (stream, lane) in even.iter().zip(EVEN) {
        lanes[lane] += stream[pair];
    }
    for (stream, lane) in odd.iter().zip(ODD) {
        lanes[lane] += stream[pair];
    }
    lanes
}

/// Writes the blocks of pair (i, j), i > j, into the lower triangle.
#[expect(
    clippy::inline_always,
    reason = "must be compiled for the caller's instruction set"
)]
#[inline(always)]
fn write_pair(values: &mut [f64], n: usize, i: usize, j: usize, blocks: &Blocks) {
    let rows = 6 * n;
    let column_of = |block: &[[f64; 3]; 3], c: usize| [block[0][c], block[1][c], block[2][c]];
    for c in 0..3 {
        // Columns of j's stresslet, and of j's force.
        let column = &mut values[rows * (3 * j + c)..][..rows];
        column[3 * i..][..3].copy_from_slice(&column_of(&blocks.strain_stresslet, c));
        column[3 * (n + i)..][..3].copy_from_slice(&column_of(&blocks.velocity_stresslet, c));
        let column = &mut values[rows * (3 * (n + j) + c)..][..rows];
        column[3 * (n + i)..][..3].copy_from_slice(&column_of(&blocks.velocity_force, c));
        // The velocity of j from the stresslet of i is the transpose of the strain of i from the force of j.
        let column = &mut values[rows * (3 * i + c)..][..rows];
        column[3 * (n + j)..][..3].copy_from_slice(&blocks.strain_force[c]);
    }
}

/// Writes the block of sphere i with itself: its own mobility and what its images add.
fn write_self(mobility: &mut Matrix, i: usize, images: &Lanes, radius: f64) {
    let n = mobility.rows() / 6;
    let own = self_mobility(radius);
    let mut blocks = kernels::blocks(images, images);
    for k in 0..3 {
        blocks.velocity_force[k][k] += own[k];
        blocks.strain_stresslet[k][k] += own[3 + k];
    }
    for c in 0..3 {
        for r in 0..3 {
            mobility[(3 * i + r, 3 * i + c)] = blocks.strain_stresslet[r][c];
            mobility[(3 * n + 3 * i + r, 3 * i + c)] = blocks.velocity_stresslet[r][c];
            mobility[(3 * n + 3 * i + r, 3 * n + 3 * i + c)] = blocks.velocity_force[r][c];
        }
    }
}

#[cfg(test)]
mod tests;
