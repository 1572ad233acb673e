//! The periodic mobility: real- and wave-space sums combined, block by block.

use super::Splitting;
use super::real_space::RealSpace;
use super::wave_space::{self, CHUNK, EVEN, ODD, WaveSpace, WaveSums};
use crate::hydrodynamics::free_space::kernels::{self, Blocks, FiniteSize, LANES, Lanes};
use crate::hydrodynamics::free_space::planar::{self, RadialChain, self_mobility};
use crate::linalg::cholesky::tiled::{TILE, TiledMatrix};
use crate::linalg::simd::vectorised;
use crate::space::cell::Lattice;
use crate::space::modes::Vec2;
use std::f64::consts::PI;
use std::ops::Range;

/// The two halves of the periodic sum.
#[derive(Debug, Clone)]
pub(super) struct Ewald {
    /// Area of the cell that was planned for, in a².
    pub(super) area: f64,
    /// Splitting parameter α, in 1/a.
    pub(super) alpha: f64,
    pub(super) equal: bool,
    /// Added to the uniform force mode, whose true mobility is infinite, in 1/(mu a).
    pub(super) uniform: f64,
    /// Short-ranged part.
    pub(super) real: RealSpace,
    /// Long-ranged part.
    pub(super) wave: WaveSpace,
    /// The pairs in chunks of about [`CHUNK`].
    pub(super) chunks: Vec<Chunk>,
    /// Sums of the current chunk.
    pub(super) sums: Sums,
}

/// All pairs (i, j), i > j, with j in a range.
#[derive(Debug, Clone)]
pub(super) struct Chunk {
    columns: Range<usize>,
    pairs: usize,
}

/// The sums of the pairs of a chunk, both halves together.
#[derive(Debug, Clone, Default)]
pub(super) struct Sums {
    /// Sums of each pair, in one layer for equal radii and in two otherwise.
    lanes: Vec<Lanes>,
    /// The wave-space half.
    wave: WaveSums,
}

/// The smallest cut-offs whose remainders stay below the tolerance.
///
/// The remainder in real space is estimated from the images in the ring where the summand falls by
/// e, as random terms; in wave space, where a sphere's own term adds coherently, from the full sum
/// over the ring.
pub(super) fn cut_offs(alpha: f64, area: f64, radii: &[f64], tolerance: f64) -> Splitting {
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
        let lanes = [planar::lanes(&point, x), planar::lanes(&laplacian, x)];
        if ring * magnitude(lanes) / (8.0 * PI) < limit {
            break;
        }
        distance += 0.02 / alpha;
    }
    let mut wave = 2.0 * alpha;
    while alpha * alpha / PI * magnitude(wave_space::weights(Vec2::new(wave, 0.0), alpha)) > limit {
        wave += 0.04 * alpha;
    }
    Splitting {
        alpha,
        distance,
        wave,
    }
}

/// The pairs of n spheres in chunks of about [`CHUNK`], unless a single column has more.
pub(super) fn chunks(n: usize) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    let mut start = 0;
    while start + 1 < n {
        let first = start;
        let mut pairs = 0;
        while start + 1 < n && (pairs == 0 || pairs + n - 1 - start <= CHUNK) {
            pairs += n - 1 - start;
            start += 1;
        }
        chunks.push(Chunk {
            columns: first..start,
            pairs,
        });
    }
    chunks
}

impl Ewald {
    /// Fills in the periodic mobility.
    pub(super) fn fill(
        &mut self,
        sizes: &[FiniteSize],
        radii: &[f64],
        lattice: &Lattice,
        centres: &[Vec2],
        target: &mut Target<'_>,
    ) {
        let real_self = self.real.update(lattice);
        let wave_self = self.wave.update(lattice, centres);
        self.fill_diagonal(sizes, radii, &real_self, &wave_self, target);
        let mut sums = std::mem::take(&mut self.sums);
        for chunk in &self.chunks {
            self.sum(centres, chunk, &mut sums);
            self.write(sizes, chunk, &sums, target);
        }
        self.sums = sums;
    }

    /// The real-space sums of all pairs, without the rest of [`Ewald::fill`].
    pub(super) fn real_sums(&mut self, lattice: &Lattice, centres: &[Vec2]) {
        self.real.update(lattice);
        let mut sums = std::mem::take(&mut self.sums);
        for chunk in &self.chunks {
            self.sum_real(centres, chunk, &mut sums);
        }
        self.sums = sums;
    }

