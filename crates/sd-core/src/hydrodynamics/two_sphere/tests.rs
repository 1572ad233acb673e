//! Reference values, symmetries, limits, positive definiteness, and the table against solutions.

use super::*;
use crate::space::modes::Vec2;
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt, SeedableRng};
use serde_json::Value;
use std::f64::consts::PI;
use std::sync::Arc;

/// Names in the reference file, in the order of [`Scalars::to_array`].
const NAMES: [&str; 10] = ["XA", "YA", "YB", "YC", "XG", "YG", "YH", "XM", "YM", "ZM"];

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// A draw, uniform in the logarithm.
fn log_uniform(random: &mut impl Rng, low: f64, high: f64) -> f64 {
    (low.ln() + (high / low).ln() * random.random::<f64>()).exp()
}

/// Drag of isolated spheres in every mode: 6πa, 8πa³, (20/3)πa³.
fn drag(radii: [f64; 2]) -> SVector<f64, 12> {
    SVector::from_fn(|k, _| {
        let a = radii[k / 6];
        match k % 6 {
            0 | 1 => 6.0 * PI * a,
            2 => 8.0 * PI * a.powi(3),
            _ => 20.0 / 3.0 * PI * a.powi(3),
        }
    })
}

/// A matrix in units of the isolated drags.
fn normalised(matrix: &PairMatrix, radii: [f64; 2]) -> PairMatrix {
    let drag = drag(radii);
    PairMatrix::from_fn(|i, j| matrix[(i, j)] / (drag[i] * drag[j]).sqrt())
}

/// R2B∞ of spheres at a gap.
fn far_field(radii: [f64; 2], gap: f64) -> PairMatrix {
    pair_frame::expand(&pair_frame::far_field_entries(
        radii,
        radii[0] + radii[1] + gap,
    ))
}

#[test]
fn agrees_with_reference() {
    let cases: Vec<Value> =
        serde_json::from_str(include_str!("../../../tests/data/two_sphere_scalars.json")).unwrap();
    for case in &cases {
        let (size_ratio, s_prime) = (number(&case["size_ratio"]), number(&case["s_prime"]));
        let found = scalars(size_ratio, s_prime).unwrap().to_array();
        for (k, value) in found.iter().enumerate() {
            let name = NAMES[k / 2];
            let expected = number(&case[name][k % 2]);
            let (tolerance, floor) = match (name, s_prime < 2.002) {
                (_, false) => (1e-8, 0.0),
                // The reference for Y12M near contact used a misprinted logarithmic term: see
                // `near_contact::singular`.
                ("YM", true) => (2e-5, 0.5),
                _ => (1e-5, 0.0),
            };
            let error = (value - expected).abs() / expected.abs().max(floor);
            assert!(
                error < tolerance,
                "{size_ratio} {s_prime} {name}: {value} for {expected}"
            );
        }
    }
}

#[test]
fn more_multipoles_change_nothing() {
    for (size_ratio, xi) in [
        (1.0, 0.01),
        (1.0, 1.0),
        (0.3, 0.02),
        (20.0, 0.01),
        (100.0, 0.05),
        (100.0, 8.0),
    ] {
        let few = series::solve(size_ratio, xi, 1.0);
        let many = series::solve(size_ratio, xi, 1.5);
        for label in 0..2 {
            for (a, b) in few[label].to_array().iter().zip(many[label].to_array()) {
                let error = (a - b).abs() / b.abs().max(1e-3);
                assert!(error < 2e-10, "{size_ratio} {xi} {label}: {a} {b}");
            }
        }
    }
}

#[test]
fn constants_of_touching_spheres_are_those_published() {
    // Jeffrey & Onishi (1984), A11X, A12X, A11Y, A12Y at λ = 1: the functions less 1/ξ and ln ξ
    // terms, ξ → 0.
    let xi = 1e-7;
    let f = NearContact::solve(1.0).evaluate(xi)[0];
    let (x, y) = (0.25 / xi - 0.225 * xi.ln(), -xi.ln() / 6.0);
    for (found, published) in [
        (f.x_a[0] - x, 0.9954),
        (f.x_a[1] + x, -0.3502),
        (f.y_a[0] - y, 0.9983),
        (f.y_a[1] + y, -0.2737),
    ] {
        assert!((found - published).abs() < 6e-5, "{found} {published}");
    }
}

