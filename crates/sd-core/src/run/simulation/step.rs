//! A step of a run: undivided, or in halves where spheres would come too close.

use super::sampling::StepRecord;
use super::volume::Growth;
use super::{Sample, SchemeMemory, Simulation};
use crate::contact::laws::StageKind;
use crate::contact::springs::Springs;
use crate::contact::{ContactState, Quality, Status};
use crate::error::Error;
use crate::hydrodynamics::resistance::Resistance;
use crate::run::spaces::Starts;
use crate::run::steppers::{Midpoint, Stages, State, Stepper};
use crate::space::Space;
use crate::space::cell::Cell;
use crate::space::pair::Neighbours;

/// Outcome of an attempt at a step.
enum Attempt {
    /// The step was made.
    Moved,
    /// The step was made, but in a stage friction is inexact, or no motion is admissible.
    Doubtful,
    /// A gap is too low; the state is unchanged.
    LowGap {
        /// Whether a stage has no admissible motion.
        jammed: bool,
    },
}

/// Result of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Advance {
    /// The spheres have moved.
    Moved,
    /// The spheres have not moved: no motion is admissible.
    Blocked,
}

/// Reason for an early end of an attempt: a gap that is too low is an outcome, anything else an
/// error.
enum Stop {
    LowGap,
    Failed(Error),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        match error {
            Error::Overlap { .. } => Self::LowGap,
            other => Self::Failed(other),
        }
    }
}

/// A step of rigid contacts, or a part of one.
#[derive(Clone, Copy)]
struct Part {
    time: f64,
    dt: f64,
    /// Number of bisections of the step.
    halvings: u32,
}

impl Part {
    /// Its two halves.
    fn halves(self) -> [Self; 2] {
        let half = Self {
            dt: 0.5 * self.dt,
            halvings: self.halvings + 1,
            ..self
        };
        let second = Self {
            time: self.time + half.dt,
            ..half
        };
        [half, second]
    }
}

impl<S: Starts> Simulation<S> {
    /// Keeps what a step changes.
    pub(in crate::run) fn save(&mut self) {
        let before = &mut self.before;
        before.state.copy_from(&self.state);
        before.extent = self.extent;
        before.memory.copy_from(&self.memory);
        (before.shear_control, before.counters) = (self.shear_control, self.counters);
        self.solver.save();
    }

    /// Restores the state before a failed step: the next one has the same result as without it.
    /// Returns the error with the place of the step in the run.
    pub(in crate::run) fn restore(&mut self, source: Error) -> Error {
        self.restore_contacts();
        self.restore_extent(self.before.extent);
        self.state.copy_from(&self.before.state);
        self.counters = self.before.counters;
        self.solver.restore();
        Error::Step {
            step: self.steps,
            strain: self.time(),
            source: Box::new(source),
        }
    }

    /// Restores the memory of contacts and the shear of the preceding step.
    fn restore_contacts(&mut self) {
        self.impose(self.steps.saturating_sub(1));
        self.shear_control = self.before.shear_control;
        self.laws = self.laws_at_load();
        self.memory.copy_from(&self.before.memory);
    }

    /// Makes a step. If it fails, the state is anywhere within it.
    pub(in crate::run) fn advance(&mut self) -> Result<Sample, Error> {
        self.impose(self.steps);
        self.enter_segment()?;
        self.shear_control.begin_step(&self.params);
        let (time, dt) = (self.time(), self.params.time_step);
        let mut record = StepRecord::at(self.free_strain().unwrap_or(time));
        let mut stepper = std::mem::take(&mut self.stepper);
        let mut state = std::mem::take(&mut self.state);
        let result = match &mut stepper {
            Stepper::RungeKutta(_) => self
                .attempt(
                    &mut stepper,
                    &mut state,
                    [time, dt],
                    &mut record,
                    &mut false,
                )
                .map(|()| Advance::Moved),
            Stepper::Midpoint(method) => {
                let part = Part {
                    time,
                    dt,
                    halvings: 0,
                };
                self.advance_rigid(method, &mut state, part, &mut record)
            }
            Stepper::Rosenbrock(_) => self.advance_soft(&mut stepper, &mut state, &mut record),
        };
        self.stepper = stepper;
        self.state = state;
        let advance = result?;
        let end = self.cell_at(self.time_of(self.steps + 1))?;
        self.check_lattice(&end)?;
        self.check_width(&end)?;
        let sample = self.count_step(&record);
        if advance == Advance::Blocked {
            self.restore_extent(self.before.extent);
            self.state.copy_from(&self.before.state);
            self.counters.jammed_steps_running = self.jam_steps();
            return Ok(sample);
        }
        self.keep_mean_velocities(dt);
        self.steps += 1;
        // The sum of the parts of a step may differ by rounding.
        self.extent.since = self.time();
        self.wrap(&end);
        Ok(sample)
    }

