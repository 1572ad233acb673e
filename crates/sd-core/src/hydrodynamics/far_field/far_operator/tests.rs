//! Tests of the operator against the dense mobility.

use super::super::FarField;
use super::super::tests::{entry, layer, mobility};
use super::*;
use crate::linalg::dense::Matrix;
use crate::space::Layer;

/// The matrix of an operator, column by column, in the order of the dense mobility.
fn whole(operator: &mut FarOperator<Layer>) -> Matrix {
    let spheres = operator.sizes.len();
    let n = 6 * spheres;
    let mut all = Matrix::zeros(n, n);
    let (mut x, mut y) = (vec![0.0; n], vec![0.0; n]);
    let place = |k: usize| entry(spheres, k / 6, k % 6);
    for j in 0..n {
        x[j] = 1.0;
        operator.apply(&x, &mut y);
        x[j] = 0.0;
        for (i, y) in y.iter().enumerate() {
            all[(place(i), place(j))] = *y;
        }
    }
    all
}

/// Largest difference of the two, and the largest entry, in columns of force-free sources and up to
/// a uniform translation of the layer: the response to a uniform force is arbitrary in both, and
/// unequal spheres share it unequally.
fn worst(expected: &Matrix, found: &Matrix) -> (f64, f64) {
    let n = expected.rows();
    let (mut worst, mut largest): (f64, f64) = (0.0, 0.0);
    for j in 0..n {
        // A force is balanced by its opposite on the next sphere.
        let force = j >= n / 2 && j % 3 < 2;
        let other = n / 2 + (j - n / 2 + 3) % (n / 2);
        let mut difference: Vec<f64> = (0..n)
            .map(|i| {
                let entry = |j: usize| expected[(i, j)] - found[(i, j)];
                entry(j) - if force { entry(other) } else { 0.0 }
            })
            .collect();
        for c in 0..2 {
            let rows = || (n / 2 + c..n).step_by(3);
            let mean = rows().map(|row| difference[row]).sum::<f64>() / rows().count() as f64;
            rows().for_each(|row| difference[row] -= mean);
        }
        for i in 0..n {
            worst = worst.max(difference[i].abs());
            largest = largest.max(expected[(i, j)].abs());
        }
    }
    (worst, largest)
}

fn radii(unequal: bool) -> Vec<f64> {
    let radius = |i| {
        if unequal {
            1.0 - 0.02 * f64::from(i)
        } else {
            1.0
        }
    };
    (0..30).map(radius).collect()
}

#[test]
fn operator_is_the_dense_mobility() {
    for (unequal, offset) in [(false, 0.0), (false, 5.1), (true, -4.7), (true, 2.2)] {
        let (cell, centres) = layer(5, 6, 0.6, 0.2, offset);
        let radii = radii(unequal);
        let mut field = FarField::new(&cell, &radii, 1e-13).unwrap();
        let expected = mobility(&mut field, &cell, &centres);
        for tolerance in [1e-5, 1e-7, 1e-8] {
            let mut operator = FarOperator::new(&cell, &radii, tolerance).unwrap();
            operator.update(&cell, &centres).unwrap();
            let found = whole(&mut operator);
            let (worst, largest) = worst(&expected, &found);
            assert!(
                worst < tolerance * largest,
                "{unequal} {offset} {tolerance:e}: {:e}",
                worst / largest
            );
            for j in 0..180 {
                for i in 0..j {
                    let difference = (found[(i, j)] - found[(j, i)]).abs();
                    assert!(difference < 1e-14 * largest, "{i} {j}: {difference:e}");
                }
            }
        }
    }
}

