//! One right-hand side and its parts in a layer with a developed contact network, beside a bare Cholesky factorization of a
//! matrix of dimension 6N in the same run; and one whole step.
//!
//! c = 0.693, h = 0.01, ν = 0.3, Γ = 100, rigid contacts. Layers of 400 and 1000 spheres are 2 × 2 copies of sheared ones of 100
//! and 250: the same contacts per sphere.

#[path = "layers/sheared.rs"]
mod layers;

use criterion::measurement::WallTime;
use criterion::{BatchSize, BenchmarkGroup, Criterion, criterion_group, criterion_main};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::{Mat, Par, Spec};
use layers::{TIME_STEP, params, quadrupled, sheared};
use sd_core::cell::Cell;
use sd_core::contact::Surface;
use sd_core::contact::rigid::Memory;
use sd_core::modes::{Background, Vec2};
use sd_core::motion::{ContactLaw, Motion};
use sd_core::resistance::Resistance;
use sd_core::{Hydrodynamics, NearFields, Simulation, Snapshot};
use std::time::{Duration, Instant};

/// Times the parts of one right-hand side, the whole and a step.
fn parts(
    group: &mut BenchmarkGroup<'_, WallTime>,
    snapshot: &Snapshot,
    hydrodynamics: Hydrodynamics,
) {
    let n = snapshot.radii.len();
    let params = params(n, hydrodynamics);
    let offset = snapshot.steps as f64 * TIME_STEP * snapshot.side;
    let cell = Cell::periodic(snapshot.side, snapshot.side, offset).expect("positive sides");
    let centres: Vec<Vec2> = snapshot
        .centres
        .iter()
        .map(|&[x, y]| Vec2::new(x, y))
        .collect();
    let tables = NearFields::default();
    let resistance =
        Resistance::new(hydrodynamics, &cell, &snapshot.radii, &tables).expect("a valid layer");
    let mut motion = Motion::new(resistance);
    let surface = Surface {
        roughness: params.roughness,
        friction: params.friction,
        critical_load: params.critical_load(),
    };
    let background = Background::SHEAR;
    // Forces of the stage before: those of this one, as good a start as in a run.
    let mut memory = Memory::default();
    let mut solve = |motion: &mut Motion| {
        let law = ContactLaw::Rigid {
            surface,
            time_span: 0.5 * TIME_STEP,
            memory: &mut memory,
        };
        motion
            .solve_again(&background, &[], law)
            .expect("finite velocities")
    };
    motion
        .resistance
        .update(&cell, &centres)
        .expect("a regular layer");
    solve(&mut motion);
    group.bench_function("right_hand_side", |bench| {
        bench.iter(|| {
            let updated = motion.resistance.update(&cell, &centres);
            updated.expect("a regular layer");
            solve(&mut motion)
        });
    });
    group.bench_function("contact_solve", |bench| bench.iter(|| solve(&mut motion)));
    group.bench_function("assembly", |bench| {
        bench.iter(|| motion.resistance.assemble(&cell, &centres));
    });
    group.bench_function("assembly_and_factorization", |bench| {
        bench.iter(|| motion.resistance.update(&cell, &centres));
    });
    let simulation =
        || Simulation::from_snapshot(&params, snapshot.clone(), &tables).expect("a valid snapshot");
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

/// Times faer's Cholesky factorization of a matrix `[6N × 6N]`, without filling it.
fn bare_cholesky(group: &mut BenchmarkGroup<'_, WallTime>, spheres: usize) {
    let n = 6 * spheres;
    let mut matrix = Mat::<f64>::zeros(n, n);
    let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Spec::default());
    let mut scratch = MemBuffer::new(scratch);
    group.bench_function("bare_cholesky_6n", |bench| {
        bench.iter_custom(|iterations| {
            let mut total = Duration::ZERO;
            for _ in 0..iterations {
                matrix.fill(0.0);
                for k in 0..n {
                    matrix[(k, k)] = 2.0;
                }
                let start = Instant::now();
                llt::factor::cholesky_in_place(
                    matrix.as_mut(),
                    llt::factor::LltRegularization::default(),
                    Par::Seq,
                    MemStack::new(&mut scratch),
                    Spec::default(),
                )
                .expect("a positive diagonal");
                total += start.elapsed();
            }
            total
        });
    });
}

/// The bench.
fn solve(criterion: &mut Criterion) {
    let small = sheared(90);
    let medium = quadrupled(&sheared(100));
    let large = quadrupled(&sheared(250));
    let kinds = [
        ("full", Hydrodynamics::StokesianDynamics),
        ("ball_melrose", Hydrodynamics::BallMelrose),
    ];
    for layer in [&small, &medium, &large] {
        let n = layer.radii.len();
        for (name, hydrodynamics) in kinds {
            if name == "full" && n > 400 {
                continue;
            }
            let mut group = criterion.benchmark_group(format!("{name}_{n}"));
            group.sample_size(if n > 90 { 10 } else { 50 });
            group.warm_up_time(Duration::from_millis(200));
            group.measurement_time(Duration::from_secs(2));
            parts(&mut group, layer, hydrodynamics);
            if name == "full" {
                bare_cholesky(&mut group, n);
            }
            group.finish();
        }
    }
}

criterion_group!(benches, solve);
criterion_main!(benches);
