//! Many spheres: `R_FU` pair by pair, its solves by preconditioned conjugate gradients, and the far field iterated on top.
//!
//! ```text
//! x = (v; −E),   q = M⁻¹ x the force modes of the far field,   q_F + R_n v − R_n,FE E = F,   R_n the pair terms
//! P = drag of isolated spheres,   R_P = P_FU + R_n (Ball-Melrose),   q₀ = P x₀,   R_P v₀ = F + (R_n + P)_FE E
//! q = q₀ + W y,   y + (M − P⁻¹)(q₀ + W y) = 0,   W = P − P (0; R_P⁻¹ (P ·)_F)
//! ```
//! as in [`crate::hydrodynamics::iterative`]: conjugate gradients for `W y` with W as preconditioner, whose operator takes `W u` to
//! `M W u + (0; R_P⁻¹ (P u)_F)`.
//! In three dimensions M without k = 0 is positive definite, and no translation has to be taken apart. The relative residual is
//! `√(rᵀ W r)/√(qᵀ P⁻¹ q)`, r = x − M q.

use super::{NearPart, Strain, isolated};
use crate::error::Error;
use crate::hydrodynamics::far_field::bulk::MobilityOperator;
use crate::hydrodynamics::two_sphere::{MODES, Modes, Motion};
use crate::linalg::Until;
use crate::linalg::cholesky::sparse::{Block, BlockCholesky, BlockPattern};
use crate::linalg::conjugate_gradients::{ConjugateGradients, largest};
use crate::space::Bulk;
use crate::space::cell::Cell;
use nalgebra::Vector3;

/// s' below which the coupling of a pair is in the preconditioner's factor. With the layer's 2.2
/// the factor fills in: a Ball-Melrose instant of 1000 spheres at φ = 0.45 takes 0.09 s in place of
/// 0.035 s.
const FACTORED: f64 = 2.05;
/// Largest residual force at which the solves with `R_P` stop, over the largest force met at these
/// positions: what later solves, of ever smaller forces, leave out counts as little.
const LEFT: f64 = 1e-10;
const MOST_SOLVER_ITERATIONS: u32 = 500;
/// Relative residual of the far field, that of the layer.
const RESIDUAL: f64 = 1e-6;
/// Tolerance of M over that residual: it leaves 7e-7 of the viscosity of 1000 spheres at φ = 0.45,
/// where 0.1 leaves 1.5e-6.
const OPERATOR_TOLERANCE: f64 = 0.05;
/// Iterations of the far field after which it counts as not converging.
const MOST_ITERATIONS: u32 = 300;

/// The resistance of many spheres at one set of positions.
pub(crate) struct SparseResistance {
    near: NearPart,
    /// M of Stokesian Dynamics.
    far: Option<MobilityOperator>,
    /// Drag of each sphere alone.
    drag: Vec<[f64; 3]>,
    solver: Solver,
}

/// Solves with `R_P`.
#[derive(Default)]
struct Solver {
    factor: BlockCholesky,
    gradients: ConjugateGradients,
    forces: Vec<f64>,
    /// Largest force met at these positions.
    scale: f64,
    /// Of each sphere, its force from its own velocity, by columns.
    own: Vec<[Motion; 6]>,
}

/// Motion of all spheres.
pub(crate) struct SolvedMotion {
    /// Disturbances `[6N]`.
    pub(crate) velocities: Vec<f64>,
    /// `R (v, −E)`: forces and torques `[6N]`.
    pub(crate) forces: Vec<f64>,
    /// S of each sphere.
    pub(crate) stresslets: Vec<Strain>,
}

impl SparseResistance {
    /// Workspace for spheres in cells of the given sides; with the far field on top if `is_full`, in a periodic cell.
    ///
    /// # Errors
    /// Those of [`MobilityOperator::new`].
    pub(crate) fn new(near: NearPart, cell: &Cell<Bulk>, is_full: bool) -> Result<Self, Error> {
        let far = if is_full {
            let tolerance = OPERATOR_TOLERANCE * RESIDUAL;
            Some(MobilityOperator::new(cell, near.radii(), tolerance)?)
        } else {
            None
        };
        let drag = near.radii().iter().map(|&a| isolated(a)).collect();
        Ok(Self {
            near,
            far,
            drag,
            solver: Solver::default(),
        })
    }

