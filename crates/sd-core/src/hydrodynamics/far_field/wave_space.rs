//! The long-ranged part of the periodic mobility: a sum over wave vectors in the plane.
//!
//! ```text
//! f^ = b0, (∇²f)^ = −b1, (∇²∇²f)^ = b2:   G^_ab = −δ_ab b1 + k_a k_b b0,   (∇²G)^_ab = δ_ab b2 − k_a k_b b1
//! b0 = −8π (J2 + σ J1 + 2σ² J0),  b1 = −8π (J1 + σ J0 + 2σ² J₋₁),  b2 = −8π (J0 + σ J₋₁ + 2σ² J₋₂)
//! J0 = e^(−q²) α/√π,  J1 = erfc(q)/(2k),  J2 = [erfc(q)(1 − 2q²) + 2q e^(−q²)/√π]/(4k³)
//! J₋₁ = J0 (k² + 1/2σ),  J₋₂ = J0 ((k² + 1/2σ)² + 1/2σ²);   σ = 1/(4α²),  q = k/(2α)
//! ```
//! Per pair the twenty lanes are sums over k of weights times cos k·x (even lanes) or sin k·x (odd
//! ones): with one row per pair, two products of a tall matrix and a narrow one.

use crate::hydrodynamics::free_space::kernels::{self, LANES, Lanes, RADIAL};
use crate::linalg::dense::{Matrix, product};
use crate::linalg::simd::vectorised;
use crate::linalg::whole;
use crate::space::cell::Lattice;
use crate::space::modes::Vec2;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Number of pairs summed together, unless one column of the matrix has more.
pub(super) const CHUNK: usize = 256;
/// Lanes with the cosine.
pub(crate) const EVEN: [usize; 12] = [0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19];
/// Lanes with the sine.
pub(crate) const ODD: [usize; 8] = [4, 5, 6, 7, 12, 13, 14, 15];

/// `(b0, b1, b2)/8π` of one wave vector: the factor 8π of G cancels against that of the mobility.
pub(crate) fn transforms(k: Vec2, alpha: f64) -> [f64; 3] {
    let square = k.norm_squared();
    let length = square.sqrt();
    let sigma = 0.25 / (alpha * alpha);
    let q = length / (2.0 * alpha);
    let (gauss, erfc) = ((-q * q).exp(), libm::erfc(q));
    let j0 = gauss * alpha / PI.sqrt();
    let j1 = erfc / (2.0 * length);
    let j2 = (erfc * (1.0 - 2.0 * q * q) + 2.0 * q * gauss / PI.sqrt()) / (4.0 * square * length);
    let inner = square + 0.5 / sigma;
    let j_1 = j0 * inner;
    let j_2 = j0 * (inner * inner + 0.5 / (sigma * sigma));
    [
        -(j2 + sigma * j1 + 2.0 * sigma * sigma * j0),
        -(j1 + sigma * j0 + 2.0 * sigma * sigma * j_1),
        -(j0 + sigma * j_1 + 2.0 * sigma * sigma * j_2),
    ]
}

/// Lanes of one wave vector, without 1/area: weights of cos or sin, for f and for ∇²f.
pub(crate) fn weights(k: Vec2, alpha: f64) -> [Lanes; 2] {
    let [b0, b1, b2] = transforms(k, alpha);
    [lanes(k, b0, -b1), lanes(k, -b1, b2)]
}

/// Lanes of one wave vector from the transforms of f and of ∇²f.
#[rustfmt::skip]
fn lanes(k: Vec2, f: f64, l: f64) -> Lanes {
    let square = k.norm_squared();
    let radial: [f64; RADIAL] = [
        0.5 * f,                                    // UU, m = 2
        -0.5 * FRAC_1_SQRT_2 * l,                   // EΩ, m = 2
        0.75_f64.sqrt() * (l + square * f),         // E3 E, m = 2
        0.25 * f,                                   // EE, m = 4
        -0.5 * l,                                   // UΩ, m = 1
        1.5_f64.sqrt() * (l + square * f),          // U s3, m = 1
        FRAC_1_SQRT_2 * (l + 0.5 * square * f),     // US, m = 1
        0.5 * FRAC_1_SQRT_2 * f,                    // US, m = 3
        l + 0.5 * square * f,                       // UU
        0.25 * square * l,                          // ΩΩ
        1.5 * square * (l + square * f),            // E3 E3
        0.5 * square * (l + 0.5 * square * f),      // EE
    ];
    let (re, im) = kernels::harmonics(k);
    let mut lanes = [0.0; LANES];
    for q in 0..8 {
        lanes[q] = radial[q] * re[q];
        lanes[q + 8] = radial[q] * im[q];
    }
    lanes[16..].copy_from_slice(&radial[8..]);
    lanes
}

