//! One run: a layer sheared step by step.

mod frame;
mod sample;
mod snapshot;

pub use frame::{Frame, FrameContact};
pub use sample::{Counters, JAM_VISCOSITY, Sample};
pub use snapshot::{SNAPSHOT_VERSION, Snapshot};

use crate::contact::laws::{History, Laws, Phase};
use crate::contact::procedure::ContactList;
use crate::contact::rigid::Memory;
use crate::contact::{Surface, most_contacts};
use crate::error::Error;
use crate::geometry::cell::Cell;
use crate::geometry::modes::{Background, Vec2};
use crate::geometry::pair::PairKey;
use crate::hydrodynamics::iterative::IterativeFarField;
use crate::hydrodynamics::resistance::{NearFields, Resistance};
use crate::motion::{ContactLaw, Motion};
use crate::params::{ContactScheme, DEEPEST_OVERLAP, Hydrodynamics, Params};
use crate::run::start;
use crate::run::steppers::rosenbrock::Rosenbrock;
use crate::run::steppers::{Stage, State, Stepper};
use crate::stress::{ContactCounts, StressWork};
use serde::{Deserialize, Serialize};

/// A layer that stays jammed for this strain ends as jammed.
pub const JAM_STRAIN: f64 = 0.1;
/// How many times a step, and then its halves, may be halved where a gap of rigid contacts falls too low within it.
const MOST_HALVINGS: u32 = 6;
/// A gap counts as too low below this share of the roughness height.
const HELD_SHARE: f64 = 0.5;
/// Memory of a [`Simulation`], in bytes, from above (near jamming): its matrices, and a few kilobytes per sphere.
///
/// ```text
/// Ball-Melrose: R_FU (3N)², columns of the contacts 2 × 3N × K, their products 3 K², with K ≈ 1.5 N candidates
/// Stokesian Dynamics: besides, M (6N)² and two more matrices (3N)²
/// pair by pair: two sparse factors and their pattern, 16 kB per sphere; an iterated far field 32 kB more
/// ```
pub fn memory_bytes(params: &Params) -> f64 {
    let n = params.spheres as f64;
    if is_pairwise(params) {
        return match params.hydrodynamics {
            Hydrodynamics::BallMelrose => 16384.0 * n,
            Hydrodynamics::StokesianDynamics => 49152.0 * n,
        };
    }
    let near = 9.0 + 9.0 + 6.75;
    let far = match params.hydrodynamics {
        Hydrodynamics::BallMelrose => 0.0,
        Hydrodynamics::StokesianDynamics => 36.0 + 2.0 * 9.0,
    };
    8.0 * (near + far) * n * n + 8192.0 * n
}

/// Spheres from which on the resistance of a layer of rigid contacts is held pair by pair under Ball-Melrose hydrodynamics, where
/// that costs less.
pub const LEAST_PAIRWISE: usize = 250;
/// The least number of spheres under Stokesian Dynamics, where the far field is then iterated.
pub const LEAST_ITERATED: usize = 800;

/// Whether runs with these parameters hold the resistance pair by pair, as a
/// [`PairwiseResistance`](crate::hydrodynamics::resistance::PairwiseResistance).
pub fn is_pairwise(params: &Params) -> bool {
    let least = match params.hydrodynamics {
        Hydrodynamics::BallMelrose => LEAST_PAIRWISE,
        Hydrodynamics::StokesianDynamics => LEAST_ITERATED,
    };
    params.contact == ContactScheme::Rigid && params.spheres >= least
}

/// Whether a run can go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Flow {
    /// The layer flows.
    Flowing,
    /// The layer stayed above [`JAM_VISCOSITY`] for [`JAM_STRAIN`].
    Jammed,
}

/// Laws chosen one by one, with what they need within a step.
struct Chosen {
    laws: Laws,
    /// What the stages of a step tell each other.
    history: History,
}

