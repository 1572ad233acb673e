//! The laws of contact in the units of the solver, and what they come to at one stage.
//!
//! Contact forces look ahead by the stage's time span s, along the line of centres and along the tangent:
//!
//! ```text
//! rigid:   w = v_n + max(g − h, 0)/s + β min(g − h, 0)/s ≥ 0,  f ≥ 0,  f·w = 0
//! springs: f = max(0, F(d − s v_n)),  d = h − g;   linearised, f = A − B v_n:   w = v_n − A/B + f/B ≥ 0,  f ≥ 0,  f·w = 0
//! ```
//!
//! so that a spring is a rigid contact with the compliance 1/B, and needs no smaller steps than the flow itself. At the second stage of a
//! two-stage step v_n − 2 v_n1 stands for v_n in what looks ahead. A rigid pair above h may approach just far enough to touch; one below h
//! is pushed out at the rate β/s.

use super::pair::{Contact, Surface};
use super::{hertz, linear_spring, repulsion::Repulsion};
use crate::params::{ContactLaws, FrictionOnset, NormalLaw, TangentialLaw};

/// β: share of an overlap of rigid contacts taken back within one time span.
pub const RESTITUTION: f64 = 0.2;
/// Compliance of rigid contacts, in a/(mu·a²·rate): what limits the forces in a truly rigid network.
pub const COMPLIANCE: f64 = 1e-10;
/// Overlap at which an unloaded Hertzian contact is first linearised, in a.
const FIRST_OVERLAP: f64 = 1e-6;
/// Smallest overlap at which one is linearised: nothing to the forces, but more than nothing to the slope.
const LEAST_OVERLAP: f64 = 1e-13;

/// What presses two spheres apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Normal {
    /// Gaps held at h.
    Rigid,
    /// See [`super::linear_spring`].
    LinearSpring {
        /// k, in mu·a·rate.
        stiffness: f64,
        /// c, in mu·a.
        dashpot: f64,
    },
    /// See [`super::hertz`].
    Hertz {
        /// k, in mu·a^(1/2)·rate.
        stiffness: f64,
        /// c, in mu·a.
        dashpot: f64,
    },
    /// Surfaces that never touch.
    None,
}

/// What resists sliding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tangential {
    /// The paper's: the force that halts the slip of the isolated pair, at most ν f.
    RollSlip,
    /// A tangential spring, see [`super::springs`].
    StickSlide {
        /// k_t, in mu·a·rate.
        stiffness: f64,
    },
    /// No slip at all within |F_t| ≤ ν f.
    Coulomb,
    /// Neither slip nor rolling while pressed.
    StickRotate,
}

/// Chosen laws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Laws {
    /// Roughness, friction, critical load.
    pub surface: Surface,
    /// What presses.
    pub normal: Normal,
    /// What resists sliding.
    pub tangential: Tangential,
    /// How friction begins.
    pub onset: FrictionOnset,
    /// Repulsion besides.
    pub repulsion: Option<Repulsion>,
}

impl Laws {
    /// A choice of laws, for spheres with this surface.
    pub fn new(choice: &ContactLaws, surface: Surface) -> Self {
        let load = surface.critical_load;
        let stiffness = choice.stiffness * load;
        let dashpot = choice.dashpot;
        Self {
            surface,
            normal: match choice.normal {
                NormalLaw::Rigid => Normal::Rigid,
                NormalLaw::LinearSpring => Normal::LinearSpring { stiffness, dashpot },
                NormalLaw::Hertz => Normal::Hertz { stiffness, dashpot },
                NormalLaw::ExponentialRepulsion => Normal::None,
            },
            tangential: match choice.tangential {
                TangentialLaw::RollSlip => Tangential::RollSlip,
                TangentialLaw::StickSlide => Tangential::StickSlide {
                    stiffness: choice.tangential_stiffness * stiffness,
                },
                TangentialLaw::Coulomb => Tangential::Coulomb,
                TangentialLaw::StickRotate => Tangential::StickRotate,
            },
            onset: choice.onset,
            repulsion: (choice.repulsion > 0.0).then_some(Repulsion {
                force: choice.repulsion * load,
                length: choice.repulsion_length,
            }),
        }
    }

    /// The paper's laws: rigid asperities that roll or slip above the critical load.
    pub fn rigid(surface: Surface) -> Self {
        Self {
            surface,
            normal: Normal::Rigid,
            tangential: Tangential::RollSlip,
            onset: FrictionOnset::CriticalLoad,
            repulsion: None,
        }
    }

    /// Whether forces depend on gaps: steps are then those of [`crate::run::steppers::rosenbrock`].
    pub fn is_soft(&self) -> bool {
        !matches!(self.normal, Normal::Rigid) || self.repulsion.is_some()
    }

    /// Load that is taken off before friction.
    pub(super) fn offset(&self) -> f64 {
        match (self.onset, self.tangential) {
            (FrictionOnset::CriticalLoad, _) | (_, Tangential::StickRotate) => 0.0,
            (FrictionOnset::Reduced, _) => self.surface.critical_load,
        }
    }

