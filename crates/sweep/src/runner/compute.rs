//! One case from its claim to its end.

use super::{Workers, panics};
use crate::model::case::{Case, State};
use crate::model::replay::replay;
use crate::model::spaces::{AnySimulation, AnySnapshot, of_either};
use crate::store::{Attempt, Checkpoint, Claim, Finished, NewRows, StoreError, can_be_kept};
use crate::structure::{Network, Reference, observe, sampled};
use crate::system::clock::{Clock, ElapsedTime};
use sd_core::simulation::Flow;
use std::time::{Duration, Instant};

/// Minimum computing time between checkpoints, as a multiple of the time that the last one took:
/// they take less than 5 % of a run, however slow the disk.
const CHECKPOINT_SHARE: u32 = 20;
/// Maximum number of samples in memory: a checkpoint is stored after these.
const SAMPLES_IN_MEMORY: usize = 1 << 14;
/// Maximum number of frames in memory.
const FRAMES_IN_MEMORY: usize = 1 << 7;

/// Default limit of the computing time of a case, as a multiple of its estimate.
const WALL_FACTOR: f64 = 50.0;
/// Lower bound of that limit: estimates of short cases are unreliable.
const MIN_WALL_LIMIT: Duration = Duration::from_mins(30);

/// A run in progress. Held outside the code that may panic, so that its results survive.
#[derive(Default)]
struct Run {
    /// The layer, once it exists.
    simulation: Option<AnySimulation>,
    /// The layer before the current step: a panic may leave the simulation in an invalid state.
    before: Option<AnySnapshot>,
    /// Places at its start along gradient and vorticity, that displacements are relative to.
    start: Option<Vec<[f64; 2]>>,
    record: Record,
}

/// What a run measured, and the time that it took.
#[derive(Default)]
struct Record {
    /// What is not in the store yet.
    rows: NewRows,
    /// Time spent before this process resumed it.
    before: ElapsedTime,
    /// Number of times it was resumed from a checkpoint.
    resumed: u32,
}

enum End {
    /// All steps done.
    Done,
    /// The layer jammed.
    Jammed,
    /// A stop was requested.
    Stopped,
    /// Failed, with a message: an error of the solver, or a limit.
    Failed(String, Option<sd_core::Error>),
}

/// Computing time after which a case ends as failed.
#[derive(Clone, Copy)]
struct WallLimit {
    seconds: f64,
    /// Whether it is the default.
    is_default: bool,
}

impl WallLimit {
    /// The limit chosen, or else a multiple of the estimate.
    fn of(chosen: Option<Duration>, case: &Case) -> Self {
        chosen.map_or_else(
            || Self {
                seconds: (WALL_FACTOR * case.cost()).max(MIN_WALL_LIMIT.as_secs_f64()),
                is_default: true,
            },
            |chosen| Self {
                seconds: chosen.as_secs_f64(),
                is_default: false,
            },
        )
    }

    /// Message of a case that took longer.
    fn message(self) -> String {
        if self.is_default {
            format!(
                "took longer than {} of computing, {WALL_FACTOR} times its estimate; \
                 `sweep run --retry-failed --max-wall-time TIME` gives it longer",
                crate::text::format::duration(self.seconds)
            )
        } else {
            format!(
                "took longer than the limit of {} s of computing per case",
                self.seconds
            )
        }
    }
}

impl End {
    /// The solver failed.
    fn of(error: sd_core::Error) -> Self {
        // Step and strain are stored separately from the message.
        let message = match &error {
            sd_core::Error::Step { source, .. } => source.to_string(),
            other => other.to_string(),
        };
        Self::Failed(message, Some(error))
    }
}

impl Run {
    /// Steps done.
    fn steps(&self) -> u64 {
        self.simulation.as_ref().map_or(0, AnySimulation::steps)
    }

    /// The last valid state of the layer.
    fn last_state(&self) -> Option<AnySnapshot> {
        let now = || self.simulation.as_ref().map(AnySimulation::snapshot);
        self.before.clone().or_else(now)
    }
}

impl Record {
    /// Bytes of the checkpoint of a run.
    fn checkpoint(&self, simulation: &AnySimulation, spent: ElapsedTime) -> Vec<u8> {
        let checkpoint = Checkpoint {
            snapshot: simulation.snapshot(),
            samples_digest: self.rows.samples_digest,
            wall_time_s: spent.wall_s,
            cpu_time_s: spent.cpu_s,
            resumed: self.resumed,
        };
        checkpoint
            .encode()
            .expect("numbers and lists always have an encoding")
    }
}

