//! What a time step costs and gains under `rigid`: methods with fixed and with adaptive steps, by right-hand sides.
//!
//! ```text
//! cargo bench -p sd-core --bench time_step -- short [SEEDS]    error in positions and viscosity over a short strain
//! cargo bench -p sd-core --bench time_step -- long [SEEDS]     mean viscosity over runs of five strains
//! ```
//!
//! Ball-Melrose, N = 90, c = 0.693, h = 0.01, ν = 0.3, Γ = 100. The methods here are for comparison only, but for `rk4`, which is
//! what [`sd_core::Simulation`] does.

#![expect(clippy::print_stdout, reason = "a bench prints its table")]

#[path = "time_step/methods.rs"]
mod methods;

use methods::{BOGACKI_SHAMPINE, EULER, HEUN, MIDPOINT, Method, RK4};
use sd_core::cell::Cell;
use sd_core::contact::ContactMemory;
use sd_core::contact::laws::{Laws, Span};
use sd_core::modes::{Background, Vec2};
use sd_core::{
    ContactScheme, Hydrodynamics, NearFields, Params, Resistance, Simulation, Snapshot,
    StageContact, StageSolver, StressWork,
};

/// Viscosity as the program measures it, and with contacts that look ahead by [`LOOK`] only.
type Viscosities = Vec2;

/// Gaps below this share of the roughness height have a step done again, as in the program.
const HELD_SHARE: f64 = 0.5;
/// Time span of contacts where the viscosity is measured apart from the step.
const LOOK: f64 = 0.001;
/// Smallest step, over the largest.
const SMALLEST: f64 = 1.0 / 64.0;

/// A layer that any method can move.
struct Layer {
    side: f64,
    laws: Laws,
    /// Strain reached.
    time: f64,
    /// Centres; the orientations of spheres do not matter here.
    centres: Vec<Vec2>,
    solver: StageSolver,
    memory: ContactMemory,
    stress: StressWork,
    evaluations: u64,
    /// Velocities of the stages.
    velocities: Vec<Vec<Vec2>>,
    /// The first stage of the step, where it is known already: from the end of the step before, or a step refused.
    first: Option<Stage>,
    last: Option<Stage>,
    refused: u64,
}

/// What is measured at a stage.
#[derive(Clone, Copy)]
struct Stage {
    gap: f64,
    viscosity: f64,
    /// Viscosity of contacts that look ahead by [`LOOK`] only, whatever the step.
    instant: f64,
}

