//! Measurements of a run: a sample at every step, and counters.

use crate::stress::{JAM_VISCOSITY, StressComponents};
use serde::{Deserialize, Deserializer, Serialize};

/// Measurements of a step: at its first stage, or with loaded rigid contacts in its middle, where
/// forces are their mean over the step. [`crate::Simulation::step`] returns one.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Sample {
    /// Strain at which the step begins; in fluid at rest the time.
    pub strain: f64,
    /// Relative viscosity in full: stresslets and contact stress. NaN in fluid at rest.
    #[serde(deserialize_with = "nan_if_null")]
    pub viscosity: f64,
    /// Relative viscosity from the stresslets alone, as in eq. (20) of the paper.
    #[serde(deserialize_with = "nan_if_null")]
    pub viscosity_stresslet: f64,
    /// First normal stress difference `N1 = σ_xx − σ_yy`, contacts included, in mu·rate.
    pub normal_stress_difference: f64,
    /// All components of the stress, by cause, in mu·rate; the viscosity is `1 + shear.total()`.
    pub stress: StressComponents,
    /// Γ = 6π/F_crit: imposed, or resulting from the imposed stress at this instant.
    pub shear_rate: f64,
    /// v'Rv / (V rate), in mu·rate.
    pub dissipation: f64,
    /// Power of the forces and torques of the user, `Σ (F (U − u∞) + T (Ω − Ω∞)) / (V rate)`, in
    /// mu·rate: see [`crate::Simulation::use_forces`].
    #[serde(default)]
    pub applied_power: f64,
    /// Pairs with a normal contact force.
    pub contacts: u32,
    /// Of these, pairs whose force exceeds the critical load.
    pub activated: u32,
    /// Activated pairs whose friction is below its bound.
    #[serde(rename = "rolling")]
    pub sticking: u32,
    /// Activated pairs that slip.
    pub slipping: u32,
    /// Mean normal velocity over the contacts, negative for approach, in a·rate; 0 without
    /// contacts.
    pub normal_velocity: f64,
    /// Smallest gap at the start of the step, in a; infinite if no pair is in
    /// lubrication range.
    #[serde(deserialize_with = "infinite_if_null")]
    pub minimum_gap: f64,
    /// Counters of the run so far, this step included.
    pub counters: Counters,
    /// Numbers of the contact network, set by an observer of the frame; `None` after a step.
    #[serde(default)]
    pub network: Option<NetworkSample>,
    /// Order, motion and constraints of the spheres, set by an observer of the frame; `None` after
    /// a step.
    #[serde(default)]
    pub structure: Option<StructureSample>,
    /// Isotropic part of the hydrodynamic stress, which the stresslets lack, as a pressure, in
    /// mu·rate; `None` under Brownian motion. It is no part of `stress`.
    #[serde(default)]
    pub pressure_hydrodynamic: Option<f64>,
    /// Area fraction of a layer, volume fraction of a suspension, under an imposed pressure.
    #[serde(default)]
    pub fraction: Option<f64>,
}

/// Reads a number. JSON has neither ∞ nor NaN and holds `null` in their place; other formats hold
/// the number.
fn null_as<'de, D: Deserializer<'de>>(null: f64, deserializer: D) -> Result<f64, D::Error> {
    if deserializer.is_human_readable() {
        let number: Option<f64> = Option::deserialize(deserializer)?;
        Ok(number.unwrap_or(null))
    } else {
        f64::deserialize(deserializer)
    }
}

fn infinite_if_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    null_as(f64::INFINITY, deserializer)
}

fn nan_if_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    null_as(f64::NAN, deserializer)
}

/// Order, motion and constraints of the spheres at one instant; NaN where a number has no meaning.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StructureSample {
    /// Largest `|Σ_j exp(2πi m y_j/L)|/N` over the whole numbers m from 2 to L/a: 1 for lanes along
    /// the flow at equal distances, some 2/√N at random.
    #[serde(deserialize_with = "nan_if_null")]
    pub layering: f64,
    /// Bond orientation Ψ₆ of a layer: 1 for a hexagonal lattice.
    #[serde(deserialize_with = "nan_if_null")]
    pub psi_6: f64,
    /// Bond orientation Q₆ of a suspension (Steinhardt): 0.57452 for an fcc lattice.
    #[serde(deserialize_with = "nan_if_null")]
    pub q_6: f64,
    /// Amplitude of the first harmonic of the local shear rate along the gradient, over the rate: 0
    /// for a linear profile.
    #[serde(deserialize_with = "nan_if_null")]
    pub localisation: f64,
    /// Amplitude of the first harmonic of the number density along the gradient, over its mean.
    #[serde(deserialize_with = "nan_if_null")]
    pub concentration_y: f64,
    /// The amplitude along the vorticity of a suspension.
    #[serde(deserialize_with = "nan_if_null")]
    pub concentration_z: f64,
    /// Mean square displacement along the gradient since the start of the run, in a².
    #[serde(deserialize_with = "nan_if_null")]
    pub displacement_yy: f64,
    /// Mean square displacement along the vorticity of a suspension since the start of the run, in
    /// a².
    #[serde(deserialize_with = "nan_if_null")]
    pub displacement_zz: f64,
    /// Constraints of the loaded contacts less degrees of freedom of the spheres that have such
    /// contacts, over the number of these spheres.
    #[serde(deserialize_with = "nan_if_null")]
    pub hyperstaticity: f64,
}

