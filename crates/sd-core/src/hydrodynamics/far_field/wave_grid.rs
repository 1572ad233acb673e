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

pub(super) mod axis;

use super::Splitting;
use super::far_operator::{FarSpace, components};
use crate::hydrodynamics::free_space::kernels::FiniteSize;
use crate::linalg::simd::vectorised;
use crate::space::FixedArray;
use crate::space::cell::Lattice;
use axis::{Axis, Sampling, WIDEST, Window, highest, plan_axes};
use rustfft::num_complex::Complex64;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Lines of the grid transformed together.
const LINES: usize = 8;

/// P and Q of each component at a point, then u and v.
type Fields<S> = <S as FarSpace>::PerComponent<[f64; 2]>;

/// One of a pair of opposite wave vectors within the cut-off.
struct Wave {
    /// Index of the wave vector in the grid, and that of its opposite.
    places: [usize; 2],
    /// The wave vector, in 1/a.
    k: [f64; 3],
    /// `[b0, b1, b2]` over the windows' transforms and the cell's content.
    kernel: [f64; 3],
}

/// The wave part, planned for radii, a splitting parameter and a cut-off.
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
    /// Whether a point of the grid is a wave vector within the cut-off.
    is_kept: Vec<bool>,
    /// The first coordinate runs fastest. Each line along it has the points of a window more than
    /// the axis, so that a window never wraps there.
    values: Vec<Fields<S>>,
    /// Starts of the lines that are transformed along an axis.
    starts: Vec<usize>,
    /// Lines being transformed.
    lines: Vec<Complex64>,
    scratch: Vec<Complex64>,
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
            is_kept: Vec::new(),
            values: Vec::new(),
            starts: Vec::new(),
            lines: Vec::new(),
            scratch: Vec::new(),
        };
        grid.plan(lattice);
        grid
    }

    /// Plans the axes, and allocates their points and the scratch of the transforms.
    fn plan(&mut self, lattice: &Lattice<S>) {
        let lengths = lattice.wave_lengths();
        let scratch;
        (self.axes, scratch) = plan_axes(
            &lengths[..S::DIMENSIONS],
            self.splitting.wave,
            self.sampling,
        );
        let [first, second, third] = self.counts();
        let zero = Complex64::new(0.0, 0.0);
        let points = (first + self.sampling.width) * second * third;
        self.is_kept.resize(points, false);
        self.values.resize(points, FixedArray::each([0.0; 2]));
        self.starts.reserve(second.max(first) * third.max(second));
        let longest = first.max(second).max(third);
        self.lines.resize(S::DIMENSIONS * LINES * longest, zero);
        self.scratch.resize(scratch, zero);
        let [m, n, l] = self.highest();
        self.waves.clear();
        self.waves.reserve((m + 1) * (2 * n + 1) * (2 * l + 1));
    }

    /// Points along each coordinate: one where the space has none.
    fn counts(&self) -> [usize; 3] {
        std::array::from_fn(|k| self.axes.get(k).map_or(1, |axis| axis.points))
    }

    /// Largest wave numbers kept.
    fn highest(&self) -> [usize; 3] {
        std::array::from_fn(|k| self.axes.get(k).map_or(0, |axis| axis.highest))
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
        windows.clear();
        vectorised(
            #[inline(always)]
            || {
                for x in centres {
                    let coordinates = lattice.coordinates(x);
                    let mut of_sphere: S::PerComponent<_> =
                        FixedArray::each(axes[0].window(coordinates[0]));
                    for k in 1..S::DIMENSIONS {
                        of_sphere[k] = axes[k].window(coordinates[k]);
                    }
                    windows.push(of_sphere);
                }
            },
        );
    }

    /// Lists the wave vectors of a lattice within the cut-off, with the transforms of the kernels.
    fn fill_waves(&mut self, lattice: &Lattice<S>) {
        let content = lattice.content();
        let Splitting { alpha, wave, .. } = self.splitting;
        let [first, second, _] = self.counts();
        let highest = self.highest().map(usize::cast_signed);
        let place = |numbers: [isize; 3]| {
            let [x, y, z] =
                std::array::from_fn(|k| self.axes.get(k).map_or(0, |axis| axis.index(numbers[k])));
            (z * second + y) * (first + self.sampling.width) + x
        };
        self.waves.clear();
        self.is_kept.fill(false);
        for l in -highest[2]..=highest[2] {
            for n in -highest[1]..=highest[1] {
                for m in 0..=highest[0] {
                    let k = lattice.wave_vector([m, n, l].map(|x| x as f64));
                    // Of opposite wave vectors only one.
                    if m == 0 && (l, n) <= (0, 0) || S::norm_squared(&k) > wave * wave {
                        continue;
                    }
                    let numbers = [m, n, l].map(isize::unsigned_abs);
                    let axes = self.axes.iter().zip(numbers);
                    let window: f64 = axes.map(|(axis, number)| axis.correction[number]).product();
                    let weight = window * window / content;
                    let places = [place([m, n, l]), place([-m, -n, -l])];
                    for place in places {
                        self.is_kept[place] = true;
                    }
                    self.waves.push(Wave {
                        places,
                        k: components::<S>(&k),
                        kernel: S::transforms(&k, alpha).map(|b| b * weight),
                    });
                }
            }
        }
    }

    /// Adds the wave part of `M x` to y, by sphere.
    pub(super) fn add(&mut self, x: &[S::PerAnyMode<f64>], y: &mut [S::PerAnyMode<f64>]) {
        match self.sampling.width {
            8 => vectorised(
                #[inline(always)]
                || self.spread::<8>(x),
            ),
            10 => vectorised(
                #[inline(always)]
                || self.spread::<10>(x),
            ),
            _ => vectorised(
                #[inline(always)]
                || self.spread::<12>(x),
            ),
        }
        for axis in 0..S::DIMENSIONS {
            self.transform_axis(axis, 0);
        }
        vectorised(
            #[inline(always)]
            || self.multiply(),
        );
        for axis in (0..S::DIMENSIONS).rev() {
            self.transform_axis(axis, 1);
        }
        match self.sampling.width {
            8 => vectorised(
                #[inline(always)]
                || self.read::<8>(y),
            ),
            10 => vectorised(
                #[inline(always)]
                || self.read::<10>(y),
            ),
            _ => vectorised(
                #[inline(always)]
                || self.read::<12>(y),
            ),
        }
    }

    /// Spreads the sources over the grid: P and Q there.
    #[inline(always)]
    fn spread<const W: usize>(&mut self, x: &[S::PerAnyMode<f64>]) {
        let none: S::PerComponent<_> = FixedArray::each([0.0; 2]);
        let counts = self.counts();
        let Self {
            values,
            windows,
            sizes,
            slopes,
            ..
        } = self;
        values.fill(none);
        for ((windows, size), modes) in windows.iter().zip(&*sizes).zip(x) {
            let modes = S::embedded(modes);
            let stress = dipole::<S>(&modes[6..]);
            let turn = rotation([modes[3], modes[4], modes[5]]);
            // Weights of the window, and of its derivatives by the lattice coordinates.
            let (mut value, mut by) = (none, [none; 3]);
            for b in 0..S::DIMENSIONS {
                value[b] = [modes[b], size.force * modes[b]];
                for (axis, by) in by.iter_mut().enumerate().take(S::DIMENSIONS) {
                    for c in 0..S::DIMENSIONS {
                        let slope = slopes[c][axis];
                        by[b][0] -= (stress[b][c] + turn[b][c]) * slope;
                        by[b][1] -= size.stresslet * stress[b][c] * slope;
                    }
                }
            }
            let along = &windows[0];
            for line in 0..lines::<S, W>() {
                let (start, [plain, second, third]) = line_under::<S, W>(windows, counts, line);
                let (mut by_value, mut by_slope) = (none, none);
                for b in 0..S::DIMENSIONS {
                    for f in 0..2 {
                        by_value[b][f] =
                            plain * value[b][f] + second * by[1][b][f] + third * by[2][b][f];
                        by_slope[b][f] = plain * by[0][b][f];
                    }
                }
                let points = &mut values[start..start + W];
                for (c, point) in points.iter_mut().enumerate() {
                    let (v, s) = (along.values[c], along.slopes[c]);
                    for b in 0..S::DIMENSIONS {
                        for f in 0..2 {
                            point[b][f] =
                                by_value[b][f].mul_add(v, by_slope[b][f].mul_add(s, point[b][f]));
                        }
                    }
                }
            }
        }
        for line in values.chunks_exact_mut(counts[0] + W) {
            let (line, beyond) = line.split_at_mut(counts[0]);
            for (point, beyond) in line.iter_mut().zip(beyond) {
                for b in 0..S::DIMENSIONS {
                    for f in 0..2 {
                        point[b][f] += beyond[b][f];
                    }
                }
            }
        }
    }

    /// Transforms along an axis, forward (0) or back (1), the lines that hold kept waves of the
    /// axes before it: those after it hold points.
    fn transform_axis(&mut self, axis: usize, direction: usize) {
        let [first, second, third] = self.counts();
        let width = self.sampling.width;
        let strides = [1, first + width, (first + width) * second];
        let Self {
            axes,
            values,
            starts,
            lines,
            scratch,
            ..
        } = self;
        let [inner, outer] = [[1, 2], [0, 2], [0, 1]][axis];
        let places = |other: usize| {
            let count = [first, second, third][other];
            let highest = axes.get(other).map_or(0, |axis| axis.highest);
            let is_kept = move |&at: &usize| other > axis || at.min(count - at) <= highest;
            (0..count).filter(is_kept)
        };
        starts.clear();
        for place in places(outer) {
            starts.extend(places(inner).map(|k| k * strides[inner] + place * strides[outer]));
        }
        let (length, stride) = (axes[axis].points, strides[axis]);
        for starts in starts.chunks(LINES) {
            let work = &mut lines[..S::DIMENSIONS * starts.len() * length];
            for (line, &start) in work.chunks_exact_mut(S::DIMENSIONS * length).zip(starts) {
                let points = values[start..].iter().step_by(stride).take(length);
                for (at, point) in points.enumerate() {
                    for c in 0..S::DIMENSIONS {
                        line[c * length + at] = Complex64::new(point[c][0], point[c][1]);
                    }
                }
            }
            axes[axis].plans[direction].process_with_scratch(work, scratch);
            for (line, &start) in work.chunks_exact(S::DIMENSIONS * length).zip(starts) {
                let points = values[start..].iter_mut().step_by(stride).take(length);
                for (at, point) in points.enumerate() {
                    for c in 0..S::DIMENSIONS {
                        let value = line[c * length + at];
                        point[c] = [value.re, value.im];
                    }
                }
            }
        }
        if axis == 0 && direction == 1 {
            for line in values.chunks_exact_mut(strides[1]) {
                line.copy_within(..width, first);
            }
        }
    }

    /// Computes u and v of every wave vector from P and Q.
    #[inline(always)]
    fn multiply(&mut self) {
        let Self {
            values,
            waves,
            is_kept,
            ..
        } = self;
        for (value, is_kept) in values.iter_mut().zip(&*is_kept) {
            if !is_kept {
                *value = FixedArray::each([0.0; 2]);
            }
        }
        for wave in &*waves {
            let [here, there] = wave.places;
            let (k, [b0, b1, b2]) = (&wave.k, wave.kernel);
            let zero = Complex64::new(0.0, 0.0);
            let (mut p, mut q): (S::PerComponent<_>, S::PerComponent<_>) =
                (FixedArray::each(zero), FixedArray::each(zero));
            let (mut kp, mut kq) = (zero, zero);
            for c in 0..S::DIMENSIONS {
                [p[c], q[c]] = split(values[here][c], values[there][c]);
                kp += p[c] * k[c];
                kq += q[c] * k[c];
            }
            let shear = kp * b0 - kq * b1;
            for c in 0..S::DIMENSIONS {
                let u = q[c] * b2 - p[c] * b1 + shear * k[c];
                let v = p[c] * b2 - kp * (b1 * k[c]);
                [values[here][c], values[there][c]] = pack([u, v]);
            }
        }
    }

    /// Adds the modes of each sphere read off u and v: the transpose of [`Grid::spread`].
    #[inline(always)]
    fn read<const W: usize>(&self, y: &mut [S::PerAnyMode<f64>]) {
        let none: S::PerComponent<_> = FixedArray::each([0.0; 2]);
        let counts = self.counts();
        for ((windows, size), y) in self.windows.iter().zip(&self.sizes).zip(y) {
            // Of u and v: value, and derivatives of the window by the lattice coordinates.
            let (mut value, mut by) = (none, [none; 3]);
            let along = &windows[0];
            // Two points at a time, whose numbers fill whole registers.
            let numbers = 4 * S::DIMENSIONS;
            let mut weights = [[[0.0; 12]; 2]; WIDEST / 2];
            for (two, [values, slopes]) in weights.iter_mut().enumerate().take(W / 2) {
                for (k, (value, slope)) in values.iter_mut().zip(slopes).enumerate().take(numbers) {
                    let point = 2 * two + k / (2 * S::DIMENSIONS);
                    (*value, *slope) = (along.values[point], along.slopes[point]);
                }
            }
            for line in 0..lines::<S, W>() {
                let (start, [plain, second, third]) = line_under::<S, W>(windows, counts, line);
                let points = S::PerComponent::flat(&self.values[start..start + W]).as_flattened();
                let mut sums = [[0.0; 12]; 2];
                for (two, points) in points.chunks_exact(numbers).enumerate() {
                    for k in 0..numbers {
                        sums[0][k] = points[k].mul_add(weights[two][0][k], sums[0][k]);
                        sums[1][k] = points[k].mul_add(weights[two][1][k], sums[1][k]);
                    }
                }
                for b in 0..S::DIMENSIONS {
                    for f in 0..2 {
                        let (even, odd) = (2 * b + f, 2 * (S::DIMENSIONS + b) + f);
                        let by_value = sums[0][even] + sums[0][odd];
                        let by_slope = sums[1][even] + sums[1][odd];
                        value[b][f] += plain * by_value;
                        by[0][b][f] += plain * by_slope;
                        by[1][b][f] += second * by_value;
                        by[2][b][f] += third * by_value;
                    }
                }
            }
            // Gradients by component and direction; ∂ of the centre is minus that of the grid
            // point.
            let gradient = |field: usize| {
                let mut gradient = [[0.0; 3]; 3];
                for (b, row) in gradient.iter_mut().enumerate().take(S::DIMENSIONS) {
                    for (entry, slopes) in row.iter_mut().zip(&self.slopes).take(S::DIMENSIONS) {
                        for (by, slope) in by.iter().zip(slopes).take(S::DIMENSIONS) {
                            *entry -= by[b][field] * slope;
                        }
                    }
                }
                if S::DIMENSIONS < 3 {
                    // The fluid is incompressible.
                    gradient[2][2] = -(gradient[0][0] + gradient[1][1]);
                }
                gradient
            };
            let (of_u, of_v) = (gradient(0), gradient(1));
            let (own, sized) = (strain(&of_u), strain(&of_v));
            let mut modes = [0.0; 11];
            for b in 0..S::DIMENSIONS {
                modes[b] = value[b][0] + size.force * value[b][1];
            }
            for b in 0..3 {
                let (c, d) = ((b + 1) % 3, (b + 2) % 3);
                modes[3 + b] = 0.5 * (of_u[d][c] - of_u[c][d]);
            }
            for k in 0..5 {
                modes[6 + k] = own[k] + size.stresslet * sized[k];
            }
            let read = S::restricted(&modes);
            for (y, read) in y.as_mut().iter_mut().zip(read.as_ref()) {
                *y += read;
            }
        }
    }
}

