//! The long-ranged part of the periodic mobility applied to a vector, by fast Fourier transforms on
//! a grid in the cell.
//!
//! ```text
//! u(x_i) = Σ_k e^(ik·x_i) [G^ P + L^ Q],   v(x_i) = Σ_k e^(ik·x_i) L^ P,   L = ∇²G,   k ≠ 0
//! P(k) = Σ_j e^(−ik·x_j) f_j,   Q(k) the same with every mode times its κ a²;   f_j: force, and dipoles as −Q_bc ∂_c
//! velocity mode of i: read off u, plus κ a² times the same of v
//! G^_ab = −δ_ab b1 + k_a k_b b0,   L^_ab = δ_ab b2 − k_a k_b b1        b: see [`FarSpace::transforms`]
//! ```
//! Sources are spread to the grid, and velocities are interpolated from it, by a Kaiser-Bessel
//! window in lattice coordinates, whose transform is divided out twice; dipoles and gradients use
//! the window's derivative. Reading is the transpose of writing, so the operator is symmetric to
//! rounding. The cost is that of the transforms of two fields per component, and of N times the
//! points under a window.

mod axis;
pub(super) mod sampling;
mod spheres;

use super::far_space::{FarSpace, components};
use super::{Splitting, highest};
use crate::hydrodynamics::free_space::kernels::FiniteSize;
use crate::linalg::simd::vectorised;
use crate::space::FixedArray;
use crate::space::cell::Lattice;
use crate::threads;
use axis::{Axis, Window, plan_axes};
use rustfft::num_complex::Complex64;
use sampling::{Sampling, sampling};
use spheres::windows_at;

/// Lines of the grid transformed together.
const LINES: usize = 8;
/// Planes of the grid that a line is copied to together.
const PLANES: usize = 8;
/// Fewest planes (in a layer, lines) of the grid, fewest pairs of its lines, and fewest spheres
/// that a thread computes.
const LEAST_SLABS: usize = 4;
const LEAST_BLOCKS: usize = 16;
const LEAST_SPHERES: usize = 100;

/// P and Q of each component at a point, then u and v.
type Fields<S> = <S as FarSpace>::PerComponent<[f64; 2]>;

/// One of a pair of opposite wave vectors within the cut-off.
struct Wave {
    /// Places of the wave vector and of its opposite in a block of lines, for the first component.
    places: [usize; 2],
    /// The wave vector, in 1/a.
    k: [f64; 3],
    /// `[b0, b1, b2]` over the windows' transforms and the cell's content.
    kernel: [f64; 3],
}

/// Workspace of a thread for transforms.
#[derive(Default)]
struct Work {
    /// Lines being transformed.
    lines: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

/// The wave part, planned for radii, a splitting parameter and a cut-off.
///
/// The grid is stored by slabs: planes across the last coordinate, in a layer lines. What is done
/// along the other coordinates stays within a slab. Lines along the last coordinate are transformed
/// in a copy, each in a block with the line of the opposite wave numbers, in which all pairs of
/// opposite wave vectors are.
pub(super) struct Grid<S: FarSpace> {
    splitting: Splitting,
    sizes: Vec<FiniteSize>,
    sampling: Sampling,
    /// One per lattice coordinate.
    axes: Vec<Axis>,
    lattice: Option<Lattice<S>>,
    /// Derivatives of the lattice coordinates: row c holds the components of `∂_c` along
    /// `∂_X, ∂_Y, ∂_Z`.
    slopes: [[f64; 3]; 3],
    windows: Vec<S::PerComponent<Window>>,
    waves: Vec<Wave>,
    /// Start of the waves of each block, then their number.
    wave_starts: Vec<usize>,
    /// Where the lines of the blocks are in a slab. The last block has the line of wave numbers 0,
    /// twice.
    lines: Vec<usize>,
    /// Whether a point of the blocks is a wave vector within the cut-off, line by line.
    is_kept: Vec<bool>,
    /// The blocks: for each line its components.
    blocks: Vec<Complex64>,
    /// The first coordinate runs fastest. Each line along it has the points of a window more than
    /// the axis, so that a window never wraps there.
    values: Vec<Fields<S>>,
    /// Length of the scratch of transforms.
    scratch: usize,
    /// One workspace for each thread.
    works: Vec<Work>,
}

impl<S: FarSpace> Grid<S> {
    /// Makes a plan for a lattice and all that it becomes; `tolerance`: of M, relative to its
    /// largest entry.
    pub(super) fn new(
        lattice: &Lattice<S>,
        sizes: &[FiniteSize],
        splitting: Splitting,
        tolerance: f64,
    ) -> Self {
        let mut grid = Self {
            splitting,
            sizes: sizes.to_vec(),
            sampling: sampling::<S>(lattice, sizes.len(), splitting.wave, tolerance).0,
            axes: Vec::new(),
            lattice: None,
            slopes: [[0.0; 3]; 3],
            windows: Vec::with_capacity(sizes.len()),
            waves: Vec::new(),
            wave_starts: Vec::new(),
            lines: Vec::new(),
            is_kept: Vec::new(),
            blocks: Vec::new(),
            values: Vec::new(),
            scratch: 0,
            works: Vec::new(),
        };
        grid.plan(lattice);
        grid
    }

