//! Products and solves with the mobility and the resistance, planned once.

use crate::common::spheres::{Spheres, difference, dot, spheres, vector};
use nalgebra::{SVector, Vector2, Vector3};
use sd_core::cell::Cell;
use sd_core::instant::{self, Configuration, InstantContacts};
use sd_core::model::SolverSettings;
use sd_core::products::{Mobility, Resistance};
use sd_core::two_sphere::two_sphere_resistance;
use sd_core::{
    Bulk, Error, Hydrodynamics, Layer, LeadingOrder, NearFields, RunSpace, VelocityGradient,
};

const FULL: Hydrodynamics = Hydrodynamics::StokesianDynamics;

fn mobility<S: RunSpace>(spheres: &Spheres<S>) -> Mobility<S> {
    Mobility::new(&spheres.cell, &spheres.radii, &spheres.centres, 1e-8).unwrap()
}

/// All hydrodynamics in few and in many spheres, whose methods differ: closer than the far field's
/// near pairs, and in reach of lubrication.
fn cases<S: RunSpace>() -> Vec<(Hydrodynamics, Spheres<S>, f64)> {
    let [few, many] = if S::DIMENSIONS == 2 { [6, 12] } else { [4, 5] };
    let lubrication = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
    vec![
        (FULL, spheres(few, 2.2, 0.0), 1e-9),
        (FULL, spheres(many, 2.2, 0.0), 2e-5),
        (Hydrodynamics::BallMelrose, spheres(few, 2.2, 0.0), 1e-8),
        (Hydrodynamics::BallMelrose, spheres(many, 2.2, 0.0), 1e-8),
        (lubrication, spheres(many, 2.2, 0.0), 1e-8),
    ]
}

fn resistance_is_symmetric_positive_definite_and_inverted<S: RunSpace>() {
    for (hydrodynamics, spheres, tolerance) in cases::<S>() {
        let n = spheres.radii.len();
        let what = format!("{hydrodynamics:?}, {n} spheres");
        let mut resistance = spheres.resistance(hydrodynamics);
        let [x, y] = [0.4, 2.9].map(|seed| vector::<S>(n, S::MODES, seed));
        let [mut rx, mut ry, mut back] = [(); 3].map(|()| vec![0.0; S::MODES * n]);
        resistance.apply(&x, &mut rx).unwrap();
        resistance.apply(&y, &mut ry).unwrap();
        let size = (dot(&x, &rx) * dot(&y, &ry)).sqrt();
        let asymmetry = (dot(&y, &rx) - dot(&x, &ry)).abs() / size;
        assert!(asymmetry < tolerance, "{what}: {asymmetry:e}");
        assert!(dot(&x, &rx) > 0.0 && dot(&y, &ry) > 0.0, "{what}");

        // A product of a layer may have a net force through its pair terms, which the far field
        // does not balance: begin with the forces.
        let mut velocities = vec![0.0; S::MODES * n];
        resistance.solve(&x, &mut velocities).unwrap();
        assert!(dot(&x, &velocities) > 0.0, "{what}");
        resistance.apply(&velocities, &mut back).unwrap();
        let error = difference(&back, &x);
        assert!(error < tolerance, "{what}: {error:e}");

        // The power that keeps spheres moving is that of the far field alone, or more.
        if hydrodynamics == FULL {
            let modes = S::MODES + S::STRAINS;
            let mut far = vec![0.0; modes * n];
            let all: Vec<f64> = x
                .chunks_exact(S::MODES)
                .flat_map(|x| [x, &vec![0.0; S::STRAINS]].concat())
                .collect();
            mobility(&spheres).solve(&all, &mut far).unwrap();
            assert!(dot(&x, &rx) > dot(&all, &far), "{what}");
        }
    }
}

#[test]
fn resistance_of_a_layer_is_symmetric_positive_definite_and_inverted() {
    resistance_is_symmetric_positive_definite_and_inverted::<Layer>();
}