/// Lines of the grid under a window.
#[inline(always)]
fn lines<S: FarSpace, const W: usize>() -> usize {
    if S::DIMENSIONS < 3 { W } else { W * W }
}

/// Where a line under a window starts in the grid, and the window's weight across it: its value and
/// its derivatives by the second and the third coordinate.
#[inline(always)]
fn line_under<S: FarSpace, const W: usize>(
    windows: &S::PerComponent<Window>,
    [first, second, third]: [usize; 3],
    line: usize,
) -> (usize, [f64; 3]) {
    let across = &windows[1];
    let r = line % W;
    let row = (across.first + r) % second;
    let (v, s) = (across.values[r], across.slopes[r]);
    if S::DIMENSIONS < 3 {
        return (row * (first + W) + windows[0].first, [v, s, 0.0]);
    }
    let up = &windows[S::DIMENSIONS - 1];
    let p = line / W;
    let plane = (up.first + p) % third * second;
    let start = (plane + row) * (first + W) + windows[0].first;
    (
        start,
        [v * up.values[p], s * up.values[p], v * up.slopes[p]],
    )
}

/// The cheapest sampling of waves up to a cut-off whose errors stay below a tolerance of M, and its
/// cost in an application, in nanoseconds.
///
/// The window leaves exp(−π W √(1 − 1/ratio)) of each wave; derivatives of aliases on the smallest
/// wave vectors weigh about a hundred times more. Test `operator_is_the_dense_mobility`.
pub(super) fn sampling<S: FarSpace>(
    lattice: &Lattice<S>,
    spheres: usize,
    cut_off: f64,
    tolerance: f64,
) -> (Sampling, f64) {
    let lengths = lattice.wave_lengths();
    let [of_window, of_point] = S::GRID_COSTS;
    let all = WIDTHS.map(|width| {
        let root = (ALIASING_GAIN / tolerance).ln() / (PI * width as f64);
        let ratio = (1.0 - root * root).max(0.1).recip().max(1.25);
        let sampling = Sampling { width, ratio };
        let points = lengths[..S::DIMENSIONS]
            .iter()
            .map(|&length| sampling.points(highest(length, cut_off)) as f64)
            .product::<f64>();
        let under = width.pow(if S::DIMENSIONS < 3 { 2 } else { 3 }) as f64;
        (
            sampling,
            of_window * under * spheres as f64 + of_point * points,
        )
    });
    all.into_iter()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or(all[0])
}

