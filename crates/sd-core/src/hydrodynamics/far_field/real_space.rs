//! The short-ranged part of the periodic mobility: a sum over images of the kernels of
//! `f = r erfc(αr)`.
//!
//! The radial functions are tabulated as polynomials in r². The intervals of the table divide every
//! octave of r² evenly, so that the bits of r² are the index, and narrow where the functions are
//! steep.

use crate::hydrodynamics::free_space::kernels::{self, LANES, Lanes, RADIAL};
use crate::hydrodynamics::free_space::planar::{self, RadialChain};
use crate::linalg::polynomial::{chebyshev_points, interpolate};
use crate::space::cell::Lattice;
use crate::space::modes::Vec2;
use std::f64::consts::PI;

/// Degree of the table's polynomials, even.
const DEGREE: usize = 6;
/// Coefficients of one interval, constant term first, aligned for vector loads.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Interval([[f64; RADIAL]; DEGREE + 1]);

impl RadialChain {
    /// f = r erfc(αr).
    pub(crate) fn screened(square: f64, alpha: f64) -> Self {
        let distance = square.sqrt();
        let gauss = (-alpha * alpha * square).exp();
        let slope = 2.0 * alpha / PI.sqrt();
        // With D = 1/r d/dr: f₁ = h − slope·gauss, h = erfc(αr)/r, D gauss = −2α² gauss, and (−D)ᵏ
        // h by recurrence.
        let mut derivatives = [0.0; 6];
        let mut h = libm::erfc(alpha * distance) / distance;
        let mut gaussian = slope * gauss;
        let mut sign = 1.0;
        for (k, value) in derivatives.iter_mut().enumerate() {
            *value = sign * (h - gaussian);
            h = ((2 * k + 1) as f64 * h + gaussian) / square;
            gaussian *= 2.0 * alpha * alpha;
            sign = -sign;
        }
        Self {
            derivatives,
            square,
        }
    }

    /// f = r erf(αr) at r = 0: a sphere's own image in the wave part.
    pub(crate) fn own_image(alpha: f64) -> Self {
        // f = 2/√π Σ (−1)ⁿ α^(2n+1) r^(2n+2) / (n! (2n+1)),  f_k = 2ᵏ k! [coefficient of r^(2k)].
        let mut derivatives = [0.0; 6];
        let mut power = 2.0 * alpha / PI.sqrt();
        for (n, value) in derivatives.iter_mut().enumerate() {
            *value = power * (n + 1) as f64 / (2 * n + 1) as f64 * 2.0;
            power *= -2.0 * alpha * alpha;
        }
        Self {
            derivatives,
            square: 0.0,
        }
    }
}

/// Twelve radial functions of r², tabulated.
#[derive(Debug, Clone, Default)]
struct RadialTable {
    intervals: Vec<Interval>,
    /// Index bits of the first interval.
    first: usize,
    /// Binary digits of r² below the leading one that belong to the index.
    digits: u32,
    /// Lower end of the table.
    smallest: f64,
}

impl RadialTable {
    /// Fits `function` at Chebyshev points for `from ≤ r² ≤ to`, with 2^digits intervals per
    /// octave.
    fn new(from: f64, to: f64, digits: u32, function: impl Fn(f64) -> [f64; RADIAL]) -> Self {
        let (first, last) = (index(from, digits), index(to, digits));
        let nodes = chebyshev_points();
        let intervals = (first..=last)
            .map(|i| {
                let start = f64::from_bits((i as u64) << (52 - digits));
                let end = f64::from_bits(((i + 1) as u64) << (52 - digits));
                let values = nodes.map(|u| function(start + 0.5 * (1.0 + u) * (end - start)));
                Interval(interpolate(&nodes, values))
            })
            .collect();
        Self {
            intervals,
            first,
            digits,
            smallest: f64::from_bits((first as u64) << (52 - digits)),
        }
    }

    /// Values at `smallest ≤ r² ≤ to`.
    #[inline(always)]
    fn evaluate(&self, square: f64) -> [f64; RADIAL] {
        let bits = square.to_bits();
        let Interval(interval) = &self.intervals[index(square, self.digits) - self.first];
        // The digits below the index, as a number in [1, 2), mapped to [−1, 1).
        let fraction =
            f64::from_bits(((bits << self.digits) & (u64::MAX >> 12)) | 1.0_f64.to_bits());
        let u = 2.0 * fraction - 3.0;
        let u_square = u * u;
        // Pairs of terms first: a shorter chain of dependent operations than Horner's.
        let mut values = interval[DEGREE];
        for pair in (0..DEGREE / 2).rev() {
            let (low, high) = (&interval[2 * pair], &interval[2 * pair + 1]);
            for k in 0..RADIAL {
                values[k] = values[k].mul_add(u_square, high[k].mul_add(u, low[k]));
            }
        }
        values
    }
}