#[test]
fn resistance_of_a_suspension_is_symmetric_positive_definite_and_inverted() {
    resistance_is_symmetric_positive_definite_and_inverted::<Bulk>();
}

/// Spheres on a disordered lattice, in a cell and in unbounded fluid.
fn with_and_without_images<S: RunSpace>(seed: f64) -> [Spheres<S>; 2] {
    let unbounded = Spheres {
        cell: Cell::Unbounded,
        ..spheres(5, 2.2, seed)
    };
    [spheres(5, 2.2, seed), unbounded]
}

fn mobility_is_symmetric_positive_definite_and_inverted<S: RunSpace>() {
    for spheres in with_and_without_images::<S>(0.0) {
        let (n, mut mobility) = (spheres.radii.len(), mobility(&spheres));
        let [mut x, y] = [0.4, 2.9].map(|seed| vector::<S>(n, S::ALL_MODES, seed));
        if spheres.cell == Cell::Unbounded {
            // A net force.
            x[0] += 5.0;
        }
        let [mut mx, mut my, mut back] = [(); 3].map(|()| vec![0.0; S::ALL_MODES * n]);
        mobility.apply(&x, &mut mx).unwrap();
        mobility.apply(&y, &mut my).unwrap();
        let size = (dot(&x, &mx) * dot(&y, &my)).sqrt();
        assert!((dot(&y, &mx) - dot(&x, &my)).abs() < 1e-7 * size);
        assert!(dot(&x, &mx) > 0.0 && dot(&y, &my) > 0.0);
        mobility.solve(&mx, &mut back).unwrap();
        let error = difference(&back, &x);
        assert!(error < 1e-6, "{error:e}");
        mobility.apply(&back, &mut my).unwrap();
        let error = difference(&my, &mx);
        assert!(error < 1e-6, "{error:e}");
    }
}

#[test]
fn mobility_of_a_layer_is_symmetric_positive_definite_and_inverted() {
    mobility_is_symmetric_positive_definite_and_inverted::<Layer>();
}

#[test]
fn mobility_of_a_suspension_is_symmetric_positive_definite_and_inverted() {
    mobility_is_symmetric_positive_definite_and_inverted::<Bulk>();
}

/// Out of the range of lubrication, the resistance is the inverse of the far field's mobility with
/// rigid spheres: E = 0.
fn mobility_inverts_the_resistance_of_distant_spheres<S: RunSpace>(count: i32, tolerance: f64) {
    let spheres = spheres::<S>(count, 4.3, 0.0);
    let (n, modes) = (spheres.radii.len(), S::MODES + S::STRAINS);
    let velocities = vector::<S>(n, S::MODES, 0.7);
    let mut forces = vec![0.0; S::MODES * n];
    let mut resistance = spheres.resistance(FULL);
    resistance.apply(&velocities, &mut forces).unwrap();
    let stresslets = resistance.stresslets();
    let by_sphere = forces.chunks_exact(S::MODES).zip(stresslets);
    let all: Vec<f64> = by_sphere
        .flat_map(|(force, s)| {
            let opposite: Vec<f64> = (0..S::STRAINS).map(|k| -s[k]).collect();
            [force, &opposite].concat()
        })
        .collect();
    let mut motion = vec![0.0; modes * n];
    mobility(&spheres).apply(&all, &mut motion).unwrap();
    if S::DIMENSIONS == 2 {
        // A common translation has no meaning; that of `velocities` is zero.
        for k in 0..2 {
            let mean = motion.iter().skip(k).step_by(modes).sum::<f64>() / n as f64;
            for velocity in motion.iter_mut().skip(k).step_by(modes) {
                *velocity -= mean;
            }
        }
    }
    for (found, expected) in motion
        .chunks_exact(modes)
        .zip(velocities.chunks_exact(S::MODES))
    {
        for k in 0..modes {
            let expected = expected.get(k).unwrap_or(&0.0);
            assert!((found[k] - expected).abs() < tolerance, "{found:?}");
        }
    }
}

