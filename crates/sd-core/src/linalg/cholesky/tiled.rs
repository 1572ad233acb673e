//! Cholesky factorization of a full matrix stored in rows of tiles, and operations with its factor.
//!
//! ```text
//! row of tiles t: rows r_t .. r_(t+1) (at most TILE), columns 0 .. r_(t+1), by columns:  (i, j) at offset_t + TILE j + (i − r_t)
//! L_ts = (A_ts − Σ_(u<s) L_tu L_suᵀ) L_ss⁻ᵀ        L_tt L_ttᵀ = A_tt − Σ_(u<t) L_tu L_tuᵀ
//! ```
//! The sum over u is one product of two contiguous strips `[TILE × K]`: the optimal shape and
//! storage for a matrix product, twice as fast as on a large matrix stored by columns, with half
//! the storage.

mod inverse;

use crate::linalg::error::BadPivot;
use crate::linalg::simd::vectorised;
use crate::linalg::vector;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par, Spec};
use std::ops::Range;

/// Rows of a tile, and distance of its columns: a multiple of the vector length, and of the modes
/// of a sphere.
pub(crate) const TILE: usize = 48;
/// Rows of a tile that are divided together: two columns of them fit in the registers.
const ROWS: usize = 24;
/// Rows of tiles that are finished before their columns update the rows below.
const GROUP: usize = 4;
/// Columns of a strip that is used several times while it is in the cache.
const DEPTH: usize = 384;

/// The lower triangle of a square matrix `[n × n]`, in rows of tiles.
#[derive(Debug, Clone, Default)]
pub struct TiledMatrix {
    /// Entries; short tiles are padded up to the next column.
    values: Vec<f64>,
    /// First row of each row of tiles, then n.
    starts: Vec<usize>,
    /// Start of each row of tiles in `values`, then its length.
    offsets: Vec<usize>,
}

impl TiledMatrix {
    /// Sets the shape to two square blocks of dimension `half` on the diagonal, each cut into its
    /// own tiles; entries are undefined.
    pub fn reshape_halves(&mut self, half: usize) {
        if self.rows() == 2 * half {
            return;
        }
        self.starts.clear();
        for block in [0, half] {
            self.starts
                .extend((0..half).step_by(TILE).map(|row| block + row));
        }
        self.starts.push(2 * half);
        self.offsets.clear();
        self.offsets.push(0);
        let mut length = 0;
        for &end in &self.starts[1..] {
            length += TILE * end;
            self.offsets.push(length);
        }
        self.values.resize(length, 0.0);
    }

    /// Dimension n.
    pub fn rows(&self) -> usize {
        self.starts.last().copied().unwrap_or(0)
    }

    fn tiles(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// All entries; see [`TiledMatrix::position`].
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Index of the entry (row, 0) among the values; (row, j) is `TILE` j further, for j up to the
    /// end of the row's tile. Rows below follow up to the end of the tile: three rows beginning at
    /// a multiple of three of either half are always together.
    pub fn position(&self, row: usize) -> usize {
        let tile = self.starts.partition_point(|&start| start <= row) - 1;
        self.offsets[tile] + row - self.starts[tile]
    }

    /// Entry of the lower triangle.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.values[self.position(row) + TILE * column]
    }
}

/// Rows `height`, columns `range` of a row of tiles, or of any strip stored like one.
fn strip(values: &[f64], height: usize, range: Range<usize>) -> MatRef<'_, f64> {
    let part = &values[TILE * range.start..TILE * range.end];
    MatRef::from_column_major_slice_with_stride(part, height, range.len(), TILE)
}

/// Rows and columns as in [`strip`], mutable.
fn strip_mut(values: &mut [f64], height: usize, range: Range<usize>) -> MatMut<'_, f64> {
    let part = &mut values[TILE * range.start..TILE * range.end];
    MatMut::from_column_major_slice_with_stride_mut(part, height, range.len(), TILE)
}

/// `X ← X L⁻ᵀ` for one tile, L the lower triangle of a diagonal tile; both by columns, `TILE`
/// apart.
fn divide(l: &[f64], x: &mut [f64], height: usize) {
    vectorised(
        #[inline(always)]
        || {
            for first in (0..height).step_by(ROWS) {
                divide_rows(l, x, first);
            }
        },
    );
}

