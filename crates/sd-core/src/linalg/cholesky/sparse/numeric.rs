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
use faer::dyn_stack::{MemStack, StackReq};
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
    /// The schedule of supernodes, whose rows below are those of the list `below`; `matrix`: the
    /// lower triangle.
    pub(super) fn new(
        nodes: &[Node],
        below: &[usize],
        matrix: SymbolicSparseColMatRef<'_, usize>,
    ) -> Self {
        let size = matrix.ncols();
        let owner = Node::owners(nodes, size);
        // Index of a row in a supernode.
        let local = |node: &Node, row: usize| {
            if row < node.start + node.width {
                row - node.start
            } else {
                let rows = &below[node.below.clone()];
                node.width + rows.partition_point(|&other| other < row)
            }
        };
        let mut schedule = Self::default();
        for column in 0..size {
            let node = &nodes[owner[column]];
            let start = node.values.start + (column - node.start) * node.height();
            // Entries above the diagonal, which are never read, have a position too.
            let rows = matrix.row_idx_of_col(column);
            let places = rows.map(|row| narrow(start + local(node, row)));
            schedule.places.extend(places);
        }
        let starts = matrix.col_ptr();
        for node in nodes {
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

/// Scratch of [`factor`].
pub(super) fn scratch(nodes: &[Node]) -> StackReq {
    let widest = nodes.iter().map(|node| node.width).max().unwrap_or(0);
    cholesky_in_place_scratch::<f32>(widest, Par::Seq, Spec::default())
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

/// Factors a matrix of the pattern, in the new supernodes; the others are kept. `rows`: workspace.
///
/// # Errors
/// The row of a pivot that is not positive.
pub(super) fn factor(
    pattern: &BlockPattern,
    values: &[f32],
    is_new: &[bool],
    factor: &mut [f32],
    rows: &mut Vec<f32>,
    stack: &mut MemStack,
) -> Result<(), usize> {
    let (nodes, schedule) = (&pattern.nodes, &pattern.schedule);
    for k in (0..nodes.len()).filter(|&k| is_new[k]) {
        factor[nodes[k].values.clone()].fill(0.0);
        let range = &schedule.values[k];
        let places = &schedule.places[range.clone()];
        for (&place, &value) in places.iter().zip(&values[range.clone()]) {
            factor[place as usize] = value;
        }
    }
    for (k, node) in nodes.iter().enumerate() {
        if is_new[k] {
            let panel = &mut factor[node.values.clone()];
            let panel = MatMut::from_column_major_slice_mut(panel, node.height(), node.width);
            let (mut top, mut bottom) = panel.split_at_row_mut(node.width);
            let none = LltRegularization::default();
            cholesky_in_place(top.as_mut(), none, Par::Seq, stack, Spec::default())
                .map_err(|LltError::NonPositivePivot { index }| node.start + index)?;
            let (top, bottom) = (top.as_ref(), bottom.as_mut().transpose_mut());
            solve_lower_triangular_in_place(top, bottom, Par::Seq);
        }
        let updates = &schedule.updates[schedule.of_node[k].clone()];
        if updates.iter().any(|update| is_new[update.target]) {
            let updates = updates.iter().filter(|update| is_new[update.target]);
            vectorised(
                #[inline(always)]
                || update(&schedule.rows, updates, node, factor, rows),
            );
        }
    }
    Ok(())
}

/// Applies the updates of a factored supernode to later ones, whose rows are those of the list, for
/// vectorised callers.
#[inline(always)]
fn update<'u>(
    targets: &[u32],
    updates: impl Iterator<Item = &'u Update>,
    node: &Node,
    factor: &mut [f32],
    rows: &mut Vec<f32>,
) {
    // Its rows below, column after column, with space for an incomplete block at the end, whose
    // content is arbitrary.
    let count = node.below.len();
    let height = count.next_multiple_of(LAST_ROWS) + LAST_ROWS;
    rows.resize((node.width * height).max(rows.len()), 0.0);
    let rows = &mut rows[..node.width * height];
    let columns = factor[node.values.clone()].chunks_exact(node.height());
    for (target, column) in rows.chunks_exact_mut(height).zip(columns) {
        target[..count].copy_from_slice(&column[node.width..]);
    }
    for update in updates {
        let targets = &targets[update.rows.clone()];
        let in_twos = update.columns - update.columns % TWO_SPHERES;
        for column in (0..in_twos).step_by(TWO_SPHERES) {
            subtract::<TWO_SPHERES>(rows, height, update, targets, column, factor);
        }
        for column in (in_twos..update.columns).step_by(COLUMNS) {
            subtract::<COLUMNS>(rows, height, update, targets, column, factor);
        }
    }
}

/// Updates C columns of a later supernode, from `column` of the update on. Results above the
/// diagonal are never read.
#[inline(always)]
fn subtract<const C: usize>(
    rows: &[f32],
    height: usize,
    update: &Update,
    targets: &[u32],
    column: usize,
    factor: &mut [f32],
) {
    let places = std::array::from_fn::<_, C, _>(|c| {
        update.start + targets[column + c] as usize * update.height
    });
    // Sums of a block of rows for successive columns.
    let mut take = |targets: &[u32], sums: &[f32]| {
        for (place, sums) in places.into_iter().zip(sums.chunks_exact(sums.len() / C)) {
            let target = &mut factor[place..place + update.height];
            for (&row, sum) in targets.iter().zip(sums) {
                target[row as usize] -= sum;
            }
        }
    };
    let from = update.first + column;
    let (whole, last) = targets[column..].as_chunks::<ROWS>();
    for (number, targets) in whole.iter().enumerate() {
        let sums = products::<ROWS, C>(rows, height, from + ROWS * number, from);
        take(targets, sums.as_flattened());
    }
    let begin = from + ROWS * whole.len();
    for (number, targets) in last.chunks(LAST_ROWS).enumerate() {
        let sums = products::<LAST_ROWS, C>(rows, height, begin + LAST_ROWS * number, from);
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
        for side in [2, 7, 25] {
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
            for node in &pattern.nodes {
                for column in 0..node.width {
                    let start = node.values.start + column * node.height();
                    let below = start + column..start + node.height();
                    assert_eq!(matrix.factor[below.clone()], expected[below], "side {side}");
                }
            }
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
