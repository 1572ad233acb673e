//! A step of a run: in one piece, or in halves where spheres would come too near on the way.

use super::{Sample, Scheme, SchemeMemory, Simulation};
use crate::contact::ContactState;
use crate::error::Error;
use crate::geometry::modes::Vec2;
use crate::law::Halt;
use crate::run::steppers::{State, Stepper};

/// How many times a step, and then its halves, may be halved where a gap of rigid contacts falls too low within it.
const MOST_HALVINGS: u32 = 6;
/// A gap counts as too low below this share of the roughness height.
const HELD_SHARE: f64 = 0.5;

impl Simulation {
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
}
