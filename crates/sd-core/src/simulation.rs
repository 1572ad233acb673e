//! One run: a layer sheared step by step.

mod frame;

pub use frame::{Frame, FrameContact};

use crate::cell::Cell;
use crate::contact::procedure::ContactList;
use crate::contact::rigid::Memory;
use crate::contact::{Surface, most_contacts};
use crate::error::Error;
use crate::integrate::{RungeKutta, Stage, State};
use crate::modes::{Background, Vec2};
use crate::motion::{ContactLaw, Motion};
use crate::params::{ContactScheme, Hydrodynamics, Params};
use crate::resistance::{NearFields, Resistance};
use crate::start;
use crate::stress::{ContactCounts, Stress, StressWork};
use serde::{Deserialize, Serialize};

/// Relative viscosity above which the layer counts as jammed for the moment.
pub const JAM_VISCOSITY: f64 = 1e4;
/// A layer that stays jammed for this strain ends as jammed.
pub const JAM_STRAIN: f64 = 0.1;
/// Times a step is halved, and its halves again, where a gap of rigid contacts falls too low within it.
const MOST_HALVINGS: u32 = 6;
/// What counts as too low: this share of the roughness height.
const HELD_SHARE: f64 = 0.5;
/// Version of [`Snapshot`].
pub const SNAPSHOT_VERSION: u32 = 1;

/// Memory of a [`Simulation`], in bytes, from above (near jamming): its matrices, and a few kilobytes per sphere.
///
/// ```text
/// Ball-Melrose: R_FU (3N)², columns of the contacts 2 × 3N × K, their products 3 K², with K ≈ 1.5 N candidates
/// Stokesian Dynamics: besides, M (6N)² and two more matrices (3N)²
/// ```
pub fn memory_bytes(params: &Params) -> f64 {
    let n = params.spheres as f64;
    let near = 9.0 + 9.0 + 6.75;
    let far = match params.hydrodynamics {
        Hydrodynamics::BallMelrose => 0.0,
        Hydrodynamics::StokesianDynamics => 36.0 + 2.0 * 9.0,
    };
    8.0 * (near + far) * n * n + 8192.0 * n
}

/// What is measured at the first stage of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Strain at which it was taken.
    pub strain: f64,
    /// Relative viscosity in full: stresslets and contact stress.
    pub viscosity: f64,
    /// Relative viscosity from the stresslets alone, eq. (20) of the paper to the letter.
    pub viscosity_stresslet: f64,
    /// First normal stress difference `N1 = σ_xx − σ_yy`, contacts included, in mu·rate.
    pub normal_stress_difference: f64,
    /// v'Rv / (V rate), in mu·rate.
    pub dissipation: f64,
    /// Pairs with a normal contact force.
    pub contacts: u32,
    /// Of these, pairs whose force exceeds the critical load.
    pub activated: u32,
    /// Of the activated, pairs that roll.
    pub rolling: u32,
    /// Of the activated, pairs that slip.
    pub slipping: u32,
    /// Mean normal velocity over the contacts, negative for approach, in a·rate; 0 without contacts.
    pub normal_velocity: f64,
    /// Smallest gap in the layer, in a; infinite if no pair is in lubrication range.
    pub minimum_gap: f64,
    /// What the run has met so far, this stage included.
    pub counters: Counters,
}

/// What a run has met since its start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Counters {
    /// Contact problems solved: four per step, and those of steps done again in halves (see [`Simulation::step`]).
    pub stages: u64,
    /// Of these, problems that did not converge.
    pub unconverged_stages: u64,
    /// Largest residual of the normal contact problem, in a·rate.
    pub worst_residual: f64,
    /// Largest inconsistency of a friction force with its law, over the largest force of its stage.
    pub worst_friction_error: f64,
    /// Smallest gap at the start of any step, in a. (Stages within a step are no states of the layer.)
    pub minimum_gap: f64,
    /// Times the viscosity rose above [`JAM_VISCOSITY`].
    pub jam_events: u64,
    /// Steps begun above it.
    pub jammed_steps: u64,
    /// Steps since it was last below.
    pub jammed_steps_running: u64,
}

