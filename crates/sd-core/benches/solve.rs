//! One right-hand side and its parts in a layer with a developed contact network, beside a bare
//! Cholesky factorization of a matrix of dimension 6N in the same run; one whole step; and the near
//! field of two spheres.
//!
//! c = 0.693, h = 0.01, ν = 0.3, Γ = 100. Name a group to measure it alone:
//! `cargo bench -p sd-core --bench solve -- full_90/`. All groups take a quarter of an hour. The
//! tables of `scripts/bench` are made by the bench `scaling`.

#[path = "layers/cholesky.rs"]
mod cholesky;
#[path = "layers/sheared.rs"]
mod layers;

use cholesky::BareCholesky;
use criterion::measurement::WallTime;
use criterion::{BatchSize, BenchmarkGroup, Criterion, criterion_group, criterion_main};
use layers::{Layer, TIME_STEP, layer, params};
use sd_core::two_sphere::NearField;
use sd_core::{Hydrodynamics, NearFields, Simulation, Snapshot};
use std::hint::black_box;
use std::time::{Duration, Instant};

const AREA_FRACTION: f64 = 0.693;

/// Times the parts of one right-hand side, the whole and a step.
fn parts(
    group: &mut BenchmarkGroup<'_, WallTime>,
    snapshot: &Snapshot,
    hydrodynamics: Hydrodynamics,
) {
    let n = snapshot.radii.len();
    let params = params(n, AREA_FRACTION, hydrodynamics);
    let mut layer = Layer::new(snapshot, &params);
    layer.assemble();
    layer.solve(TIME_STEP);
    group.bench_function("right_hand_side", |bench| {
        bench.iter(|| {
            layer.assemble();
            layer.solve(TIME_STEP);
        });
    });
    group.bench_function("contact_solve", |bench| {
        bench.iter(|| layer.solve_contacts(TIME_STEP));
    });
    group.bench_function("assembly", |bench| bench.iter(|| layer.assemble()));
    group.bench_function("assembly_and_factorization", |bench| {
        bench.iter(|| {
            layer.assemble();
            layer.factor();
        });
    });
    let simulation = || {
        Simulation::from_snapshot(&params, snapshot.clone(), &NearFields::default())
            .expect("a valid snapshot")
    };
    if n < 200 {
        // Steps in sequence, as in a run.
        let mut simulation = simulation();
        group.bench_function("step", |bench| bench.iter(|| simulation.step()));
    } else {
        group.bench_function("step", |bench| {
            bench.iter_batched_ref(simulation, Simulation::step, BatchSize::PerIteration);
        });
    }
}

/// Times the near field of two spheres.
fn two_spheres(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("two_spheres");
    group.sample_size(10);
    group.bench_function("table", |bench| {
        bench.iter(|| NearField::new(black_box(1.4)));
    });
    let table = NearField::equal_spheres();
    group.bench_function("pair", |bench| {
        bench.iter(|| table.evaluate(1.0, 1.0, black_box(0.013)));
    });
    group.finish();
}

/// Times right-hand sides at growing numbers of spheres.
fn solve(criterion: &mut Criterion) {
    let all: [(&str, Hydrodynamics, &[usize]); 2] = [
        (
            "full",
            Hydrodynamics::StokesianDynamics,
            &[50, 90, 200, 400, 800],
        ),
        ("ball_melrose", Hydrodynamics::BallMelrose, &[90, 400, 1000]),
    ];
    for (name, hydrodynamics, sizes) in all {
        for &n in sizes {
            let layer = layer(n, AREA_FRACTION);
            let mut group = criterion.benchmark_group(format!("{name}_{n}"));
            group.sample_size(if n > 90 { 10 } else { 50 });
            group.warm_up_time(Duration::from_millis(200));
            group.measurement_time(Duration::from_secs(2));
            parts(&mut group, &layer, hydrodynamics);
            if hydrodynamics == Hydrodynamics::StokesianDynamics {
                let mut bare = BareCholesky::new(n);
                group.bench_function("bare_cholesky_6n", |bench| {
                    bench.iter_custom(|times| {
                        let timed = (0..times).map(|_| {
                            bare.reset();
                            let start = Instant::now();
                            bare.factor();
                            start.elapsed()
                        });
                        timed.sum()
                    });
                });
            }
            group.finish();
        }
    }
}

criterion_group!(benches, two_spheres, solve);
criterion_main!(benches);
