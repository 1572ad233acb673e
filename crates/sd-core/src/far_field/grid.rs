//! The long-ranged part of the periodic mobility applied to a vector, by fast Fourier transforms on a grid in the plane.
//!
//! ```text
//! u(x_i) = Σ_k e^(ik·x_i) [G^ P + L^ Q],   v(x_i) = Σ_k e^(ik·x_i) L^ P,   L = ∇²G,   k ≠ 0
//! P(k) = Σ_j e^(−ik·x_j) f_j,   Q(k) the same with every mode times its κ a²;   f_j: force, and dipoles as −Q_bc ∂_c
//! velocity mode of i: read off u, plus κ a² times the same of v
//! ```
//! Sources go to the grid, and velocities come from it, through a Kaiser-Bessel window in lattice coordinates, whose transform is
//! divided out twice; dipoles and gradients go through the window's derivative. Reading is the transpose of writing, so the
//! operator is symmetric to rounding. The cost is that of four transforms and of N times the points under a window.

use super::kernels::FiniteSize;
use super::wave_space::transforms;
use crate::cell::Cell;
use crate::modes::Vec2;
use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::sync::Arc;

/// Points under the window along each coordinate.
const WIDTH: usize = 12;
/// Grid points over the wave numbers kept, at least.
const OVERSAMPLING: f64 = 1.5;

/// The window of one sphere along one coordinate: first grid point, values, derivatives by the lattice coordinate.
#[derive(Debug, Clone, Copy)]
struct Window {
    /// First grid point; the next ones follow, wrapped.
    first: usize,
    /// Values of the window.
    values: [f64; WIDTH],
    /// Derivatives with respect to the grid point's lattice coordinate.
    slopes: [f64; WIDTH],
}

/// One lattice direction of the grid.
#[derive(Clone)]
struct Axis {
    /// Grid points.
    points: usize,
    /// Largest wave number kept.
    highest: usize,
    /// Shape parameter of the window.
    shape: f64,
    /// One over the window's transform, by wave number ≥ 0.
    correction: Vec<f64>,
    /// Transforms along the axis, forward and back.
    plans: [Arc<dyn Fft<f64>>; 2],
}

impl Axis {
    /// Wave numbers up to `highest` on a grid that is large enough and easily transformed.
    fn new(highest: usize, planner: &mut FftPlanner<f64>) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a grid fits the memory"
        )]
        let least = (OVERSAMPLING * (2 * highest + 1) as f64).ceil() as usize;
        let points = regular(least.max(2 * WIDTH));
        let ratio = points as f64 / (2 * highest + 1) as f64;
        // Beatty, Nishimura & Pauly 2005, eq. (5).
        let scaled = WIDTH as f64 / ratio * (ratio - 0.5);
        let shape = PI * (scaled * scaled - 0.8).sqrt();
        let correction = (0..=highest)
            .map(|m| {
                let argument = PI * m as f64 / points as f64 * WIDTH as f64;
                let root = (shape * shape - argument * argument).sqrt();
                bessel(shape)[0] * root / (WIDTH as f64 * root.sinh())
            })
            .collect();
        Self {
            points,
            highest,
            shape,
            correction,
            plans: [
                planner.plan_fft_forward(points),
                planner.plan_fft_inverse(points),
            ],
        }
    }

    /// The window around a lattice coordinate.
    fn window(&self, coordinate: f64) -> Window {
        let points = self.points as f64;
        let position = (coordinate - coordinate.floor()) * points;
        let half = 0.5 * WIDTH as f64;
        let start = (position - half).ceil();
        let (mut values, mut slopes) = ([0.0; WIDTH], [0.0; WIDTH]);
        let scale = bessel(self.shape)[0].recip();
        for k in 0..WIDTH {
            let z = (start + k as f64 - position) / half;
            let root = (1.0 - z * z).max(0.0).sqrt();
            let [i0, i1] = bessel(self.shape * root);
            values[k] = scale * i0;
            slopes[k] = -scale * points / half * self.shape * self.shape * z * i1;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "wrapped to a grid point"
        )]
        let first = start.rem_euclid(points) as usize % self.points;
        Window {
            first,
            values,
            slopes,
        }
    }

    /// Grid index of a wave number of either sign.
    fn index(&self, wave: isize) -> usize {
        wave.rem_euclid(self.points.cast_signed()).cast_unsigned()
    }
}

