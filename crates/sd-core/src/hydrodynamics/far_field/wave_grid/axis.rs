//! One lattice direction of the grid: its points, its window, its transforms.
//!
//! ```text
//! window w(z) = I₀(β √(1 − z²))/I₀(β), |z| < 1, over W points;   its transform at m: W sinh(s)/(s I₀(β)), s = √(β² − (π W m/points)²)
//! ```
//! Between two grid points every value of the window is a fitted polynomial of the position.

use super::sampling::Sampling;
use crate::hydrodynamics::far_field::highest;
use crate::linalg::polynomial::{chebyshev_points, interpolate};
use crate::linalg::whole;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::PI;
use std::sync::Arc;

/// Most points W under the window along each coordinate.
pub(super) const WIDEST: usize = 12;
/// Degree of the polynomials that approximate the window.
const DEGREE: usize = 15;

/// The window of one sphere along one coordinate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    /// First grid point; the next ones follow, wrapped.
    pub(super) first: usize,
    /// Values at the W points; those beyond are of no use.
    pub(super) values: [f64; WIDEST],
    /// Derivatives with respect to the grid point's lattice coordinate.
    pub(super) slopes: [f64; WIDEST],
}

/// One lattice direction of the grid.
pub(super) struct Axis {
    /// Grid points.
    pub(super) points: usize,
    /// Points under the window.
    width: usize,
    /// Largest wave number kept.
    pub(super) highest: usize,
    /// One over the window's transform, by wave number ≥ 0.
    pub(super) correction: Vec<f64>,
    /// Coefficients of the window's values in u = 2t − 1, t the position between two grid points.
    polynomials: [[f64; WIDEST]; DEGREE + 1],
    /// Transforms along the axis, forward and back.
    pub(super) plans: [Arc<dyn Fft<f64>>; 2],
}

/// The directions of a grid whose wave numbers end at `cut_off`, and the scratch that their
/// transforms need.
///
/// `lengths`: of each direction, in a: a wave vector k has at most k·length/2π waves along it.
pub(super) fn plan_axes(lengths: &[f64], cut_off: f64, sampling: Sampling) -> (Vec<Axis>, usize) {
    let mut planner = FftPlanner::new();
    let axes: Vec<_> = lengths
        .iter()
        .map(|&length| Axis::new(highest(length, cut_off), sampling, &mut planner))
        .collect();
    let scratch = axes
        .iter()
        .flat_map(|axis| axis.plans.iter().map(|plan| plan.get_inplace_scratch_len()))
        .max()
        .unwrap_or(0);
    (axes, scratch)
}

impl Axis {
    /// An axis with wave numbers up to `highest`.
    pub(super) fn new(highest: usize, sampling: Sampling, planner: &mut FftPlanner<f64>) -> Self {
        let points = sampling.points(highest);
        let width = sampling.width as f64;
        let ratio = points as f64 / (2 * highest + 1) as f64;
        // Beatty, Nishimura & Pauly 2005, eq. (5).
        let scaled = width / ratio * (ratio - 0.5);
        let shape = PI * (scaled * scaled - 0.8).sqrt();
        let correction = (0..=highest)
            .map(|m| {
                let argument = PI * m as f64 / points as f64 * width;
                let root = (shape * shape - argument * argument).sqrt();
                bessel(shape) * root / (width * root.sinh())
            })
            .collect();
        Self {
            points,
            width: sampling.width,
            highest,
            correction,
            polynomials: fit_window(shape, sampling.width),
            plans: [
                planner.plan_fft_forward(points),
                planner.plan_fft_inverse(points),
            ],
        }
    }

    /// The window around a lattice coordinate.
    #[inline(always)]
    pub(super) fn window(&self, coordinate: f64) -> Window {
        let points = self.points as f64;
        let position = (coordinate - coordinate.floor()) * points;
        let begin = position - 0.5 * self.width as f64;
        let start = begin.ceil();
        let u = 2.0 * (start - begin) - 1.0;
        let mut values = self.polynomials[DEGREE];
        let mut slopes = [0.0_f64; WIDEST];
        for coefficients in self.polynomials[..DEGREE].iter().rev() {
            for k in 0..WIDEST {
                slopes[k] = slopes[k].mul_add(u, values[k]);
                values[k] = values[k].mul_add(u, coefficients[k]);
            }
        }
        // u advances by 2 from one grid point to the next.
        let slopes = slopes.map(|slope| 2.0 * points * slope);
        let first = whole(start.rem_euclid(points)) % self.points;
        Window {
            first,
            values,
            slopes,
        }
    }

    /// Grid index of a wave number of either sign.
    pub(super) fn index(&self, wave: isize) -> usize {
        wave.rem_euclid(self.points.cast_signed()).cast_unsigned()
    }
}

/// Polynomials through the window's values at Chebyshev points.
fn fit_window(shape: f64, width: usize) -> [[f64; WIDEST]; DEGREE + 1] {
    let nodes: [f64; DEGREE + 1] = chebyshev_points();
    let scale = bessel(shape).recip();
    let values = nodes.map(|u| {
        std::array::from_fn(|k| {
            let z = (0.5 * (u + 1.0) + k as f64) / (0.5 * width as f64) - 1.0;
            if k < width {
                scale * bessel(shape * (1.0 - z * z).max(0.0).sqrt())
            } else {
                0.0
            }
        })
    });
    interpolate(&nodes, values)
}

/// `I₀(x)` by its power series.
fn bessel(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 0.0);
    let mut k = 0.0;
    while term > 1e-17 * sum {
        sum += term;
        k += 1.0;
        term *= quarter / (k * k);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn window_is_the_bessel_function_and_its_slope() {
        for (width, coordinate) in [12, 8, 6]
            .into_iter()
            .flat_map(|width| [0.0, 0.1234, -3.77, 0.9999].map(|coordinate| (width, coordinate)))
        {
            let sampling = Sampling { width, ratio: 1.7 };
            let axis = Axis::new(40, sampling, &mut FftPlanner::new());
            let ratio = axis.points as f64 / 81.0;
            let half = 0.5 * width as f64;
            let scaled = width as f64 / ratio * (ratio - 0.5);
            let shape = PI * (scaled * scaled - 0.8).sqrt();
            let exact = |z: f64| bessel(shape * (1.0 - z * z).max(0.0).sqrt()) / bessel(shape);
            let window = axis.window(coordinate);
            let position = (coordinate - coordinate.floor()) * axis.points as f64;
            for k in 0..width {
                let mut distance = (window.first + k) as f64 - position;
                distance -= (distance / axis.points as f64).round() * axis.points as f64;
                let z = distance / half;
                assert!(
                    (window.values[k] - exact(z)).abs() < 1e-12,
                    "{coordinate} {k}"
                );
                if z.abs() < 0.95 {
                    let h = 1e-4;
                    let slope = (exact(z + h) - exact(z - h)) / (2.0 * h) / half;
                    let found = window.slopes[k] / axis.points as f64;
                    assert!((found - slope).abs() < 1e-6, "{coordinate} {k}");
                }
            }
        }
    }
}
