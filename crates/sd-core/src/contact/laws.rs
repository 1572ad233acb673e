//! One stage under laws chosen one by one: what presses, what rubs, how friction begins.
//!
//! Contact forces look ahead by the stage's time span s, along the line of centres and along the tangent:
//!
//! ```text
//! f = max(0, F(d − s v_n)),   d = h − g;     linearised, f = A − B v_n:   w = v_n − A/B + f/B ≥ 0,  f ≥ 0,  f·w = 0
//! ```
//!
//! which is the rigid problem with the compliance 1/B on the diagonal of the Delassus matrix; B = ∞ is the rigid one. A spring
//! thus needs no smaller steps than the flow itself. Hertz's law is linearised again until its forces stand still (Newton; its
//! curvature makes that monotonic). At the second stage of a two-stage step v_n − 2 v_n1 stands for v_n in what looks ahead.

use super::rigid::{EXPECTED_APPROACH, MOST_ROUNDS, Memory, RESTITUTION};
use super::stick_slide::Stretch;
use super::{COMPLIANCE, Contact, Contacts, Quality, Surface, hertz, linear_spring};
use crate::geometry::modes::Background;
use crate::hydrodynamics::resistance::Resistance;
use crate::params::FrictionOnset;

/// Overlap at which an unloaded Hertzian contact is first linearised, in a.
const FIRST_OVERLAP: f64 = 1e-6;
/// Smallest overlap at which one is linearised: nothing to the forces, but more than nothing to the slope.
const LEAST_OVERLAP: f64 = 1e-13;
/// Linearisations of Hertz's law.
const MOST_LINEARISATIONS: u32 = 40;
/// Distance of a force from its law, over the largest force or 1, at which linearisations end.
const LINEARISED: f64 = 1e-10;

/// What presses two spheres apart, in the units of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Normal {
    /// Gaps held at h, see [`super::rigid`].
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

/// What resists sliding, in the units of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tangential {
    /// See [`super::friction`].
    RollSlip,
    /// See [`super::stick_slide`].
    StickSlide {
        /// k_t, in mu·a·rate.
        stiffness: f64,
    },
    /// See [`super::coulomb`].
    Coulomb,
    /// See [`super::stick_rotate`].
    StickRotate,
}

/// Chosen laws, in the units of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Laws {
    /// Roughness, friction, critical load.
    pub surface: Surface,
    /// What presses.
    pub normal: Normal,
    /// What rubs.
    pub tangential: Tangential,
    /// How friction begins.
    pub onset: FrictionOnset,
    /// Repulsion besides.
    pub repulsion: Option<super::repulsion::Repulsion>,
}

impl Laws {
    /// Whether forces depend on gaps: steps are then those of [`crate::run::steppers::rosenbrock`].
    pub fn is_soft(&self) -> bool {
        !matches!(self.normal, Normal::Rigid) || self.repulsion.is_some()
    }

    /// Load that is taken off before friction.
    pub(super) fn offset(&self) -> f64 {
        match self.onset {
            FrictionOnset::CriticalLoad => 0.0,
            FrictionOnset::Reduced => self.surface.critical_load,
        }
    }
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

    /// Overlap about which a contact is first linearised: `overlap` its own, `force` that of the stage before.
    fn reference(&self, overlap: f64, force: f64) -> f64 {
        match *self {
            Self::Hertz { stiffness, .. } => overlap
                .max(hertz::overlap(force, stiffness))
                .max(FIRST_OVERLAP),
            _ => overlap,
        }
    }

    /// Bias and compliance of `w = v_n + bias + compliance f`, linearised about an overlap.
    ///
    /// `overlap`: d of the stage, that of the first stage's motion taken back; `touching`: g < h; `held`: whether a rigid overlap is
    /// taken back at once.
    fn line(
        &self,
        overlap: f64,
        reference: f64,
        time: f64,
        touching: bool,
        held: bool,
    ) -> [f64; 2] {
        let (intercept, slope, dashpot) = match *self {
            Self::Rigid | Self::None => {
                let share = if overlap > 0.0 && !held {
                    RESTITUTION
                } else {
                    1.0
                };
                return [-share * overlap / time, 0.0];
            }
            Self::LinearSpring { stiffness, dashpot } => (stiffness * overlap, stiffness, dashpot),
            Self::Hertz { stiffness, dashpot } => {
                let slope = hertz::slope(reference, stiffness);
                let force = hertz::force(reference, stiffness);
                (force + slope * (overlap - reference), slope, dashpot)
            }
        };
        let slope = slope * time + if touching { dashpot } else { 0.0 };
        [-intercept / slope, slope.recip()]
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
    /// Disturbance velocities `[3N]` of the first stage.
    pub first: &'s [f64],
}

impl Span<'_> {
    /// 2 v_n1 of a pair at the second stage, 0 at others.
    pub(super) fn taken_back(&self, contact: &Contact) -> f64 {
        match self.phase {
            Phase::Alone | Phase::First => 0.0,
            Phase::Second => 2.0 * (contact.background[0] + contact.normal_row(self.first)),
        }
    }
}

