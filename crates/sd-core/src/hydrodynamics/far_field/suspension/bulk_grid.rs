//! The long-ranged part of a suspension's mobility applied to a vector, by fast Fourier transforms
//! on a grid in the sheared cell.
//!
//! ```text
//! u(x_i) = Σ_k e^(ik·x_i) G^ (P − k² Q),   v(x_i) = −Σ_k e^(ik·x_i) G^ k² P,   G^ = γ (I − kk/k²),   k ≠ 0
//! P(k) = Σ_j e^(−ik·x_j) f_j,   Q(k) the same with every mode times its κ a²;   f_j: force, and dipoles as −Q_bc ∂_c
//! velocity mode of i: read off u, plus κ a² times the same of v
//! ```
//! Window, its transform and its derivative are those of the layer's grid; reading is the transpose
//! of writing.

use super::dense_mobility::transform;
use crate::hydrodynamics::far_field::planar_grid::axis::{Axis, WIDTH, Window, plan_axes};
use crate::hydrodynamics::far_field::planar_grid::{fit, oversampling, pack, split};
use crate::hydrodynamics::free_space::coupling::Modes;
use crate::hydrodynamics::free_space::kernels::FiniteSize;
use crate::linalg::simd::vectorised;
use crate::space::Bulk;
use crate::space::cell::Lattice;
use nalgebra::Vector3;
use rustfft::num_complex::Complex64;
use std::f64::consts::FRAC_1_SQRT_2;

/// Lines of the grid transformed together.
const LINES: usize = 8;

