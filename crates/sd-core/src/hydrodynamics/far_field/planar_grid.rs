//! The long-ranged part of the periodic mobility applied to a vector, by fast Fourier transforms on
//! a grid in the plane.
//!
//! ```text
//! u(x_i) = Σ_k e^(ik·x_i) [G^ P + L^ Q],   v(x_i) = Σ_k e^(ik·x_i) L^ P,   L = ∇²G,   k ≠ 0
//! P(k) = Σ_j e^(−ik·x_j) f_j,   Q(k) the same with every mode times its κ a²;   f_j: force, and dipoles as −Q_bc ∂_c
//! velocity mode of i: read off u, plus κ a² times the same of v
//! ```
//! Sources are spread to the grid, and velocities are interpolated from it, by a Kaiser-Bessel
//! window in lattice coordinates, whose transform is divided out twice; dipoles and gradients use
//! the window's derivative. Reading is the transpose of writing, so the operator is symmetric to
//! rounding. The cost is that of four transforms and of N times the points under a window.

pub(super) mod axis;

use super::wave_space::transforms;
use crate::hydrodynamics::free_space::kernels::FiniteSize;
use crate::linalg::simd::vectorised;
use crate::space::cell::Lattice;
use crate::space::modes::Vec2;
use axis::{Axis, WIDTH, Window, highest, plan_axes};
use rustfft::num_complex::Complex64;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Rows of the grid transformed together.
const ROWS: usize = 4;

/// The wave part, planned for radii, a splitting parameter and a cut-off.
#[derive(Clone)]
pub(super) struct Grid {
    /// Splitting parameter α, in 1/a.
    alpha: f64,
    /// Largest |k|, in 1/a.
    cut_off: f64,
    /// Finite-size coefficients of each sphere.
    sizes: Vec<FiniteSize>,
    /// First and second lattice coordinate.
    axes: [Axis; 2],
    oversampling: f64,
    lattice: Option<Lattice>,
    windows: Vec<[Window; 2]>,
    /// `(b0, b1, b2)/area` over the windows' transforms, by (m ≥ 0, n), n wrapped as on the grid;
    /// zero beyond the cut-off.
    kernel: Vec<[f64; 3]>,
    /// `(P_x, P_y, Q_x, Q_y)`, then the same for u and v: rows of the second coordinate, each
    /// followed by its first points again.
    values: Vec<[f64; 4]>,
    /// P and Q as `f_x + i f_y`, then u and v, by wave numbers: rows of the first, 0 to `highest`,
    /// −`highest` to −1.
    columns: [Vec<Complex64>; 2],
    /// [`ROWS`] rows of P, then of Q.
    lines: Vec<Complex64>,
    /// Scratch of the transforms.
    scratch: Vec<Complex64>,
}

