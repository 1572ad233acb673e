//! Uniform translations of the layer: their resistance, and the constraint that the far field's
//! forces sum to zero.

use super::local::LocalResistance;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::linalg::dense::add_scaled;
use crate::space::Strains;

/// Resistance of the pair terms to a translation, over isolated drag, below which it counts as
/// zero.
const LEAST: f64 = 1e-9;

/// The two translations V at one set of positions, under sparse hydrodynamics.
#[derive(Default)]
pub(super) struct Uniform<S: Fluid> {
    /// Inverse of `Vᵀ R_n V`, zero where that is.
    inverse: [[f64; 2]; 2],
    /// A translation of all spheres, `(0; V)`, `[6N]`.
    velocities: Vec<f64>,
    /// `P (0; V)`, `[6N]`.
    p_v: Vec<f64>,
    /// `R_n V`, `[3N]`.
    resisted: Vec<f64>,
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
        let resistance = [0, 1].map(|c| {
            let velocity = &mut self.velocities;
            velocity.clear();
            velocity.resize(half + moves, 0.0);
            velocity[half..]
                .iter_mut()
                .skip(c)
                .step_by(S::MODES)
                .for_each(|v| *v = 1.0);
            near.apply(
                &velocity[half..],
                Strains::none(),
                &mut self.work,
                &mut self.resisted,
                &mut self.stresslets,
            );
            self.p_v.resize(half + moves, 0.0);
            local.apply(velocity, &mut self.p_v);
            add_scaled(&mut self.resisted, &self.p_v[half..], -1.0);
            translations::<S>(&self.resisted)
        });
        // Symmetric up to rounding; the total drag is the scale.
        let least = LEAST * drag.iter().step_by(S::MODES).sum::<f64>();
        let [[xx, xy], [yx, yy]] = resistance;
        let off = 0.5 * (xy + yx);
        let determinant = xx * yy - off * off;
        self.inverse = if determinant > least * least {
            [
                [yy / determinant, -off / determinant],
                [-off / determinant, xx / determinant],
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
}

/// Sum of forces `[3N]`.
fn translations<S: Fluid>(forces: &[f64]) -> [f64; 2] {
    [0, 1].map(|c| forces.iter().skip(c).step_by(S::MODES).sum())
}

/// `V c` in row k.
pub(super) fn translation<S: Fluid>(c: [f64; 2], k: usize) -> f64 {
    match k % S::MODES {
        row if row < S::DRIFTS => c[row],
        _ => 0.0,
    }
}
