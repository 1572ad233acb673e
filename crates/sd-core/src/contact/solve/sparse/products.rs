//! How all forces move all contacts, as one dense matrix: for problems whose states change a thousand times.

use crate::contact::row::Row;
use crate::contact::solve::problem::Problem;
use crate::hydrodynamics::resistance::PairwiseResistance;
use crate::linalg::cholesky::skyline::SkylineCholesky;
use crate::linalg::dense::Matrix;
use crate::linalg::staggered::StaggeredColumns;
use crate::model::Params;

/// `R = L Lᵀ`, columns `Y = L⁻¹ (Cᵀ, Dᵀ)`, and their products `Yᵀ Y`.
#[derive(Default)]
pub(super) struct ContactProducts {
    factor: SkylineCholesky,
    /// Whether the factor is that of the stage.
    is_factored: bool,
    /// Rows whose products are at hand: a stage has many problems of the same rows.
    rows: Vec<Row>,
    columns: StaggeredColumns,
    products: Matrix,
    /// Where each column begins and which contact or row it belongs to, in the order of the columns.
    order: Vec<(usize, usize)>,
}

/// Whether the matrices are not too large: they have 72 MB each at most.
pub(crate) fn has_products(network: &PairwiseResistance, problem: &Problem) -> bool {
    let count = problem.normal.len() + problem.tangential.len();
    count.max(3 * network.spheres()) <= 3 * Params::LARGE_ABOVE
}

impl ContactProducts {
    /// Begins a stage at new positions.
    pub(super) fn start(&mut self) {
        self.is_factored = false;
        self.rows.clear();
    }

    /// See [`System::fill_matrix`](crate::contact::solve::problem::System::fill_matrix).
    pub(super) fn fill(
        &mut self,
        network: &PairwiseResistance,
        problem: &Problem,
        matrix: &mut Matrix,
    ) -> bool {
        if !has_products(network, problem) {
            return false;
        }
        if !self.is_factored {
            network.fill_full(self.factor.full_matrix());
            if self.factor.factor().is_err() {
                return false;
            }
            self.is_factored = true;
        }
        let contacts = problem.normal.len();
        let normal = problem.normal.iter().map(|entry| entry.row);
        let rows = normal.chain(problem.tangential.iter().map(|entry| entry.row));
        if !self.rows.iter().copied().eq(rows.clone()) {
            self.rows.clear();
            self.rows.extend(rows);
            self.multiply(3 * network.spheres());
        }
        let count = self.rows.len();
        matrix.reset(count, count);
        for (column, &(_, b)) in self.order.iter().enumerate() {
            // Forces of friction hold back what normal forces push.
            let sign = if b < contacts { 1.0 } else { -1.0 };
            let (target, products) = (matrix.column_mut(b), self.products.column(column));
            for (product, &(_, a)) in products.iter().zip(&self.order) {
                // Friction does not move what reads the motion without it.
                if a < contacts || b < contacts || !problem.isolated {
                    target[a] = sign * product;
                }
            }
        }
        true
    }

    /// The products of the rows at hand; `size`: that of the factor.
    fn multiply(&mut self, size: usize) {
        self.order.clear();
        self.order
            .extend(self.rows.iter().enumerate().map(|(at, row)| {
                let [i, j] = row.spheres;
                (3 * i.min(j), at)
            }));
        self.order.sort_unstable();
        let starts = self.order.iter().map(|(start, _)| *start);
        self.columns.reset(size, starts);
        for (column, &(_, at)) in self.order.iter().enumerate() {
            let row = &self.rows[at];
            let starts = row.spheres.map(|sphere| 3 * sphere);
            row.add_at(1.0, starts, self.columns.column_mut(column));
        }
        self.columns.solve_lower(&self.factor);
        self.columns.gram(&mut self.products);
    }
}
