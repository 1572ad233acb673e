//! One run: a layer sheared step by step.

mod drive;
mod frame;
mod sample;
mod sampling;
mod snapshot;
mod stage;

pub use crate::stress::JAM_VISCOSITY;
pub use frame::{Frame, FrameContact};
pub use sample::{Counters, Sample};
pub use sampling::SAMPLE_SPAN;
pub use snapshot::{SNAPSHOT_VERSION, SchemeMemory, Snapshot};

use crate::contact::laws::Laws;
use crate::contact::procedure::ContactList;
use crate::contact::{ContactMemory, ContactState, most_contacts};
use crate::error::Error;
use crate::geometry::cell::Cell;
use crate::geometry::modes::{Background, Vec2};
use crate::geometry::pair::PairKey;
use crate::hydrodynamics::resistance::NearFields;
use crate::law::Halt;
use crate::model::{ContactScheme, DEEPEST_OVERLAP, Params};
use crate::run::start;
use crate::run::steppers::rosenbrock::Rosenbrock;
use crate::run::steppers::{State, Stepper};
use crate::stage::{Method, StageSolver};
use crate::stress::StressWork;
use drive::Drive;
use serde::{Deserialize, Serialize};

/// A layer that stays jammed for this strain ends as jammed.
pub const JAM_STRAIN: f64 = 0.1;
/// How many times a step, and then its halves, may be halved where a gap of rigid contacts falls too low within it.
const MOST_HALVINGS: u32 = 6;
/// A gap counts as too low below this share of the roughness height.
const HELD_SHARE: f64 = 0.5;
/// Whether a run can go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Flow {
    /// The layer flows.
    Flowing,
    /// The layer stayed above [`JAM_VISCOSITY`] for [`JAM_STRAIN`], or flows only by overlaps that its contacts do not admit.
    Jammed,
}

/// What keeps the spheres apart.
enum Scheme {
    /// Laws.
    Laws {
        /// The laws.
        laws: Box<Laws>,
        /// Disturbance velocities `[3N]` of the first stage of a two-stage step.
        first: Vec<f64>,
    },
    /// The paper's steps.
    Procedure,
}

/// A layer under shear.
pub struct Simulation {
    params: Params,
    /// Steps done.
    steps: u64,
    /// Side of the square cell, in a.
    side: f64,
    state: State,
    /// Where the spheres were at the start of the step.
    before: State,
    scheme: Scheme,
    drive: Drive,
    /// The background flow.
    background: Background,
    /// Offset of the cell at strain 0, in a.
    offset: f64,
    /// What contacts remember.
    memory: SchemeMemory,
    counters: Counters,
    stage: StageSolver,
    stepper: Stepper,
    stress: StressWork,
    /// Pairs that the procedure listed before the stage under way was solved.
    listed_before: ContactList,
    /// The frame of the first stage, while one is asked for.
    frame: Option<Box<Frame>>,
    /// Whether the step under way is sampled with a contact problem of its own.
    sampling: bool,
    /// What contacts remembered before the layer was sampled, or where they are soft before the step.
    remembered: ContactMemory,
}

impl Simulation {
    /// Starts a run from the layer that the seed makes.
    ///
    /// # Errors
    /// Parameters out of range, a cell too small, an area fraction that cannot be packed.
    pub fn new(params: &Params, seed: u64, tables: &NearFields) -> Result<Self, Error> {
        params.validate()?;
        let start = start::first_layer(params, seed)?;
        let mut memory = SchemeMemory::new(&params.contact);
        let drive = Drive::new(params, None);
        memory.stretch(&start.springs, drive.laws(params).tangential_stiffness);
        let snapshot = Snapshot {
            version: SNAPSHOT_VERSION,
            steps: 0,
            radii: start.radii,
            side: start.side,
            centres: start.centres.iter().map(|x| [x.x, x.y]).collect(),
            orientations: start.orientations,
            memory,
            near_pairs: Vec::new(),
            critical_load: None,
            counters: Counters::default(),
        };
        Self::from_snapshot(params, snapshot, tables)
    }

