//! Solves with one right-hand side, eight supernodes in parallel.
//!
//! Most supernodes have few spheres, and each of their steps depends on the one before; independent
//! supernodes can be solved in parallel. A level has all supernodes whose descendants are in
//! earlier levels. Up to eight of a level are stored interleaved as a batch, padded with zeros
//! where their sizes differ: in the first columns, and between the rows below that are summed in
//! groups of eight and the others. So every sum has the same bits as in [`super::single`].
//!
//! Vectors use the same order: eight interleaved entries for each column of a batch, consecutive
//! ones for a single supernode.

use super::lanes::{LANES, Lanes};
use super::{Node, eight, narrow, single};
use std::ops::Range;

/// Batches of supernodes and their order.
#[derive(Debug, Default)]
pub(super) struct SolveOrder {
    levels: Vec<Level>,
    batches: Vec<Batch>,
    singles: Vec<Single>,
    /// Position of each row in a vector, and the length of vectors, in eights. The last eight are
    /// zeros.
    places: Vec<u32>,
    length: usize,
    /// Positions of the rows below: interleaved for batches, then for single supernodes. Padding
    /// refers to a zero.
    batched_below: Vec<[u32; LANES]>,
    single_below: Vec<u32>,
    /// Updates of supernodes to rows of later levels.
    scatters: Vec<Scatter>,
    /// Number of values of all batches, and of updates, in eights.
    values: usize,
    slots: usize,
}

/// Ranges of the lists of a level.
#[derive(Debug)]
struct Level {
    scatters: Range<usize>,
    batches: Range<usize>,
    singles: Range<usize>,
}

/// A batch of up to eight supernodes.
#[derive(Debug)]
struct Batch {
    nodes: Vec<usize>,
    /// Columns of the widest, and their start in a vector, in eights.
    width: usize,
    start: usize,
    /// Rows below that are summed in groups of eight, and the others.
    whole: usize,
    rest: usize,
    /// Start of its rows below in the list.
    below: usize,
    /// Start of its values.
    values: usize,
    /// Start of its updates.
    slots: usize,
}

/// A single supernode.
#[derive(Debug)]
struct Single {
    node: usize,
    /// Start of its columns in a vector.
    start: usize,
    /// Its rows below in the list.
    below: Range<usize>,
    /// Start of its updates.
    slots: usize,
}

/// Adds an update, by its number, to a row of a vector.
#[derive(Debug)]
struct Scatter {
    row: u32,
    update: u32,
}

/// Workspace.
#[derive(Default)]
pub(super) struct Workspace {
    /// Updates of supernodes.
    updates: Vec<Lanes>,
    /// Rows below the current batch.
    rows_below: Vec<Lanes>,
    /// Rows below the current single supernode.
    rows: Vec<f32>,
}

impl Batch {
    /// Number of rows beyond the last group of eight.
    fn rest(node: &Node) -> usize {
        node.below.len() % LANES
    }

    /// Number of rows below.
    fn below(&self) -> usize {
        self.whole + self.rest
    }

    /// Index of a row below of one of its supernodes among those of the batch.
    fn row_below(&self, node: &Node, row: usize) -> usize {
        let whole = node.below.len() - Self::rest(node);
        if row < whole {
            row
        } else {
            self.whole + row - whole
        }
    }

    /// Index of an entry among its values; the next row is three further.
    fn place(&self, row: usize, column: usize) -> usize {
        let (first, rest) = (column - column % 3, column % 3);
        eight::start(first, self.width + self.below()) + 3 * (row - first) + rest
    }

    /// Its part of all values.
    fn values(&self) -> Range<usize> {
        self.values..self.values + eight::values(self.width, self.below())
    }
}

impl SolveOrder {
    /// The levels of supernodes of a matrix `[size × size]`, whose rows below are those of the list
    /// `below`.
    pub(super) fn new(nodes: &[Node], below: &[usize], size: usize) -> Self {
        let owner = Node::owners(nodes, size);
        let mut level = vec![0; nodes.len()];
        for (k, node) in nodes.iter().enumerate() {
            for &row in &below[node.below.clone()] {
                level[owner[row]] = level[owner[row]].max(level[k] + 1);
            }
        }
        let count = level.iter().max().map_or(0, |last| last + 1);
        let mut all = Self {
            places: vec![0; size],
            ..Self::default()
        };
        // Destination of the update of each row below of a supernode.
        let mut slots = vec![Vec::new(); nodes.len()];
        for number in 0..count {
            let mut same: Vec<usize> = (0..nodes.len()).filter(|&k| level[k] == number).collect();
            // Grouped by width first: with 10 000 spheres this needs an eighth fewer values,
            // padding included, than grouping by height first.
            same.sort_by_key(|&k| (nodes[k].width, nodes[k].below.len()));
            let (first_batch, first_single) = (all.batches.len(), all.singles.len());
            for eight in same.chunks(LANES) {
                if is_worth_while(nodes, eight) {
                    all.add_batch(nodes, eight, &mut slots);
                } else {
                    for &node in eight {
                        all.add_single(nodes, node, &mut slots);
                    }
                }
            }
            all.levels.push(Level {
                scatters: 0..0,
                batches: first_batch..all.batches.len(),
                singles: first_single..all.singles.len(),
            });
        }
        // Every row adds its updates in the order of the supernodes.
        let mut scatters: Vec<_> = (0..count).map(|_| Vec::new()).collect();
        for (node, slots) in nodes.iter().zip(&slots) {
            for (&row, &slot) in below[node.below.clone()].iter().zip(slots) {
                let place = all.places[row];
                scatters[level[owner[row]]].push(Scatter {
                    row: place,
                    update: slot,
                });
            }
        }
        for (own, scatters) in all.levels.iter_mut().zip(scatters) {
            let begin = all.scatters.len();
            all.scatters.extend(scatters);
            own.scatters = begin..all.scatters.len();
        }
        all.find_rows_below(nodes, below);
        all
    }