/// Leading binary digits of a positive number, exponent included: steps 2^digits times per octave.
#[inline(always)]
fn index(square: f64, digits: u32) -> usize {
    #[expect(clippy::cast_possible_truncation, reason = "at most 12 + digits bits")]
    let index = (square.to_bits() >> (52 - digits)) as usize;
    index
}

/// The real-space sum, planned for one splitting parameter.
#[derive(Debug, Clone)]
pub struct RealSpace {
    /// Splitting parameter α, in 1/a.
    alpha: f64,
    /// Square of the cut-off, in a².
    cut_off_square: f64,
    /// One table with the finite-size factors of equal spheres, or two: of f and of ∇²f.
    tables: Vec<RadialTable>,
    /// Finite-size factors if all radii are equal.
    equal: Option<[f64; RADIAL]>,
    /// Lattice vectors that can bring a pair within the cut-off.
    images: Vec<Vec2>,
    lattice: Option<Lattice>,
}

impl RealSpace {
    /// Plans the sum; `equal` holds the finite-size factors if all radii are equal.
    ///
    /// Separations below `smallest` are still summed, slowly.
    pub(crate) fn new(
        alpha: f64,
        cut_off: f64,
        smallest: f64,
        tolerance: f64,
        equal: Option<[f64; RADIAL]>,
    ) -> Self {
        let digits = if tolerance < 1e-9 { 6 } else { 4 };
        let (from, to) = (smallest * smallest, cut_off * cut_off);
        let from = from.min(to);
        let table =
            |function: &dyn Fn(f64) -> [f64; RADIAL]| RadialTable::new(from, to, digits, function);
        let tables = if equal.is_some() {
            vec![table(&|square| exact(square, alpha, equal.as_ref())[0])]
        } else {
            vec![
                table(&|square| exact(square, alpha, None)[0]),
                table(&|square| exact(square, alpha, None)[1]),
            ]
        };
        Self {
            alpha,
            cut_off_square: to,
            tables,
            equal,
            images: Vec::new(),
            lattice: None,
        }
    }

    /// Whether the term of a separation includes the finite size of equal spheres.
    pub(crate) fn is_of_equal_spheres(&self) -> bool {
        self.equal.is_some()
    }

    /// Sets the lattice and returns the self terms: all images of a sphere but itself.
    pub(crate) fn update(&mut self, lattice: &Lattice) -> [Lanes; 2] {
        self.lattice = Some(*lattice);
        let &[length_x, length_y] = lattice.lengths() else {
            return [[0.0; LANES]; 2];
        };
        self.images.clear();
        let cut_off = self.cut_off_square.sqrt();
        #[expect(clippy::cast_possible_truncation, reason = "a few cells")]
        let whole = |x: f64| x.ceil() as i32;
        let rows = whole(cut_off / length_y + 0.5);
        for n in -rows..=rows {
            let shift = lattice.offset() * f64::from(n);
            let columns = whole((cut_off + shift.abs()) / length_x + 0.5);
            for m in -columns..=columns {
                let image = lattice.translation([m, n]);
                // Nearest point of the box of all folded separations.
                let [x, y, _] = lattice.in_frame(&image);
                let x = (x.abs() - 0.5 * length_x).max(0.0);
                let y = (y.abs() - 0.5 * length_y).max(0.0);
                if x * x + y * y < self.cut_off_square {
                    self.images.push(image);
                }
            }
        }
        let mut sums = [[0.0; LANES]; 2];
        for image in &self.images {
            let square = image.norm_squared();
            if square > 0.0 && square < self.cut_off_square {
                for (sum, radial) in
                    sums.iter_mut()
                        .zip(exact(square, self.alpha, self.equal.as_ref()))
                {
                    let mut total = Sum::new(sum);
                    total.add(&radial, *image);
                    total.store(sum);
                }
            }
        }
        sums
    }

    /// The term of one separation within the cut-off: lanes of equal spheres and zeros, or those of
    /// f and of ∇²f.
    #[inline(always)]
    pub(crate) fn single(&self, separation: Vec2) -> [Lanes; 2] {
        let square = separation.norm_squared();
        let mut lanes = [[0.0; LANES]; 2];
        for (layer, (lanes, table)) in lanes.iter_mut().zip(&self.tables).enumerate() {
            let radial = if square < table.smallest {
                exact(square, self.alpha, self.equal.as_ref())[layer]
            } else {
                table.evaluate(square)
            };
            *lanes = planar::lanes(&radial, separation);
        }
        lanes
    }