/// A layer under shear.
pub struct Simulation {
    params: Params,
    surface: Surface,
    steps: u64,
    /// Side of the square cell, in a.
    side: f64,
    state: State,
    /// Where the spheres were at the start of the step.
    before: State,
    /// Mean disturbance velocities of the last step, where the procedure needs them.
    velocities: Vec<f64>,
    /// Forces of the last stage, under all schemes but the procedure.
    memory: Memory,
    /// Laws, where they are chosen one by one.
    chosen: Option<Box<Chosen>>,
    /// Contact list of the procedure.
    listed: ContactList,
    counters: Counters,
    motion: Motion,
    stepper: Stepper,
    stress: StressWork,
    /// The frame of the first stage, while one is asked for.
    frame: Option<Box<Frame>>,
}

impl Simulation {
    /// Starts a run from the layer that the seed makes.
    ///
    /// # Errors
    /// Parameters out of range, a cell too small, an area fraction that cannot be packed.
    pub fn new(params: &Params, seed: u64, tables: &NearFields) -> Result<Self, Error> {
        params.validate()?;
        let start = start::layer(params, seed)?;
        let n = start.radii.len();
        let snapshot = Snapshot {
            version: SNAPSHOT_VERSION,
            steps: 0,
            radii: start.radii,
            side: start.side,
            centres: start.centres.iter().map(|x| [x.x, x.y]).collect(),
            orientations: vec![0.0; n],
            velocities: Vec::new(),
            memory: Memory::default(),
            listed: ContactList::default(),
            near_pairs: Vec::new(),
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
        let mut resistance = if is_pairwise(params) {
            Resistance::new_pairwise(&cell, &snapshot.radii, tables, &snapshot.near_pairs)?
        } else {
            Resistance::new(params.hydrodynamics, &cell, &snapshot.radii, tables)?
        };
        let most = most_contacts(params.spheres);
        let mut stepper = Stepper::default();
        let chosen = match &params.contact {
            ContactScheme::Rigid | ContactScheme::Procedure => None,
            ContactScheme::Laws(laws) => {
                if laws.is_soft() {
                    resistance.regularise(laws.lubrication_gap, DEEPEST_OVERLAP);
                    stepper = Stepper::Rosenbrock(Rosenbrock::default());
                }
                Some(Box::new(Chosen {
                    laws: laws.in_solver_units(params.surface()),
                    history: History::new(most, params.spheres),
                }))
            }
        };
        let motion =
            if is_pairwise(params) && params.hydrodynamics == Hydrodynamics::StokesianDynamics {
                let far = IterativeFarField::new(
                    &cell,
                    &snapshot.radii,
                    IterativeFarField::DEFAULT_RESIDUAL,
                )?;
                Motion::with_far_field(resistance, far)
            } else {
                Motion::new(resistance)
            };
        snapshot.memory.forces.reserve(most);
        snapshot.listed.pairs.reserve(most);
        Ok(Self {
            params: params.clone(),
            surface: params.surface(),
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
            velocities: snapshot.velocities,
            memory: snapshot.memory,
            chosen,
            listed: snapshot.listed,
            counters: snapshot.counters,
            motion,
            stepper,
            stress: StressWork::default(),
            frame: None,
        })
    }

    /// One step, of RK4 or under soft laws of [`crate::run::steppers::rosenbrock`]; returns the sample taken at its start.
    ///
    /// Near jamming velocities can leap between two stages, so far that a gap falls below h/2 within a step under the
    /// rigid scheme, which holds each stage's own gaps. Such a step is done again as two of half the size, down to 2⁻⁶ of it.
    ///
    /// # Errors
    /// [`Error::Step`] with step, strain and cause. The state is that before the step.
    #[expect(
        clippy::missing_panics_doc,
        reason = "the first stage of every step that succeeds is sampled"
    )]
    pub fn step(&mut self) -> Result<Sample, Error> {
        let (time, dt) = (self.strain(), self.params.time_step);
        let mut sample = None;
        let mut stepper = std::mem::take(&mut self.stepper);
        let mut state = std::mem::take(&mut self.state);
        self.before.copy_from(&state);
        let most = match (&stepper, self.params.contact) {
            (Stepper::Rosenbrock(_), _) | (_, ContactScheme::Procedure) => 0,
            (Stepper::RungeKutta(_), _) => MOST_HALVINGS,
        };
        let result = self.advance(&mut stepper, &mut state, time, dt, most, &mut sample);
        if result.is_err() {
            state.copy_from(&self.before);
        }
        self.stepper = stepper;
        self.state = state;
        let failed = |source| Error::Step {
            step: self.steps,
            strain: time,
            source: Box::new(source),
        };
        result.map_err(failed)?;
        let sample = sample.expect("the first stage of a step is sampled");
        if self.params.contact == ContactScheme::Procedure {
            self.keep_mean_velocities(dt);
        }
        self.steps += 1;
        let cell = self.cell_at(self.strain())?;
        for x in &mut self.state.centres {
            *x = cell.wrap(*x);
        }
        Ok(sample)
    }

    /// Moves the state over `dt`; where a gap falls too low on the way, in two halves, each halved at most `halvings - 1` times.
    fn advance(
        &mut self,
        stepper: &mut Stepper,
        state: &mut State,
        time: f64,
        dt: f64,
        halvings: u32,
        sample: &mut Option<Sample>,
    ) -> Result<(), Error> {
        let mut start_gap = 0.0;
        let whole = stepper.step(state, time, dt, |stage, centres, velocities| {
            self.stage(stage, centres, velocities, sample)?;
            let Some(pair) = self.motion.closest() else {
                return Ok(());
            };
            if stage.number == 0 {
                start_gap = pair.gap;
            }
            let held = start_gap.min(HELD_SHARE * self.surface.roughness);
            if halvings > 0 && pair.gap < held {
                return Err(pair.overlap());
            }
            Ok(())
        });
        match whole {
            Err(Error::Overlap { .. }) if halvings > 0 => {
                let half = 0.5 * dt;
                self.advance(stepper, state, time, half, halvings - 1, sample)?;
                self.advance(stepper, state, time + half, half, halvings - 1, sample)
            }
            whole => whole,
        }
    }

    /// One right-hand side; the first of a step is the one that is sampled.
    fn stage(
        &mut self,
        stage: Stage,
        centres: &[Vec2],
        velocities: &mut [f64],
        sample: &mut Option<Sample>,
    ) -> Result<(), Error> {
        let background = Background::SHEAR;
        let cell = self.cell_at(stage.time)?;
        let motion = &mut self.motion;
        let surface = self.surface;
        if stage.number == 0 {
            // A run that is resumed here then has the same bits.
            motion.forget();
        }
        let repels = |chosen: &Chosen| chosen.laws.repulsion.is_some();
        if self.chosen.as_deref().is_some_and(repels) {
            // The repulsion adds to the matrix before it is factored.
            motion.assemble(&cell, centres)?;
        } else {
            motion.update(&cell, centres)?;
        }
        let law = match self.params.contact {
            ContactScheme::Rigid => ContactLaw::Rigid {
                surface,
                time_span: stage.span,
                memory: &mut self.memory,
            },
            ContactScheme::Procedure => {
                if stage.number == 0 && !self.velocities.is_empty() {
                    self.listed.add_approaching(
                        &motion.resistance,
                        &background,
                        surface.roughness,
                        &self.velocities,
                    );
                }
                ContactLaw::Procedure {
                    surface,
                    listed: &mut self.listed,
                }
            }
            ContactScheme::Laws(_) => match &mut self.chosen {
                None => ContactLaw::None,
                Some(chosen) => ContactLaw::Laws {
                    span: (
                        stage.span,
                        match (chosen.laws.is_soft(), stage.number) {
                            (false, _) => Phase::Alone,
                            (true, 0) => Phase::First,
                            (true, _) => Phase::Second,
                        },
                    ),
                    laws: &chosen.laws,
                    memory: &mut self.memory,
                    history: &mut chosen.history,
                },
            },
        };
        let quality = motion.solve_again(&background, &[], law)?;
        let minimum_gap = motion.closest().map_or(f64::INFINITY, |pair| pair.gap);
        let counters = &mut self.counters;
        counters.stages += 1;
        counters.unconverged_stages += u64::from(!quality.converged());
        counters.worst_residual = counters.worst_residual.max(quality.residual);
        counters.worst_friction_error = counters.worst_friction_error.max(quality.friction_error);
        if stage.number == 0 && sample.is_none() {
            counters.minimum_gap = counters.minimum_gap.min(minimum_gap);
            let stress = self
                .stress
                .stress(motion, &background, self.side * self.side);
            counters.count_jam(stress.viscosity);
            if let Some(frame) = &mut self.frame {
                frame.solved(&self.stress.stresslets, &motion.contacts.list);
            }
            let counts = ContactCounts::of(&motion.contacts.list);
            *sample = Some(Sample {
                strain: stage.time,
                viscosity: stress.viscosity,
                viscosity_stresslet: stress.viscosity_stresslet,
                normal_stress_difference: stress.normal_stress_difference,
                dissipation: stress.dissipation,
                contacts: counts.contacts,
                activated: counts.activated,
                rolling: counts.rolling,
                slipping: counts.slipping,
                normal_velocity: counts.normal_velocity,
                minimum_gap,
                counters: *counters,
            });
        }
        for ((u, v), &x) in velocities
            .chunks_exact_mut(3)
            .zip(motion.velocities().chunks_exact(3))
            .zip(centres)
        {
            let flow = background.velocity(x);
            u[0] = v[0] + flow.x;
            u[1] = v[1] + flow.y;
            u[2] = v[2] + background.angular_velocity;
        }
        Ok(())
    }

    /// Disturbance velocities of the step as a whole, at its mean positions.
    fn keep_mean_velocities(&mut self, dt: f64) {
        let Stepper::RungeKutta(method) = &self.stepper else {
            return;
        };
        let background = Background::SHEAR;
        self.velocities.clear();
        self.velocities.extend_from_slice(method.mean());
        for (u, x) in self.velocities.chunks_exact_mut(3).zip(&self.state.centres) {
            // The centre has moved by u dt already; its mean position lies half a step back.
            let flow = background.velocity(x - Vec2::new(u[0], u[1]) * (0.5 * dt));
            u[0] -= flow.x;
            u[1] -= flow.y;
            u[2] -= background.angular_velocity;
        }
    }

    /// The cell at a strain.
    fn cell_at(&self, strain: f64) -> Result<Cell, Error> {
        Cell::periodic(self.side, self.side, strain * self.side)
    }

    /// Whether the layer still flows after the steps done.
    pub fn flow(&self) -> Flow {
        if self.counters.jammed_steps_running as f64 * self.params.time_step >= JAM_STRAIN {
            Flow::Jammed
        } else {
            Flow::Flowing
        }
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Strain reached.
    pub fn strain(&self) -> f64 {
        self.steps as f64 * self.params.time_step
    }

    /// Counters so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The pairs of the near part's pattern, where the resistance is held pair by pair.
    fn near_pairs(&self) -> Vec<PairKey> {
        let pairwise = self.motion.resistance.pairwise();
        pairwise.map_or_else(Vec::new, |pairwise| pairwise.pattern_pairs().to_vec())
    }

    /// All that the next step needs.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            version: SNAPSHOT_VERSION,
            steps: self.steps,
            radii: self.motion.resistance.radii().to_vec(),
            side: self.side,
            centres: self.state.centres.iter().map(|x| [x.x, x.y]).collect(),
            orientations: self.state.orientations.clone(),
            velocities: self.velocities.clone(),
            memory: self.memory.clone(),
            listed: self.listed.clone(),
            near_pairs: self.near_pairs(),
            counters: self.counters,
        }
    }
}