    /// Plans the axes, and allocates their points and the scratch of the transforms.
    fn plan(&mut self, lattice: &Lattice<S>) {
        let lengths = lattice.wave_lengths();
        (self.axes, self.scratch) = plan_axes(
            &lengths[..S::DIMENSIONS],
            self.splitting.wave,
            self.sampling,
        );
        let points = self.slab() * self.last().points;
        self.values.resize(points, FixedArray::each([0.0; 2]));
        let [m, n, l] = self.highest();
        self.waves.clear();
        self.waves.reserve((m + 1) * (2 * n + 1) * (2 * l + 1));
        let across = if S::DIMENSIONS < 3 { 0 } else { n };
        let lines = 2 * (m + 1) * (2 * across + 1);
        for list in [&mut self.wave_starts, &mut self.lines] {
            list.clear();
            list.reserve(lines + 1);
        }
        let points = lines * self.last().points;
        self.is_kept.clear();
        self.is_kept.reserve(points);
        self.blocks.clear();
        self.blocks.reserve(S::DIMENSIONS * points);
        self.works.clear();
    }

    /// Points along each coordinate: one where the space has none.
    fn counts(&self) -> [usize; 3] {
        std::array::from_fn(|k| self.axes.get(k).map_or(1, |axis| axis.points))
    }

    /// Largest wave numbers kept.
    fn highest(&self) -> [usize; 3] {
        std::array::from_fn(|k| self.axes.get(k).map_or(0, |axis| axis.highest))
    }

    /// The last coordinate.
    fn last(&self) -> &Axis {
        &self.axes[S::DIMENSIONS - 1]
    }

    /// Points of a line along the first coordinate, with those beyond it.
    fn row(&self) -> usize {
        self.axes[0].points + self.sampling.width
    }

    /// Points of a slab.
    fn slab(&self) -> usize {
        if S::DIMENSIONS < 3 {
            self.row()
        } else {
            self.row() * self.axes[1].points
        }
    }

    /// Numbers of a block of two lines.
    fn block(&self) -> usize {
        2 * S::DIMENSIONS * self.last().points
    }

    /// Number of grid points.
    #[cfg(test)]
    pub(super) fn points(&self) -> usize {
        self.counts().iter().product()
    }

    /// Sets the lattice and the centres for the next applications.
    pub(super) fn update(&mut self, lattice: &Lattice<S>, centres: &[S::Vector]) {
        if self.lattice != Some(*lattice) {
            self.lattice = Some(*lattice);
            // The plan depends only on the lattice, not on earlier ones, so a resumed run has the
            // same bits.
            let lengths = lattice.wave_lengths();
            let fits = |(axis, &length): (&Axis, &f64)| {
                axis.highest == highest(length, self.splitting.wave)
            };
            if !self.axes.iter().zip(&lengths).all(fits) {
                self.plan(lattice);
            }
            let reciprocal = lattice.reciprocal().map(|b| components::<S>(&b));
            self.slopes = [0, 1, 2].map(|c| reciprocal.map(|b| b[c]));
            self.fill_waves(lattice);
        }
        let Self { windows, axes, .. } = self;
        if let Some(first) = centres.first() {
            windows.resize(centres.len(), windows_at(axes, lattice, first));
        }
        threads::divide(windows, LEAST_SPHERES, &|first, windows| {
            vectorised(
                #[inline(always)]
                || {
                    for (windows, x) in windows.iter_mut().zip(&centres[first..]) {
                        *windows = windows_at(axes, lattice, x);
                    }
                },
            );
        });
    }

