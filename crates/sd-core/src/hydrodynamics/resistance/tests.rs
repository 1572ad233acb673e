//! Comparison of the forms of the resistance.

use super::*;
use crate::space::modes::Vec2;
use std::f64::consts::PI;

/// Four spheres, each near another, in a cell.
fn layer() -> (Cell, Vec<Vec2>, Vec<f64>) {
    let cell = Cell::periodic(Vec2::new(12.0, 11.0), 1.5).unwrap();
    let centres = [[1.0, 1.0], [3.1, 1.3], [3.9, 3.2], [11.5, 10.2]];
    (cell, centres.map(Vec2::from).to_vec(), vec![1.0; 4])
}

#[test]
fn a_spring_pulls_its_two_spheres_whichever_way_the_resistance_is_held() {
    let (cell, centres, radii) = layer();
    let tables = NearFields::default();
    let ball_melrose = Hydrodynamics::BallMelrose;
    let mut factored = Resistance::new(ball_melrose, &cell, &radii, &tables).unwrap();
    let mut pairwise = Resistance::new_pairwise(ball_melrose, &cell, &radii, &tables, &[]).unwrap();
    let forces: Vec<f64> = (0..12).map(|k| (1.3 * f64::from(k)).sin()).collect();
    factored.assemble(&cell, &centres).unwrap();
    pairwise.assemble(&cell, &centres).unwrap();
    let springs = factored.neighbours().to_vec();
    assert!(springs.len() >= 4, "{}", springs.len());
    for (k, pair) in springs.iter().enumerate() {
        let slope = 50.0 + 10.0 * k as f64;
        factored.add_spring(pair, slope);
        pairwise.add_spring(pair, slope);
    }
    factored.factor().unwrap();
    let mut velocities = forces.clone();
    factored.solver().solve(&mut velocities);
    let mut found = vec![0.0; 12];
    pairwise.pairwise().unwrap().apply(&velocities, &mut found);
    for (force, found) in forces.iter().zip(&found) {
        assert!((force - found).abs() < 1e-12, "{force} {found}");
    }
}

#[test]
fn contacts_of_high_asperities_are_in_the_near_part() {
    let cell = Cell::<Layer>::equal_sides(30.0, 0.0).unwrap();
    // Gaps of 0.25 and 0.3.
    let centres = [[5.0, 5.0], [7.25, 5.0], [7.25, 7.0]].map(Vec2::from);
    let radii = [1.0, 1.0, 0.7];
    let tables = NearFields::default();
    for (height, pairs) in [(0.01, 0), (0.1, 1), (0.3, 2)] {
        let mut near =
            Resistance::new_pairwise(Hydrodynamics::BallMelrose, &cell, &radii, &tables, &[])
                .unwrap();
        near.expect_contacts(height);
        near.assemble(&cell, &centres).unwrap();
        let pairwise = near.pairwise().unwrap();
        assert_eq!(pairwise.pattern_pairs().len(), pairs, "{height}");
    }
}

#[test]
fn far_pairs_leave_a_positive_definite_resistance() {
    // Touching spheres on a hexagonal lattice with six neighbours each: the plain sum over pairs
    // would be indefinite.
    let (rows, distance) = (8, 2.02);
    let height = distance * 0.75_f64.sqrt();
    let cell = Cell::<Layer>::periodic(
        Vec2::new(f64::from(rows) * distance, f64::from(rows) * height),
        f64::from(rows / 2) * distance,
    )
    .unwrap();
    let centres: Vec<Vec2> = (0..rows * rows)
        .map(|k| {
            let (column, row) = (f64::from(k % rows), f64::from(k / rows));
            Vec2::new(distance * (column + 0.5 * row), height * row)
        })
        .collect();
    let radii = vec![1.0; centres.len()];
    let tables = NearFields::default();
    let full = Hydrodynamics::StokesianDynamics;
    let mut near = Resistance::new_pairwise(full, &cell, &radii, &tables, &[]).unwrap();
    near.assemble(&cell, &centres).unwrap();
    let drag = PI * 6.0;
    let together = [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]; 2];
    let (mut added, mut pairs) = (0.0, 0);
    for (pair, term) in near.far_pairs() {
        let [of_i, of_j] = term.apply(pair.normal, &together);
        added += of_i[0] + of_j[0];
        pairs += 1;
    }
    assert_eq!(pairs, 3 * centres.len());
    let left = 1.0 + added / (drag * centres.len() as f64);
    assert!(left > 0.05 && left < 0.5, "{left}");
}