impl Workers<'_> {
    /// Computes a case and stores its outcome. A result is returned, to be stored with others.
    pub(super) fn compute(
        &self,
        worker: usize,
        claim: &Claim,
    ) -> Result<Option<Finished>, StoreError> {
        let mut run = self.resume(claim)?;
        let clock = self.clock();
        self.options.progress.start_case(worker, claim, run.steps());
        let outcome = panics::catch(|| self.simulate(worker, claim, &mut run, &clock));
        let spent = run.record.before + clock.spent();
        let steps = run.steps();
        let (state, result) = match outcome {
            Ok(Ok(End::Done)) => ("done", Ok(Some(Self::finished(State::Done, run, spent)))),
            Ok(Ok(End::Jammed)) => (
                "jammed",
                Ok(Some(Self::finished(State::Jammed, run, spent))),
            ),
            Ok(Ok(End::Stopped)) => ("stopped", self.stopped(claim, &run, spent)),
            Ok(Ok(End::Failed(message, error))) => {
                ("failed", self.fail(claim, &run, message, error.as_ref()))
            }
            Ok(Err(error)) => ("lost", Err(error)),
            Err(message) => (
                "failed",
                self.fail(claim, &run, format!("panic: {message}"), None),
            ),
        };
        self.options.progress.end_case(worker, result.is_ok());
        if matches!(result, Ok(None) | Err(_)) {
            self.print_end(claim, state, steps, spent.cpu_s);
        }
        result
    }

    /// Reports the end of a case.
    fn print_end(&self, claim: &Claim, state: &str, steps: u64, cpu_s: f64) {
        self.options.progress.ended(claim, state, steps, cpu_s);
    }

    /// The result of a completed run.
    fn finished(state: State, run: Run, spent: ElapsedTime) -> Finished {
        let layer = run.simulation.as_ref();
        let last_state = layer.map(|layer| run.record.checkpoint(layer, spent));
        Finished {
            state,
            last_state: last_state.unwrap_or_default(),
            steps: run.steps(),
            counters: layer.map(|layer| *layer.counters()).unwrap_or_default(),
            wall_time_s: spent.wall_s,
            cpu_time_s: spent.cpu_s,
            resumed: run.record.resumed,
            rows: run.record.rows,
        }
    }

    /// Stores results of cases and reports their ends.
    pub(super) fn keep_ended(&self, ended: &[(&Claim, Finished)]) -> Result<(), StoreError> {
        if ended.is_empty() {
            return Ok(());
        }
        let runs: Vec<(&Claim, &Finished)> = ended
            .iter()
            .map(|(claim, finished)| (*claim, finished))
            .collect();
        let owned = self.store().finish(&runs)?;
        for ((claim, finished), owned) in runs.into_iter().zip(owned) {
            if !owned {
                self.options.progress.note(&claim.lost().to_string());
            } else if finished.state == State::Jammed {
                self.options.progress.note(&format!(
                    "{} at strain {:.3}: {}",
                    finished.state.word(&claim.case.params),
                    finished.steps as f64 * claim.case.params.time_step,
                    claim.case.label()
                ));
            }
            self.print_end(
                claim,
                finished.state.name(),
                finished.steps,
                finished.cpu_time_s,
            );
        }
        Ok(())
    }

    /// Stores the progress of a run and releases its case.
    fn stopped(
        &self,
        claim: &Claim,
        run: &Run,
        spent: ElapsedTime,
    ) -> Result<Option<Finished>, StoreError> {
        if let Some(layer) = run.simulation.as_ref().filter(|layer| layer.steps() > 0) {
            let bytes = run.record.checkpoint(layer, spent);
            self.store()
                .keep(claim, layer.steps(), &bytes, &run.record.rows)?;
        }
        self.store().release([claim])?;
        Ok(None)
    }

    /// A clock for one run, of all its threads.
    fn clock(&self) -> Clock {
        if self.options.workers == 1 {
            Clock::of_process()
        } else if self.options.threads < 2 * self.options.workers {
            Clock::of_thread()
        } else {
            Clock::of_pool()
        }
    }

    /// The run of a claimed case, from its newest valid checkpoint or from its start.
    fn resume(&self, claim: &Claim) -> Result<Run, StoreError> {
        for checkpoint in &claim.checkpoints {
            let refused = match checkpoint {
                Ok(good) => match self.resume_from(claim, good)? {
                    Ok(run) => return Ok(run),
                    Err(reason) => reason,
                },
                Err(damage) => damage.to_string(),
            };
            self.options.progress.note(&format!(
                "a checkpoint of {} cannot be used ({refused}): continuing from the one before",
                claim.case.label()
            ));
        }
        let rows = self.store().restart(claim)?;
        let record = Record {
            rows,
            ..Record::default()
        };
        Ok(Run {
            record,
            ..Run::default()
        })
    }

    /// The run of a claimed case from a checkpoint, or the reason why that cannot be used.
    fn resume_from(
        &self,
        claim: &Claim,
        checkpoint: &Checkpoint,
    ) -> Result<Result<Run, String>, StoreError> {
        let snapshot = checkpoint.snapshot.clone();
        let simulation =
            match AnySimulation::from_snapshot(&claim.case.params, snapshot, self.tables) {
                Ok(simulation) => simulation,
                Err(error) => return Ok(Err(error.to_string())),
            };
        let Some(rows) = self.store().resume(claim, checkpoint)? else {
            return Ok(Err("the samples before it are others".into()));
        };
        Ok(Ok(Run {
            simulation: Some(simulation),
            before: None,
            start: None,
            record: Record {
                rows,
                before: ElapsedTime {
                    wall_s: checkpoint.wall_time_s,
                    cpu_s: checkpoint.cpu_time_s,
                },
                resumed: checkpoint.resumed + 1,
            },
        }))
    }

    /// Makes steps until the run ends.
    fn simulate(
        &self,
        worker: usize,
        claim: &Claim,
        run: &mut Run,
        clock: &Clock,
    ) -> Result<End, StoreError> {
        let (case, record) = (&claim.case, &mut run.record);
        let simulation = match &mut run.simulation {
            Some(simulation) => simulation,
            none => match AnySimulation::new(&case.params, case.seed, self.tables) {
                Ok(simulation) => none.insert(simulation),
                Err(error) => return Ok(End::of(error)),
            },
        };
        let limit = WallLimit::of(self.options.wall_limit, case);
        let steps = self.protocol.with_time_step(case.params.time_step);
        let checkpoint_stride = steps.checkpoint_stride();
        let segments = &case.params.segments;
        let has_cross_shear = segments.iter().any(|one| one.cross_shear.is_some());
        let mut kept = Instant::now();
        let mut cost = Duration::ZERO;
        let mut viscosity = f64::NAN;
        loop {
            if simulation.flow() == Flow::Jammed {
                return Ok(End::Jammed);
            }
            if simulation.steps() >= case.steps {
                return Ok(End::Done);
            }
            if self.stopping() {
                return Ok(End::Stopped);
            }
            let step = simulation.steps();
            run.before = Some(simulation.snapshot());
            let is_sampled = step.is_multiple_of(case.sample_stride);
            let observes = self.protocol.observes_network;
            let films = record.rows.frames_from.is_some();
            let outcome = if is_sampled {
                if run.start.is_none() {
                    run.start = match simulation.places_at_start(&case.params, case.seed) {
                        Ok(places) => Some(places),
                        Err(error) => return Ok(End::of(error)),
                    };
                }
                let reference = Reference {
                    direction: case.params.imposed(step).direction,
                    start: run.start.as_deref(),
                    has_cross_shear,
                };
                simulation.step_with_frame().map(|(mut sample, frame)| {
                    of_either!(&frame, frame => {
                        if let Ok(network) = Network::try_from(frame) {
                            sample.structure = Some(sampled(frame, &network, reference));
                            sample.network = observes.then(|| observe(&network));
                        }
                    });
                    if films {
                        record.rows.frames.push((step, frame));
                    }
                    Some(sample)
                })
            } else {
                simulation.step_unmeasured().map(|()| None)
            };
            match outcome {
                Ok(Some(sample)) if can_be_kept(&sample) => {
                    viscosity = sample.viscosity;
                    record.rows.add(step, sample);
                }
                Ok(Some(_)) => {
                    let message = "a measured value is not a number".to_owned();
                    return Ok(End::Failed(message, None));
                }
                Ok(None) => {}
                Err(error) => return Ok(End::of(error)),
            }
            self.options
                .progress
                .step(worker, simulation.steps(), viscosity);
            if record.before.wall_s + clock.wall_s() > limit.seconds {
                return Ok(End::Failed(limit.message(), None));
            }
            let is_due = simulation.steps().is_multiple_of(checkpoint_stride)
                && kept.elapsed() >= cost * CHECKPOINT_SHARE;
            let rows = &record.rows;
            let is_full =
                rows.samples.len() >= SAMPLES_IN_MEMORY || rows.frames.len() >= FRAMES_IN_MEMORY;
            if simulation.steps() < case.steps && (is_due || is_full) {
                let writing = Instant::now();
                let bytes = record.checkpoint(simulation, record.before + clock.spent());
                self.store()
                    .keep(claim, simulation.steps(), &bytes, &record.rows)?;
                record.rows.samples.clear();
                record.rows.frames.clear();
                cost = writing.elapsed();
                kept = Instant::now();
            }
        }
    }

    /// Stores a failure; the campaign continues.
    fn fail(
        &self,
        claim: &Claim,
        run: &Run,
        message: String,
        error: Option<&sd_core::Error>,
    ) -> Result<Option<Finished>, StoreError> {
        self.options.progress.failed(&claim.case, &message);
        let (pair, gap) = error.map_or((None, None), error_location);
        let step = match error {
            Some(sd_core::Error::Step { step, .. }) => *step,
            _ => run.steps(),
        };
        let params = &claim.case.params;
        let failure = Attempt {
            error: message,
            step,
            strain: step as f64 * params.time_step,
            pair,
            gap,
            snapshot: run.last_state().map(|state| replay(params, &state)),
            ..Attempt::default()
        };
        let rows = &run.record.rows;
        self.store().fail(claim, failure, rows).map(|()| None)
    }
}

/// The pair and the gap in an error.
fn error_location(error: &sd_core::Error) -> (Option<(u64, u64)>, Option<f64>) {
    match error {
        sd_core::Error::Step { source, .. } => error_location(source),
        sd_core::Error::Overlap { i, j, gap, .. } => (Some((*i as u64, *j as u64)), Some(*gap)),
        sd_core::Error::BadPair { i, j, .. } => (Some((*i as u64, *j as u64)), None),
        _ => (None, None),
    }
}
