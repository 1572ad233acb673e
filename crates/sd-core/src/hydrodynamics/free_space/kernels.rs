//! The twenty numbers that make up the 6 × 6 mobility block of a pair.
//!
//! Every entry of the block is a derivative of one scalar field f of the separation, so by
//! rotational symmetry it is an angular harmonic of order m = 0..4 of the separation `z = x + iy`
//! (or of the wave vector) times a radial function. There are twelve radial functions: four with
//! m = 0, and eight which come with both `Re zᵐ` and `Im zᵐ`.
//!
//! ```text
//! lanes 0-7:  UU₂ EΩ₂ E₃E₂ EE₄ | UΩ₁ US₁' US₁ US₃   times Re zᵐ (subscript: m; US₁' is the third stresslet)
//! lanes 8-15: the same                              times Im zᵐ
//! lanes 16-19: UU₀ ΩΩ₀ E₃E₃₀ EE₀
//! ```
//! Lanes 4-7 and 12-15 are odd in the separation, all others even.

use crate::space::modes::{ModeBlock, Vec2};

pub(crate) const LANES: usize = 20;
pub(crate) const RADIAL: usize = 12;
/// The numbers of one pair.
pub(crate) type Lanes = [f64; LANES];

/// Finite-size coefficients `κ a²` of one sphere's modes; the torque's is 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FiniteSize {
    /// Force and velocity: a²/6.
    pub(crate) force: f64,
    /// Stresslet and strain: a²/10.
    pub(crate) stresslet: f64,
}

impl FiniteSize {
    pub(crate) fn new(radius: f64) -> Self {
        let square = radius * radius;
        Self {
            force: square / 6.0,
            stresslet: square / 10.0,
        }
    }

    /// The factor of ∇² for the velocity modes of `self` due to the force modes of `other`, by
    /// radial function.
    ///
    /// Lanes UΩ and EΩ belong to velocity or strain of `self` and torque of `other`, lanes US to
    /// velocity of `self` and stresslet of `other`.
    pub(crate) fn factors(&self, other: &Self) -> [f64; RADIAL] {
        let force_force = self.force + other.force;
        let force_stresslet = self.force + other.stresslet;
        let stresslet_stresslet = self.stresslet + other.stresslet;
        [
            force_force,
            self.stresslet,
            stresslet_stresslet,
            stresslet_stresslet,
            self.force,
            force_stresslet,
            force_stresslet,
            force_stresslet,
            force_force,
            0.0,
            stresslet_stresslet,
            stresslet_stresslet,
        ]
    }
}

/// `point + factor ∇²point`, lane by lane, factors by radial function.
#[inline(always)]
pub(crate) fn finite_size(point: &Lanes, laplacian: &Lanes, factors: &[f64; RADIAL]) -> Lanes {
    let mut lanes = *point;
    for k in 0..8 {
        lanes[k] += factors[k] * laplacian[k];
        lanes[k + 8] += factors[k] * laplacian[k + 8];
    }
    for k in 8..RADIAL {
        lanes[k + 8] += factors[k] * laplacian[k + 8];
    }
    lanes
}

/// `Re zᵐ` (lanes 0-7) and `Im zᵐ` (lanes 8-15) of each radial function's order m.
#[inline(always)]
pub(crate) fn harmonics(x: Vec2) -> ([f64; 8], [f64; 8]) {
    let (c1, s1) = (x.x, x.y);
    let (c2, s2) = (c1 * c1 - s1 * s1, 2.0 * c1 * s1);
    let (c3, s3) = (c2 * c1 - s2 * s1, c2 * s1 + s2 * c1);
    let (c4, s4) = (c2 * c2 - s2 * s2, 2.0 * c2 * s2);
    (
        [c2, c2, c2, c4, c1, c1, c1, c3],
        [s2, s2, s2, s4, s1, s1, s1, s3],
    )
}

/// Velocity modes of i from force modes of j, as four 3 × 3 blocks indexed `[row][column]`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Blocks {
    /// `(U_x, U_y, Ω)` from `(F_x, F_y, T)`.
    pub(crate) velocity_force: [[f64; 3]; 3],
    /// `(U_x, U_y, Ω)` from `(s1, s2, s3)`.
    pub(crate) velocity_stresslet: [[f64; 3]; 3],
    /// `(e1, e2, e3)` from `(F_x, F_y, T)`.
    pub(crate) strain_force: [[f64; 3]; 3],
    /// `(e1, e2, e3)` from `(s1, s2, s3)`.
    pub(crate) strain_stresslet: [[f64; 3]; 3],
}

/// The blocks of pair (i, j) at separation `x_i − x_j`, from its lanes and those of (j, i) at the
/// same separation.
///
/// The two differ only in the finite-size factors; for equal radii they are the same.
#[inline(always)]
#[rustfmt::skip]
pub(crate) fn blocks(ij: &Lanes, ji: &Lanes) -> Blocks {
    let [uu_c, _, e3e_c, ee_c, uo_c, us3_c, us1_c, usm_c,
         uu_s, _, e3e_s, ee_s, uo_s, us3_s, us1_s, usm_s, uu, oo, e3e3, ee] = *ij;
    let [_, eo_c, _, _, wo_c, ws3_c, ws1_c, wsm_c,
         _, eo_s, _, _, wo_s, ws3_s, ws1_s, wsm_s, ..] = *ji;
    Blocks {
        velocity_force: [
            [uu + uu_c, uu_s,       uo_s],
            [uu_s,      uu - uu_c, -uo_c],
            [-wo_s,     wo_c,       oo],
        ],
        velocity_stresslet: [
            [us1_c + usm_c,  us1_s + usm_s, us3_c],
            [usm_s - us1_s,  us1_c - usm_c, us3_s],
            [eo_s,           -eo_c,         0.0],
        ],
        strain_force: [
            [-ws1_c - wsm_c, ws1_s - wsm_s,  ij[9]],
            [-ws1_s - wsm_s, wsm_c - ws1_c, -ij[1]],
            [-ws3_c,         -ws3_s,         0.0],
        ],
        strain_stresslet: [
            [ee + ee_c, ee_s,      e3e_c],
            [ee_s,      ee - ee_c, e3e_s],
            [e3e_c,     e3e_s,     e3e3],
        ],
    }
}

impl Blocks {
    /// As one matrix in the order of [`crate::space::modes`].
    pub(crate) fn to_modes(self) -> ModeBlock {
        ModeBlock::from_fn(|row, column| match (row / 3, column / 3) {
            (0, 0) => self.velocity_force[row][column],
            (0, _) => self.velocity_stresslet[row][column - 3],
            (_, 0) => self.strain_force[row - 3][column],
            _ => self.strain_stresslet[row - 3][column - 3],
        })
    }
}