#[test]
fn far_apart_functions_have_their_limits() {
    let (lambda, s_prime) = (3.0, 4000.0);
    let r = 0.5 * s_prime * (1.0 + lambda);
    let f = scalars(lambda, s_prime).unwrap();
    for own in [f.x_a, f.y_a, f.y_c, f.x_m, f.y_m, f.z_m] {
        assert!((own[0] - 1.0).abs() < 1e-6);
    }
    // Stokeslets to first order in 1/r, the force on 2 of its own drag.
    assert!((f.x_a[1] * r / (-1.5 * lambda) - 1.0).abs() < 1e-4);
    assert!((f.y_a[1] * r / (-0.75 * lambda) - 1.0).abs() < 1e-4);
    for small in [f.y_b, f.x_g, f.y_g, f.y_h].as_flattened() {
        assert!(small.abs() < 1e-6);
    }
}

#[test]
fn functions_that_join_both_spheres_are_symmetric_under_exchange() {
    // λ enters as a power of the radius that scales each function.
    for (lambda, s_prime) in [(2.0_f64, 2.1), (0.2, 2.5), (7.0, 2.05)] {
        let f = scalars(lambda, s_prime).unwrap();
        let g = scalars(1.0 / lambda, s_prime).unwrap();
        for (a, b, power) in [
            (f.x_a, g.x_a, 1),
            (f.y_a, g.y_a, 1),
            (f.y_c, g.y_c, 3),
            (f.x_m, g.x_m, 3),
            (f.y_m, g.y_m, 3),
            (f.z_m, g.z_m, 3),
        ] {
            let error = (a[1] - b[1] * lambda.powi(power)).abs();
            assert!(error < 1e-10 * a[1].abs().max(0.01), "{lambda} {a:?} {b:?}");
        }
    }
}

#[test]
fn velocities_of_exact_pairs() {
    let file: Value =
        serde_json::from_str(include_str!("../../../tests/data/two_sphere_exact.json")).unwrap();
    let velocity = [0, 1, 2, 6, 7, 8];
    for case in file["cases"].as_array().unwrap() {
        let [a, b] = [0, 1].map(|k| number(&case["radii"][k]));
        let r = two_sphere_resistance(a, b, number(&case["separation"])).unwrap();
        let e = &case["rate_of_strain"];
        let e =
            crate::space::modes::strain_modes(number(&e["xx"]), number(&e["yy"]), number(&e["xy"]));
        let r_fu = SMatrix::<f64, 6, 6>::from_fn(|i, j| r[(velocity[i], velocity[j])]);
        let force = SVector::<f64, 6>::from_fn(|i, _| {
            let external = if i % 3 < 2 {
                number(&case["forces"][i / 3][i % 3])
            } else {
                0.0
            };
            let strain = |k: usize| r[(velocity[i], 3 + k)] + r[(velocity[i], 9 + k)];
            external + (0..3).map(|k| strain(k) * e[k]).sum::<f64>()
        });
        let v = r_fu.try_inverse().unwrap() * force;
        for i in 0..6 {
            let expected = if i % 3 < 2 {
                number(&case["velocity_disturbance"][i / 3][i % 3])
            } else {
                number(&case["angular_velocity_disturbance"][i / 3])
            };
            // Seven digits are given, the last not always rounded.
            let error = (v[i] - expected).abs();
            assert!(
                error <= 1e-6 * expected.abs() + 1e-12,
                "{} {a} {b} {i}: {} for {expected}",
                case["case"],
                v[i]
            );
        }
    }
}

#[test]
fn arguments_out_of_range_are_refused() {
    for (size_ratio, s_prime) in [
        (0.0099, 3.0),
        (101.0, 3.0),
        (f64::NAN, 3.0),
        (1.0, 2.0),
        (1.0, f64::NAN),
        (1.0, f64::INFINITY),
    ] {
        assert!(matches!(
            scalars(size_ratio, s_prime),
            Err(Error::OutOfRange { .. })
        ));
    }
    assert!(NearField::new(0.001).is_err());
    assert!(two_sphere_resistance(1.0, 1.0, 2.0).is_err());
    assert!(two_sphere_resistance(-1.0, 1.0, 3.0).is_err());
}

