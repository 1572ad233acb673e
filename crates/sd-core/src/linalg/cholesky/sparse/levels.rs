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
use crate::linalg::simd::vectorised;
use crate::threads;
use std::ops::Range;

/// Fewest rows that a thread copies.
const LEAST_ROWS: usize = 4000;

/// Batches of supernodes and their order.
#[derive(Debug, Default)]
pub(super) struct SolveOrder {
    /// Groups of subtrees, and last the supernodes above them.
    parts: Vec<Part>,
    /// Position in a vector of each element, and the length of vectors, in eights.
    places: Vec<u32>,
    length: usize,
    /// Number of values of all batches, and of updates, in eights.
    values: usize,
    slots: usize,
}

/// The batches of a part, its range of vectors and its range of updates, in eights. Positions are
/// counted from the beginning of its range of vectors; those of updates too in a group of subtrees,
/// but among all in the last part, which reads those of the groups.
///
/// The range of a group ends with copies of rows of the last part, and every range with eight
/// zeros.
#[derive(Debug, Default)]
struct Part {
    x: Range<usize>,
    slots: Range<usize>,
    levels: Vec<Level>,
    batches: Vec<Batch>,
    singles: Vec<Single>,
    /// Positions of the rows below: interleaved for batches, then for single supernodes. Padding
    /// refers to a zero.
    batched_below: Vec<[u32; LANES]>,
    single_below: Vec<u32>,
    /// Updates of supernodes to rows of later levels.
    scatters: Vec<Scatter>,
    /// Its elements of a right-hand side and their positions; positions of copies, and of what they
    /// copy in the last part.
    rows: Vec<[u32; 2]>,
    copies: Vec<[u32; 2]>,
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
    of_parts: Vec<PartWorkspace>,
}

/// Workspace of a part.
#[derive(Default)]
struct PartWorkspace {
    /// Rows below the current batch.
    rows_below: Vec<Lanes>,
    /// Rows below the current single supernode.
    rows: Vec<f32>,
    /// Their sums in a large one.
    sums: Vec<[f32; 3]>,
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

/// What the parts of an order are made from.
#[derive(Clone, Copy)]
struct Tree<'t> {
    nodes: &'t [Node],
    /// Rows below of all supernodes.
    below: &'t [usize],
    /// The supernode of each row, and the part of each supernode.
    owner: &'t [usize],
    part: &'t [usize],
}

impl SolveOrder {
    /// The levels of the parts of a matrix, whose rows below are those of the list `below`, by the
    /// supernode of each row; `elements`: of right-hand sides, of each row.
    pub(super) fn new(
        nodes: &[Node],
        parts: &[Vec<usize>],
        (owner, below): (&[usize], &[usize]),
        elements: &[usize],
    ) -> Self {
        let mut all = Self {
            places: vec![0; owner.len()],
            ..Self::default()
        };
        let mut part = vec![0; nodes.len()];
        for (number, nodes) in parts.iter().enumerate() {
            for &k in nodes {
                part[k] = number;
            }
        }
        let tree = Tree {
            nodes,
            below,
            owner,
            part: &part,
        };
        // Destination of the update of each row below of a supernode.
        let mut slots = vec![Vec::new(); nodes.len()];
        let last = parts.len() - 1;
        for (number, own) in parts.iter().enumerate() {
            let mut new = Part::new(tree, own, number == last, &mut all, &mut slots);
            new.find_rows_below(tree, number, own, &mut all);
            all.parts.push(new);
        }
        // Positions within a part, so far.
        let mut places = vec![0; elements.len()];
        for part in &mut all.parts {
            for [row, place] in &mut part.rows {
                let element = elements[*row as usize];
                places[element] = *place + narrow(LANES * part.x.start);
                *row = narrow(element);
            }
        }
        for group in &mut all.parts[..last] {
            for [_, row] in &mut group.copies {
                *row = all.places[*row as usize];
            }
        }
        all.places = places;
        all
    }

