//! Generalised minimal residuals (Saad & Schultz 1986), preconditioned from the right, with the
//! preconditioned vectors kept.
//!
//! ```text
//! x = Z y,   Z = P⁻¹ V,   A Z = V H,   y least in |b − V H y|
//! ```
//!
//! For systems that are not symmetric. The preconditioner may be of any precision, since the
//! residual is that of A itself.

use super::StopCriteria;
use super::dense::{add_scaled, add_scaled_and_dot, dot};

/// Outcome of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GmresInfo {
    /// Products with A, each with one application of the preconditioner.
    pub(crate) iterations: usize,
    /// Euclidean norm of b − A x.
    pub(crate) residual: f64,
}

/// Workspace of the iteration. When reused, it allocates only for longer vectors or more iterations
/// than before.
#[derive(Debug, Default)]
pub(crate) struct Gmres {
    /// Orthonormal basis V of the residuals.
    basis: Vec<Vec<f64>>,
    /// P⁻¹ V.
    preconditioned: Vec<Vec<f64>>,
    /// Columns of H after Givens rotations: the upper triangle of least squares.
    triangle: Vec<Vec<f64>>,
    /// Cosine and sine of each rotation.
    rotations: Vec<[f64; 2]>,
    /// Right-hand side of least squares.
    rhs: Vec<f64>,
}

impl Gmres {
    /// `x ≈ A⁻¹ b` from x = 0, the residual measured by its norm.
    ///
    /// # Arguments
    /// - `apply`: writes A times its first argument to the second.
    /// - `precondition`: the same for an approximation of the inverse of A.
    pub(crate) fn solve(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        stop: StopCriteria,
        mut apply: impl FnMut(&[f64], &mut [f64]),
        mut precondition: impl FnMut(&[f64], &mut [f64]),
    ) -> GmresInfo {
        x.fill(0.0);
        let norm = dot(b, b).sqrt();
        self.rhs.clear();
        self.rhs.push(norm);
        self.rotations.clear();
        if norm <= stop.residual || stop.iterations == 0 {
            return GmresInfo {
                iterations: 0,
                residual: norm,
            };
        }
        let first = self.vector(0, b.len());
        first.copy_from_slice(b);
        scale(first, norm.recip());
        let mut iterations = 0;
        while iterations < stop.iterations && self.rhs[iterations].abs() > stop.residual {
            self.vector(iterations + 1, b.len());
            let (known, new) = self.basis.split_at_mut(iterations + 1);
            let image = &mut new[0];
            precondition(&known[iterations], &mut self.preconditioned[iterations]);
            apply(&self.preconditioned[iterations], image);
            let column = &mut self.triangle[iterations];
            column.clear();
            let mut share = dot(&known[0], image);
            for pair in known.windows(2) {
                column.push(share);
                share = add_scaled_and_dot(image, &pair[0], -share, &pair[1]);
            }
            column.push(share);
            add_scaled(image, &known[iterations], -share);
            let norm = dot(image, image).sqrt();
            if norm > 0.0 {
                scale(image, norm.recip());
            }
            self.rotate(iterations, norm);
            iterations += 1;
        }
        // Back substitution, and the sum of the preconditioned vectors.
        for row in (0..iterations).rev() {
            let mut sum = self.rhs[row];
            for later in row + 1..iterations {
                sum -= self.triangle[later][row] * self.rhs[later];
            }
            let pivot = self.triangle[row][row];
            let share = if pivot == 0.0 { 0.0 } else { sum / pivot };
            self.rhs[row] = share;
            add_scaled(x, &self.preconditioned[row], share);
        }
        GmresInfo {
            iterations,
            residual: self.rhs[iterations].abs(),
        }
    }

    /// Applies the rotations so far to the newest column of H and adds the one that makes it
    /// triangular.
    fn rotate(&mut self, column: usize, below: f64) {
        let entries = &mut self.triangle[column];
        for (k, &[cosine, sine]) in self.rotations.iter().enumerate() {
            let (upper, lower) = (entries[k], entries[k + 1]);
            entries[k] = cosine * upper + sine * lower;
            entries[k + 1] = cosine * lower - sine * upper;
        }
        let length = entries[column].hypot(below);
        let rotation = if length > 0.0 {
            [entries[column] / length, below / length]
        } else {
            [1.0, 0.0]
        };
        entries[column] = length;
        self.rotations.push(rotation);
        let last = self.rhs[column];
        self.rhs[column] = rotation[0] * last;
        self.rhs.push(-rotation[1] * last);
    }

    /// Allocates a basis vector and its associated data.
    fn vector(&mut self, number: usize, length: usize) -> &mut [f64] {
        if self.basis.len() == number {
            self.basis.push(Vec::new());
            self.preconditioned.push(Vec::new());
            self.triangle.push(Vec::with_capacity(number + 2));
        }
        self.basis[number].resize(length, 0.0);
        self.preconditioned[number].resize(length, 0.0);
        &mut self.basis[number]
    }
}

/// `x ← s x`.
fn scale(x: &mut [f64], s: f64) {
    for value in x {
        *value *= s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix without symmetry, `[4 × 4]`.
    fn apply(x: &[f64], y: &mut [f64]) {
        for (row, value) in y.iter_mut().enumerate() {
            *value = (0..4)
                .map(|column| {
                    let own = if row == column { 5.0 } else { 0.0 };
                    (own + (3.0 * row as f64 - 2.0 * column as f64).sin()) * x[column]
                })
                .sum();
        }
    }

    #[test]
    fn four_unknowns_take_four_iterations_whatever_the_preconditioner() {
        let b = [1.0, -2.0, 0.5, 3.0];
        let diagonal = |r: &[f64], z: &mut [f64]| {
            for k in 0..4 {
                z[k] = r[k] / (4.0 + k as f64);
            }
        };
        let mut x = [0.0; 4];
        let info =
            Gmres::default().solve(&b, &mut x, StopCriteria::new(1e-12, 10), apply, diagonal);
        assert_eq!(info.iterations, 4);
        let mut image = [0.0; 4];
        apply(&x, &mut image);
        for k in 0..4 {
            assert!((image[k] - b[k]).abs() < 1e-12, "{image:?}");
        }
    }

    #[test]
    fn residual_that_is_reported_is_that_of_the_system() {
        let b = [1.0, -2.0, 0.5, 3.0];
        let copy = |r: &[f64], z: &mut [f64]| z.copy_from_slice(r);
        let (mut x, mut solver) = ([0.0; 4], Gmres::default());
        for most in 1..4 {
            let info = solver.solve(&b, &mut x, StopCriteria::new(0.0, most), apply, copy);
            let mut image = [0.0; 4];
            apply(&x, &mut image);
            let left: f64 = b.iter().zip(&image).map(|(b, y)| (b - y).powi(2)).sum();
            assert!((left.sqrt() - info.residual).abs() < 1e-12);
        }
    }

    #[test]
    fn nothing_is_done_where_nothing_is_wanted() {
        let never = |_: &[f64], _: &mut [f64]| panic!("not needed");
        let mut x = [1.0];
        let info = Gmres::default().solve(&[0.0], &mut x, StopCriteria::new(0.0, 5), never, never);
        assert_eq!((info.iterations, x), (0, [0.0]));
    }
}
