//! The precision that a campaign requests of a quantity, in place of a number of seeds.

use serde::{Deserialize, Serialize};

/// The quantity with a requested precision.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Mean viscosity.
    Viscosity,
    /// Median viscosity of a run; over runs the mean is taken.
    ViscosityMedian,
    /// Viscosity from the stresslets alone.
    ViscosityStresslet,
    /// First normal stress difference.
    NormalStressDifference,
    /// Second normal stress difference.
    N2,
    /// Particle pressure.
    Pressure,
    /// Ratio of the shear stress and P₂₂.
    MacroscopicFriction,
    /// Area or volume fraction under an imposed pressure.
    Fraction,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Viscosity,
        Self::ViscosityMedian,
        Self::ViscosityStresslet,
        Self::NormalStressDifference,
        Self::N2,
        Self::Pressure,
        Self::MacroscopicFriction,
        Self::Fraction,
    ];

    /// Its name: that of the column in results of the store and in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Viscosity => "viscosity",
            Self::ViscosityMedian => "viscosity_median",
            Self::ViscosityStresslet => "viscosity_stresslet",
            Self::NormalStressDifference => "normal_stress_difference",
            Self::N2 => "n2",
            Self::Pressure => "pressure",
            Self::MacroscopicFriction => "macroscopic_friction",
            Self::Fraction => "fraction",
        }
    }

    /// The quantity of this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|measure| measure.name() == name)
    }
}

/// The precision requested at a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Precision {
    /// Half width of the 95 % interval over the mean; in (0, 1].
    pub precision: f64,
    /// The quantity.
    pub quantity: Quantity,
    /// Seeds of the first batch, at least 2.
    pub at_least: usize,
    /// Maximum number of seeds.
    pub at_most: usize,
}