/// [`divide`] for the rows from `first` on that fit in registers, two columns at a time.
#[inline(always)]
fn divide_rows(l: &[f64], x: &mut [f64], first: usize) {
    let width = x.len() / TILE;
    for k in (0..width).step_by(2) {
        let (known, open) = x.split_at_mut(TILE * k);
        let (mut a, mut b) = ([0.0; ROWS], [0.0; ROWS]);
        for (column, factors) in known.chunks_exact(TILE).zip(l.chunks_exact(TILE)) {
            let column = &column[first..first + ROWS];
            let (of_a, of_b) = (factors[k], factors[k + 1]);
            for r in 0..ROWS {
                a[r] = column[r].mul_add(of_a, a[r]);
                b[r] = column[r].mul_add(of_b, b[r]);
            }
        }
        let (column, rest) = open.split_at_mut(TILE);
        let own = l[TILE * k + k].recip();
        for (x, sum) in column[first..first + ROWS].iter_mut().zip(&mut a) {
            *sum = (*x - *sum) * own;
            *x = *sum;
        }
        if k + 1 == width {
            return;
        }
        let (between, own) = (l[TILE * k + k + 1], l[TILE * (k + 1) + k + 1].recip());
        for ((x, sum), a) in rest[first..first + ROWS].iter_mut().zip(b).zip(a) {
            *x = (*x - a.mul_add(between, sum)) * own;
        }
    }
}

/// Cholesky factorization `A = L Lᵀ` in rows of tiles, with its workspace.
#[derive(Default)]
pub struct TiledCholesky {
    /// A, then L. Entries above the diagonal of a diagonal tile are undefined.
    matrix: TiledMatrix,
    /// Scratch of a diagonal tile, allocated in the first factorization.
    scratch: Option<MemBuffer>,
    /// Transposed inverse of the trailing factor: rows of tiles `[TILE × m]`.
    inverse: Vec<f64>,
}

/// The shape of a matrix that is being factored.
#[derive(Clone, Copy)]
struct Shape<'a> {
    /// First row of each row of tiles, then n.
    starts: &'a [usize],
    /// Start of each row of tiles.
    offsets: &'a [usize],
}

impl Shape<'_> {
    fn height(&self, tile: usize) -> usize {
        self.starts[tile + 1] - self.starts[tile]
    }

    /// A row of tiles among all values.
    fn row<'v>(&self, values: &'v [f64], tile: usize) -> &'v [f64] {
        &values[self.offsets[tile]..self.offsets[tile + 1]]
    }

    /// Subtracts from tile (t, s) of row t the product of columns `range` of rows t and s.
    fn subtract(&self, upper: &[f64], row: &mut [f64], t: usize, s: usize, range: Range<usize>) {
        if range.is_empty() {
            return;
        }
        let (known, open) = row.split_at_mut(TILE * self.starts[s]);
        let (height, width) = (self.height(t), self.height(s));
        let other = if t == s {
            strip(known, width, range.clone())
        } else {
            strip(self.row(upper, s), width, range.clone())
        };
        matmul(
            strip_mut(open, height, 0..width),
            Accum::Add,
            strip(known, height, range),
            other.transpose(),
            -1.0,
            Par::Seq,
        );
    }

    /// Replaces tile (t, s) of row t by that of L once all columns before are subtracted.
    fn divide(&self, upper: &[f64], row: &mut [f64], t: usize, s: usize) {
        let columns = TILE * self.starts[s]..TILE * self.starts[s + 1];
        divide(
            &self.row(upper, s)[columns.clone()],
            &mut row[columns],
            self.height(t),
        );
    }

    /// Finishes the columns of a group in the rows of tiles `tiles`, all below the group; `rows`
    /// holds these alone.
    fn finish_group(
        &self,
        upper: &[f64],
        rows: &mut [f64],
        tiles: Range<usize>,
        group: Range<usize>,
    ) {
        if tiles.is_empty() {
            return;
        }
        let base = self.offsets[tiles.start];
        let known = self.starts[group.start];
        // Complete pieces of the known columns first, each for all rows while the group's strips
        // are in the cache.
        let mut first = 0;
        while first + DEPTH < known {
            for t in tiles.clone() {
                let row = &mut rows[self.offsets[t] - base..self.offsets[t + 1] - base];
                for s in group.clone() {
                    self.subtract(upper, row, t, s, first..first + DEPTH);
                }
            }
            first += DEPTH;
        }
        for t in tiles {
            let row = &mut rows[self.offsets[t] - base..self.offsets[t + 1] - base];
            for s in group.clone() {
                self.subtract(upper, row, t, s, first..self.starts[s]);
                self.divide(upper, row, t, s);
            }
        }
    }
}

impl TiledCholesky {
    /// The matrix to fill before [`TiledCholesky::factor`]; holds L afterwards.
    pub fn matrix_mut(&mut self) -> &mut TiledMatrix {
        &mut self.matrix
    }

    /// L.
    pub fn lower(&self) -> &TiledMatrix {
        &self.matrix
    }