/// Worst error of a table against solving, of the entry or of the geometric mean of the drags it
/// joins.
fn table_error(table: &NearField, radii: [f64; 2], xi: f64) -> f64 {
    let gap = 0.5 * xi * (radii[0] + radii[1]);
    let resistance = pair_frame::expand(&pair_frame::resistance_entries(
        &both_labellings(radii[1] / radii[0], xi),
        radii,
    ));
    let found = table.evaluate(radii[0], radii[1], gap).matrix();
    pair_error(&found, &(resistance - far_field(radii, gap)), radii)
}

/// Worst error of a pair term, relative to the entry or to the geometric mean of the drags it
/// joins.
fn pair_error(found: &PairMatrix, expected: &PairMatrix, radii: [f64; 2]) -> f64 {
    let [found, expected] = [found, expected].map(|matrix| normalised(matrix, radii));
    expected
        .iter()
        .zip(&found)
        .map(|(e, f)| (e - f).abs() / e.abs().max(1.0))
        .fold(0.0, f64::max)
}

#[test]
fn table_meets_solutions() {
    for (ratio, gaps) in [
        (
            1.0,
            vec![1e-8, 1e-4, 4e-3, 0.013, 0.11, 0.47, 0.9, 1.1, 8.0, 50.0],
        ),
        (
            2.5,
            vec![1e-8, 1e-4, 4e-3, 0.013, 0.11, 0.47, 0.9, 1.1, 8.0, 50.0],
        ),
        (15.0, vec![5e-3, 0.11, 0.47, 0.9, 8.0]),
    ] {
        let table = NearField::new(ratio).unwrap();
        for xi in gaps {
            for radii in [[1.0, ratio], [ratio, 1.0], [0.4, 0.4 * ratio]] {
                let error = table_error(&table, radii, xi);
                assert!(error < 1e-8, "{radii:?} {xi}: {error:e}");
            }
        }
    }
}

#[test]
#[ignore = "half a minute: the most unequal spheres"]
fn table_meets_solutions_at_extreme_size_ratios() {
    for ratio in [50.0, 100.0] {
        let table = NearField::new(ratio).unwrap();
        for xi in [
            1e-8, 1e-4, 1e-3, 4e-3, 0.013, 0.11, 0.47, 0.9, 1.1, 8.0, 50.0,
        ] {
            for radii in [[1.0, ratio], [1.0, 1.0 / ratio]] {
                let error = table_error(&table, radii, xi);
                println!("{radii:?} {xi}: {error:e}");
                assert!(error < 1e-8, "{radii:?} {xi}: {error:e}");
            }
        }
    }
}

/// Draws size ratios log-uniform in 1 to the largest of a range, both ends among them, and for each
/// gaps log-uniform in ξ from 1e-2 to 50, where it compares with solutions, and from 1e-8 on, where
/// it compares with the table of that ratio.
fn check_range(largest: f64, ratios: usize) {
    let start = std::time::Instant::now();
    let tables: Vec<Arc<NearField>> = NearFieldRange::ratios(largest)
        .unwrap()
        .into_iter()
        .map(|ratio| Arc::new(NearField::new(ratio).unwrap()))
        .collect();
    let range = NearFieldRange::new(largest, &tables).unwrap();
    let time = start.elapsed();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut worst = [0.0_f64; 3];
    for k in 0..ratios {
        let ratio = match k {
            0 => 1.0,
            1 => largest,
            _ => log_uniform(&mut random, 1.0, largest),
        };
        let table = NearField::new(ratio).unwrap();
        for draw in 0..400 {
            let radii = if random.random() {
                [0.8, 0.8 * ratio]
            } else {
                [1.3 * ratio, 1.3]
            };
            let mean = 0.5 * (radii[0] + radii[1]);
            let xi = log_uniform(&mut random, 1e-8, 50.0);
            let known = table.evaluate(radii[0], radii[1], mean * xi).matrix();
            let found = range.evaluate(radii[0], radii[1], mean * xi).matrix();
            worst[0] = worst[0].max(pair_error(&found, &known, radii));
            let known = table.slip_resistance(radii[0], radii[1], mean * xi);
            let found = range.slip_resistance(radii[0], radii[1], mean * xi);
            worst[1] = worst[1].max((found / known - 1.0).abs());
            if draw < 20 {
                let xi = log_uniform(&mut random, 1e-2, 50.0);
                let solved = two_sphere_resistance(radii[0], radii[1], mean * (2.0 + xi)).unwrap()
                    - far_field(radii, mean * xi);
                let found = range.evaluate(radii[0], radii[1], mean * xi).matrix();
                worst[2] = worst[2].max(pair_error(&found, &solved, radii));
            }
        }
    }
    let [of_table, of_slip, of_solved] = worst;
    println!(
        "up to {largest}: {of_table:.1e} {of_slip:.1e} {of_solved:.1e}, {} tables in {time:.1?}",
        tables.len()
    );
    assert!(worst.iter().all(|worst| *worst < 1e-8), "{worst:?}");
}

