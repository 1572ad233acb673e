//! The mobility of a suspension: splitting, images, closed forms of lattices.

use super::*;
use crate::hydrodynamics::far_field::far_operator::FarOperator;
use crate::linalg::cholesky::dense::DenseCholesky;
use crate::linalg::dense::Matrix;
use crate::space::Bulk;
use crate::space::cell::{Cell, Lattice};
use nalgebra::Vector3;
use std::f64::consts::PI;

fn filled(cell: &Cell<Bulk>, centres: &[Vector3<f64>], radii: &[f64], alpha: f64) -> Matrix {
    let mut mobility = Matrix::default();
    DenseMobility::with_splitting(cell, radii, 1e-13, alpha)
        .unwrap()
        .fill(cell, centres, &mut mobility)
        .unwrap();
    mobility
}

fn difference(a: &Matrix, b: &Matrix) -> f64 {
    let mut worst: f64 = 0.0;
    for column in 0..a.columns() {
        for row in column..a.rows() {
            worst = worst.max((a[(row, column)] - b[(row, column)]).abs());
        }
    }
    worst
}

/// Three spheres in a cell of unequal sides that is sheared along both axes.
fn sheared() -> (Cell<Bulk>, Vec<Vector3<f64>>, Vec<f64>) {
    let cell = Cell::periodic(Vector3::new(6.0, 7.0, 5.0), 1.7)
        .and_then(|cell| cell.with_cross_offset(-2.2))
        .unwrap();
    let centres = [[0.3, 0.2, 0.1], [2.9, 1.4, 1.0], [1.0, 4.0, 3.1]].map(Vector3::from);
    (cell, centres.to_vec(), vec![1.0, 0.8, 1.3])
}

#[test]
fn mobility_does_not_depend_on_the_splitting() {
    let (cell, centres, radii) = sheared();
    let first = filled(&cell, &centres, &radii, 0.5);
    for alpha in [0.35, 0.8] {
        let worst = difference(&first, &filled(&cell, &centres, &radii, alpha));
        assert!(worst < 1e-11, "{alpha}: {worst:e}");
    }
}

#[test]
fn planned_tolerance_is_met() {
    let (cell, centres, radii) = sheared();
    let exact = filled(&cell, &centres, &radii, 0.5);
    for tolerance in [1e-5, 1e-9] {
        let mut mobility = Matrix::default();
        DenseMobility::new(&cell, &radii, tolerance)
            .unwrap()
            .fill(&cell, &centres, &mut mobility)
            .unwrap();
        let worst = difference(&exact, &mobility);
        assert!(worst < tolerance / (6.0 * PI), "{tolerance:e}: {worst:e}");
    }
}