impl StructureSample {
    /// All numbers NaN.
    pub const NONE: Self = Self {
        layering: f64::NAN,
        psi_6: f64::NAN,
        q_6: f64::NAN,
        localisation: f64::NAN,
        concentration_y: f64::NAN,
        concentration_z: f64::NAN,
        displacement_yy: f64::NAN,
        displacement_zz: f64::NAN,
        hyperstaticity: f64::NAN,
    };
}

/// Numbers of the contact network at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NetworkSample {
    /// Loaded contacts of a sphere.
    pub coordination: f64,
    /// Contacts of a sphere on which friction acts.
    pub frictional_coordination: f64,
    /// Fraction of spheres in the largest cluster of such contacts.
    pub largest_cluster: f64,
    /// 1 if such a cluster percolates along the flow, else 0.
    pub percolating_x: f64,
    /// 1 if such a cluster percolates along the gradient, else 0.
    pub percolating_y: f64,
    /// Fraction of spheres in the core of such contacts.
    pub core_fraction: f64,
}

impl NetworkSample {
    /// The numbers without a network.
    pub const NONE: Self = Self {
        coordination: f64::NAN,
        frictional_coordination: f64::NAN,
        largest_cluster: f64::NAN,
        percolating_x: f64::NAN,
        percolating_y: f64::NAN,
        core_fraction: f64::NAN,
    };
}

/// Counters of a run since its start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Counters {
    /// Contact problems solved: two per step, or four without loaded contacts or under the paper's
    /// procedure; more where steps are halved (see [`crate::Simulation::step`]). Those of rejected
    /// attempts are not counted.
    pub stages: u64,
    /// Problems among these with violated conditions: friction is inexact, or the solver failed.
    pub unconverged_stages: u64,
    /// Problems among these whose friction error, over the largest force, is above
    /// [`crate::model::SolverSettings::inexact_friction`].
    #[serde(default)]
    pub inexact_stages: u64,
    /// Problems among these without a solution: the spheres were jammed at that instant.
    #[serde(default)]
    pub jammed_stages: u64,
    /// Largest residual of the contact problem where it has a solution, in a·rate.
    pub worst_residual: f64,
    /// Largest inconsistency of a friction force with its law, over the largest force of its stage.
    pub worst_friction_error: f64,
    /// Smallest gap at the start of any step, in a. (Stages within a step are not states of the
    /// run.)
    #[serde(deserialize_with = "infinite_if_null")]
    pub minimum_gap: f64,
    /// Number of times the viscosity rose above [`JAM_VISCOSITY`], or no admissible motion existed.
    pub jam_events: u64,
    /// Steps above it.
    pub jammed_steps: u64,
    /// Steps since it was last below.
    pub jammed_steps_running: u64,
}

impl Default for Counters {
    fn default() -> Self {
        Self {
            stages: 0,
            unconverged_stages: 0,
            inexact_stages: 0,
            jammed_stages: 0,
            worst_residual: 0.0,
            worst_friction_error: 0.0,
            minimum_gap: f64::INFINITY,
            jam_events: 0,
            jammed_steps: 0,
            jammed_steps_running: 0,
        }
    }
}

impl Counters {
    /// Updates the jam counters, once per step. `jammed`: a contact problem of it has no solution.
    pub(super) fn count_jam(&mut self, viscosity: f64, jammed: bool) {
        if viscosity > JAM_VISCOSITY || jammed {
            self.jam_events += u64::from(self.jammed_steps_running == 0);
            self.jammed_steps += 1;
            self.jammed_steps_running += 1;
        } else {
            self.jammed_steps_running = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Sample, StructureSample};

    #[test]
    fn a_sample_without_near_pairs_is_read_back_from_json() {
        let sample = Sample {
            minimum_gap: f64::INFINITY,
            ..Sample::default()
        };
        assert_eq!(sample.counters.minimum_gap, f64::INFINITY);
        let json = serde_json::to_string(&sample).unwrap();
        assert_eq!(serde_json::from_str::<Sample>(&json).unwrap(), sample);
    }

    #[test]
    fn numbers_without_meaning_are_read_back_from_json() {
        let sample = Sample {
            viscosity: f64::NAN,
            viscosity_stresslet: f64::NAN,
            structure: Some(StructureSample {
                psi_6: 0.5,
                ..StructureSample::NONE
            }),
            ..Sample::default()
        };
        let json = serde_json::to_string(&sample).unwrap();
        let read: Sample = serde_json::from_str(&json).unwrap();
        assert!(read.viscosity.is_nan() && read.viscosity_stresslet.is_nan());
        let structure = read.structure.unwrap();
        assert!(structure.q_6.is_nan() && structure.psi_6 == 0.5);
    }
}