    /// Adds a batch of some supernodes.
    fn add_batch(&mut self, nodes: &[Node], eight: &[usize], slots: &mut [Vec<u32>]) {
        let most = |of: &dyn Fn(&Node) -> usize| {
            let all = eight.iter().map(|&k| of(&nodes[k]));
            all.max().unwrap_or(0)
        };
        let batch = Batch {
            nodes: eight.to_vec(),
            width: most(&|node| node.width),
            start: self.length,
            whole: most(&|node| node.below.len() - Batch::rest(node)),
            rest: most(&Batch::rest),
            below: 0,
            values: self.values,
            slots: self.slots,
        };
        for (lane, &k) in eight.iter().enumerate() {
            let node = &nodes[k];
            let first = batch.start + batch.width - node.width;
            for column in 0..node.width {
                self.places[node.start + column] = narrow(LANES * (first + column) + lane);
            }
            let rows = 0..node.below.len();
            let eights = rows.map(|row| batch.slots + batch.row_below(node, row));
            slots[k].extend(eights.map(|eight| narrow(LANES * eight + lane)));
        }
        self.length += batch.width;
        self.values = batch.values().end;
        self.slots += batch.below();
        self.batches.push(batch);
    }

    /// Adds a single supernode.
    fn add_single(&mut self, nodes: &[Node], k: usize, slots: &mut [Vec<u32>]) {
        let node = &nodes[k];
        let start = LANES * self.length;
        for column in 0..node.width {
            self.places[node.start + column] = narrow(start + column);
        }
        let rows = 0..node.below.len();
        slots[k].extend(rows.map(|row| narrow(LANES * self.slots + row)));
        self.singles.push(Single {
            node: k,
            start,
            below: 0..0,
            slots: self.slots,
        });
        self.length += node.width.div_ceil(LANES);
        self.slots += node.below.len().div_ceil(LANES);
    }

    /// Looks up the positions of all rows below, once every row has one.
    fn find_rows_below(&mut self, nodes: &[Node], below: &[usize]) {
        let zero = narrow(LANES * self.length);
        self.length += 1;
        for batch in &mut self.batches {
            batch.below = self.batched_below.len();
            let mut places = vec![[zero; LANES]; batch.below()];
            for (lane, &k) in batch.nodes.iter().enumerate() {
                for (number, &row) in below[nodes[k].below.clone()].iter().enumerate() {
                    places[batch.row_below(&nodes[k], number)][lane] = self.places[row];
                }
            }
            self.batched_below.extend(places);
        }
        for single in &mut self.singles {
            let begin = self.single_below.len();
            let rows = &below[nodes[single.node].below.clone()];
            self.single_below
                .extend(rows.iter().map(|&row| self.places[row]));
            single.below = begin..self.single_below.len();
        }
    }

    /// Position of the three rows of a sphere in a vector.
    pub(super) fn places(&self, row: usize) -> [u32; 3] {
        [0, 1, 2].map(|k| self.places[row + k])
    }

    /// Length of a vector, in eights.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Allocates the interleaved values of a factor, with padding.
    pub(super) fn make_room(&self, values: &mut Vec<Lanes>) {
        values.clear();
        values.resize(self.values, [0.0; LANES]);
        for batch in &self.batches {
            let values = &mut values[batch.values()];
            // Padding has no effect: 1 · 0 = 0.
            for column in 0..batch.width {
                values[batch.place(column, column)] = [1.0; LANES];
            }
        }
    }

    /// Interleaves the values of the new supernodes of a factor.
    pub(super) fn pack(
        &self,
        nodes: &[Node],
        is_new: &[bool],
        factor: &[f32],
        values: &mut [Lanes],
    ) {
        for batch in &self.batches {
            let values = &mut values[batch.values()];
            for (lane, &k) in batch.nodes.iter().enumerate() {
                if !is_new[k] {
                    continue;
                }
                let node = &nodes[k];
                let skipped = batch.width - node.width;
                let whole = node.below.len() - Batch::rest(node);
                let columns = factor[node.values.clone()].chunks_exact(node.height());
                for (column, source) in columns.enumerate() {
                    let mut put = |row: usize, source: &[f32]| {
                        let from = batch.place(row, skipped + column);
                        let targets = values.iter_mut().skip(from).step_by(3);
                        for (target, &value) in targets.zip(source) {
                            target[lane] = value;
                        }
                    };
                    let (own, below) = source.split_at(node.width);
                    put(skipped + column, &own[column..]);
                    put(batch.width, &below[..whole]);
                    put(batch.width + batch.whole, &below[whole..]);
                }
            }
        }
    }

