//! Cost of a checkpoint relative to the steps between two of them: less than 1 % of the run time.
//!
//! N = 90 at c = 0.693, both hydrodynamics.
#![expect(clippy::print_stderr, reason = "the share is what this bench is for")]

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use sd_core::model::Keywords as _;
use sd_core::{NearFields, Simulation};
use std::time::{Duration, Instant};
use sweep::model::spaces::AnySnapshot;
use sweep::store::{Checkpoint, NewRows, Store};

/// A run of the published size under each hydrodynamics.
const CAMPAIGN: &str = r#"name = "bench"
[[grid]]
area_fraction = 0.693
friction = 0.3
roughness = 0.01
shear_rate = inf
seeds = 1
spheres = 90
hydrodynamics = ["ball-melrose", "stokesian-dynamics"]
"#;

/// Mean time of something done so many times.
fn mean(times: u32, mut work: impl FnMut()) -> Duration {
    let begun = Instant::now();
    for _ in 0..times {
        work();
    }
    begun.elapsed() / times
}

/// Steps and checkpoints, and the share of the latter.
fn checkpoint(criterion: &mut Criterion) {
    let campaign = sweep::campaign::parse("bench.toml", CAMPAIGN.into()).expect("a good campaign");
    let directory = tempfile::tempdir().expect("a place for the store");
    let path = directory.path().join("bench.sqlite");
    let (mut store, _) = Store::enter(&path, &campaign).expect("a new store");
    store.register(1).expect("room for a process");
    let stride = campaign
        .protocol
        .with_time_step(campaign.cases[0].1.params.time_step)
        .checkpoint_stride();
    while let Some(claim) = store.claim(1, Duration::ZERO).expect("cases").pop() {
        let p = &claim.case.params;
        let name = p.hydrodynamics.word();
        let mut layer =
            Simulation::<sd_core::Layer>::new(p, 1, &NearFields::default()).expect("a layer");
        let sample = layer.step().expect("a step");
        let record = Checkpoint {
            snapshot: AnySnapshot::Layer(layer.snapshot()),
            samples_digest: None,
            wall_time_s: 1.0,
            cpu_time_s: 1.0,
            resumed: 0,
        };
        let mut keep = || {
            let bytes = record.encode().expect("numbers have an encoding");
            let mut rows = NewRows::default();
            rows.add(0, sample);
            store
                .keep(&claim, 1, &bytes, &rows)
                .expect("a claim of ours");
        };
        let step = mean(20, || {
            layer.step().expect("a step");
        });
        let kept = mean(100, &mut keep);
        let share = kept.as_secs_f64() / (step.as_secs_f64() * stride as f64);
        eprintln!(
            "{name}: step {step:?}, checkpoint {kept:?} every {stride} steps: {:.3} % of the run",
            100.0 * share
        );
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.bench_function("step", |bench| {
            bench.iter_batched(
                || (),
                |()| layer.step().expect("a step"),
                BatchSize::PerIteration,
            );
        });
        group.bench_function("checkpoint", |bench| bench.iter(&mut keep));
        group.finish();
    }
}

criterion_group!(benches, checkpoint);
criterion_main!(benches);