impl Default for Counters {
    fn default() -> Self {
        Self {
            stages: 0,
            unconverged_stages: 0,
            worst_residual: 0.0,
            worst_friction_error: 0.0,
            minimum_gap: f64::INFINITY,
            jam_events: 0,
            jammed_steps: 0,
            jammed_steps_running: 0,
        }
    }
}

/// Whether a run can go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Flow {
    /// The layer flows.
    Flowing,
    /// The layer stayed above [`JAM_VISCOSITY`] for [`JAM_STRAIN`].
    Jammed,
}

/// All that the next step needs. Restored with the same parameters, a run goes on with the same bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Snapshot {
    /// [`SNAPSHOT_VERSION`].
    pub version: u32,
    /// Steps done; strain = steps × time step.
    pub steps: u64,
    /// Radii, in a.
    pub radii: Vec<f64>,
    /// Side of the square cell, in a.
    pub side: f64,
    /// Centres, in a.
    pub centres: Vec<[f64; 2]>,
    /// Orientations, in radians.
    pub orientations: Vec<f64>,
    /// Mean disturbance velocities `[3N]` of the last step, for step 1 of the procedure; empty before it and under other schemes.
    pub velocities: Vec<f64>,
    /// Contact forces of the last stage, where the rigid scheme starts.
    pub memory: Memory,
    /// Contact list of the procedure.
    pub listed: ContactList,
    /// Counters.
    pub counters: Counters,
}

/// A layer under shear.
pub struct Simulation {
    /// What decides the run.
    params: Params,
    /// Roughness, friction, critical load.
    surface: Surface,
    /// Steps done.
    steps: u64,
    /// Side of the square cell.
    side: f64,
    /// Where the spheres are.
    state: State,
    /// Where they were at the start of the step.
    before: State,
    /// Mean disturbance velocities of the last step, where the procedure needs them.
    velocities: Vec<f64>,
    /// Memory of the rigid scheme.
    memory: Memory,
    /// Memory of the procedure.
    listed: ContactList,
    /// Counters.
    counters: Counters,
    /// Solver.
    motion: Motion,
    /// Integrator.
    integrator: RungeKutta,
    /// Stresslets.
    stress: StressWork,
    /// A look at the first stage, while one is asked for.
    frame: Option<Box<Frame>>,
}

