//! X^C: two spheres that rotate about their line of centres, in closed form and tabulated.
//!
//! ```text
//! X11C = Σ_{n≥0} [sinh α / sinh(α + n (α + β))]³,   X12C = −Σ_{n≥1} [sinh α / sinh(n (α + β))]³
//! cosh α = (r² + a_1² − a_2²)/(2 r a_1),   cosh β = (r² + a_2² − a_1²)/(2 r a_2)
//! ```
//!
//! Both stay finite at contact, where they are `x³ ζ(3, x)` and `−x³ ζ(3)` with `x = λ/(1 + λ)`;
//! their slope there has a logarithm. The two-sphere resistance minus that of the far field is,
//! with `t = (a_1 a_2/r²)³`:
//!
//! ```text
//! R11 = 8π a_1³ [X11C − 1/(1 − t)],   R12 = 8π a_1³ [X12C + (a_2/r)³/(1 − t)]
//! ```
//!
//! # Source
//! Jeffery, Proc. London Math. Soc. 14, 327 (1915), in the normalisation of [`super::Scalars`].

use super::check_size_ratio;
use super::table::{Cells, INTERVALS, LAST, NODES, fit_intervals, locate, node_xi};
use crate::error::Error;
use crate::linalg::polynomial::{horner, horner_of_two};
use std::f64::consts::PI;

/// Terms summed one by one; the rest is an integral with its end corrections, whose error is 1e-15.
const SUMMED: u32 = 200;

/// `Σ_{n≥0} sinh³ α / sinh³(first + n step)`.
fn sum(scale: f64, first: f64, step: f64) -> f64 {
    let term = |x: f64| (scale / x.sinh()).powi(3);
    let mut total = 0.0;
    for n in 0..SUMMED {
        let added = term(first + f64::from(n) * step);
        total += added;
        if added < 1e-18 * total {
            return total;
        }
    }
    // Euler-Maclaurin: ∫ csch³ = −(coth csch + ln tanh(x/2))/2 and its value and slope at the lower
    // end.
    let x = first + f64::from(SUMMED) * step;
    let integral = 0.5 * ((x.tanh() * x.sinh()).recip() + (0.5 * x).tanh().ln());
    let rest = scale.powi(3) * integral / step;
    total + rest + term(x) * (0.5 + 0.25 * step / x.tanh())
}

/// X^C of both spheres at ξ, the first of radius 1: `[X11C, X12C]` with it as sphere 1, then with
/// the other.
fn functions(size_ratio: f64, xi: f64) -> [[f64; 2]; 2] {
    let mean = 0.5 * (1.0 + size_ratio);
    let (gap, distance) = (mean * xi, mean * (2.0 + xi));
    let radii = [1.0, size_ratio];
    // cosh α − 1, without cancellation.
    let excess = [0, 1].map(|one: usize| {
        let (own, other) = (radii[one], radii[1 - one]);
        gap * (distance - own + other) / (2.0 * distance * own)
    });
    let sines = excess.map(|x| (x * (2.0 + x)).sqrt());
    let angles = [0, 1].map(|one| (excess[one] + sines[one]).ln_1p());
    let step = angles[0] + angles[1];
    [0, 1].map(|one| {
        [
            sum(sines[one], angles[one], step),
            -sum(sines[one], step, step),
        ]
    })
}

/// X^C of two spheres in unbounded fluid, `[X11C, X12C]`: the torque from rotation about the line
/// of centres, over `8π mu a_1³`.
///
/// # Arguments
/// - `size_ratio`: `λ = a_2/a_1`, within 0.01..=100.
/// - `s_prime`: `s' = 2r/(a_1 + a_2)`, above 2.
///
/// # Accuracy
/// Rounding; test `twist_agrees_with_coupled_multipoles`.
///
/// # Errors
/// [`Error::OutOfRange`] if an argument is, or is not a number.
///
/// ```
/// use sd_core::two_sphere::twist;
///
/// let [own, other] = twist(1.0, 100.0)?;
/// assert!((own - 1.0).abs() < 1e-5 && other.abs() < 1e-5);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn twist(size_ratio: f64, s_prime: f64) -> Result<[f64; 2], Error> {
    let size_ratio = check_size_ratio(size_ratio)?;
    super::check_s_prime(s_prime)?;
    Ok(functions(size_ratio, s_prime - 2.0)[0])
}

/// The twist entries of the near-field term of spheres of two radii, i before j: `[ii, ij, jj]`, in
/// mu·a³.
#[derive(Debug, Clone)]
pub(crate) struct TwistTable {
    /// By interval of ln ξ, as in [`super::NearField`], and power of the local variable.
    powers: Vec<[[f64; 3]; NODES]>,
    /// Twice over the sum of the radii.
    per_mean: f64,
}

