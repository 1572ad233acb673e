//! Tests of the periodic sums and of the resistance made from them.

use super::*;
use crate::hydrodynamics::free_space::planar::self_mobility;
use crate::linalg::cholesky::dense::DenseCholesky;
use crate::linalg::dense::Matrix;
use crate::space::cell::Lattice;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A triangular layer of `columns × rows` spheres at an area fraction, each displaced by at most
/// `shake`.
pub(super) fn layer(
    columns: usize,
    rows: usize,
    area_fraction: f64,
    shake: f64,
    offset: f64,
) -> (Cell, Vec<Vec2>) {
    // Spacing of the triangular lattice of radius 1: c = 2π/(√3 d²).
    let spacing = (2.0 * PI / (3.0_f64.sqrt() * area_fraction)).sqrt();
    let height = spacing * 0.75_f64.sqrt();
    let cell = Cell::periodic(
        Vec2::new(columns as f64 * spacing, rows as f64 * height),
        offset,
    )
    .unwrap();
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

/// The full matrix `R_far`.
fn resistance(far_field: FarField, cell: &Cell, centres: &[Vec2]) -> Matrix {
    let n = 6 * centres.len();
    let mut far = FarResistance::new(far_field);
    far.update(cell, centres, &mut Matrix::default()).unwrap();
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
            FarField::new(&cell, &radii, FarField::DEFAULT_TOLERANCE).unwrap(),
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

/// Three spheres of unequal radii in a skewed cell.
fn three() -> (Cell, Vec<Vec2>, Vec<f64>) {
    let cell = Cell::periodic(Vec2::new(8.0, 7.0), 2.3).unwrap();
    let centres = vec![
        Vec2::new(0.3, 0.1),
        Vec2::new(3.1, 1.0),
        Vec2::new(1.9, 4.4),
    ];
    (cell, centres, vec![1.0, 0.7, 1.2])
}

/// All of M from its lower triangle.
pub(super) fn mobility(far_field: &mut FarField, cell: &Cell, centres: &[Vec2]) -> Matrix {
    let mut tiled = TiledMatrix::default();
    far_field.fill(cell, centres, &mut tiled).unwrap();
    let n = tiled.rows();
    let mut m = Matrix::zeros(n, n);
    for j in 0..n {
        for i in j..n {
            m[(i, j)] = tiled.get(i, j);
        }
    }
    m.mirror_lower();
    m
}

/// Entry of mode k (order of [`crate::space::modes`]) of sphere i in a grand vector of n spheres.
pub(super) fn entry(n: usize, i: usize, k: usize) -> usize {
    if k < 3 {
        3 * n + 3 * i + k
    } else {
        3 * i + k - 3
    }
}

#[test]
fn force_free_sources_agree_with_a_plain_lattice_sum() {
    let (cell, centres, radii) = three();
    let n = 3;
    let m = mobility(
        &mut FarField::new(&cell, &radii, 1e-12).unwrap(),
        &cell,
        &centres,
    );
    // Forces that cancel, and any dipoles.
    let mut sources = [[0.0; 6]; 3];
    let mut x = vec![0.0; 18];
    for i in 0..n {
        for k in 0..6 {
            let force = [[1.0, -0.4], [0.3, 0.9], [-1.3, -0.5]][i];
            sources[i][k] = if k < 2 {
                force[k]
            } else {
                ((7 * i + k) as f64).sin()
            };
            x[entry(n, i, k)] = sources[i][k];
        }
    }
    let mut found = vec![0.0; 18];
    m.add_product(&x, &mut found);
    // Sums over (2R + 1)² images, remainder a h + b h³ with h = 1/(R + 1/2).
    let mut sums = Vec::new();
    let mut partial = vec![0.0; 18];
    for (i, sphere) in sources.iter().enumerate() {
        for (k, own) in self_mobility(radii[i]).iter().enumerate() {
            partial[entry(n, i, k)] = own * sphere[k];
        }
    }
    let mut last: i32 = -1;
    for range in [20_i32, 40, 80] {
        for p in -range..=range {
            for q in -range..=range {
                if p.abs().max(q.abs()) <= last {
                    continue;
                }
                let image = cell.image_vector([p, q]);
                for i in 0..n {
                    for j in 0..n {
                        if i == j && p == 0 && q == 0 {
                            continue;
                        }
                        let block = planar::pair_mobility(
                            centres[i] - centres[j] - image,
                            radii[i],
                            radii[j],
                        );
                        let velocity =
                            block * crate::space::modes::Modes::from_row_slice(&sources[j]);
                        for k in 0..6 {
                            partial[entry(n, i, k)] += velocity[k];
                        }
                    }
                }
            }
        }
        last = range;
        sums.push((1.0 / (f64::from(range) + 0.5), partial.clone()));
    }
    let mut expected: Vec<f64> = (0..18)
        .map(|row| {
            let fit = Matrix::zeros(3, 3);
            let (mut a, mut b) = (fit, Matrix::zeros(3, 1));
            for (line, (h, sum)) in sums.iter().enumerate() {
                a[(line, 0)] = 1.0;
                a[(line, 1)] = *h;
                a[(line, 2)] = h.powi(3);
                b[(line, 0)] = sum[row];
            }
            crate::linalg::lu::solve_once(&mut a, &mut b).unwrap();
            b[(0, 0)]
        })
        .collect();
    // A uniform velocity is undetermined.
    for values in [&mut found, &mut expected] {
        for k in 0..2 {
            let mean = (0..n).map(|i| values[entry(n, i, k)]).sum::<f64>() / 3.0;
            for i in 0..n {
                values[entry(n, i, k)] -= mean;
            }
        }
    }
    for (row, (a, b)) in found.iter().zip(&expected).enumerate() {
        assert!((a - b).abs() < 1e-8, "row {row}: {a} {b}");
    }
}

#[test]
fn mobility_is_symmetric_between_spheres() {
    // Only the lower triangle is filled, so compare with the spheres in reverse order.
    let (cell, centres, radii) = three();
    for radii in [vec![1.0; 3], radii] {
        for cell in [cell, Cell::Unbounded] {
            let m = mobility(
                &mut FarField::new(&cell, &radii, 1e-8).unwrap(),
                &cell,
                &centres,
            );
            let reversed: (Vec<_>, Vec<_>) = (
                centres.iter().rev().copied().collect(),
                radii.iter().rev().copied().collect(),
            );
            let r = mobility(
                &mut FarField::new(&cell, &reversed.1, 1e-8).unwrap(),
                &cell,
                &reversed.0,
            );
            for (i, k) in (0..18).map(|row| (row / 6, row % 6)) {
                for (j, l) in (0..18).map(|row| (row / 6, row % 6)) {
                    let (a, b) = (
                        m[(entry(3, i, k), entry(3, j, l))],
                        r[(entry(3, 2 - i, k), entry(3, 2 - j, l))],
                    );
                    assert!((a - b).abs() < 1e-14, "{i}{k} {j}{l}: {a} {b}");
                }
            }
        }
    }
}

#[test]
fn dense_layers_have_a_positive_definite_mobility() {
    for (area_fraction, shake, columns, rows) in [
        (0.84, 0.02, 4, 6),
        (0.84, 0.0, 6, 4),
        (0.6, 0.15, 5, 4),
        (0.02, 1.0, 2, 2),
    ] {
        let (cell, centres) = layer(columns, rows, area_fraction, shake, 0.0);
        for radius in [1.0, 0.5] {
            // Spheres of half the size also have a far field.
            let radii = vec![radius; centres.len()];
            let mut far = FarResistance::new(
                FarField::new(&cell, &radii, FarField::DEFAULT_TOLERANCE).unwrap(),
            );
            let mut r = Matrix::default();
            far.update(&cell, &centres, &mut r).unwrap();
            let n = centres.len();
            r.mirror_lower();
            // No resistance to a uniform translation, resistance to all else.
            let mut uniform = vec![0.0; 3 * n];
            uniform.iter_mut().skip(1).step_by(3).for_each(|v| *v = 1.0);
            let mut force = vec![0.0; 3 * n];
            r.add_product(&uniform, &mut force);
            assert!(force.iter().all(|f| f.abs() < 1e-10));
            for axis in 0..2 {
                for j in 0..n {
                    for i in 0..n {
                        r[(3 * i + axis, 3 * j + axis)] += 1.0 / n as f64;
                    }
                }
            }
            let mut cholesky = DenseCholesky::new(3 * n);
            cholesky.matrix_mut().clone_from(&r);
            cholesky.factor().unwrap();
        }
    }
}

#[test]
fn explicit_block_is_the_trailing_one() {
    let (cell, centres, radii) = three();
    for cell in [cell, Cell::Unbounded] {
        let far_field = FarField::new(&cell, &radii, 1e-10).unwrap();
        let whole = resistance(far_field.clone(), &cell, &centres);
        let mut far = FarResistance::new(far_field);
        let mut r_fu = Matrix::default();
        far.update(&cell, &centres, &mut r_fu).unwrap();
        for j in 0..9 {
            for i in j..9 {
                assert!((r_fu[(i, j)] - whole[(9 + i, 9 + j)]).abs() < 1e-11);
                assert!((whole[(i, j)] - whole[(j, i)]).abs() < 1e-11);
            }
        }
    }
}

#[test]
fn large_cells_tend_to_unbounded_fluid() {
    let (_, centres, radii) = three();
    // Unbounded, with the uniform translation projected out as in a layer.
    let mut unbounded = resistance(
        FarField::new(&Cell::Unbounded, &radii, 1e-12).unwrap(),
        &Cell::Unbounded,
        &centres,
    );
    let mut lifted = Matrix::zeros(18, 2);
    for c in 0..2 {
        for i in 0..3 {
            for row in 0..18 {
                lifted[(row, c)] += unbounded[(row, entry(3, i, c))];
            }
        }
    }
    let total = |a: usize, b: usize| (0..3).map(|i| lifted[(entry(3, i, a), b)]).sum::<f64>();
    let (xx, xy, yy) = (total(0, 0), total(0, 1), total(1, 1));
    let determinant = xx * yy - xy * xy;
    for j in 0..18 {
        for i in 0..18 {
            let (a, b) = (
                [lifted[(i, 0)], lifted[(i, 1)]],
                [lifted[(j, 0)], lifted[(j, 1)]],
            );
            unbounded[(i, j)] -= (yy * a[0] * b[0] - xy * (a[0] * b[1] + a[1] * b[0])
                + xx * a[1] * b[1])
                / determinant;
        }
    }
    let errors = [40.0, 80.0].map(|side| {
        let cell = Cell::equal_sides(side, 0.2 * side).unwrap();
        difference(
            &resistance(
                FarField::new(&cell, &radii, 1e-12).unwrap(),
                &cell,
                &centres,
            ),
            &unbounded,
        )
    });
    // Images act through the gradient of the velocity they induce: side⁻³.
    assert!(
        errors[0] < 0.05 && errors[1] < errors[0] / 7.0,
        "{errors:?}"
    );
}

#[test]
fn choice_of_images_is_immaterial() {
    let (_, centres, radii) = three();
    for radii in [vec![1.0; 3], radii] {
        let at = |offset: f64, centres: &[Vec2]| {
            let vectors = [Vec2::new(8.0, 0.0), Vec2::new(offset, 7.0)];
            let cell = Cell::Periodic(Lattice::new(&vectors).unwrap());
            mobility(
                &mut FarField::new(&cell, &radii, 1e-12).unwrap(),
                &cell,
                centres,
            )
        };
        assert!(difference(&at(-4.0, &centres), &at(4.0, &centres)) < 1e-12);
        assert!(difference(&at(0.0, &centres), &at(8.0, &centres)) < 1e-12);
        let base = at(1.7, &centres);
        let sheared = Cell::periodic(Vec2::new(8.0, 7.0), 1.7).unwrap();
        let mut far_field = FarField::new(&sheared, &radii, 1e-12).unwrap();
        assert!(difference(&mobility(&mut far_field, &sheared, &centres), &base) < 1e-12);
        let moved = [
            centres[0] + Vec2::new(-3.0 * 8.0, 0.0),
            centres[1] + Vec2::new(2.0 * 1.7 + 8.0, 14.0),
            centres[2] - Vec2::new(1.7, 7.0),
        ];
        assert!(difference(&base, &at(1.7, &moved)) < 1e-12);
        let shifted: Vec<_> = centres.iter().map(|x| x + Vec2::new(5.3, -11.1)).collect();
        assert!(difference(&base, &at(1.7, &shifted)) < 1e-12);
    }
}

#[test]
fn sums_meet_their_tolerance() {
    for (area_fraction, shake) in [(0.84, 0.02), (0.6, 0.15), (0.1, 1.0)] {
        let (cell, centres) = layer(5, 6, area_fraction, shake, 0.0);
        for radii in [
            vec![1.0; 30],
            (0..30).map(|i| 1.0 - 0.02 * f64::from(i)).collect(),
        ] {
            let alpha = FarField::new(&cell, &radii, FarField::DEFAULT_TOLERANCE)
                .unwrap()
                .splitting()
                .unwrap();
            let [coarse, fine] = [FarField::DEFAULT_TOLERANCE, 1e-13].map(|tolerance| {
                mobility(
                    &mut FarField::with_splitting(&cell, &radii, tolerance, alpha).unwrap(),
                    &cell,
                    &centres,
                )
            });
            let largest = fine.values().iter().fold(0.0, |a: f64, b| a.max(b.abs()));
            let error = difference(&coarse, &fine) / largest;
            assert!(
                error < FarField::DEFAULT_TOLERANCE,
                "{area_fraction}: {error:e}"
            );
        }
    }
}

#[test]
fn overlap_names_a_sphere() {
    let centres = [Vec2::zeros(), Vec2::new(10.0, 0.0), Vec2::new(10.2, 0.0)];
    let mut far = FarResistance::new(FarField::new(&Cell::Unbounded, &[1.0; 3], 1e-8).unwrap());
    let error = far
        .update(&Cell::Unbounded, &centres, &mut Matrix::default())
        .unwrap_err();
    assert!(
        matches!(error, Error::NotPositiveDefinite { sphere: 1 | 2, .. }),
        "{error}"
    );
}

#[test]
fn bad_input_is_refused() {
    let (cell, centres, radii) = three();
    assert!(matches!(
        FarField::new(&cell, &[], 1e-8),
        Err(Error::NoSpheres)
    ));
    assert!(matches!(
        FarField::new(&cell, &[1.0, -1.0], 1e-8),
        Err(Error::OutOfRange { field: "radii", .. })
    ));
    assert!(matches!(
        FarField::new(&cell, &[1.0], 0.1),
        Err(Error::OutOfRange {
            field: "tolerance",
            ..
        })
    ));
    let mut far_field = FarField::new(&cell, &radii, 1e-8).unwrap();
    let mut m = TiledMatrix::default();
    assert!(matches!(
        far_field.fill(&cell, &centres[..2], &mut m),
        Err(Error::Length { found: 2, .. })
    ));
    assert!(matches!(
        far_field.fill(&Cell::Unbounded, &centres, &mut m),
        Err(Error::OutOfRange {
            field: "area of the cell",
            ..
        })
    ));
}
