//! Parts of a factor that are computed independently: subtrees of the elimination tree, and the
//! supernodes above them.
//!
//! They depend on the pattern alone. Every row has its sums in the same order as without parts.

use super::Node;
use std::collections::BinaryHeap;

/// Number of groups of subtrees.
const GROUPS: usize = 2;
/// Fewest values of a factor that is divided.
const LEAST_VALUES: usize = 150_000;
/// Most supernodes above the subtrees.
const MOST_ABOVE: usize = 64;

/// The supernodes of each part, ascending: groups of subtrees, if any, and last those above.
pub(super) fn divide(nodes: &[Node], owner: &[usize], below: &[usize]) -> Vec<Vec<usize>> {
    let parent = |k: usize| below[nodes[k].below.clone()].first().map(|&row| owner[row]);
    let values = |k: usize| nodes[k].width * nodes[k].height();
    let total: usize = (0..nodes.len()).map(values).sum();
    if total < LEAST_VALUES {
        return vec![(0..nodes.len()).collect()];
    }
    let mut sizes: Vec<usize> = (0..nodes.len()).map(values).collect();
    let mut children = vec![Vec::new(); nodes.len()];
    let mut heap = BinaryHeap::new();
    for k in 0..nodes.len() {
        if let Some(parent) = parent(k) {
            sizes[parent] += sizes[k];
            children[parent].push(k);
        } else {
            heap.push((sizes[k], k));
        }
    }
    // The largest subtrees are opened while that shortens the time of as many threads as groups.
    let (mut opened, mut of_opened) = (Vec::new(), 0);
    let (mut best, mut count) = (usize::MAX, 0);
    while let Some(&(largest, k)) = heap.peek() {
        let time = of_opened + largest.max((total - of_opened).div_ceil(GROUPS));
        if time < best {
            (best, count) = (time, opened.len());
        }
        if opened.len() == MOST_ABOVE {
            break;
        }
        heap.pop();
        opened.push(k);
        of_opened += values(k);
        heap.extend(children[k].iter().map(|&child| (sizes[child], child)));
    }
    let mut part = vec![None; nodes.len()];
    for &k in &opened[..count] {
        part[k] = Some(GROUPS);
    }
    // The next subtree, from the largest on, to the group that has least.
    let is_above = |k: usize, part: &[Option<usize>]| part[k] == Some(GROUPS);
    let roots = (0..nodes.len())
        .filter(|&k| !is_above(k, &part) && parent(k).is_none_or(|parent| is_above(parent, &part)));
    let mut roots: Vec<_> = roots.map(|k| (sizes[k], k)).collect();
    roots.sort_unstable_by(|a, b| b.cmp(a));
    let mut loads = [0; GROUPS];
    for (size, root) in roots {
        let group = (0..GROUPS).min_by_key(|&group| (loads[group], group));
        let group = group.unwrap_or(0);
        loads[group] += size;
        part[root] = Some(group);
    }
    let mut parts = vec![Vec::new(); GROUPS + 1];
    for k in (0..nodes.len()).rev() {
        let own = part[k].or_else(|| parent(k).and_then(|parent| part[parent]));
        part[k] = own;
    }
    for (k, part) in part.iter().enumerate() {
        parts[part.unwrap_or(GROUPS)].push(k);
    }
    parts
}
