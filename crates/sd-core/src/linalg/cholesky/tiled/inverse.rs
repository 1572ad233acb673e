//! The trailing block of an inverse, from the factor.

use super::{Shape, TILE, TiledCholesky, divide, strip, strip_mut};
use crate::linalg::dense::Matrix;
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
        shape.invert(lower, &mut self.inverse, first);
        shape.outer(&self.inverse, out.values_mut(), first);
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
    /// Rows of `V = L₂₂⁻ᵀ`, whose tiles begin with `first`, each a strip of all columns of the
    /// half: `V_t L₂₂ᵀ = e_t`, column after column.
    fn invert(&self, lower: &[f64], inverse: &mut [f64], first: usize) {
        let half = self.starts[first];
        let strips = inverse.chunks_exact_mut((TILE * half).max(1));
        for (t, row) in (first..).zip(strips) {
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

    /// The lower triangle of `V Vᵀ`, tile by tile.
    fn outer(&self, inverse: &[f64], out: &mut [f64], first: usize) {
        let half = self.starts[first];
        let last = self.starts.len() - 1;
        let row = |t: usize| &inverse[TILE * half * (t - first)..TILE * half * (t - first + 1)];
        let mut out = MatMut::from_column_major_slice_mut(out, half, half);
        for s in first..last {
            for t in s..last {
                let range = self.starts[t] - half..half;
                matmul(
                    out.as_mut().submatrix_mut(
                        self.starts[t] - half,
                        self.starts[s] - half,
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