impl Layer {
    fn new(params: &Params, snapshot: &Snapshot) -> Self {
        let cell = Cell::periodic(snapshot.side, snapshot.side, 0.0).expect("positive sides");
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
            first: None,
            last: None,
            refused: 0,
        }
    }

    /// One right-hand side; `None` if spheres overlap.
    fn stage(&mut self, number: usize, time: f64, span: f64, centres: &[Vec2]) -> Option<Stage> {
        let background = Background::SHEAR;
        let cell = Cell::periodic(self.side, self.side, time * self.side).expect("positive sides");
        self.solver.assemble(&cell, centres).ok()?;
        let contact = StageContact::Laws {
            laws: &self.laws,
            span: Span::alone(span),
            memory: &mut self.memory,
        };
        self.solver.solve(&background, &[], contact).ok()?;
        self.evaluations += 1;
        let velocities = &mut self.velocities[number];
        velocities.clear();
        let disturbances = self.solver.velocities().chunks_exact(3);
        velocities.extend(
            disturbances
                .zip(centres)
                .map(|(v, &x)| Vec2::new(v[0], v[1]) + background.velocity(x)),
        );
        let viscosity = self.viscosity();
        let contact = StageContact::Laws {
            laws: &self.laws,
            span: Span::alone(LOOK),
            memory: &mut self.memory.clone(),
        };
        self.solver.solve_again(&background, contact).ok()?;
        let instant = self.viscosity();
        Some(Stage {
            gap: self.solver.closest().map_or(f64::INFINITY, |pair| pair.gap),
            viscosity,
            instant,
        })
    }

    /// Viscosity of the motion last solved.
    fn viscosity(&mut self) -> f64 {
        let stress = self
            .stress
            .stress(&self.solver, &Background::SHEAR, self.side * self.side);
        stress.viscosity
    }

    /// Tries a step: the viscosity at its start and the largest estimated error; `None` if a gap fell too low.
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
            let stage = self.stage(number, time, method.spans[number] * dt, &centres)?;
            let first = self.first.get_or_insert(stage);
            if stage.gap < first.gap.min(HELD_SHARE * self.laws.surface.roughness) && !smallest {
                return None;
            }
            last = Some(stage);
        }
        let first = self.first?;
        let viscosity = Viscosities::new(first.viscosity, first.instant);
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

    /// After a step that stands: what it knows of the next.
    fn accept(&mut self, method: &Method, dt: f64) {
        self.time += dt;
        self.first = None;
        if method.last_is_first {
            self.first = self.last;
            self.velocities.swap(0, method.rows.len() - 1);
        }
    }

    /// Moves by fixed steps; integral of the viscosity over the strain.
    fn fixed(&mut self, method: &Method, dt: f64, steps: u32) -> Option<Viscosities> {
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
    fn adaptive(
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

fn params(time_step: f64) -> Params {
    Params {
        spheres: 90,
        area_fraction: 0.693,
        roughness: 0.01,
        friction: 0.3,
        shear_rate: 100.0,
        size_ratio: 1.0,
        large_fraction: 0.5,
        hydrodynamics: Hydrodynamics::BallMelrose,
        contact: ContactScheme::Rigid,
        time_step,
        ..Params::UNWRITTEN
    }
}

/// How the steps of a trial are chosen.
enum Steps {
    /// All steps of this length.
    Fixed(f64),
    /// Steps that keep this tolerance.
    Adaptive(f64),
}

/// All that is compared: right-hand sides as they come.
fn trials() -> Vec<(&'static Method, Steps)> {
    let mut all = Vec::new();
    for dt in [0.1, 0.05, 0.025, 0.0125, 0.005, 0.0025, 0.00125] {
        all.push((&RK4, Steps::Fixed(dt)));
    }
    for dt in [0.025, 0.0125, 0.00625, 0.0025, 0.00125, 0.000625] {
        all.push((&MIDPOINT, Steps::Fixed(dt)));
    }
    for dt in [0.0125, 0.00625, 0.0025, 0.00125, 0.0005] {
        all.push((&EULER, Steps::Fixed(dt)));
    }
    for dt in [0.05, 0.025, 0.0125, 0.005, 0.0025] {
        all.push((&BOGACKI_SHAMPINE, Steps::Fixed(dt)));
    }
    for tolerance in [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5] {
        all.push((&BOGACKI_SHAMPINE, Steps::Adaptive(tolerance)));
    }
    for tolerance in [3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5] {
        all.push((&HEUN, Steps::Adaptive(tolerance)));
    }
    for tolerance in [3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6] {
        all.push((&RK4, Steps::Adaptive(tolerance)));
    }
    all
}

/// Mean viscosity over a strain, right-hand sides, steps refused; `None` if the layer overlapped.
fn run(layer: &mut Layer, method: &Method, steps: &Steps, strain: f64) -> Option<Viscosities> {
    let integral = match *steps {
        Steps::Fixed(dt) => {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a small count"
            )]
            let count = (strain / dt).round() as u32;
            layer.fixed(method, dt, count)?
        }
        Steps::Adaptive(tolerance) => {
            let until = layer.time + strain;
            layer.adaptive(method, tolerance, 0.1, until)?
        }
    };
    Some(integral / strain)
}