/// The wave-space sum, planned for one splitting parameter.
#[derive(Debug, Clone)]
pub(crate) struct WaveSpace {
    /// Splitting parameter α, in 1/a.
    alpha: f64,
    /// Largest |k|, in 1/a.
    cut_off: f64,
    /// Finite-size factors if all radii are equal.
    equal: Option<[f64; RADIAL]>,
    /// Half of the wave vectors, as multiples (m, n) of the reciprocal lattice vectors.
    vectors: Vec<(usize, i32)>,
    /// Their maximum number at any offset.
    most: usize,
    /// Weights `[K × 12]` or `[K × 24]` of the cosines.
    even: Matrix,
    /// Weights `[K × 8]` or `[K × 16]` of the sines.
    odd: Matrix,
    /// cos k·x of every sphere `[N × K]`.
    cosines: Matrix,
    /// sin k·x of every sphere `[N × K]`.
    sines: Matrix,
    /// Powers of e^(i 2π X), real then imaginary, `[N × 2]` per power; X is the first lattice
    /// coordinate.
    powers_x: Matrix,
    /// Powers of e^(i 2π Y) of the second lattice coordinate, likewise.
    powers_y: Matrix,
}

/// Wave-space sums of some pairs.
#[derive(Debug, Clone, Default)]
pub(crate) struct WaveSums {
    /// Even lanes `[pairs × 12]` (or 24).
    pub(crate) even: Matrix,
    /// Odd lanes `[pairs × 8]` (or 16).
    pub(crate) odd: Matrix,
    /// `cos k·x_ij` of the pairs.
    cosines: Matrix,
    /// `sin k·x_ij` of the pairs.
    sines: Matrix,
}

impl WaveSpace {
    /// Plans the sum; `equal` holds the finite-size factors if all radii are equal.
    pub(crate) fn new(alpha: f64, cut_off: f64, equal: Option<[f64; RADIAL]>) -> Self {
        Self {
            alpha,
            cut_off,
            equal,
            vectors: Vec::new(),
            most: 0,
            even: Matrix::default(),
            odd: Matrix::default(),
            cosines: Matrix::default(),
            sines: Matrix::default(),
            powers_x: Matrix::default(),
            powers_y: Matrix::default(),
        }
    }

    /// Number of layers of streams: 1 for equal radii, 2 otherwise.
    fn layers(&self) -> usize {
        if self.equal.is_some() { 1 } else { 2 }
    }