/// `I₀(x)` and `I₁(x)/x` by their power series.
fn bessel(x: f64) -> [f64; 2] {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum, mut sum_1) = (1.0, 0.0, 0.0);
    let mut k = 0.0;
    while term > 1e-17 * sum {
        sum += term;
        sum_1 += term / (2.0 * (k + 1.0));
        k += 1.0;
        term *= quarter / (k * k);
    }
    [sum, sum_1]
}

/// The least even number, at least `least`, without prime factors above 5.
fn regular(least: usize) -> usize {
    let smooth = |mut n: usize| {
        for factor in [2, 3, 5] {
            while n.is_multiple_of(factor) {
                n /= factor;
            }
        }
        n == 1
    };
    let mut n = least.next_multiple_of(2);
    while !smooth(n) {
        n += 2;
    }
    n
}

/// The wave part, planned for a cell's sides, radii, splitting parameter and cut-off.
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
    /// Cell as `(length_x, length_y, offset)`.
    cell: [f64; 3],
    /// Windows of each sphere.
    windows: Vec<[Window; 2]>,
    /// `(b0, b1, b2)/area` over the windows' transforms, by (m ≥ 0, n), n wrapped as on the grid; zero beyond the cut-off.
    kernel: Vec<[f64; 3]>,
    /// P and Q as `f_x + i f_y`, then u and v: rows of the second coordinate.
    fields: [Vec<Complex64>; 2],
    /// The same after the first transform: rows of the first wave number, 0 to `highest`, −`highest` to −1.
    columns: [Vec<Complex64>; 2],
    /// Scratch of the transforms.
    scratch: Vec<Complex64>,
}

