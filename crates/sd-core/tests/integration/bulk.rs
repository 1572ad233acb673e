//! Three dimensions: agreement with numbers computed independently of this program
//! (`tests/data/README.md`), symmetries, limits.

use crate::common::data::{data, difference, numbers, vectors};
use nalgebra::{Matrix3, Rotation3, Vector3};
use sd_core::bulk::TracelessTensor;
use sd_core::cell::Cell;
use sd_core::instant::{self, InstantContacts};
use sd_core::{Bulk, Error, Hydrodynamics, LeadingOrder, NearFields, Space as _, VelocityGradient};
use serde_json::Value;
use std::f64::consts::PI;

type Configuration = instant::Configuration<Bulk>;

/// Motion and stresslets of a configuration without contacts.
#[derive(Debug)]
struct Solved {
    velocities: Vec<Vector3<f64>>,
    angular_velocities: Vec<Vector3<f64>>,
    stresslets: Vec<TracelessTensor>,
    viscosity: Option<f64>,
    dissipation: Option<f64>,
}

fn solve(configuration: &Configuration, tables: &NearFields) -> Result<Solved, Error> {
    let solved = instant::solve(configuration, &InstantContacts::None, tables)?;
    let part = |first: usize| {
        let motions = solved.disturbances.iter();
        motions
            .map(|v| Vector3::from_column_slice(&v[first..first + 3]))
            .collect()
    };
    let tensors = solved.stresslets.iter().map(Bulk::tensor);
    Ok(Solved {
        velocities: part(0),
        angular_velocities: part(3),
        stresslets: tensors
            .map(|[xx, yy, xy, xz, yz]| TracelessTensor { xx, yy, xy, xz, yz })
            .collect(),
        viscosity: solved.stress.map(|stress| stress.viscosity),
        dissipation: solved.stress.map(|stress| stress.dissipation),
    })
}

/// Spheres of radius 1 in simple shear, without forces.
fn sheared(
    centres: Vec<Vector3<f64>>,
    cell: &Cell<sd_core::Bulk>,
    hydrodynamics: Hydrodynamics,
) -> Configuration {
    let n = centres.len();
    Configuration {
        centres,
        radii: vec![1.0; n],
        cell: *cell,
        hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vector3::zeros(); n],
        torques: vec![Vector3::zeros(); n],
    }
}

fn compare(solved: &Solved, part: &Value, what: &str) {
    let flat =
        |list: &[Vector3<f64>]| -> Vec<f64> { list.iter().flat_map(|v| [v.x, v.y, v.z]).collect() };
    for (name, ours) in [
        ("velocity_disturbance", &solved.velocities),
        ("angular_velocity_disturbance", &solved.angular_velocities),
    ] {
        let error = difference(flat(ours), &flat(&vectors(&part[name])));
        assert!(error < 1e-6, "{what} {name}: {error:e}");
    }
    let names = ["xx", "yy", "xy", "xz", "yz"];
    for (k, name) in names
        .map(|name| format!("stresslet_{name}"))
        .iter()
        .enumerate()
    {
        let component = |s: &TracelessTensor| [s.xx, s.yy, s.xy, s.xz, s.yz][k];
        let error = difference(
            solved.stresslets.iter().map(component),
            &numbers(&part[name]),
        );
        assert!(error < 1e-6, "{what} {name}: {error:e}");
    }
    for (name, ours) in [
        ("viscosity", solved.viscosity),
        ("dissipation", solved.dissipation),
    ] {
        if let Some(expected) = part[name].as_f64() {
            let error = (ours.unwrap() / expected - 1.0).abs();
            assert!(error < 1e-6, "{what} {name}: {error:e}");
        }
    }
}

#[test]
fn instants_agree_with_an_independent_program() {
    for (number, instant) in data("bulk_instant.json")
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
    {
        for (part, hydrodynamics) in [
            ("full", Hydrodynamics::StokesianDynamics),
            ("ball_melrose", Hydrodynamics::BallMelrose),
        ] {
            let centres = vectors(&instant["centres"]);
            let mut configuration = if instant["cell"].is_null() {
                sheared(centres, &Cell::Unbounded, hydrodynamics)
            } else {
                let sides = Vector3::from_column_slice(&numbers(&instant["cell"]));
                let offset = instant["offset"].as_f64().unwrap();
                sheared(
                    centres,
                    &Cell::periodic(sides, offset).unwrap(),
                    hydrodynamics,
                )
            };
            if instant["cell"].is_null() {
                let e = |name: &str| instant["rate_of_strain"][name].as_f64().unwrap();
                let spin = Vector3::from_column_slice(&numbers(&instant["angular_velocity"]));
                configuration.background =
                    VelocityGradient::from_parts(&["xx", "yy", "xy", "xz", "yz"].map(e), &spin)
                        .into();
                configuration.forces = vectors(&instant["forces"]);
                configuration.torques = vectors(&instant["torques"]);
            }
            let solved = solve(&configuration, &NearFields::default()).unwrap();
            if let (Some(viscosity), Some(dissipation)) = (solved.viscosity, solved.dissipation) {
                assert!((viscosity - 1.0 - dissipation).abs() < 1e-10);
            }
            compare(
                &solved,
                &instant[part],
                &format!("instant {number}, {part}"),
            );
        }
    }
}

