//! Sparse symmetric positive definite matrices of 3 × 3 blocks, one block row per sphere, and their
//! Cholesky factors.
//!
//! Pattern, order and symbolic factorization are computed once for all matrices of a pattern. The
//! order is that of approximate minimum degree on the graph of the spheres, in large graphs with
//! [`dissection`] above it; faer determines the supernodes, columns with the same rows. Matrix and
//! factor are in **single precision**: they precondition [`crate::linalg::gmres`], which iterates
//! in double precision, with half the memory traffic.
//!
//! [`numeric`] factors, [`levels`] solves: independent supernodes as in [`eight`], others as in
//! [`single`]. Large factors are divided in [`parts`], which several threads compute. The time of
//! faer's own factorization and solve of the same pattern, over the time of these, by `cargo test
//! --release -p sd-core --lib times_of -- --ignored --nocapture`:
//!
//! | near field of | factorization | solve |
//! | --- | ---: | ---: |
//! | a layer of 200 spheres, c = 0.7 | 1.42 | 2.85 |
//! | a layer of 1000 | 1.36 | 2.79 |
//! | a suspension of 200, φ = 0.5 | 1.11 | 4.32 |
//! | a suspension of 1000 | 0.98 | 5.77 |
//!
//! Some ten solves follow a factorization. The ratios are those of the release profile: compiled in
//! many units, as for incremental builds, these take several times as long.

mod dissection;
mod eight;
mod lanes;
mod levels;
mod node;
mod numeric;
mod parts;
mod single;

use self::node::Node;
use crate::linalg::error::BadPivot;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::simplicial::prefactorize_symbolic_cholesky;
use faer::sparse::linalg::cholesky::simplicial::prefactorize_symbolic_cholesky_scratch;
use faer::sparse::linalg::cholesky::supernodal::{
    SymbolicSupernodalCholesky, factorize_supernodal_symbolic_cholesky,
    factorize_supernodal_symbolic_cholesky_scratch,
};
use faer::sparse::linalg::{SymbolicSupernodalParams, amd};
use faer::sparse::{FaerError, SymbolicSparseColMat, SymbolicSparseColMatRef};

/// A 3 × 3 block, by columns.
pub(crate) type Block = [f64; 9];

/// Position of a block in the values of a matrix.
#[derive(Debug, Clone, Copy)]
struct Place {
    start: usize,
    /// Stride between columns of the block.
    stride: usize,
    /// Whether the block's columns are the second sphere's.
    transposed: bool,
}

/// The pattern: nonzero blocks, elimination order of the spheres, and fill-in.
#[derive(Debug)]
pub(crate) struct BlockPattern {
    /// Block row of each sphere.
    rows: Vec<usize>,
    /// Scalar pattern of the lower triangle, diagonal blocks whole.
    scalar: SymbolicSparseColMat<usize>,
    /// Position of each sphere's diagonal block.
    diagonal: Vec<Place>,
    /// Position of each coupling, in the order given.
    couplings: Vec<Place>,
    /// Symbolic factorization.
    symbolic: SymbolicSupernodalCholesky<usize>,
    /// Its supernodes, and those of each part.
    nodes: Vec<Node>,
    parts: Vec<Vec<usize>>,
    /// Positions of values in it.
    schedule: numeric::Schedule,
    /// The order of a solve.
    order: levels::SolveOrder,
}

