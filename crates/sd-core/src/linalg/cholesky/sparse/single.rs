//! Solves with one supernode and one right-hand side, for vectorised callers.

use super::Node;
use crate::linalg::simd::vectorised;
use crate::threads;

/// Number of spheres whose columns are subtracted from the rows below together.
const SPHERES: usize = 4;
/// Columns of a large supernode that one thread solves before several subtract them.
const BLOCK: usize = 96;
/// Fewest values that one of them reads.
const LEAST_VALUES: usize = 15_000;

/// `x ← L⁻¹ x` in the columns of a supernode; `updates`: updates of its rows below.
#[inline(always)]
pub(super) fn lower(node: &Node, factor: &[f32], x: &mut [f32], updates: &mut [f32]) {
    solve_block(node, factor, 0, x);
    updates.fill(0.0);
    subtract_columns(node, factor, (0, x), (node.width, updates));
}

/// Whether a supernode is so large that several threads solve with it.
pub(super) fn is_large(node: &Node) -> bool {
    threads::parts(node.width * node.height(), 2 * LEAST_VALUES) > 1
}

/// [`lower`] by several threads, with the same bits.
pub(super) fn lower_together(node: &Node, factor: &[f32], x: &mut [f32], updates: &mut [f32]) {
    for begin in (0..node.width).step_by(BLOCK) {
        let end = (begin + BLOCK).min(node.width);
        let (own, rest) = x[begin..].split_at_mut(end - begin);
        vectorised(
            #[inline(always)]
            || solve_block(node, factor, begin, own),
        );
        let own = &*own;
        threads::divide(rest, LEAST_VALUES / BLOCK, &|first, rest| {
            vectorised(
                #[inline(always)]
                || subtract_columns(node, factor, (begin, own), (end + first, rest)),
            );
        });
    }
    let x = &*x;
    threads::divide(updates, LEAST_VALUES / BLOCK, &|first, updates| {
        vectorised(
            #[inline(always)]
            || {
                updates.fill(0.0);
                subtract_columns(node, factor, (0, x), (node.width + first, updates));
            },
        );
    });
}

/// `x ← L⁻¹ x` in some columns of a supernode, from `begin` on, by these alone.
#[inline(always)]
fn solve_block(node: &Node, factor: &[f32], begin: usize, x: &mut [f32]) {
    for j in (0..x.len()).step_by(3) {
        let [a, b, c] = node.columns(factor, begin + j);
        let (top, rest) = x[j..].split_at_mut(3);
        let xa = top[0] / a[0];
        let xb = (top[1] - a[1] * xa) / b[1];
        let xc = (top[2] - a[2] * xa - b[2] * xb) / c[2];
        top.copy_from_slice(&[xa, xb, xc]);
        let columns = [a, b, c].map(|column| &column[3..3 + rest.len()]);
        subtract(rest, [columns], [[xa, xb, xc]]);
    }
}

/// Subtracts columns from the first given on, times their weights, from rows from the first given
/// on.
#[inline(always)]
fn subtract_columns(
    node: &Node,
    factor: &[f32],
    (column, weights): (usize, &[f32]),
    (row, x): (usize, &mut [f32]),
) {
    let from_row = |j: usize| node.columns(factor, j).map(|column| &column[row - j..]);
    let (many, few) = weights.as_chunks::<3>().0.as_chunks::<SPHERES>();
    for (number, weights) in many.iter().enumerate() {
        let first = column + 3 * SPHERES * number;
        subtract(
            x,
            std::array::from_fn(|g| from_row(first + 3 * g)),
            *weights,
        );
    }
    for (number, weights) in few.iter().enumerate() {
        let first = column + 3 * (SPHERES * many.len() + number);
        subtract(x, [from_row(first)], [*weights]);
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
        let columns = node.columns(factor, j);
        let (own, known) = x[j..].split_at_mut(3);
        let rows = |first: usize, count: usize| columns.map(|column| &column[first..first + count]);
        let inside = dot_three(rows(3, known.len()), known);
        let outside = dot_three(rows(3 + known.len(), below.len()), below);
        solve_upper(columns, own, [inside, outside]);
    }
}

/// [`upper`] by several threads, with the same bits; `work`: sums of the rows below.
pub(super) fn upper_together(
    node: &Node,
    factor: &[f32],
    (x, below): (&mut [f32], &[f32]),
    work: &mut Vec<[f32; 3]>,
) {
    work.resize((node.width / 3).max(work.len()), [0.0; 3]);
    let sums_below = &mut work[..node.width / 3];
    let least = LEAST_VALUES / (3 * below.len()).max(1);
    threads::divide(sums_below, least.max(1), &|first, sums| {
        vectorised(
            #[inline(always)]
            || {
                for (sphere, sums) in (first..).zip(sums) {
                    let columns = node.columns(factor, 3 * sphere);
                    let outside = node.width - 3 * sphere;
                    *sums = dot_three(columns.map(|column| &column[outside..]), below);
                }
            },
        );
    });
    vectorised(
        #[inline(always)]
        || {
            for (sphere, sums_below) in sums_below.iter().enumerate().rev() {
                let columns = node.columns(factor, 3 * sphere);
                let (own, known) = x[3 * sphere..].split_at_mut(3);
                let inside = columns.map(|column| &column[3..3 + known.len()]);
                let sums = [dot_three(inside, known), *sums_below];
                solve_upper(columns, own, sums);
            }
        },
    );
}

/// Solves for one sphere, given sums of its columns times known rows.
#[inline(always)]
fn solve_upper([a, b, c]: [&[f32]; 3], own: &mut [f32], parts: [[f32; 3]; 2]) {
    let mut sums = [0.0; 3];
    for part in parts {
        for k in 0..3 {
            sums[k] += part[k];
        }
    }
    own[2] = (own[2] - sums[2]) / c[2];
    own[1] = (own[1] - sums[1] - b[2] * own[2]) / b[1];
    own[0] = (own[0] - sums[0] - a[1] * own[1] - a[2] * own[2]) / a[0];
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
