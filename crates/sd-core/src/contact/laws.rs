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
//! is pushed out at the rate β/s. In the middle of a step of rigid contacts g is the gap at its start, and s the whole step.

use super::pair::Contact;
use crate::law::repulsion::ExponentialRepulsion;
use crate::law::{CustomNormalLaw, FrictionOnset, Halt, NormalLaw, TangentialLaw};
use crate::model::{ContactLaws, Surface};
use crate::space::{ImposedFlow as _, Space};

/// β: share of an overlap of rigid contacts taken back within one time span.
pub const RESTITUTION: f64 = 0.2;
/// Compliance of rigid contacts, in a/(mu·a²·rate): what limits the forces in a truly rigid network.
pub(crate) const COMPLIANCE: f64 = 1e-10;
/// Overlap at which an unloaded contact is first linearised, in a.
const FIRST_OVERLAP: f64 = 1e-6;
/// Smallest overlap at which one is linearised: nothing to the forces, but more than nothing to the slope.
const LEAST_OVERLAP: f64 = 1e-13;

/// Chosen laws, in the units of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Laws {
    /// Roughness, friction, and the load above which friction acts.
    pub surface: Surface,
    /// What presses.
    pub normal: NormalForce,
    /// What resists sliding.
    pub tangential: TangentialLaw,
    /// Stiffness k_t of tangential springs, in mu·a·rate; 0 under laws without.
    pub tangential_stiffness: f64,
    /// How friction begins.
    pub onset: FrictionOnset,
    /// Repulsion besides.
    pub repulsion: Option<ExponentialRepulsion>,
    /// Coefficient of rolling friction; 0 without.
    pub rolling_friction: f64,
    /// Attraction F_A of surfaces that touch, in mu·a²·rate; 0 without.
    pub adhesion: f64,
}

/// A law of the normal force with its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalForce {
    /// The law.
    pub law: ForceLaw,
    /// Its stiffness, in mu·a·rate times what the law asks for; infinite for rigid contacts.
    pub stiffness: f64,
    /// Dashpot c, in mu·a.
    pub dashpot: f64,
}

/// A law of the normal force: of the list, or implemented outside this crate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ForceLaw {
    /// A law of the list.
    Listed(NormalLaw),
    /// A law of the user.
    Custom(&'static dyn CustomNormalLaw),
}

impl From<NormalLaw> for ForceLaw {
    fn from(law: NormalLaw) -> Self {
        Self::Listed(law)
    }
}

impl ForceLaw {
    /// Whether surfaces can touch under it.
    pub fn touches(self) -> bool {
        match self {
            Self::Listed(law) => law.touches(),
            Self::Custom(_) => true,
        }
    }

    /// Force at an overlap d, as [`CustomNormalLaw::force`].
    pub fn force(self, overlap: f64, stiffness: f64) -> f64 {
        match self {
            Self::Listed(law) => law.force(overlap, stiffness),
            Self::Custom(law) => law.force(overlap, stiffness),
        }
    }

    /// Slope dF/dd at an overlap d, as [`CustomNormalLaw::slope`].
    pub fn slope(self, overlap: f64, stiffness: f64) -> f64 {
        match self {
            Self::Listed(law) => law.slope(overlap, stiffness),
            Self::Custom(law) => law.slope(overlap, stiffness),
        }
    }

    /// Overlap at a force, as [`CustomNormalLaw::overlap`].
    pub fn overlap(self, force: f64, stiffness: f64) -> f64 {
        match self {
            Self::Listed(law) => law.overlap(force, stiffness),
            Self::Custom(law) => law.overlap(force, stiffness),
        }
    }
}

impl Laws {
    /// No contact at all.
    pub const NONE: Self = Self {
        surface: Surface {
            roughness: 0.0,
            friction: 0.0,
            critical_load: f64::INFINITY,
        },
        normal: NormalForce {
            law: ForceLaw::Listed(NormalLaw::ExponentialRepulsion),
            stiffness: f64::INFINITY,
            dashpot: 0.0,
        },
        tangential: TangentialLaw::RollSlip,
        tangential_stiffness: 0.0,
        onset: FrictionOnset::CriticalLoad,
        repulsion: None,
        rolling_friction: 0.0,
        adhesion: 0.0,
    };