/// The twist entries of spheres of radii a and b at ξ.
fn entries([a, b]: [f64; 2], xi: f64) -> [f64; 3] {
    let distance = 0.5 * (a + b) * (2.0 + xi);
    let [first, second] = functions(b / a, xi);
    let cubes = [a, b].map(|radius| 8.0 * PI * radius.powi(3));
    let t = (a * b / (distance * distance)).powi(3);
    let far = (1.0 - t).recip();
    [
        cubes[0] * (first[0] - far),
        cubes[0] * (first[1] + (b / distance).powi(3) * far),
        cubes[1] * (second[0] - far),
    ]
}

impl TwistTable {
    /// The table of spheres with these radii, in a; takes a millisecond.
    pub(crate) fn new(radii: [f64; 2]) -> Self {
        Self {
            powers: fit_intervals(|interval, node| entries(radii, node_xi(interval, node))),
            per_mean: 2.0 / (radii[0] + radii[1]),
        }
    }

    /// The entries at a gap, in a; positive.
    #[inline(always)]
    pub(crate) fn evaluate(&self, gap: f64) -> [f64; 3] {
        let logarithm = (self.per_mean * gap).ln();
        if logarithm > LAST {
            return [0.0; 3];
        }
        let (interval, x) = locate(logarithm);
        horner(&self.powers[interval], x)
    }
}

/// Nodes of a cell of [`TwistRange`] in ln λ.
const COARSE: usize = 7;

/// The twist entries at any size ratio up to a largest, like [`super::NearFieldRange`] for the
/// others.
#[derive(Debug)]
pub(crate) struct TwistRange {
    cells: Cells,
    /// By cell in ln λ, interval of ln ξ and power of ln ξ: the powers of ln λ; the smaller sphere
    /// is i, of radius 1.
    powers: Vec<[[f64; 3]; COARSE]>,
}

impl TwistRange {
    /// Takes 0.1 s up to size ratio 4, 0.3 s up to 26.
    pub(crate) fn new(largest: f64) -> Self {
        let cells = Cells::new(largest);
        let powers = cells.fit(|t| {
            let values = |interval, node| entries([1.0, t.exp()], node_xi(interval, node));
            fit_intervals(values).into_flattened()
        });
        Self { cells, powers }
    }