/// What contacts remember from stage to stage, besides what [`Memory`] holds.
///
/// Between steps [`Memory`] is all there is: the normal force, and the tangential one or, under
/// [`Tangential::StickSlide`], the force of the tangential spring.
#[derive(Debug, Clone, Default)]
pub struct History {
    /// Disturbance velocities `[3N]` of the first stage.
    pub motion: Vec<f64>,
    /// Tangential springs under way, ordered by (i, j).
    stretches: Vec<(u32, u32, Stretch)>,
}

impl History {
    /// Room for that many contacts.
    pub fn new(contacts: usize, spheres: usize) -> Self {
        Self {
            motion: Vec::with_capacity(3 * spheres),
            stretches: Vec::with_capacity(contacts),
        }
    }

    /// The spring of a pair, unstretched if it had none.
    pub(super) fn stretch(&self, i: usize, j: usize) -> Stretch {
        let key = |entry: &(u32, u32, Stretch)| (entry.0 as usize, entry.1 as usize);
        self.stretches
            .binary_search_by_key(&(i, j), key)
            .map_or_else(|_| Stretch::default(), |at| self.stretches[at].2)
    }
}

/// Workspace of the laws, one entry per candidate.
#[derive(Default)]
pub(super) struct Workspace {
    /// Overlap about which each contact is linearised.
    reference: Vec<f64>,
    /// Overlap of each contact with what the first stage's motion takes back.
    overlap: Vec<f64>,
    /// Compliance on the diagonal of the Delassus matrix.
    compliance: Vec<f64>,
    /// Cone problem.
    pub(super) cone: super::coulomb::Workspace,
}

impl Workspace {
    /// Room for that many candidates.
    pub(super) fn new(candidates: usize) -> Self {
        Self {
            reference: Vec::with_capacity(candidates),
            overlap: Vec::with_capacity(candidates),
            compliance: Vec::with_capacity(candidates),
            cone: super::coulomb::Workspace::new(candidates),
        }
    }
}

/// What a stage is solved with.
#[derive(Clone, Copy)]
pub(super) struct Setting<'s> {
    /// Hydrodynamics.
    pub(super) resistance: &'s Resistance,
    /// Laws.
    pub(super) laws: &'s Laws,
    /// Time ahead.
    pub(super) span: Span<'s>,
}

