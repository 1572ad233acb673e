//! The numeric factorization of a sparse matrix: columns of a supernode, then their updates of all
//! later ones.
//!
//! ```text
//! L_ss L_ssᵀ = A_ss,   L_bs = A_bs L_ss⁻ᵀ,   A_bb ← A_bb − L_bs L_bsᵀ          s: columns of a supernode, b: its rows below
//! ```
//!
//! Supernodes have few spheres, so most time is spent in hundreds of small products. Their
//! destinations are determined once for a pattern; faer factors the blocks of columns. The factor
//! has the same bits as faer's own supernodal factorization; [`super`] compares their times.

use super::{BlockPattern, Node, narrow};
use crate::linalg::simd::vectorised;
use crate::threads;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{
    LltError, LltRegularization, cholesky_in_place, cholesky_in_place_scratch,
};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::sparse::SymbolicSparseColMatRef;
use faer::{MatMut, Par, Spec};
use std::ops::Range;

/// Rows per block: with the columns of two spheres, as many independent sums as fit in registers.
const ROWS: usize = 16;
/// Rows per block of the last rows.
const LAST_ROWS: usize = 8;
/// Columns of a sphere.
const COLUMNS: usize = 3;
/// Fewest spheres whose columns a thread updates.
const LEAST_COLUMNS: usize = 8;
/// Parts of the columns of a supernode for each thread: the first columns have the most rows. With
/// one, two and four parts 10 000 spheres took 1.42, 1.48 and 1.22 s on two threads.
const PARTS_OF_THREAD: usize = 4;
/// Rows and columns of a block of an update by a supernode of at least so many columns: on one
/// thread 1.54 s in place of 1.79 s.
const PANEL: usize = 96;
const WIDE: usize = 192;
/// Columns of two spheres.
const TWO_SPHERES: usize = 2 * COLUMNS;

/// Positions of values in a factor.
#[derive(Debug, Default)]
pub(super) struct Schedule {
    /// Position in the factor of each value of the matrix, and the values in the columns of each
    /// supernode.
    places: Vec<u32>,
    values: Vec<Range<usize>>,
    /// Updates of later supernodes, and their ranges by supernode.
    updates: Vec<Update>,
    of_node: Vec<Range<usize>>,
    /// Rows of the targets.
    rows: Vec<u32>,
    /// The part of each supernode.
    part: Vec<usize>,
    /// For each supernode above groups of subtrees: the supernodes that update it, ascending, with
    /// the numbers of their updates.
    incoming: Vec<Vec<[usize; 2]>>,
}

/// The update of a later supernode by a supernode.
#[derive(Debug)]
struct Update {
    /// The later supernode.
    target: usize,
    /// The first of its rows below that is a column of the target, and their number.
    first: usize,
    columns: usize,
    /// Start of the target, and its column stride.
    start: usize,
    height: usize,
    /// The target's row for each of its own rows from the first on; for columns these are their
    /// indices too.
    rows: Range<usize>,
}