    /// Takes new positions and solves for the motion under external forces and torques `[6N]` in the background strain.
    ///
    /// # Errors
    /// [`Error::Overlap`], [`Error::NotPositiveDefinite`], [`Error::NotConverged`], [`Error::OutOfMemory`].
    pub(crate) fn solve(
        &mut self,
        cell: &Cell<Bulk>,
        centres: &[Vector3<f64>],
        external: &[f64],
        strain: &Strain,
    ) -> Result<SolvedMotion, Error> {
        let Self {
            near,
            far,
            drag,
            solver,
        } = self;
        near.update(cell, centres)?;
        let pattern = solver.factor(near, drag)?;
        let n = drag.len();
        let mut still = [0.0; MODES];
        for k in 0..5 {
            still[6 + k] = -strain[k];
        }
        let mut x = vec![still; n];
        // v₀: isolated drag drives nothing.
        let mut driving = vec![[0.0; MODES]; n];
        near.add(&x, &mut driving);
        let mut velocities: Vec<f64> = external.to_vec();
        for (v, force) in velocities.chunks_exact_mut(6).zip(&driving) {
            for k in 0..6 {
                v[k] -= force[k];
            }
        }
        solver.solve(near, &pattern, &mut velocities)?;
        put(&velocities, &mut x);
        let mut q: Vec<Modes> = pushed(drag, &x);
        if let Some(operator) = far {
            operator.update(cell, centres)?;
            let mut image = vec![[0.0; MODES]; n];
            operator.apply(&q, &mut image);
            let mut residual = x.clone();
            add_scaled(&mut residual, &image, -1.0);
            let (mut step, mut step_lag) = (vec![[0.0; MODES]; n], vec![0.0; 6 * n]);
            let mut before = f64::INFINITY;
            let mut iterations = 0;
            loop {
                let (preconditioned, lag) = precondition(solver, near, drag, &pattern, &residual)?;
                let square = dot(&residual, &preconditioned);
                let whole: f64 = weighted_square(&q, drag);
                let reached = if square > 0.0 {
                    (square / whole).sqrt()
                } else {
                    0.0
                };
                if reached <= RESIDUAL {
                    break;
                }
                if iterations == MOST_ITERATIONS || !reached.is_finite() {
                    return Err(Error::NotConverged {
                        quantity: "the far field",
                        iterations,
                        residual: reached,
                        wanted: RESIDUAL,
                    });
                }
                let share = square / before;
                before = square;
                turn(&mut step, &preconditioned, share);
                for (last, next) in step_lag.iter_mut().zip(&lag) {
                    *last = next + share * *last;
                }
                operator.apply(&step, &mut image);
                for (image, lag) in image.iter_mut().zip(step_lag.chunks_exact(6)) {
                    for k in 0..6 {
                        image[k] += lag[k];
                    }
                }
                let length = square / dot(&step, &image);
                add_scaled(&mut q, &step, length);
                add_scaled(&mut residual, &image, -length);
                for (v, lag) in velocities.iter_mut().zip(&step_lag) {
                    *v -= length * lag;
                }
                iterations += 1;
            }
            put(&velocities, &mut x);
        }
        near.add(&x, &mut q);
        Ok(SolvedMotion {
            velocities,
            forces: q.iter().flat_map(|q| q[..6].to_vec()).collect(),
            stresslets: q
                .iter()
                .map(|q| -Strain::from_column_slice(&q[6..]))
                .collect(),
        })
    }
}

/// `W r`, and the lag `R_P⁻¹ (P r)_F` that belongs to it.
fn precondition(
    solver: &mut Solver,
    near: &NearPart,
    drag: &[[f64; 3]],
    pattern: &BlockPattern,
    residual: &[Modes],
) -> Result<(Vec<Modes>, Vec<f64>), Error> {
    let mut pushed_residual = pushed(drag, residual);
    let mut lag: Vec<f64> = pushed_residual
        .iter()
        .flat_map(|x| x[..6].to_vec())
        .collect();
    solver.solve(near, pattern, &mut lag)?;
    for ((x, lag), drag) in pushed_residual
        .iter_mut()
        .zip(lag.chunks_exact(6))
        .zip(drag)
    {
        for k in 0..6 {
            x[k] -= drag[k / 3] * lag[k];
        }
    }
    Ok((pushed_residual, lag))
}