#[test]
fn far_pair_alone_is_the_whole_two_sphere_resistance() {
    let cell = Cell::<Layer>::equal_sides(30.0, 0.0).unwrap();
    let centres = [Vec2::new(0.0, 0.0), Vec2::new(2.1, 0.0)];
    let tables = NearFields::default();
    let resisted = |hydrodynamics, v: &[f64]| {
        let mut near =
            Resistance::new_pairwise(hydrodynamics, &cell, &[1.0; 2], &tables, &[]).unwrap();
        near.assemble(&cell, &centres).unwrap();
        let (mut work, mut forces, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
        near.apply(v, Strains::none(), &mut work, &mut forces, &mut stresslets);
        forces
    };
    // Two touching spheres that move side by side: 6π 0.6453 each along their line (Stimson &
    // Jeffery 1926), a little more apart.
    let both = [1.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    let whole = resisted(Hydrodynamics::StokesianDynamics, &both)[0] / (6.0 * PI);
    assert!((whole - 0.65).abs() < 0.01, "{whole}");
    let without = resisted(Hydrodynamics::BallMelrose, &both)[0] / (6.0 * PI);
    assert!(without > 0.9, "{without}");
}

/// Columns of B in `F = B z`, which [`Resistance::add_random_forces`] multiplies.
fn random_columns<S: Fluid>(resistance: &Resistance<S>) -> Vec<Vec<f64>> {
    let size = S::MODES * resistance.radii().len();
    let mut columns = Vec::new();
    loop {
        let (mut column, mut drawn) = (vec![0.0; size], 0);
        let number = || {
            drawn += 1;
            if drawn == columns.len() + 1 { 1.0 } else { 0.0 }
        };
        resistance.add_random_forces(1.0, number, &mut column);
        if columns.len() == drawn {
            return columns;
        }
        columns.push(column);
    }
}

/// The largest difference between B Bᵀ and R, over the largest entry of R.
fn covariance_error<S: Fluid>(resistance: &Resistance<S>) -> f64 {
    let size = S::MODES * resistance.radii().len();
    let columns = random_columns(resistance);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for k in 0..size {
        let (mut unit, mut expected) = (vec![0.0; size], vec![0.0; size]);
        unit[k] = 1.0;
        resistance.pairwise().unwrap().apply(&unit, &mut expected);
        for (row, expected) in expected.iter().enumerate() {
            let found: f64 = columns.iter().map(|column| column[row] * column[k]).sum();
            worst = worst.max((found - expected).abs());
            largest = largest.max(expected.abs());
        }
    }
    worst / largest
}

#[test]
fn random_forces_have_the_covariance_of_the_resistance() {
    let tables = NearFields::default();
    let leading = Hydrodynamics::Lubrication(crate::LeadingOrder::DEFAULT);
    for hydrodynamics in [Hydrodynamics::BallMelrose, leading] {
        for gap in [1e-4, 0.01, 0.3, 1.5] {
            // Three spheres of two sizes, the first two at this gap.
            let radii = [1.0, 1.4, 1.0];
            let cell = Cell::<Layer>::equal_sides(30.0, 0.0).unwrap();
            let apart = 2.4 + gap;
            let centres = [
                [5.0, 5.0],
                [5.0 + 0.6 * apart, 5.0 + 0.8 * apart],
                [4.0, 7.3],
            ];
            let mut layer =
                Resistance::new_pairwise(hydrodynamics, &cell, &radii, &tables, &[]).unwrap();
            layer.assemble(&cell, &centres.map(Vec2::from)).unwrap();
            let error = covariance_error(&layer);
            assert!(error < 1e-12, "{hydrodynamics:?} {gap}: {error:e}");
            let cell = Cell::<crate::Bulk>::equal_sides(30.0, 0.0).unwrap();
            let centres = [
                [5.0, 5.0, 5.0],
                [5.0 + 0.6 * apart, 5.0 + 0.64 * apart, 5.0 + 0.48 * apart],
                [4.0, 7.0, 4.0],
            ];
            let mut suspension =
                Resistance::new_pairwise(hydrodynamics, &cell, &radii, &tables, &[]).unwrap();
            let centres = centres.map(nalgebra::Vector3::from);
            suspension.assemble(&cell, &centres).unwrap();
            let error = covariance_error(&suspension);
            assert!(error < 1e-12, "{hydrodynamics:?} {gap}: {error:e}");
        }
    }
}
