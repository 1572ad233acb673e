//! Contact laws other than the rigid ones of the paper, in the units of their input.

use super::{infinite, is_default};
use crate::law::hydrodynamic_friction::HydrodynamicFriction;
use crate::law::tangential::stick_slide::DEFAULT_STIFFNESS;
use crate::law::{ColloidUnit, FrictionOnset, NormalLaw, StiffnessUnit, TangentialLaw};
use serde::{Deserialize, Serialize};

/// Default gap below which lubrication is constant, over the roughness height.
const LUBRICATION_SHARE: f64 = 0.1;
/// Default gap below which lubrication between smooth spheres is constant, in a.
const SMOOTH_LUBRICATION_GAP: f64 = 1e-3;
/// Overlap of two surfaces, in a, at which a run of soft spheres fails: its springs do not carry
/// the load.
pub const DEEPEST_OVERLAP: f64 = 0.2;

/// A choice of laws, in units in which they are material properties while Γ varies.
///
/// ```
/// use sd_core::{ContactLaws, TangentialLaw};
///
/// // Rigid asperities with Coulomb friction and friction against rolling.
/// let laws = ContactLaws {
///     tangential: TangentialLaw::Coulomb,
///     rolling_friction: 0.1,
///     ..ContactLaws::PAPER
/// };
/// assert!(!laws.is_soft() && !laws.needs_critical_load());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactLaws {
    /// Normal law.
    pub normal: NormalLaw,
    /// Tangential law.
    pub tangential: TangentialLaw,
    /// Onset of friction.
    pub onset: FrictionOnset,
    /// Unit of the stiffness.
    #[serde(
        default = "by_critical_load",
        skip_serializing_if = "is_by_critical_load"
    )]
    pub stiffness_unit: StiffnessUnit,
    /// k, in F/a (Hertz: F/a^(3/2)) with F the unit of force, above 0; infinite exactly for normal
    /// laws without a stiffness.
    #[serde(with = "infinite")]
    pub stiffness: f64,
    /// Tangential stiffness, above 0, for [`TangentialLaw::StickSlide`]: over k, and of rigid
    /// contacts in F/a; 0 under other laws.
    pub tangential_stiffness: f64,
    /// Dashpot of a spring, in mu·a, from 0.
    pub dashpot: f64,
    /// Gap below which lubrication is held constant, in a, above 0 and at most h unless h is 0; 0
    /// (nowhere) with rigid asperities alone, and with a regularised lubrication.
    pub lubrication_gap: f64,
    /// Unit of the repulsion and of van der Waals attraction.
    #[serde(
        default = "colloids_by_critical_load",
        skip_serializing_if = "are_colloids_by_critical_load"
    )]
    pub colloid_unit: ColloidUnit,
    /// F0 of the repulsion, from 0.
    pub repulsion: f64,
    /// Decay length l of the repulsion, in a, above 0; 0 without repulsion.
    pub repulsion_length: f64,
    /// Strength A of van der Waals attraction, twice the Hamaker constant, from 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub van_der_waals: f64,
    /// δ of van der Waals attraction, in a, above 0; 0 without it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub van_der_waals_length: f64,
    /// Coefficient μ_r of rolling friction, from 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rolling_friction: f64,
    /// Adhesion F_A of touching surfaces, in F_crit, from 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub adhesion: f64,
    /// Coefficient α of hydrodynamic friction, from 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hydrodynamic_friction: f64,
    /// Range g0 of hydrodynamic friction, in a, above 0; 0 without it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hydrodynamic_friction_range: f64,
}

/// Default of [`ContactLaws::stiffness_unit`].
fn by_critical_load() -> StiffnessUnit {
    StiffnessUnit::CriticalLoad
}

/// Whether the unit is the default, which is omitted so that older cases keep their keys.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde requires"
)]
fn is_by_critical_load(unit: &StiffnessUnit) -> bool {
    *unit == by_critical_load()
}

/// Default of [`ContactLaws::colloid_unit`].
fn colloids_by_critical_load() -> ColloidUnit {
    ColloidUnit::CriticalLoad
}

/// Whether that unit is the default, which is omitted for the same reason.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde requires"
)]
fn are_colloids_by_critical_load(unit: &ColloidUnit) -> bool {
    *unit == colloids_by_critical_load()
}

impl ContactLaws {
    /// The paper's laws: rigid asperities that roll or slip above the critical load.
    pub const PAPER: Self = Self {
        normal: NormalLaw::Rigid,
        tangential: TangentialLaw::RollSlip,
        onset: FrictionOnset::CriticalLoad,
        stiffness_unit: StiffnessUnit::CriticalLoad,
        stiffness: f64::INFINITY,
        tangential_stiffness: 0.0,
        dashpot: 0.0,
        lubrication_gap: 0.0,
        colloid_unit: ColloidUnit::CriticalLoad,
        repulsion: 0.0,
        repulsion_length: 0.0,
        van_der_waals: 0.0,
        van_der_waals_length: 0.0,
        rolling_friction: 0.0,
        adhesion: 0.0,
        hydrodynamic_friction: 0.0,
        hydrodynamic_friction_range: 0.0,
    };

    /// Linear springs of a stiffness in F_crit/a, with defaults for a roughness height h.
    ///
    /// ```
    /// use sd_core::{ContactLaws, TangentialLaw};
    ///
    /// let laws = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
    /// assert_eq!((laws.tangential_stiffness, laws.lubrication_gap), (0.5, 0.001));
    /// ```
    pub fn linear_spring(stiffness: f64, tangential: TangentialLaw, roughness: f64) -> Self {
        Self {
            normal: NormalLaw::LinearSpring,
            tangential,
            stiffness,
            tangential_stiffness: if tangential.has_spring() {
                DEFAULT_STIFFNESS
            } else {
                0.0
            },
            lubrication_gap: Self::usual_lubrication_gap(roughness),
            ..Self::PAPER
        }
    }

    /// Default gap below which lubrication is constant, in a, at a roughness height.
    pub fn usual_lubrication_gap(roughness: f64) -> f64 {
        if roughness > 0.0 {
            LUBRICATION_SHARE * roughness
        } else {
            SMOOTH_LUBRICATION_GAP
        }
    }

    /// The friction of hydrodynamic roughness.
    pub(crate) fn hydrodynamic(&self) -> HydrodynamicFriction {
        HydrodynamicFriction {
            coefficient: self.hydrodynamic_friction,
            range: self.hydrodynamic_friction_range,
        }
    }

    /// Whether a parameter is in units of the critical load, which must then be above 0 and finite.
    pub fn needs_critical_load(&self) -> bool {
        let springs = self.has_stiffness() && self.stiffness_unit == StiffnessUnit::CriticalLoad;
        let colloids = self.has_colloids() && self.colloid_unit == ColloidUnit::CriticalLoad;
        springs || colloids || self.adhesion > 0.0
    }

    /// Whether surfaces repel or attract each other without contact.
    pub fn has_colloids(&self) -> bool {
        self.repulsion > 0.0 || self.van_der_waals > 0.0
    }

    /// Whether rigid contacts have tangential springs.
    pub fn has_rigid_springs(&self) -> bool {
        self.normal == NormalLaw::Rigid && self.tangential.has_spring()
    }

    /// Whether there is a stiffness, of contacts or of tangential springs alone.
    pub(crate) fn has_stiffness(&self) -> bool {
        self.normal.is_spring() || self.has_rigid_springs()
    }

    /// Whether forces depend on the gaps, so that steps must resolve them or be implicit.
    pub fn is_soft(&self) -> bool {
        self.normal != NormalLaw::Rigid || self.repulsion > 0.0
    }
}
