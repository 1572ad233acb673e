//! Solves with eight supernodes side by side and one right-hand side, for callers that are vectorised themselves: what [`super::single`] does
//! with one, with the same bits.

use super::lanes::{LANES, Lanes};
use std::ops::Range;

/// Solves with their columns; what is left for the rows below. `values`: `[rows × columns]`.
#[inline(always)]
pub(super) fn lower(values: &[Lanes], own: &mut [Lanes], below: &mut [Lanes]) {
    let width = own.len();
    let (top_rows, rows_below) = values.split_at(width * width);
    for (j, rows) in (0..width).step_by(3).zip(top_rows.chunks_exact(3 * width)) {
        let (known, top) = own.split_at_mut(j);
        let [first, second, third] = subtracted([top[0], top[1], top[2]], rows, width, known);
        let (a, b, c) = (&rows[j..], &rows[width + j..], &rows[2 * width + j..]);
        let first = over(first, a[0]);
        let second = over(less(second, b[0], first), b[1]);
        let third = over(less(less(third, c[0], first), c[1], second), c[2]);
        top[..3].copy_from_slice(&[first, second, third]);
    }
    let (pairs, last) = below.as_chunks_mut::<2>();
    for (pair, rows) in pairs.iter_mut().zip(rows_below.chunks_exact(2 * width)) {
        *pair = subtracted([[0.0; LANES]; 2], rows, width, own);
    }
    for last in last {
        let row = &rows_below[rows_below.len() - width..];
        [*last] = subtracted([[0.0; LANES]], row, width, own);
    }
}

/// `start − row · known` for some rows of that width, three columns at a time.
#[inline(always)]
fn subtracted<const ROWS: usize>(
    mut sums: [Lanes; ROWS],
    rows: &[Lanes],
    width: usize,
    known: &[Lanes],
) -> [Lanes; ROWS] {
    for (number, [x, y, z]) in known.as_chunks().0.iter().enumerate() {
        for (row, sum) in sums.iter_mut().enumerate() {
            let three = &rows[row * width + 3 * number..][..3];
            let (a, b, c) = (
                times(three[0], *x),
                times(three[1], *y),
                times(three[2], *z),
            );
            *sum = minus(*sum, plus(plus(a, b), c));
        }
    }
    sums
}

/// Solves with the transpose of their columns, from the rows below; see [`lower`]. `whole`: how many of these are summed eight at a
/// time.
#[inline(always)]
pub(super) fn upper(values: &[Lanes], whole: usize, own: &mut [Lanes], below: &[Lanes]) {
    let width = own.len();
    let (top_rows, rows_below) = values.split_at(width * width);
    for j in (0..width).step_by(3).rev() {
        let (top, known) = own[j..].split_at_mut(3);
        let inside = known.len();
        let (columns, whole_inside) = (j..j + 3, inside - inside % LANES);
        let by_own = dot_three(
            &top_rows[(j + 3) * width..],
            width,
            &columns,
            known,
            whole_inside,
        );
        let by_below = dot_three(rows_below, width, &columns, below, whole);
        let row = |k: usize| &top_rows[(j + k) * width + j..][..3];
        let (a, b, c) = (row(0), row(1), row(2));
        let known = |k: usize| minus(top[k], plus(by_own[k], by_below[k]));
        let third = over(known(2), c[2]);
        let second = over(less(known(1), c[1], third), b[1]);
        let first = over(less(less(known(0), b[0], second), c[0], third), a[0]);
        top.copy_from_slice(&[first, second, third]);
    }
}

/// Dot products of three columns with x, of rows that are `width` long: of the first `whole` in eight partial sums, then one by one.
#[inline(always)]
fn dot_three(
    rows: &[Lanes],
    width: usize,
    columns: &Range<usize>,
    x: &[Lanes],
    whole: usize,
) -> [Lanes; 3] {
    let mut totals = [[0.0; LANES]; 3];
    if whole > 0 {
        for (column, total) in columns.clone().zip(&mut totals) {
            let mut s = [[0.0; LANES]; 8];
            for (number, x) in x[..whole].as_chunks::<8>().0.iter().enumerate() {
                for (k, s) in s.iter_mut().enumerate() {
                    *s = plus(*s, times(rows[(8 * number + k) * width + column], x[k]));
                }
            }
            *total = plus(
                plus(plus(s[0], s[4]), plus(s[1], s[5])),
                plus(plus(s[2], s[6]), plus(s[3], s[7])),
            );
        }
    }
    for (row, x) in x.iter().enumerate().skip(whole) {
        let three = &rows[row * width..][columns.clone()];
        for (total, value) in totals.iter_mut().zip(three) {
            *total = plus(*total, times(*value, *x));
        }
    }
    totals
}

#[inline(always)]
fn plus(mut a: Lanes, b: Lanes) -> Lanes {
    for (a, b) in a.iter_mut().zip(b) {
        *a += b;
    }
    a
}

#[inline(always)]
fn minus(mut a: Lanes, b: Lanes) -> Lanes {
    for (a, b) in a.iter_mut().zip(b) {
        *a -= b;
    }
    a
}

#[inline(always)]
fn times(mut a: Lanes, b: Lanes) -> Lanes {
    for (a, b) in a.iter_mut().zip(b) {
        *a *= b;
    }
    a
}

#[inline(always)]
fn over(mut a: Lanes, b: Lanes) -> Lanes {
    for (a, b) in a.iter_mut().zip(b) {
        *a /= b;
    }
    a
}

/// `sum − a x`.
#[inline(always)]
fn less(sum: Lanes, a: Lanes, x: Lanes) -> Lanes {
    minus(sum, times(a, x))
}
