//! Far-field mobility: time to fill it, compared with a bare Cholesky factorization of the same
//! matrix.

use criterion::{Criterion, criterion_group, criterion_main};
use sd_core::cell::Cell;
use sd_core::internals::{FarField, FarResistance, Matrix, TiledCholesky, TiledMatrix};
use sd_core::modes::Vec2;
use std::hint::black_box;

/// A sheared triangular layer of area fraction 0.693.
fn layer(columns: usize, rows: usize) -> (Cell, Vec<Vec2>) {
    let spacing = (2.0 * std::f64::consts::PI / (3.0_f64.sqrt() * 0.693)).sqrt();
    let height = spacing * 0.75_f64.sqrt();
    let (x, y) = (columns as f64 * spacing, rows as f64 * height);
    let cell = Cell::periodic(Vec2::new(x, y), 0.3 * x).expect("positive sides");
    let centres = (0..columns * rows)
        .map(|k| {
            let (row, column) = (k / columns, k % columns);
            let shake = 0.1 * (k as f64 * 12.9898).sin();
            Vec2::new(
                (column as f64 + 0.5 * (row % 2) as f64) * spacing + shake,
                row as f64 * height - shake,
            )
        })
        .collect();
    (cell, centres)
}

fn far_field(criterion: &mut Criterion) {
    for (columns, rows) in [(5, 10), (9, 10), (10, 20), (20, 20), (20, 40)] {
        let n = columns * rows;
        let (cell, centres) = layer(columns, rows);
        let radii = vec![1.0; n];
        let mut group = criterion.benchmark_group(format!("far_field_{n}"));
        group.sample_size(if n > 100 { 10 } else { 50 });
        let mut far_field =
            FarField::new(&cell, &radii, FarField::DEFAULT_TOLERANCE).expect("valid radii");
        let mut mobility = TiledMatrix::default();
        group.bench_function("fill", |bench| {
            bench.iter(|| far_field.fill(&cell, black_box(&centres), &mut mobility));
        });
        group.bench_function("real_space_sums", |bench| {
            bench.iter(|| far_field.real_space_sums(&cell, black_box(&centres)));
        });
        group.bench_function("wave_space_sums", |bench| {
            bench.iter(|| far_field.wave_space_sums(&cell, black_box(&centres)));
        });
        let mut cholesky = TiledCholesky::default();
        group.bench_function("copy_and_cholesky", |bench| {
            bench.iter(|| {
                cholesky.matrix_mut().clone_from(&mobility);
                cholesky.factor()
            });
        });
        let mixed: Vec<_> = (0..n).map(|i| if i % 2 == 0 { 0.8 } else { 1.0 }).collect();
        let mut far_field =
            FarField::new(&cell, &mixed, FarField::DEFAULT_TOLERANCE).expect("valid radii");
        group.bench_function("fill_two_radii", |bench| {
            bench.iter(|| far_field.fill(&cell, black_box(&centres), &mut mobility));
        });
        let far_field =
            FarField::new(&cell, &radii, FarField::DEFAULT_TOLERANCE).expect("valid radii");
        let mut resistance = FarResistance::new(far_field);
        let mut r_fu = Matrix::default();
        group.bench_function("resistance", |bench| {
            bench.iter(|| resistance.update(&cell, black_box(&centres), &mut r_fu));
        });
        group.finish();
    }
}

criterion_group!(benches, far_field);
criterion_main!(benches);