    /// A choice of laws, for spheres with this surface.
    pub fn new(choice: &ContactLaws, surface: Surface) -> Self {
        let load = surface.critical_load;
        let springs = choice.normal.is_spring();
        let stiffness = if springs {
            choice.stiffness * choice.stiffness_unit.force(load)
        } else {
            f64::INFINITY
        };
        Self {
            surface: Surface {
                critical_load: choice.onset.threshold(load),
                ..surface
            },
            normal: NormalForce {
                law: choice.normal.into(),
                stiffness,
                dashpot: choice.dashpot,
            },
            tangential: choice.tangential,
            tangential_stiffness: if choice.tangential.has_spring() {
                choice.tangential_stiffness * stiffness
            } else {
                0.0
            },
            onset: choice.onset,
            repulsion: (choice.repulsion > 0.0).then_some(ExponentialRepulsion {
                force: choice.repulsion * load,
                length: choice.repulsion_length,
            }),
            rolling_friction: choice.rolling_friction,
            // The load may be infinite.
            adhesion: if choice.adhesion > 0.0 {
                choice.adhesion * load
            } else {
                0.0
            },
        }
    }

    /// The paper's laws: rigid asperities that roll or slip above the critical load.
    pub fn rigid(surface: Surface) -> Self {
        Self::new(&ContactLaws::PAPER, surface)
    }

    /// Whether forces depend on gaps: steps are then those of `run::steppers::rosenbrock`.
    pub fn is_soft(&self) -> bool {
        !self.normal.is_rigid() || self.repulsion.is_some()
    }

    /// Whether forces act on surfaces that need not press: they are found before the contact problem, from gaps and the critical load.
    pub(crate) fn act_at_a_distance(&self) -> bool {
        self.repulsion.is_some() || self.adhesion > 0.0
    }

    /// Whether tangential rows read the motion that normal forces alone leave.
    pub(super) fn reads_isolated_motion(&self) -> bool {
        self.tangential.halts() == Halt::IsolatedSlip
    }

    /// Coefficient and intercept of the bound `ρ(f) = max(0, coefficient f + intercept)` of friction; the coefficient is infinite where
    /// there is no bound.
    pub(super) fn friction_bound(&self) -> (f64, f64) {
        self.bound(self.tangential.bound(self.surface.friction, 1.0))
    }

    /// The same of rolling friction.
    pub(super) fn rolling_bound(&self) -> (f64, f64) {
        self.bound(self.rolling_friction)
    }

    /// A bound by its coefficient: it begins with the load as the onset has it.
    fn bound(&self, coefficient: f64) -> (f64, f64) {
        let intercept = match self.onset {
            FrictionOnset::Reduced if coefficient.is_finite() => {
                -coefficient * self.surface.critical_load
            }
            FrictionOnset::CriticalLoad | FrictionOnset::Reduced | FrictionOnset::Contact => 0.0,
        };
        (coefficient, intercept)
    }