    /// Sets the lattice and the centres; returns the sum at separation 0.
    pub(crate) fn update(&mut self, lattice: &Lattice, centres: &[Vec2]) -> [Lanes; 2] {
        let &[length_x, length_y] = lattice.lengths() else {
            return [[0.0; LANES]; 2];
        };
        let offset = lattice.offset();
        let first = 2.0 * PI / length_x;
        let second = 2.0 * PI / length_y;
        let columns = whole((self.cut_off / first).floor());
        if self.cosines.rows() != centres.len() {
            self.reserve(centres.len(), columns, first, second);
        }
        self.vectors.clear();
        let mut highest = 0;
        for m in 0..=columns {
            let kx = first * m as f64;
            let half = (self.cut_off * self.cut_off - kx * kx).max(0.0).sqrt();
            let centre = m as f64 * offset / length_x;
            #[expect(
                clippy::cast_possible_truncation,
                reason = "as many as the plan allows"
            )]
            let (from, to) = (
                (centre - half / second).ceil() as i32,
                (centre + half / second).floor() as i32,
            );
            let from = if m == 0 { 1 } else { from };
            for n in from..=to {
                self.vectors.push((m, n));
                highest = highest.max(n.unsigned_abs() as usize);
            }
        }
        let sums = self.fill_weights(first, second, lattice);
        self.fill_phases(centres, lattice, [columns, highest]);
        sums
    }

    /// Allocates the maximum number of wave vectors at any offset.
    fn reserve(&mut self, spheres: usize, columns: usize, first: f64, second: f64) {
        let count = |length: f64| whole((length / second).floor()) + 1;
        let vectors: usize = (0..=columns)
            .map(|m| {
                let kx = first * m as f64;
                count(2.0 * (self.cut_off * self.cut_off - kx * kx).max(0.0).sqrt())
            })
            .sum();
        let layers = self.layers();
        self.most = vectors;
        self.vectors.reserve(vectors);
        self.even.reshape(vectors, EVEN.len() * layers);
        self.odd.reshape(vectors, ODD.len() * layers);
        self.cosines.reshape(spheres, vectors);
        self.sines.reshape(spheres, vectors);
        self.powers_x.reshape(spheres, 2 * (columns + 1));
        self.powers_y
            .reshape(spheres, 2 * (count(self.cut_off) + columns / 2 + 2));
    }

    /// Weights of all wave vectors; returns their sum.
    fn fill_weights(&mut self, first: f64, second: f64, lattice: &Lattice) -> [Lanes; 2] {
        let skew = lattice.offset() / lattice.lengths()[0];
        let factor = 2.0 / lattice.content();
        let count = self.vectors.len();
        let layers = self.layers();
        self.even.reshape(count, EVEN.len() * layers);
        self.odd.reshape(count, ODD.len() * layers);
        let mut sums = [[0.0; LANES]; 2];
        for (row, &(m, n)) in self.vectors.iter().enumerate() {
            let across = second * (f64::from(n) - m as f64 * skew);
            let k = lattice.out_of_frame([first * m as f64, across, 0.0]);
            let mut weights = weights(k, self.alpha);
            if let Some(factors) = &self.equal {
                weights[0] = kernels::finite_size(&weights[0], &weights[1], factors);
                weights[1] = [0.0; LANES];
            }
            for layer in 0..layers {
                for (column, &lane) in EVEN.iter().enumerate() {
                    self.even[(row, EVEN.len() * layer + column)] = factor * weights[layer][lane];
                    sums[layer][lane] += factor * weights[layer][lane];
                }
                for (column, &lane) in ODD.iter().enumerate() {
                    self.odd[(row, ODD.len() * layer + column)] = factor * weights[layer][lane];
                }
            }
        }
        sums
    }

    /// cos and sin of k·x for every sphere and wave vector, by products of powers.
    /// `most`: largest multiples of the two reciprocal vectors, the second of either sign.
    fn fill_phases(&mut self, centres: &[Vec2], lattice: &Lattice, most: [usize; 2]) {
        let n = centres.len();
        self.powers_x.reshape(n, 2 * (most[0] + 1));
        self.powers_y.reshape(n, 2 * (most[1] + 1));
        for (i, x) in centres.iter().enumerate() {
            let [x_fraction, y_fraction, _] = lattice.coordinates(x);
            for (powers, fraction, highest) in [
                (&mut self.powers_x, x_fraction, most[0]),
                (&mut self.powers_y, y_fraction, most[1]),
            ] {
                let (s, c) = (2.0 * PI * (fraction - fraction.floor())).sin_cos();
                let (mut re, mut im) = (1.0, 0.0);
                for power in 0..=highest {
                    powers[(i, 2 * power)] = re;
                    powers[(i, 2 * power + 1)] = im;
                    (re, im) = (re * c - im * s, re * s + im * c);
                }
            }
        }
        self.cosines.reshape(n, self.vectors.len());
        self.sines.reshape(n, self.vectors.len());
        for (row, &(m, power)) in self.vectors.iter().enumerate() {
            let sign = f64::from(power.signum());
            let p = power.unsigned_abs() as usize;
            let (xr, xi) = (self.powers_x.column(2 * m), self.powers_x.column(2 * m + 1));
            let (yr, yi) = (self.powers_y.column(2 * p), self.powers_y.column(2 * p + 1));
            let cosines = self.cosines.column_mut(row);
            for i in 0..n {
                cosines[i] = xr[i] * yr[i] - sign * xi[i] * yi[i];
            }
            let sines = self.sines.column_mut(row);
            for i in 0..n {
                sines[i] = xi[i] * yr[i] + sign * xr[i] * yi[i];
            }
        }
    }

    /// Lanes of all pairs (i, j), i > j, for j in a range.
    pub(crate) fn sum(&self, range: std::ops::Range<usize>, sums: &mut WaveSums) {
        let n = self.cosines.rows();
        let pairs: usize = range.clone().map(|j| n - 1 - j).sum();
        let count = self.vectors.len();
        let most = n.max(CHUNK);
        for waves in [&mut sums.cosines, &mut sums.sines] {
            waves.reserve(most * self.most);
            waves.reshape(pairs, count);
        }
        sums.even.reserve(most * self.even.columns());
        sums.odd.reserve(most * self.odd.columns());
        vectorised(
            #[inline(always)]
            || {
                for k in 0..count {
                    let (c, s) = (self.cosines.column(k), self.sines.column(k));
                    let mut pair_c = sums.cosines.column_mut(k);
                    let mut pair_s = sums.sines.column_mut(k);
                    for j in range.clone() {
                        let (cj, sj) = (c[j], s[j]);
                        let (c, s) = (&c[j + 1..], &s[j + 1..]);
                        let (out_c, rest_c) = pair_c.split_at_mut(c.len());
                        let (out_s, rest_s) = pair_s.split_at_mut(c.len());
                        for (((ci, si), oc), os) in
                            c.iter().zip(s).zip(&mut *out_c).zip(&mut *out_s)
                        {
                            *oc = ci.mul_add(cj, si * sj);
                            *os = si.mul_add(cj, -(ci * sj));
                        }
                        (pair_c, pair_s) = (rest_c, rest_s);
                    }
                }
            },
        );
        product(&sums.cosines, &self.even, &mut sums.even);
        product(&sums.sines, &self.odd, &mut sums.odd);
    }
}
