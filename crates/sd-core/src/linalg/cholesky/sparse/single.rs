//! Solves with one supernode and one right-hand side, for vectorised callers.

use super::Node;

/// Number of spheres whose columns are subtracted from the rows below together.
const SPHERES: usize = 4;

/// `x ← L⁻¹ x` in the columns of a supernode; `updates`: updates of its rows below.
#[inline(always)]
pub(super) fn lower(node: &Node, factor: &[f32], x: &mut [f32], updates: &mut [f32]) {
    for j in (0..node.width).step_by(3) {
        let [a, b, c] = node.columns(factor, j);
        let (top, rest) = x[j..].split_at_mut(3);
        let xa = top[0] / a[0];
        let xb = (top[1] - a[1] * xa) / b[1];
        let xc = (top[2] - a[2] * xa - b[2] * xb) / c[2];
        top.copy_from_slice(&[xa, xb, xc]);
        let inside = 3..node.width - j;
        let columns = [a, b, c].map(|column| &column[inside.clone()]);
        subtract(rest, [columns], [[xa, xb, xc]]);
    }
    updates.fill(0.0);
    let below = |j: usize| {
        node.columns(factor, j)
            .map(|column| &column[node.width - j..])
    };
    let (many, few) = x.as_chunks::<3>().0.as_chunks::<SPHERES>();
    for (number, weights) in many.iter().enumerate() {
        let first = 3 * SPHERES * number;
        subtract(
            updates,
            std::array::from_fn(|g| below(first + 3 * g)),
            *weights,
        );
    }
    for (number, weights) in few.iter().enumerate() {
        let first = 3 * (SPHERES * many.len() + number);
        subtract(updates, [below(first)], [*weights]);
    }
}

/// `x ← x − Σ weight · column` for the three columns of G spheres in sequence, in blocks of eight
/// rows.
#[inline(always)]
fn subtract<const G: usize>(x: &mut [f32], columns: [[&[f32]; 3]; G], weights: [[f32; 3]; G]) {
    let columns = columns.map(|three| three.map(|column| &column[..x.len()]));
    let (eights, rest) = x.as_chunks_mut::<8>();
    let whole = 8 * eights.len();
    for (number, x) in eights.iter_mut().enumerate() {
        let mut new = *x;
        for (three, [wa, wb, wc]) in columns.iter().zip(weights) {
            let [a, b, c] = three.map(|column| &column[8 * number..8 * number + 8]);
            for k in 0..8 {
                new[k] -= a[k] * wa + b[k] * wb + c[k] * wc;
            }
        }
        *x = new;
    }
    for (row, x) in (whole..).zip(rest) {
        for ([a, b, c], [wa, wb, wc]) in columns.iter().zip(weights) {
            *x -= a[row] * wa + b[row] * wb + c[row] * wc;
        }
    }
}

/// `x ← L⁻ᵀ x` in the columns of a supernode, by those of its rows below.
#[inline(always)]
pub(super) fn upper(node: &Node, factor: &[f32], x: &mut [f32], below: &[f32]) {
    for j in (0..node.width).step_by(3).rev() {
        let [a, b, c] = node.columns(factor, j);
        let inside = 3..node.width - j;
        let outside = inside.end..inside.end + below.len();
        let mut sums = [0.0; 3];
        for (known, rows) in [(&x[j + 3..], inside), (below, outside)] {
            let parts = dot_three([a, b, c].map(|column| &column[rows.clone()]), known);
            for k in 0..3 {
                sums[k] += parts[k];
            }
        }
        let own = &mut x[j..j + 3];
        own[2] = (own[2] - sums[2]) / c[2];
        own[1] = (own[1] - sums[1] - b[2] * own[2]) / b[1];
        own[0] = (own[0] - sums[0] - a[1] * own[1] - a[2] * own[2]) / a[0];
    }
}

/// Dot products of three vectors with one, in eight partial sums each.
#[inline(always)]
fn dot_three(a: [&[f32]; 3], b: &[f32]) -> [f32; 3] {
    let length = b.len();
    let a = a.map(|x| &x[..length]);
    let mut sums = [[0.0; 8]; 3];
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