impl Schedule {
    /// The schedule of supernodes in parts, whose rows below are those of the list `below`, by the
    /// supernode of each row; `matrix`: the lower triangle.
    pub(super) fn new(
        nodes: &[Node],
        parts: &[Vec<usize>],
        (owner, below): (&[usize], &[usize]),
        matrix: SymbolicSparseColMatRef<'_, usize>,
    ) -> Self {
        let size = matrix.ncols();
        // Index of a row in a supernode.
        let local = |node: &Node, row: usize| {
            if row < node.start + node.width {
                row - node.start
            } else {
                let rows = &below[node.below.clone()];
                node.width + rows.partition_point(|&other| other < row)
            }
        };
        let mut schedule = Self {
            part: vec![0; nodes.len()],
            incoming: vec![Vec::new(); nodes.len()],
            ..Self::default()
        };
        for (number, nodes) in parts.iter().enumerate() {
            for &k in nodes {
                schedule.part[k] = number;
            }
        }
        for column in 0..size {
            let node = &nodes[owner[column]];
            let start = node.values.start + (column - node.start) * node.height();
            // Entries above the diagonal, which are never read, have a position too.
            let rows = matrix.row_idx_of_col(column);
            let places = rows.map(|row| narrow(start + local(node, row)));
            schedule.places.extend(places);
        }
        let starts = matrix.col_ptr();
        for (k, node) in nodes.iter().enumerate() {
            let values = starts[node.start]..starts[node.start + node.width];
            schedule.values.push(values);
            let first_update = schedule.updates.len();
            let rows = &below[node.below.clone()];
            let mut first = 0;
            for same in rows.chunk_by(|&a, &b| owner[a] == owner[b]) {
                let target = &nodes[owner[same[0]]];
                let begin = schedule.rows.len();
                let targets = rows[first..].iter().map(|&row| narrow(local(target, row)));
                schedule.rows.extend(targets);
                let target_part = schedule.part[owner[same[0]]];
                if parts.len() > 1 && target_part == parts.len() - 1 {
                    schedule.incoming[owner[same[0]]].push([k, schedule.updates.len()]);
                }
                schedule.updates.push(Update {
                    target: owner[same[0]],
                    first,
                    columns: same.len(),
                    start: target.values.start,
                    height: target.height(),
                    rows: begin..schedule.rows.len(),
                });
                first += same.len();
            }
            schedule.of_node.push(first_update..schedule.updates.len());
        }
        schedule
    }
}

/// Workspace of one thread.
#[derive(Default)]
pub(super) struct Workspace {
    /// Rows below the supernode whose updates are applied.
    rows: Vec<f32>,
    scratch: Option<MemBuffer>,
}

impl Workspace {
    /// Makes room for the factorization of all supernodes.
    fn make_room(&mut self, nodes: &[Node]) {
        let widest = nodes.iter().map(|node| node.width).max().unwrap_or(0);
        let needed = cholesky_in_place_scratch::<f32>(widest, Par::Seq, Spec::default());
        let held = self.scratch.as_ref().map_or(0, |memory| memory.len());
        if held < needed.size_bytes() {
            self.scratch = Some(MemBuffer::new(needed));
        }
    }
}

impl Schedule {
    /// Supernodes of a factor that change with the values of the matrix: their own, or those of a
    /// supernode they depend on.
    pub(super) fn find_changes(&self, old: &[f32], new: &[f32], changes: &mut Vec<bool>) {
        changes.clear();
        changes.resize(self.values.len(), false);
        for (k, values) in self.values.iter().enumerate() {
            changes[k] |= differ(&old[values.clone()], &new[values.clone()]);
            if changes[k] {
                for update in &self.updates[self.of_node[k].clone()] {
                    changes[update.target] = true;
                }
            }
        }
    }
}

/// Whether values differ; all are compared, as most are equal, and a loop with an early exit is not
/// vectorised.
fn differ(old: &[f32], new: &[f32]) -> bool {
    let pairs = old.iter().zip(new);
    pairs.filter(|(old, new)| old != new).count() > 0
}

/// Factors a matrix of the pattern, in the new supernodes; the others are kept.
///
/// # Errors
/// The row of a pivot that is not positive.
pub(super) fn factor(
    pattern: &BlockPattern,
    (values, is_new): (&[f32], &[bool]),
    factor: &mut [f32],
    works: &mut Vec<Workspace>,
) -> Result<(), usize> {
    let parts = pattern.parts.len();
    works.resize_with(
        works
            .len()
            .max(parts)
            .max(PARTS_OF_THREAD * threads::together()),
        Workspace::default,
    );
    for work in &mut *works {
        work.make_room(&pattern.nodes);
    }
    let matrix = Numeric {
        pattern,
        values,
        is_new,
    };
    if parts == 1 {
        return matrix.factor_parts(0..1, (factor, 0), works);
    }
    let above = pattern.parts[parts - 1].first();
    let begin = above.map_or(factor.len(), |&k| pattern.nodes[k].values.start);
    let (groups, above) = factor.split_at_mut(begin);
    matrix.factor_parts(0..parts - 1, (groups, 0), works)?;
    matrix.factor_above((groups, above), works)
}