    /// Factors the matrix in place. Cost n³/3.
    ///
    /// # Errors
    /// [`BadPivot`] with the row at which it broke down.
    pub fn factor(&mut self) -> Result<(), BadPivot> {
        let scratch = self.scratch.get_or_insert_with(|| {
            MemBuffer::new(llt::factor::cholesky_in_place_scratch::<f64>(
                TILE,
                Par::Seq,
                Spec::default(),
            ))
        });
        let tiles = self.matrix.tiles();
        let shape = Shape {
            starts: &self.matrix.starts,
            offsets: &self.matrix.offsets,
        };
        let values = &mut self.matrix.values;
        for start in (0..tiles).step_by(GROUP) {
            let group = start..(start + GROUP).min(tiles);
            for t in group.clone() {
                let (upper, rest) = values.split_at_mut(shape.offsets[t]);
                let row = &mut rest[..shape.offsets[t + 1] - shape.offsets[t]];
                shape.finish_group(upper, row, t..t + 1, group.start..t);
                shape.subtract(upper, row, t, t, 0..shape.starts[t]);
                let columns = shape.starts[t]..shape.starts[t + 1];
                llt::factor::cholesky_in_place(
                    strip_mut(row, columns.len(), columns),
                    llt::factor::LltRegularization::default(),
                    Par::Seq,
                    MemStack::new(scratch),
                    Spec::default(),
                )
                .map_err(|llt::factor::LltError::NonPositivePivot { index }| {
                    BadPivot {
                        pivot: shape.starts[t] + index,
                    }
                })?;
            }
            let (upper, rest) = values.split_at_mut(shape.offsets[group.end]);
            let below = group.end..tiles;
            shape.finish_group(upper, rest, below, group);
        }
        Ok(())
    }

    /// `x ← L⁻¹ x` for one vector.
    pub fn solve_lower_vector(&self, x: &mut [f64]) {
        let matrix = &self.matrix;
        vectorised(
            #[inline(always)]
            || {
                for t in 0..matrix.tiles() {
                    let (start, end) = (matrix.starts[t], matrix.starts[t + 1]);
                    let row = &matrix.values[matrix.offsets[t]..matrix.offsets[t + 1]];
                    let (known, open) = x.split_at_mut(start);
                    let mut sums = [0.0; TILE];
                    for (column, &xk) in row.chunks_exact(TILE).zip(known.iter()) {
                        for (sum, value) in sums.iter_mut().zip(column) {
                            *sum = value.mul_add(xk, *sum);
                        }
                    }
                    let open = &mut open[..end - start];
                    for (value, sum) in open.iter_mut().zip(sums) {
                        *value -= sum;
                    }
                    for (k, column) in row.chunks_exact(TILE).skip(start).enumerate() {
                        let xk = open[k] / column[k];
                        open[k] = xk;
                        for (value, l) in open[k + 1..].iter_mut().zip(&column[k + 1..]) {
                            *value -= l * xk;
                        }
                    }
                }
            },
        );
    }

    /// `x ← L⁻ᵀ x` for one vector, rows from `first` (0 or half) on: the others are unchanged.
    pub fn solve_upper_vector(&self, x: &mut [f64], first: usize) {
        let matrix = &self.matrix;
        vectorised(
            #[inline(always)]
            || {
                for t in (0..matrix.tiles()).rev() {
                    let (start, end) = (matrix.starts[t], matrix.starts[t + 1]);
                    if start < first {
                        break;
                    }
                    let row = &matrix.values[matrix.offsets[t]..matrix.offsets[t + 1]];
                    let (known, open) = x.split_at_mut(start);
                    let open = &mut open[..end - start];
                    for (k, column) in row.chunks_exact(TILE).skip(start).enumerate().rev() {
                        let mut xk = open[k];
                        for (value, l) in open[k + 1..].iter().zip(&column[k + 1..]) {
                            xk -= l * value;
                        }
                        open[k] = xk / column[k];
                    }
                    let height = open.len();
                    let columns = &row[TILE * first..TILE * start];
                    for (four, xs) in columns.chunks(4 * TILE).zip(known[first..].chunks_mut(4)) {
                        if xs.len() == 4 {
                            let at = [0, TILE, 2 * TILE, 3 * TILE].map(|c| &four[c..c + height]);
                            let sums = vector::dot_four(at, open);
                            for (xk, sum) in xs.iter_mut().zip(sums) {
                                *xk -= sum;
                            }
                        } else {
                            for (column, xk) in four.chunks(TILE).zip(xs) {
                                *xk -= vector::dot_inline(&column[..height], open);
                            }
                        }
                    }
                }
            },
        );
    }
}

#[cfg(test)]
mod tests;
