//! The contact laws in the units of the solver, and their linearised form at one stage.
//!
//! Contact forces are implicit: they depend on the gap and the tangential deformation at the end of
//! the time span s of the stage.
//!
//! ```text
//! rigid:   w = v_n + max(g − h, 0)/s + β min(g − h, 0)/s ≥ 0,  f ≥ 0,  f·w = 0
//! springs: f = max(0, F(d − s v_n)),  d = h − g;   linearised, f = A − B v_n:
//!          w = v_n − A/B + f/B ≥ 0,  f ≥ 0,  f·w = 0
//! ```
//!
//! A spring is therefore a rigid contact with the compliance 1/B, and does not require smaller
//! steps than the flow itself. At the second stage of a two-stage step, v_n − 2 v_n1 replaces v_n
//! in the implicit terms. A rigid pair with a gap above h may approach until it touches; one with a
//! gap below h is separated at the rate β/s. At the midpoint of a step of rigid contacts, g is the
//! gap at the start of the step and s is the whole step.

use super::contact_pair::Contact;
use crate::law::hydrodynamic_friction::HydrodynamicFriction;
use crate::law::repulsion::ExponentialRepulsion;
use crate::law::van_der_waals::VanDerWaals;
use crate::law::{ColloidUnit, CustomNormalLaw, FrictionOnset, NormalLaw, TangentialLaw};
use crate::model::{ContactLaws, PressureKind, Surface};
use crate::space::{IncidentFlow, Space};
use std::f64::consts::FRAC_1_SQRT_2;

/// γ of two-stage steps: the time span of implicit contact forces, in steps.
pub(crate) const GAMMA: f64 = 1.0 - FRAC_1_SQRT_2;
/// β: fraction of the overlap of rigid contacts that is corrected within one time span.
pub const OVERLAP_CORRECTION: f64 = 0.2;
/// Compliance of rigid contacts, in a/(mu·a²·rate). It limits the forces in a truly rigid network.
pub(crate) const COMPLIANCE: f64 = 1e-10;
/// Overlap about which an unloaded contact is first linearised, in a.
const INITIAL_OVERLAP: f64 = 1e-6;
/// Smallest overlap about which a contact is linearised, in a: its force is negligible, but its
/// slope is not zero.
const MIN_OVERLAP: f64 = 1e-13;

/// The chosen laws, in the units of the solver.
///
/// ```
/// use sd_core::contact::{Laws, Surface};
/// use sd_core::{ContactLaws, TangentialLaw};
///
/// // Springs of 1e4 F_crit/a, where F_crit is 2 mu·a²·rate.
/// let springs = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
/// let surface = Surface { roughness: 0.01, friction: 0.5, critical_load: 2.0 };
/// let laws = Laws::new(&springs, surface);
/// assert_eq!(laws.normal.force(0.001), 20.0);
/// assert_eq!(laws.tangential_stiffness, 1e4);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Laws {
    /// Roughness height, friction coefficient and critical load.
    pub surface: Surface,
    /// Normal force law.
    pub normal: NormalForce,
    /// Tangential force law.
    pub tangential: TangentialLaw,
    /// Stiffness k_t of tangential springs, in mu·a·rate; 0 for laws without them.
    pub tangential_stiffness: f64,
    /// Onset of friction.
    pub onset: FrictionOnset,
    /// Additional repulsion.
    pub repulsion: Option<ExponentialRepulsion>,
    /// Additional van der Waals attraction.
    pub attraction: Option<VanDerWaals>,
    /// Coefficient of rolling friction; 0 without rolling friction.
    pub rolling_friction: f64,
    /// Attraction F_A of touching surfaces, in mu·a²·rate; 0 without adhesion.
    pub adhesion: f64,
    /// Friction of hydrodynamic roughness, which is a part of the resistance.
    pub hydrodynamic_friction: HydrodynamicFriction,
}

/// A law of the normal force with its parameters.
#[derive(Debug, Clone, Copy)]
pub struct NormalForce {
    /// The law.
    pub law: ForceLaw,
    /// Stiffness, in mu·a·rate times the power of a that the law requires; infinite for rigid
    /// contacts.
    pub stiffness: f64,
    /// Dashpot coefficient c, in mu·a.
    pub dashpot: f64,
}