impl Grid {
    /// Makes a plan for a lattice and all that it becomes.
    ///
    /// `tolerance`: of M, relative to its largest entry.
    pub(super) fn new(
        lattice: &Lattice,
        sizes: &[FiniteSize],
        alpha: f64,
        cut_off: f64,
        tolerance: f64,
    ) -> Self {
        let oversampling = oversampling(tolerance);
        let [first, second, _] = lattice.wave_lengths();
        let (axes, scratch) = plan_axes([first, second], cut_off, oversampling);
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
            columns: Default::default(),
            lines: Vec::new(),
            scratch: Vec::new(),
        };
        grid.make_room(scratch);
        grid
    }

    /// Allocates the points of the axes and the scratch of the transforms.
    fn make_room(&mut self, scratch: usize) {
        let (points, rows) = (self.axes[0].points, self.axes[1].points);
        let zero = Complex64::new(0.0, 0.0);
        let kept = 2 * self.axes[0].highest + 1;
        self.kernel
            .resize((self.axes[0].highest + 1) * rows, [0.0; 3]);
        self.values.resize((points + WIDTH) * rows, [0.0; 4]);
        for columns in &mut self.columns {
            columns.resize(kept * rows, zero);
        }
        self.lines.resize(2 * ROWS * points, zero);
        self.scratch.resize(scratch, zero);
    }

    /// Number of points of the grid.
    #[cfg(test)]
    pub(super) fn points(&self) -> usize {
        self.axes[0].points * self.axes[1].points
    }

    /// Sets the lattice and the centres for the next applications.
    pub(super) fn update(&mut self, lattice: &Lattice, centres: &[Vec2]) {
        if self.lattice != Some(*lattice) {
            self.lattice = Some(*lattice);
            let [first, second, _] = lattice.wave_lengths();
            if !fit([first, second], self.cut_off, &self.axes) {
                let scratch;
                (self.axes, scratch) = plan_axes([first, second], self.cut_off, self.oversampling);
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
                    let [first, second, _] = lattice.coordinates(x);
                    windows.push([axes[0].window(first), axes[1].window(second)]);
                }
            },
        );
    }

    /// The transforms of the kernels on a lattice.
    fn fill_kernel(&mut self, lattice: &Lattice) {
        let area = lattice.content();
        self.kernel.fill([0.0; 3]);
        let points = self.axes[1].points;
        let highest = self.axes[1].highest.cast_signed();
        for m in 0..=self.axes[0].highest {
            for n in -highest..=highest {
                let k = wave(lattice, m, n as f64);
                let square = k.norm_squared();
                if square == 0.0 || square > self.cut_off * self.cut_off {
                    continue;
                }
                let window = self.axes[0].correction[m] * self.axes[1].correction[n.unsigned_abs()];
                self.kernel[m * points + self.axes[1].index(n)] =
                    transforms(k, self.alpha).map(|b| b * window * window / area);
            }
        }
    }

    /// Adds the wave part of `M x` to y; modes of each sphere as `(s1, s2, s3, F_x, F_y, T)` or
    /// `(e1, e2, e3, U_x, U_y, Ω)`.
    pub(super) fn add(&mut self, x: &[[f64; 6]], y: &mut [[f64; 6]]) {
        vectorised(
            #[inline(always)]
            || self.spread(x),
        );
        self.transform_forward();
        self.multiply();
        self.transform_back();
        vectorised(
            #[inline(always)]
            || self.read(y),
        );
    }

    /// Spreads the sources over the grid: P and Q there.
    #[inline(always)]
    fn spread(&mut self, x: &[[f64; 6]]) {
        self.values.fill([0.0; 4]);
        let Some(lattice) = &self.lattice else {
            return;
        };
        let d = slopes(lattice);
        let (columns, rows) = (self.axes[0].points, self.axes[1].points);
        let stride = columns + WIDTH;
        let spheres = self.windows.iter().zip(&self.sizes).zip(x);
        for (([along, across], size), &[s1, s2, s3, fx, fy, torque]) in spheres {
            let stress = dipole([s1, s2, s3]);
            let turn = [[0.0, -0.5 * torque], [0.5 * torque, 0.0]];
            // Weights of the window, and of its derivatives by X and by Y.
            let (mut value, mut by_x, mut by_y) = ([0.0_f64; 4], [0.0_f64; 4], [0.0_f64; 4]);
            for b in 0..2 {
                let force = [fx, fy][b];
                let total = [0, 1].map(|c| stress[b][c] + turn[b][c]);
                value[b] = force;
                by_x[b] = -(total[0] * d[0].x + total[1] * d[0].y);
                by_y[b] = -total[1] * d[1].y - total[0] * d[1].x;
                value[2 + b] = size.force * force;
                by_x[2 + b] = -size.stresslet * (stress[b][0] * d[0].x + stress[b][1] * d[0].y);
                by_y[2 + b] = -size.stresslet * stress[b][1] * d[1].y
                    - size.stresslet * stress[b][0] * d[1].x;
            }
            for r in 0..WIDTH {
                let start = (across.first + r) % rows * stride + along.first;
                let (v, s) = (across.values[r], across.slopes[r]);
                let by_value: [f64; 4] = std::array::from_fn(|k| v.mul_add(value[k], s * by_y[k]));
                let by_slope = by_x.map(|weight| weight * v);
                let points = &mut self.values[start..start + WIDTH];
                for (c, point) in points.iter_mut().enumerate() {
                    let (v, s) = (along.values[c], along.slopes[c]);
                    for k in 0..4 {
                        point[k] = by_value[k].mul_add(v, by_slope[k].mul_add(s, point[k]));
                    }
                }
            }
        }
        for row in self.values.chunks_exact_mut(stride) {
            let (row, beyond) = row.split_at_mut(columns);
            for (point, beyond) in row.iter_mut().zip(beyond) {
                for k in 0..4 {
                    point[k] += beyond[k];
                }
            }
        }
    }

    /// Transforms both fields to wave numbers; of the first coordinate only the wave numbers that
    /// are kept.
    fn transform_forward(&mut self) {
        let Self {
            axes,
            values,
            columns,
            lines,
            scratch,
            ..
        } = self;
        let (points, rows) = (axes[0].points, axes[1].points);
        let stride = points + WIDTH;
        for (block, values) in values.chunks(ROWS * stride).enumerate() {
            for (b, row) in values.chunks_exact(stride).enumerate() {
                for (field, half) in lines.chunks_exact_mut(ROWS * points).enumerate() {
                    let line = &mut half[b * points..(b + 1) * points];
                    for (value, point) in line.iter_mut().zip(row) {
                        *value = Complex64::new(point[2 * field], point[2 * field + 1]);
                    }
                }
            }
            axes[0].plans[0].process_with_scratch(lines, scratch);
            let count = values.len() / stride;
            for (half, column) in lines.chunks_exact(ROWS * points).zip(&mut *columns) {
                for (kept, column) in column.chunks_exact_mut(rows).enumerate() {
                    let at = grid_row(kept, axes[0].highest, points);
                    let place = &mut column[block * ROWS..block * ROWS + count];
                    for (value, line) in place.iter_mut().zip(half.chunks_exact(points)) {
                        *value = line[at];
                    }
                }
            }
        }
        for column in columns {
            axes[1].plans[0].process_with_scratch(column, scratch);
        }
    }

    /// Transforms both fields back from wave numbers to the points of the grid.
    fn transform_back(&mut self) {
        let Self {
            axes,
            values,
            columns,
            lines,
            scratch,
            ..
        } = self;
        let (points, rows) = (axes[0].points, axes[1].points);
        let stride = points + WIDTH;
        for column in &mut *columns {
            axes[1].plans[1].process_with_scratch(column, scratch);
        }
        for (block, values) in values.chunks_mut(ROWS * stride).enumerate() {
            lines.fill(Complex64::new(0.0, 0.0));
            let count = values.len() / stride;
            for (half, column) in lines.chunks_exact_mut(ROWS * points).zip(&*columns) {
                for (kept, column) in column.chunks_exact(rows).enumerate() {
                    let at = grid_row(kept, axes[0].highest, points);
                    let place = &column[block * ROWS..block * ROWS + count];
                    for (value, line) in place.iter().zip(half.chunks_exact_mut(points)) {
                        line[at] = *value;
                    }
                }
            }
            axes[0].plans[1].process_with_scratch(lines, scratch);
            let (u, v) = lines.split_at(ROWS * points);
            for (b, row) in values.chunks_exact_mut(stride).enumerate() {
                let (u, v) = (
                    &u[b * points..(b + 1) * points],
                    &v[b * points..(b + 1) * points],
                );
                for ((point, u), v) in row.iter_mut().zip(u).zip(v) {
                    *point = [u.re, u.im, v.re, v.im];
                }
                row.copy_within(..WIDTH, points);
            }
        }
    }

    /// Computes u and v of every wave vector from P and Q.
    fn multiply(&mut self) {
        let Some(lattice) = self.lattice else {
            return;
        };
        let rows = self.axes[1].points;
        let highest = self.axes[0].highest;
        let [p, q] = &mut self.columns;
        let zero = Complex64::new(0.0, 0.0);
        for m in 0..=highest {
            let opposite = if m == 0 { 0 } else { 2 * highest + 1 - m };
            for at in 0..rows {
                let (here, there) = (m * rows + at, opposite * rows + (rows - at) % rows);
                // At m = 0 each pair of wave vectors k, −k occurs twice.
                if m == 0 && here > there {
                    continue;
                }
                let [b0, b1, b2] = self.kernel[here];
                if b2 == 0.0 {
                    for field in [&mut *p, &mut *q] {
                        field[here] = zero;
                        field[there] = zero;
                    }
                    continue;
                }
                let n = if at > rows / 2 {
                    at as f64 - rows as f64
                } else {
                    at as f64
                };
                let k = wave(&lattice, m, n);
                let [source, sized] = [&*p, &*q].map(|field| split(field[here], field[there]));
                let along = |v: [Complex64; 2]| v[0] * k.x + v[1] * k.y;
                let (kp, kq) = (along(source), along(sized));
                let shear = kp * b0 - kq * b1;
                let u = [
                    sized[0] * b2 - source[0] * b1 + shear * k.x,
                    sized[1] * b2 - source[1] * b1 + shear * k.y,
                ];
                let v = [
                    source[0] * b2 - kp * (b1 * k.x),
                    source[1] * b2 - kp * (b1 * k.y),
                ];
                for (field, values) in [(&mut *p, u), (&mut *q, v)] {
                    [field[here], field[there]] = pack(values);
                }
            }
        }
    }

    /// Adds the modes of each sphere read off u and v: the transpose of [`Grid::spread`].
    #[inline(always)]
    fn read(&self, y: &mut [[f64; 6]]) {
        let Some(lattice) = &self.lattice else {
            return;
        };
        let d = slopes(lattice);
        let (columns, rows) = (self.axes[0].points, self.axes[1].points);
        let stride = columns + WIDTH;
        let spheres = self.windows.iter().zip(&self.sizes).zip(y);
        for (([along, across], size), y) in spheres {
            // Of u and v: value, and derivatives of the window by X and by Y.
            let (mut value, mut by_x, mut by_y) = ([0.0_f64; 4], [0.0_f64; 4], [0.0_f64; 4]);
            for r in 0..WIDTH {
                let start = (across.first + r) % rows * stride + along.first;
                let (mut by_value, mut by_slope) = ([0.0_f64; 4], [0.0_f64; 4]);
                let points = &self.values[start..start + WIDTH];
                for (c, point) in points.iter().enumerate() {
                    let (v, s) = (along.values[c], along.slopes[c]);
                    for k in 0..4 {
                        by_value[k] = point[k].mul_add(v, by_value[k]);
                        by_slope[k] = point[k].mul_add(s, by_slope[k]);
                    }
                }
                let (v, s) = (across.values[r], across.slopes[r]);
                for k in 0..4 {
                    value[k] = by_value[k].mul_add(v, value[k]);
                    by_x[k] = by_slope[k].mul_add(v, by_x[k]);
                    by_y[k] = by_value[k].mul_add(s, by_y[k]);
                }
            }
            // ∂ of the centre is minus that of the grid point.
            let [dx, dy]: [[f64; 4]; 2] = std::array::from_fn(|c| {
                std::array::from_fn(|k| -(by_x[k] * d[0][c] + by_y[k] * d[1][c]))
            });
            let strain = |k: usize| {
                [
                    FRAC_1_SQRT_2 * (dx[k] - dy[k + 1]),
                    FRAC_1_SQRT_2 * (dx[k + 1] + dy[k]),
                    1.5_f64.sqrt() * (dx[k] + dy[k + 1]),
                ]
            };
            let (own, sized) = (strain(0), strain(2));
            for k in 0..3 {
                y[k] += own[k] + size.stresslet * sized[k];
            }
            y[3] += value[0] + size.force * value[2];
            y[4] += value[1] + size.force * value[3];
            y[5] += 0.5 * (dx[1] - dy[0]);
        }
    }
}