#[test]
fn images_of_one_lattice_are_one_whatever_cell_spans_it() {
    let (cell, centres, radii) = sheared();
    let expected = filled(&cell, &centres, &radii, 0.5);
    // Other vectors of the lattice, and spheres moved to other images.
    let vectors = [[1, 0, 0], [1, 1, -1], [-2, 0, 1]].map(|image| cell.image_vector(image));
    let later = Cell::Periodic(Lattice::new(&vectors).unwrap());
    let moved: Vec<_> = centres
        .iter()
        .zip([[1, 0, 2], [0, 1, 1], [-1, 2, 0]])
        .map(|(x, image)| x + cell.image_vector(image))
        .collect();
    let worst = difference(&expected, &filled(&later, &moved, &radii, 0.5));
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn rotation_from_torque_is_the_sum_over_spheres_of_images() {
    // The sum over images within a sphere contains the directional mean of the k = 0 term, T/(6V).
    let (radii, side) = ([1.0, 1.0], 12.0);
    let cell = Cell::periodic(Vector3::new(side, side, side), 0.0).unwrap();
    let x = Vector3::new(2.6, 0.7, -0.4);
    let periodic = filled(&cell, &[x, Vector3::zeros()], &radii, 0.4);
    let mut sum = [[0.0; 3]; 3];
    let shells = 24;
    for l in -shells..=shells {
        for m in -shells..=shells {
            for n in -shells..=shells {
                let image = Vector3::new(f64::from(l), f64::from(m), f64::from(n)) * side;
                if image.norm() > (f64::from(shells) + 0.01) * side {
                    continue;
                }
                let x = x + image;
                let distance = x.norm();
                let block =
                    crate::hydrodynamics::free_space::spatial::pair_mobility(distance, 1.0, 1.0)
                        .matrix(&(x / distance));
                for (row, sums) in sum.iter_mut().enumerate() {
                    for (column, sum) in sums.iter_mut().enumerate() {
                        *sum += block[3 + column][3 + row];
                    }
                }
            }
        }
    }
    let volume = side.powi(3);
    for (row, sums) in sum.iter().enumerate() {
        for (column, sum) in sums.iter().enumerate() {
            let [i, j] = [0, 1].map(|k| DenseMobility::row(2, k, 3 + [row, column][k]));
            let mean = f64::from(u8::from(row == column)) / (6.0 * volume);
            let found = periodic[(i.max(j), i.min(j))] + mean;
            let error = (found - sum).abs() * volume;
            assert!(error < 0.01, "{row} {column}: {error:e}");
        }
    }
}

/// The spheres of one cube of a cubic lattice.
fn lattice(name: &str, phi: f64) -> (Cell<Bulk>, Vec<Vector3<f64>>) {
    let places: &[[f64; 3]] = match name {
        "SC" => &[[0.0; 3]],
        "BCC" => &[[0.0; 3], [0.5; 3]],
        _ => &[[0.0; 3], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]],
    };
    let side = (4.0 / 3.0 * PI * places.len() as f64 / phi).cbrt();
    let cell = Cell::periodic(Vector3::new(side, side, side), 0.0).unwrap();
    let centres = places.iter().map(|&x| Vector3::from(x) * side).collect();
    (cell, centres)
}

/// The far field for velocities and strains common to all spheres.
fn far_response(name: &str, phi: f64, modes: [f64; 11]) -> [f64; 11] {
    let (cell, centres) = lattice(name, phi);
    let n = centres.len();
    let mut factor = DenseCholesky::default();
    *factor.matrix_mut() = filled(&cell, &centres, &vec![1.0; n], 2.0 * phi.cbrt());
    factor.factor().unwrap();
    let mut rows = vec![0.0; 11 * n];
    for i in 0..n {
        for (k, x) in modes.into_iter().enumerate() {
            rows[DenseMobility::row(n, i, k)] = x;
        }
    }
    factor.solve(&mut rows);
    std::array::from_fn(|k| rows[DenseMobility::row(n, 0, k)])
}

#[test]
fn far_field_of_cubic_lattices_has_its_closed_forms() {
    // Hasimoto 1959; Zuzovsky, Adler & Brenner 1983: the constants have these digits.
    for (name, c, a, b) in [
        ("SC", 1.7601, 0.28556, -0.04645),
        ("BCC", 1.7919, -0.08990, 0.01432),
        ("FCC", 1.7917, -0.06860, 0.01273),
    ] {
        for phi in [0.027, 0.2, 0.45] {
            let mut stream = [0.0; 11];
            stream[0] = 1.0;
            let drag = far_response(name, phi, stream)[0] / (6.0 * PI);
            let expected = 1.0 - c * phi.cbrt() + phi;
            assert!(
                (drag.recip() - expected).abs() < 1e-4,
                "{name} {phi} {drag}"
            );
            let volume = 4.0 / 3.0 * PI / phi;
            // Along the axes: e1; E_xy: e2. The stress is that of unit strain, over 2 mu.
            let five = phi.powf(5.0 / 3.0);
            let along = 2.5 * phi / (1.0 - (1.0 - 60.0 * b) * phi + 12.0 * a * five);
            let across = 2.5 * phi / (1.0 - (1.0 + 40.0 * b) * phi - 8.0 * a * five);
            for (mode, expected) in [(6, along), (7, across)] {
                let mut strain = [0.0; 11];
                strain[mode] = 1.0;
                let added = far_response(name, phi, strain)[mode] / (2.0 * volume);
                let error = (added / expected - 1.0).abs();
                assert!(error < 2e-3, "{name} {phi} {mode}: {added} {expected}");
            }
        }
    }
}