/// A law of the normal force: of the list, or implemented outside this crate.
#[derive(Debug, Clone, Copy)]
pub enum ForceLaw {
    /// A law of the list.
    BuiltIn(NormalLaw),
    /// A law of the user.
    Custom(&'static dyn CustomNormalLaw),
}

impl From<NormalLaw> for ForceLaw {
    fn from(law: NormalLaw) -> Self {
        Self::BuiltIn(law)
    }
}

impl ForceLaw {
    /// Whether surfaces can touch under it.
    pub fn touches(self) -> bool {
        match self {
            Self::BuiltIn(law) => law.touches(),
            Self::Custom(_) => true,
        }
    }

    /// Its force as a function of the overlap.
    pub fn curve(&self) -> &dyn CustomNormalLaw {
        match self {
            Self::BuiltIn(law) => law,
            Self::Custom(law) => *law,
        }
    }
}

impl Laws {
    /// No contact forces.
    pub fn none() -> Self {
        let choice = ContactLaws {
            normal: NormalLaw::ExponentialRepulsion,
            ..ContactLaws::PAPER
        };
        let surface = Surface {
            roughness: 0.0,
            friction: 0.0,
            critical_load: f64::INFINITY,
        };
        Self::new(&choice, surface)
    }

    /// The given choice of laws, for spheres with this surface.
    pub fn new(choice: &ContactLaws, surface: Surface) -> Self {
        let load = surface.critical_load;
        // The load may be infinite, and 0 times infinity is NaN.
        let times = |factor: f64, unit: f64| if factor > 0.0 { factor * unit } else { 0.0 };
        let stiffness = if choice.normal.is_spring() {
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
            tangential_stiffness: times(
                choice.tangential_stiffness,
                if choice.normal == NormalLaw::Rigid {
                    choice.stiffness_unit.force(load)
                } else {
                    stiffness
                },
            ),
            onset: choice.onset,
            repulsion: None,
            attraction: None,
            rolling_friction: choice.rolling_friction,
            adhesion: times(choice.adhesion, load),
            hydrodynamic_friction: choice.hydrodynamic(),
        }
        .with_colloids(choice, ColloidUnit::CriticalLoad, load)
    }

    /// These laws at a thermal energy kT, in mu·a³·rate, which may be the unit of the repulsion and
    /// attraction.
    pub(crate) fn at_thermal_energy(self, choice: &ContactLaws, energy: f64) -> Self {
        self.with_colloids(choice, ColloidUnit::Thermal, energy)
    }

    /// These laws with the chosen repulsion and attraction, if they are in this unit.
    fn with_colloids(self, choice: &ContactLaws, unit: ColloidUnit, size: f64) -> Self {
        if choice.colloid_unit != unit {
            return self;
        }
        Self {
            repulsion: (choice.repulsion > 0.0).then_some(ExponentialRepulsion {
                force: choice.repulsion * size,
                length: choice.repulsion_length,
            }),
            attraction: (choice.van_der_waals > 0.0).then_some(VanDerWaals {
                energy: choice.van_der_waals * size,
                length: choice.van_der_waals_length,
            }),
            ..self
        }
    }

    /// The paper's laws: rigid asperities that roll or slip above the critical load.
    pub fn rigid(surface: Surface) -> Self {
        Self::new(&ContactLaws::PAPER, surface)
    }

    /// Whether forces depend on gaps. Steps are then those of `run::steppers::rosenbrock`.
    pub fn is_soft(&self) -> bool {
        !self.normal.is_rigid() || self.repulsion.is_some()
    }

    /// Whether forces other than contact forces act between surfaces. They follow from gaps and the
    /// critical load, before the contact problem is solved.
    pub(crate) fn act_without_contact(&self) -> bool {
        self.repulsion.is_some() || self.attraction.is_some() || self.adhesion > 0.0
    }

    /// Coefficients of the bounds on friction, infinite where there is no bound, and on rolling
    /// friction.
    pub(super) fn friction_coefficients(&self) -> [f64; 2] {
        let friction = self.tangential.bound(self.surface.friction, 1.0);
        [friction, self.rolling_friction]
    }