    /// Lists the wave vectors of a lattice within the cut-off, with the transforms of the kernels,
    /// by the lines of the grid that they are on.
    fn fill_waves(&mut self, lattice: &Lattice<S>) {
        self.waves.clear();
        self.wave_starts.clear();
        self.lines.clear();
        self.is_kept.clear();
        let [m, n, _] = self.highest().map(usize::cast_signed);
        let across = if S::DIMENSIONS < 3 { 0 } else { n };
        for m in 0..=m {
            for n in -across..=across {
                // Of opposite lines only one.
                if (m, n) > (0, 0) {
                    self.add_block(lattice, [m, n]);
                }
            }
        }
        self.add_block(lattice, [0, 0]);
        self.wave_starts.push(self.waves.len());
        let numbers = self.block() * (self.lines.len() / 2);
        self.blocks.resize(numbers, Complex64::new(0.0, 0.0));
    }

    /// Adds the block of the line with the first wave numbers (m, n), in a layer (m), if it has
    /// wave vectors within the cut-off.
    fn add_block(&mut self, lattice: &Lattice<S>, [m, n]: [isize; 2]) {
        let Splitting { alpha, wave, .. } = self.splitting;
        let first_wave = self.waves.len();
        let points = self.last().points;
        let highest = self.last().highest.cast_signed();
        let is_alone = [m, n] == [0, 0];
        let flags = 2 * points * (self.lines.len() / 2);
        self.is_kept.resize(flags + 2 * points, false);
        for l in if is_alone { 1 } else { -highest }..=highest {
            let numbers = if S::DIMENSIONS < 3 {
                [m, l, n]
            } else {
                [m, n, l]
            };
            let k = lattice.wave_vector(numbers.map(|x| x as f64));
            if S::norm_squared(&k) > wave * wave {
                continue;
            }
            let axes = self.axes.iter().zip(numbers);
            let window: f64 = axes
                .map(|(axis, number)| axis.correction[number.unsigned_abs()])
                .product();
            let weight = window * window / lattice.content();
            let [here, there] = [l, -l].map(|l| self.last().index(l));
            let other = usize::from(!is_alone);
            self.is_kept[flags + here] = true;
            self.is_kept[flags + other * points + there] = true;
            self.waves.push(Wave {
                places: [here, other * S::DIMENSIONS * points + there],
                k: components::<S>(&k),
                kernel: S::transforms(&k, alpha).map(|b| b * weight),
            });
        }
        if first_wave == self.waves.len() && !is_alone {
            self.is_kept.truncate(flags);
            return;
        }
        self.wave_starts.push(first_wave);
        for [m, n] in [[m, n], [-m, -n]] {
            let across = if S::DIMENSIONS < 3 {
                0
            } else {
                self.axes[1].index(n)
            };
            self.lines.push(across * self.row() + self.axes[0].index(m));
        }
    }

    /// Adds the wave part of `M x` to y, by sphere.
    pub(super) fn add(&mut self, x: &[S::PerAnyMode<f64>], y: &mut [S::PerAnyMode<f64>]) {
        let slabs = threads::parts(self.last().points, LEAST_SLABS);
        let blocks = threads::parts(self.lines.len() / 2, LEAST_BLOCKS);
        self.make_works(slabs.max(blocks));
        let mut works = std::mem::take(&mut self.works);
        let mut values = std::mem::take(&mut self.values);
        let mut lines = std::mem::take(&mut self.blocks);
        let grid = &*self;
        let slab = grid.slab();
        let by_slab = &mut works[..slabs];
        threads::divide_with((&mut values, slab), by_slab, &|first, values, work| {
            grid.spread_and_transform(first, x, values, work);
        });
        let read = &values[..];
        let by_block = &mut works[..blocks];
        threads::divide_with(
            (&mut lines, grid.block()),
            by_block,
            &|first, lines, work| {
                grid.convolve(first, read, lines, work);
            },
        );
        let read = &lines[..];
        let by_slab = &mut works[..slabs];
        threads::divide_with((&mut values, slab), by_slab, &|first, values, work| {
            grid.transform_back(first, read, values, work);
        });
        let read = &values[..];
        threads::divide(y, LEAST_SPHERES, &|first, y| {
            vectorised(
                #[inline(always)]
                || match grid.sampling.width {
                    8 => grid.read::<8>(read, first, y),
                    10 => grid.read::<10>(read, first, y),
                    _ => grid.read::<12>(read, first, y),
                },
            );
        });
        (self.works, self.values, self.blocks) = (works, values, lines);
    }

