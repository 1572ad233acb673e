//! Stokesian Dynamics of many spheres: the far field is iterated on top of a sparse resistance that
//! has its near part.
//!
//! ```text
//! x = (−E; v),   q the force modes of the far field, M its mobility, M₀ that of isolated spheres, P a sparse approximation of M⁻¹
//! M q = x − V c,   Vᵀ q = 0,   q_F + R_n v − R_n,FE E = F        V: translations of the layer; R_n: the pair terms
//! q = P x + δ:     R_P v = F + (R_n + P)_FE E − δ_F,   R_P = P_FU + R_n         sparse, under forces −δ_F more
//! ```
//!
//! F includes the forces of contacts, which depend on v. [`fixed_point`] finds q by evaluating this
//! sparse problem for one δ after another, and [`split`] has the map.
//!
//! P is M₀⁻¹ and the inverse mobilities of near pairs ([`Resistance`] includes it in its terms);
//! M₀⁻¹ alone would suffice, with twice as many iterations, and R_P is then that of
//! Ball-Melrose hydrodynamics. Where M is far above P⁻¹, in long waves, the pair terms resist
//! little, so the number of iterations hardly depends on N.
//!
//! The far field does not resist a translation of the layer, but the pair terms resist it slightly,
//! as their two parts are not of the same order of multipoles: the mean velocity balances the net
//! force on the layer.

pub(crate) mod fixed_point;
mod local;
mod random_forces;
mod split;
mod uniform;

use crate::error::Error;
use crate::hydrodynamics::far_field::far_operator::FarOperator;
use crate::hydrodynamics::resistance::{
    Fluid, PressureWork, Resistance, isolated, modes_in_strain,
};
use crate::space::cell::Cell;
use crate::space::{FixedArray as _, Layer, Strains};
use local::LocalResistance;
use random_forces::FreeMotion;
use split::SplitMotion;
use uniform::Uniform;

/// Tolerance of M over the requested relative residual; test
/// `linear_motion_is_that_of_the_dense_far_field`.
const OPERATOR_TOLERANCE: f64 = 0.1;

/// Outcome of an iteration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// Evaluations of the map, each with one product with M for each part of the motion.
    pub evaluations: u32,
    /// Relative residual reached.
    pub residual: f64,
    /// Whether it is within the tolerance.
    pub converged: bool,
}

/// The far field of Stokesian Dynamics, iterated on top of a [`Resistance`] without it. Memory is
/// O(N).
pub struct IterativeFarField<S: Fluid = Layer> {
    /// M.
    operator: FarOperator<S>,
    /// Diagonal of M₀⁻¹.
    drag: Vec<S::PerAnyMode<f64>>,
    /// P.
    local: LocalResistance<S>,
    /// Relative residual to be reached.
    residual: f64,
    max_evaluations: u32,
    /// Outcome of the last solve.
    last: Convergence,
    /// δ of the last solve.
    delta: Vec<f64>,
    uniform: Uniform<S>,
    /// The motion of the last solve, from which the next one starts.
    pub(crate) split: SplitMotion<S>,
    /// That under random forces alone, once there were any.
    free: Option<Box<FreeMotion<S>>>,
}

impl<S: Fluid> IterativeFarField<S> {
    /// Plans for cells of the given area or volume.
    ///
    /// # Arguments
    /// - `cell`: periodic.
    /// - `radii`: one per sphere, in a.
    /// - `residual`: relative residual to be reached, 1e-7 to 1e-2; see the module.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for unbounded fluid, a radius or the residual.
    pub fn new(cell: &Cell<S>, radii: &[f64], residual: f64) -> Result<Self, Error> {
        if !(1e-7..=1e-2).contains(&residual) {
            return Err(Error::OutOfRange {
                field: "residual",
                value: residual,
                allowed: "1e-7 to 1e-2",
            });
        }
        if *cell == Cell::Unbounded {
            return Err(Error::OutOfRange {
                field: "cell",
                value: f64::INFINITY,
                allowed: "periodic",
            });
        }
        let operator = FarOperator::new(cell, radii, OPERATOR_TOLERANCE * residual)?;
        let drag: Vec<_> = radii.iter().map(|&radius| isolated::<S>(radius)).collect();
        Ok(Self {
            operator,
            local: LocalResistance::default(),
            residual,
            max_evaluations: fixed_point::MAX_EVALUATIONS,
            last: Convergence::default(),
            delta: vec![0.0; S::ALL_MODES * drag.len()],
            uniform: Uniform::default(),
            split: SplitMotion::new(S::PerAnyMode::flat(&drag)),
            free: None,
            drag,
        })
    }

    /// Sets another limit of the evaluations of one solve.
    #[cfg(test)]
    pub(crate) fn limit_evaluations(&mut self, most: u32) {
        self.max_evaluations = most;
    }

    /// Products with M at the current positions.
    pub(crate) fn operator(&mut self) -> &mut FarOperator<S> {
        &mut self.operator
    }

    /// Sets new positions. The next solve starts from the last solution.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of another area or volume.
    pub fn update(&mut self, cell: &Cell<S>, centres: &[S::Vector]) -> Result<(), Error> {
        self.operator.update(cell, centres)
    }

    /// Adds the far field, beyond P, to the result of [`Resistance::apply`] of `near` for the
    /// velocities of the last solve: counterforces `[3N]`, and stresslets of each sphere.
    pub fn correct(&self, forces: &mut [f64], stresslets: &mut [S::Strain]) {
        Self::add_delta(&self.delta, forces, stresslets);
    }

    /// Sets the forces, torques and stresslets that the spheres exert on the fluid in the far
    /// field, at the velocities of the last solve.
    pub(crate) fn force_modes(
        &self,
        velocities: &[f64],
        strains: Strains<'_, S>,
        work: &mut PressureWork<S>,
    ) {
        work.motion.clear();
        for (sphere, v) in S::by_sphere(velocities).iter().enumerate() {
            let motion = modes_in_strain::<S>(v, strains.at(sphere));
            work.motion.extend_from_slice(motion.as_ref());
        }
        work.modes.clear();
        work.modes.resize(work.motion.len(), 0.0);
        self.local.apply(&work.motion, &mut work.modes);
        for (mode, delta) in work.modes.iter_mut().zip(&self.delta) {
            *mode += delta;
        }
    }

    fn add_delta(delta: &[f64], forces: &mut [f64], stresslets: &mut [S::Strain]) {
        let spheres = S::by_sphere_mut(forces).iter_mut().zip(stresslets);
        for ((force, stresslet), delta) in spheres.zip(S::all_modes(delta)) {
            for k in 0..S::MODES {
                force[k] += delta[k];
            }
            for k in 0..S::STRAINS {
                stresslet[k] -= delta[S::MODES + k];
            }
        }
    }

    /// Refuses vectors of other lengths.
    fn check_lengths(
        &self,
        near: &Resistance<S>,
        forces: &[f64],
        velocities: &[f64],
    ) -> Result<(), Error> {
        let spheres = self.drag.len();
        for (field, found) in [
            ("forces", forces.len() / S::MODES),
            ("velocities", velocities.len() / S::MODES),
            ("near field", near.radii().len()),
        ] {
            if found != spheres {
                return Err(Error::Length {
                    field,
                    found,
                    expected: spheres,
                });
            }
        }
        Ok(())
    }
}