    /// Continues a run from a snapshot made with the same parameters.
    ///
    /// # Errors
    /// [`Error::Snapshot`] if it does not fit the parameters.
    pub fn from_snapshot(
        params: &Params,
        mut snapshot: Snapshot,
        tables: &NearFields,
    ) -> Result<Self, Error> {
        params.validate()?;
        snapshot.check(params)?;
        let cell = Cell::periodic(snapshot.side, snapshot.side, 0.0)?;
        let most = most_contacts(params.spheres);
        let method = Method::of(params);
        let mut stage = method.solver(
            params.hydrodynamics,
            &cell,
            &snapshot.radii,
            tables,
            &snapshot.near_pairs,
        )?;
        let mut stepper = Stepper::default();
        let drive = Drive::new(params, snapshot.critical_load);
        let scheme = match &params.contact {
            ContactScheme::Procedure => Scheme::Procedure,
            ContactScheme::Rigid | ContactScheme::Laws(_) => {
                let choice = params.contact.laws();
                if choice.is_soft() {
                    let (gap, deepest) = (choice.lubrication_gap, DEEPEST_OVERLAP);
                    stage.resistance.regularise(gap, deepest);
                    stepper = Stepper::Rosenbrock(Rosenbrock::default());
                }
                Scheme::Laws {
                    laws: Box::new(drive.laws(params)),
                    first: Vec::with_capacity(3 * params.spheres),
                }
            }
        };
        snapshot.memory.reserve(most);
        let mut remembered = ContactMemory::default();
        remembered.reserve(most);
        Ok(Self {
            params: params.clone(),
            steps: snapshot.steps,
            side: snapshot.side,
            state: State {
                centres: snapshot
                    .centres
                    .iter()
                    .map(|&[x, y]| Vec2::new(x, y))
                    .collect(),
                orientations: snapshot.orientations,
            },
            before: State::default(),
            scheme,
            drive,
            background: Background::shear(params.direction),
            offset: match &params.start {
                Some(start) => start.offset,
                None => 0.0,
            },
            memory: snapshot.memory,
            counters: snapshot.counters,
            stage,
            stepper,
            stress: StressWork::default(),
            listed_before: match &params.contact {
                ContactScheme::Procedure => ContactList {
                    pairs: Vec::with_capacity(most),
                },
                ContactScheme::Rigid | ContactScheme::Laws(_) => ContactList::default(),
            },
            frame: None,
            sampling: false,
            remembered,
        })
    }

    /// One step, of RK4 or under soft laws of [`crate::run::steppers::rosenbrock`]; returns the sample taken at its start.
    ///
    /// Near jamming velocities can leap between two stages, so far that a gap falls below h/2 within a step under the
    /// rigid scheme, which holds each stage's own gaps, or that soft spheres overlap by too much to be spheres. Such a step is done again
    /// as two of half the size, down to 2⁻⁶ of it.
    ///
    /// # Errors
    /// [`Error::Step`] with step, strain and cause. The state is that before the step.
    pub fn step(&mut self) -> Result<Sample, Error> {
        self.step_sampled(true)
    }

    /// [`Simulation::step`] that leaves out, unless a sample is `wanted`, the contact problem which a sample of rigid contacts takes. What is
    /// returned then has the forces of the first stage, which hold gaps over the whole step, and its viscosity is a little high. The layer
    /// moves as it would with a sample, to the bit.
    ///
    /// # Errors
    /// As there.
    pub fn step_sampled(&mut self, wanted: bool) -> Result<Sample, Error> {
        self.sampling = wanted;
        self.one_step()
    }

    fn one_step(&mut self) -> Result<Sample, Error> {
        let (time, dt) = (self.strain(), self.params.time_step);
        let mut sample = None;
        let jammed = self.counters.jammed_stages;
        let mut stepper = std::mem::take(&mut self.stepper);
        let mut state = std::mem::take(&mut self.state);
        self.before.copy_from(&state);
        let most = match &self.scheme {
            Scheme::Procedure => 0,
            Scheme::Laws { .. } => MOST_HALVINGS,
        };
        let result = match &stepper {
            Stepper::RungeKutta(_) => {
                self.advance(&mut stepper, &mut state, time, dt, most, &mut sample)
            }
            Stepper::Rosenbrock(_) => self.advance_soft(&mut stepper, &mut state, &mut sample),
        };
        if result.is_err() {
            state.copy_from(&self.before);
        }
        self.stepper = stepper;
        self.state = state;
        if matches!(result, Err(Error::Overlap { .. }))
            && let Some(sample) = sample
            && (self.counters.jammed_stages > jammed || self.is_held())
        {
            // There is no motion that the contacts admit: the layer stays where it is.
            self.counters.jammed_steps_running = self.jam_steps();
            return Ok(sample);
        }
        let failed = |source| Error::Step {
            step: self.steps,
            strain: time,
            source: Box::new(source),
        };
        result.map_err(failed)?;
        let sample = sample.expect("the first stage of a step is sampled");
        self.keep_mean_velocities(dt);
        self.steps += 1;
        let cell = self.cell_at(self.strain())?;
        for x in &mut self.state.centres {
            *x = cell.wrap(*x);
        }
        Ok(sample)
    }