    /// Allocates workspaces, if there are fewer.
    fn make_works(&mut self, count: usize) {
        let zero = Complex64::new(0.0, 0.0);
        let longest = self.counts().into_iter().max().unwrap_or(1);
        let (length, scratch) = (S::DIMENSIONS * LINES * longest, self.scratch);
        while self.works.len() < count {
            self.works.push(Work {
                lines: vec![zero; length],
                scratch: vec![zero; scratch],
            });
        }
    }

    /// Spreads the sources over slabs from `first` on, and transforms along all coordinates but the
    /// last.
    fn spread_and_transform(
        &self,
        first: usize,
        x: &[S::PerAnyMode<f64>],
        values: &mut [Fields<S>],
        work: &mut Work,
    ) {
        vectorised(
            #[inline(always)]
            || match self.sampling.width {
                8 => self.spread::<8>(first, x, values),
                10 => self.spread::<10>(first, x, values),
                _ => self.spread::<12>(first, x, values),
            },
        );
        self.transform_rows(0, values, work);
        self.transform_columns(0, values, work);
    }

    /// Transforms slabs along the first coordinate, forward (0) or back (1).
    fn transform_rows(&self, direction: usize, values: &mut [Fields<S>], work: &mut Work) {
        let row = self.row();
        let starts = (0..values.len()).step_by(row);
        transform::<S>(&self.axes[0], direction, 1, starts, values, work);
    }

    /// Transforms planes along the second coordinate the lines that hold kept waves of the first.
    fn transform_columns(&self, direction: usize, values: &mut [Fields<S>], work: &mut Work) {
        if S::DIMENSIONS < 3 {
            return;
        }
        let (count, highest) = (self.axes[0].points, self.axes[0].highest);
        let kept = (0..count).filter(|&at| at.min(count - at) <= highest);
        let planes = (0..values.len()).step_by(self.slab());
        let starts = planes.flat_map(|plane| kept.clone().map(move |at| plane + at));
        transform::<S>(&self.axes[1], direction, self.row(), starts, values, work);
    }

    /// Computes u and v from P and Q in blocks of lines from `first` on: transforms them along the
    /// last coordinate, multiplies by the kernels, and transforms back.
    fn convolve(
        &self,
        first: usize,
        values: &[Fields<S>],
        blocks: &mut [Complex64],
        work: &mut Work,
    ) {
        let (axis, slab) = (self.last(), self.slab());
        let length = S::DIMENSIONS * axis.points;
        for (blocks, first) in blocks
            .chunks_mut(LINES / 2 * self.block())
            .zip((first..).step_by(LINES / 2))
        {
            let starts = &self.lines[2 * first..];
            for (line, &start) in blocks.chunks_exact_mut(length).zip(starts) {
                let points = values[start..].iter().step_by(slab);
                for (at, point) in points.take(axis.points).enumerate() {
                    for c in 0..S::DIMENSIONS {
                        line[c * axis.points + at] = Complex64::new(point[c][0], point[c][1]);
                    }
                }
            }
            axis.plans[0].process_with_scratch(blocks, &mut work.scratch);
            vectorised(
                #[inline(always)]
                || {
                    for (block, number) in blocks.chunks_exact_mut(2 * length).zip(first..) {
                        self.multiply(block, number);
                    }
                },
            );
            axis.plans[1].process_with_scratch(blocks, &mut work.scratch);
        }
    }

    /// Computes u and v of every wave vector of a block from P and Q.
    #[inline(always)]
    fn multiply(&self, block: &mut [Complex64], number: usize) {
        let points = self.last().points;
        let zero = Complex64::new(0.0, 0.0);
        let is_kept = &self.is_kept[2 * points * number..2 * points * (number + 1)];
        let lines = block.chunks_exact_mut(S::DIMENSIONS * points);
        for (line, is_kept) in lines.zip(is_kept.chunks_exact(points)) {
            for component in line.chunks_exact_mut(points) {
                for (value, is_kept) in component.iter_mut().zip(is_kept) {
                    if !is_kept {
                        *value = zero;
                    }
                }
            }
        }
        let waves = self.wave_starts[number]..self.wave_starts[number + 1];
        for wave in &self.waves[waves] {
            let [here, there] = wave.places;
            let (k, [b0, b1, b2]) = (&wave.k, wave.kernel);
            let (mut p, mut q): (S::PerComponent<_>, S::PerComponent<_>) =
                (FixedArray::each(zero), FixedArray::each(zero));
            let (mut kp, mut kq) = (zero, zero);
            for c in 0..S::DIMENSIONS {
                [p[c], q[c]] = split(block[here + c * points], block[there + c * points]);
                kp += p[c] * k[c];
                kq += q[c] * k[c];
            }
            let shear = kp * b0 - kq * b1;
            for c in 0..S::DIMENSIONS {
                let u = q[c] * b2 - p[c] * b1 + shear * k[c];
                let v = p[c] * b2 - kp * (b1 * k[c]);
                [block[here + c * points], block[there + c * points]] = pack([u, v]);
            }
        }
    }