/// A cubic lattice in as many cells as the near field needs.
fn lattice(name: &str, phi: f64) -> (Cell<sd_core::Bulk>, Vec<Vector3<f64>>) {
    let spheres = places(name).len() as f64;
    lattice_of_side(name, (4.0 / 3.0 * PI * spheres / phi).cbrt())
}

/// The spheres of one cube, in sides of it.
fn places(name: &str) -> &'static [[f64; 3]] {
    match name {
        "SC" => &[[0.0; 3]],
        "BCC" => &[[0.0; 3], [0.5; 3]],
        _ => &[[0.0; 3], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]],
    }
}

fn lattice_of_side(name: &str, side: f64) -> (Cell<sd_core::Bulk>, Vec<Vector3<f64>>) {
    let cells = (1..100)
        .find(|&cells| f64::from(cells) * side >= 8.0)
        .unwrap();
    let mut centres = Vec::new();
    for k in 0..i32::pow(cells, 3) {
        let corner = [k % cells, k / cells % cells, k / cells / cells].map(f64::from);
        let corner = Vector3::from(corner);
        centres.extend(
            places(name)
                .iter()
                .map(|&x| (corner + Vector3::from(x)) * side),
        );
    }
    let cell = Cell::periodic(Vector3::repeat(f64::from(cells) * side), 0.0).unwrap();
    (cell, centres)
}

#[test]
fn lattices_near_contact_have_their_exact_slopes() {
    // Viscosity against one over the gap: strain along the axes (alpha) and E_xy (beta); 0 where it
    // is logarithmic.
    for (name, side, alpha, beta) in [
        ("SC", 1.0, 3.0 * PI / 8.0, 0.0),
        ("BCC", 2.0 / 3.0_f64.sqrt(), 0.0, 3.0_f64.sqrt() * PI / 4.0),
        (
            "FCC",
            2.0_f64.sqrt(),
            3.0 * PI / (8.0 * 2.0_f64.sqrt()),
            3.0 * PI / (4.0 * 2.0_f64.sqrt()),
        ),
    ] {
        let viscosities = |xi: f64| {
            let (cell, centres) = lattice_of_side(name, side * (2.0 + xi));
            let mut configuration = sheared(centres, &cell, Hydrodynamics::BallMelrose);
            let spin = configuration.background.linear().angular_velocity();
            configuration.background =
                VelocityGradient::from_parts(&[0.5, -0.5, 0.5, 0.0, 0.0], &spin).into();
            let solved = solve(&configuration, &NearFields::default()).unwrap();
            let s = solved.stresslets[0];
            let density = configuration.centres.len() as f64 / cell.content().unwrap();
            [0.5 * (s.xx - s.yy), s.xy].map(|stress| density * stress)
        };
        let (near, nearer) = (viscosities(1e-3), viscosities(1e-4));
        for (k, expected) in [alpha, beta].into_iter().enumerate() {
            let slope = (nearer[k] - near[k]) / (1e4 - 1e3);
            assert!(
                (slope - expected).abs() < 1e-3,
                "{name} {k}: {slope} {expected}"
            );
        }
        if name == "SC" {
            let slope = (nearer[1] - near[1]) / 10.0_f64.ln();
            assert!((slope / (PI / 4.0) - 1.0).abs() < 0.02, "{slope}");
        }
    }
}

