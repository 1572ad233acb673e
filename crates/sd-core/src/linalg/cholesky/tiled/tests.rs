use super::*;
use crate::linalg::cholesky::dense::DenseCholesky;
use crate::linalg::dense::Matrix;

/// Entries of a dense positive definite matrix without structure.
fn entry(i: usize, j: usize) -> f64 {
    1.0 / (1.0 + i.abs_diff(j) as f64) + f64::from(u8::from(i == j))
}

/// A matrix of two halves in rows of tiles, factored.
fn factored(half: usize) -> TiledCholesky {
    let mut cholesky = TiledCholesky::default();
    let matrix = cholesky.matrix_mut();
    matrix.reshape_halves(half);
    for i in 0..2 * half {
        for j in 0..=i {
            let at = matrix.position(i) + TILE * j;
            matrix.values_mut()[at] = entry(i, j);
        }
    }
    cholesky.factor().unwrap();
    cholesky
}

/// The matrix of [`entry`] by columns, factored.
fn reference(n: usize) -> DenseCholesky {
    let mut cholesky = DenseCholesky::new(n);
    let matrix = cholesky.matrix_mut();
    matrix.reset(n, n);
    for j in 0..n {
        for i in j..n {
            matrix[(i, j)] = entry(i, j);
        }
    }
    cholesky.factor().unwrap();
    cholesky
}

#[test]
fn factor_and_solves_are_those_of_a_matrix_by_columns() {
    // Tiles that are full, short, odd, and more known columns than one strip is deep.
    for half in [3, 27, 48, 51, 99, 270, 450] {
        let (tiled, columns) = (factored(half), reference(2 * half));
        for j in 0..2 * half {
            for i in j..2 * half {
                let difference = tiled.lower().get(i, j) - columns.lower()[(i, j)];
                assert!(difference.abs() < 1e-13, "{half}: {i} {j}");
            }
        }
        let x: Vec<f64> = (0..2 * half).map(|k| (k as f64).sin()).collect();
        let (mut a, mut b) = (x.clone(), x.clone());
        tiled.solve_lower_vector(&mut a);
        columns.solve_lower_vector(&mut b);
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-13));
        let mut tail = a.clone();
        tiled.solve_upper_vector(&mut a, 0);
        columns.solve_upper_vector(&mut b);
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-13));
        tiled.solve_upper_vector(&mut tail, half);
        let mut pairs = tail[half..].iter().zip(&a[half..]);
        assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-13));
    }
}

#[test]
fn trailing_half_of_the_inverse() {
    for half in [27, 99, 160] {
        let (mut tiled, columns) = (factored(half), reference(2 * half));
        let mut block = Matrix::default();
        tiled.trailing_inverse(&mut block);
        for j in 0..half {
            let mut column = vec![0.0; 2 * half];
            column[half + j] = 1.0;
            columns.solve(&mut column);
            for i in j..half {
                assert!((block[(i, j)] - column[half + i]).abs() < 1e-13);
            }
        }
        // V itself: L₂₂ᵀ V = 1.
        for (rows, strip) in tiled.inverse_rows() {
            for row in rows.clone() {
                let v = |k: usize| strip[TILE * (k - rows.start) + row - rows.start];
                for column in rows.start..half {
                    let product: f64 = (rows.start..=column)
                        .map(|k| v(k) * tiled.lower().get(half + column, half + k))
                        .sum();
                    assert!((product - f64::from(u8::from(row == column))).abs() < 1e-13);
                }
            }
        }
    }
}

#[test]
fn indefinite_matrix_names_its_row() {
    let mut cholesky = TiledCholesky::default();
    let matrix = cholesky.matrix_mut();
    matrix.reshape_halves(150);
    for k in 0..300 {
        let at = matrix.position(k) + TILE * k;
        matrix.values_mut()[at] = if k == 170 { -1.0 } else { 1.0 };
    }
    assert_eq!(cholesky.factor(), Err(BadPivot { pivot: 170 }));
}