    /// Length of a vector, in eights.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Allocates the interleaved values of a factor, with padding.
    pub(super) fn make_room(&self, values: &mut Vec<Lanes>) {
        values.clear();
        values.resize(self.values, [0.0; LANES]);
        for batch in self.parts.iter().flat_map(|part| &part.batches) {
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
        pack_parts(&self.parts, 0, values, &|part, values, begin| {
            for batch in &part.batches {
                let range = batch.values();
                let values = &mut values[range.start - begin..range.end - begin];
                batch.pack(nodes, is_new, factor, values);
            }
        });
    }

    /// `z ← L⁻ᵀ L⁻¹ r` by a factor and its interleaved values; x is workspace.
    pub(super) fn solve(
        &self,
        nodes: &[Node],
        (factor, values): (&[f32], &[Lanes]),
        r: &[f64],
        z: &mut [f64],
        (x, work): (&mut [Lanes], &mut Workspace),
    ) {
        let Workspace { updates, of_parts } = work;
        updates.resize(self.slots, [0.0; LANES]);
        of_parts.resize_with(of_parts.len().max(self.parts.len()), Default::default);
        let Some((above, groups)) = self.parts.split_last() else {
            return;
        };
        let (of_groups, of_above) = x.split_at_mut(above.x.start);
        let (works, own_work) = of_parts.split_at_mut(groups.len());
        let lower = |part: &Part, x: &mut [Lanes], updates: &mut [Lanes], _: &mut PartWorkspace| {
            part.read(r, x);
            part.lower(nodes, factor, values, x, updates);
        };
        for_groups(groups, of_groups, updates, works, &lower);
        above.read(r, of_above);
        above.lower(nodes, factor, values, of_above, updates);
        above.upper(nodes, factor, values, of_above, &mut own_work[0]);
        let of_above = of_above.as_flattened();
        let upper = |part: &Part, x: &mut [Lanes], _: &mut [Lanes], work: &mut PartWorkspace| {
            for &[to, from] in &part.copies {
                x.as_flattened_mut()[to as usize] = of_above[from as usize];
            }
            part.upper(nodes, factor, values, x, work);
        };
        for_groups(groups, of_groups, updates, works, &upper);
        let x = x.as_flattened();
        threads::divide(z, LEAST_ROWS, &|first, z| {
            for (z, &place) in z.iter_mut().zip(&self.places[first..]) {
                *z = f64::from(x[place as usize]);
            }
        });
    }
}

/// Packs the values of parts, which begin at `begin`, at the same time.
fn pack_parts(
    parts: &[Part],
    begin: usize,
    values: &mut [Lanes],
    pack: &(impl Fn(&Part, &mut [Lanes], usize) + Sync),
) {
    let (left, right) = parts.split_at(parts.len() / 2);
    let Some(first) = right.first() else {
        return;
    };
    if left.is_empty() {
        return pack(first, values, begin);
    }
    let own = |part: &Part| part.batches.last().map(|batch| batch.values().end);
    let middle = left.iter().rev().find_map(own).unwrap_or(begin);
    let (values_left, values_right) = values.split_at_mut(middle - begin);
    threads::both(
        || pack_parts(left, begin, values_left, pack),
        || pack_parts(right, middle, values_right, pack),
    );
}

/// Computes groups of subtrees at the same time: with the range of the vector of each, that of its
/// updates and a workspace.
fn for_groups(
    groups: &[Part],
    x: &mut [Lanes],
    updates: &mut [Lanes],
    works: &mut [PartWorkspace],
    compute: &(impl Fn(&Part, &mut [Lanes], &mut [Lanes], &mut PartWorkspace) + Sync),
) {
    let (left, right) = groups.split_at(groups.len() / 2);
    let Some(next) = right.first() else {
        return;
    };
    let Some(first) = left.first() else {
        return compute(next, x, updates, &mut works[0]);
    };
    let (x_left, x_right) = x.split_at_mut(next.x.start - first.x.start);
    let (updates_left, updates_right) = updates.split_at_mut(next.slots.start - first.slots.start);
    let (works_left, works_right) = works.split_at_mut(left.len());
    threads::both(
        || for_groups(left, x_left, updates_left, works_left, compute),
        || for_groups(right, x_right, updates_right, works_right, compute),
    );
}

impl Batch {
    /// Interleaves the values of its new supernodes.
    fn pack(&self, nodes: &[Node], is_new: &[bool], factor: &[f32], values: &mut [Lanes]) {
        for (lane, &k) in self.nodes.iter().enumerate() {
            if !is_new[k] {
                continue;
            }
            let node = &nodes[k];
            let skipped = self.width - node.width;
            let whole = node.below.len() - Self::rest(node);
            let columns = factor[node.values.clone()].chunks_exact(node.height());
            for (column, source) in columns.enumerate() {
                let mut put = |row: usize, source: &[f32]| {
                    let from = self.place(row, skipped + column);
                    let targets = values.iter_mut().skip(from).step_by(3);
                    for (target, &value) in targets.zip(source) {
                        target[lane] = value;
                    }
                };
                let (own, below) = source.split_at(node.width);
                put(skipped + column, &own[column..]);
                put(self.width, &below[..whole]);
                put(self.width + self.whole, &below[whole..]);
            }
        }
    }
}

impl Part {
    /// The levels of some supernodes, which are added to the vectors, values and updates of all.
    fn new(
        tree: Tree<'_>,
        own: &[usize],
        is_last: bool,
        all: &mut SolveOrder,
        slots: &mut [Vec<u32>],
    ) -> Self {
        let Tree {
            nodes,
            below,
            owner,
            part,
        } = tree;
        let mut level = vec![0; nodes.len()];
        let number = own.first().map(|&k| part[k]);
        for &k in own {
            for &row in &below[nodes[k].below.clone()] {
                let owner = owner[row];
                if Some(part[owner]) == number {
                    level[owner] = level[owner].max(level[k] + 1);
                }
            }
        }
        let count = own.iter().map(|&k| level[k] + 1).max().unwrap_or(0);
        // Updates are numbered as the part reads them.
        let (begin, first_slot) = (all.length, all.slots);
        let offset = if is_last { 0 } else { first_slot };
        let mut new = Self::default();
        let mut of_level = vec![Vec::new(); count];
        for &k in own {
            of_level[level[k]].push(k);
        }
        for mut same in of_level {
            // Grouped by width first: with 10 000 spheres this needs an eighth fewer values,
            // padding included, than grouping by height first.
            same.sort_by_key(|&k| (nodes[k].width, nodes[k].below.len()));
            let (first_batch, first_single) = (new.batches.len(), new.singles.len());
            for eight in same.chunks(LANES) {
                if is_worth_while(nodes, eight) {
                    new.add_batch(nodes, eight, (begin, offset), all, slots);
                } else {
                    for &node in eight {
                        new.add_single(nodes, node, (begin, offset), all, slots);
                    }
                }
            }
            new.levels.push(Level {
                scatters: 0..0,
                batches: first_batch..new.batches.len(),
                singles: first_single..new.singles.len(),
            });
        }
        for &[row, place] in &new.rows {
            all.places[row as usize] = place;
        }
        // Every row adds its updates in the order of the supernodes.
        let mut scatters: Vec<_> = (0..count).map(|_| Vec::new()).collect();
        for (node, slots) in nodes.iter().zip(&*slots) {
            for (&row, &slot) in below[node.below.clone()].iter().zip(slots) {
                if Some(part[owner[row]]) == number {
                    scatters[level[owner[row]]].push(Scatter {
                        row: all.places[row],
                        update: slot - narrow(LANES * offset),
                    });
                }
            }
        }
        for (own, scatters) in new.levels.iter_mut().zip(scatters) {
            let begin = new.scatters.len();
            new.scatters.extend(scatters);
            own.scatters = begin..new.scatters.len();
        }
        (new.x, new.slots) = (begin..all.length, first_slot..all.slots);
        new
    }

