//! The periodic mobility: real- and wave-space sums put together, block by block.

use super::kernels::{self, Blocks, FiniteSize, LANES, Lanes};
use super::real_space::RealSpace;
use super::unbounded::{self, RadialChain, self_mobility};
use super::wave_space::{self, CHUNK, EVEN, ODD, WaveSpace};
use crate::geometry::cell::Cell;
use crate::geometry::modes::Vec2;
use crate::linalg::cholesky::tiled::{TILE, TiledMatrix};
use crate::linalg::simd::vectorised;
use std::f64::consts::PI;

/// The two halves of the periodic sum.
#[derive(Debug, Clone)]
pub(super) struct Ewald {
    /// Sides of the cell it was planned for, in a.
    pub(super) sides: [f64; 2],
    /// Splitting parameter α, in 1/a.
    pub(super) alpha: f64,
    pub(super) equal: bool,
    /// Added to the uniform force mode, whose true mobility is infinite, in 1/(mu a).
    pub(super) uniform: f64,
    /// Short-ranged part.
    pub(super) real: RealSpace,
    /// Long-ranged part.
    pub(super) wave: WaveSpace,
    /// Real-space sums of the pairs that are being summed.
    pub(super) sums: Vec<Lanes>,
}

/// Cut-offs that reach the tolerance at one splitting parameter.
#[derive(Debug, Clone, Copy)]
pub(super) struct CutOffs {
    /// Largest separation, in a.
    pub(super) distance: f64,
    /// Largest wave number, in 1/a.
    pub(super) wave: f64,
}

