//! One right-hand side and its parts in a layer with a developed contact network, beside a bare Cholesky factorization of a
//! matrix of dimension 6N in the same run; and one whole step.
//!
//! c = 0.693, h = 0.01, ν = 0.3, Γ = 100, rigid contacts. Layers of 400 and 1000 spheres are 2 × 2 copies of sheared ones of 100
//! and 250: the same contacts per sphere.

use criterion::measurement::WallTime;
use criterion::{BatchSize, BenchmarkGroup, Criterion, criterion_group, criterion_main};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::{Mat, Par, Spec};
use sd_core::cell::Cell;
use sd_core::contact::Surface;
use sd_core::contact::rigid::Memory;
use sd_core::modes::{Background, Vec2};
use sd_core::motion::{ContactLaw, Motion};
use sd_core::resistance::Resistance;
use sd_core::{ContactScheme, Hydrodynamics, NearFields, Params, Simulation, Snapshot};
use std::time::{Duration, Instant};

/// Time step of the runs and of the stages timed.
const TIME_STEP: f64 = 0.005;
/// Strain after which the layer is taken.
const STRAIN: f64 = 0.8;

/// Parameters of the layers.
fn params(spheres: usize, hydrodynamics: Hydrodynamics) -> Params {
    Params {
        spheres,
        area_fraction: 0.693,
        roughness: 0.01,
        friction: 0.3,
        shear_rate: 100.0,
        size_ratio: 1.0,
        large_fraction: 0.5,
        hydrodynamics,
        contact: ContactScheme::Rigid,
        time_step: TIME_STEP,
    }
}

/// A layer sheared by Ball-Melrose hydrodynamics.
fn sheared(spheres: usize) -> Snapshot {
    let params = params(spheres, Hydrodynamics::BallMelrose);
    let mut simulation =
        Simulation::new(&params, 1, &NearFields::default()).expect("valid parameters");
    while simulation.strain() < STRAIN {
        simulation.step().expect("a step that succeeds");
    }
    simulation.snapshot()
}

/// 2 × 2 copies of a layer, as one of four times the spheres.
fn quadrupled(small: &Snapshot) -> Snapshot {
    let n = small.radii.len();
    let mut large = small.clone();
    large.side = 2.0 * small.side;
    large.memory = Memory::default();
    let shift = small.steps as f64 * TIME_STEP * small.side;
    for copy in 1..4_usize {
        let (right, up) = ((copy % 2) as f64, (copy / 2) as f64);
        for k in 0..n {
            let [x, y] = small.centres[k];
            large
                .centres
                .push([x + right * small.side + up * shift, y + up * small.side]);
            large.orientations.push(small.orientations[k]);
            large.radii.push(small.radii[k]);
        }
    }
    // The same length, with the bits that the parameters give.
    let params = params(large.radii.len(), Hydrodynamics::BallMelrose);
    let (_, side) = sd_core::start::radii_and_side(&params).expect("a valid layer");
    assert!((side / large.side - 1.0).abs() < 1e-12);
    large.side = side;
    large
}

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