    /// `x ← L⁻ᵀ L⁻¹ x` by a factor and its interleaved values, for vectorised callers.
    #[inline(always)]
    pub(super) fn solve(
        &self,
        nodes: &[Node],
        factor: &[f32],
        values: &[Lanes],
        x: &mut [Lanes],
        work: &mut Workspace,
    ) {
        let Workspace {
            updates,
            rows_below,
            rows,
        } = work;
        updates.resize(self.slots, [0.0; LANES]);
        for level in &self.levels {
            for &Scatter { row, update } in &self.scatters[level.scatters.clone()] {
                x.as_flattened_mut()[row as usize] += updates.as_flattened()[update as usize];
            }
            for batch in &self.batches[level.batches.clone()] {
                let own = &mut x[batch.start..batch.start + batch.width];
                let updates = &mut updates[batch.slots..batch.slots + batch.below()];
                eight::lower(&values[batch.values()], own, updates);
            }
            for single in &self.singles[level.singles.clone()] {
                let node = &nodes[single.node];
                let own = &mut x.as_flattened_mut()[single.start..single.start + node.width];
                let updates =
                    &mut updates.as_flattened_mut()[LANES * single.slots..][..node.below.len()];
                single::lower(node, factor, own, updates);
            }
        }
        for level in self.levels.iter().rev() {
            for batch in &self.batches[level.batches.clone()] {
                let places = &self.batched_below[batch.below..batch.below + batch.below()];
                rows_below.resize(places.len().max(rows_below.len()), [0.0; LANES]);
                let below = &mut rows_below[..places.len()];
                for (below, places) in below.iter_mut().zip(places) {
                    for (value, &place) in below.iter_mut().zip(places) {
                        *value = x.as_flattened()[place as usize];
                    }
                }
                let own = &mut x[batch.start..batch.start + batch.width];
                eight::upper(&values[batch.values()], batch.whole, own, below);
            }
            for single in &self.singles[level.singles.clone()] {
                let (node, x) = (&nodes[single.node], x.as_flattened_mut());
                rows.clear();
                let places = self.single_below[single.below.clone()].iter();
                rows.extend(places.map(|&row| x[row as usize]));
                let own = &mut x[single.start..single.start + node.width];
                single::upper(node, factor, own, rows);
            }
        }
    }
}

/// Whether supernodes are faster as a batch: a single one takes the time of its steps in sequence,
/// a batch that of all values.
fn is_worth_while(nodes: &[Node], eight: &[usize]) -> bool {
    let rows = eight.iter().map(|&k| nodes[k].height()).max().unwrap_or(0);
    eight.len() > 2 + rows / 16
}

#[cfg(test)]
mod tests {
    use super::super::tests::{couples, lattice};
    use super::*;

    #[test]
    fn side_by_side_supernodes_are_solved_with_the_bits_of_each_alone() {
        let many = lattice(25);
        let order = &many.0.order;
        assert!(order.batches.len() > 10 && order.singles.len() > 3 && order.levels.len() > 3);
        for (pattern, mut matrix) in [lattice(2), lattice(7), many, couples(9)] {
            matrix.factor(&pattern).unwrap();
            let (order, size) = (&pattern.order, 3 * pattern.spheres());
            // Twice, as zeros must stay zeros.
            for shift in [0.0, 0.7] {
                let start = |row: usize| (row as f32 + shift).cos();
                let mut expected: Vec<f32> = (0..size).map(start).collect();
                let below = |node: &Node| &pattern.symbolic.row_idx()[node.below.clone()];
                for node in &pattern.nodes {
                    let mut updates = vec![0.0; node.below.len()];
                    let own = &mut expected[node.start..node.start + node.width];
                    single::lower(node, &matrix.factor, own, &mut updates);
                    for (&row, updates) in below(node).iter().zip(updates) {
                        expected[row] += updates;
                    }
                }
                for node in pattern.nodes.iter().rev() {
                    let known: Vec<f32> = below(node).iter().map(|&row| expected[row]).collect();
                    let own = &mut expected[node.start..node.start + node.width];
                    single::upper(node, &matrix.factor, own, &known);
                }
                for row in 0..size {
                    let place = order.places[row] as usize;
                    matrix.ordered.as_flattened_mut()[place] = start(row);
                }
                order.solve(
                    &pattern.nodes,
                    &matrix.factor,
                    &matrix.packed,
                    &mut matrix.ordered,
                    &mut matrix.work,
                );
                for (row, expected) in expected.iter().enumerate() {
                    let found = matrix.ordered.as_flattened()[order.places[row] as usize];
                    assert_eq!(found.to_bits(), expected.to_bits(), "row {row} of {size}");
                }
            }
        }
    }
}