#[test]
fn mobility_inverts_the_resistance_of_distant_spheres_in_full_matrices() {
    mobility_inverts_the_resistance_of_distant_spheres::<Layer>(3, 1e-7);
    mobility_inverts_the_resistance_of_distant_spheres::<Bulk>(3, 1e-7);
}

#[test]
fn mobility_inverts_the_resistance_of_many_distant_spheres() {
    mobility_inverts_the_resistance_of_distant_spheres::<Layer>(11, 1e-5);
    mobility_inverts_the_resistance_of_distant_spheres::<Bulk>(5, 1e-5);
}

fn solves_are_those_of_an_instant<S: RunSpace>() {
    for (hydrodynamics, spheres, _) in cases::<S>() {
        let n = spheres.radii.len();
        let forces = vector::<S>(n, S::MODES, 1.1);
        let (mut linear, mut turning) = (Vec::new(), Vec::new());
        for force in S::by_sphere(&forces) {
            linear.push(S::translation(force));
            turning.push(S::rotation(force));
        }
        let configuration = Configuration::<S> {
            centres: spheres.centres.clone(),
            radii: spheres.radii.clone(),
            cell: spheres.cell,
            hydrodynamics,
            background: VelocityGradient::<S>::simple_shear(0.0).into(),
            forces: linear,
            torques: turning,
        };
        let tables = NearFields::default();
        let expected = instant::solve(&configuration, &InstantContacts::None, &tables).unwrap();
        let mut velocities = vec![0.0; S::MODES * n];
        let mut resistance = spheres.resistance(hydrodynamics);
        // An earlier solve under other forces leaves no trace.
        let other = vector::<S>(n, S::MODES, 5.0);
        resistance.solve(&other, &mut velocities).unwrap();
        resistance.solve(&forces, &mut velocities).unwrap();
        for (found, expected) in S::by_sphere(&velocities).iter().zip(expected.disturbances) {
            for k in 0..S::MODES {
                assert_eq!(
                    found[k].to_bits(),
                    expected[k].to_bits(),
                    "{hydrodynamics:?}"
                );
            }
        }
        for (found, expected) in resistance.stresslets().iter().zip(expected.stresslets) {
            assert_eq!(*found, expected, "{hydrodynamics:?}");
        }
    }
}

#[test]
fn solves_are_those_of_an_instant_to_the_bit() {
    solves_are_those_of_an_instant::<Layer>();
    solves_are_those_of_an_instant::<Bulk>();
}

/// All numbers of products and solves at the present positions.
fn numbers<S: RunSpace>(resistance: &mut Resistance<S>, n: usize) -> Vec<f64> {
    let x = vector::<S>(n, S::MODES, 0.4);
    let [mut product, mut solution] = [(); 2].map(|()| vec![0.0; S::MODES * n]);
    resistance.apply(&x, &mut product).unwrap();
    resistance.solve(&x, &mut solution).unwrap();
    [product, solution].concat()
}