impl BlockPattern {
    /// Determines the order of elimination and the fill-in. `couplings`: pairs of different
    /// spheres, each once.
    ///
    /// `None` if out of memory.
    pub(crate) fn new(spheres: usize, couplings: &[(usize, usize)]) -> Option<Self> {
        let rows = elimination_order(spheres, couplings).ok()?;
        // Block rows below, and above, the diagonal of each block column, ascending.
        let (mut lower, mut above) = (vec![Vec::new(); spheres], vec![Vec::new(); spheres]);
        for &(i, j) in couplings {
            let (first, second) = (rows[i].min(rows[j]), rows[i].max(rows[j]));
            lower[first].push(second);
            above[second].push(first);
        }
        for others in lower.iter_mut().chain(&mut above) {
            others.sort_unstable();
        }
        let mut starts = Vec::with_capacity(spheres);
        let mut start = 0;
        for others in &lower {
            starts.push(start);
            start += 9 * (1 + others.len());
        }
        let place = |row: usize, column: usize, transposed: bool| {
            let others = &lower[column];
            let before = if row == column {
                0
            } else {
                1 + others.partition_point(|&other| other < row)
            };
            Place {
                start: starts[column] + 3 * before,
                stride: 3 * (1 + others.len()),
                transposed,
            }
        };
        let diagonal = rows.iter().map(|&row| place(row, row, false)).collect();
        let couplings = couplings.iter().map(|&(i, j)| {
            let (row_i, row_j) = (rows[i], rows[j]);
            place(row_i.max(row_j), row_i.min(row_j), row_j < row_i)
        });
        // The analysis reads the upper triangle, the factorization the lower one.
        let symbolic = analyse(scalars(&above).as_ref()).ok()?;
        let scalar = scalars(&lower);
        let mut nodes = Node::all(&symbolic);
        let (owner, below) = (Node::owners(&nodes, 3 * spheres), symbolic.row_idx());
        let parts = parts::divide(&nodes, &owner, below);
        Node::sort_values(&mut nodes, &parts);
        let mut elements = vec![0; 3 * spheres];
        for (sphere, &row) in rows.iter().enumerate() {
            for k in 0..3 {
                elements[3 * row + k] = 3 * sphere + k;
            }
        }
        let order = levels::SolveOrder::new(&nodes, &parts, (&owner, below), &elements);
        let schedule = numeric::Schedule::new(&nodes, &parts, (&owner, below), scalar.as_ref());
        Some(Self {
            diagonal,
            couplings: couplings.collect(),
            schedule,
            order,
            nodes,
            parts,
            symbolic,
            scalar,
            rows,
        })
    }

    /// Number of spheres.
    pub(crate) fn spheres(&self) -> usize {
        self.rows.len()
    }
}

/// The scalar pattern of a block pattern: diagonal blocks, and others by block column.
fn scalars(others: &[Vec<usize>]) -> SymbolicSparseColMat<usize> {
    let (mut starts, mut indices) = (vec![0], Vec::new());
    for (column, others) in others.iter().enumerate() {
        let mut rows = others.clone();
        rows.push(column);
        rows.sort_unstable();
        for _ in 0..3 {
            indices.extend(rows.iter().flat_map(|row| 3 * row..3 * row + 3));
            starts.push(indices.len());
        }
    }
    let size = 3 * others.len();
    SymbolicSparseColMat::new_checked(size, size, starts, None, indices)
}

/// The spheres to which each is coupled and itself, ascending.
fn columns(spheres: usize, couplings: &[(usize, usize)]) -> Vec<Vec<usize>> {
    let mut columns: Vec<Vec<usize>> = (0..spheres).map(|i| vec![i]).collect();
    for &(i, j) in couplings {
        columns[i].push(j);
        columns[j].push(i);
    }
    for column in &mut columns {
        column.sort_unstable();
    }
    columns
}

/// Block row of each sphere.
fn elimination_order(
    spheres: usize,
    couplings: &[(usize, usize)],
) -> Result<Vec<usize>, FaerError> {
    let columns = columns(spheres, couplings);
    if spheres < dissection::LEAST_ROWS {
        minimum_degree(&columns)
    } else {
        dissection::order(&columns)
    }
}

/// Position of each vertex in the order of approximate minimum degree; `columns`: its neighbours
/// and itself, ascending.
fn minimum_degree(columns: &[Vec<usize>]) -> Result<Vec<usize>, FaerError> {
    let (count, indices) = (columns.len(), columns.concat());
    let mut starts = vec![0];
    for column in columns {
        starts.push(starts[starts.len() - 1] + column.len());
    }
    let graph = SymbolicSparseColMatRef::new_checked(count, count, &starts, None, &indices);
    let (mut order, mut positions) = (vec![0; count], vec![0; count]);
    let scratch = amd::order_scratch::<usize>(count, indices.len());
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| FaerError::OutOfMemory)?;
    let control = amd::Control::default();
    let stack = MemStack::new(&mut memory);
    amd::order(&mut order, &mut positions, graph, control, stack)?;
    Ok(positions)
}