/// Points under a window that may be chosen, the largest first.
const WIDTHS: [usize; 3] = [12, 10, 8];

/// How much larger aliasing errors are in dipole entries of M than in others.
const ALIASING_GAIN: f64 = 200.0;

/// Dipole of a stresslet in components. In a layer, whose fluid moves as if incompressible in three
/// dimensions, a multiple of the identity is added that leaves none normal to the layer.
#[inline(always)]
fn dipole<S: FarSpace>(s: &[f64]) -> [[f64; 3]; 3] {
    let (sum, difference) = (s[2] / 6.0_f64.sqrt(), FRAC_1_SQRT_2 * s[0]);
    let [xy, xz, yz] = [s[1], s[3], s[4]].map(|x| FRAC_1_SQRT_2 * x);
    let normal = if S::DIMENSIONS < 3 { 2.0 * sum } else { 0.0 };
    [
        [sum + normal + difference, xy, xz],
        [xy, sum + normal - difference, yz],
        [xz, yz, normal - 2.0 * sum],
    ]
}

/// Dipole of a torque: `−ε_kbc T_k/2`.
#[inline(always)]
fn rotation([x, y, z]: [f64; 3]) -> [[f64; 3]; 3] {
    [
        [0.0, -0.5 * z, 0.5 * y],
        [0.5 * z, 0.0, -0.5 * x],
        [-0.5 * y, 0.5 * x, 0.0],
    ]
}