#[test]
fn drags_and_viscosities_of_cubic_lattices_agree_with_an_independent_program() {
    for case in data("bulk_lattices.json").as_array().unwrap() {
        let phi = case["volume_fraction"].as_f64().unwrap();
        let name = case["lattice"].as_str().unwrap();
        let (cell, centres) = lattice(name, phi);
        let volume = cell.content().unwrap();
        let mut configuration = sheared(centres, &cell, Hydrodynamics::StokesianDynamics);
        // By the symmetry of the lattice both strains and the force decouple: one solution contains
        // all three.
        let (axes, diagonal) = (0.5, 0.3);
        let spin = configuration.background.linear().angular_velocity();
        configuration.background =
            VelocityGradient::from_parts(&[diagonal, -diagonal, axes, 0.0, 0.0], &spin).into();
        configuration.forces.fill(Vector3::x());
        let solved = solve(&configuration, &NearFields::default()).unwrap();
        let s = solved.stresslets[0];
        let density = configuration.centres.len() as f64 / volume;
        for (key, found) in [
            ("viscosity_shear_axes", 1.0 + density * s.xy / (2.0 * axes)),
            (
                "viscosity_shear_diagonal",
                1.0 + density * (s.xx - s.yy) / (4.0 * diagonal),
            ),
            ("drag", 1.0 / (6.0 * PI * solved.velocities[0].x)),
        ] {
            let expected = case[key].as_f64().unwrap();
            let error = (found / expected - 1.0).abs();
            assert!(error < 1e-5, "{name} {phi} {key}: {found} {expected}");
        }
    }
}

fn matrix(t: &TracelessTensor) -> Matrix3<f64> {
    Matrix3::new(t.xx, t.xy, t.xz, t.xy, t.yy, t.yz, t.xz, t.yz, -t.xx - t.yy)
}

/// A cluster of unequal spheres under forces, torques and a strain.
fn cluster(hydrodynamics: Hydrodynamics) -> Configuration {
    let centres = [
        [0.0; 3],
        [2.1, 0.3, -0.2],
        [0.4, 2.5, 1.1],
        [1.0, 0.9, -2.3],
    ];
    let forces = [
        [1.0, 0.2, -0.5],
        [0.3, -1.0, 0.7],
        [-0.2, 0.1, 0.4],
        [0.6, 0.5, 0.9],
    ];
    let torques = [
        [0.1, 0.7, -0.5],
        [0.9, -0.2, 0.3],
        [-0.6, 0.8, 0.1],
        [0.2, 0.5, -0.9],
    ];
    Configuration {
        centres: centres.map(Vector3::from).to_vec(),
        radii: vec![1.0, 1.0, 1.4, 1.0],
        cell: Cell::Unbounded,
        hydrodynamics,
        background: VelocityGradient::from_parts(&[0.3, -0.5, 0.2, -0.4, 0.6], &Vector3::zeros())
            .into(),
        forces: forces.map(Vector3::from).to_vec(),
        torques: torques.map(Vector3::from).to_vec(),
    }
}

/// Largest difference between the rotated motion and the motion of the rotated configuration.
fn turned(configuration: &Configuration, turn: &Matrix3<f64>) -> f64 {
    let mut other = configuration.clone();
    for list in [&mut other.centres, &mut other.forces, &mut other.torques] {
        for x in list.iter_mut() {
            *x = turn * *x;
        }
    }
    let rows = [0, 1, 2].map(|k| other.background.linear().rows()[k].transpose());
    let gradient = turn * Matrix3::from_rows(&rows) * turn.transpose();
    let rows = [0, 1, 2].map(|k| gradient.row(k).transpose());
    other.background = VelocityGradient::new(&rows).unwrap().into();
    let tables = NearFields::default();
    let (a, b) = (
        solve(configuration, &tables).unwrap(),
        solve(&other, &tables).unwrap(),
    );
    let mut worst: f64 = 0.0;
    for i in 0..a.velocities.len() {
        worst = worst
            .max((turn * a.velocities[i] - b.velocities[i]).amax())
            .max((turn * a.angular_velocities[i] - b.angular_velocities[i]).amax());
        let stress = turn * matrix(&a.stresslets[i]) * turn.transpose();
        worst = worst.max((stress - matrix(&b.stresslets[i])).amax());
    }
    worst
}

#[test]
fn motion_turns_with_the_configuration() {
    let turn = Rotation3::from_euler_angles(0.7, -1.1, 2.3);
    for hydrodynamics in [
        Hydrodynamics::StokesianDynamics,
        Hydrodynamics::BallMelrose,
        Hydrodynamics::Lubrication(LeadingOrder::DEFAULT),
    ] {
        let worst = turned(&cluster(hydrodynamics), turn.matrix());
        assert!(worst < 1e-10, "{hydrodynamics:?}: {worst:e}");
    }
}