/// Symbolic factorization of the matrix with that upper triangle.
fn analyse(
    upper: SymbolicSparseColMatRef<'_, usize>,
) -> Result<SymbolicSupernodalCholesky<usize>, FaerError> {
    let size = upper.nrows();
    let scratch = prefactorize_symbolic_cholesky_scratch::<usize>(size, upper.compute_nnz()).or(
        factorize_supernodal_symbolic_cholesky_scratch::<usize>(size),
    );
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| FaerError::OutOfMemory)?;
    let (mut tree, mut counts) = (vec![0_isize; size], vec![0; size]);
    let stack = MemStack::new(&mut memory);
    let tree = prefactorize_symbolic_cholesky(&mut tree, &mut counts, upper, stack);
    factorize_supernodal_symbolic_cholesky(
        upper,
        tree,
        &counts,
        MemStack::new(&mut memory),
        SymbolicSupernodalParams::default(),
    )
}

/// A matrix of a [`BlockPattern`] and its factor, in single precision, with workspace.
#[derive(Default)]
pub(crate) struct BlockCholesky {
    /// Values of the matrix.
    values: Vec<f32>,
    /// Values of the factor, of the factored matrix, and flags of factored supernodes.
    factor: Vec<f32>,
    factored: Vec<f32>,
    is_new: Vec<bool>,
    /// Values of the factor in the layout of solves.
    packed: Vec<lanes::Lanes>,
    /// Right-hand side in the order of a solve.
    ordered: Vec<lanes::Lanes>,
    work: levels::Workspace,
    works: Vec<numeric::Workspace>,
}

impl BlockCholesky {
    /// Sets the matrix to zero. Allocates only for a pattern larger than all before.
    pub(crate) fn reset(&mut self, pattern: &BlockPattern) {
        self.values.clear();
        self.values.resize(pattern.scalar.row_idx().len(), 0.0);
    }

    /// Copies another matrix of the same pattern.
    pub(crate) fn copy_matrix(&mut self, other: &Self) {
        self.values.clone_from(&other.values);
    }

    /// Copies the diagonal block of a sphere from another matrix of the same pattern.
    pub(crate) fn copy_own(&mut self, pattern: &BlockPattern, other: &Self, sphere: usize) {
        copy(&mut self.values, &other.values, pattern.diagonal[sphere]);
    }

    /// Copies the block of a coupling from another matrix of the same pattern.
    pub(crate) fn copy_coupling(&mut self, pattern: &BlockPattern, other: &Self, coupling: usize) {
        copy(&mut self.values, &other.values, pattern.couplings[coupling]);
    }

    /// Allocates a factor and its solves.
    fn make_room(&mut self, pattern: &BlockPattern) {
        self.ordered.clear();
        self.ordered
            .resize(pattern.order.length(), [0.0; lanes::LANES]);
        self.factor.resize(pattern.symbolic.len_val(), 0.0);
    }

    /// Adds to a diagonal block.
    pub(crate) fn add_own(&mut self, pattern: &BlockPattern, sphere: usize, block: &Block) {
        add(&mut self.values, pattern.diagonal[sphere], block);
    }

    /// Adds to the block of a coupling (i, j): rows of j, columns of i.
    pub(crate) fn add_coupling(&mut self, pattern: &BlockPattern, coupling: usize, block: &Block) {
        add(&mut self.values, pattern.couplings[coupling], block);
    }

    /// Factors the matrix, which is unchanged. Allocates only for a pattern larger than all before.
    ///
    /// # Errors
    /// [`BadPivot`] with `3 × sphere + component`.
    pub(crate) fn factor(&mut self, pattern: &BlockPattern) -> Result<(), BadPivot> {
        self.make_room(pattern);
        self.is_new.clear();
        self.is_new.resize(pattern.nodes.len(), true);
        pattern.order.make_room(&mut self.packed);
        self.factor_new(pattern)
    }

    /// Refactors a matrix of the same pattern as at the last factorization: updates only what
    /// changed values affect, with the same bits.
    ///
    /// # Errors
    /// [`BadPivot`] with the row of the pivot.
    pub(crate) fn factor_again(&mut self, pattern: &BlockPattern) -> Result<(), BadPivot> {
        if self.factored.len() != self.values.len() {
            return self.factor(pattern);
        }
        let schedule = &pattern.schedule;
        schedule.find_changes(&self.factored, &self.values, &mut self.is_new);
        self.factor_new(pattern)
    }