    /// Adds a batch of some supernodes.
    fn add_batch(
        &mut self,
        nodes: &[Node],
        eight: &[usize],
        (begin, offset): (usize, usize),
        all: &mut SolveOrder,
        slots: &mut [Vec<u32>],
    ) {
        let most = |of: &dyn Fn(&Node) -> usize| {
            let all = eight.iter().map(|&k| of(&nodes[k]));
            all.max().unwrap_or(0)
        };
        let batch = Batch {
            nodes: eight.to_vec(),
            width: most(&|node| node.width),
            start: all.length - begin,
            whole: most(&|node| node.below.len() - Batch::rest(node)),
            rest: most(&Batch::rest),
            below: 0,
            values: all.values,
            slots: all.slots - offset,
        };
        for (lane, &k) in eight.iter().enumerate() {
            let node = &nodes[k];
            let first = batch.start + batch.width - node.width;
            let columns = 0..node.width;
            self.rows.extend(columns.map(|column| {
                let place = LANES * (first + column) + lane;
                [narrow(node.start + column), narrow(place)]
            }));
            let rows = 0..node.below.len();
            let eights = rows.map(|row| all.slots + batch.row_below(node, row));
            slots[k].extend(eights.map(|eight| narrow(LANES * eight + lane)));
        }
        all.length += batch.width;
        all.values = batch.values().end;
        all.slots += batch.below();
        self.batches.push(batch);
    }