fn moved_spheres_have_the_bits_of_a_new_plan<S: RunSpace>() {
    for (hydrodynamics, before, _) in cases::<S>() {
        let count = (before.radii.len() as f64)
            .powf(1.0 / S::DIMENSIONS as f64)
            .round();
        #[expect(clippy::cast_possible_truncation, reason = "a small whole number")]
        let after = spheres::<S>(count as i32, 2.2, 4.0);
        let (n, what) = (before.radii.len(), format!("{hydrodynamics:?}"));
        let mut planned = before.resistance(hydrodynamics);
        let first = numbers(&mut planned, n);
        planned.set_positions(&after.cell, &after.centres).unwrap();
        let moved = numbers(&mut planned, n);
        assert_ne!(first, moved, "{what}");
        assert_eq!(
            moved,
            numbers(&mut after.resistance(hydrodynamics), n),
            "{what}"
        );

        // Refused positions leave those before.
        let mut overlapping = after.centres.clone();
        overlapping[1] = overlapping[0];
        let error = planned
            .set_positions(&after.cell, &overlapping)
            .unwrap_err();
        assert!(
            matches!(error, Error::Overlap { i: 0, j: 1, .. }),
            "{error}"
        );
        assert_eq!(numbers(&mut planned, n), moved, "{what}");
    }
    let [before, after] = [0.0, 4.0].map(with_and_without_images::<S>);
    for (before, after) in before.into_iter().zip(after) {
        let n = before.radii.len();
        let x = vector::<S>(n, S::ALL_MODES, 0.4);
        let mut planned = mobility(&before);
        planned.set_positions(&after.cell, &after.centres).unwrap();
        let [mut moved, mut new] = [(); 2].map(|()| vec![0.0; S::ALL_MODES * n]);
        planned.apply(&x, &mut moved).unwrap();
        mobility(&after).apply(&x, &mut new).unwrap();
        assert_eq!(moved, new);
        planned.solve(&x, &mut moved).unwrap();
        mobility(&after).solve(&x, &mut new).unwrap();
        assert_eq!(moved, new);
    }
}

#[test]
fn moved_spheres_of_a_layer_have_the_bits_of_a_new_plan() {
    moved_spheres_have_the_bits_of_a_new_plan::<Layer>();
}

#[test]
fn moved_spheres_of_a_suspension_have_the_bits_of_a_new_plan() {
    moved_spheres_have_the_bits_of_a_new_plan::<Bulk>();
}

/// The mobility has the first multipoles of a sphere: what it neglects falls with the distance.
#[test]
fn mobility_of_two_spheres_far_apart_is_that_of_the_exact_functions() {
    let radii = [1.0, 0.7];
    let x: [f64; 12] = vector::<Bulk>(2, 6, 0.3).try_into().unwrap();
    let errors = [5.0, 10.0, 20.0].map(|distance| {
        let exact = two_sphere_resistance(radii[0], radii[1], distance).unwrap();
        let expected = exact * SVector::from(x);
        let centres = [Vector2::zeros(), Vector2::new(distance, 0.0)];
        let mut layer = Mobility::<Layer>::new(&Cell::Unbounded, &radii, &centres, 1e-8).unwrap();
        let mut forces = vec![0.0; 12];
        layer.solve(&x, &mut forces).unwrap();

        // The same modes in three dimensions.
        let centres = [Vector3::zeros(), Vector3::new(distance, 0.0, 0.0)];
        let mut pair = Mobility::<Bulk>::new(&Cell::Unbounded, &radii, &centres, 1e-8).unwrap();
        let planar = [0, 1, 5, 6, 7, 8];
        let (mut all, mut found) = ([0.0; 22], [0.0; 22]);
        for (k, x) in x.iter().enumerate() {
            all[11 * (k / 6) + planar[k % 6]] = *x;
        }
        pair.solve(&all, &mut found).unwrap();
        let found: Vec<f64> = (0..12)
            .map(|k| found[11 * (k / 6) + planar[k % 6]])
            .collect();
        assert!(difference(&found, &forces) < 1e-7, "{distance}");
        difference(&forces, expected.as_slice())
    });
    assert!(errors[0] < 1e-3, "{errors:?}");
    for pair in errors.windows(2) {
        assert!(pair[1] < pair[0] / 16.0, "{errors:?}");
    }
}

