//! `A^(−1/2) x` of a symmetric positive definite operator, by Lanczos' method (1950).
//!
//! ```text
//! A V ≈ V T,   V orthonormal, T tridiagonal:   A^(−1/2) x ≈ |x| V T^(−1/2) e_1
//! ```
//! The error falls by a factor per product that depends on the root of the condition number (Chow &
//! Saad, SIAM J. Sci. Comput. 36, A588, 2014).

use super::dense::{Matrix, add_scaled, dot};
use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::{Par, Spec};

/// Most products.
const MAX_PRODUCTS: usize = 120;
/// Products between two estimates of the error.
const INTERVAL: usize = 4;
/// A part of a product beyond the span of the vectors before, over the product, that is rounding.
const ROUNDING: f64 = 1e-12;

/// How a root was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outcome {
    /// Products with A.
    pub(crate) products: u32,
    /// Relative change in the last four products.
    pub(crate) change: f64,
}

/// Workspace of the method.
pub(crate) struct InverseRoot {
    /// V, one vector after another.
    basis: Vec<Vec<f64>>,
    /// T: its diagonal, and what is beside it.
    diagonal: Vec<f64>,
    beside: Vec<f64>,
    matrix: Matrix,
    vectors: Matrix,
    values: Vec<f64>,
    scratch: MemBuffer,
    /// `T^(−1/2) e_1`, and that of the estimate before.
    root: Vec<f64>,
    before: Vec<f64>,
}

impl Default for InverseRoot {
    fn default() -> Self {
        let scratch = self_adjoint_evd_scratch::<f64>(
            MAX_PRODUCTS,
            ComputeEigenvectors::Yes,
            Par::Seq,
            Spec::default(),
        );
        Self {
            basis: Vec::new(),
            diagonal: Vec::with_capacity(MAX_PRODUCTS),
            beside: Vec::with_capacity(MAX_PRODUCTS),
            matrix: Matrix::default(),
            vectors: Matrix::default(),
            values: Vec::with_capacity(MAX_PRODUCTS),
            scratch: MemBuffer::new(scratch),
            root: Vec::with_capacity(MAX_PRODUCTS),
            before: Vec::with_capacity(MAX_PRODUCTS),
        }
    }
}

impl InverseRoot {
    /// `x ← A^(−1/2) x`, until four more products change it by less than `tolerance` of its length;
    /// `product` sets its second argument to A times the first.
    pub(crate) fn apply(
        &mut self,
        x: &mut [f64],
        tolerance: f64,
        mut product: impl FnMut(&[f64], &mut [f64]),
    ) -> Outcome {
        self.diagonal.clear();
        self.beside.clear();
        self.before.clear();
        let mut outcome = Outcome {
            products: 0,
            change: 0.0,
        };
        let length = dot(x, x).sqrt();
        if length == 0.0 {
            return outcome;
        }
        let first = self.vector(0, x.len());
        for (v, x) in first.iter_mut().zip(&*x) {
            *v = x / length;
        }
        for k in 0..MAX_PRODUCTS {
            self.vector(k + 1, x.len());
            let (known, rest) = self.basis.split_at_mut(k + 1);
            let (last, next) = (&known[k], &mut rest[0]);
            product(last, next);
            outcome.products += 1;
            let size = dot(next, next).sqrt();
            self.diagonal.push(dot(last, next));
            // Against all of them, as rounding makes later vectors lean on the first.
            for _ in 0..2 {
                for v in &*known {
                    let part = dot(v, next);
                    add_scaled(next, v, -part);
                }
            }
            let beyond = dot(next, next).sqrt();
            let ends = beyond <= ROUNDING * size || k + 1 == MAX_PRODUCTS;
            if ends || (k + 1) % INTERVAL == 0 {
                outcome.change = self.estimate();
                if ends || outcome.change < tolerance {
                    break;
                }
            }
            self.beside.push(beyond);
            for next in &mut self.basis[k + 1] {
                *next /= beyond;
            }
        }
        x.fill(0.0);
        for (v, share) in self.basis.iter().zip(&self.root) {
            add_scaled(x, v, length * share);
        }
        outcome
    }

    /// The vector of a number in V.
    fn vector(&mut self, number: usize, length: usize) -> &mut [f64] {
        if self.basis.len() == number {
            self.basis.push(Vec::new());
        }
        let vector = &mut self.basis[number];
        vector.resize(length, 0.0);
        vector
    }

    /// Sets `T^(−1/2) e_1`, and returns by how much of its length it has changed.
    fn estimate(&mut self) -> f64 {
        let size = self.diagonal.len();
        self.matrix.reset(size, size);
        for (k, &diagonal) in self.diagonal.iter().enumerate() {
            self.matrix[(k, k)] = diagonal;
        }
        for (k, &beside) in self.beside.iter().enumerate() {
            (self.matrix[(k + 1, k)], self.matrix[(k, k + 1)]) = (beside, beside);
        }
        self.vectors.reset(size, size);
        self.values.clear();
        self.values.resize(size, 0.0);
        let found = self_adjoint_evd(
            self.matrix.view_mut().as_ref(),
            DiagMut::from_slice_mut(&mut self.values),
            Some(self.vectors.view_mut()),
            Par::Seq,
            MemStack::new(&mut self.scratch),
            Spec::default(),
        );
        std::mem::swap(&mut self.root, &mut self.before);
        self.root.clear();
        self.root.resize(size, 0.0);
        if found.is_err() {
            return f64::INFINITY;
        }
        for (column, &value) in self.values.iter().enumerate() {
            let vector = self.vectors.column(column);
            if value > 0.0 {
                add_scaled(&mut self.root, vector, vector[0] / value.sqrt());
            }
        }
        self.before.resize(size, 0.0);
        let pairs = self.root.iter().zip(&self.before);
        let square: f64 = pairs.map(|(now, before)| (now - before).powi(2)).sum();
        (square / dot(&self.root, &self.root)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::cholesky::dense::DenseCholesky;

    #[test]
    fn root_twice_is_the_inverse() {
        let n = 80;
        let mut matrix = Matrix::zeros(n, n);
        for j in 0..n {
            for i in 0..n {
                let apart = (i as f64 - j as f64).abs();
                matrix[(i, j)] = 1.0 / (1.0 + apart) + f64::from(u8::from(i == j));
            }
        }
        let b: Vec<f64> = (0..n).map(|i| (1.3 * i as f64).sin()).collect();
        let mut found = b.clone();
        let mut root = InverseRoot::default();
        for _ in 0..2 {
            let outcome = root.apply(&mut found, 1e-12, |x, y| {
                y.fill(0.0);
                matrix.add_product(x, y);
            });
            assert!(outcome.products < 60, "{outcome:?}");
        }
        let mut cholesky = DenseCholesky::new(n);
        cholesky.matrix_mut().clone_from(&matrix);
        cholesky.factor().unwrap();
        let mut expected = b;
        cholesky.solve(&mut expected);
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-10, "{found} {expected}");
        }
    }
}