    /// Moves the path of the lattice to the segment of the current step.
    fn enter_segment(&mut self) -> Result<(), Error> {
        let segment = self.imposed.segment;
        match (&mut self.path, &self.run) {
            (Some(path), Some(run)) if !path.is_in(segment) => path.enter(run, segment),
            _ => Ok(()),
        }
    }

    /// Refuses a lattice in which a sphere could have two images of one neighbour in range, in a
    /// flow in which it does not recur.
    fn check_lattice(&self, cell: &Cell<S>) -> Result<(), Error> {
        if self.path.as_ref().is_none_or(|path| path.recurs()) {
            return Ok(());
        }
        let range = Resistance::<S>::range(self.params.hydrodynamics);
        cell.check_range(self.radii(), range)
    }

    /// Whether contacts jam the spheres: whether loaded, non-sliding contacts constrain as many
    /// motions as spheres with at least two contacts have (Maxwell counting). Such a network
    /// carries any load, and does not flow with stiffer contacts either.
    fn is_held(&self) -> bool {
        let constrained = S::TANGENTS * self.laws.tangential.constraint().motions();
        let contacts = self.solver.contacts.list.iter();
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
        let constraints: usize = loaded()
            .filter(|contact| bears(contact.pair.i) && bears(contact.pair.j))
            .map(|contact| {
                S::TANGENTS * usize::from(contact.rolling_sticks)
                    + match contact.state {
                        ContactState::Sticking => 1 + constrained,
                        ContactState::Frictionless | ContactState::Slipping => 1,
                    }
            })
            .sum();
        let spheres = (0..partners.len()).filter(|&sphere| bears(sphere)).count();
        spheres > 0 && constraints >= S::MODES * spheres
    }

    /// Moves the state by one step of `stepper`, sampled at its first stage.
    ///
    /// `jammed` is set where a stage has no admissible motion.
    fn attempt(
        &mut self,
        stepper: &mut Stepper<S>,
        state: &mut State<S>,
        [time, dt]: [f64; 2],
        record: &mut StepRecord,
        jammed: &mut bool,
    ) -> Result<(), Error> {
        stepper.step(state, time, dt, |stage, centres, velocities| {
            let quality = self.evaluate(stage, centres, velocities)?;
            *jammed |= quality.jammed();
            if stage.number == 0 {
                self.begin_sample(quality.jammed(), record);
                self.take_sample(&stage, centres, record);
            }
            Ok::<_, Error>(self.has_contact_forces())
        })?;
        self.end_growth(Growth::of(stepper), dt, &mut state.centres);
        Ok(())
    }

    /// Moves soft spheres over one step: undivided, or in two, four and more parts
    /// where spheres would overlap too much within it or at its end, which only the next step would
    /// detect.
    fn advance_soft(
        &mut self,
        stepper: &mut Stepper<S>,
        state: &mut State<S>,
        record: &mut StepRecord,
    ) -> Result<Advance, Error> {
        let (time, dt) = (self.time(), self.params.time_step);
        let (empty, counters) = (*record, self.counters);
        let (mut halvings, mut jammed) = (0, false);
        loop {
            let parts = 1_u32 << halvings;
            let part = dt / f64::from(parts);
            let moved = (0..parts).try_for_each(|k| {
                let start = time + f64::from(k) * part;
                self.attempt(stepper, state, [start, part], record, &mut jammed)
            });
            let end = self.cell_at(time + dt)?;
            let checked = moved.and_then(|()| {
                let resistance = &self.solver.resistance;
                resistance.check_overlaps(&end, &state.centres)
            });
            let Err(error) = checked else {
                return Ok(Advance::Moved);
            };
            state.copy_from(&self.before.state);
            self.restore_extent(self.before.extent);
            self.restore_contacts();
            self.impose(self.steps);
            self.shear_control.begin_step(&self.params);
            let overlaps = matches!(error, Error::Overlap { .. });
            // Smaller steps do not help where no motion is admissible.
            let jams = jammed || self.is_held();
            if overlaps && jams && record.sample.is_some() {
                return Ok(Advance::Blocked);
            }
            if !overlaps || jams || halvings == self.settings.halvings {
                return Err(error);
            }
            halvings += 1;
            *record = empty;
            self.counters = counters;
        }
    }