/// A matrix of a pattern and the supernodes to be factored.
#[derive(Clone, Copy)]
struct Numeric<'m> {
    pattern: &'m BlockPattern,
    values: &'m [f32],
    is_new: &'m [bool],
}

impl Numeric<'_> {
    /// Factors parts at the same time; their values begin at `begin`.
    fn factor_parts(
        self,
        parts: Range<usize>,
        (factor, begin): (&mut [f32], usize),
        works: &mut [Workspace],
    ) -> Result<(), usize> {
        if parts.len() == 1 {
            return self.factor_part(parts.start, (factor, begin), &mut works[0]);
        }
        let middle = usize::midpoint(parts.start, parts.end);
        let mut left = self.pattern.parts[parts.start..middle].iter().flatten();
        let end = left.next_back();
        let end = end.map_or(begin, |&k| self.pattern.nodes[k].values.end);
        let (of_left, of_right) = factor.split_at_mut(end - begin);
        let (for_left, for_right) = works.split_at_mut(middle - parts.start);
        let (mut left, mut right) = (Ok(()), Ok(()));
        threads::both(
            || left = self.factor_parts(parts.start..middle, (of_left, begin), for_left),
            || right = self.factor_parts(middle..parts.end, (of_right, end), for_right),
        );
        match (left, right) {
            (Err(left), Err(right)) => Err(left.min(right)),
            (left, right) => left.and(right),
        }
    }

    /// Copies the values of a supernode, whose values in the factor begin at `begin`.
    fn copy_matrix(self, k: usize, panel: &mut [f32], begin: usize) {
        let schedule = &self.pattern.schedule;
        panel.fill(0.0);
        let range = &schedule.values[k];
        let places = &schedule.places[range.clone()];
        for (&place, &value) in places.iter().zip(&self.values[range.clone()]) {
            panel[place as usize - begin] = value;
        }
    }

    /// Factors a part: each supernode, then its updates of later ones.
    fn factor_part(
        self,
        part: usize,
        (factor, begin): (&mut [f32], usize),
        work: &mut Workspace,
    ) -> Result<(), usize> {
        let BlockPattern {
            nodes, schedule, ..
        } = self.pattern;
        let own = &self.pattern.parts[part];
        let panel_of = |k: usize| nodes[k].values.start - begin..nodes[k].values.end - begin;
        for &k in own.iter().filter(|&&k| self.is_new[k]) {
            self.copy_matrix(k, &mut factor[panel_of(k)], nodes[k].values.start);
        }
        for &k in own {
            let node = &nodes[k];
            if self.is_new[k] {
                factor_panel(node, &mut factor[panel_of(k)], work)?;
            }
            let updates = schedule.updates[schedule.of_node[k].clone()].iter();
            let mut updates = updates
                .filter(|update| self.is_new[update.target] && schedule.part[update.target] == part)
                .peekable();
            if updates.peek().is_some() {
                vectorised(
                    #[inline(always)]
                    || {
                        let rows = &mut work.rows;
                        let height = pack(node, &factor[panel_of(k)], 0, rows);
                        for update in updates {
                            let targets = &schedule.rows[update.rows.clone()];
                            let columns = 0..update.columns;
                            let target = &mut factor[update.start - begin..];
                            let rows = (&rows[..height * node.width], height, 0);
                            apply(rows, (update, 0), targets, columns, target);
                        }
                    },
                );
            }
        }
        Ok(())
    }

    /// Factors the supernodes above the groups of subtrees, in order: for each all updates, its
    /// columns divided among the threads.
    fn factor_above(
        self,
        (groups, above): (&[f32], &mut [f32]),
        works: &mut [Workspace],
    ) -> Result<(), usize> {
        let BlockPattern {
            nodes,
            schedule,
            parts,
            ..
        } = self.pattern;
        let begin = groups.len();
        let last = parts.len() - 1;
        for &k in parts[last].iter().filter(|&&k| self.is_new[k]) {
            let (node, height) = (&nodes[k], nodes[k].height());
            let (before, rest) = above.split_at_mut(node.values.start - begin);
            let (panel, before) = (&mut rest[..node.values.len()], &*before);
            self.copy_matrix(k, panel, node.values.start);
            let spheres = node.width / COLUMNS;
            let parts = match threads::parts(spheres, LEAST_COLUMNS) {
                1 => 1,
                parts => parts.max((PARTS_OF_THREAD * parts).min(spheres / LEAST_COLUMNS)),
            };
            let works = &mut works[..parts];
            let length = COLUMNS * height;
            threads::divide_with((&mut *panel, length), works, &|first, columns, work| {
                let first = COLUMNS * first;
                let own = narrow(first)..narrow(first + columns.len() / height);
                for &[source, number] in &schedule.incoming[k] {
                    let (source_node, update) = (&nodes[source], &schedule.updates[number]);
                    let targets = &schedule.rows[update.rows.clone()];
                    let of_columns = &targets[..update.columns];
                    let range = of_columns.partition_point(|&at| at < own.start)
                        ..of_columns.partition_point(|&at| at < own.end);
                    if range.is_empty() {
                        continue;
                    }
                    let values = source_node.values.clone();
                    let source = if schedule.part[source] == last {
                        &before[values.start - begin..values.end - begin]
                    } else {
                        &groups[values]
                    };
                    vectorised(
                        #[inline(always)]
                        || {
                            let packed = update.first + range.start;
                            let rows = &mut work.rows;
                            let height = pack(source_node, source, packed, rows);
                            let rows = (&rows[..height * source_node.width], height, packed);
                            apply(rows, (update, first), targets, range, columns);
                        },
                    );
                }
            });
            factor_panel(node, panel, &mut works[0])?;
        }
        Ok(())
    }
}