#[test]
fn operator_is_the_dense_mobility() {
    let plain = Cell::periodic(Vector3::new(14.0, 15.0, 13.0), 3.7).unwrap();
    let centres: Vec<Vector3<f64>> = (0..24)
        .map(|k| {
            let place = Vector3::new(f64::from(k % 3), f64::from(k / 3 % 4), f64::from(k / 12));
            let moved = Vector3::new((1.7 * f64::from(k)).sin(), (0.9 * f64::from(k)).cos(), 0.4);
            place.component_mul(&Vector3::new(4.5, 3.6, 6.0)) + moved * 0.5
        })
        .collect();
    let radii: Vec<f64> = (0..24)
        .map(|k| if k % 3 == 0 { 1.3 } else { 1.0 })
        .collect();
    let crossed = |offset: f64| plain.with_cross_offset(offset).unwrap();
    let cells = [plain, crossed(6.4), crossed(-2.9), plain]
        .map(|cell| (cell, filled(&cell, &centres, &radii, 0.5)));
    let columns = [
        (0, 0),
        (3, 2),
        (5, 3),
        (9, 4),
        (11, 6),
        (17, 8),
        (20, 9),
        (23, 10),
    ];
    // The last splitting leaves near pairs that reach less than half a side, the others several
    // images of each.
    for (tolerance, alpha) in [(1e-4, None), (1e-6, None), (1e-8, None), (1e-7, Some(0.9))] {
        let operator = match alpha {
            None => FarOperator::new(&plain, &radii, tolerance),
            Some(alpha) => FarOperator::with_splitting(&plain, &radii, tolerance, alpha),
        };
        let mut operator = operator.unwrap();
        assert_eq!(operator.is_within_one_image(&plain), alpha.is_some());
        // One plan serves cells of any offsets.
        for (cell, exact) in &cells {
            let worst = error_of(&mut operator, cell, &centres, columns, exact);
            println!("{tolerance:e}: {worst:.1e}");
            assert!(worst < tolerance / (6.0 * PI), "{tolerance:e}: {worst:e}");
        }
    }
}

#[test]
fn operator_is_the_dense_mobility_in_unbounded_fluid() {
    let (_, centres, radii) = sheared();
    let mut exact = Matrix::default();
    let mut dense = DenseMobility::new(&Cell::Unbounded, &radii, 1e-8).unwrap();
    dense.fill(&Cell::Unbounded, &centres, &mut exact).unwrap();
    let mut operator = FarOperator::new(&Cell::Unbounded, &radii, 1e-8).unwrap();
    let columns = (0..3).flat_map(|sphere| (0..11).map(move |mode| (sphere, mode)));
    let worst = error_of(&mut operator, &Cell::Unbounded, &centres, columns, &exact);
    assert!(worst < 1e-15, "{worst:e}");
}

/// The largest error of some columns of an operator.
fn error_of(
    operator: &mut FarOperator<Bulk>,
    cell: &Cell<Bulk>,
    centres: &[Vector3<f64>],
    columns: impl IntoIterator<Item = (usize, usize)>,
    exact: &Matrix,
) -> f64 {
    let n = centres.len();
    operator.update(cell, centres).unwrap();
    let mut worst: f64 = 0.0;
    for (sphere, mode) in columns {
        let (mut x, mut y) = (vec![0.0; 11 * n], vec![0.0; 11 * n]);
        let column = DenseMobility::row(n, sphere, mode);
        x[11 * sphere + mode] = 1.0;
        operator.apply(&x, &mut y);
        for (k, y) in y.iter().enumerate() {
            let row = DenseMobility::row(n, k / 11, k % 11);
            let expected = exact[(row.max(column), row.min(column))];
            worst = worst.max((y - expected).abs());
        }
    }
    worst
}