    /// Adds a single supernode.
    fn add_single(
        &mut self,
        nodes: &[Node],
        k: usize,
        (begin, offset): (usize, usize),
        all: &mut SolveOrder,
        slots: &mut [Vec<u32>],
    ) {
        let node = &nodes[k];
        let start = LANES * (all.length - begin);
        let columns = 0..node.width;
        self.rows
            .extend(columns.map(|column| [narrow(node.start + column), narrow(start + column)]));
        let rows = 0..node.below.len();
        slots[k].extend(rows.map(|row| narrow(LANES * all.slots + row)));
        self.singles.push(Single {
            node: k,
            start,
            below: 0..0,
            slots: all.slots - offset,
        });
        all.length += node.width.div_ceil(LANES);
        all.slots += node.below.len().div_ceil(LANES);
    }

    /// Looks up the positions of all rows below, once every row of the part has one; those of other
    /// parts are copied.
    fn find_rows_below(
        &mut self,
        tree: Tree<'_>,
        number: usize,
        own: &[usize],
        all: &mut SolveOrder,
    ) {
        let rows_of = |k: usize| &tree.below[tree.nodes[k].below.clone()];
        let mut copied: Vec<usize> = own
            .iter()
            .flat_map(|&k| rows_of(k))
            .copied()
            .filter(|&row| tree.part[tree.owner[row]] != number)
            .collect();
        copied.sort_unstable();
        copied.dedup();
        let first = LANES * (all.length - self.x.start);
        for (place, &row) in (first..).zip(&copied) {
            self.copies.push([narrow(place), narrow(row)]);
        }
        all.length += copied.len().div_ceil(LANES);
        let zero = narrow(LANES * (all.length - self.x.start));
        all.length += 1;
        self.x.end = all.length;
        let place = |row: usize| match copied.binary_search(&row) {
            Ok(copy) => narrow(first + copy),
            Err(_) => all.places[row],
        };
        for batch in &mut self.batches {
            batch.below = self.batched_below.len();
            let mut places = vec![[zero; LANES]; batch.below()];
            for (lane, &k) in batch.nodes.iter().enumerate() {
                for (number, &row) in rows_of(k).iter().enumerate() {
                    places[batch.row_below(&tree.nodes[k], number)][lane] = place(row);
                }
            }
            self.batched_below.extend(places);
        }
        for single in &mut self.singles {
            let begin = self.single_below.len();
            let places = rows_of(single.node).iter().map(|&row| place(row));
            self.single_below.extend(places);
            single.below = begin..self.single_below.len();
        }
    }

