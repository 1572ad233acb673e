//! Interpolating polynomials of several functions at once.

use std::f64::consts::PI;

/// Chebyshev points of [−1, 1], descending.
pub(crate) fn chebyshev_points<const N: usize>() -> [f64; N] {
    std::array::from_fn(|k| (PI * (k as f64 + 0.5) / N as f64).cos())
}

/// Coefficients of powers, constant terms first, of the polynomials with these values at the
/// points, by Newton's divided differences.
pub(crate) fn interpolate<const N: usize, const L: usize>(
    points: &[f64; N],
    mut values: [[f64; L]; N],
) -> [[f64; L]; N] {
    for order in 1..N {
        for k in (order..N).rev() {
            let before = values[k - 1];
            for (value, before) in values[k].iter_mut().zip(before) {
                *value = (*value - before) / (points[k] - points[k - order]);
            }
        }
    }
    let mut coefficients = [[0.0; L]; N];
    for k in (0..N).rev() {
        // coefficients ← coefficients (u − point) + difference
        for power in (0..N).rev() {
            for lane in 0..L {
                let lower = match power {
                    0 => values[k][lane],
                    _ => coefficients[power - 1][lane],
                };
                coefficients[power][lane] = lower - points[k] * coefficients[power][lane];
            }
        }
    }
    coefficients
}

/// The values of polynomials at x, from coefficients of powers.
#[inline(always)]
pub(crate) fn horner<const N: usize, const L: usize>(powers: &[[f64; L]; N], x: f64) -> [f64; L] {
    let mut sums = powers[N - 1];
    for power in powers[..N - 1].iter().rev() {
        for lane in 0..L {
            sums[lane] = sums[lane].mul_add(x, power[lane]);
        }
    }
    sums
}

/// The values at (x, y) of polynomials in both, from coefficients by the power of x, then of y.
#[inline(always)]
pub(crate) fn horner_of_two<const N: usize, const M: usize, const L: usize>(
    powers: &[[[f64; L]; M]; N],
    x: f64,
    y: f64,
) -> [f64; L] {
    horner(&powers.each_ref().map(|powers| horner(powers, y)), x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_found_from_its_values() {
        let polynomial = |x: f64| [1.0 - 2.0 * x + 0.5 * x * x * x, x * x - 3.0];
        let points = chebyshev_points::<6>();
        let powers = interpolate(&points, points.map(polynomial));
        let expected = [[1.0, -3.0], [-2.0, 0.0], [0.0, 1.0], [0.5, 0.0]];
        for (power, found) in powers.iter().enumerate() {
            let expected = expected.get(power).copied().unwrap_or_default();
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-14, "{power}: {found}");
            }
        }
        for x in [-0.9, 0.3, 1.0] {
            for (found, expected) in horner(&powers, x).into_iter().zip(polynomial(x)) {
                assert!((found - expected).abs() < 1e-14, "{x}: {found}");
            }
        }
    }
}