    /// The entries of spheres of two radii at a gap, in a; positive.
    #[inline(never)]
    pub(crate) fn evaluate(&self, radius_i: f64, radius_j: f64, gap: f64) -> [f64; 3] {
        let logarithm = (2.0 * gap / (radius_i + radius_j)).ln();
        if logarithm > LAST {
            return [0.0; 3];
        }
        let length = radius_i.min(radius_j);
        let (interval, x) = locate(logarithm);
        let (cell, y) = self.cells.locate(radius_i.max(radius_j) / length);
        let powers: &[_; NODES] = &self.powers.as_chunks().0[cell * INTERVALS + interval];
        let [own, coupling, other] =
            horner_of_two(powers, x, y).map(|entry| length * length * length * entry);
        if radius_i > radius_j {
            [other, coupling, own]
        } else {
            [own, coupling, other]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::dense::Matrix;
    use crate::linalg::lu;

    /// X^C from the coupled multipoles `Q_n = start − Σ_s C(n+s, n) tⁿ t'^(s+1) s/(n+1) Q'_s`,
    /// solved as they stand.
    fn coupled(size_ratio: f64, xi: f64, orders: usize) -> [f64; 2] {
        let distance = 0.5 * (1.0 + size_ratio) * (2.0 + xi);
        let t = [1.0 / distance, size_ratio / distance];
        let mut matrix = Matrix::zeros(2 * orders, 2 * orders);
        let mut x = Matrix::zeros(2 * orders, 2);
        for sphere in 0..2 {
            let (own, other) = (t[sphere], t[1 - sphere]);
            let (row, column) = (sphere * orders, (1 - sphere) * orders);
            x[(row, sphere)] = 1.0;
            for n in 1..=orders {
                matrix[(row + n - 1, row + n - 1)] += 1.0;
                for s in 1..=orders {
                    let (n_, s_) = (n as f64, s as f64);
                    let binomial = libm::lgamma(n_ + s_ + 1.0)
                        - libm::lgamma(n_ + 1.0)
                        - libm::lgamma(s_ + 1.0);
                    let power = binomial + n_ * own.ln() + (s_ + 1.0) * other.ln();
                    matrix[(row + n - 1, column + s - 1)] += power.exp() * s_ / (n_ + 1.0);
                }
            }
        }
        lu::solve_once(&mut matrix, &mut x).unwrap();
        [x[(0, 0)], size_ratio * x[(0, 1)]]
    }

    #[test]
    fn twist_agrees_with_coupled_multipoles() {
        for size_ratio in [1.0, 0.5, 2.0, 1.4] {
            for xi in [0.05, 0.3, 2.0] {
                let expected = coupled(size_ratio, xi, 120);
                let found = twist(size_ratio, 2.0 + xi).unwrap();
                for k in 0..2 {
                    let error = (found[k] - expected[k]).abs();
                    assert!(
                        error < 1e-12,
                        "{size_ratio} {xi} {k}: {found:?} {expected:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn twist_has_the_values_of_an_independent_solution() {
        for (size_ratio, xi, expected) in [
            (1.0, 0.1, [1.02831, -0.11683]),
            (1.0, 0.01, [1.04677, -0.14419]),
            (1.0, 0.003, [1.04985, -0.14799]),
            (0.5, 0.1, [1.01241, -0.03442]),
            (0.5, 0.01, [1.01906, -0.04263]),
            (0.5, 0.003, [1.02011, -0.04380]),
        ] {
            let found = twist(size_ratio, 2.0 + xi).unwrap();
            for k in 0..2 {
                assert!(
                    (found[k] - expected[k]).abs() < 6e-6,
                    "{found:?} {expected:?}"
                );
            }
        }
    }

    #[test]
    fn twist_is_finite_at_contact_and_decays_far_apart() {
        // ζ(3), and x³ ζ(3, x) at x = 1/2 and 1/3.
        let zeta = 1.202_056_903_159_594_3;
        let [own, other] = functions(1.0, 1e-9)[0];
        assert!((own - 7.0 / 8.0 * zeta).abs() < 1e-7, "{own}");
        assert!((other + zeta / 8.0).abs() < 1e-7, "{other}");
        let [own, other] = functions(0.5, 1e-9)[0];
        assert!((own - 1.02078).abs() < 6e-6, "{own}");
        assert!((other + zeta / 27.0).abs() < 1e-7, "{other}");
        let (ratio, s_prime) = (1.5, 100.0);
        let r = 0.5 * 2.5 * s_prime;
        let [own, other] = twist(ratio, s_prime).unwrap();
        assert!((other / -(ratio / r).powi(3) - 1.0).abs() < 1e-5, "{other}");
        assert!((own - 1.0).abs() < 1e-10, "{own}");
    }

    #[test]
    fn range_meets_the_closed_form() {
        let range = TwistRange::new(12.0);
        for k in 0..60 {
            let xi = (-18.0 + 0.36 * f64::from(k)).exp();
            let ratio = 12.0_f64.powf(f64::from(k * 37 % 60) / 59.0);
            for [a, b] in [[0.7, 0.7 * ratio], [1.2 * ratio, 1.2]] {
                let found = range.evaluate(a, b, 0.5 * (a + b) * xi);
                let drags = [a.powi(3), (a * b).powf(1.5), b.powi(3)];
                for ((found, expected), drag) in
                    found.into_iter().zip(entries([a, b], xi)).zip(drags)
                {
                    let error = (found - expected).abs() / (8.0 * PI * drag);
                    assert!(error < 1e-9, "{a} {b} {xi}: {error:.1e}");
                }
            }
        }
    }

    #[test]
    fn table_meets_the_closed_form() {
        for [a, b] in [[1.0, 1.0], [1.0, 1.4], [1.4, 1.0], [0.7, 2.8]] {
            let table = TwistTable::new([a, b]);
            for k in 0..60 {
                let xi = (-18.0 + 0.36 * f64::from(k)).exp();
                let distance = 0.5 * (a + b) * (2.0 + xi);
                let t = (a * b / (distance * distance)).powi(3);
                let [first, second] = functions(b / a, xi);
                let found = table.evaluate(distance - a - b);
                for (found, expected) in found.into_iter().zip([
                    a.powi(3) * (first[0] - 1.0 / (1.0 - t)),
                    a.powi(3) * (first[1] + (b / distance).powi(3) / (1.0 - t)),
                    b.powi(3) * (second[0] - 1.0 / (1.0 - t)),
                ]) {
                    let error = (found / (8.0 * PI) - expected).abs() / a.max(b).powi(3);
                    assert!(error < 1e-9, "{a} {b} {xi}: {error:.1e}");
                }
            }
        }
    }
}