    /// Whether contacts hold the layer: whether loaded ones that do not slide take away as many motions as the spheres have that bear on two
    /// others or more (Maxwell's count). Such a network bears any load, and harder contacts would not let it flow.
    fn is_held(&self) -> bool {
        let Scheme::Laws { laws, .. } = &self.scheme else {
            return false;
        };
        let halted = match laws.tangential.halts() {
            Halt::SlipAndRotation => 2,
            Halt::IsolatedSlip | Halt::SpringSlip | Halt::Slip => 1,
        };
        let contacts = self.stage.contacts.list.iter();
        let loaded = || {
            contacts
                .clone()
                .filter(|contact| contact.normal_force > 0.0)
        };
        let mut partners = vec![0; self.params.spheres];
        for contact in loaded() {
            partners[contact.pair.i] += 1;
            partners[contact.pair.j] += 1;
        }
        let bears = |sphere: usize| partners[sphere] > 1;
        let taken: usize = loaded()
            .filter(|contact| bears(contact.pair.i) && bears(contact.pair.j))
            .map(|contact| match contact.state {
                ContactState::Rolling => 1 + halted,
                ContactState::Frictionless | ContactState::Slipping => 1,
            })
            .sum();
        let spheres = (0..partners.len()).filter(|&sphere| bears(sphere)).count();
        spheres > 0 && taken >= 3 * spheres
    }

    /// Moves the state of a soft layer over one step: in one piece, or where spheres would come to overlap by too much at its end, which only
    /// the next step would find, in two, four and so on.
    fn advance_soft(
        &mut self,
        stepper: &mut Stepper,
        state: &mut State,
        sample: &mut Option<Sample>,
    ) -> Result<(), Error> {
        let (time, dt, drive) = (self.strain(), self.params.time_step, self.drive);
        if let SchemeMemory::Laws(memory) = &self.memory {
            self.remembered.copy_from(memory);
        }
        let mut halvings = 0;
        loop {
            let parts = 1_u32 << halvings;
            let part = dt / f64::from(parts);
            let moved = (0..parts).try_for_each(|k| {
                let start = time + f64::from(k) * part;
                self.advance(
                    stepper,
                    state,
                    start,
                    part,
                    MOST_HALVINGS - halvings,
                    sample,
                )
            });
            let end = self.cell_at(time + dt)?;
            let checked = moved.and_then(|()| {
                let resistance = &self.stage.resistance;
                resistance.check_overlaps(&end, &state.centres)
            });
            if checked.is_ok() {
                return Ok(());
            }
            state.copy_from(&self.before);
            self.drive = drive;
            if let (Scheme::Laws { laws, .. }, SchemeMemory::Laws(memory)) =
                (&mut self.scheme, &mut self.memory)
            {
                **laws = drive.laws(&self.params);
                memory.copy_from(&self.remembered);
            }
            let helps = matches!(checked, Err(Error::Overlap { .. })) && !self.is_held();
            if !helps || halvings == MOST_HALVINGS {
                return checked;
            }
            halvings += 1;
        }
    }