#[test]
fn two_spheres_under_forces_move_by_the_exact_functions() {
    use crate::common::data::data;
    let mut checked = 0;
    for case in data("two_sphere_exact.json")["cases"].as_array().unwrap() {
        let Some(name) = case["case"].as_str().filter(|name| name.starts_with('F')) else {
            continue;
        };
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let mut pair = Resistance::<Layer>::new(
            FULL,
            &Cell::Unbounded,
            &[number(&case["radii"][0]), number(&case["radii"][1])],
            &[
                Vector2::zeros(),
                Vector2::new(number(&case["separation"]), 0.0),
            ],
            &NearFields::default(),
            &SolverSettings::precise(),
        )
        .unwrap();
        let forces: Vec<f64> = (0..2)
            .flat_map(|i| {
                let force = &case["forces"][i];
                [number(&force[0]), number(&force[1]), 0.0]
            })
            .collect();
        let mut velocities = [0.0; 6];
        pair.solve(&forces, &mut velocities).unwrap();
        for i in 0..2 {
            let expected = &case["velocity_disturbance"][i];
            let expected = [
                &expected[0],
                &expected[1],
                &case["angular_velocity_disturbance"][i],
            ];
            for (found, expected) in velocities[3 * i..].iter().zip(expected.map(number)) {
                assert!(
                    (found - expected).abs() < 1e-7,
                    "{name}: {found} {expected}"
                );
            }
        }
        checked += 1;
    }
    assert!(checked >= 4);
}

#[test]
fn bad_input_is_refused_with_the_sphere_and_the_number() {
    let spheres = spheres::<Layer>(3, 4.3, 0.0);
    let (n, mut layer) = (spheres.radii.len(), spheres.resistance(FULL));
    let mut velocities = vec![0.0; 3 * n];
    let mut forces = vector::<Layer>(n, 3, 0.0);
    forces[5] = f64::NAN;
    let error = layer.solve(&forces, &mut velocities).unwrap_err();
    assert_eq!(
        error.to_string(),
        "forces of sphere 1 must be finite, got NaN"
    );
    let error = layer.solve(&vec![1.0; 3 * n], &mut velocities).unwrap_err();
    assert!(
        matches!(error, Error::NetForce { direction: 'x', net } if net == n as f64),
        "{error}"
    );
    let error = layer.apply(&forces[1..], &mut velocities).unwrap_err();
    assert!(
        matches!(
            error,
            Error::Length {
                field: "velocities",
                ..
            }
        ),
        "{error}"
    );
    let mut centres = spheres.centres.clone();
    centres[2].y = f64::INFINITY;
    let error = layer.set_positions(&spheres.cell, &centres).unwrap_err();
    assert_eq!(
        error.to_string(),
        "centres of sphere 2 must be finite, got inf"
    );
    let wide = Cell::equal_sides(14.0, 0.0).unwrap();
    let error = layer.set_positions(&wide, &spheres.centres).unwrap_err();
    assert!(matches!(error, Error::OutOfRange { .. }), "{error}");
    let thin = Cell::equal_sides(3.0, 0.0).unwrap();
    let mut near = spheres.resistance(Hydrodynamics::BallMelrose);
    let error = near.set_positions(&thin, &spheres.centres).unwrap_err();
    assert!(matches!(error, Error::CellTooSmall { .. }), "{error}");

    let mut far = mobility(&spheres);
    let ones = vec![1.0; 6 * n];
    let error = far.apply(&ones, &mut vec![0.0; 6 * n]).unwrap_err();
    assert!(matches!(error, Error::NetForce { .. }), "{error}");
    let touching = [Vector3::zeros(), Vector3::new(1.9, 0.0, 0.0)];
    let cell = Cell::<Bulk>::equal_sides(10.0, 0.0).unwrap();
    let error = Mobility::new(&cell, &[1.0; 2], &touching, 1e-6)
        .err()
        .unwrap();
    assert!(matches!(error, Error::Overlap { .. }), "{error}");
    let mut alone = Mobility::new(&Cell::Unbounded, &[1.0], &[Vector3::zeros()], 1e-6).unwrap();
    let error = alone.set_positions(&cell, &[Vector3::zeros()]).unwrap_err();
    assert!(matches!(error, Error::OutOfRange { .. }), "{error}");
}