    /// Intercept of the bound `ρ(f) = max(0, coefficient f + intercept)`.
    pub(super) fn intercept(&self, coefficient: f64) -> f64 {
        if self.onset == FrictionOnset::Reduced && coefficient.is_finite() {
            -coefficient * self.surface.critical_load
        } else {
            0.0
        }
    }

    /// Bound of the friction force of a contact in its solution, for a coefficient.
    pub(super) fn bound<S: Space>(&self, coefficient: f64, contact: &Contact<S>) -> f64 {
        if !contact.friction_acts || contact.normal_force <= 0.0 {
            return 0.0;
        }
        (coefficient * contact.normal_force + self.intercept(coefficient)).max(0.0)
    }

    /// Time over which tangential springs look ahead: γ steps in every stage.
    pub(super) fn spring_time(&self, span: &Span<'_>) -> f64 {
        if self.is_soft() {
            span.time
        } else {
            GAMMA * span.time
        }
    }

    /// Whether the friction force is continuous at its onset.
    pub(super) fn is_smooth(&self) -> bool {
        let [coefficient, _] = self.friction_coefficients();
        self.surface.critical_load == 0.0 || self.intercept(coefficient) < 0.0
    }
}

/// The overlap of one candidate, as its normal law uses it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Overlap {
    /// Overlap d of the stage; at the second stage with the correction for the motion of the first.
    pub(super) now: f64,
    /// Overlap to which random forces alone would bring rigid contacts by the end of the time span:
    /// they end at this gap above h.
    pub(super) reflected: f64,
    /// Overlap about which a nonlinear law is linearised.
    pub(super) reference: f64,
    /// Whether the surfaces touch: g < h.
    pub(super) touching: bool,
    /// Contribution of the background to v_n, which is added to the bias.
    pub(super) background: f64,
}

impl NormalForce {
    /// Force at an overlap d, in mu·a²·rate, of a pair at rest; meaningless for rigid contacts.
    pub fn force(&self, overlap: f64) -> f64 {
        self.law.curve().force(overlap, self.stiffness)
    }

    /// Whether contacts are rigid.
    pub fn is_rigid(&self) -> bool {
        matches!(self.law, ForceLaw::BuiltIn(NormalLaw::Rigid))
    }

    /// Overlap about which a contact is first linearised, from its current overlap and from its
    /// force at the preceding stage.
    pub(super) fn first_reference(&self, overlap: f64, force: f64) -> f64 {
        overlap
            .max(self.law.curve().overlap(force, self.stiffness))
            .max(INITIAL_OVERLAP)
    }

    /// Bias and compliance of `w = v_n + bias + compliance f`.
    pub(super) fn entry(&self, overlap: &Overlap, span: &Span<'_>) -> [f64; 2] {
        if self.is_rigid() {
            let separation = self.separation_velocity(overlap, span);
            return [overlap.background - separation, COMPLIANCE];
        }
        let slope = self.law.curve().slope(overlap.reference, self.stiffness);
        let intercept = self.force(overlap.reference) + slope * (overlap.now - overlap.reference);
        let damping = slope * span.time + self.damping(overlap);
        [overlap.background - intercept / damping, damping.recip()]
    }

    /// The normal velocity above which a candidate bears no force.
    pub(super) fn separation_velocity(&self, overlap: &Overlap, span: &Span<'_>) -> f64 {
        if !self.is_rigid() {
            return overlap.now / span.time;
        }
        let corrected = if overlap.now > 0.0 && !span.corrects_overlap_immediately() {
            OVERLAP_CORRECTION * overlap.now
        } else {
            overlap.now
        };
        (corrected + overlap.reflected) / span.time
    }

    /// Dashpot coefficient of this contact; 0 unless the surfaces touch.
    fn damping(&self, overlap: &Overlap) -> f64 {
        if overlap.touching { self.dashpot } else { 0.0 }
    }

