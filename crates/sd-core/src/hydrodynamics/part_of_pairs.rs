//! Pairs of some of the spheres, in the order of all pairs: what one thread of several computes.
//!
//! A thread adds to its own spheres only, whatever the pairs. As pairs are ordered by (i, j), every
//! sphere has its sums in the same order as if one thread computed all of them.

use crate::threads;
use std::ops::Range;

/// Fewest spheres for which a thread computes blocks or products.
pub(crate) const LEAST_SPHERES: usize = 250;

/// Lists where the pairs of each first sphere start, then their number; `firsts` are ordered.
pub(crate) fn list_starts(
    spheres: usize,
    firsts: impl Iterator<Item = usize>,
    starts: &mut Vec<usize>,
) {
    starts.clear();
    let mut count = 0;
    for first in firsts {
        while starts.len() <= first {
            starts.push(count);
        }
        count += 1;
    }
    starts.resize(spheres + 1, count);
}

/// Those of the pairs of one first sphere whose second spheres are from `from` to before `end`.
#[inline(always)]
pub(crate) fn part_of(
    pairs: Range<usize>,
    second: impl Fn(usize) -> usize,
    from: usize,
    end: usize,
) -> Range<usize> {
    let bound = |pairs: Range<usize>, limit: usize| {
        let (mut low, mut high) = (pairs.start, pairs.end);
        // The ends are looked at first: they decide where one thread computes all.
        if low == high || second(high - 1) < limit {
            return high;
        }
        while low < high {
            let middle = usize::midpoint(low, high);
            if second(middle) < limit {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        low
    };
    let first = if from == 0 {
        pairs.start
    } else {
        bound(pairs.clone(), from)
    };
    first..bound(first..pairs.end, end)
}

/// Visits the pairs that have a sphere in a range: with the number of each, and whether its first
/// and its second sphere are in the range.
#[inline(always)]
pub(crate) fn for_pairs_of(
    range: &Range<usize>,
    starts: &[usize],
    second: impl Fn(usize) -> usize,
    mut visit: impl FnMut(usize, [bool; 2]),
) {
    // One place where `visit` is called, so that it is compiled for the caller's instruction set.
    for i in 0..range.end {
        let (all, is_own) = (starts[i]..starts[i + 1], range.start <= i);
        let pairs = if is_own {
            all
        } else {
            part_of(all, &second, range.start, range.end)
        };
        for at in pairs {
            visit(at, [is_own, second(at) < range.end]);
        }
    }
}

/// Divides a list of the spheres and one of the pairs, listed by first sphere, among the threads;
/// `compute` gets a range of spheres, their part, and the part of their pairs as first spheres.
pub(crate) fn divide_spheres<A: Send, B: Send>(
    (spheres, pairs): (&mut [A], &mut [B]),
    starts: &[usize],
    least: usize,
    compute: &(impl Fn(Range<usize>, &mut [A], &mut [B]) + Sync),
) {
    let parts = threads::parts(spheres.len(), least);
    divide_from(0, (spheres, pairs), starts, parts, compute);
}

fn divide_from<A: Send, B: Send>(
    first: usize,
    (spheres, pairs): (&mut [A], &mut [B]),
    starts: &[usize],
    parts: usize,
    compute: &(impl Fn(Range<usize>, &mut [A], &mut [B]) + Sync),
) {
    if parts == 1 {
        return compute(first..first + spheres.len(), spheres, pairs);
    }
    let before = parts / 2;
    let middle = spheres.len() * before / parts;
    let (left, right) = spheres.split_at_mut(middle);
    let of_left = starts[first + middle] - starts[first];
    let (pairs_left, pairs_right) = pairs.split_at_mut(of_left);
    let next = first + middle;
    threads::both(
        || divide_from(first, (left, pairs_left), starts, before, compute),
        || divide_from(next, (right, pairs_right), starts, parts - before, compute),
    );
}