impl Solver {
    /// Factors the preconditioner at new positions: all diagonal blocks, and the couplings of pairs that are nearly in contact. Each
    /// sphere has two block rows, for its velocity and its angular velocity.
    fn factor(&mut self, near: &NearPart, drag: &[[f64; 3]]) -> Result<BlockPattern, Error> {
        let n = drag.len();
        let radii = near.radii();
        let mut couplings: Vec<(usize, usize)> = (0..n).map(|i| (2 * i, 2 * i + 1)).collect();
        let is_near =
            |i: usize, j: usize, distance: f64| distance < 0.5 * FACTORED * (radii[i] + radii[j]);
        for pair in near.pairs() {
            if is_near(pair.i, pair.j, pair.distance) {
                for (p, q) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    couplings.push((2 * pair.i + p, 2 * pair.j + q));
                }
            }
        }
        let pattern = BlockPattern::new(2 * n, &couplings).ok_or(Error::OutOfMemory {
            purpose: "the factor of near pairs",
        })?;
        let Self {
            factor, scale, own, ..
        } = self;
        *scale = 0.0;
        own.clear();
        own.extend(drag.iter().map(|drag| {
            let mut block = [[0.0; 6]; 6];
            for (k, column) in block.iter_mut().enumerate() {
                column[k] = drag[k / 3];
            }
            block
        }));
        factor.reset(&pattern);
        let mut coupling = n;
        for (pair, blocks) in near.pairs().iter().zip(near.blocks()) {
            for (sphere, block) in [(pair.i, &blocks[0]), (pair.j, &blocks[2])] {
                let matrix = block.force_matrix(&pair.normal);
                for (own, new) in own[sphere]
                    .as_flattened_mut()
                    .iter_mut()
                    .zip(matrix.as_flattened())
                {
                    *own += new;
                }
            }
            if is_near(pair.i, pair.j, pair.distance) {
                // Rows of j, columns of i.
                let matrix = blocks[1].force_matrix(&pair.normal);
                for (p, q) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    factor.add_coupling(&pattern, coupling, &part(&matrix, q, p));
                    coupling += 1;
                }
            }
        }
        for (i, own) in own.iter().enumerate() {
            factor.add_own(&pattern, 2 * i, &part(own, 0, 0));
            factor.add_own(&pattern, 2 * i + 1, &part(own, 1, 1));
            // Rows of the angular velocity, columns of the velocity.
            factor.add_coupling(&pattern, i, &part(own, 1, 0));
        }
        factor
            .factor(&pattern)
            .map_err(|bad| Error::NotPositiveDefinite {
                matrix: "near part of the resistance",
                pivot: bad.pivot,
                sphere: bad.pivot / 6,
            })?;
        Ok(pattern)
    }

    /// `x ← R_P⁻¹ x`, `[6N]`.
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    fn solve(
        &mut self,
        near: &NearPart,
        pattern: &BlockPattern,
        x: &mut [f64],
    ) -> Result<(), Error> {
        let Self {
            factor,
            gradients,
            forces,
            scale,
            own,
        } = self;
        forces.clear();
        forces.extend_from_slice(x);
        *scale = scale.max(largest(forces));
        gradients.solve(
            forces,
            x,
            Until::new(LEFT * *scale, MOST_SOLVER_ITERATIONS as usize),
            |v, y| {
                let (v, y) = (v.as_chunks().0, y.as_chunks_mut().0);
                for ((y, v), own) in y.iter_mut().zip(v).zip(&*own) {
                    *y = times(own, v);
                }
                near.add_forces_from_others(v, y);
            },
            |r, z| factor.solve(pattern, r, z),
        );
        if gradients.residual() <= LEFT * *scale {
            return Ok(());
        }
        Err(Error::NotConverged {
            quantity: "the motion under near-field hydrodynamics",
            iterations: MOST_SOLVER_ITERATIONS,
            residual: gradients.residual() / *scale,
            wanted: LEFT,
        })
    }
}

/// A block of translations (0) or rotations (1), by columns.
fn part(matrix: &[Motion; 6], row: usize, column: usize) -> Block {
    std::array::from_fn(|k| matrix[3 * column + k / 3][3 * row + k % 3])
}

/// A matrix, by columns, times a vector.
#[inline(always)]
fn times(columns: &[Motion; 6], x: &Motion) -> Motion {
    let mut y = [0.0; 6];
    for (column, x) in columns.iter().zip(x) {
        for (y, entry) in y.iter_mut().zip(column) {
            *y += entry * x;
        }
    }
    y
}

/// P x.
fn pushed(drag: &[[f64; 3]], x: &[Modes]) -> Vec<Modes> {
    x.iter()
        .zip(drag)
        .map(|(x, drag)| std::array::from_fn(|k| drag[(k / 3).min(2)] * x[k]))
        .collect()
}

/// Sets the velocities of all spheres.
fn put(velocities: &[f64], x: &mut [Modes]) {
    for (x, v) in x.iter_mut().zip(velocities.chunks_exact(6)) {
        x[..6].copy_from_slice(v);
    }
}

fn dot(a: &[Modes], b: &[Modes]) -> f64 {
    crate::linalg::dense::dot(a.as_flattened(), b.as_flattened())
}

fn add_scaled(x: &mut [Modes], y: &[Modes], factor: f64) {
    crate::linalg::dense::add_scaled(x.as_flattened_mut(), y.as_flattened(), factor);
}

/// `last ← next + share last`.
fn turn(last: &mut [Modes], next: &[Modes], share: f64) {
    for (last, next) in last.as_flattened_mut().iter_mut().zip(next.as_flattened()) {
        *last = next + share * *last;
    }
}

/// `qᵀ P⁻¹ q`.
fn weighted_square(q: &[Modes], drag: &[[f64; 3]]) -> f64 {
    q.iter()
        .zip(drag)
        .map(|(q, drag)| {
            (0..MODES)
                .map(|k| q[k] * q[k] / drag[(k / 3).min(2)])
                .sum::<f64>()
        })
        .sum()
}