    /// ν; infinite where friction has no limit.
    pub(super) fn friction(&self) -> f64 {
        match self.tangential {
            Tangential::StickRotate => f64::INFINITY,
            _ => self.surface.friction,
        }
    }

    /// Whether the friction force does not jump where it begins.
    pub(super) fn is_smooth(&self) -> bool {
        self.surface.critical_load == 0.0 || self.offset() > 0.0
    }
}

/// How the overlap of one candidate enters its normal law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Overlap {
    /// d of the stage, that of the first stage's motion taken back.
    pub(super) now: f64,
    /// Overlap about which a curved law is linearised.
    pub(super) reference: f64,
    /// Whether the surfaces touch: g < h.
    pub(super) touching: bool,
    /// What is added to the bias: the background's v_n.
    pub(super) background: f64,
}

impl Normal {
    /// Force at an overlap d, in mu·a²·rate, of pairs at rest; without meaning for rigid ones.
    pub fn force(&self, overlap: f64) -> f64 {
        match *self {
            Self::Rigid | Self::None => 0.0,
            Self::LinearSpring { stiffness, .. } => linear_spring::force(overlap, stiffness),
            Self::Hertz { stiffness, .. } => hertz::force(overlap, stiffness),
        }
    }

    /// Whether the slope of the force depends on the overlap.
    pub(super) fn is_curved(&self) -> bool {
        matches!(self, Self::Hertz { .. })
    }

    /// Overlap about which a contact is first linearised: `overlap` its own, `force` that of the stage before.
    pub(super) fn first_reference(&self, overlap: f64, force: f64) -> f64 {
        match *self {
            Self::Hertz { stiffness, .. } => overlap
                .max(hertz::overlap(force, stiffness))
                .max(FIRST_OVERLAP),
            _ => overlap,
        }
    }

    /// Bias and compliance of `w = v_n + bias + compliance f`.
    ///
    /// `held`: whether a rigid overlap is taken back at once.
    pub(super) fn entry(&self, overlap: &Overlap, time: f64, held: bool) -> [f64; 2] {
        let (intercept, slope, dashpot) = match *self {
            Self::Rigid | Self::None => {
                let all = overlap.now <= 0.0 || held;
                let share = if all { 1.0 } else { RESTITUTION };
                return [overlap.background - share * overlap.now / time, COMPLIANCE];
            }
            Self::LinearSpring { stiffness, dashpot } => {
                (stiffness * overlap.now, stiffness, dashpot)
            }
            Self::Hertz { stiffness, dashpot } => {
                let slope = hertz::slope(overlap.reference, stiffness);
                let force = hertz::force(overlap.reference, stiffness);
                (force + slope * (overlap.now - overlap.reference), slope, dashpot)
            }
        };
        let slope = slope * time + if overlap.touching { dashpot } else { 0.0 };
        [overlap.background - intercept / slope, slope.recip()]
    }

    /// The normal velocity above which a candidate bears no force.
    ///
    /// `held`: as in [`Normal::entry`].
    pub(super) fn parting_velocity(&self, overlap: &Overlap, time: f64, held: bool) -> f64 {
        match self {
            Self::Rigid if overlap.now > 0.0 && !held => RESTITUTION * overlap.now / time,
            _ => overlap.now / time,
        }
    }

    /// Takes the overlap ahead as the one about which a curved law is linearised; the distance of the force from the law there.
    pub(super) fn refine(&self, overlap: &mut Overlap, velocity: f64, force: f64, time: f64) -> f64 {
        let Self::Hertz { stiffness, dashpot } = *self else {
            return 0.0;
        };
        let ahead = overlap.now - time * velocity;
        let damping = if overlap.touching { dashpot } else { 0.0 };
        let exact = hertz::force(ahead, stiffness) - damping * velocity;
        // A dashpot has a slope of its own, beside which the least one is not nothing.
        let least = if damping > 0.0 { 0.0 } else { LEAST_OVERLAP };
        overlap.reference = ahead.max(least);
        (exact.max(0.0) - force).abs()
    }
}

/// Which stage of a step is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// One like the others: Runge-Kutta, or a single instant.
    Alone,
    /// The first of two.
    First,
    /// The second of two.
    Second,
}

/// How far contact forces look ahead.
#[derive(Debug, Clone, Copy)]
pub struct Span<'s> {
    /// s, in strain.
    pub time: f64,
    /// The stage.
    pub phase: Phase,
    /// Disturbance velocities `[3N]` of the first stage, at the second.
    pub first: &'s [f64],
}

impl Span<'_> {
    /// A stage like the others.
    pub fn alone(time: f64) -> Self {
        Self {
            time,
            phase: Phase::Alone,
            first: &[],
        }
    }

    /// 2 v_n1 of a pair at the second stage, 0 at others.
    pub(super) fn taken_back(&self, contact: &Contact) -> f64 {
        match self.phase {
            Phase::Alone | Phase::First => 0.0,
            Phase::Second => 2.0 * (contact.background[0] + contact.normal_row().read(self.first)),
        }
    }
}