impl Simulation {
    /// Makes the start layer from the seed.
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
            counters: Counters::default(),
        };
        Self::from_snapshot(params, snapshot, tables)
    }

    /// Goes on from a snapshot of a run with the same parameters.
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
        let resistance = Resistance::new(params.hydrodynamics, &cell, &snapshot.radii, tables)?;
        let most = most_contacts(params.spheres);
        snapshot.memory.forces.reserve(most);
        snapshot.listed.pairs.reserve(most);
        Ok(Self {
            params: params.clone(),
            surface: Surface {
                roughness: params.roughness,
                friction: params.friction,
                critical_load: params.critical_load(),
            },
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
            listed: snapshot.listed,
            counters: snapshot.counters,
            motion: Motion::new(resistance),
            integrator: RungeKutta::default(),
            stress: StressWork::default(),
            frame: None,
        })
    }

    /// One RK4 step; returns the sample taken at its start.
    ///
    /// Near jamming velocities can leap between two stages, so far that a gap falls below h/2 within a step under the
    /// rigid scheme, which holds each stage's own gaps. Such a step is done again as two of half the size, down to 2⁻⁶ of it.
    ///
    /// # Errors
    /// [`Error::Step`] with step, strain and cause. The state is that before the step.
    pub fn step(&mut self) -> Result<Sample, Error> {
        let (time, dt) = (self.strain(), self.params.time_step);
        let mut sample = None;
        let mut integrator = std::mem::take(&mut self.integrator);
        let mut state = std::mem::take(&mut self.state);
        let most = match self.params.contact {
            ContactScheme::Rigid => MOST_HALVINGS,
            ContactScheme::Procedure => 0,
        };
        self.before.copy_from(&state);
        let result = self.advance(&mut integrator, &mut state, time, dt, most, &mut sample);
        if result.is_err() {
            state.copy_from(&self.before);
        }
        self.integrator = integrator;
        self.state = state;
        let failed = |source| Error::Step {
            step: self.steps,
            strain: time,
            source: Box::new(source),
        };
        result.map_err(failed)?;
        let sample = sample.ok_or(Error::NoSpheres).map_err(failed)?;
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

    /// [`Simulation::step`] with a look at its first stage. The numbers of the run are the same with it as without.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub fn step_with_frame(&mut self) -> Result<(Sample, Frame), Error> {
        let strain = self.strain();
        let travelled = strain * self.side;
        self.frame = Some(Box::new(Frame {
            strain,
            side: self.side,
            offset: travelled - self.side * (travelled / self.side + 0.5).floor(),
            radii: self.motion.resistance.radii().to_vec(),
            centres: self
                .state
                .centres
                .iter()
                .copied()
                .map(frame::plain)
                .collect(),
            orientations: self.state.orientations.clone(),
            ..Frame::default()
        }));
        let result = self.step();
        let frame = self.frame.take().map(|frame| *frame).unwrap_or_default();
        Ok((result?, frame))
    }

    /// Moves the state over `dt`; where a gap falls too low on the way, in two halves, each halved at most `halvings - 1` times.
    fn advance(
        &mut self,
        integrator: &mut RungeKutta,
        state: &mut State,
        time: f64,
        dt: f64,
        halvings: u32,
        sample: &mut Option<Sample>,
    ) -> Result<(), Error> {
        let mut start_gap = 0.0;
        let whole = integrator.step(state, time, dt, |stage, centres, velocities| {
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
                self.advance(integrator, state, time, half, halvings - 1, sample)?;
                self.advance(integrator, state, time + half, half, halvings - 1, sample)
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
        motion.resistance.update(&cell, centres)?;
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
            let stress = self.stress.stress(
                &motion.resistance,
                &background,
                motion.velocities(),
                &motion.contacts.list,
                self.side * self.side,
            );
            count_jam(counters, &stress);
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
        let background = Background::SHEAR;
        self.velocities.clear();
        self.velocities.extend_from_slice(self.integrator.mean());
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
            counters: self.counters,
        }
    }
}

/// Keeps the jam counters, at the first stage of each step.
fn count_jam(counters: &mut Counters, stress: &Stress) {
    if stress.viscosity > JAM_VISCOSITY {
        counters.jam_events += u64::from(counters.jammed_steps_running == 0);
        counters.jammed_steps += 1;
        counters.jammed_steps_running += 1;
    } else {
        counters.jammed_steps_running = 0;
    }
}

impl Snapshot {
    /// Refuses what cannot be a snapshot of a run with these parameters.
    fn check(&self, params: &Params) -> Result<(), Error> {
        let refuse = |reason| Err(Error::Snapshot { reason });
        let n = params.spheres;
        if self.version != SNAPSHOT_VERSION {
            return refuse("made by another version of the program");
        }
        if self.radii.len() != n || self.centres.len() != n || self.orientations.len() != n {
            return refuse("other number of spheres");
        }
        if !(self.velocities.is_empty() || self.velocities.len() == 3 * n) {
            return refuse("velocities of another number of spheres");
        }
        if !self
            .listed
            .pairs
            .iter()
            .all(|&(i, j)| i < j && (j as usize) < n)
        {
            return refuse("contacts of spheres that are not there");
        }
        let finite = self.centres.iter().flatten().all(|x| x.is_finite())
            && self.orientations.iter().all(|x| x.is_finite())
            && self.velocities.iter().all(|x| x.is_finite())
            && self
                .memory
                .forces
                .iter()
                .all(|f| f.2.is_finite() && f.3.is_finite());
        if !finite {
            return refuse("not all numbers are finite");
        }
        let (radii, side) = start::radii_and_side(params)?;
        if self.radii != radii || self.side.to_bits() != side.to_bits() {
            return refuse("other radii or cell than the parameters give");
        }
        Ok(())
    }
}