/// Components of the strain of a gradient `∂_c u_b`, by b and c.
#[inline(always)]
fn strain(g: &[[f64; 3]; 3]) -> [f64; 5] {
    [
        FRAC_1_SQRT_2 * (g[0][0] - g[1][1]),
        FRAC_1_SQRT_2 * (g[0][1] + g[1][0]),
        (g[0][0] + g[1][1] - 2.0 * g[2][2]) / 6.0_f64.sqrt(),
        FRAC_1_SQRT_2 * (g[0][2] + g[2][0]),
        FRAC_1_SQRT_2 * (g[1][2] + g[2][1]),
    ]
}

/// Transforms of two real fields a, b at k from those of a + ib at k and −k.
#[inline(always)]
fn split([re, im]: [f64; 2], [back_re, back_im]: [f64; 2]) -> [Complex64; 2] {
    [
        Complex64::new(0.5 * (re + back_re), 0.5 * (im - back_im)),
        Complex64::new(0.5 * (im + back_im), 0.5 * (back_re - re)),
    ]
}

/// Transforms of a + ib at k and −k from those of the two real fields a and b at k.
#[inline(always)]
fn pack([a, b]: [Complex64; 2]) -> [[f64; 2]; 2] {
    [[a.re - b.im, a.im + b.re], [a.re + b.im, b.re - a.im]]
}
