//! Cost of a right-hand side over the number of spheres, as the tables of
//! `results/published/performance.md`.
//!
//! ```text
//! cargo bench -p sd-core --bench scaling -- full [N...]             beside faer's bare Cholesky of a matrix of dimension 6N
//! cargo bench -p sd-core --bench scaling -- ball-melrose [c=0.75] [N...]
//! cargo bench -p sd-core --bench scaling -- tables                  of two spheres
//! ```
//!
//! CPU times of one thread. The parts: minimum times of many interleaved rounds, so that their
//! ratios hold on a busy machine as well, each contact problem started from its own solution. A
//! step: median time of steps in sequence, as in a run. h = 0.01, ν = 0.3, Γ = 100, rigid contacts,
//! layers sheared by 0.8, time step 0.005; an N from 400 on is made of k × k copies of a smaller
//! layer.

#![expect(clippy::print_stdout, reason = "a bench prints its table")]

#[path = "layers/cholesky.rs"]
mod cholesky;
#[path = "layers/clock.rs"]
mod clock;
#[path = "layers/sheared.rs"]
mod layers;

use cholesky::BareCholesky;
use clock::Moment;
use layers::{Layer, TIME_STEP, layer, params};
use sd_core::internals::vectorised;
use sd_core::two_sphere::NearField;
use sd_core::{Hydrodynamics, NearFields, Simulation, Snapshot};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Time for one N and one kind of measurement: as many rounds as fit, and some at least.
const LONG_ENOUGH: Duration = Duration::from_secs(4);
const ROUNDS: usize = 3;
/// Time step and strain of the timed runs.
const RUN: (f64, f64) = (0.01, 5.0);

fn milliseconds(call: impl FnOnce()) -> f64 {
    let start = Moment::now();
    call();
    1e3 * start.seconds()
}

/// Repeats a measurement for long enough.
fn rounds<const K: usize>(mut measure: impl FnMut() -> [f64; K]) -> Vec<[f64; K]> {
    let start = Instant::now();
    let mut all = Vec::new();
    while all.len() < ROUNDS || start.elapsed() < LONG_ENOUGH {
        all.push(measure());
    }
    all
}

/// Minimum times in ms: assembly, factorization, contact solve, bare Cholesky if there is one; and
/// whether all contact problems were solved.
fn parts(
    snapshot: &Snapshot,
    area_fraction: f64,
    hydrodynamics: Hydrodynamics,
    mut bare: Option<BareCholesky>,
) -> ([f64; 4], bool) {
    let params = params(snapshot.radii.len(), area_fraction, hydrodynamics);
    let mut layer = Layer::new(snapshot, &params);
    let mut solved = true;
    let all = rounds(|| {
        let assembly = milliseconds(|| layer.assemble());
        let factorization = milliseconds(|| layer.factor());
        // Solving factors for itself.
        layer.assemble();
        let whole = milliseconds(|| solved &= layer.solve(TIME_STEP));
        [
            assembly,
            factorization,
            whole,
            bare.as_mut().map_or(f64::NAN, |bare| {
                bare.reset();
                milliseconds(|| bare.factor())
            }),
        ]
    });
    let [assembly, factorization, whole, bare] = all
        .into_iter()
        .reduce(|a, b| std::array::from_fn(|k| a[k].min(b[k])))
        .expect("rounds");
    let contacts = (whole - factorization).max(0.0);
    ([assembly, factorization, contacts, bare], solved)
}

/// Median time of steps in sequence, in ms.
fn step(snapshot: &Snapshot, area_fraction: f64, hydrodynamics: Hydrodynamics) -> f64 {
    let params = params(snapshot.radii.len(), area_fraction, hydrodynamics);
    let simulation = Simulation::from_snapshot(&params, snapshot.clone(), &NearFields::default());
    let mut simulation = simulation.expect("a valid snapshot");
    simulation.step().expect("a step that succeeds");
    let mut all = rounds(|| {
        [milliseconds(|| {
            simulation.step().expect("a step that succeeds");
        })]
    });
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    all[all.len() / 2][0]
}

/// Prints one row for each N.
fn table(hydrodynamics: Hydrodynamics, area_fraction: f64, all: &[usize]) {
    let full = hydrodynamics == Hydrodynamics::StokesianDynamics;
    let (head, rule) = if full {
        (" bare Cholesky of 6N | ratio |", " ---: | ---: |")
    } else {
        ("", "")
    };
    println!(
        "| N | right-hand side | assembly | factorization | contacts | step |{head} run of {} strains |",
        RUN.1
    );
    println!("| ---: | ---: | ---: | ---: | ---: | ---: |{rule} ---: |");
    for &spheres in all {
        let snapshot = layer(spheres, area_fraction);
        let bare = full.then(|| BareCholesky::new(spheres));
        let ([assembly, factorization, contacts, bare], solved) =
            parts(&snapshot, area_fraction, hydrodynamics, bare);
        let total = assembly + factorization + contacts;
        let mark = if solved { "" } else { " (unsolved)" };
        let step = step(&snapshot, area_fraction, hydrodynamics);
        let ratio = if full {
            format!(" {bare:.3} | {:.2} |", total / bare)
        } else {
            String::new()
        };
        println!(
            "| {spheres} | {total:.3} | {assembly:.3} | {factorization:.3} | {contacts:.3}{mark} | {step:.2} |{ratio} {:.2} s |",
            1e-3 * step * RUN.1 / RUN.0
        );
    }
}

/// Tables of the near field of two spheres: time to make one, and time per pair.
fn tables() {
    let made = milliseconds(|| {
        black_box(NearField::new(1.4).expect("a valid size ratio"));
    });
    let known = milliseconds(|| {
        black_box(NearField::equal_spheres());
    });
    let table = NearField::equal_spheres();
    let pairs = 100_000;
    let evaluated = rounds(|| {
        [milliseconds(|| {
            vectorised(
                #[inline(always)]
                || {
                    for k in 0..pairs {
                        black_box(table.evaluate(1.0, 1.0, 1e-3 + 1e-5 * f64::from(k)));
                    }
                },
            );
        })]
    });
    let least = evaluated.iter().map(|t| t[0]).fold(f64::INFINITY, f64::min);
    println!("| two-sphere functions | CPU time |");
    println!("| --- | ---: |");
    println!("| table for size ratio 1.4 | {:.2} s |", 1e-3 * made);
    println!("| table for equal spheres, stored in the program | {known:.2} ms |");
    println!(
        "| evaluation of one pair | {:.0} ns |",
        1e6 * least / f64::from(pairs)
    );
}

fn main() {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let has = |word: &str| given.iter().any(|given| given == word);
    let spheres = |usual: &[usize]| {
        let all: Vec<usize> = given.iter().filter_map(|a| a.parse().ok()).collect();
        if all.is_empty() { usual.to_vec() } else { all }
    };
    let area_fraction = given
        .iter()
        .find_map(|given| given.strip_prefix("c=")?.parse().ok())
        .unwrap_or(0.693);
    if has("tables") {
        tables();
    } else if has("ball-melrose") {
        let all = spheres(&[90, 400, 1000]);
        table(Hydrodynamics::BallMelrose, area_fraction, &all);
    } else {
        let all = spheres(&[50, 90, 200, 400, 800, 2000]);
        table(Hydrodynamics::StokesianDynamics, area_fraction, &all);
    }
}