/// Factors a supernode whose updates are all applied.
///
/// # Errors
/// The row of a pivot that is not positive.
fn factor_panel(node: &Node, panel: &mut [f32], work: &mut Workspace) -> Result<(), usize> {
    let memory = work.scratch.as_mut().ok_or(node.start)?;
    let panel = MatMut::from_column_major_slice_mut(panel, node.height(), node.width);
    let (mut top, mut bottom) = panel.split_at_row_mut(node.width);
    let none = LltRegularization::default();
    let stack = MemStack::new(memory);
    cholesky_in_place(top.as_mut(), none, Par::Seq, stack, Spec::default())
        .map_err(|LltError::NonPositivePivot { index }| node.start + index)?;
    let (top, bottom) = (top.as_ref(), bottom.as_mut().transpose_mut());
    solve_lower_triangular_in_place(top, bottom, Par::Seq);
    Ok(())
}

/// Copies the rows below a factored supernode from `from` on, column after column, with space for
/// an incomplete block at the end, whose content is arbitrary; returns the column stride.
#[inline(always)]
fn pack(node: &Node, panel: &[f32], from: usize, rows: &mut Vec<f32>) -> usize {
    let count = node.below.len() - from;
    let height = count.next_multiple_of(LAST_ROWS) + LAST_ROWS;
    rows.resize((node.width * height).max(rows.len()), 0.0);
    let rows = rows.chunks_exact_mut(height);
    for (target, column) in rows.zip(panel.chunks_exact(node.height())) {
        target[..count].copy_from_slice(&column[node.width + from..]);
    }
    height
}

/// Applies some columns of an update to a later supernode, of which `factor` has the columns from
/// `first` on, for vectorised callers. `rows`: the result of [`pack`], its stride, and the number
/// of its first row.
#[inline(always)]
fn apply(
    (rows, height, packed): (&[f32], usize, usize),
    (update, first): (&Update, usize),
    targets: &[u32],
    columns: Range<usize>,
    factor: &mut [f32],
) {
    let source = (rows, height, packed);
    if rows.len() < WIDE * height || columns.len() <= PANEL {
        let rows = columns.start..targets.len();
        return subtract_columns(source, (update, first), targets, (rows, columns), factor);
    }
    // Blocks of rows and columns that stay in the cache.
    for begin in columns.clone().step_by(PANEL) {
        let end = columns.end.min(begin + PANEL);
        let triangle = (begin..end, begin..end);
        subtract_columns(source, (update, first), targets, triangle, factor);
        for row in (end..targets.len()).step_by(PANEL) {
            let block = (row..targets.len().min(row + PANEL), begin..end);
            subtract_columns(source, (update, first), targets, block, factor);
        }
    }
}