impl Contacts {
    /// Solves one stage. Velocities `[3N]` are the disturbances; forces `[3N]` all but contact's.
    #[expect(
        clippy::too_many_arguments,
        reason = "what drives the spheres, what holds them apart, what comes out"
    )]
    pub fn solve_laws(
        &mut self,
        resistance: &Resistance,
        background: &Background,
        laws: &Laws,
        (time, phase): (f64, Phase),
        forces: &[f64],
        memory: &mut Memory,
        history: &mut History,
        velocities: &mut [f64],
    ) -> Quality {
        let first = std::mem::take(&mut history.motion);
        let setting = Setting {
            resistance,
            laws,
            span: Span {
                time,
                phase,
                first: &first,
            },
        };
        let quality = self.solve_setting(setting, background, forces, memory, history, velocities);
        history.motion = first;
        match phase {
            Phase::Alone => memory.store(self),
            Phase::First | Phase::Second => self.keep_stretches(laws, phase, memory, history),
        }
        if phase == Phase::First {
            history.motion.clear();
            history.motion.extend_from_slice(velocities);
        }
        quality
    }

    /// Rounds of solving and of adding pairs that turned out to close after all.
    fn solve_setting(
        &mut self,
        setting: Setting<'_>,
        background: &Background,
        forces: &[f64],
        memory: &Memory,
        history: &History,
        velocities: &mut [f64],
    ) -> Quality {
        let Setting {
            resistance,
            laws,
            span,
        } = setting;
        let radii = resistance.radii();
        let touching = laws.normal != Normal::None;
        // How much nearer than h the pair would be if it stood still.
        let short = |contact: &Contact| {
            contact.pair.gap - span.time * span.taken_back(contact) - laws.surface.roughness
        };
        // Where to start: the forces of the stage before.
        let remembered = |mut contact: Contact| {
            let (i, j) = (contact.pair.i, contact.pair.j);
            (contact.normal_force, contact.tangential_force) = memory.forces(i, j);
            if span.phase == Phase::Second
                && matches!(laws.tangential, Tangential::StickSlide { .. })
            {
                contact.tangential_force = history.stretch(i, j).first;
            }
            contact
        };
        self.list.clear();
        for pair in resistance.neighbours().iter().filter(|_| touching) {
            let contact = Contact::new(*pair, radii, background);
            if short(&contact) < EXPECTED_APPROACH * span.time {
                self.list.push(remembered(contact));
            }
        }
        let mut worst = Quality::default();
        for _ in 0..MOST_ROUNDS {
            let quality = self.solve_linearised(setting, forces, memory, history);
            worst.residual = quality.residual;
            worst.friction_error = quality.friction_error;
            worst.passes += quality.passes;
            self.finish_laws(resistance, velocities);
            let before = self.list.len();
            for pair in resistance.neighbours().iter().filter(|_| touching) {
                let contact = Contact::new(*pair, radii, background);
                let approach = contact.background[0] + contact.normal_row(velocities);
                if short(&contact) + span.time * approach >= 0.0 {
                    continue;
                }
                let key = (pair.i, pair.j);
                let known =
                    self.list[..before].binary_search_by_key(&key, |c| (c.pair.i, c.pair.j));
                if known.is_err() {
                    self.list.push(remembered(contact));
                }
            }
            if self.list.len() == before {
                return worst;
            }
            self.list.sort_unstable_by_key(|c| (c.pair.i, c.pair.j));
        }
        // Still closing pairs: report by how much.
        for c in &self.list {
            if c.normal_force == 0.0 {
                let missed = short(c) / span.time + c.normal_velocity;
                worst.residual = worst.residual.max(-missed);
            }
        }
        worst
    }

    /// Forces of the candidates at hand, put into `list`; a curved law is linearised until its forces stand still.
    fn solve_linearised(
        &mut self,
        setting: Setting<'_>,
        forces: &[f64],
        memory: &Memory,
        history: &History,
    ) -> Quality {
        let Setting {
            resistance,
            laws,
            span,
        } = setting;
        self.reduce_normal(resistance, forces);
        let work = &mut self.laws;
        work.reference.clear();
        work.overlap.clear();
        work.compliance.clear();
        for contact in &self.list {
            let gap = contact.pair.gap - span.time * span.taken_back(contact);
            let overlap = laws.surface.roughness - gap;
            work.overlap.push(overlap);
            work.reference
                .push(laws.normal.reference(overlap, contact.normal_force));
            work.compliance.push(0.0);
        }
        let curved = matches!(laws.normal, Normal::Hertz { .. });
        let mut worst = Quality::default();
        for linearisation in 0..if curved { MOST_LINEARISATIONS } else { 1 } {
            self.linearise(laws, span);
            let quality = if linearisation == 0 {
                self.solve_line(setting, memory, history)
            } else {
                self.solve_line_again(setting, memory, history)
            };
            worst = Quality {
                passes: worst.passes + quality.passes,
                ..quality
            };
            if curved {
                let error = self.curvature_error(laws, span.time);
                if error <= LINEARISED {
                    break;
                }
                if linearisation + 1 == MOST_LINEARISATIONS {
                    worst.friction_error = worst.friction_error.max(error);
                }
            }
        }
        worst
    }

    /// Puts bias and compliance of every candidate where they belong.
    fn linearise(&mut self, laws: &Laws, span: Span<'_>) {
        self.friction.bias.clear();
        self.friction.offset = laws.offset();
        let held = span.phase != Phase::Alone;
        // What the solver of the normal problem adds by itself; springs have their own.
        let networks = match (laws.normal, laws.tangential) {
            (Normal::Rigid, tangential) if tangential != Tangential::RollSlip => COMPLIANCE,
            _ => 0.0,
        };
        for (k, contact) in self.list.iter().enumerate() {
            let touching = contact.pair.gap < laws.surface.roughness;
            let (overlap, reference) = (self.laws.overlap[k], self.laws.reference[k]);
            let mut line = laws
                .normal
                .line(overlap, reference, span.time, touching, held);
            line[1] += networks;
            self.friction.bias.push(line[0]);
            self.g_nn[(k, k)] += line[1] - self.laws.compliance[k];
            self.laws.compliance[k] = line[1];
        }
    }

    /// Largest distance of a force from its law, over the largest force; contacts are linearised anew about where they are now.
    fn curvature_error(&mut self, laws: &Laws, time: f64) -> f64 {
        let Normal::Hertz { stiffness, dashpot } = laws.normal else {
            return 0.0;
        };
        let (mut largest, mut error) = (1.0_f64, 0.0_f64);
        let work = &mut self.laws;
        let slack = work.cone.slack().unwrap_or_else(|| self.normal.slack());
        for (k, contact) in self.list.iter().enumerate() {
            let f = contact.normal_force;
            let velocity = slack[k] - self.friction.bias[k] - work.compliance[k] * f;
            let ahead = work.overlap[k] - time * velocity;
            let touching = contact.pair.gap < laws.surface.roughness;
            let damping = if touching { dashpot } else { 0.0 };
            let exact = hertz::force(ahead, stiffness) - damping * velocity;
            error = error.max((exact.max(0.0) - f).abs());
            largest = largest.max(f);
            // A dashpot has a slope of its own, beside which the least one is not nothing.
            let least = if damping > 0.0 { 0.0 } else { LEAST_OVERLAP };
            work.reference[k] = ahead.max(least);
        }
        error / largest
    }

    /// Solves what has been linearised for the first time in this stage.
    fn solve_line(&mut self, setting: Setting<'_>, memory: &Memory, history: &History) -> Quality {
        let started = self
            .list
            .iter()
            .zip(self.free_normal.iter().zip(self.friction.bias.iter()))
            .map(|(c, (v, b))| c.normal_force > 0.0 || v + b < 0.0);
        self.normal.start(started);
        self.solve_line_again(setting, memory, history)
    }

    /// Solves what has been linearised, from the normal support at hand.
    fn solve_line_again(
        &mut self,
        setting: Setting<'_>,
        memory: &Memory,
        history: &History,
    ) -> Quality {
        let surface = &setting.laws.surface;
        self.normal.changed();
        self.solve_frictionless();
        self.laws.cone.clear();
        let load = surface.critical_load;
        self.frictional.clear();
        let loaded = |f: f64| f > load;
        let any = self.normal_forces.iter().any(|&f| loaded(f))
            || self.list.iter().any(|c| loaded(c.normal_force));
        if surface.has_friction() && any {
            let now =
                |k: &usize| loaded(self.normal_forces[*k]) || loaded(self.list[*k].normal_force);
            self.frictional.extend((0..self.list.len()).filter(now));
            return match setting.laws.tangential {
                Tangential::RollSlip => self.solve_roll_slip(setting.resistance, surface),
                _ => self.solve_cone(setting, memory, history),
            };
        }
        self.take_frictionless()
    }

    /// Keeps the tangential springs, or the forces where the next stage starts.
    fn keep_stretches(
        &self,
        laws: &Laws,
        phase: Phase,
        memory: &mut Memory,
        history: &mut History,
    ) {
        if !matches!(laws.tangential, Tangential::StickSlide { .. }) {
            memory.store(self);
            return;
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "sphere numbers fit 32 bits"
        )]
        let key = |c: &Contact| (c.pair.i as u32, c.pair.j as u32);
        if phase == Phase::First {
            history.stretches.clear();
            for c in &self.list {
                let (_, start) = memory.forces(c.pair.i, c.pair.j);
                let first = c.tangential_force;
                if start != 0.0 || first != 0.0 {
                    let (i, j) = key(c);
                    history.stretches.push((i, j, Stretch { start, first }));
                }
            }
            return;
        }
        memory.forces.clear();
        for c in self.list.iter().filter(|c| c.normal_force > 0.0) {
            let stretch = history.stretch(c.pair.i, c.pair.j);
            let (i, j) = key(c);
            memory
                .forces
                .push((i, j, c.normal_force, stretch.end(c.tangential_force)));
        }
    }
}