fn label(method: &Method, steps: &Steps) -> String {
    match (steps, method.embedded) {
        (Steps::Fixed(dt), _) => format!("{} | {dt}", method.name),
        (Steps::Adaptive(tolerance), Some(_)) => {
            format!("{}, adaptive | {tolerance:.0e}", method.name)
        }
        (Steps::Adaptive(tolerance), None) => {
            format!("{}, step doubling | {tolerance:.0e}", method.name)
        }
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Errors over a short strain, before chaos takes over: medians over layers.
fn short(seeds: u64) {
    const STRAIN: f64 = 0.1;
    let params = params(0.01);
    let start: Vec<Snapshot> = (1..=seeds)
        .map(|seed| {
            let simulation = Simulation::new(&params, seed, &NearFields::default());
            let mut simulation = simulation.expect("valid parameters");
            for _ in 0..150 {
                simulation.step().expect("a step that succeeds");
            }
            simulation.snapshot()
        })
        .collect();
    let references: Vec<(Vec<Vec2>, Viscosities)> = start
        .iter()
        .map(|snapshot| {
            let mut layer = Layer::new(&params, snapshot);
            let mean = run(&mut layer, &RK4, &Steps::Fixed(1e-4), STRAIN);
            (layer.centres, mean.expect("a reference"))
        })
        .collect();
    println!(
        "| method | step or tolerance | right-hand sides per strain | refused | position, rms | position, largest | viscosity |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (method, steps) in trials() {
        let mut columns = [const { Vec::new() }; 6];
        for (snapshot, (centres, viscosity)) in start.iter().zip(&references) {
            let mut layer = Layer::new(&params, snapshot);
            let Some(mean) = run(&mut layer, method, &steps, STRAIN) else {
                continue;
            };
            let cell = Cell::periodic(layer.side, layer.side, layer.time * layer.side);
            let cell = cell.expect("positive sides");
            let distances = layer.centres.iter().zip(centres);
            let distances: Vec<f64> = distances
                .map(|(a, b)| cell.nearest(a - b).0.norm())
                .collect();
            let square = distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64;
            let values = [
                layer.evaluations as f64 / STRAIN,
                layer.refused as f64,
                square.sqrt(),
                distances.iter().copied().fold(0.0, f64::max),
                mean[0] / viscosity[1] - 1.0,
                mean[1] / viscosity[1] - 1.0,
            ];
            for (column, value) in columns.iter_mut().zip(values) {
                column.push(value);
            }
        }
        let refused = columns[1].iter().sum::<f64>() / columns[1].len() as f64;
        let viscosities =
            [4, 5].map(|k| 100.0 * columns[k].iter().sum::<f64>() / columns[k].len() as f64);
        let [evaluations, _, square, largest, ..] = columns.map(median);
        println!(
            "| {} | {evaluations:.0} | {refused:.1} | {square:.1e} | {largest:.1e} | {:+.2} % | {:+.2} % |",
            label(method, &steps),
            viscosities[0],
            viscosities[1]
        );
    }
}

/// Mean viscosity over five strains less two, over that of RK4 at 0.005 looking ahead by 0.001: mean and standard error of the
/// difference over common seeds.
fn long(seeds: u64) {
    let params = params(0.01);
    let all = |method: &Method, steps: &Steps| -> (Vec<Option<Viscosities>>, f64) {
        let mut evaluations = 0;
        let means = (1..=seeds)
            .map(|seed| {
                let start = Simulation::new(&params, seed, &NearFields::default());
                let start = start.expect("valid parameters").snapshot();
                let mut layer = Layer::new(&params, &start);
                run(&mut layer, method, steps, 2.0)?;
                let mean = run(&mut layer, method, steps, 3.0);
                evaluations += layer.evaluations;
                mean
            })
            .collect();
        (means, evaluations as f64 / (5.0 * seeds as f64))
    };
    println!(
        "| method | step or tolerance | right-hand sides per strain | runs | viscosity | the same, looking ahead by 0.001 |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    let (reference, _) = all(&RK4, &Steps::Fixed(0.005));
    let mut chosen: Vec<(&Method, Steps)> = Vec::new();
    for dt in [0.005, 0.0125, 0.025, 0.05] {
        chosen.push((&RK4, Steps::Fixed(dt)));
    }
    for dt in [0.0125, 0.025] {
        chosen.push((&MIDPOINT, Steps::Fixed(dt)));
    }
    chosen.push((&EULER, Steps::Fixed(0.005)));
    for tolerance in [1e-2, 1e-3] {
        chosen.push((&BOGACKI_SHAMPINE, Steps::Adaptive(tolerance)));
    }
    for tolerance in [3e-3, 1e-3] {
        chosen.push((&HEUN, Steps::Adaptive(tolerance)));
    }
    chosen.push((&RK4, Steps::Adaptive(1e-3)));
    for (method, steps) in chosen {
        let (means, evaluations) = all(method, &steps);
        let pairs: Vec<(Viscosities, Viscosities)> = means
            .iter()
            .zip(&reference)
            .filter_map(|(&a, &b)| Some((a?, b?)))
            .collect();
        let over = |k: usize| {
            let n = pairs.len() as f64;
            let base = pairs.iter().map(|p| p.1[1]).sum::<f64>() / n;
            let difference = |p: &(Viscosities, Viscosities)| p.0[k] - p.1[1];
            let mean = pairs.iter().map(difference).sum::<f64>() / n;
            let variance = pairs.iter().map(|p| (difference(p) - mean).powi(2));
            let error = (variance.sum::<f64>() / (n * (n - 1.0))).sqrt();
            format!(
                "{:+.1} ± {:.1} %",
                100.0 * mean / base,
                100.0 * error / base
            )
        };
        println!(
            "| {} | {evaluations:.0} | {} | {} | {} |",
            label(method, &steps),
            pairs.len(),
            over(0),
            over(1)
        );
    }
}

fn main() {
    let given: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let seeds = given.get(1).and_then(|seeds| seeds.parse().ok());
    match given.first().map(String::as_str) {
        Some("long") => long(seeds.unwrap_or(16)),
        _ => short(seeds.unwrap_or(12)),
    }
}
