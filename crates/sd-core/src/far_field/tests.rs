//! Tests of the periodic sums and of the resistance made from them.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A triangular layer of `columns × rows` spheres at an area fraction, each moved by at most `shake`.
fn layer(
    columns: usize,
    rows: usize,
    area_fraction: f64,
    shake: f64,
    offset: f64,
) -> (Cell, Vec<Vec2>) {
    // Spacing of the triangular lattice of radius 1: c = 2π/(√3 d²).
    let spacing = (2.0 * PI / (3.0_f64.sqrt() * area_fraction)).sqrt();
    let height = spacing * 0.75_f64.sqrt();
    let cell = Cell::periodic(columns as f64 * spacing, rows as f64 * height, offset).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut centres = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let x = (column as f64 + 0.5 * (row % 2) as f64) * spacing;
            let jitter = Vec2::new(
                random.random_range(-shake..=shake),
                random.random_range(-shake..=shake),
            );
            centres.push(Vec2::new(x, row as f64 * height) + jitter);
        }
    }
    (cell, centres)
}

/// The whole of R_far.
fn resistance(far_field: FarField, cell: &Cell, centres: &[Vec2]) -> Matrix {
    let n = 6 * centres.len();
    let mut far = FarResistance::new(far_field);
    far.update(cell, centres).unwrap();
    let mut r = Matrix::zeros(n, n);
    for j in 0..n {
        let column = r.column_mut(j);
        column[j] = 1.0;
        far.apply(column);
    }
    r
}

/// Largest difference of two matrices.
fn difference(a: &Matrix, b: &Matrix) -> f64 {
    a.values()
        .iter()
        .zip(b.values())
        .map(|(x, y)| (x - y).abs())
        .fold(0.0, f64::max)
}

#[test]
fn resistance_does_not_depend_on_the_splitting() {
    for unequal in [false, true] {
        let (cell, centres) = layer(4, 4, 0.6, 0.2, 1.3);
        let radii: Vec<_> = (0..16)
            .map(|i| {
                if unequal {
                    1.0 - 0.03 * f64::from(i)
                } else {
                    1.0
                }
            })
            .collect();
        let all: Vec<_> = [0.25, 0.375, 0.6]
            .map(|alpha| {
                resistance(
                    FarField::with_splitting(&cell, &radii, 1e-13, alpha).unwrap(),
                    &cell,
                    &centres,
                )
            })
            .into();
        assert!(
            difference(&all[0], &all[1]) < 1e-10,
            "{}",
            difference(&all[0], &all[1])
        );
        assert!(
            difference(&all[0], &all[2]) < 1e-10,
            "{}",
            difference(&all[0], &all[2])
        );
        let planned = resistance(
            FarField::new(&cell, &radii, DEFAULT_TOLERANCE).unwrap(),
            &cell,
            &centres,
        );
        assert!(
            difference(&all[0], &planned) < 1e-5,
            "{}",
            difference(&all[0], &planned)
        );
    }
}
