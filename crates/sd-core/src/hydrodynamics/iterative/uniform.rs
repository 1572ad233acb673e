//! Uniform translations of the layer: their resistance, and the constraint that the far field's
//! forces sum to zero.

use super::local::LocalResistance;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::space::Strains;

/// Resistance of the pair terms to a translation, over isolated drag, below which it counts as
/// zero.
const LEAST: f64 = 1e-9;

/// The two translations V at one set of positions, under sparse hydrodynamics.
#[derive(Default)]
pub(super) struct Uniform<S: Fluid> {
    /// Inverse of `Vᵀ R_n V`, zero where that is.
    inverse: [[f64; 2]; 2],
    /// A translation of all spheres, `[3N]`.
    velocities: Vec<f64>,
    /// The translation among all modes, `[6N]`.
    modes: Vec<f64>,
    /// P times the translation, `[6N]`.
    p_v: Vec<f64>,
    /// `R_P V`, `[3N]`.
    resisted: Vec<f64>,
    work: Vec<f64>,
    /// Stresslets, a by-product that is not used.
    stresslets: Vec<S::Strain>,
}

impl<S: Fluid> Uniform<S> {
    /// Computes the resistance of the pair terms to translations; `drag` is that of isolated
    /// spheres.
    pub(super) fn update(
        &mut self,
        near: &Resistance<S>,
        local: &LocalResistance<S>,
        drag: &[S::PerAnyMode<f64>],
    ) {
        let spheres = drag.len();
        let resistance = [0, 1].map(|c| {
            for (vector, modes) in [
                (&mut self.velocities, S::MODES),
                (&mut self.modes, S::ALL_MODES),
            ] {
                vector.clear();
                vector.resize(modes * spheres, 0.0);
                vector[c..].iter_mut().step_by(modes).for_each(|v| *v = 1.0);
            }
            near.apply(
                &self.velocities,
                Strains::none(),
                &mut self.work,
                &mut self.resisted,
                &mut self.stresslets,
            );
            self.p_v.resize(S::ALL_MODES * spheres, 0.0);
            local.apply(&self.modes, &mut self.p_v);
            let rows = S::by_sphere(&self.resisted).iter();
            [0, 1].map(|row| {
                let both = rows.clone().zip(S::all_modes(&self.p_v));
                both.map(|(resisted, p_v)| resisted[row] - p_v[row]).sum()
            })
        });
        // Symmetric up to rounding; the total drag is the scale.
        let least = LEAST * drag.iter().map(|drag| drag[0]).sum::<f64>();
        let [[xx, xy], [yx, yy]]: [[f64; 2]; 2] = resistance;
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
