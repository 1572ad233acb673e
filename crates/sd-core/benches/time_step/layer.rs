//! A layer that any method can move.

use super::methods::Method;
use sd_core::cell::Cell;
use sd_core::contact::Laws;
use sd_core::internals::{
    ContactMemory, Resistance, SolvePass, Span, StageContacts, StageKind, StageSolver, StressWork,
};
use sd_core::modes::Vec2;
use sd_core::{NearFields, Params, Snapshot, VelocityGradient};

/// Viscosity of a step: that of the method, at the first stage or with constrained gaps at the
/// second; and that of the layer at its start, with contacts that look ahead by [`LOOK`].
pub(crate) type Viscosities = Vec2;

/// Gaps below this share of the roughness height have a step done again, as in the program.
const HELD_SHARE: f64 = 0.8;
/// Time span of contacts where the viscosity is measured apart from the step.
const LOOK: f64 = 0.001;
/// Smallest step, over the largest.
const SMALLEST: f64 = 1.0 / 64.0;

/// A layer that any method can move.
pub(crate) struct Layer {
    pub(crate) side: f64,
    laws: Laws,
    /// Strain reached.
    pub(crate) time: f64,
    /// Centres; the orientations of spheres do not matter here.
    pub(crate) centres: Vec<Vec2>,
    solver: StageSolver,
    memory: ContactMemory,
    stress: StressWork,
    pub(crate) evaluations: u64,
    /// Velocities of the stages.
    velocities: Vec<Vec<Vec2>>,
    /// Disturbances `[3N]` of the first stage.
    disturbances: Vec<f64>,
    /// The first stage of the step, where it is known already: from the end of the step before, or
    /// a step refused.
    first: Option<Stage>,
    last: Option<Stage>,
    pub(crate) refused: u64,
}

/// Measurements of a stage.
#[derive(Clone, Copy)]
struct Stage {
    gap: f64,
    viscosity: f64,
    /// Viscosity of contacts that look ahead by [`LOOK`] only, whatever the step.
    instant: f64,
}

impl Layer {
    pub(crate) fn new(params: &Params, snapshot: &Snapshot) -> Self {
        let cell = Cell::equal_sides(snapshot.side, 0.0).expect("positive sides");
        let resistance = Resistance::new(
            params.hydrodynamics,
            &cell,
            &snapshot.radii,
            &NearFields::default(),
        );
        Self {
            side: snapshot.side,
            laws: Laws::rigid(params.surface()),
            time: snapshot.steps as f64 * params.time_step,
            centres: snapshot
                .centres
                .iter()
                .map(|&[x, y]| Vec2::new(x, y))
                .collect(),
            solver: StageSolver::new(resistance.expect("a valid layer")),
            memory: ContactMemory::default(),
            stress: StressWork::default(),
            evaluations: 0,
            velocities: vec![Vec::new(); 8],
            disturbances: Vec::new(),
            first: None,
            last: None,
            refused: 0,
        }
    }

    /// One right-hand side; `None` if spheres overlap.
    fn stage(
        &mut self,
        (number, kind): (usize, StageKind),
        time: f64,
        span: f64,
        centres: &[Vec2],
    ) -> Option<Stage> {
        let background = VelocityGradient::simple_shear(1.0);
        let cell = Cell::equal_sides(self.side, time * self.side).expect("positive sides");
        self.solver.assemble(&cell, centres).ok()?;
        let contact = StageContacts::Laws {
            laws: &self.laws,
            span: Span {
                time: span,
                kind,
                first: &self.disturbances,
                shear: 1.0,
                dilation: 0.0,
                dilates: sd_core::model::PressureKind::Isotropic,
            },
            memory: &mut self.memory,
        };
        self.solver
            .solve(&background.into(), &[], contact, SolvePass::First)
            .ok()?;
        if number == 0 {
            self.disturbances.clear();
            self.disturbances
                .extend_from_slice(self.solver.velocities());
        }
        self.evaluations += 1;
        let velocities = &mut self.velocities[number];
        velocities.clear();
        let disturbances = self.solver.velocities().chunks_exact(3);
        velocities.extend(
            disturbances
                .zip(centres)
                .map(|(v, &x)| Vec2::new(v[0], v[1]) + background.velocity(&x)),
        );
        let viscosity = self.viscosity();
        let contact = StageContacts::Laws {
            laws: &self.laws,
            span: Span::single(LOOK),
            memory: &mut self.memory.clone(),
        };
        self.solver
            .solve(&background.into(), &[], contact, SolvePass::Repeat)
            .ok()?;
        let instant = self.viscosity();
        Some(Stage {
            gap: self.solver.closest().map_or(f64::INFINITY, |pair| pair.gap),
            viscosity,
            instant,
        })
    }

    /// Viscosity of the motion last solved.
    fn viscosity(&mut self) -> f64 {
        let stress = self.stress.stress(
            &self.solver,
            &VelocityGradient::simple_shear(1.0).into(),
            &VelocityGradient::simple_shear(1.0),
            self.side * self.side,
        );
        stress.viscosity
    }

