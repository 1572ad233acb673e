//! The trailing block of an inverse, from the factor.

use super::{LARGE, Shape, TILE, TiledCholesky, divide, strip, strip_mut};
use crate::linalg::dense::Matrix;
use crate::linalg::join::join;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, Par};
use std::ops::Range;

impl TiledCholesky {
    /// The trailing half of A⁻¹, as `V Vᵀ` with `V = L₂₂⁻ᵀ`, L₂₂ the trailing half of L: makes V
    /// and writes the lower triangle `[n/2 × n/2]` of `V Vᵀ` into `out`. Cost 2 (n/2)³/3.
    pub fn trailing_inverse(&mut self, out: &mut Matrix) {
        let tiles = self.matrix.tiles();
        let (first, half) = (tiles / 2, self.matrix.rows() / 2);
        self.inverse.resize(TILE * half * (tiles - first), 0.0);
        out.reshape(half, half);
        let shape = Shape {
            starts: &self.matrix.starts,
            offsets: &self.matrix.offsets,
        };
        let lower = &self.matrix.values;
        let strips = TILE * half;
        let share = tiles >= LARGE;
        // Row t of V is made by (last − t)² products of tiles, and so is column t of the product:
        // the first fifth is half of the work.
        let cut = first + (tiles - first).div_ceil(5);
        let (upper, rest) = self.inverse.split_at_mut(strips * (cut - first));
        join(
            share,
            || shape.invert(lower, upper, first..cut, first),
            || shape.invert(lower, rest, cut..tiles, first),
        );
        let inverse = &self.inverse;
        let columns = shape.starts[cut] - half;
        let (left, right) = out.values_mut().split_at_mut(half * columns);
        join(
            share,
            || shape.outer(inverse, left, first..cut, first),
            || shape.outer(inverse, right, cut..tiles, first),
        );
    }

    /// V of [`TiledCholesky::trailing_inverse`], by tiles: rows of the tile (counted from the
    /// half), and its columns from the diagonal on, `TILE` apart.
    pub(crate) fn inverse_rows(&self) -> impl Iterator<Item = (Range<usize>, &[f64])> {
        let tiles = self.matrix.tiles();
        let half = self.matrix.rows() / 2;
        (tiles / 2..tiles)
            .zip(self.inverse.chunks_exact((TILE * half).max(1)))
            .map(move |(t, strip)| {
                let rows = self.matrix.starts[t] - half..self.matrix.starts[t + 1] - half;
                let from = TILE * rows.start;
                (rows, &strip[from..])
            })
    }
}

impl Shape<'_> {
    /// Rows `tiles` of `V = L₂₂⁻ᵀ`, each a strip of all columns of the half: `V_t L₂₂ᵀ = e_t`,
    /// column after column.
    fn invert(&self, lower: &[f64], inverse: &mut [f64], tiles: Range<usize>, first: usize) {
        let half = self.starts[first];
        let strips = inverse.chunks_exact_mut((TILE * half).max(1));
        for (t, row) in tiles.zip(strips) {
            let (start, height) = (self.starts[t] - half, self.height(t));
            for s in t..self.starts.len() - 1 {
                let columns = self.starts[s] - half..self.starts[s + 1] - half;
                let (known, open) = row.split_at_mut(TILE * columns.start);
                let mut tile = strip_mut(open, height, 0..columns.len());
                let of_l = self.row(lower, s);
                if s == t {
                    tile.fill(0.0);
                    for k in 0..height {
                        tile[(k, k)] = 1.0;
                    }
                } else {
                    let solved = half + start..half + columns.start;
                    matmul(
                        tile.as_mut(),
                        Accum::Replace,
                        strip(known, height, start..columns.start),
                        strip(of_l, columns.len(), solved).transpose(),
                        -1.0,
                        Par::Seq,
                    );
                }
                let own = TILE * self.starts[s]..TILE * self.starts[s + 1];
                let open = &mut open[..TILE * columns.len()];
                divide(&of_l[own], open, height);
            }
        }
    }

    /// Columns of the tiles `tiles` of the lower triangle of `V Vᵀ`, stored by whole columns.
    fn outer(&self, inverse: &[f64], out: &mut [f64], tiles: Range<usize>, first: usize) {
        let half = self.starts[first];
        let last = self.starts.len() - 1;
        let row = |t: usize| &inverse[TILE * half * (t - first)..TILE * half * (t - first + 1)];
        let base = self.starts[tiles.start];
        let columns = self.starts[tiles.end] - base;
        let mut out = MatMut::from_column_major_slice_mut(out, half, columns);
        for s in tiles {
            for t in s..last {
                let range = self.starts[t] - half..half;
                matmul(
                    out.as_mut().submatrix_mut(
                        self.starts[t] - half,
                        self.starts[s] - base,
                        self.height(t),
                        self.height(s),
                    ),
                    Accum::Replace,
                    strip(row(t), self.height(t), range.clone()),
                    strip(row(s), self.height(s), range).transpose(),
                    1.0,
                    Par::Seq,
                );
            }
        }
    }
}
