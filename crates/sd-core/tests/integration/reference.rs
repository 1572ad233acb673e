//! Agreement with numbers computed independently of this program; their sources are in
//! `tests/data/README.md`.

use crate::common::data::{data, difference, numbers, vectors};
use sd_core::cell::Cell;
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::modes::Vec2;
use sd_core::{Hydrodynamics, NearFields, VelocityGradient};
use serde_json::Value;

/// Compares one instant with one part of the file, to `tolerance` of the largest number of each
/// kind.
fn compare(instant: &SolvedConfiguration, part: &Value, what: &str, tolerance: f64) {
    let velocities: Vec<f64> = vectors::<2>(&part["velocity_disturbance"])
        .iter()
        .flat_map(|v| [v.x, v.y])
        .collect();
    let n = instant.disturbances.len();
    let kinds = [
        (
            "velocity",
            difference(
                instant.disturbances.iter().flat_map(|v| [v[0], v[1]]),
                &velocities,
            ),
        ),
        (
            "angular velocity",
            difference(
                instant.disturbances.iter().map(|v| v[2]),
                &numbers(&part["angular_velocity_disturbance"]),
            ),
        ),
        (
            "stresslet xx",
            difference(
                (0..n).map(|i| instant.stresslet(i).0),
                &numbers(&part["stresslet_xx"]),
            ),
        ),
        (
            "stresslet yy",
            difference(
                (0..n).map(|i| instant.stresslet(i).1),
                &numbers(&part["stresslet_yy"]),
            ),
        ),
        (
            "stresslet xy",
            difference(
                (0..n).map(|i| instant.stresslet(i).2),
                &numbers(&part["stresslet_xy"]),
            ),
        ),
    ];
    let stress = instant.stress.unwrap();
    let mut all: Vec<_> = kinds.to_vec();
    for (name, ours) in [
        ("viscosity", stress.viscosity),
        ("viscosity_stresslet", stress.viscosity_stresslet),
    ] {
        all.push((name, difference([ours], &[part[name].as_f64().unwrap()])));
    }
    if let Some(contacts) = part["contacts"].as_array() {
        assert_eq!(instant.contacts.len(), contacts.len());
        let forces: Vec<f64> = contacts
            .iter()
            .map(|c| c["normal_force"].as_f64().unwrap())
            .collect();
        for (ours, theirs) in instant.contacts.iter().zip(contacts) {
            assert_eq!(theirs["i"].as_u64(), Some(ours.pair.i as u64));
            assert_eq!(theirs["j"].as_u64(), Some(ours.pair.j as u64));
        }
        all.push((
            "normal force",
            difference(instant.contacts.iter().map(|c| c.normal_force), &forces),
        ));
    }
    for (kind, error) in all {
        assert!(error < tolerance, "{what}: {kind} differs by {error:.2e}");
    }
}

#[test]
fn layers_under_shear() {
    for layer in data("monolayer_instant.json").as_array().unwrap() {
        let cell = numbers(&layer["cell"]);
        let centres = vectors(&layer["centres"]);
        let n = centres.len();
        let configuration = |hydrodynamics| Configuration {
            centres: centres.clone(),
            radii: vec![1.0; n],
            cell: Cell::periodic(
                Vec2::new(cell[0], cell[1]),
                layer["offset"].as_f64().unwrap(),
            )
            .unwrap(),
            hydrodynamics,
            background: VelocityGradient::simple_shear(1.0).into(),
            forces: vec![Vec2::zeros(); n],
            torques: vec![0.0; n],
        };
        // The `full` numbers have their own noise. Ours move by less than 1e-8 when the Ewald
        // parameter goes from 0.2 to 0.8 and its tolerance from 1e-8 to 1e-12, and the mobility
        // agrees with a brute-force lattice sum to 1e-8 (far_field/tests.rs); the differences look
        // random from sphere to sphere. Hence two more tolerances.
        for (name, hydrodynamics, alone_to, constrained_to) in [
            ("ball_melrose", Hydrodynamics::BallMelrose, 1e-6, 1e-6),
            ("full", Hydrodynamics::StokesianDynamics, 4e-6, 2e-5),
        ] {
            let configuration = configuration(hydrodynamics);
            let tables = NearFields::default();
            let alone = solve(&configuration, &InstantContacts::None, &tables).unwrap();
            let what = format!("{name}, {n} spheres");
            compare(&alone, &layer[name], &what, alone_to);
            let part = &layer[&format!("{name}_with_contacts")];
            let pairs = part["contacts"]
                .as_array()
                .unwrap()
                .iter()
                .map(|c| ["i", "j"].map(|k| usize::try_from(c[k].as_u64().unwrap()).unwrap()))
                .collect();
            let constrained = solve(
                &configuration,
                &InstantContacts::HeldPairs { pairs },
                &tables,
            )
            .unwrap();
            let what = format!("{name}, {n} spheres, listed contacts");
            compare(&constrained, part, &what, constrained_to);
        }
    }
}

#[test]
fn two_spheres_are_exact() {
    for case in data("two_sphere_exact.json")["cases"].as_array().unwrap() {
        let radii = numbers(&case["radii"]);
        let separation = case["separation"].as_f64().unwrap();
        let e = &case["rate_of_strain"];
        let strain = |key: &str| e[key].as_f64().unwrap();
        let configuration: Configuration = Configuration {
            centres: vec![Vec2::zeros(), Vec2::new(separation, 0.0)],
            radii,
            cell: Cell::Unbounded,
            hydrodynamics: Hydrodynamics::StokesianDynamics,
            background: VelocityGradient::from_parts(&["xx", "yy", "xy"].map(strain), &0.0).into(),
            forces: vectors(&case["forces"]),
            torques: vec![0.0; 2],
        };
        let instant = solve(
            &configuration,
            &InstantContacts::None,
            &NearFields::default(),
        )
        .unwrap();
        let velocities = vectors::<2>(&case["velocity_disturbance"]);
        let spins = numbers(&case["angular_velocity_disturbance"]);
        for i in 0..2 {
            let ours = instant.disturbances[i];
            for (a, b) in [
                (ours[0], velocities[i].x),
                (ours[1], velocities[i].y),
                (ours[2], spins[i]),
            ] {
                // Seven digits are printed.
                let printed = 1e-6_f64.mul_add(b.abs(), 5e-10);
                assert!(
                    (a - b).abs() <= printed,
                    "{} {}: {a} against {b}",
                    case["case"],
                    case["s_prime"]
                );
            }
        }
    }
}