    /// Moves rigid spheres over a part of the step; in two halves if a gap becomes too
    /// small within it or at its end, or if the motion is doubtful.
    ///
    /// If a gap is still too small in the smallest part, the spheres move with the velocities of
    /// the first stage, whose contact problem constrains the gaps at the end of exactly this
    /// motion. Without such a motion, they stay where they are.
    fn advance_rigid(
        &mut self,
        method: &mut Midpoint<S>,
        state: &mut State<S>,
        part: Part,
        record: &mut StepRecord,
    ) -> Result<Advance, Error> {
        let (before, counters, extent) = (*record, self.counters, self.extent);
        let attempt = self.attempt_rigid(method, state, part, record)?;
        let halvings = match attempt {
            Attempt::Moved => return Ok(Advance::Moved),
            Attempt::LowGap { jammed: false } => self.settings.halvings,
            Attempt::LowGap { jammed: true } | Attempt::Doubtful => self.settings.halvings_in_doubt,
        };
        let has_moved = matches!(attempt, Attempt::Doubtful);
        if part.halvings < halvings {
            if has_moved {
                method.undo(state);
                self.restore_extent(extent);
            }
            *record = before;
            self.counters = counters;
            self.each_spring(Springs::undo_attempt);
            for half in part.halves() {
                if self.advance_rigid(method, state, half, record)? == Advance::Blocked {
                    return Ok(Advance::Blocked);
                }
            }
            return Ok(Advance::Moved);
        }
        if has_moved {
            return Ok(Advance::Moved);
        }
        *record = before;
        self.counters = counters;
        self.each_spring(Springs::undo_attempt);
        let mut held = self.settings.held_share * self.params.roughness;
        let span = [part.time, part.dt];
        method.step(state, span, Stages::First, |stage, centres, velocities| {
            let quality = self.evaluate(stage, centres, velocities)?;
            held = self
                .solver
                .closest()
                .map_or(held, |pair| held.min(pair.gap));
            self.begin_sample(quality.jammed(), record);
            self.take_sample(&stage, centres, record);
            Ok::<_, Error>(self.has_contact_forces())
        })?;
        self.each_spring(Springs::end_with_first_stage);
        self.end_growth(Growth::Midpoint, part.dt, &mut state.centres);
        let end = self.cell_at(part.time + part.dt)?;
        let closest = self.solver.resistance.closest_at(&end, &state.centres);
        if is_low(held, closest.as_ref()) {
            method.undo(state);
            self.restore_extent(extent);
            return Ok(Advance::Blocked);
        }
        Ok(Advance::Moved)
    }

    /// Moves rigid spheres by one step of the midpoint rule.
    fn attempt_rigid(
        &mut self,
        method: &mut Midpoint<S>,
        state: &mut State<S>,
        part: Part,
        record: &mut StepRecord,
    ) -> Result<Attempt, Error> {
        let (mut jammed, mut inexact) = (false, false);
        let mut held = self.settings.held_share * self.params.roughness;
        self.each_spring(Springs::begin_attempt);
        let (span, extent) = ([part.time, part.dt], self.extent);
        let moved = method.step(state, span, Stages::Both, |stage, centres, velocities| {
            let quality = self.evaluate(stage, centres, velocities)?;
            jammed |= quality.jammed();
            inexact |= self.is_inexact(quality);
            let closest = self.solver.closest();
            if stage.number == 0 {
                held = closest.map_or(held, |pair| held.min(pair.gap));
            }
            if is_low(held, closest) {
                return Err(Stop::LowGap);
            }
            self.begin_sample(quality.jammed(), record);
            let has_contact_forces = self.has_contact_forces();
            if stage.number == 0 && !has_contact_forces {
                self.each_spring(Springs::clear);
            }
            if !has_contact_forces || stage.kind == StageKind::Midpoint {
                self.take_sample(&stage, centres, record);
            }
            Ok(has_contact_forces)
        });
        match moved {
            Err(Stop::Failed(error)) => return Err(error),
            Err(Stop::LowGap) => {
                self.restore_extent(extent);
                return Ok(Attempt::LowGap { jammed });
            }
            Ok(()) => self.end_growth(Growth::Midpoint, part.dt, &mut state.centres),
        }
        let end = self.cell_at(part.time + part.dt)?;
        let closest = self.solver.resistance.closest_at(&end, &state.centres);
        if is_low(held, closest.as_ref()) {
            method.undo(state);
            self.restore_extent(extent);
            return Ok(Attempt::LowGap { jammed });
        }
        Ok(if jammed || inexact {
            Attempt::Doubtful
        } else {
            Attempt::Moved
        })
    }

    /// Applies a change to the tangential and rolling springs of a run under laws.
    fn each_spring(&mut self, change: fn(&mut Springs<S>)) {
        if let SchemeMemory::Laws(memory) = &mut self.memory {
            memory.all_springs().into_iter().for_each(change);
        }
    }

    /// Whether friction is inexact in a stage.
    pub(super) fn is_inexact(&self, quality: Quality) -> bool {
        matches!(quality.status, Status::InexactFriction | Status::Failed)
            && quality.friction_error > self.settings.inexact_friction
    }

    /// Disturbance velocities of the step as a whole, at its mean positions, which the procedure
    /// needs.
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
        let spheres = S::by_sphere_mut(velocities).iter_mut();
        for (u, &x) in spheres.zip(&self.state.centres) {
            // The centre has already moved by u dt; its mean position is half a step back.
            let mean = x - S::translation(u) * (0.5 * dt);
            let flow = S::join(&background.velocity(&mean), &background.angular_velocity());
            for k in 0..S::MODES {
                u[k] -= flow[k];
            }
        }
    }
}

/// Whether a gap is too low.
fn is_low<S: Space>(held: f64, closest: Option<&Neighbours<S>>) -> bool {
    closest.is_some_and(|pair| pair.gap < held)
}