    /// The wave-space sums of all pairs, without the rest of [`Ewald::fill`].
    pub(super) fn wave_sums(&mut self, lattice: &Lattice, centres: &[Vec2]) {
        self.wave.update(lattice, centres);
        for chunk in &self.chunks {
            self.wave.sum(chunk.columns.clone(), &mut self.sums.wave);
        }
    }

    /// Layers of sums: one for equal radii, two otherwise.
    fn layers(&self) -> usize {
        if self.equal { 1 } else { 2 }
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
            .map(|radial| planar::lanes(&radial, Vec2::zeros()).map(|v| v / (8.0 * PI)));
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

    /// The sums of the pairs of a chunk.
    fn sum(&self, centres: &[Vec2], chunk: &Chunk, sums: &mut Sums) {
        self.sum_real(centres, chunk, sums);
        let layers = self.layers();
        self.wave.sum(chunk.columns.clone(), &mut sums.wave);
        let Sums { wave, lanes } = sums;
        vectorised(
            #[inline(always)]
            || add_waves(wave, layers, self.uniform, lanes),
        );
    }

    /// The real-space sums of the pairs of a chunk.
    fn sum_real(&self, centres: &[Vec2], chunk: &Chunk, sums: &mut Sums) {
        let (n, layers) = (centres.len(), self.layers());
        sums.lanes.resize(chunk.pairs * layers, [0.0; LANES]);
        vectorised(
            #[inline(always)]
            || {
                let mut rest = &mut sums.lanes[..];
                for j in chunk.columns.clone() {
                    let (lanes, others) = rest.split_at_mut((n - 1 - j) * layers);
                    self.real.column(centres, j, lanes);
                    rest = others;
                }
            },
        );
    }

    /// Writes the blocks of the pairs of a chunk.
    fn write(&self, sizes: &[FiniteSize], chunk: &Chunk, sums: &Sums, target: &mut Target<'_>) {
        let n = sizes.len();
        let columns = chunk.columns.clone();
        let pairs = columns.flat_map(|j| (j + 1..n).map(move |i| (i, j)));
        vectorised(
            #[inline(always)]
            || {
                if self.equal {
                    for ((i, j), lanes) in pairs.zip(&sums.lanes) {
                        target.write_pair(i, j, &kernels::blocks(lanes, lanes));
                    }
                } else {
                    for ((i, j), lanes) in pairs.zip(sums.lanes.chunks_exact(2)) {
                        let [ij, ji] = [(i, j), (j, i)].map(|(i, j)| {
                            let factors = sizes[i].factors(&sizes[j]);
                            kernels::finite_size(&lanes[0], &lanes[1], &factors)
                        });
                        target.write_pair(i, j, &kernels::blocks(&ij, &ji));
                    }
                }
            },
        );
    }
}

/// Adds the wave-space sums of a chunk to its real-space sums, in one layer or two, and the
/// mobility of the uniform force.
#[inline(always)]
fn add_waves(wave: &WaveSums, layers: usize, uniform: f64, lanes: &mut [Lanes]) {
    for layer in 0..layers {
        let even: [&[f64]; 12] = std::array::from_fn(|k| wave.even.column(12 * layer + k));
        let odd: [&[f64]; 8] = std::array::from_fn(|k| wave.odd.column(8 * layer + k));
        for (pair, lanes) in lanes.iter_mut().skip(layer).step_by(layers).enumerate() {
            for (stream, lane) in even.iter().zip(EVEN) {
                lanes[lane] += stream[pair];
            }
            for (stream, lane) in odd.iter().zip(ODD) {
                lanes[lane] += stream[pair];
            }
            if layer == 0 {
                lanes[16] += uniform;
            }
        }
    }
}

/// The grand mobility, and where the rows of each sphere are in it.
pub(super) struct Target<'a> {
    /// Entries of the matrix in rows of tiles.
    values: &'a mut [f64],
    /// Position of the first strain row and of the first velocity row of each sphere.
    rows: &'a [[usize; 2]],
}

impl<'a> Target<'a> {
    /// Sets the shape `[6N × 6N]` of the matrix and determines its rows.
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
            // The velocity of j from the stresslet of i is the transpose of the strain of i from
            // the force of j.
            self.write(velocity_j, 3 * i + c, blocks.strain_force[c]);
        }
    }

    /// Writes the self block of sphere i: its own mobility and that of its images.
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