/// Updates the rows of columns of a later supernode that are in a block, from the diagonal down.
#[inline(always)]
fn subtract_columns(
    source: (&[f32], usize, usize),
    update: (&Update, usize),
    targets: &[u32],
    (rows, columns): (Range<usize>, Range<usize>),
    factor: &mut [f32],
) {
    let in_twos = columns.start + columns.len() - columns.len() % TWO_SPHERES;
    for column in (columns.start..in_twos).step_by(TWO_SPHERES) {
        let rows = rows.start.max(column)..rows.end;
        subtract::<TWO_SPHERES>(source, update, targets, (rows, column), factor);
    }
    for column in (in_twos..columns.end).step_by(COLUMNS) {
        let rows = rows.start.max(column)..rows.end;
        subtract::<COLUMNS>(source, update, targets, (rows, column), factor);
    }
}

/// Updates rows of C columns of a later supernode, from `column` of the update on. Results above
/// the diagonal are never read.
#[inline(always)]
fn subtract<const C: usize>(
    (rows, height, packed): (&[f32], usize, usize),
    (update, first): (&Update, usize),
    targets: &[u32],
    (range, column): (Range<usize>, usize),
    factor: &mut [f32],
) {
    let places =
        std::array::from_fn::<_, C, _>(|c| (targets[column + c] as usize - first) * update.height);
    // Sums of a block of rows for successive columns.
    let mut take = |targets: &[u32], sums: &[f32]| {
        for (place, sums) in places.into_iter().zip(sums.chunks_exact(sums.len() / C)) {
            let target = &mut factor[place..place + update.height];
            for (&row, sum) in targets.iter().zip(sums) {
                target[row as usize] -= sum;
            }
        }
    };
    let [from, at] = [range.start, column].map(|row| update.first + row - packed);
    let (whole, last) = targets[range].as_chunks::<ROWS>();
    for (number, targets) in whole.iter().enumerate() {
        let sums = products::<ROWS, C>(rows, height, from + ROWS * number, at);
        take(targets, sums.as_flattened());
    }
    let from = from + ROWS * whole.len();
    for (number, targets) in last.chunks(LAST_ROWS).enumerate() {
        let sums = products::<LAST_ROWS, C>(rows, height, from + LAST_ROWS * number, at);
        take(targets, sums.as_flattened());
    }
}

