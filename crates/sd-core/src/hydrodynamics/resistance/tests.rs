//! Comparison of the forms of the resistance.

use super::*;
use crate::contact::Contact;
use crate::space::modes::Vec2;
use crate::space::{Bulk, IncidentFlow, Space, VelocityGradient};
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
    pairwise
        .pairwise()
        .unwrap()
        .apply(&velocities, &mut found, &mut Vec::new());
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

/// Columns of B in `F = B z`, which `draw` multiplies.
pub(crate) fn random_columns(
    size: usize,
    mut draw: impl FnMut(&mut dyn FnMut() -> f64, &mut [f64]),
) -> Vec<Vec<f64>> {
    let mut columns = Vec::new();
    loop {
        let (mut column, mut drawn) = (vec![0.0; size], 0);
        let mut number = || {
            drawn += 1;
            if drawn == columns.len() + 1 { 1.0 } else { 0.0 }
        };
        draw(&mut number, &mut column);
        if columns.len() == drawn {
            return columns;
        }
        columns.push(column);
    }
}

/// The shear whose rate is one of the velocities that [`difference_of_covariance`] is of.
pub(crate) fn free_shear<S: Space>() -> IncidentFlow<S> {
    VelocityGradient::<S>::simple_shear(1.0).into()
}

/// The largest difference between B Bᵀ and R, over the largest entry of R, the last row being that
/// of the rate of [`free_shear`].
pub(crate) fn difference_of_covariance<S: Fluid>(
    columns: &[Vec<f64>],
    resistance: &Resistance<S>,
) -> f64 {
    let size = S::MODES * resistance.radii().len();
    let (mut work, mut expected, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    let flow = free_shear::<S>();
    for k in 0..=size {
        let mut unit = vec![0.0; size];
        let strains = if k < size {
            unit[k] = 1.0;
            Strains::none()
        } else {
            flow.strains()
        };
        resistance.apply(&unit, strains, &mut work, &mut expected, &mut stresslets);
        let works = stresslets
            .iter()
            .map(|stresslet| S::strain_dot(stresslet, flow.strains().at(0)));
        expected.push(works.sum());
        for (row, expected) in expected.iter().enumerate() {
            let found: f64 = columns.iter().map(|column| column[row] * column[k]).sum();
            worst = worst.max((found - expected).abs());
            largest = largest.max(expected.abs());
        }
    }
    worst / largest
}

/// That difference for the forces of [`Resistance::add_random_forces`].
fn covariance_error<S: Fluid>(resistance: &mut Resistance<S>) -> f64 {
    let size = S::MODES * resistance.radii().len();
    let flow = free_shear::<S>();
    let strains = flow.strains();
    let columns = random_columns(size + 1, |number, forces| {
        let (last, forces) = forces.split_last_mut().unwrap();
        let strain = Some(strains.at(0));
        let drawn = resistance.add_random_forces(1.0, &mut *number, strain, forces);
        *last = drawn.force + drawn.rest.max(0.0).sqrt() * number();
    });
    difference_of_covariance(&columns, resistance)
}

#[test]
fn random_forces_have_the_covariance_of_the_resistance() {
    let tables = NearFields::default();
    let leading = Hydrodynamics::Lubrication(crate::LeadingOrder::DEFAULT);
    let full = Hydrodynamics::StokesianDynamics;
    for hydrodynamics in [Hydrodynamics::BallMelrose, leading, full] {
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
            let mut layer = Resistance::new(hydrodynamics, &cell, &radii, &tables).unwrap();
            layer.assemble(&cell, &centres.map(Vec2::from)).unwrap();
            let error = covariance_error(&mut layer);
            assert!(error < 1e-12, "{hydrodynamics:?} {gap}: {error:e}");
            let cell = Cell::<crate::Bulk>::equal_sides(30.0, 0.0).unwrap();
            let centres = [
                [5.0, 5.0, 5.0],
                [5.0 + 0.6 * apart, 5.0 + 0.64 * apart, 5.0 + 0.48 * apart],
                [4.0, 7.0, 4.0],
            ];
            let mut suspension = Resistance::new(hydrodynamics, &cell, &radii, &tables).unwrap();
            let centres = centres.map(nalgebra::Vector3::from);
            suspension.assemble(&cell, &centres).unwrap();
            let error = covariance_error(&mut suspension);
            assert!(error < 1e-12, "{hydrodynamics:?} {gap}: {error:e}");
        }
    }
}

