//! Solves with eight supernodes in parallel and one right-hand side, for vectorised callers: like
//! [`super::single`] for one, with the same bits.

use super::lanes::{LANES, Lanes};

/// Number of values of supernodes side by side: for each sphere its three columns, row after row
/// from its own first row on.
pub(super) fn values(width: usize, below: usize) -> usize {
    start(width, width + below)
}

/// Start of the values of the sphere with columns from `column` on, in supernodes of that height.
#[inline(always)]
pub(super) fn start(column: usize, height: usize) -> usize {
    // Each sphere before has three columns and starts three rows below the one before it.
    let spheres = column / 3;
    3 * spheres * height - 9 * (spheres * spheres.saturating_sub(1) / 2)
}

/// Solves with their columns, and accumulates updates of the rows below.
#[inline(always)]
pub(super) fn lower(values: &[Lanes], own: &mut [Lanes], below: &mut [Lanes]) {
    let (width, height) = (own.len(), own.len() + below.len());
    for j in (0..width).step_by(3) {
        let (known, top) = own.split_at_mut(j);
        let [first, second, third] = subtracted([top[0], top[1], top[2]], values, j, height, known);
        let triangle = &values[start(j, height)..][..9];
        let (a, b, c) = (&triangle[..3], &triangle[3..6], &triangle[6..]);
        let first = over(first, a[0]);
        let second = over(less(second, b[0], first), b[1]);
        let third = over(less(less(third, c[0], first), c[1], second), c[2]);
        top[..3].copy_from_slice(&[first, second, third]);
    }
    let (pairs, last) = below.as_chunks_mut::<2>();
    for (row, pair) in (width..).step_by(2).zip(pairs) {
        *pair = subtracted([[0.0; LANES]; 2], values, row, height, own);
    }
    for last in last {
        [*last] = subtracted([[0.0; LANES]], values, height - 1, height, own);
    }
}

/// `start − row · known` for some rows from `first` on, three columns at a time.
#[inline(always)]
fn subtracted<const ROWS: usize>(
    mut sums: [Lanes; ROWS],
    values: &[Lanes],
    first: usize,
    height: usize,
    known: &[Lanes],
) -> [Lanes; ROWS] {
    let mut at = 3 * first;
    for (number, [x, y, z]) in known.as_chunks().0.iter().enumerate() {
        let rows = values[at..at + 3 * ROWS].as_chunks::<3>().0;
        for (row, sum) in rows.iter().zip(&mut sums) {
            let (a, b, c) = (times(row[0], *x), times(row[1], *y), times(row[2], *z));
            *sum = minus(*sum, plus(plus(a, b), c));
        }
        at += 3 * (height - 3 * number) - 9;
    }
    sums
}

/// Solves with the transpose of their columns, from the rows below; see [`lower`]. `whole`: the
/// number of these that are summed in groups of eight.
#[inline(always)]
pub(super) fn upper(values: &[Lanes], whole: usize, own: &mut [Lanes], below: &[Lanes]) {
    let (width, height) = (own.len(), own.len() + below.len());
    for j in (0..width).step_by(3).rev() {
        let (top, known) = own[j..].split_at_mut(3);
        let inside = known.len();
        let rows = values[start(j, height)..][..3 * (height - j)]
            .as_chunks::<3>()
            .0;
        let ([a, b, c], rows) = rows.split_first_chunk::<3>().expect("three rows");
        let (rows_inside, rows_below) = rows.split_at(inside);
        let by_own = dot_three(rows_inside, known, inside - inside % LANES);
        let by_below = dot_three(rows_below, below, whole);
        let known = |k: usize| minus(top[k], plus(by_own[k], by_below[k]));
        let third = over(known(2), c[2]);
        let second = over(less(known(1), c[1], third), b[1]);
        let first = over(less(less(known(0), b[0], second), c[0], third), a[0]);
        top.copy_from_slice(&[first, second, third]);
    }
}

/// Dot products of three columns with x: of the first `whole` rows in eight partial sums, then one
/// by one.
#[inline(always)]
fn dot_three(rows: &[[Lanes; 3]], x: &[Lanes], whole: usize) -> [Lanes; 3] {
    let mut totals = [[0.0; LANES]; 3];
    let (whole_rows, last_rows) = rows.split_at(whole);
    let (whole_x, last_x) = x.split_at(whole);
    if whole > 0 {
        for (column, total) in totals.iter_mut().enumerate() {
            let mut s = [[0.0; LANES]; 8];
            let eights = whole_rows.as_chunks::<8>().0;
            for (rows, x) in eights.iter().zip(whole_x.as_chunks::<8>().0) {
                for ((s, row), x) in s.iter_mut().zip(rows).zip(x) {
                    *s = plus(*s, times(row[column], *x));
                }
            }
            *total = plus(
                plus(plus(s[0], s[4]), plus(s[1], s[5])),
                plus(plus(s[2], s[6]), plus(s[3], s[7])),
            );
        }
    }
    for (row, x) in last_rows.iter().zip(last_x) {
        for (total, value) in totals.iter_mut().zip(row) {
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