#[test]
fn motion_turns_with_a_cubic_cell() {
    let cell = Cell::periodic(Vector3::new(11.5, 11.5, 11.5), 0.0).unwrap();
    for hydrodynamics in [Hydrodynamics::StokesianDynamics, Hydrodynamics::BallMelrose] {
        let configuration = Configuration {
            cell,
            ..cluster(hydrodynamics)
        };
        // The two quarter turns that make up the 24 rotations of the cube.
        for turn in [
            Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0),
        ] {
            let worst = turned(&configuration, &turn);
            assert!(worst < 1e-10, "{hydrodynamics:?}: {worst:e}");
        }
    }
}

#[test]
fn centres_in_a_plane_move_as_in_the_layer() {
    use sd_core::modes::Vec2;
    let places = [[0.0, 0.0], [2.1, 0.3], [0.4, 2.5], [4.0, 1.9]];
    let (forces, torques) = (
        [[1.0, 0.2], [0.3, -1.0], [-0.2, 0.1], [0.6, 0.5]],
        [0.1, -0.7, 0.4, 0.9],
    );
    for hydrodynamics in [
        Hydrodynamics::StokesianDynamics,
        Hydrodynamics::BallMelrose,
        Hydrodynamics::Lubrication(LeadingOrder::DEFAULT),
    ] {
        let radii = vec![1.0, 1.0, 1.4, 1.0];
        let layer = instant::solve(
            &instant::Configuration {
                centres: places.map(Vec2::from).to_vec(),
                radii: radii.clone(),
                cell: sd_core::cell::Cell::Unbounded,
                hydrodynamics,
                background: VelocityGradient::simple_shear(1.0).into(),
                forces: forces.map(Vec2::from).to_vec(),
                torques: torques.to_vec(),
            },
            &instant::InstantContacts::None,
            &NearFields::default(),
        )
        .unwrap();
        let flat = |x: &[f64; 2]| Vector3::new(x[0], x[1], 0.0);
        let solved = solve(
            &Configuration {
                centres: places.iter().map(flat).collect(),
                radii,
                cell: Cell::Unbounded,
                hydrodynamics,
                background: VelocityGradient::simple_shear(1.0).into(),
                forces: forces.iter().map(flat).collect(),
                torques: torques.iter().map(|&t| Vector3::new(0.0, 0.0, t)).collect(),
            },
            &NearFields::default(),
        )
        .unwrap();
        for i in 0..places.len() {
            let [x, y, spin] = layer.disturbances[i];
            let velocity = solved.velocities[i] - Vector3::new(x, y, 0.0);
            let turning = solved.angular_velocities[i] - Vector3::new(0.0, 0.0, spin);
            assert!(
                velocity.amax() < 1e-10 && turning.amax() < 1e-10,
                "{velocity} {turning}"
            );
            let (xx, yy, xy) = layer.stresslet(i);
            let s = solved.stresslets[i];
            for difference in [s.xx - xx, s.yy - yy, s.xy - xy, s.xz, s.yz] {
                assert!(
                    difference.abs() < 1e-10,
                    "{hydrodynamics:?} {i}: {difference:e}"
                );
            }
        }
    }
}

#[test]
fn dilute_suspension_has_einsteins_viscosity() {
    let cell = Cell::periodic(Vector3::new(40.0, 40.0, 40.0), 0.0).unwrap();
    let phi = 4.0 / 3.0 * PI / 64000.0;
    for hydrodynamics in [Hydrodynamics::StokesianDynamics, Hydrodynamics::BallMelrose] {
        let solved = solve(
            &sheared(vec![Vector3::zeros()], &cell, hydrodynamics),
            &NearFields::default(),
        )
        .unwrap();
        let added = (solved.viscosity.unwrap() - 1.0) / phi;
        assert!((added - 2.5).abs() < 1e-3, "{added}");
        assert!((solved.dissipation.unwrap() / phi - added).abs() < 1e-10);
    }
}

#[test]
fn bad_configurations_are_refused() {
    let cell = Cell::periodic(Vector3::new(7.0, 9.0, 9.0), 0.0).unwrap();
    let good = cluster(Hydrodynamics::BallMelrose);
    let refused = |change: &dyn Fn(&mut Configuration)| {
        let mut bad = good.clone();
        change(&mut bad);
        solve(&bad, &NearFields::default()).unwrap_err().to_string()
    };
    assert!(refused(&|c| c.cell = cell).contains("wide along x"));
    assert!(refused(&|c| c.centres[1] = Vector3::new(1.9, 0.0, 0.0)).contains("overlap"));
    assert!(refused(&|c| c.radii[0] = 0.0).contains("radii"));
    assert!(refused(&|c| c.forces.clear()).contains("forces"));
    assert!(refused(&|c| c.centres[0].z = f64::NAN).contains("centres"));
}