#[test]
fn range_meets_solutions_at_random_size_ratios_and_gaps() {
    check_range(4.0, 12);
    check_range(12.0, 12);
}

#[test]
#[ignore = "half a minute: the most unequal spheres"]
fn range_meets_solutions_at_extreme_size_ratios() {
    check_range(26.0, 12);
    check_range(100.0, 12);
}

#[test]
fn correction_beyond_the_table_is_negligible() {
    for radii in [[1.0, 1.0], [1.0, 0.1], [1.0, 100.0]] {
        let gap = 0.5 * 55.0 * (radii[0] + radii[1]);
        let resistance =
            two_sphere_resistance(radii[0], radii[1], radii[0] + radii[1] + gap).unwrap();
        let left = normalised(&(resistance - far_field(radii, gap)), radii);
        assert!(left.amax() < 1e-9, "{radii:?}: {:e}", left.amax());
    }
}

#[test]
fn equal_sphere_constants_are_what_solving_gives() {
    let (kept, solved) = (NearField::equal_spheres(), NearField::new(1.0).unwrap());
    for k in 0..300 {
        let gap = 1e-8 * 1.08_f64.powi(k);
        let (a, b) = (kept.evaluate(1.0, 1.0, gap), solved.evaluate(1.0, 1.0, gap));
        let (a, b) = (a.matrix(), b.matrix());
        assert!((a - b).amax() < 1e-8 * (1.0 + b.amax()), "{gap}");
    }
}

#[test]
fn stored_table_gives_the_same_bits() {
    let table = NearField::new(3.0).unwrap();
    let text = serde_json::to_string(&table).unwrap();
    assert_eq!(serde_json::from_str::<NearField>(&text).unwrap(), table);
    let other = text.replacen("\"version\":1", "\"version\":999", 1);
    assert!(serde_json::from_str::<NearField>(&other).is_err());
    let torn = text.replacen("],[", "],[1.0],[", 1);
    assert!(serde_json::from_str::<NearField>(&torn).is_err());
}

/// Draws 10,000 pairs: 6 size ratios (1, 30, and four log-uniform between), each with gaps
/// log-uniform in ξ from 1e-8 to 50, either sphere first, a random size; resistance and pair term
/// from tables.
#[test]
fn resistance_is_spd_and_pair_terms_semidefinite_for_10000_pairs_from_six_tables() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut drawn = 0;
    for k in 0..6 {
        let ratio = match k {
            0 => 1.0,
            1 => 30.0,
            _ => log_uniform(&mut random, 1.0, 30.0),
        };
        let table = NearField::new(ratio).unwrap();
        for _ in 0..1667 {
            let a = log_uniform(&mut random, 0.1, 10.0);
            let radii = if random.random() {
                [a, a * ratio]
            } else {
                [a * ratio, a]
            };
            let xi = log_uniform(&mut random, 1e-8, 50.0);
            let gap = 0.5 * xi * (radii[0] + radii[1]);
            let term = table.evaluate(radii[0], radii[1], gap).matrix();
            let resistance = normalised(&(term + far_field(radii, gap)), radii);
            assert!(
                resistance.cholesky().is_some(),
                "{radii:?} {xi}: not positive definite"
            );
            let term = normalised(&term, radii);
            let least = term.symmetric_eigenvalues().min();
            // Rounding of the largest entry, and the table's error where the term vanishes.
            let rounding = 1e-14 * term.amax() + 1e-11;
            assert!(least > -rounding, "{radii:?} {xi}: {least:e}");
            drawn += 1;
        }
    }
    assert!(drawn >= 10_000);
}

