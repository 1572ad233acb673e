//! Contact laws other than the rigid ones of the paper: what is chosen, in the units it is chosen in.

use super::infinite;
use crate::contact::Surface;
use crate::contact::laws::{Laws, Normal, Tangential};
use crate::contact::repulsion::Repulsion;
use crate::error::Error;
use serde::{Deserialize, Serialize};

/// Tangential over normal stiffness unless said otherwise: Mari et al., J. Rheol. 58, 1693 (2014).
pub const TANGENTIAL_STIFFNESS: f64 = 0.5;
/// Lubrication is held constant below this share of the roughness height unless said otherwise.
pub const LUBRICATION_SHARE: f64 = 0.1;
/// Overlap of two surfaces, in a, at which a layer of soft spheres is given up: its springs do not carry the load.
pub const DEEPEST_OVERLAP: f64 = 0.2;

/// What presses two spheres apart; d = h − g.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NormalLaw {
    /// Gaps are held at the roughness height.
    Rigid,
    /// `F = k d`, see [`crate::contact::linear_spring`].
    LinearSpring,
    /// `F = k d^(3/2)`, see [`crate::contact::hertz`].
    Hertz,
    /// Nothing but the repulsion `F = F0 exp(−g/l)`: the surfaces never touch. See [`crate::contact::repulsion`].
    ExponentialRepulsion,
}

impl NormalLaw {
    /// Whether it is a spring, which has a stiffness.
    pub fn is_spring(self) -> bool {
        matches!(self, Self::LinearSpring | Self::Hertz)
    }
}

/// What resists sliding and rolling of spheres that touch. Without friction (`friction = 0`) none of them acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TangentialLaw {
    /// The paper's: the force that lets the isolated pair roll, at most ν f. See [`crate::contact::friction`].
    RollSlip,
    /// A tangential spring, at most ν f. See [`crate::contact::stick_slide`].
    StickSlide,
    /// No slip at all within |F_t| ≤ ν f. See [`crate::contact::coulomb`].
    Coulomb,
    /// Neither slip nor rolling while pressed. See [`crate::contact::stick_rotate`].
    StickRotate,
}

/// How friction begins with the load.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FrictionOnset {
    /// The paper's: |F_t| ≤ ν f once f > F_crit, nothing before.
    CriticalLoad,
    /// |F_t| ≤ ν (f − F_crit), which does not jump.
    Reduced,
}

/// A choice of laws. In units in which it is a property of the material while Γ varies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactLaws {
    /// What presses apart.
    pub normal: NormalLaw,
    /// What resists sliding.
    pub tangential: TangentialLaw,
    /// How friction begins.
    pub onset: FrictionOnset,
    /// k, in F_crit/a (Hertz: F_crit/a^(3/2)), above 0; infinite exactly where the normal law has none.
    #[serde(with = "infinite")]
    pub stiffness: f64,
    /// Tangential stiffness over k, above 0, for [`TangentialLaw::StickSlide`]; 0 under other laws.
    pub tangential_stiffness: f64,
    /// Dashpot of a spring, in mu·a, from 0.
    pub dashpot: f64,
    /// Gap below which lubrication is held constant, in a, above 0 and at most h; 0 (nowhere) with rigid asperities alone.
    pub lubrication_gap: f64,
    /// F0 of the repulsion, in F_crit, from 0.
    pub repulsion: f64,
    /// Decay length l of the repulsion, in a, above 0; 0 without repulsion.
    pub repulsion_length: f64,
}

impl ContactLaws {
    /// The paper's laws: rigid asperities that roll or slip above the critical load.
    pub const PAPER: Self = Self {
        normal: NormalLaw::Rigid,
        tangential: TangentialLaw::RollSlip,
        onset: FrictionOnset::CriticalLoad,
        stiffness: f64::INFINITY,
        tangential_stiffness: 0.0,
        dashpot: 0.0,
        lubrication_gap: 0.0,
        repulsion: 0.0,
        repulsion_length: 0.0,
    };

    /// Linear springs of a stiffness in F_crit/a, with all else at its default for a roughness height h.
    pub fn linear_spring(stiffness: f64, tangential: TangentialLaw, roughness: f64) -> Self {
        Self {
            normal: NormalLaw::LinearSpring,
            tangential,
            stiffness,
            tangential_stiffness: if tangential == TangentialLaw::StickSlide {
                TANGENTIAL_STIFFNESS
            } else {
                0.0
            },
            lubrication_gap: LUBRICATION_SHARE * roughness,
            ..Self::PAPER
        }
    }