    /// Factors the supernodes that are new.
    fn factor_new(&mut self, pattern: &BlockPattern) -> Result<(), BadPivot> {
        // A failed factorization is discarded.
        self.factored.clear();
        numeric::factor(
            pattern,
            (&self.values, &self.is_new),
            &mut self.factor,
            &mut self.works,
        )
        .map_err(|row| {
            let sphere = pattern.rows.iter().position(|&other| other == row / 3);
            BadPivot {
                pivot: 3 * sphere.unwrap_or(0) + row % 3,
            }
        })?;
        let (nodes, order) = (&pattern.nodes, &pattern.order);
        order.pack(nodes, &self.is_new, &self.factor, &mut self.packed);
        self.factored.extend_from_slice(&self.values);
        Ok(())
    }

    /// `z ≈ A⁻¹ r` by the factor; vectors `[3N]` in the order of the spheres.
    pub(crate) fn solve(&mut self, pattern: &BlockPattern, r: &[f64], z: &mut [f64]) {
        pattern.order.solve(
            &pattern.nodes,
            (&self.factor, &self.packed),
            r,
            z,
            (&mut self.ordered, &mut self.work),
        );
    }
}

fn copy(values: &mut [f32], from: &[f32], place: Place) {
    for column in 0..3 {
        let start = place.start + column * place.stride;
        values[start..start + 3].copy_from_slice(&from[start..start + 3]);
    }
}

fn add(values: &mut [f32], place: Place, block: &Block) {
    for column in 0..3 {
        let target = &mut values[place.start + column * place.stride..][..3];
        for row in 0..3 {
            let value = if place.transposed {
                block[3 * row + column]
            } else {
                block[3 * column + row]
            };
            #[expect(clippy::cast_possible_truncation, reason = "the factor's precision")]
            let value = value as f32;
            target[row] += value;
        }
    }
}