/// Draws 100 pairs solved one by one: size ratio log-uniform in 0.01..100, gap over the smaller
/// radius log-uniform in 0.05..50.
#[test]
fn solved_resistance_is_spd_for_100_pairs_of_any_size_ratio() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(2);
    for _ in 0..100 {
        let radii = [1.0, log_uniform(&mut random, 0.01, 100.0)];
        let gap = log_uniform(&mut random, 0.05, 50.0) * radii[1].min(1.0);
        let distance = radii[0] + radii[1] + gap;
        let resistance = two_sphere_resistance(radii[0], radii[1], distance).unwrap();
        assert!((resistance - resistance.transpose()).amax() <= 1e-12 * resistance.amax());
        assert!(normalised(&resistance, radii).cholesky().is_some());
        let term = normalised(&(resistance - far_field(radii, gap)), radii);
        let least = term.symmetric_eigenvalues().min();
        assert!(
            least > -1e-11 * term.amax().max(1.0),
            "{radii:?} {gap}: {least:e}"
        );
    }
}

#[test]
fn slip_resistance_of_equal_spheres_follows_the_published_fit() {
    let table = NearField::equal_spheres();
    for xi in [1e-8_f64, 1e-6, 1e-4, 1e-3, 1e-2] {
        let l = xi.ln();
        let published = -PI * (l - 6.04 + 6.33 / l) / (1.0 - 4.69 / l);
        let found = table.slip_resistance(1.0, 1.0, xi);
        assert!((found / published - 1.0).abs() < 0.005, "{xi}");
        assert!((table.slip_resistance(2.0, 2.0, 2.0 * xi) / found - 2.0).abs() < 1e-13);
    }
}

#[test]
fn slip_resistance_undoes_the_slip_of_a_free_pair() {
    let (radii, gap) = ([0.8, 2.0], 0.3);
    let table = NearField::new(2.5).unwrap();
    let r = two_sphere_resistance(radii[0], radii[1], radii[0] + radii[1] + gap).unwrap();
    let velocity = [0, 1, 2, 6, 7, 8];
    let r_fu = SMatrix::<f64, 6, 6>::from_fn(|i, j| r[(velocity[i], velocity[j])]);
    let arms = radii.map(|a| a + 0.5 * gap);
    // Unit friction: +t on i, −t on j, torques l on both.
    let friction = SVector::<f64, 6>::from([0.0, 1.0, arms[0], 0.0, -1.0, arms[1]]);
    let v = r_fu.try_inverse().unwrap() * friction;
    let slip = v[4] - v[1] - arms[0] * v[2] - arms[1] * v[5];
    let k = table.slip_resistance(radii[0], radii[1], gap);
    assert!((k * slip + 1.0).abs() < 1e-9, "{}", k * slip);
    assert!((table.slip_resistance(radii[1], radii[0], gap) - k).abs() < 1e-14 * k);
}

#[test]
fn pair_term_does_not_depend_on_which_sphere_is_first() {
    let table = NearField::new(4.0).unwrap();
    let n = Vec2::new(0.6, 0.8);
    let [i, j] = [
        [0.1, -0.4, 0.3, 0.5, -0.2, 0.7],
        [0.9, 0.2, -0.7, -0.6, 0.3, 0.1],
    ];
    let [of_i, of_j] = table.evaluate(0.5, 2.0, 0.01).apply(n, &[i, j]);
    let exchanged = table.evaluate(2.0, 0.5, 0.01).apply(-n, &[j, i]);
    let size = of_i.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    for (found, expected) in exchanged.into_iter().zip([of_j, of_i]) {
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12 * size);
        }
    }
}
