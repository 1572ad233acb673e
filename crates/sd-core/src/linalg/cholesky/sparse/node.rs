//! The supernodes of a factor.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use std::ops::Range;

/// A supernode of a factor: its rows, columns and values.
#[derive(Debug, Clone)]
pub(super) struct Node {
    /// First row and column.
    pub(super) start: usize,
    /// Number of columns: three for each sphere, whose columns have the same rows.
    pub(super) width: usize,
    /// Entries, column after column.
    pub(super) values: Range<usize>,
    /// Rows below the triangle, in the list of all.
    pub(super) below: Range<usize>,
}

impl Node {
    /// The supernode of each column.
    pub(super) fn owners(nodes: &[Self], size: usize) -> Vec<usize> {
        let mut owners = vec![0; size];
        for (k, node) in nodes.iter().enumerate() {
            owners[node.start..node.start + node.width].fill(k);
        }
        owners
    }

    /// Number of rows.
    pub(super) fn height(&self) -> usize {
        self.width + self.below.len()
    }

    /// The supernodes of a factor.
    pub(super) fn all(symbolic: &SymbolicSupernodalCholesky<usize>) -> Vec<Self> {
        let (begins, ends) = (symbolic.supernode_begin(), symbolic.supernode_end());
        let (values, rows) = (symbolic.col_ptr_for_val(), symbolic.col_ptr_for_row_idx());
        let nodes = 0..symbolic.n_supernodes();
        nodes
            .map(|k| Self {
                start: begins[k],
                width: ends[k] - begins[k],
                values: values[k]..values[k + 1],
                below: rows[k]..rows[k + 1],
            })
            .collect()
    }

    /// Stores their values part after part.
    pub(super) fn sort_values(nodes: &mut [Self], parts: &[Vec<usize>]) {
        let mut start = 0;
        for &k in parts.iter().flatten() {
            let count = nodes[k].values.len();
            nodes[k].values = start..start + count;
            start += count;
        }
    }

    /// The three columns of a sphere from column `j` on, starting at the row of the first.
    #[inline(always)]
    pub(super) fn columns<'f>(&self, factor: &'f [f32], j: usize) -> [&'f [f32]; 3] {
        let height = self.height();
        let values = &factor[self.values.clone()];
        [0, 1, 2].map(|k| &values[(j + k) * height..][j..height])
    }
}
