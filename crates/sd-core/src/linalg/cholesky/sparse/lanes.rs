//! Solves with eight right-hand sides at once, which read the factor once for all of them.

use super::{BlockCholesky, BlockPattern, Node};
use crate::linalg::simd::vectorised;

/// Right-hand sides at once.
pub(crate) const LANES: usize = 8;
/// One entry of each.
pub(crate) type Lanes = [f32; LANES];

/// Room for a solve.
#[derive(Default)]
pub(super) struct Workspace {
    /// Right-hand sides in the order of elimination.
    ordered: Vec<Lanes>,
    /// Their rows of the supernode at work.
    local: Vec<Lanes>,
}

impl BlockCholesky {
    /// `x ≈ A⁻¹ x` by the factor, for eight vectors `[3N]` in the order of the spheres. Few entries should differ from zero: supernodes
    /// that none of them reaches cost half.
    pub(crate) fn solve_lanes(&mut self, pattern: &BlockPattern, x: &mut [Lanes]) {
        let Workspace { ordered, local } = &mut self.lanes;
        ordered.resize(x.len(), [0.0; LANES]);
        for (x, &row) in x.chunks_exact(3).zip(&pattern.rows) {
            ordered[3 * row..3 * row + 3].copy_from_slice(x);
        }
        let factor = &self.factor;
        vectorised(
            #[inline(always)]
            || {
                solve_lower(pattern, factor, ordered, local);
                solve_upper(pattern, factor, ordered, local);
            },
        );
        for (x, &row) in x.chunks_exact_mut(3).zip(&pattern.rows) {
            x.copy_from_slice(&ordered[3 * row..3 * row + 3]);
        }
    }
}

/// `target ← target − weight x`, for callers that are vectorised themselves, as the rest.
#[inline(always)]
fn subtract(target: &mut Lanes, weight: f32, x: &Lanes) {
    for (target, x) in target.iter_mut().zip(x) {
        *target -= weight * x;
    }
}

/// `x ← x / by`.
#[inline(always)]
fn divide(x: &mut Lanes, by: f32) {
    for x in x {
        *x /= by;
    }
}

/// The rows of a supernode below its triangle.
#[inline(always)]
fn below<'p>(pattern: &'p BlockPattern, node: &Node) -> &'p [usize] {
    &pattern.symbolic.row_idx()[node.below.clone()]
}

/// `x ← L⁻¹ x`.
#[inline(always)]
fn solve_lower(pattern: &BlockPattern, factor: &[f32], x: &mut [Lanes], local: &mut Vec<Lanes>) {
    for node in &pattern.nodes {
        let own = node.start..node.start + node.width;
        if x[own.clone()].iter().flatten().all(|&x| x == 0.0) {
            continue;
        }
        let below = below(pattern, node);
        local.clear();
        local.extend_from_slice(&x[own.clone()]);
        local.resize(node.width + below.len(), [0.0; LANES]);
        for j in (0..node.width).step_by(3) {
            let [a, b, c] = node.columns(factor, j);
            let (top, rest) = local[j..].split_at_mut(3);
            let [mut first, mut second, mut third] = [top[0], top[1], top[2]];
            divide(&mut first, a[0]);
            subtract(&mut second, a[1], &first);
            divide(&mut second, b[1]);
            subtract(&mut third, a[2], &first);
            subtract(&mut third, b[2], &second);
            divide(&mut third, c[2]);
            top.copy_from_slice(&[first, second, third]);
            let [a, b, c] = [a, b, c].map(|column| &column[3..][..rest.len()]);
            for (k, x) in rest.iter_mut().enumerate() {
                subtract(x, a[k], &first);
                subtract(x, b[k], &second);
                subtract(x, c[k], &third);
            }
        }
        x[own].copy_from_slice(&local[..node.width]);
        for (&row, sum) in below.iter().zip(&local[node.width..]) {
            for (x, sum) in x[row].iter_mut().zip(sum) {
                *x += sum;
            }
        }
    }
}

/// `x ← L⁻ᵀ x`.
#[inline(always)]
fn solve_upper(pattern: &BlockPattern, factor: &[f32], x: &mut [Lanes], local: &mut Vec<Lanes>) {
    for node in pattern.nodes.iter().rev() {
        let own = node.start..node.start + node.width;
        local.clear();
        local.extend_from_slice(&x[own.clone()]);
        local.extend(below(pattern, node).iter().map(|&row| x[row]));
        for j in (0..node.width).step_by(3).rev() {
            let [a, b, c] = node.columns(factor, j);
            let (top, rest) = local[j..].split_at_mut(3);
            let [mut first, mut second, mut third] = [top[0], top[1], top[2]];
            {
                let [a, b, c] = [a, b, c].map(|column| &column[3..][..rest.len()]);
                for (k, x) in rest.iter().enumerate() {
                    subtract(&mut first, a[k], x);
                    subtract(&mut second, b[k], x);
                    subtract(&mut third, c[k], x);
                }
            }
            divide(&mut third, c[2]);
            subtract(&mut second, b[2], &third);
            divide(&mut second, b[1]);
            subtract(&mut first, a[1], &second);
            subtract(&mut first, a[2], &third);
            divide(&mut first, a[0]);
            top.copy_from_slice(&[first, second, third]);
        }
        x[own].copy_from_slice(&local[..node.width]);
    }
}