/// The smallest cut-offs whose remainders stay below the tolerance.
///
/// The remainder in real space is that of the images in the ring where the summand falls by e, taken as random; in
/// wave space, where a sphere's own term adds up coherently, that of the ring in full.
pub(super) fn cut_offs(alpha: f64, area: f64, radii: &[f64], tolerance: f64) -> CutOffs {
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

/// The columns of the matrix in ranges of about [`CHUNK`] pairs, with their numbers of pairs.
fn chunks(n: usize) -> impl Iterator<Item = (std::ops::Range<usize>, usize)> {
    let mut start = 0;
    std::iter::from_fn(move || {
        if start + 1 >= n {
            return None;
        }
        let first = start;
        let mut pairs = 0;
        while start + 1 < n && (pairs == 0 || pairs + n - 1 - start <= CHUNK) {
            pairs += n - 1 - start;
            start += 1;
        }
        Some((first..start, pairs))
    })
}

impl Ewald {
    /// Fills in the periodic mobility.
    pub(super) fn fill(
        &mut self,
        sizes: &[FiniteSize],
        radii: &[f64],
        cell: &Cell,
        centres: &[Vec2],
        target: &mut Target<'_>,
    ) {
        let n = radii.len();
        let real_self = self.real.update(cell);
        let wave_self = self.wave.update(cell, centres);
        self.fill_diagonal(sizes, radii, &real_self, &wave_self, target);
        for (range, pairs) in chunks(n) {
            self.fill_columns(sizes, centres, range, pairs, target);
        }
    }

    /// The real-space sums of all pairs, and nothing else of [`Ewald::fill`].
    pub(super) fn real_sums(&mut self, cell: &Cell, centres: &[Vec2]) {
        let n = centres.len();
        let layers = if self.equal { 1 } else { 2 };
        self.real.update(cell);
        for (range, pairs) in chunks(n) {
            self.sums.resize(pairs * layers, [0.0; LANES]);
            let mut start = 0;
            for j in range {
                let end = start + n - 1 - j;
                let sums = &mut self.sums[start * layers..end * layers];
                let real = &self.real;
                vectorised(
                    #[inline(always)]
                    || real.column(centres, j, sums),
                );
                start = end;
            }
        }
    }

    /// The wave-space sums of all pairs, and nothing else of [`Ewald::fill`].
    pub(super) fn wave_sums(&mut self, cell: &Cell, centres: &[Vec2]) {
        self.wave.update(cell, centres);
        for (range, _) in chunks(centres.len()) {
            self.wave.columns(range);
        }
    }

    /// Fills in the blocks of each sphere with itself.
    fn fill_diagonal(
        &self,
        sizes: &[FiniteSize],
        radii: &[f64],
        real: &[Lanes; 2],
        wave: &[Lanes; 2],
        target: &mut Target<'_>,
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
            target.write_self(i, &sum, radii[i]);
        }
    }

    /// The blocks of all pairs (i, j), i > j, with j in a range.
    fn fill_columns(
        &mut self,
        sizes: &[FiniteSize],
        centres: &[Vec2],
        range: std::ops::Range<usize>,
        pairs: usize,
        target: &mut Target<'_>,
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
                            target.write_pair(i, j, &kernels::blocks(&point, &point));
                        } else {
                            let laplacian =
                                add_waves(&sums[pair * layers + 1], &even[1], &odd[1], pair);
                            let (i_size, j_size) = (&sizes[i], &sizes[j]);
                            let ij =
                                kernels::finite_size(&point, &laplacian, &i_size.factors(j_size));
                            let ji =
                                kernels::finite_size(&point, &laplacian, &j_size.factors(i_size));
                            target.write_pair(i, j, &kernels::blocks(&ij, &ji));
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

/// The grand mobility, and where the rows of each sphere are in it.
pub(super) struct Target<'a> {
    /// Entries of the matrix in rows of tiles.
    values: &'a mut [f64],
    /// Position of the first strain row and of the first velocity row of each sphere.
    rows: &'a [[usize; 2]],
}

impl<'a> Target<'a> {
    /// Gives the matrix the shape `[6N × 6N]` and finds its rows.
    pub(super) fn new(
        matrix: &'a mut TiledMatrix,
        rows: &'a mut Vec<[usize; 2]>,
        spheres: usize,
    ) -> Self {
        matrix.reshape_halves(3 * spheres);
        rows.clear();
        rows.extend(
            (0..spheres).map(|i| [3 * i, 3 * (spheres + i)].map(|row| matrix.position(row))),
        );
        Self {
            values: matrix.values_mut(),
            rows,
        }
    }

    /// Writes three rows of one column.
    #[inline(always)]
    fn write(&mut self, row: usize, column: usize, entries: [f64; 3]) {
        self.values[row + TILE * column..][..3].copy_from_slice(&entries);
    }

    /// Writes the blocks of pair (i, j), i > j.
    #[inline(always)]
    pub(super) fn write_pair(&mut self, i: usize, j: usize, blocks: &Blocks) {
        let n = self.rows.len();
        let [strain_i, velocity_i] = self.rows[i];
        let [_, velocity_j] = self.rows[j];
        let column_of = |block: &[[f64; 3]; 3], c: usize| [block[0][c], block[1][c], block[2][c]];
        for c in 0..3 {
            // Columns of j's stresslet, and of j's force.
            self.write(strain_i, 3 * j + c, column_of(&blocks.strain_stresslet, c));
            self.write(
                velocity_i,
                3 * j + c,
                column_of(&blocks.velocity_stresslet, c),
            );
            self.write(
                velocity_i,
                3 * (n + j) + c,
                column_of(&blocks.velocity_force, c),
            );
            // The velocity of j from the stresslet of i is the transpose of the strain of i from the force of j.
            self.write(velocity_j, 3 * i + c, blocks.strain_force[c]);
        }
    }

    /// Writes the block of sphere i with itself: its own mobility and what its images add.
    pub(super) fn write_self(&mut self, i: usize, images: &Lanes, radius: f64) {
        let n = self.rows.len();
        let own = self_mobility(radius);
        let mut blocks = kernels::blocks(images, images);
        for k in 0..3 {
            blocks.velocity_force[k][k] += own[k];
            blocks.strain_stresslet[k][k] += own[3 + k];
        }
        let [strain, velocity] = self.rows[i];
        let column_of = |block: &[[f64; 3]; 3], c: usize| [block[0][c], block[1][c], block[2][c]];
        for c in 0..3 {
            self.write(strain, 3 * i + c, column_of(&blocks.strain_stresslet, c));
            self.write(
                velocity,
                3 * i + c,
                column_of(&blocks.velocity_stresslet, c),
            );
            self.write(
                velocity,
                3 * (n + i) + c,
                column_of(&blocks.velocity_force, c),
            );
        }
    }
}