/// An index into a factor or a vector, 32 bits since patterns store many.
fn narrow(place: usize) -> u32 {
    u32::try_from(place).expect("factors have fewer than 2^32 values")
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    pub(crate) use numeric::tests::times;

    /// A ring of spheres, each coupled to the next and to one far away.
    fn ring(n: usize) -> Vec<(usize, usize)> {
        let near = (0..n).map(|i| (i.min((i + 1) % n), i.max((i + 1) % n)));
        let far = (0..n / 2).map(|i| (i, i + n / 2));
        let mut pairs: Vec<_> = near.chain(far).collect();
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// A matrix of a periodic lattice of `side²` spheres, some of whose neighbours are missing, and
    /// its pattern.
    pub(super) fn lattice(side: usize) -> (BlockPattern, BlockCholesky) {
        let at = |x: usize, y: usize| (y % side) * side + x % side;
        let all = (0..side * side).flat_map(|i| {
            let (x, y) = (i % side, i / side);
            [at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)].map(|j| (i.min(j), i.max(j)))
        });
        let kept = all.enumerate().filter(|(k, _)| (k * k) % 7 < 4);
        matrix(side * side, kept.map(|(_, pair)| pair).collect())
    }

    /// Couplings of a cubic lattice of `side³` spheres, some of whose neighbours are missing.
    pub(super) fn cube(side: usize) -> Vec<(usize, usize)> {
        let at = |x: usize, y: usize, z: usize| ((z % side) * side + y % side) * side + x % side;
        let all = (0..side * side * side).flat_map(|i| {
            let (x, y, z) = (i % side, i / side % side, i / (side * side));
            let others = [at(x + 1, y, z), at(x, y + 1, z), at(x, y, z + 1)];
            others.map(|j| (i.min(j), i.max(j)))
        });
        let kept = all.enumerate().filter(|(k, _)| (k * k) % 7 < 4);
        kept.map(|(_, pair)| pair).collect()
    }

    /// A matrix of isolated pairs of spheres, and its pattern.
    pub(super) fn couples(n: usize) -> (BlockPattern, BlockCholesky) {
        matrix(2 * n, (0..n).map(|k| (2 * k, 2 * k + 1)).collect())
    }

    pub(super) fn matrix(
        n: usize,
        mut pairs: Vec<(usize, usize)>,
    ) -> (BlockPattern, BlockCholesky) {
        pairs.sort_unstable();
        pairs.dedup();
        let pattern = BlockPattern::new(n, &pairs).unwrap();
        let mut matrix = BlockCholesky::default();
        matrix.reset(&pattern);
        for i in 0..n {
            let spin = 20.0 + (i as f64).sin();
            let own = [19.0, 0.5, 0.1, 0.5, 18.0, -0.3, 0.1, -0.3, spin];
            matrix.add_own(&pattern, i, &own);
        }
        for k in 0..pairs.len() {
            let block = std::array::from_fn(|m| (0.7 * k as f64 + m as f64).sin());
            matrix.add_coupling(&pattern, k, &block);
        }
        (pattern, matrix)
    }

    #[test]
    fn solves_are_those_of_the_whole_matrix_to_single_precision() {
        let n = 40;
        let pairs = ring(n);
        let pattern = BlockPattern::new(n, &pairs).unwrap();
        let mut sparse = BlockCholesky::default();
        sparse.reset(&pattern);
        let mut whole = crate::linalg::cholesky::dense::DenseCholesky::new(3 * n);
        whole.matrix_mut().reset(3 * n, 3 * n);
        for i in 0..n {
            let own = [9.0, 0.5, 0.1, 0.5, 8.0, -0.3, 0.1, -0.3, 10.0 + i as f64];
            sparse.add_own(&pattern, i, &own);
            for column in 0..3 {
                for row in column..3 {
                    whole.matrix_mut()[(3 * i + row, 3 * i + column)] = own[3 * column + row];
                }
            }
        }
        for (k, &(i, j)) in pairs.iter().enumerate() {
            let block: Block = std::array::from_fn(|m| (0.7 * k as f64 + m as f64).sin());
            sparse.add_coupling(&pattern, k, &block);
            for column in 0..3 {
                for row in 0..3 {
                    whole.matrix_mut()[(3 * j + row, 3 * i + column)] = block[3 * column + row];
                }
            }
        }
        sparse.factor(&pattern).unwrap();
        whole.factor().unwrap();
        let r: Vec<f64> = (0..3 * n).map(|k| (k as f64).cos()).collect();
        let (mut z, mut expected) = (vec![0.0; 3 * n], r.clone());
        sparse.solve(&pattern, &r, &mut z);
        whole.solve(&mut expected);
        for (a, b) in z.iter().zip(&expected) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
    }

    #[test]
    fn factor_of_a_matrix_that_changed_a_little_has_the_bits_of_a_new_one() {
        let (pattern, mut matrix) = lattice(25);
        matrix.factor(&pattern).unwrap();
        let stiff = [50.0, 1.0, 2.0, 1.0, 40.0, 3.0, 2.0, 3.0, 60.0];
        for spheres in [&[][..], &[17], &[3, 250, 600]] {
            for &sphere in spheres {
                matrix.add_own(&pattern, sphere, &stiff);
            }
            matrix.factor_again(&pattern).unwrap();
            let changed = matrix.is_new.iter().filter(|&&is_new| is_new).count();
            assert!(changed < pattern.nodes.len() / 2 && (changed > 0) != spheres.is_empty());
            let mut new = BlockCholesky::default();
            new.copy_matrix(&matrix);
            new.factor(&pattern).unwrap();
            assert!(new.factor == matrix.factor && new.packed == matrix.packed);
        }
        // Nothing is kept after a failure.
        let (_, whole) = lattice(25);
        matrix.add_own(&pattern, 40, &[-1e3; 9]);
        assert!(matrix.factor_again(&pattern).is_err());
        matrix.copy_matrix(&whole);
        matrix.factor_again(&pattern).unwrap();
        let mut new = BlockCholesky::default();
        new.copy_matrix(&whole);
        new.factor(&pattern).unwrap();
        assert!(new.factor == matrix.factor && new.packed == matrix.packed);
    }

    #[test]
    fn indefinite_matrix_names_its_sphere() {
        let pattern = BlockPattern::new(12, &ring(12)).unwrap();
        let mut sparse = BlockCholesky::default();
        sparse.reset(&pattern);
        for i in 0..12 {
            let sign = if i == 7 { -1.0 } else { 1.0 };
            sparse.add_own(&pattern, i, &[1.0, 0.0, 0.0, 0.0, sign, 0.0, 0.0, 0.0, 1.0]);
        }
        assert_eq!(sparse.factor(&pattern), Err(BadPivot { pivot: 22 }));
    }
}