/// Products of R rows from `i` on with the C rows from `j` on, summed in the order of the columns.
#[inline(always)]
fn products<const R: usize, const C: usize>(
    rows: &[f32],
    height: usize,
    i: usize,
    j: usize,
) -> [[f32; R]; C] {
    let mut sums = [[0.0_f32; R]; C];
    for column in rows.chunks_exact(height) {
        let x = &column[i..i + R];
        for (sums, y) in sums.iter_mut().zip(&column[j..j + C]) {
            for (sum, x) in sums.iter_mut().zip(x) {
                *sum = x.mul_add(*y, *sum);
            }
        }
    }
    sums
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::tests::lattice;
    use super::super::{BlockCholesky, BlockPattern};
    use crate::threads::threads_for_small_work;
    use faer::dyn_stack::{MemBuffer, MemStack};
    use faer::linalg::cholesky::llt::factor::LltRegularization;
    use faer::sparse::SparseColMatRef;
    use faer::sparse::linalg::cholesky::supernodal::{
        SupernodalLltRef, factorize_supernodal_numeric_llt,
        factorize_supernodal_numeric_llt_scratch,
    };
    use faer::{Conj, MatMut, Par, Spec};
    use std::time::Instant;

    #[test]
    fn factor_has_the_bits_of_the_libraries() {
        for side in [2, 7, 25, 60] {
            let (pattern, mut matrix) = lattice(side);
            matrix.factor(&pattern).unwrap();
            let scratch = factorize_supernodal_numeric_llt_scratch::<usize, f32>(
                &pattern.symbolic,
                Par::Seq,
                Spec::default(),
            );
            let mut expected = vec![0.0; pattern.symbolic.len_val()];
            factorize_supernodal_numeric_llt(
                &mut expected,
                SparseColMatRef::new(pattern.scalar.as_ref(), &matrix.values),
                LltRegularization::default(),
                &pattern.symbolic,
                Par::Seq,
                MemStack::new(&mut MemBuffer::new(scratch)),
                Spec::default(),
            )
            .unwrap();
            let starts = pattern.symbolic.col_ptr_for_val();
            for (node, &first) in pattern.nodes.iter().zip(starts) {
                for column in 0..node.width {
                    let below = column * node.height() + column..(column + 1) * node.height();
                    let [ours, theirs] = [node.values.start, first]
                        .map(|start| start + below.start..start + below.end);
                    assert_eq!(matrix.factor[ours], expected[theirs], "side {side}");
                }
            }
        }
    }

    #[test]
    fn factor_in_parts_has_the_same_bits_for_any_number_of_threads() {
        let (pattern, mut one) = lattice(60);
        assert!(pattern.parts.len() > 2);
        one.factor(&pattern).unwrap();
        let lower = |matrix: &BlockCholesky| {
            let columns = pattern.nodes.iter().flat_map(|node| {
                let columns = matrix.factor[node.values.clone()].chunks(node.height());
                columns
                    .enumerate()
                    .flat_map(|(k, column)| column[k..].to_vec())
            });
            columns.collect::<Vec<_>>()
        };
        for threads in [2, 4, 16] {
            let (_, mut many) = lattice(60);
            let threads = threads_for_small_work(threads).unwrap();
            threads.run(|| many.factor(&pattern)).unwrap();
            assert!(lower(&many) == lower(&one) && many.packed == one.packed);
        }
    }

    /// Seconds of our factorization and solve, and of the library's, the least of rounds in turn.
    pub(crate) fn times(pattern: &BlockPattern, matrix: &mut BlockCholesky) -> [[f64; 2]; 2] {
        let (spec, none) = (Spec::default(), LltRegularization::default());
        let symbolic = &pattern.symbolic;
        let scratch =
            factorize_supernodal_numeric_llt_scratch::<usize, f32>(symbolic, Par::Seq, spec)
                .or(symbolic.solve_in_place_scratch::<f32>(1, Par::Seq));
        let (mut memory, mut values) = (MemBuffer::new(scratch), vec![0.0; symbolic.len_val()]);
        let size = pattern.scalar.nrows();
        let r: Vec<f64> = (0..size).map(|k| (k as f64).cos()).collect();
        let (mut z, mut x) = (vec![0.0; size], vec![0.0_f32; size]);
        let mut least = [[f64::INFINITY; 2]; 2];
        let time = |seconds: &mut f64, call: &mut dyn FnMut()| {
            let start = Instant::now();
            call();
            *seconds = seconds.min(start.elapsed().as_secs_f64());
        };
        for _ in 0..30 {
            let [[our_factor, our_solve], [factor, solve]] = &mut least;
            time(our_factor, &mut || matrix.factor(pattern).unwrap());
            time(our_solve, &mut || matrix.solve(pattern, &r, &mut z));
            let lower = SparseColMatRef::new(pattern.scalar.as_ref(), &matrix.values);
            time(factor, &mut || {
                let stack = MemStack::new(&mut memory);
                factorize_supernodal_numeric_llt(
                    &mut values,
                    lower,
                    none,
                    symbolic,
                    Par::Seq,
                    stack,
                    spec,
                )
                .unwrap();
            });
            time(solve, &mut || {
                #[expect(clippy::cast_possible_truncation, reason = "the factor's precision")]
                for (x, r) in x.iter_mut().zip(&r) {
                    *x = *r as f32;
                }
                SupernodalLltRef::new(symbolic, &values).solve_in_place_with_conj(
                    Conj::No,
                    MatMut::from_column_major_slice_mut(&mut x, size, 1),
                    Par::Seq,
                    MemStack::new(&mut memory),
                );
                for (z, x) in z.iter_mut().zip(&x) {
                    *z = f64::from(*x);
                }
            });
        }
        least
    }
}