    /// Moves the state over `dt`; where a gap falls too low on the way, in two halves, each halved at most `halvings - 1` times. What then
    /// still fails moves with the velocities of its first stage, whose contact problem holds the gaps at the end of just this motion.
    fn advance(
        &mut self,
        stepper: &mut Stepper,
        state: &mut State,
        time: f64,
        dt: f64,
        halvings: u32,
        sample: &mut Option<Sample>,
    ) -> Result<(), Error> {
        let (mut start_gap, jammed) = (0.0, self.counters.jammed_stages);
        let holds_gaps = matches!(
            (&*stepper, &self.scheme),
            (Stepper::RungeKutta(_), Scheme::Laws { .. })
        );
        let whole = stepper.step(state, time, dt, |stage, centres, velocities| {
            self.stage(stage, centres, velocities, sample)?;
            let Some(pair) = self.stage.closest() else {
                return Ok(());
            };
            if stage.number == 0 {
                start_gap = pair.gap;
            }
            let held = start_gap.min(HELD_SHARE * self.params.roughness);
            if holds_gaps && pair.gap < held {
                return Err(pair.overlap());
            }
            Ok(())
        });
        match whole {
            // Smaller steps do not help where no motion is admitted.
            Err(Error::Overlap { .. })
                if halvings > 0
                    && self.counters.jammed_stages == jammed
                    && (holds_gaps || !self.is_held()) =>
            {
                let half = 0.5 * dt;
                self.advance(stepper, state, time, half, halvings - 1, sample)?;
                self.advance(stepper, state, time + half, half, halvings - 1, sample)
            }
            Err(Error::Overlap { .. }) if holds_gaps => {
                stepper.first_stage_alone(state, time, dt, |stage, centres, velocities| {
                    self.stage(stage, centres, velocities, sample)
                })?;
                // What compliance let through is found now, while the start of the step is known.
                let cell = self.cell_at(time + dt)?;
                self.stage.assemble(&cell, &state.centres)
            }
            whole => whole,
        }
    }

    /// Disturbance velocities of the step as a whole, at its mean positions, which the procedure needs.
    fn keep_mean_velocities(&mut self, dt: f64) {
        let SchemeMemory::Procedure { velocities, .. } = &mut self.memory else {
            return;
        };
        let Stepper::RungeKutta(method) = &self.stepper else {
            return;
        };
        let background = self.background;
        velocities.clear();
        velocities.extend_from_slice(method.mean());
        for (u, x) in velocities.chunks_exact_mut(3).zip(&self.state.centres) {
            // The centre has moved by u dt already; its mean position lies half a step back.
            let flow = background.velocity(x - Vec2::new(u[0], u[1]) * (0.5 * dt));
            u[0] -= flow.x;
            u[1] -= flow.y;
            u[2] -= background.angular_velocity;
        }
    }

    /// The cell at a strain.
    fn cell_at(&self, strain: f64) -> Result<Cell, Error> {
        let travelled = self.params.direction * strain * self.side;
        Cell::periodic(self.side, self.side, self.offset + travelled)
    }

    /// Offset of the upper image cell at a strain, wrapped.
    pub fn offset_at(&self, strain: f64) -> f64 {
        match self.cell_at(strain) {
            Ok(Cell::Periodic { offset, .. }) => offset,
            Ok(Cell::Unbounded) | Err(_) => 0.0,
        }
    }

    /// Whether the layer still flows after the steps done.
    pub fn flow(&self) -> Flow {
        if self.counters.jammed_steps_running >= self.jam_steps() {
            Flow::Jammed
        } else {
            Flow::Flowing
        }
    }

    /// Steps of [`JAM_STRAIN`].
    fn jam_steps(&self) -> u64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "steps are at least 1e-7 of strain"
        )]
        let steps = (JAM_STRAIN / self.params.time_step).ceil() as u64;
        steps
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Strain reached.
    pub fn strain(&self) -> f64 {
        self.steps as f64 * self.params.time_step
    }

    /// Centres, in a, in the cell of the strain reached.
    pub fn centres(&self) -> &[Vec2] {
        &self.state.centres
    }

    /// Orientations, in radians.
    pub fn orientations(&self) -> &[f64] {
        &self.state.orientations
    }

    /// Radii, in a.
    pub fn radii(&self) -> &[f64] {
        self.stage.resistance.radii()
    }

    /// Side of the square cell, in a.
    pub fn side(&self) -> f64 {
        self.side
    }

    /// Counters so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The pairs of the near part's pattern, where the resistance is held pair by pair.
    fn near_pairs(&self) -> Vec<PairKey> {
        let pairwise = self.stage.resistance.pairwise();
        pairwise.map_or_else(Vec::new, |pairwise| pairwise.pattern_pairs().to_vec())
    }

    /// All that the next step needs.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            version: SNAPSHOT_VERSION,
            steps: self.steps,
            radii: self.stage.resistance.radii().to_vec(),
            side: self.side,
            centres: self.state.centres.iter().map(|x| [x.x, x.y]).collect(),
            orientations: self.state.orientations.clone(),
            memory: self.memory.clone(),
            near_pairs: self.near_pairs(),
            critical_load: self.drive.critical_load(),
            counters: self.counters,
        }
    }
}