/// Wave vector of wave numbers (m, n).
fn wave(lattice: &Lattice, m: usize, n: f64) -> Vec2 {
    let (m, [length_x, length_y, _]) = (m as f64, lattice.lengths_in_frame());
    let across = 2.0 * PI / length_y * (n - m * lattice.offset() / length_x);
    lattice.out_of_frame([2.0 * PI * m / length_x, across, 0.0])
}

/// Gradients of the two lattice coordinates.
fn slopes(lattice: &Lattice) -> [Vec2; 2] {
    let [length_x, length_y, _] = lattice.lengths_in_frame();
    let across = -lattice.offset() / (length_x * length_y);
    [
        lattice.out_of_frame([length_x.recip(), across, 0.0]),
        lattice.out_of_frame([0.0, length_y.recip(), 0.0]),
    ]
}

/// Whether the axes are those that wave vectors up to `cut_off` need, of these lengths of the
/// lattice vectors.
pub(super) fn fit<const DIMENSIONS: usize>(
    lengths: [f64; DIMENSIONS],
    cut_off: f64,
    axes: &[Axis; DIMENSIONS],
) -> bool {
    (0..DIMENSIONS).all(|k| axes[k].highest == highest(lengths[k], cut_off))
}

/// Grid points over wave numbers that keep the window's errors below a tolerance of M.
///
/// The window leaves exp(−π WIDTH √(1 − 1/oversampling)) of each wave; derivatives of aliases on
/// the smallest wave vectors weigh about a hundred times more. Test
/// `operator_is_the_dense_mobility`.
pub(super) fn oversampling(tolerance: f64) -> f64 {
    let root = (FOLDED / tolerance).ln() / (PI * WIDTH as f64);
    (1.0 - root * root).max(0.25).recip().max(1.25)
}