    /// Copies slabs from `first` on from the blocks, and transforms back along the other
    /// coordinates.
    fn transform_back(
        &self,
        first: usize,
        blocks: &[Complex64],
        values: &mut [Fields<S>],
        work: &mut Work,
    ) {
        let (points, slab) = (self.last().points, self.slab());
        values.fill(FixedArray::each([0.0; 2]));
        // The last line is there twice.
        let starts = &self.lines[..self.lines.len() - 1];
        let planes = values.chunks_mut(PLANES * slab);
        for (values, first) in planes.zip((first..).step_by(PLANES)) {
            let lines = blocks.chunks_exact(S::DIMENSIONS * points).zip(starts);
            for (line, &start) in lines {
                let targets = values[start..].iter_mut().step_by(slab);
                for (point, at) in targets.zip(first..) {
                    for c in 0..S::DIMENSIONS {
                        let value = line[c * points + at];
                        point[c] = [value.re, value.im];
                    }
                }
            }
        }
        self.transform_columns(1, values, work);
        self.transform_rows(1, values, work);
        let (row, count) = (self.row(), self.axes[0].points);
        for line in values.chunks_exact_mut(row) {
            line.copy_within(..row - count, count);
        }
    }
}

/// Transforms the lines that start at some points along an axis, forward (0) or back (1); `stride`:
/// from one point of a line to the next.
fn transform<S: FarSpace>(
    axis: &Axis,
    direction: usize,
    stride: usize,
    mut starts: impl Iterator<Item = usize>,
    values: &mut [Fields<S>],
    work: &mut Work,
) {
    let (plan, points) = (&axis.plans[direction], axis.points);
    let Work { lines, scratch } = work;
    loop {
        let (mut places, mut count) = ([0; LINES], 0);
        for (place, start) in places.iter_mut().zip(&mut starts) {
            *place = start;
            count += 1;
        }
        if count == 0 {
            return;
        }
        let starts = &places[..count];
        let lines = &mut lines[..S::DIMENSIONS * count * points];
        for (line, &start) in lines.chunks_exact_mut(S::DIMENSIONS * points).zip(starts) {
            let points_of = values[start..].iter().step_by(stride).take(points);
            for (at, point) in points_of.enumerate() {
                for c in 0..S::DIMENSIONS {
                    line[c * points + at] = Complex64::new(point[c][0], point[c][1]);
                }
            }
        }
        plan.process_with_scratch(lines, scratch);
        for (line, &start) in lines.chunks_exact(S::DIMENSIONS * points).zip(starts) {
            let points_of = values[start..].iter_mut().step_by(stride).take(points);
            for (at, point) in points_of.enumerate() {
                for c in 0..S::DIMENSIONS {
                    let value = line[c * points + at];
                    point[c] = [value.re, value.im];
                }
            }
        }
        if count < LINES {
            return;
        }
    }
}

/// Transforms of two real fields a, b at k from those of a + ib at k and −k.
#[inline(always)]
fn split(here: Complex64, there: Complex64) -> [Complex64; 2] {
    [
        Complex64::new(0.5 * (here.re + there.re), 0.5 * (here.im - there.im)),
        Complex64::new(0.5 * (here.im + there.im), 0.5 * (there.re - here.re)),
    ]
}

/// Transforms of a + ib at k and −k from those of the two real fields a and b at k.
#[inline(always)]
fn pack([a, b]: [Complex64; 2]) -> [Complex64; 2] {
    [
        Complex64::new(a.re - b.im, a.im + b.re),
        Complex64::new(a.re + b.im, b.re - a.im),
    ]
}