    /// Copies its rows of a right-hand side.
    fn read(&self, r: &[f64], x: &mut [Lanes]) {
        let x = x.as_flattened_mut();
        for &[row, place] in &self.rows {
            #[expect(clippy::cast_possible_truncation, reason = "the factor's precision")]
            let value = r[row as usize] as f32;
            x[place as usize] = value;
        }
    }

    /// `x ← L⁻¹ x` in its rows.
    fn lower(
        &self,
        nodes: &[Node],
        factor: &[f32],
        values: &[Lanes],
        x: &mut [Lanes],
        updates: &mut [Lanes],
    ) {
        vectorised(
            #[inline(always)]
            || {
                for level in &self.levels {
                    for &Scatter { row, update } in &self.scatters[level.scatters.clone()] {
                        x.as_flattened_mut()[row as usize] +=
                            updates.as_flattened()[update as usize];
                    }
                    for batch in &self.batches[level.batches.clone()] {
                        let own = &mut x[batch.start..batch.start + batch.width];
                        let updates = &mut updates[batch.slots..batch.slots + batch.below()];
                        eight::lower(&values[batch.values()], own, updates);
                    }
                    for single in &self.singles[level.singles.clone()] {
                        let node = &nodes[single.node];
                        let own =
                            &mut x.as_flattened_mut()[single.start..single.start + node.width];
                        let updates = &mut updates.as_flattened_mut()[LANES * single.slots..]
                            [..node.below.len()];
                        if single::is_large(node) {
                            single::lower_together(node, factor, own, updates);
                        } else {
                            single::lower(node, factor, own, updates);
                        }
                    }
                }
            },
        );
    }

    /// `x ← L⁻ᵀ x` in its rows.
    fn upper(
        &self,
        nodes: &[Node],
        factor: &[f32],
        values: &[Lanes],
        x: &mut [Lanes],
        PartWorkspace {
            rows_below,
            rows,
            sums,
        }: &mut PartWorkspace,
    ) {
        vectorised(
            #[inline(always)]
            || {
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
                        if single::is_large(node) {
                            single::upper_together(node, factor, (own, rows), sums);
                        } else {
                            single::upper(node, factor, own, rows);
                        }
                    }
                }
            },
        );
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
    use crate::threads::threads_for_small_work;

    #[test]
    fn side_by_side_supernodes_are_solved_with_the_bits_of_each_alone() {
        let (many, large) = (lattice(25), lattice(60));
        let part = &many.0.order.parts[0];
        assert!(part.batches.len() > 10 && part.singles.len() > 3 && part.levels.len() > 3);
        assert!(many.0.order.parts.len() == 1 && large.0.order.parts.len() > 2);
        for (pattern, mut matrix) in [lattice(2), lattice(7), many, couples(9), large] {
            matrix.factor(&pattern).unwrap();
            let (order, size) = (&pattern.order, 3 * pattern.spheres());
            // Twice, as zeros must stay zeros.
            for shift in [0.0, 0.7] {
                let start = |k: usize| (k as f32 + shift).cos();
                let r: Vec<f64> = (0..size).map(|k| f64::from(start(k))).collect();
                let row_of = |element: usize| 3 * pattern.rows[element / 3] + element % 3;
                let mut expected = vec![0.0; size];
                for element in 0..size {
                    expected[row_of(element)] = start(element);
                }
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
                for threads in [1, 3] {
                    let mut z = vec![0.0; size];
                    let threads = threads_for_small_work(threads).unwrap();
                    threads.run(|| {
                        order.solve(
                            &pattern.nodes,
                            (&matrix.factor, &matrix.packed),
                            &r,
                            &mut z,
                            (&mut matrix.ordered, &mut matrix.work),
                        );
                    });
                    for (element, z) in z.iter().enumerate() {
                        let expected = f64::from(expected[row_of(element)]);
                        assert_eq!(z.to_bits(), expected.to_bits(), "{element} of {size}");
                    }
                }
            }
        }
    }
}