    /// Whether forces depend on the gaps, so that steps must resolve or outlast them.
    pub fn is_soft(&self) -> bool {
        self.normal.is_spring() || self.repulsion > 0.0
    }

    /// Checks ranges and which laws go together.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] names the first value out of range and what is allowed.
    pub fn validate(&self, surface: &Surface) -> Result<(), Error> {
        let check = |ok: bool, field, value: f64, allowed| {
            if ok {
                Ok(())
            } else {
                Err(Error::OutOfRange {
                    field,
                    value,
                    allowed,
                })
            }
        };
        let spring = self.normal.is_spring();
        check(
            !self.is_soft() || (surface.critical_load > 0.0 && surface.critical_load.is_finite()),
            "critical_load",
            surface.critical_load,
            "above 0 and finite where stiffness and repulsion are in units of it: with an infinite one they are infinite, \
             which is `rigid`, and with 0 nothing holds the spheres apart",
        )?;
        check(
            if spring {
                self.stiffness > 0.0 && self.stiffness.is_finite()
            } else {
                self.stiffness == f64::INFINITY
            },
            "stiffness",
            self.stiffness,
            "above 0 and finite for springs, infinite otherwise",
        )?;
        let sliding = self.tangential == TangentialLaw::StickSlide;
        check(
            if sliding {
                spring && self.tangential_stiffness > 0.0 && self.tangential_stiffness <= 100.0
            } else {
                self.tangential_stiffness == 0.0
            },
            "tangential_stiffness",
            self.tangential_stiffness,
            "above 0 and at most 100 for stick-slide, whose normal law must be a spring; 0 otherwise",
        )?;
        check(
            self.dashpot >= 0.0 && self.dashpot.is_finite() && (spring || self.dashpot == 0.0),
            "dashpot",
            self.dashpot,
            "0 or positive, and 0 without springs",
        )?;
        check(
            if self.is_soft() {
                self.lubrication_gap > 0.0 && self.lubrication_gap <= surface.roughness
            } else {
                self.lubrication_gap == 0.0
            },
            "lubrication_gap",
            self.lubrication_gap,
            "above 0 and at most the roughness for soft laws, 0 otherwise",
        )?;
        check(
            self.repulsion >= 0.0
                && self.repulsion.is_finite()
                && (self.repulsion > 0.0 || self.normal != NormalLaw::ExponentialRepulsion),
            "repulsion",
            self.repulsion,
            "0 or positive, and positive where there is nothing else",
        )?;
        check(
            if self.repulsion > 0.0 {
                self.repulsion_length > 0.0 && self.repulsion_length <= 0.5
            } else {
                self.repulsion_length == 0.0
            },
            "repulsion_length",
            self.repulsion_length,
            "above 0 and at most 0.5 with repulsion, 0 without",
        )
    }

    /// The laws in the units of the solver, for spheres with this surface.
    pub fn in_solver_units(&self, surface: Surface) -> Laws {
        let load = surface.critical_load;
        let stiffness = self.stiffness * load;
        Laws {
            surface,
            normal: match self.normal {
                NormalLaw::Rigid => Normal::Rigid,
                NormalLaw::LinearSpring => Normal::LinearSpring {
                    stiffness,
                    dashpot: self.dashpot,
                },
                NormalLaw::Hertz => Normal::Hertz {
                    stiffness,
                    dashpot: self.dashpot,
                },
                NormalLaw::ExponentialRepulsion => Normal::None,
            },
            tangential: match self.tangential {
                TangentialLaw::RollSlip => Tangential::RollSlip,
                TangentialLaw::StickSlide => Tangential::StickSlide {
                    stiffness: self.tangential_stiffness * stiffness,
                },
                TangentialLaw::Coulomb => Tangential::Coulomb,
                TangentialLaw::StickRotate => Tangential::StickRotate,
            },
            onset: self.onset,
            repulsion: (self.repulsion > 0.0).then_some(Repulsion {
                force: self.repulsion * load,
                length: self.repulsion_length,
            }),
        }
    }
}