impl Grid {
    /// Plans for a cell's sides; any offset.
    pub(super) fn new(sides: [f64; 2], sizes: &[FiniteSize], alpha: f64, cut_off: f64) -> Self {
        let mut planner = FftPlanner::new();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "as many as the plan allows"
        )]
        let highest = |side: f64| (cut_off * side / (2.0 * PI)).floor() as usize;
        let first = highest(sides[0]);
        // The second wave number counts from m times the offset, which is at most half a side.
        let second = highest(sides[1]) + first.div_ceil(2);
        let axes = [first, second].map(|highest| Axis::new(highest, &mut planner));
        let points = axes[0].points * axes[1].points;
        let rows = 2 * first + 1;
        let zero = Complex64::new(0.0, 0.0);
        let scratch = axes
            .iter()
            .flat_map(|axis| axis.plans.iter().map(|plan| plan.get_inplace_scratch_len()))
            .max()
            .unwrap_or(0);
        Self {
            alpha,
            cut_off,
            sizes: sizes.to_vec(),
            cell: [0.0; 3],
            windows: Vec::with_capacity(sizes.len()),
            kernel: vec![[0.0; 3]; (first + 1) * axes[1].points],
            fields: [vec![zero; points], vec![zero; points]],
            columns: [
                vec![zero; rows * axes[1].points],
                vec![zero; rows * axes[1].points],
            ],
            scratch: vec![zero; scratch],
            axes,
        }
    }

    /// Grid points in all.
    pub(super) fn points(&self) -> usize {
        self.axes[0].points * self.axes[1].points
    }

    /// Takes cell and centres of the next applications.
    pub(super) fn update(&mut self, cell: &Cell, centres: &[Vec2]) {
        let Cell::Periodic {
            length_x,
            length_y,
            offset,
        } = *cell
        else {
            return;
        };
        if self.cell != [length_x, length_y, offset] {
            self.cell = [length_x, length_y, offset];
            self.fill_kernel();
        }
        self.windows.clear();
        for x in centres {
            let second = x.y / length_y;
            let first = (x.x - second * offset) / length_x;
            self.windows
                .push([self.axes[0].window(first), self.axes[1].window(second)]);
        }
    }

    /// Wave vector of wave numbers (m, n).
    fn wave(&self, m: isize, n: isize) -> Vec2 {
        let [length_x, length_y, offset] = self.cell;
        let (m, n) = (m as f64, n as f64);
        Vec2::new(
            2.0 * PI * m / length_x,
            2.0 * PI / length_y * (n - m * offset / length_x),
        )
    }

    /// The transforms of the kernels at this cell.
    fn fill_kernel(&mut self) {
        let area = self.cell[0] * self.cell[1];
        self.kernel.fill([0.0; 3]);
        let points = self.axes[1].points;
        let highest = self.axes[1].highest.cast_signed();
        for m in 0..=self.axes[0].highest {
            for n in -highest..=highest {
                let k = self.wave(m.cast_signed(), n);
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

    /// Adds the wave part of `M x` to y; both `[6N]`, stresslets or strains first.
    pub(super) fn add(&mut self, x: &[f64], y: &mut [f64]) {
        self.spread(x);
        self.transform_forward();
        self.multiply();
        self.transform_back();
        self.read(y);
    }

    /// Derivatives of the lattice coordinates: ∂_x = d[0] ∂_X, ∂_y = d[1] ∂_X + d[2] ∂_Y.
    fn slopes(&self) -> [f64; 3] {
        let [length_x, length_y, offset] = self.cell;
        [
            length_x.recip(),
            -offset / (length_x * length_y),
            length_y.recip(),
        ]
    }

    /// P and Q on the grid.
    fn spread(&mut self, x: &[f64]) {
        for field in &mut self.fields {
            field.fill(Complex64::new(0.0, 0.0));
        }
        let n = self.sizes.len();
        let d = self.slopes();
        let [p, q] = &mut self.fields;
        let (columns, rows) = (self.axes[0].points, self.axes[1].points);
        for (i, ([along, across], size)) in self.windows.iter().zip(&self.sizes).enumerate() {
            let (s, f) = (&x[3 * i..3 * i + 3], &x[3 * (n + i)..3 * (n + i) + 3]);
            let stress = dipole([s[0], s[1], s[2]]);
            let torque = [[0.0, -0.5 * f[2]], [0.5 * f[2], 0.0]];
            // Weights of the window, and of its derivatives by X and by Y, for P and for Q, in both components.
            let weights = |b: usize| {
                let total = [0, 1].map(|c| stress[b][c] + torque[b][c]);
                [
                    [f[b], -(total[0] * d[0] + total[1] * d[1]), -total[1] * d[2]],
                    [
                        size.force * f[b],
                        -size.stresslet * (stress[b][0] * d[0] + stress[b][1] * d[1]),
                        -size.stresslet * stress[b][1] * d[2],
                    ],
                ]
            };
            let (wx, wy) = (weights(0), weights(1));
            let weight = |field: usize, k: usize| Complex64::new(wx[field][k], wy[field][k]);
            for r in 0..WIDTH {
                let row = (across.first + r) % rows * columns;
                let (value, slope) = (across.values[r], across.slopes[r]);
                // By the window and by its derivative along X.
                let factors = [0, 1].map(|field| {
                    [
                        weight(field, 0) * value + weight(field, 2) * slope,
                        weight(field, 1) * value,
                    ]
                });
                for (field, [by_value, by_slope]) in [&mut *p, &mut *q].into_iter().zip(factors) {
                    let row = &mut field[row..row + columns];
                    for c in 0..WIDTH {
                        let mut at = along.first + c;
                        if at >= columns {
                            at -= columns;
                        }
                        row[at] += by_value * along.values[c] + by_slope * along.slopes[c];
                    }
                }
            }
        }
    }

    /// Both fields to wave numbers; of the first, only those kept.
    fn transform_forward(&mut self) {
        let Self {
            axes,
            fields,
            columns,
            scratch,
            ..
        } = self;
        let (points, rows) = (axes[0].points, axes[1].points);
        for (field, column) in fields.iter_mut().zip(columns) {
            axes[0].plans[0].process_with_scratch(field, scratch);
            for (line, column) in column.chunks_exact_mut(rows).enumerate() {
                let at = grid_row(line, axes[0].highest, points);
                for (value, row) in column.iter_mut().zip(field.chunks_exact(points)) {
                    *value = row[at];
                }
            }
            axes[1].plans[0].process_with_scratch(column, scratch);
        }
    }

    /// The reverse.
    fn transform_back(&mut self) {
        let Self {
            axes,
            fields,
            columns,
            scratch,
            ..
        } = self;
        let (points, rows) = (axes[0].points, axes[1].points);
        for (field, column) in fields.iter_mut().zip(columns) {
            axes[1].plans[1].process_with_scratch(column, scratch);
            field.fill(Complex64::new(0.0, 0.0));
            for (line, column) in column.chunks_exact(rows).enumerate() {
                let at = grid_row(line, axes[0].highest, points);
                for (value, row) in column.iter().zip(field.chunks_exact_mut(points)) {
                    row[at] = *value;
                }
            }
            axes[0].plans[1].process_with_scratch(field, scratch);
        }
    }

    /// u and v of every wave vector from P and Q.
    fn multiply(&mut self) {
        let rows = self.axes[1].points;
        let highest = self.axes[0].highest;
        let [p, q] = &mut self.columns;
        let zero = Complex64::new(0.0, 0.0);
        let [length_x, length_y, offset] = self.cell;
        for m in 0..=highest {
            let opposite = if m == 0 { 0 } else { 2 * highest + 1 - m };
            let kx = 2.0 * PI * m as f64 / length_x;
            for at in 0..rows {
                let (here, there) = (m * rows + at, opposite * rows + (rows - at) % rows);
                // Of m = 0 each pair k, −k is met twice.
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
                let ky = 2.0 * PI / length_y * (n - m as f64 * offset / length_x);
                let [source, sized] = [&*p, &*q].map(|field| split(field[here], field[there]));
                let along = |v: [Complex64; 2]| v[0] * kx + v[1] * ky;
                let (kp, kq) = (along(source), along(sized));
                let shear = kp * b0 - kq * b1;
                let u = [
                    sized[0] * b2 - source[0] * b1 + shear * kx,
                    sized[1] * b2 - source[1] * b1 + shear * ky,
                ];
                let v = [
                    source[0] * b2 - kp * (b1 * kx),
                    source[1] * b2 - kp * (b1 * ky),
                ];
                for (field, values) in [(&mut *p, u), (&mut *q, v)] {
                    [field[here], field[there]] = pack(values);
                }
            }
        }
    }

    /// Adds the modes of each sphere read off u and v.
    fn read(&self, y: &mut [f64]) {
        let n = self.sizes.len();
        let d = self.slopes();
        let [u, v] = &self.fields;
        let (columns, rows) = (self.axes[0].points, self.axes[1].points);
        for (i, ([along, across], size)) in self.windows.iter().zip(&self.sizes).enumerate() {
            // Of u and v: value, and derivatives of the window by X and by Y.
            let mut sums = [[Complex64::new(0.0, 0.0); 3]; 2];
            for r in 0..WIDTH {
                let row = (across.first + r) % rows * columns;
                let (value, slope) = (across.values[r], across.slopes[r]);
                for (field, sums) in [u, v].into_iter().zip(&mut sums) {
                    let row = &field[row..row + columns];
                    let (mut by_value, mut by_slope) =
                        (Complex64::new(0.0, 0.0), Complex64::new(0.0, 0.0));
                    for c in 0..WIDTH {
                        let mut at = along.first + c;
                        if at >= columns {
                            at -= columns;
                        }
                        by_value += row[at] * along.values[c];
                        by_slope += row[at] * along.slopes[c];
                    }
                    sums[0] += by_value * value;
                    sums[1] += by_slope * value;
                    sums[2] += by_value * slope;
                }
            }
            let [u, v] = sums.map(|[value, by_x, by_y]| {
                // ∂ of the centre is minus that of the grid point.
                (value, -(by_x * d[0]), -(by_x * d[1] + by_y * d[2]))
            });
            let modes = |(_, dx, dy): (Complex64, Complex64, Complex64)| {
                [
                    FRAC_1_SQRT_2 * (dx.re - dy.im),
                    FRAC_1_SQRT_2 * (dx.im + dy.re),
                    1.5_f64.sqrt() * (dx.re + dy.im),
                ]
            };
            let (own, sized) = (modes(u), modes(v));
            for k in 0..3 {
                y[3 * i + k] += own[k] + size.stresslet * sized[k];
            }
            let y = &mut y[3 * (n + i)..];
            y[0] += u.0.re + size.force * v.0.re;
            y[1] += u.0.im + size.force * v.0.im;
            y[2] += 0.5 * (u.1.im - u.2.re);
        }
    }
}

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
fn split(here: Complex64, there: Complex64) -> [Complex64; 2] {
    let (sum, difference) = (here + there.conj(), here - there.conj());
    [
        sum * 0.5,
        Complex64::new(difference.im, -difference.re) * 0.5,
    ]
}

/// The reverse: transforms of a + ib at k and −k.
fn pack([a, b]: [Complex64; 2]) -> [Complex64; 2] {
    [
        Complex64::new(a.re - b.im, a.im + b.re),
        Complex64::new(a.re + b.im, b.re - a.im),
    ]
}