#[test]
fn operator_is_the_dense_mobility_in_unbounded_fluid() {
    let (_, centres) = layer(5, 6, 0.6, 0.2, 0.0);
    for unequal in [false, true] {
        let radii = radii(unequal);
        let mut field = FarField::new(&Cell::Unbounded, &radii, 1e-8).unwrap();
        let expected = mobility(&mut field, &Cell::Unbounded, &centres);
        let mut operator = FarOperator::new(&Cell::Unbounded, &radii, 1e-8).unwrap();
        operator.update(&Cell::Unbounded, &centres).unwrap();
        let found = whole(&mut operator);
        for (i, j) in (0..180).flat_map(|i| (0..180).map(move |j| (i, j))) {
            let error = (expected[(i, j)] - found[(i, j)]).abs();
            assert!(error < 1e-15, "{unequal} {i} {j}: {error:e}");
        }
    }
}

#[test]
fn operator_does_not_depend_on_the_splitting() {
    let (cell, centres) = layer(5, 6, 0.6, 0.2, -3.3);
    let radii = radii(true);
    let all = [0.4, 1.0, 1.5].map(|alpha| {
        // The first one leaves several images of each pair in range.
        let mut operator = FarOperator::with_splitting(&cell, &radii, 1e-8, alpha).unwrap();
        assert_eq!(operator.is_within_one_image(&cell), alpha > 0.5);
        operator.update(&cell, &centres).unwrap();
        whole(&mut operator)
    });
    for other in &all[1..] {
        let (worst, largest) = worst(&all[0], other);
        assert!(worst < 2e-8 * largest, "{:e}", worst / largest);
    }
}

#[test]
fn applications_allocate_nothing_and_repeat_bit_for_bit() {
    let (cell, centres) = layer(5, 6, 0.6, 0.2, 1.0);
    let mut operator = FarOperator::new(&cell, &radii(false), 1e-8).unwrap();
    operator.update(&cell, &centres).unwrap();
    let x: Vec<f64> = (0..180).map(|k| f64::from(k).sin()).collect();
    let (mut first, mut second) = (vec![0.0; 180], vec![0.0; 180]);
    operator.apply(&x, &mut first);
    let counted = allocation_counter::measure(|| {
        operator.update(&cell, &centres).unwrap();
        operator.apply(&x, &mut second);
    });
    assert_eq!(counted.count_total, 0);
    assert_eq!(first, second);
    let (both, mut found) = ([&x[..], &x[..]].concat(), vec![0.0; 360]);
    operator.apply(&both, &mut found);
    assert_eq!(found, [first, second].concat());
}

#[test]
fn cost_grows_with_the_number_of_spheres_alone() {
    let sizes = [10, 20, 40].map(|side: usize| {
        let (cell, centres) = layer(side, side, 0.7, 0.1, 3.0);
        let radii = vec![1.0; side * side];
        let mut operator = FarOperator::new(&cell, &radii, 1e-7).unwrap();
        operator.update(&cell, &centres).unwrap();
        let (pairs, points) = (
            operator.pairs.list.len(),
            operator.periodic.as_ref().unwrap().grid.points(),
        );
        (pairs + points) as f64 / radii.len() as f64
    });
    assert!(
        sizes.iter().all(|size| (size / sizes[0] - 1.0).abs() < 0.3),
        "{sizes:?}"
    );
}

#[test]
fn bad_input_is_refused() {
    let (cell, centres) = layer(5, 6, 0.6, 0.2, 1.0);
    let radii = radii(false);
    assert!(FarOperator::new(&cell, &[], 1e-8).is_err());
    assert!(FarOperator::new(&cell, &radii, f64::NAN).is_err());
    assert!(FarOperator::new(&cell, &radii, 1e-9).is_err());
    let mut operator = FarOperator::new(&cell, &radii, 1e-8).unwrap();
    assert!(operator.update(&cell, &centres[1..]).is_err());
    let other = Cell::equal_sides(20.0, 0.0).unwrap();
    assert!(operator.update(&other, &centres).is_err());
    assert!(operator.update(&Cell::Unbounded, &centres).is_err());
    let mut unbounded = FarOperator::new(&Cell::Unbounded, &radii, 1e-8).unwrap();
    assert!(unbounded.update(&other, &centres).is_err());
}