/// Amplification of the window's errors in dipole entries of M relative to others.
const FOLDED: f64 = 200.0;

/// Grid index of a line of kept wave numbers: 0 to `highest`, then −`highest` to −1.
fn grid_row(line: usize, highest: usize, points: usize) -> usize {
    if line <= highest {
        line
    } else {
        points + line - (2 * highest + 1)
    }
}

/// Dipole of a stresslet.
fn dipole(s: [f64; 3]) -> [[f64; 2]; 2] {
    let sum = 1.5_f64.sqrt() * s[2];
    let difference = FRAC_1_SQRT_2 * s[0];
    let off = FRAC_1_SQRT_2 * s[1];
    [[sum + difference, off], [off, sum - difference]]
}

/// Transforms of two real fields a, b at k from those of a + ib at k and −k.
pub(super) fn split(here: Complex64, there: Complex64) -> [Complex64; 2] {
    let (sum, difference) = (here + there.conj(), here - there.conj());
    [
        sum * 0.5,
        Complex64::new(difference.im, -difference.re) * 0.5,
    ]
}

/// Transforms of a + ib at k and −k from those of the two real fields a and b at k.
pub(super) fn pack([a, b]: [Complex64; 2]) -> [Complex64; 2] {
    [
        Complex64::new(a.re - b.im, a.im + b.re),
        Complex64::new(a.re + b.im, b.re - a.im),
    ]
}