/// A pair of spheres of unequal radii at a gap, along a slanted line.
fn pair<S: Fluid>(
    hydrodynamics: Hydrodynamics,
    gap: f64,
    friction: HydrodynamicFriction,
) -> Resistance<S> {
    let mut line = S::Vector::default();
    for k in 0..S::DIMENSIONS {
        line[k] = (0.7 + 1.9 * k as f64).sin();
    }
    let line = line * S::norm_squared(&line).sqrt().recip();
    let centres = [S::Vector::default(), line * (2.3 + gap)];
    let radii = [1.0, 1.3];
    let tables = NearFields::default();
    let mut both = Resistance::new(hydrodynamics, &Cell::Unbounded, &radii, &tables).unwrap();
    both.roughen(friction);
    both.update(&Cell::Unbounded, &centres).unwrap();
    both
}

/// A friction resists exactly the slip of a pair, as linear resistance does, up to its range.
fn check_friction<S: Fluid>(hydrodynamics: Hydrodynamics) {
    let friction = HydrodynamicFriction {
        coefficient: 0.7,
        range: 0.05,
    };
    // Under lubrication gaps are those of its functions.
    let shift = hydrodynamics
        .leading_order()
        .map_or(0.0, |numbers| 1.15 * numbers.regularisation);
    let flow: IncidentFlow<S> = VelocityGradient::<S>::simple_shear(1.0).into();
    for (gap, resists) in [(1e-4, true), (0.01, true), (0.05, false), (0.3, false)] {
        let [rough, smooth] = [friction, HydrodynamicFriction::default()]
            .map(|friction| pair::<S>(hydrodynamics, gap, friction));
        let motion = |phase: f64| -> Vec<f64> {
            let modes = 0..2 * S::MODES;
            modes.map(|k| (phase + 2.3 * k as f64).sin()).collect()
        };
        let [v, w] = [0.4, 1.7].map(motion);
        // Power of a motion in the flow, and forces of one in a fluid at rest times another.
        let powers = |resistance: &Resistance<S>| {
            let (mut work, mut forces, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            resistance.apply(&v, flow.strains(), &mut work, &mut forces, &mut stresslets);
            let mut power = dot(&v, &forces);
            for (sphere, stresslet) in stresslets.iter().enumerate() {
                for k in 0..S::STRAINS {
                    power += stresslet[k] * flow.strains().at(sphere)[k];
                }
            }
            let mut product = |v: &[f64], w: &[f64]| {
                let at_rest = Strains::none();
                resistance.apply(v, at_rest, &mut work, &mut forces, &mut stresslets);
                dot(w, &forces)
            };
            let symmetry = product(&v, &w) - product(&w, &v);
            (power, symmetry, product(&w, &w))
        };
        let (with, without) = (powers(&rough), powers(&smooth));
        let pair = &rough.neighbours()[0];
        let mut contact = Contact::new(*pair, rough.radii(), &flow);
        contact.set_velocities(&v);
        let slip = S::tangent_dot(&contact.slip_velocity, &contact.slip_velocity);
        let expected = friction.resistance(gap + shift) * slip;
        assert_eq!(expected > 0.0, resists);
        let found = with.0 - without.0;
        assert!(
            (found - expected).abs() < 1e-10 * with.0,
            "{gap}: {found} {expected}"
        );
        assert!(with.1.abs() < 1e-10 * with.2 && with.2 >= without.2 && without.2 > 0.0);
        let added = rough.slip_resistance(pair) - smooth.slip_resistance(pair);
        assert!((added - friction.resistance(gap + shift)).abs() < 1e-9 * (1.0 + added));
    }
}

#[test]
fn hydrodynamic_friction_dissipates_by_the_slip_and_ends_at_its_range() {
    for hydrodynamics in [
        Hydrodynamics::BallMelrose,
        Hydrodynamics::StokesianDynamics,
        Hydrodynamics::Lubrication(crate::model::LeadingOrder::DEFAULT),
    ] {
        check_friction::<Layer>(hydrodynamics);
        check_friction::<Bulk>(hydrodynamics);
    }
}
