//! Dot products and sums of vectors, in a fixed order of summation.

use super::simd::vectorised;

/// Dot product, in a fixed order of summation.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    vectorised(|| dot_inline(a, b))
}

/// [`dot`] for vectorised callers: sixteen partial sums.
#[inline(always)]
pub(super) fn dot_inline(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 16];
    let (a16, b16) = (a.chunks_exact(16), b.chunks_exact(16));
    let mut total = 0.0;
    for (x, y) in a16.remainder().iter().zip(b16.remainder()) {
        total += x * y;
    }
    for (x, y) in a16.zip(b16) {
        for k in 0..16 {
            sums[k] += x[k] * y[k];
        }
    }
    for sum in sums {
        total += sum;
    }
    total
}

/// Dot products of four vectors with one, all of its length, for vectorised callers.
#[inline(always)]
pub(super) fn dot_four(a: [&[f64]; 4], b: &[f64]) -> [f64; 4] {
    let length = b.len();
    let a = a.map(|x| &x[..length]);
    let mut sums = [[0.0; 8]; 4];
    let whole = length - length % 8;
    for at in (0..whole).step_by(8) {
        let y = &b[at..at + 8];
        for (sum, x) in sums.iter_mut().zip(a) {
            let x = &x[at..at + 8];
            for k in 0..8 {
                sum[k] += x[k] * y[k];
            }
        }
    }
    let mut totals =
        sums.map(|s| ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7])));
    for at in whole..length {
        for (total, x) in totals.iter_mut().zip(a) {
            *total += x[at] * b[at];
        }
    }
    totals
}

/// `y ← y + s x`.
pub(crate) fn add_scaled(y: &mut [f64], x: &[f64], s: f64) {
    vectorised(|| add_scaled_inline(y, x, s));
}

/// `y ← y + s x`, then the dot product of y with z, in one pass; the bits are those of
/// [`add_scaled`] and [`dot`].
pub(crate) fn add_scaled_and_dot(y: &mut [f64], x: &[f64], s: f64, z: &[f64]) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let (x16, x_rest) = x[..y.len()].as_chunks::<16>();
            let (z16, z_rest) = z[..y.len()].as_chunks::<16>();
            let (y16, y_rest) = y.as_chunks_mut::<16>();
            let mut total = 0.0;
            for ((y, x), z) in y_rest.iter_mut().zip(x_rest).zip(z_rest) {
                *y += s * x;
                total += z * *y;
            }
            let mut sums = [0.0; 16];
            for ((y, x), z) in y16.iter_mut().zip(x16).zip(z16) {
                let mut new = *y;
                for k in 0..16 {
                    new[k] += s * x[k];
                    sums[k] += z[k] * new[k];
                }
                *y = new;
            }
            for sum in sums {
                total += sum;
            }
            total
        },
    )
}

/// [`add_scaled`] for vectorised callers.
#[inline(always)]
pub(super) fn add_scaled_inline(y: &mut [f64], x: &[f64], s: f64) {
    for (yi, xi) in y.iter_mut().zip(x) {
        *yi += s * xi;
    }
}

/// `y ← y + Σ s_k x_k` for four vectors at least as long as y, for vectorised callers.
#[inline(always)]
pub(super) fn add_four(y: &mut [f64], x: [&[f64]; 4], s: [f64; 4]) {
    let length = y.len();
    let [a, b, c, d] = x.map(|x| &x[..length]);
    for i in 0..length {
        y[i] += (s[0] * a[i] + s[1] * b[i]) + (s[2] * c[i] + s[3] * d[i]);
    }
}

/// `y_c ← y_c − Σ_k u_ck l_k` for two vectors y at once and four vectors l at least as long, for
/// vectorised callers.
#[inline(always)]
pub(super) fn subtract_four_from_two(y: [&mut [f64]; 2], l: [&[f64]; 4], u: [[f64; 4]; 2]) {
    /// Block size. Entries are copied first, so that the compiler need not assume that the vectors
    /// overlap.
    const LANES: usize = 8;
    let [y0, y1] = y;
    let length = y0.len();
    let (y0, end0) = y0.as_chunks_mut::<LANES>();
    let (y1, end1) = y1[..length].as_chunks_mut::<LANES>();
    let [(a, end_a), (b, end_b), (c, end_c), (d, end_d)] =
        l.map(|x| x[..length].as_chunks::<LANES>());
    let [u0, u1] = u.map(|u| u.map(|x| -x));
    let both = y0.iter_mut().zip(y1.iter_mut());
    let columns = a.iter().zip(b).zip(c.iter().zip(d));
    for ((y0, y1), ((a, b), (c, d))) in both.zip(columns) {
        let (mut s0, mut s1) = (*y0, *y1);
        for (x, k) in [(a, 0), (b, 1), (c, 2), (d, 3)] {
            for i in 0..LANES {
                s0[i] = x[i].mul_add(u0[k], s0[i]);
                s1[i] = x[i].mul_add(u1[k], s1[i]);
            }
        }
        (*y0, *y1) = (s0, s1);
    }
    let ends = [(end_a, 0), (end_b, 1), (end_c, 2), (end_d, 3)].map(|(x, k)| (x, u0[k], u1[k]));
    for (i, (y0, y1)) in end0.iter_mut().zip(end1).enumerate() {
        let (mut s0, mut s1) = (*y0, *y1);
        for (x, u0, u1) in ends {
            s0 = x[i].mul_add(u0, s0);
            s1 = x[i].mul_add(u1, s1);
        }
        (*y0, *y1) = (s0, s1);
    }
}

/// Largest magnitude, for vectorised callers; NaN entries are ignored.
#[inline(always)]
pub(super) fn largest(x: &[f64]) -> f64 {
    let larger = |m: f64, x: f64| if x.abs() > m { x.abs() } else { m };
    let (eights, rest) = x.as_chunks::<8>();
    let mut most = [0.0; 8];
    for eight in eights {
        for (m, &x) in most.iter_mut().zip(eight) {
            *m = larger(*m, x);
        }
    }
    most.iter().chain(rest).fold(0.0, |m, &x| larger(m, x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pass_has_the_bits_of_two() {
        let vector = |shift: f64| (0..37).map(move |k| (f64::from(k) + shift).sin());
        let (x, z): (Vec<_>, Vec<_>) = (vector(0.3).collect(), vector(1.1).collect());
        let (mut one, mut two): (Vec<_>, Vec<_>) = (vector(0.0).collect(), vector(0.0).collect());
        let product = add_scaled_and_dot(&mut one, &x, -0.7, &z);
        add_scaled(&mut two, &x, -0.7);
        assert_eq!(one, two);
        assert_eq!(product.to_bits(), dot(&z, &two).to_bits());
    }
}
