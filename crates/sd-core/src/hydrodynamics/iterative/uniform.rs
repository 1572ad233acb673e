//! Uniform translations of the layer: their resistance, and the constraint that the far field's
//! forces sum to zero.

use super::local::LocalResistance;
use super::near_solver::NearSolver;
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::linalg::dense::add_scaled;

/// Resistance of the pair terms to a translation, over isolated drag, below which it counts as
/// zero.
const LEAST: f64 = 1e-9;

/// The two translations V at one set of positions, under sparse hydrodynamics.
#[derive(Default)]
pub(super) struct Uniform<S: Fluid> {
    /// `P (0; V)`, two vectors `[6N]`.
    pushed: [Vec<f64>; 2],
    /// `R_n V`, two vectors `[3N]`.
    resisted: [Vec<f64>; 2],
    /// `R_P⁻¹ R_n V`, as `(0; ·)`, two vectors `[6N]`.
    answers: [Vec<f64>; 2],
    /// P times that, two vectors `[6N]`: `W (0; V)`.
    pushed_answers: [Vec<f64>; 2],
    /// Drag of all spheres, isolated, along one direction.
    drag: f64,
    /// Inverse of `Vᵀ R_n V` or of `Vᵀ W V`, zero where these are.
    inverse: [[f64; 2]; 2],
    /// A translation of all spheres, `(0; V)`, `[6N]`.
    velocities: Vec<f64>,
    work: Vec<f64>,
    /// Stresslets, a by-product that is not used.
    stresslets: Vec<S::Strain>,
}

impl<S: Fluid> Uniform<S> {
    /// Computes the resistance of the pair terms to translations; `drag` is that of the velocity
    /// rows, `[3N]`.
    pub(super) fn update(
        &mut self,
        near: &Resistance<S>,
        local: &LocalResistance<S>,
        drag: &[f64],
    ) {
        let moves = drag.len();
        let half = S::STRAINS * near.radii().len();
        for c in 0..2 {
            let velocity = &mut self.velocities;
            velocity.clear();
            velocity.resize(half + moves, 0.0);
            velocity[half..]
                .iter_mut()
                .skip(c)
                .step_by(S::MODES)
                .for_each(|v| *v = 1.0);
            let (force, strain) = (&mut self.resisted[c], S::Strain::default());
            near.apply(
                &velocity[half..],
                &strain,
                &mut self.work,
                force,
                &mut self.stresslets,
            );
            let pushed = &mut self.pushed[c];
            pushed.resize(half + moves, 0.0);
            local.apply(velocity, pushed);
            add_scaled(force, &pushed[half..], -1.0);
        }
        let [a, b] = &self.resisted;
        self.drag = drag.iter().step_by(S::MODES).sum();
        self.invert([a, b].map(|force| translations::<S>(force)));
    }

    /// Solves for the motion driven by the resistance to translations: `Vᵀ W V`.
    pub(super) fn solve(
        &mut self,
        near: &Resistance<S>,
        local: &LocalResistance<S>,
        solver: &mut NearSolver<S>,
    ) -> Result<(), Error> {
        for c in 0..2 {
            let (answer, half) = (&mut self.answers[c], S::STRAINS * near.radii().len());
            answer.clear();
            answer.resize(half, 0.0);
            answer.extend_from_slice(&self.resisted[c]);
            solver.solve(near, &mut answer[half..])?;
            self.pushed_answers[c].resize(answer.len(), 0.0);
            local.apply(answer, &mut self.pushed_answers[c]);
        }
        let [a, b] = &self.pushed_answers;
        self.invert(
            [a, b].map(|force| translations::<S>(&force[S::STRAINS * near.radii().len()..])),
        );
        Ok(())
    }

    /// Inverts the products of V with two vectors, symmetric up to rounding; the total drag is the
    /// scale.
    fn invert(&mut self, m: [[f64; 2]; 2]) {
        let least = LEAST * self.drag;
        let off = 0.5 * (m[0][1] + m[1][0]);
        let determinant = m[0][0] * m[1][1] - off * off;
        self.inverse = if determinant > least * least {
            [
                [m[1][1] / determinant, -off / determinant],
                [-off / determinant, m[0][0] / determinant],
            ]
        } else {
            [[0.0; 2]; 2]
        };
    }

    /// The translation of the layer, against the fluid, that adds to a net force on it the opposite
    /// one.
    pub(super) fn against(&self, net: [f64; 2]) -> [f64; 2] {
        self.inverse.map(|row| row[0] * net[0] + row[1] * net[1])
    }

    /// `R_P⁻¹ R_n V c` in velocity row k of `[3N]`.
    pub(super) fn answer(&self, c: [f64; 2], k: usize) -> f64 {
        if S::DRIFTS == 0 {
            return 0.0;
        }
        let half = self.answers[0].len() - self.resisted[0].len();
        self.answers[0][half + k] * c[0] + self.answers[1][half + k] * c[1]
    }

    /// `P (0; V c)` in row k of `[6N]`.
    pub(super) fn pushed(&self, c: [f64; 2], k: usize) -> f64 {
        if S::DRIFTS == 0 {
            return 0.0;
        }
        self.pushed[0][k] * c[0] + self.pushed[1][k] * c[1]
    }

    /// `P (0; R_P⁻¹ R_n V c)` in row k of `[6N]`.
    pub(super) fn pushed_answer(&self, c: [f64; 2], k: usize) -> f64 {
        if S::DRIFTS == 0 {
            return 0.0;
        }
        self.pushed_answers[0][k] * c[0] + self.pushed_answers[1][k] * c[1]
    }
}

/// Sum of forces `[3N]`.
pub(super) fn translations<S: Fluid>(forces: &[f64]) -> [f64; 2] {
    [0, 1].map(|c| forces.iter().skip(c).step_by(S::MODES).sum())
}

/// `V c` in row k.
pub(super) fn translation<S: Fluid>(c: [f64; 2], k: usize) -> f64 {
    match k % S::MODES {
        row if row < S::DRIFTS => c[row],
        _ => 0.0,
    }
}
