//! Spheres and the grid: sources spread to its points, and velocities read off them.

use super::axis::{Axis, WIDEST, Window};
use super::{Fields, Grid};
use crate::hydrodynamics::far_field::far_space::FarSpace;
use crate::space::FixedArray;
use crate::space::cell::Lattice;
use std::f64::consts::FRAC_1_SQRT_2;

impl<S: FarSpace> Grid<S> {
    /// Spreads the sources over slabs from `first` on: P and Q there.
    #[inline(always)]
    pub(super) fn spread<const W: usize>(
        &self,
        first: usize,
        x: &[S::PerAnyMode<f64>],
        values: &mut [Fields<S>],
    ) {
        let none: S::PerComponent<_> = FixedArray::each([0.0; 2]);
        let counts = self.counts();
        let Self {
            windows,
            sizes,
            slopes,
            ..
        } = self;
        let (slab, slabs) = (self.slab(), self.last().points);
        let (begin, end) = (first * slab, first + values.len() / slab);
        let within = if S::DIMENSIONS < 3 { 1 } else { W };
        values.fill(none);
        for ((windows, size), modes) in windows.iter().zip(sizes).zip(x) {
            let start = windows[S::DIMENSIONS - 1].first;
            let is_here = |k: usize| {
                let at = (start + k) % slabs;
                first <= at && at < end
            };
            if !(0..W).any(is_here) {
                continue;
            }
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
            for line in (0..lines::<S, W>()).filter(|line| is_here(line / within)) {
                let (start, [plain, second, third]) = line_under::<S, W>(windows, counts, line);
                let (mut by_value, mut by_slope) = (none, none);
                for b in 0..S::DIMENSIONS {
                    for f in 0..2 {
                        by_value[b][f] =
                            plain * value[b][f] + second * by[1][b][f] + third * by[2][b][f];
                        by_slope[b][f] = plain * by[0][b][f];
                    }
                }
                let points = &mut values[start - begin..start - begin + W];
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

    /// Adds the modes of each sphere read off u and v: the transpose of [`Grid::spread`].
    #[inline(always)]
    pub(super) fn read<const W: usize>(
        &self,
        values: &[Fields<S>],
        first: usize,
        y: &mut [S::PerAnyMode<f64>],
    ) {
        let none: S::PerComponent<_> = FixedArray::each([0.0; 2]);
        let counts = self.counts();
        let spheres = self.windows[first..].iter().zip(&self.sizes[first..]);
        for ((windows, size), y) in spheres.zip(y) {
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
                let points = S::PerComponent::flat(&values[start..start + W]).as_flattened();
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

/// The windows around a centre.
#[inline(always)]
pub(super) fn windows_at<S: FarSpace>(
    axes: &[Axis],
    lattice: &Lattice<S>,
    x: &S::Vector,
) -> S::PerComponent<Window> {
    let coordinates = lattice.coordinates(x);
    let mut windows: S::PerComponent<_> = FixedArray::each(axes[0].window(coordinates[0]));
    for k in 1..S::DIMENSIONS {
        windows[k] = axes[k].window(coordinates[k]);
    }
    windows
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
