//! Cost and accuracy of time steps under `rigid`: methods with fixed and with adaptive steps, by
//! right-hand sides.
//!
//! ```text
//! cargo bench -p sd-core --bench time_step -- short [SEEDS]    error in positions and viscosity over a short strain
//! cargo bench -p sd-core --bench time_step -- long [SEEDS]     mean viscosity over runs of five strains
//! ```
//!
//! Ball-Melrose, N = 90, c = 0.693, h = 0.01, ν = 0.3, Γ = 100. The methods here are for comparison
//! only, but for the midpoint rule with gaps held, which is what [`sd_core::Simulation`] does.

#![expect(clippy::print_stdout, reason = "a bench prints its table")]

#[path = "time_step/layer.rs"]
mod layer;
#[path = "time_step/methods.rs"]
mod methods;

use layer::{Layer, Viscosities};
use methods::{BOGACKI_SHAMPINE, EULER, HELD, HEUN, MIDPOINT, Method, RK4};
use sd_core::cell::Cell;
use sd_core::modes::Vec2;
use sd_core::{ContactScheme, Hydrodynamics, NearFields, Params, Simulation, Snapshot};

fn params(time_step: f64) -> Params {
    Params::builder()
        .spheres(90)
        .area_fraction(0.693)
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(100.0)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Rigid)
        .time_step(time_step)
        .build()
        .expect("valid parameters")
}

/// Choice of the steps of a trial.
enum Steps {
    /// All steps of this length.
    Fixed(f64),
    /// Steps that keep this tolerance.
    Adaptive(f64),
}

/// Methods compared over a short strain: the midpoint rule with gaps held and RK4 at several steps,
/// the others at one step or tolerance of similar cost.
fn trials() -> Vec<(&'static Method, Steps)> {
    vec![
        (&HELD, Steps::Fixed(0.025)),
        (&HELD, Steps::Fixed(0.0125)),
        (&HELD, Steps::Fixed(0.00625)),
        (&RK4, Steps::Fixed(0.025)),
        (&RK4, Steps::Fixed(0.0125)),
        (&MIDPOINT, Steps::Fixed(0.0125)),
        (&EULER, Steps::Fixed(0.00625)),
        (&BOGACKI_SHAMPINE, Steps::Fixed(0.0125)),
        (&BOGACKI_SHAMPINE, Steps::Adaptive(1e-3)),
        (&HEUN, Steps::Adaptive(1e-3)),
        (&RK4, Steps::Adaptive(1e-3)),
    ]
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
            let simulation =
                Simulation::<sd_core::Layer>::new(&params, seed, &NearFields::default());
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
        "| method | step or tolerance | right-hand sides per strain | rejected steps | position error, rms | position error, maximum | viscosity error, within the steps | viscosity error, at their starts |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (method, steps) in trials() {
        let mut columns = [const { Vec::new() }; 6];
        for (snapshot, (centres, viscosity)) in start.iter().zip(&references) {
            let mut layer = Layer::new(&params, snapshot);
            let Some(mean) = run(&mut layer, method, &steps, STRAIN) else {
                continue;
            };
            let cell = Cell::equal_sides(layer.side, layer.time * layer.side);
            let cell: Cell = cell.expect("positive sides");
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

/// Mean viscosity over five strains less two, over that of RK4 at 0.005 looking ahead by 0.001:
/// mean and standard error of the difference over common seeds.
fn long(seeds: u64) {
    let params = params(0.01);
    let all = |method: &Method, steps: &Steps| -> (Vec<Option<Viscosities>>, f64) {
        let mut evaluations = 0;
        let means = (1..=seeds)
            .map(|seed| {
                let start =
                    Simulation::<sd_core::Layer>::new(&params, seed, &NearFields::default());
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
        "| method | step or tolerance | right-hand sides per strain | runs | viscosity error, within the steps | viscosity error, at their starts |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    let (reference, _) = all(&RK4, &Steps::Fixed(0.005));
    let chosen: [(&Method, Steps); 10] = [
        (&HELD, Steps::Fixed(0.025)),
        (&HELD, Steps::Fixed(0.0125)),
        (&HELD, Steps::Fixed(0.005)),
        (&RK4, Steps::Fixed(0.025)),
        (&RK4, Steps::Fixed(0.0125)),
        (&MIDPOINT, Steps::Fixed(0.0125)),
        (&EULER, Steps::Fixed(0.005)),
        (&BOGACKI_SHAMPINE, Steps::Adaptive(1e-3)),
        (&HEUN, Steps::Adaptive(1e-3)),
        (&RK4, Steps::Adaptive(1e-3)),
    ];
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