    /// Tries a step: the viscosity at its start and the largest estimated error; `None` if a gap
    /// fell too low.
    fn attempt(&mut self, method: &Method, dt: f64, smallest: bool) -> Option<(Viscosities, f64)> {
        let start = self.centres.clone();
        let mut last = None;
        for (number, row) in method.rows.iter().enumerate() {
            if number == 0 && self.first.is_some() {
                continue;
            }
            let centres: Vec<Vec2> = (0..start.len())
                .map(|i| {
                    let terms = row.iter().zip(&self.velocities);
                    terms.fold(
                        start[i],
                        |x, (a, u)| {
                            if *a == 0.0 { x } else { x + u[i] * (a * dt) }
                        },
                    )
                })
                .collect();
            let time = self.time + method.nodes[number] * dt;
            let kind = if method.held && number == 1 {
                StageKind::Midpoint
            } else {
                StageKind::Single
            };
            let stage = self.stage((number, kind), time, method.spans[number] * dt, &centres)?;
            let first = self.first.get_or_insert(stage);
            if stage.gap < first.gap.min(HELD_SHARE * self.laws.surface.roughness) && !smallest {
                return None;
            }
            last = Some(stage);
        }
        let first = self.first?;
        let own = last.filter(|_| method.held).unwrap_or(first);
        let viscosity = Viscosities::new(own.viscosity, first.instant);
        let mut error: f64 = 0.0;
        for i in 0..start.len() {
            let sum = |weights: &[f64]| {
                let terms = weights.iter().zip(&self.velocities);
                terms.fold(Vec2::zeros(), |x, (b, u)| x + u[i] * *b) * dt
            };
            self.centres[i] = start[i] + sum(method.weights);
            if let Some((weights, _)) = method.embedded {
                error = error.max(sum(weights).norm());
            }
        }
        self.last = last;
        Some((viscosity, error))
    }

    /// After an accepted step: its information about the next.
    fn accept(&mut self, method: &Method, dt: f64) {
        self.time += dt;
        self.first = None;
        if method.last_is_first {
            self.first = self.last;
            self.velocities.swap(0, method.rows.len() - 1);
        }
    }

    /// Moves by fixed steps; integral of the viscosity over the strain.
    pub(crate) fn fixed(&mut self, method: &Method, dt: f64, steps: u32) -> Option<Viscosities> {
        let mut integral = Viscosities::zeros();
        for _ in 0..steps {
            integral += self.halved(method, dt, 6)?;
        }
        Some(integral)
    }

    /// One step, in halves where gaps fall too low.
    fn halved(&mut self, method: &Method, dt: f64, halvings: u32) -> Option<Viscosities> {
        let start = self.centres.clone();
        if let Some((viscosity, _)) = self.attempt(method, dt, halvings == 0) {
            self.accept(method, dt);
            return Some(viscosity * dt);
        }
        self.refused += 1;
        self.centres = start;
        if halvings == 0 {
            return None;
        }
        Some(
            self.halved(method, 0.5 * dt, halvings - 1)?
                + self.halved(method, 0.5 * dt, halvings - 1)?,
        )
    }

    /// Moves by steps that keep the estimated error of any position per step below `tolerance`.
    pub(crate) fn adaptive(
        &mut self,
        method: &Method,
        tolerance: f64,
        largest: f64,
        until: f64,
    ) -> Option<Viscosities> {
        let (weights, order) = method.embedded.unwrap_or((&[], 4.0));
        let doubling = weights.is_empty();
        let mut dt = 0.25 * largest;
        let mut integral = Viscosities::zeros();
        while until - self.time > 1e-12 {
            let step = dt.min(until - self.time);
            let smallest = step <= 1.0001 * SMALLEST * largest;
            let start = self.centres.clone();
            let result = if doubling {
                self.doubled(method, step, smallest)
            } else {
                self.attempt(method, step, smallest)
            };
            let Some((viscosity, error)) = result else {
                self.refused += 1;
                self.centres = start;
                if smallest {
                    return None;
                }
                dt = (0.5 * step).max(SMALLEST * largest);
                continue;
            };
            let factor = 0.9 * (tolerance / error.max(1e-300)).powf(1.0 / order);
            if error > tolerance && !smallest {
                self.refused += 1;
                self.centres = start;
                dt = (step * factor.clamp(0.2, 0.9)).max(SMALLEST * largest);
                continue;
            }
            self.accept(method, step);
            integral += viscosity * step;
            dt = (step * factor.clamp(0.2, 2.0)).clamp(SMALLEST * largest, largest);
        }
        Some(integral)
    }

    /// A step twice: whole, and in two halves, which are kept. Error by Richardson.
    fn doubled(&mut self, method: &Method, dt: f64, smallest: bool) -> Option<(Viscosities, f64)> {
        let start = self.centres.clone();
        let time = self.time;
        self.attempt(method, dt, smallest)?;
        let whole = std::mem::replace(&mut self.centres, start);
        // The first right-hand side of the first half is that of the whole.
        let first = self.attempt(method, 0.5 * dt, smallest);
        self.time = time + 0.5 * dt;
        self.first = None;
        let second = first.and_then(|_| self.attempt(method, 0.5 * dt, smallest));
        self.time = time;
        self.first = None;
        let (viscosity, _) = second?;
        let first = first?;
        let error = whole.iter().zip(&self.centres);
        let error = error.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max) / 15.0;
        Some(((first.0 + viscosity) * 0.5, error))
    }
}