/// The wave part, planned for radii, a splitting parameter and a cut-off.
pub(super) struct Grid {
    /// Splitting parameter α, in 1/a.
    alpha: f64,
    /// Largest |k|, in 1/a.
    cut_off: f64,
    sizes: Vec<FiniteSize>,
    oversampling: f64,
    /// The three lattice coordinates.
    axes: [Axis; 3],
    lattice: Option<Lattice<Bulk>>,
    windows: Vec<[Window; 3]>,
    /// γ over the windows' transforms; zero beyond the cut-off.
    kernel: Vec<f64>,
    /// `P + iQ`, then `u + iv`, three components a point; the first coordinate runs fastest.
    values: Vec<[Complex64; 3]>,
    /// Starts of the lines that are transformed along an axis.
    starts: Vec<usize>,
    /// Lines being transformed.
    lines: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl Grid {
    /// Makes a plan for a lattice and all that it becomes; `tolerance`: of M, relative to its
    /// largest entry.
    pub(super) fn new(
        lattice: &Lattice<Bulk>,
        sizes: &[FiniteSize],
        alpha: f64,
        cut_off: f64,
        tolerance: f64,
    ) -> Self {
        let oversampling = oversampling(tolerance);
        let (axes, scratch) = plan_axes(lattice.wave_lengths(), cut_off, oversampling);
        let mut grid = Self {
            alpha,
            cut_off,
            sizes: sizes.to_vec(),
            oversampling,
            axes,
            lattice: None,
            windows: Vec::with_capacity(sizes.len()),
            kernel: Vec::new(),
            values: Vec::new(),
            starts: Vec::new(),
            lines: Vec::new(),
            scratch: Vec::new(),
        };
        grid.make_room(scratch);
        grid
    }

    /// Allocates the points of the axes and the scratch of the transforms.
    fn make_room(&mut self, scratch: usize) {
        let points = self.axes.iter().map(|axis| axis.points).product();
        let longest = self.axes.iter().map(|axis| axis.points).max().unwrap_or(0);
        let zero = Complex64::new(0.0, 0.0);
        self.kernel.resize(points, 0.0);
        self.values.resize(points, [zero; 3]);
        self.lines.resize(3 * LINES * longest, zero);
        self.scratch.resize(scratch, zero);
    }

    /// Sets the lattice and the centres for the next applications.
    pub(super) fn update(&mut self, lattice: &Lattice<Bulk>, centres: &[Vector3<f64>]) {
        if self.lattice != Some(*lattice) {
            self.lattice = Some(*lattice);
            // The plan depends only on the lattice, not on earlier ones, so a resumed run has the
            // same bits.
            let lengths = lattice.wave_lengths();
            if !fit(lengths, self.cut_off, &self.axes) {
                let scratch;
                (self.axes, scratch) = plan_axes(lengths, self.cut_off, self.oversampling);
                self.make_room(scratch);
            }
            self.fill_kernel(lattice);
        }
        let Self { windows, axes, .. } = self;
        windows.clear();
        vectorised(
            #[inline(always)]
            || {
                for x in centres {
                    let coordinates = lattice.coordinates(x);
                    windows.push([0, 1, 2].map(|k| axes[k].window(coordinates[k])));
                }
            },
        );
    }

    /// Calls `visit` with the index of every kept wave vector, that of its opposite, and the wave
    /// vector, once per pair.
    fn for_waves(
        &self,
        lattice: &Lattice<Bulk>,
        mut visit: impl FnMut(usize, usize, Vector3<f64>, [usize; 3]),
    ) {
        let highest = [0, 1, 2].map(|k| self.axes[k].highest.cast_signed());
        let place = |m: isize, n: isize, l: isize| {
            let [x, y, z] =
                [(0, m), (1, n), (2, l)].map(|(axis, wave)| self.axes[axis].index(wave));
            (z * self.axes[1].points + y) * self.axes[0].points + x
        };
        for l in -highest[2]..=highest[2] {
            for n in -highest[1]..=highest[1] {
                for m in 0..=highest[0] {
                    if m == 0 && (n, l) <= (0, 0) {
                        continue;
                    }
                    let k = lattice.wave_vector([m, n, l].map(|x| x as f64));
                    if k.norm_squared() <= self.cut_off * self.cut_off {
                        let numbers = [m, n, l].map(isize::unsigned_abs);
                        visit(place(m, n, l), place(-m, -n, -l), k, numbers);
                    }
                }
            }
        }
    }

    /// The transforms of the kernel on a lattice.
    fn fill_kernel(&mut self, lattice: &Lattice<Bulk>) {
        let mut kernel = std::mem::take(&mut self.kernel);
        kernel.fill(0.0);
        let volume = lattice.content();
        self.for_waves(lattice, |here, there, k, numbers| {
            let window: f64 = (0..3)
                .map(|axis| self.axes[axis].correction[numbers[axis]])
                .product();
            let value = transform(k.norm_squared(), self.alpha) * window * window / volume;
            [kernel[here], kernel[there]] = [value; 2];
        });
        self.kernel = kernel;
    }

    /// Adds the wave part of `M x` to y.
    pub(super) fn add(&mut self, x: &[Modes], y: &mut [Modes]) {
        vectorised(
            #[inline(always)]
            || self.spread(x),
        );
        for axis in 0..3 {
            self.transform_axis(axis, 0);
        }
        self.multiply();
        for axis in (0..3).rev() {
            self.transform_axis(axis, 1);
        }
        vectorised(
            #[inline(always)]
            || self.read(y),
        );
    }

    /// Derivatives of the lattice coordinates: row c holds the components of `∂_c` along
    /// `∂_X, ∂_Y, ∂_Z`.
    fn slopes(&self) -> [[f64; 3]; 3] {
        let Some(lattice) = &self.lattice else {
            return [[0.0; 3]; 3];
        };
        let reciprocal = lattice.reciprocal();
        [0, 1, 2].map(|c| reciprocal.map(|b| b[c]))
    }

    /// Spreads the sources over the grid.
    #[inline(always)]
    fn spread(&mut self, x: &[Modes]) {
        self.values.fill([Complex64::new(0.0, 0.0); 3]);
        let slopes = self.slopes();
        let counts = [0, 1, 2].map(|k| self.axes[k].points);
        for ((windows, size), modes) in self.windows.iter().zip(&self.sizes).zip(x) {
            let stress = dipole(&modes[6..]);
            let turn = rotation([modes[3], modes[4], modes[5]]);
            // Weights of the window, and of its derivatives by the lattice coordinates; P and Q of
            // each component in turn.
            let mut value = [0.0_f64; 6];
            let mut by = [[0.0_f64; 6]; 3];
            for b in 0..3 {
                value[2 * b] = modes[b];
                value[2 * b + 1] = size.force * modes[b];
                for (c, slopes) in slopes.iter().enumerate() {
                    for (by, slope) in by.iter_mut().zip(slopes) {
                        by[2 * b] -= (stress[b][c] + turn[b][c]) * slope;
                        by[2 * b + 1] -= size.stresslet * stress[b][c] * slope;
                    }
                }
            }
            let [along, across, up] = windows;
            for p in 0..WIDTH {
                let plane = (up.first + p) % counts[2] * counts[1];
                let (vz, sz) = (up.values[p], up.slopes[p]);
                for r in 0..WIDTH {
                    let row = (plane + (across.first + r) % counts[1]) * counts[0];
                    let (vy, sy) = (across.values[r], across.slopes[r]);
                    let by_value: [f64; 6] = std::array::from_fn(|k| {
                        vz * (vy * value[k] + sy * by[1][k]) + sz * vy * by[2][k]
                    });
                    let by_slope = by[0].map(|weight| weight * vy * vz);
                    let row = &mut self.values[row..row + counts[0]];
                    let (beyond, before) = row.split_at_mut(along.first);
                    // Up to the edge of the grid, then wrapped to the other edge.
                    let edge = before.len().min(WIDTH);
                    for (from, points) in [(0, before), (edge, beyond)] {
                        let window = along.values[from..].iter().zip(&along.slopes[from..]);
                        for (point, (&v, &s)) in points.iter_mut().zip(window) {
                            for (k, point) in point.iter_mut().enumerate() {
                                let (re, im) = (2 * k, 2 * k + 1);
                                point.re =
                                    by_slope[re].mul_add(s, by_value[re].mul_add(v, point.re));
                                point.im =
                                    by_slope[im].mul_add(s, by_value[im].mul_add(v, point.im));
                            }
                        }
                    }
                }
            }
        }
    }

    /// Transforms along an axis, forward (0) or back (1), the lines that hold kept waves of the
    /// axes before it: those after it hold points.
    fn transform_axis(&mut self, axis: usize, direction: usize) {
        let Self {
            axes,
            values,
            starts,
            lines,
            scratch,
            ..
        } = self;
        let strides = [1, axes[0].points, axes[0].points * axes[1].points];
        let [inner, outer] = [[1, 2], [0, 2], [0, 1]][axis];
        let places = |other: usize| {
            let Axis {
                points, highest, ..
            } = axes[other];
            let is_kept = move |&at: &usize| other > axis || at.min(points - at) <= highest;
            (0..points).filter(is_kept)
        };
        starts.clear();
        for second in places(outer) {
            starts.extend(places(inner).map(|k| k * strides[inner] + second * strides[outer]));
        }
        let (length, stride) = (axes[axis].points, strides[axis]);
        for starts in starts.chunks(LINES) {
            let work = &mut lines[..3 * starts.len() * length];
            for (line, &start) in work.chunks_exact_mut(3 * length).zip(starts) {
                let (first, rest) = line.split_at_mut(length);
                let (second, third) = rest.split_at_mut(length);
                let points = values[start..].iter().step_by(stride);
                for (((point, a), b), c) in points.zip(first).zip(second).zip(third) {
                    [*a, *b, *c] = *point;
                }
            }
            axes[axis].plans[direction].process_with_scratch(work, scratch);
            for (line, &start) in work.chunks_exact(3 * length).zip(starts) {
                let (first, rest) = line.split_at(length);
                let (second, third) = rest.split_at(length);
                let points = values[start..].iter_mut().step_by(stride);
                for (((point, a), b), c) in points.zip(first).zip(second).zip(third) {
                    *point = [*a, *b, *c];
                }
            }
        }
    }

    /// Computes u and v of every wave vector from P and Q.
    fn multiply(&mut self) {
        let Some(lattice) = self.lattice else {
            return;
        };
        let mut values = std::mem::take(&mut self.values);
        for (value, &gamma) in values.iter_mut().zip(&self.kernel) {
            if gamma == 0.0 {
                *value = [Complex64::new(0.0, 0.0); 3];
            }
        }
        self.for_waves(&lattice, |here, there, k, _| {
            let gamma = self.kernel[here];
            let square = k.norm_squared();
            let fields = [0, 1, 2].map(|c| split(values[here][c], values[there][c]));
            let project = |v: [Complex64; 3]| {
                let along = (v[0] * k.x + v[1] * k.y + v[2] * k.z) / square;
                [0, 1, 2].map(|c| (v[c] - along * k[c]) * gamma)
            };
            let u = project(fields.map(|[p, q]| p - q * square));
            let v = project(fields.map(|[p, _]| -p * square));
            for c in 0..3 {
                [values[here][c], values[there][c]] = pack([u[c], v[c]]);
            }
        });
        self.values = values;
    }

    /// Adds the modes of each sphere read off u and v: the transpose of [`Grid::spread`].
    #[inline(always)]
    fn read(&self, y: &mut [Modes]) {
        let slopes = self.slopes();
        let counts = [0, 1, 2].map(|k| self.axes[k].points);
        for (([along, across, up], size), y) in self.windows.iter().zip(&self.sizes).zip(y) {
            let mut value = [0.0_f64; 6];
            let mut by = [[0.0_f64; 6]; 3];
            for p in 0..WIDTH {
                let plane = (up.first + p) % counts[2] * counts[1];
                let (vz, sz) = (up.values[p], up.slopes[p]);
                for r in 0..WIDTH {
                    let row = (plane + (across.first + r) % counts[1]) * counts[0];
                    let (vy, sy) = (across.values[r], across.slopes[r]);
                    let (mut by_value, mut by_slope) = ([0.0_f64; 6], [0.0_f64; 6]);
                    let row = &self.values[row..row + counts[0]];
                    let (beyond, before) = row.split_at(along.first);
                    let edge = before.len().min(WIDTH);
                    for (from, points) in [(0, before), (edge, beyond)] {
                        let window = along.values[from..].iter().zip(&along.slopes[from..]);
                        for (point, (&v, &s)) in points.iter().zip(window) {
                            for (k, point) in point.iter().enumerate() {
                                let (re, im) = (2 * k, 2 * k + 1);
                                by_value[re] = point.re.mul_add(v, by_value[re]);
                                by_value[im] = point.im.mul_add(v, by_value[im]);
                                by_slope[re] = point.re.mul_add(s, by_slope[re]);
                                by_slope[im] = point.im.mul_add(s, by_slope[im]);
                            }
                        }
                    }
                    for k in 0..6 {
                        value[k] += vy * vz * by_value[k];
                        by[0][k] += vy * vz * by_slope[k];
                        by[1][k] += sy * vz * by_value[k];
                        by[2][k] += vy * sz * by_value[k];
                    }
                }
            }
            // Gradients of u and v by component and direction; ∂ of the centre is minus that of the
            // grid point.
            let gradient = |field: usize| {
                [0, 1, 2].map(|b| {
                    slopes.map(|slopes| {
                        -(0..3)
                            .map(|axis| by[axis][2 * b + field] * slopes[axis])
                            .sum::<f64>()
                    })
                })
            };
            let (of_u, of_v) = (gradient(0), gradient(1));
            let (own, sized) = (strain(&of_u), strain(&of_v));
            for b in 0..3 {
                y[b] += value[2 * b] + size.force * value[2 * b + 1];
                let (c, d) = ((b + 1) % 3, (b + 2) % 3);
                y[3 + b] += 0.5 * (of_u[d][c] - of_u[c][d]);
            }
            for k in 0..5 {
                y[6 + k] += own[k] + size.stresslet * sized[k];
            }
        }
    }
}

/// Dipole of a stresslet in components.
fn dipole(s: &[f64]) -> [[f64; 3]; 3] {
    let (sum, difference) = (s[2] / 6.0_f64.sqrt(), FRAC_1_SQRT_2 * s[0]);
    let [xy, xz, yz] = [s[1], s[3], s[4]].map(|x| FRAC_1_SQRT_2 * x);
    [
        [sum + difference, xy, xz],
        [xy, sum - difference, yz],
        [xz, yz, -2.0 * sum],
    ]
}

/// Dipole of a torque: `−ε_kbc T_k/2`.
fn rotation([x, y, z]: [f64; 3]) -> [[f64; 3]; 3] {
    [
        [0.0, -0.5 * z, 0.5 * y],
        [0.5 * z, 0.0, -0.5 * x],
        [-0.5 * y, 0.5 * x, 0.0],
    ]
}

/// Components of the strain of a gradient `∂_c u_b`, by b and c.
fn strain(g: &[[f64; 3]; 3]) -> [f64; 5] {
    [
        FRAC_1_SQRT_2 * (g[0][0] - g[1][1]),
        FRAC_1_SQRT_2 * (g[0][1] + g[1][0]),
        (g[0][0] + g[1][1] - 2.0 * g[2][2]) / 6.0_f64.sqrt(),
        FRAC_1_SQRT_2 * (g[0][2] + g[2][0]),
        FRAC_1_SQRT_2 * (g[1][2] + g[2][1]),
    ]
}
