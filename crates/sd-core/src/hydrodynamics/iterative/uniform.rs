//! Translations of the layer as a whole: what resists them, and what keeps the far field's forces adding up to zero.

use super::ball_melrose::BallMelroseSolver;
use crate::hydrodynamics::resistance::Resistance;
use nalgebra::Vector3;

/// Resistance of the pair terms to a translation, over isolated drag, below which it counts as none.
const LEAST: f64 = 1e-9;

/// The two translations V at one set of positions, under Ball-Melrose hydrodynamics.
#[derive(Default)]
pub(super) struct Uniform {
    /// `R_n V`, two vectors `[3N]`.
    resisted: [Vec<f64>; 2],
    /// `R_BM⁻¹ R_n V`, two vectors `[3N]`; `W V` over drag.
    answers: [Vec<f64>; 2],
    /// Inverse of `Vᵀ R_n V` or of `Vᵀ W V`, zero where these are.
    inverse: [[f64; 2]; 2],
    /// A translation of all spheres, `[3N]`.
    velocities: Vec<f64>,
    work: Vec<f64>,
    /// Stresslets that come with the forces and are not used.
    stresslets: Vec<Vector3<f64>>,
}

impl Uniform {
    /// Computes how the pair terms resist translations; `drag` is that of the velocity rows, `[3N]`.
    pub(super) fn update(&mut self, near: &Resistance, drag: &[f64]) {
        for c in 0..2 {
            let velocity = &mut self.velocities;
            velocity.clear();
            velocity.resize(drag.len(), 0.0);
            velocity
                .iter_mut()
                .skip(c)
                .step_by(3)
                .for_each(|v| *v = 1.0);
            let (force, strain) = (&mut self.resisted[c], Vector3::zeros());
            near.apply(
                velocity,
                &strain,
                &mut self.work,
                force,
                &mut self.stresslets,
            );
            for ((force, v), drag) in force.iter_mut().zip(&*velocity).zip(drag) {
                *force -= drag * v;
            }
        }
        self.invert(drag, |own, _| own.map(translations));
    }

    /// Solves for the motion that the translations' resistance drives: `Vᵀ W V`.
    pub(super) fn solve(
        &mut self,
        near: &Resistance,
        solver: &mut BallMelroseSolver,
        drag: &[f64],
    ) {
        for (answer, force) in self.answers.iter_mut().zip(&self.resisted) {
            answer.clear();
            answer.extend_from_slice(force);
            solver.solve(near, answer);
        }
        self.invert(drag, |_, answers| {
            answers.map(|answer| {
                let mut sums = [0.0; 2];
                for (k, (answer, drag)) in answer.iter().zip(drag).enumerate() {
                    if k % 3 < 2 {
                        sums[k % 3] += drag * answer;
                    }
                }
                sums
            })
        });
    }

    /// Inverts what a product with V is of the resisted and of the answers; whole drag is the scale.
    fn invert(
        &mut self,
        drag: &[f64],
        product: impl FnOnce([&[f64]; 2], [&[f64]; 2]) -> [[f64; 2]; 2],
    ) {
        let [a, b] = &self.resisted;
        let [c, d] = &self.answers;
        let m = product([a, b], [c, d]);
        let least = LEAST * drag.iter().step_by(3).sum::<f64>();
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

    /// The translation of the layer, against the fluid, that adds to a net force on it the opposite one.
    pub(super) fn against(&self, net: [f64; 2]) -> [f64; 2] {
        self.inverse.map(|row| row[0] * net[0] + row[1] * net[1])
    }

    /// `R_BM⁻¹ R_n V c` in row k.
    pub(super) fn answer(&self, c: [f64; 2], k: usize) -> f64 {
        self.answers[0][k] * c[0] + self.answers[1][k] * c[1]
    }
}

/// Sum of forces `[3N]`.
pub(super) fn translations(forces: &[f64]) -> [f64; 2] {
    [0, 1].map(|c| forces.iter().skip(c).step_by(3).sum())
}

/// `V c` in row k.
pub(super) fn translation(c: [f64; 2], k: usize) -> f64 {
    match k % 3 {
        2 => 0.0,
        row => c[row],
    }
}