    /// Linearises a spring's law about the overlap at the end of the time span. Returns the new
    /// bias and compliance if they changed and `force` does not satisfy the law.
    ///
    /// `velocity`, `force`: v_n and f of the current solution. `tolerance`: largest accepted
    /// difference from the law.
    pub(super) fn refine(
        &self,
        overlap: &mut Overlap,
        [velocity, force]: [f64; 2],
        span: &Span<'_>,
        tolerance: f64,
    ) -> Option<[f64; 2]> {
        let (at_end, damping) = (overlap.now - span.time * velocity, self.damping(overlap));
        let exact = (self.force(at_end) - damping * velocity).max(0.0);
        if (exact - force).abs() <= tolerance {
            return None;
        }
        let before = self.law.curve().slope(overlap.reference, self.stiffness);
        // A dashpot has a slope of its own, so that no minimum overlap is needed.
        let minimum = if damping > 0.0 { 0.0 } else { MIN_OVERLAP };
        overlap.reference = at_end.max(minimum);
        let slope = self.law.curve().slope(overlap.reference, self.stiffness);
        (slope != before).then(|| self.entry(overlap, span))
    }
}

/// Kind of stage within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StageKind {
    /// An independent stage: of Runge-Kutta, of a single instant, or the first of two under rigid
    /// contacts.
    Single,
    /// The midpoint of a step of rigid contacts, which constrain the gaps at its start.
    Midpoint,
    /// The first of two stages where forces depend on gaps.
    First,
    /// The second of two stages where forces depend on gaps.
    Second,
}

/// The time span over which contact forces are implicit.
#[derive(Debug, Clone, Copy)]
pub struct Span<'s> {
    /// Time span s, in strain.
    pub time: f64,
    /// Kind of the stage.
    pub kind: StageKind,
    /// Disturbance velocities of the first stage, at a later stage that depends on them; else
    /// empty.
    pub first: &'s [f64],
    /// Rate of the flow at that stage over that at the present one; 1 where the rate is imposed.
    pub shear: f64,
    /// Rate of dilation of the cell at that stage; 0 where the volume is imposed.
    pub dilation: f64,
    /// How it dilates.
    pub dilates: PressureKind,
}

impl Span<'_> {
    /// An independent stage.
    pub fn single(time: f64) -> Self {
        Self {
            time,
            kind: StageKind::Single,
            first: &[],
            shear: 1.0,
            dilation: 0.0,
            dilates: PressureKind::Isotropic,
        }
    }

    /// The gap that enters the contact law: the gap of the stage, at the second stage with the
    /// correction for the motion of the first, and at the midpoint the gap at the start of the
    /// step.
    pub(super) fn gap<S: Space>(&self, contact: &Contact<S>, flow: &IncidentFlow<S>) -> f64 {
        let pair = &contact.pair;
        match self.kind {
            StageKind::Single | StageKind::First => pair.gap,
            StageKind::Midpoint => {
                let half = 0.5 * self.time;
                let first = S::by_sphere(self.first);
                let [u_i, u_j] = [pair.i, pair.j].map(|sphere| S::translation(&first[sphere]));
                let separation = match self.dilates {
                    PressureKind::Isotropic => {
                        let grown = 1.0 + self.dilation * half / S::DIMENSIONS as f64;
                        pair.normal * (pair.distance / grown)
                    }
                    PressureKind::Gradient => {
                        let mut separation = pair.normal * pair.distance;
                        separation[1] /= 1.0 + self.dilation * half;
                        separation
                    }
                };
                let drifted = separation - (u_j - u_i) * half;
                let start = flow.advect_backward(&drifted, half * self.shear, [pair.i, pair.j]);
                pair.gap + (S::norm_squared(&start).sqrt() - pair.distance)
            }
            StageKind::Second => pair.gap - self.time * self.twice_first_approach(contact),
        }
    }

    /// 2 v_n1 of a pair at the second stage, 0 at others: what replaces v_n by v_n − 2 v_n1.
    pub(super) fn twice_first_approach<S: Space>(&self, contact: &Contact<S>) -> f64 {
        match self.kind {
            StageKind::Single | StageKind::Midpoint | StageKind::First => 0.0,
            StageKind::Second => {
                let opening = contact.opening(self.dilates);
                let background = contact.background_approach * self.shear;
                let approach = background + contact.normal_row().read(self.first);
                2.0 * (approach + opening * self.dilation)
            }
        }
    }

    /// Whether the overlap of rigid contacts is corrected within one time span, as it is where
    /// other forces depend on gaps.
    fn corrects_overlap_immediately(&self) -> bool {
        matches!(self.kind, StageKind::First | StageKind::Second)
    }
}