    /// Sums of the images of all pairs (i, j), i > j, of one j; `sums` takes one entry per i and
    /// table.
    #[inline(always)]
    pub(crate) fn column(&self, centres: &[Vec2], j: usize, sums: &mut [Lanes]) {
        let Some(lattice) = &self.lattice else {
            return;
        };
        let layers = self.tables.len();
        let centre = centres[j];
        let (mut squares, mut xs, mut ys) = ([0.0; NEAR], [0.0; NEAR], [0.0; NEAR]);
        for (x, sums) in centres[j + 1..].iter().zip(sums.chunks_exact_mut(layers)) {
            let (d, _) = lattice.fold(x - centre);
            sums.fill([0.0; LANES]);
            for images in self.images.chunks(NEAR) {
                // Those within the cut-off first, without branches.
                let mut count = 0;
                for image in images {
                    let separation = d + image;
                    let square = separation.norm_squared();
                    squares[count % NEAR] = square;
                    xs[count % NEAR] = separation.x;
                    ys[count % NEAR] = separation.y;
                    count += usize::from(square < self.cut_off_square);
                }
                for (layer, (sum, table)) in sums.iter_mut().zip(&self.tables).enumerate() {
                    let mut total = Sum::new(sum);
                    for ((&square, &x), &y) in squares[..count].iter().zip(&xs).zip(&ys) {
                        let separation = Vec2::new(x, y);
                        if square < table.smallest {
                            total.add(
                                &exact(square, self.alpha, self.equal.as_ref())[layer],
                                separation,
                            );
                        } else {
                            total.add(&table.evaluate(square), separation);
                        }
                    }
                    total.store(sum);
                }
            }
        }
    }
}

/// Number of images gathered before summation.
const NEAR: usize = 64;

/// Partial sums of lanes, in separate arrays so that they stay in registers.
struct Sum {
    /// Lanes 0-7.
    re: [f64; 8],
    /// Lanes 8-15.
    im: [f64; 8],
    /// Lanes 16-19.
    isotropic: [f64; 4],
}

impl Sum {
    #[inline(always)]
    fn new(lanes: &Lanes) -> Self {
        Self {
            re: std::array::from_fn(|k| lanes[k]),
            im: std::array::from_fn(|k| lanes[k + 8]),
            isotropic: std::array::from_fn(|k| lanes[k + 16]),
        }
    }

    #[inline(always)]
    fn add(&mut self, radial: &[f64; RADIAL], separation: Vec2) {
        let (re, im) = kernels::harmonics(separation);
        for k in 0..8 {
            self.re[k] = radial[k].mul_add(re[k], self.re[k]);
        }
        for k in 0..8 {
            self.im[k] = radial[k].mul_add(im[k], self.im[k]);
        }
        for k in 0..4 {
            self.isotropic[k] += radial[k + 8];
        }
    }

    #[inline(always)]
    fn store(&self, lanes: &mut Lanes) {
        lanes[..8].copy_from_slice(&self.re);
        lanes[8..16].copy_from_slice(&self.im);
        lanes[16..].copy_from_slice(&self.isotropic);
    }
}

/// Radial functions without a table: those of equal spheres and zeros, or those of f and of ∇²f.
fn exact(square: f64, alpha: f64, equal: Option<&[f64; RADIAL]>) -> [[f64; RADIAL]; 2] {
    let (mut point, mut laplacian) = RadialChain::screened(square, alpha).radial_functions();
    if let Some(factors) = equal {
        for k in 0..RADIAL {
            point[k] += factors[k] * laplacian[k];
        }
        laplacian = [0.0; RADIAL];
    }
    [point, laplacian].map(|radial| radial.map(|value| value / (8.0 * PI)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_holds_the_screened_functions() {
        let alpha = 0.3;
        let factors = kernels::FiniteSize::new(1.0);
        let factors = factors.factors(&factors);
        for (digits, limit) in [(4, 5e-10), (6, 1e-13)] {
            let table =
                RadialTable::new(4.0, 225.0, digits, |s| exact(s, alpha, Some(&factors))[0]);
            for k in 0..1000 {
                let square = 4.0 + 221.0 * (f64::from(k) / 999.0).powi(3);
                let (found, expected) = (
                    table.evaluate(square),
                    exact(square, alpha, Some(&factors))[0],
                );
                let unscreened = RadialChain::distance(square).radial_functions();
                for q in 0..RADIAL {
                    let scale = (unscreened.0[q].abs() + unscreened.1[q].abs()) / (8.0 * PI);
                    assert!(
                        (found[q] - expected[q]).abs() <= limit * scale.max(1e-9),
                        "{q} {square} {} {}",
                        found[q],
                        expected[q]
                    );
                }
            }
        }
    }

    #[test]
    fn own_image_and_screened_part_make_up_the_whole() {
        // r erf(αr) near 0 tends to its series; r − r erfc(αr) cancels there, so compare at
        // moderate αr.
        let (alpha, r) = (0.05, 2.0_f64);
        let (whole, screened, own) = (
            RadialChain::distance(r * r),
            RadialChain::screened(r * r, alpha),
            RadialChain::own_image(alpha),
        );
        for k in 0..4 {
            let difference = whole.derivatives[k] - screened.derivatives[k];
            assert!((difference / own.derivatives[k] - 1.0).abs() < 0.02, "{k}");
        }
    }
}