    /// Whether the friction force does not jump where it begins.
    pub(super) fn is_smooth(&self) -> bool {
        self.surface.critical_load == 0.0 || self.friction_bound().1 < 0.0
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

impl NormalForce {
    /// Force at an overlap d, in mu·a²·rate, of pairs at rest; without meaning for rigid ones.
    pub fn force(&self, overlap: f64) -> f64 {
        self.law.force(overlap, self.stiffness)
    }

    /// Whether contacts do not give way.
    pub fn is_rigid(&self) -> bool {
        self.law == ForceLaw::Listed(NormalLaw::Rigid)
    }

    /// Overlap about which a contact is first linearised: `overlap` its own, `force` that of the stage before.
    pub(super) fn first_reference(&self, overlap: f64, force: f64) -> f64 {
        overlap
            .max(self.law.overlap(force, self.stiffness))
            .max(FIRST_OVERLAP)
    }

    /// Bias and compliance of `w = v_n + bias + compliance f`.
    ///
    /// `held`: whether a rigid overlap is taken back at once.
    pub(super) fn entry(&self, overlap: &Overlap, time: f64, held: bool) -> [f64; 2] {
        if self.is_rigid() {
            let parting = self.parting_velocity(overlap, time, held);
            return [overlap.background - parting, COMPLIANCE];
        }
        let slope = self.law.slope(overlap.reference, self.stiffness);
        let intercept = self.force(overlap.reference) + slope * (overlap.now - overlap.reference);
        let ahead = slope * time + self.damping(overlap);
        [overlap.background - intercept / ahead, ahead.recip()]
    }

    /// The normal velocity above which a candidate bears no force.
    ///
    /// `held`: as in [`NormalForce::entry`].
    pub(super) fn parting_velocity(&self, overlap: &Overlap, time: f64, held: bool) -> f64 {
        if self.is_rigid() && overlap.now > 0.0 && !held {
            RESTITUTION * overlap.now / time
        } else {
            overlap.now / time
        }
    }

    /// The dashpot that acts.
    fn damping(&self, overlap: &Overlap) -> f64 {
        if overlap.touching { self.dashpot } else { 0.0 }
    }

    /// Linearises the law about the overlap ahead; the new bias and compliance if they differ, and `force` is not near enough to the law.
    ///
    /// `velocity`, `force`: v_n and f of the solution at hand. `near`: distance that is near enough.
    pub(super) fn refine(
        &self,
        overlap: &mut Overlap,
        [velocity, force]: [f64; 2],
        time: f64,
        near: f64,
    ) -> Option<[f64; 2]> {
        if self.is_rigid() {
            return None;
        }
        let (ahead, damping) = (overlap.now - time * velocity, self.damping(overlap));
        let exact = (self.force(ahead) - damping * velocity).max(0.0);
        if (exact - force).abs() <= near {
            return None;
        }
        let before = self.law.slope(overlap.reference, self.stiffness);
        // A dashpot has a slope of its own, beside which the least one is not nothing.
        let least = if damping > 0.0 { 0.0 } else { LEAST_OVERLAP };
        overlap.reference = ahead.max(least);
        let slope = self.law.slope(overlap.reference, self.stiffness);
        (slope != before).then(|| self.entry(overlap, time, false))
    }
}

/// Which stage of a step is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// One like the others: Runge-Kutta, a single instant, or the first of two under rigid contacts.
    Alone,
    /// The middle of a step of rigid contacts, which hold the gaps of its start.
    Middle,
    /// The first of two where forces depend on gaps.
    First,
    /// The second of these.
    Second,
}

/// How far contact forces look ahead.
#[derive(Debug, Clone, Copy)]
pub struct Span<'s> {
    /// s, in strain.
    pub time: f64,
    /// The stage.
    pub phase: Phase,
    /// Disturbance velocities of the first stage, at a later one that asks for them.
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

    /// The gap that counts: that of the stage, what the first stage's motion takes back of it, or in the middle of a step the gap at its
    /// start.
    pub(super) fn gap<S: Space>(&self, contact: &Contact<S>, background: &S::Background) -> f64 {
        let pair = &contact.pair;
        match self.phase {
            Phase::Alone | Phase::First => pair.gap,
            Phase::Middle => {
                let half = 0.5 * self.time;
                let first = S::by_sphere(self.first);
                let [u_i, u_j] = [pair.i, pair.j].map(|sphere| S::translation(&first[sphere]));
                let drifted = pair.normal * pair.distance - (u_j - u_i) * half;
                let start = background.carried_back(&drifted, half);
                pair.gap + (S::norm_squared(&start).sqrt() - pair.distance)
            }
            Phase::Second => pair.gap - self.time * self.taken_back(contact),
        }
    }

    /// 2 v_n1 of a pair at the second stage, 0 at others.
    pub(super) fn taken_back<S: Space>(&self, contact: &Contact<S>) -> f64 {
        match self.phase {
            Phase::Alone | Phase::Middle | Phase::First => 0.0,
            Phase::Second => 2.0 * contact.approach(self.first),
        }
    }

    /// Whether rigid contacts that overlap are taken back at once, as those are whose forces depend on gaps.
    pub(super) fn takes_back_at_once(&self) -> bool {
        matches!(self.phase, Phase::First | Phase::Second)
    }
}
