//! Instants in general lattices: agreement with an independent program (`tests/data/README.md`),
//! independence of the basis, agreement with sheared cells.

use crate::common::data::{data, difference, numbers, vectors};
use nalgebra::{Vector2, Vector3};
use sd_core::cell::{Cell, Lattice};
use sd_core::contact::Laws;
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::model::Surface;
use sd_core::{
    Bulk, Error, Hydrodynamics, LeadingOrder, NearFields, RunSpace, Space, VelocityGradient,
};
use serde_json::Value;

const FULL: Hydrodynamics = Hydrodynamics::StokesianDynamics;
const BALL_MELROSE: Hydrodynamics = Hydrodynamics::BallMelrose;

fn periodic<S: Space>(vectors: &[S::Vector]) -> Cell<S> {
    Cell::Periodic(Lattice::new(vectors).unwrap())
}

/// A configuration of the reference file.
fn recorded(instant: &Value, hydrodynamics: Hydrodynamics) -> Configuration<Bulk> {
    let centres = vectors(&instant["centres"]);
    let e = |name: &str| instant["rate_of_strain"][name].as_f64().unwrap();
    let n = centres.len();
    Configuration {
        centres,
        radii: vec![1.0; n],
        cell: periodic(&vectors(&instant["lattice"])),
        hydrodynamics,
        background: VelocityGradient::from_parts(
            &["xx", "yy", "xy", "xz", "yz"].map(e),
            &Vector3::from_column_slice(&numbers(&instant["angular_velocity"])),
        )
        .into(),
        forces: vec![Vector3::zeros(); n],
        torques: vec![Vector3::zeros(); n],
    }
}

fn solved<S: RunSpace>(
    configuration: &Configuration<S>,
    request: &InstantContacts<S>,
) -> SolvedConfiguration<S> {
    solve(configuration, request, &NearFields::default()).unwrap()
}

/// The largest difference from the numbers of the file, relative to the largest of each kind, when
/// every sphere of the file stands for `copies` in sequence.
fn error_of(solved: &SolvedConfiguration<Bulk>, part: &Value, copies: usize) -> f64 {
    let repeated = |list: Vec<f64>, width: usize| -> Vec<f64> {
        list.chunks(width)
            .flat_map(|numbers| numbers.repeat(copies))
            .collect()
    };
    let mut worst: f64 = 0.0;
    for (name, first) in [
        ("velocity_disturbance", 0),
        ("angular_velocity_disturbance", 3),
    ] {
        let theirs: Vec<Vector3<f64>> = vectors(&part[name]);
        let theirs = theirs.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
        let ours = solved.disturbances.iter();
        let ours = ours.flat_map(|v| v[first..first + 3].to_vec());
        worst = worst.max(difference(ours, &repeated(theirs, 3)));
    }
    for (k, name) in ["xx", "yy", "xy", "xz", "yz"].into_iter().enumerate() {
        let theirs = repeated(numbers(&part[format!("stresslet_{name}")]), 1);
        let ours = solved.stresslets.iter().map(|s| Bulk::tensor(s)[k]);
        worst = worst.max(difference(ours, &theirs));
    }
    let stress = solved.stress.unwrap();
    for (name, ours) in [
        ("viscosity", stress.viscosity),
        ("dissipation", stress.dissipation),
    ] {
        worst = worst.max((ours / part[name].as_f64().unwrap() - 1.0).abs());
    }
    worst
}

#[test]
fn instants_in_extension_agree_with_an_independent_program() {
    for instant in data("lattice_instant.json").as_array().unwrap() {
        for (part, hydrodynamics) in [("full", FULL), ("ball_melrose", BALL_MELROSE)] {
            let solved = solved(&recorded(instant, hydrodynamics), &InstantContacts::None);
            let error = error_of(&solved, &instant[part], 1);
            assert!(error < 1e-8, "{} {part}: {error:e}", instant["what"]);
        }
    }
}

#[test]
fn copies_of_a_lattice_move_as_one() {
    // 192 spheres: the far field by fast Fourier transforms, the near field pair by pair.
    for instant in data("lattice_instant.json").as_array().unwrap() {
        for (part, hydrodynamics) in [("full", FULL), ("ball_melrose", BALL_MELROSE)] {
            let mut one = recorded(instant, hydrodynamics);
            let basis: Vec<Vector3<f64>> = vectors(&instant["lattice"]);
            let images: Vec<[i32; 3]> = (0..8).map(|k| [k % 2, k / 2 % 2, k / 4]).collect();
            let shifts: Vec<_> = images.iter().map(|&x| one.cell.image_vector(x)).collect();
            let copies = |x| shifts.iter().map(move |shift| x + shift);
            one.centres = one.centres.iter().flat_map(copies).collect();
            let n = one.centres.len();
            one.radii = vec![1.0; n];
            [one.forces, one.torques] = [0, 1].map(|_| vec![Vector3::zeros(); n]);
            one.cell = periodic(&basis.iter().map(|a| a * 2.0).collect::<Vec<_>>());
            let solved = solved(&one, &InstantContacts::None);
            let error = error_of(&solved, &instant[part], images.len());
            // That of the iterated far field.
            assert!(error < 1e-5, "{} {part}: {error:e}", instant["what"]);
        }
    }
}

/// The largest difference of two solutions.
fn distance<S: Space>(a: &SolvedConfiguration<S>, b: &SolvedConfiguration<S>) -> f64 {
    let numbers = |solved: &SolvedConfiguration<S>| -> Vec<f64> {
        let motions = solved.disturbances.iter();
        let motions = motions.flat_map(|v| v.as_ref().to_vec());
        let stresses = solved.stresslets.iter();
        let stresses = stresses.flat_map(|s| S::full_tensor(s));
        let forces = solved.contacts.iter().map(|c| c.normal_force);
        let stress = solved.stress.unwrap();
        let bulk = [stress.viscosity, stress.dissipation];
        motions.chain(stresses).chain(forces).chain(bulk).collect()
    };
    let (a, b) = (numbers(a), numbers(b));
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().zip(&b);
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A sheared suspension of `count`³ spheres, disturbed from a cubic lattice.
fn suspension(count: u32, hydrodynamics: Hydrodynamics) -> Configuration<Bulk> {
    let side = 2.4;
    let centres: Vec<_> = (0..count.pow(3))
        .map(|k| {
            let place = [k % count, k / count % count, k / count / count].map(f64::from);
            let k = f64::from(k);
            Vector3::from(place) * side
                + Vector3::new((1.7 * k).sin(), (2.9 * k).cos(), (0.9 * k).sin()) * 0.1
        })
        .collect();
    let n = centres.len();
    let cell = Cell::periodic(Vector3::repeat(f64::from(count) * side), 1.1 * side);
    Configuration {
        radii: (0..n).map(|k| if k % 3 == 0 { 1.1 } else { 1.0 }).collect(),
        cell: cell
            .and_then(|cell| cell.with_cross_offset(-0.7 * side))
            .unwrap(),
        hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: (0..n)
            .map(|k| Vector3::new((0.7 * k as f64).sin(), 0.3, -0.1))
            .collect(),
        torques: vec![Vector3::new(0.1, -0.2, 0.3); n],
        centres,
    }
}

/// A sheared layer of `count`² spheres, disturbed from a square lattice.
fn layer(count: u32, hydrodynamics: Hydrodynamics) -> Configuration {
    let side = 2.4;
    let centres: Vec<_> = (0..count.pow(2))
        .map(|k| {
            let place = Vector2::new(f64::from(k % count), f64::from(k / count));
            let k = f64::from(k);
            place * side + Vector2::new((1.7 * k).sin(), (2.9 * k).cos()) * 0.1
        })
        .collect();
    let n = centres.len();
    Configuration {
        radii: (0..n).map(|k| if k % 3 == 0 { 1.1 } else { 1.0 }).collect(),
        cell: Cell::periodic(Vector2::repeat(f64::from(count) * side), 1.1 * side).unwrap(),
        hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        // In pairs of opposite ones: the fluid around a layer bears no net force.
        forces: (0..n)
            .map(|k| {
                let force = Vector2::new((0.7 * (k / 2) as f64).sin(), 0.3);
                if k % 2 == 0 { force } else { -force }
            })
            .collect(),
        torques: vec![0.1; n],
        centres,
    }
}

fn contacts<S: Space>() -> InstantContacts<S> {
    let surface = Surface {
        roughness: 0.2,
        friction: 0.3,
        critical_load: 0.0,
    };
    InstantContacts::under(Laws::rigid(surface), 0.01)
}

/// All hydrodynamics.
fn hydrodynamics() -> [Hydrodynamics; 3] {
    let lubrication = LeadingOrder {
        cutoff: 0.5,
        regularisation: 1e-3,
    };
    [FULL, BALL_MELROSE, Hydrodynamics::Lubrication(lubrication)]
}

/// Compares a configuration in its sheared cell, in the lattice of the cell's vectors and in
/// others of the same lattice. Contacts touch the same pairs, at images of the vectors given.
fn check_bases<S: RunSpace>(
    configuration: &Configuration<S>,
    bases: &[Vec<S::Vector>; 2],
    tolerance: f64,
) {
    for request in [InstantContacts::None, contacts()] {
        let sheared = solved(configuration, &request);
        let [first, second] = bases.each_ref().map(|vectors| {
            let mut other = configuration.clone();
            other.cell = periodic(vectors);
            let solved = solved(&other, &request);
            for contact in &solved.contacts {
                let pair = &contact.pair;
                let between = configuration.centres[pair.j] - configuration.centres[pair.i]
                    + other.cell.image_vector(pair.image);
                let gap = between - pair.normal * pair.distance;
                assert!(S::norm_squared(&gap) < 1e-24);
            }
            solved
        });
        // Contacts under an iterated far field are solved to a tolerance.
        let is_iterated = tolerance > 1e-8 && !first.contacts.is_empty();
        let exact = if is_iterated { 1e-8 } else { 1e-12 };
        let what = format!(
            "{:?}, {}",
            configuration.hydrodynamics,
            first.contacts.len()
        );
        for (name, error, allowed) in [
            ("sheared cell", distance(&sheared, &first), tolerance),
            ("bases", distance(&first, &second), exact),
        ] {
            assert!(error < allowed, "{what}: {name} {error:e}");
        }
    }
}

#[test]
fn numbers_do_not_depend_on_the_basis_of_a_layer() {
    for hydrodynamics in hydrodynamics() {
        for (count, tolerance) in [(6, 1e-8), (12, 1e-6)] {
            let configuration = layer(count, hydrodynamics);
            let lattice = configuration.cell.lattice().unwrap();
            let &[a, b] = lattice.vectors() else {
                unreachable!("a layer has two")
            };
            check_bases(
                &configuration,
                &[vec![a, b], vec![a + b * 2.0, b]],
                tolerance,
            );
        }
    }
}

#[test]
fn numbers_do_not_depend_on_the_basis_of_a_suspension() {
    for hydrodynamics in hydrodynamics() {
        for (count, tolerance) in [(4, 1e-8), (5, 1e-5)] {
            let configuration = suspension(count, hydrodynamics);
            let lattice = configuration.cell.lattice().unwrap();
            let &[a, b, c] = lattice.vectors() else {
                unreachable!("a suspension has three")
            };
            let other = vec![a + b, b, c - a - b];
            check_bases(&configuration, &[vec![a, b, c], other], tolerance);
        }
    }
}

#[test]
fn a_lattice_too_short_for_pairs_is_refused() {
    let mut configuration = layer(4, BALL_MELROSE);
    let [a, b] = [Vector2::new(9.7, 0.0), Vector2::new(3.0, 8.0)];
    configuration.cell = periodic(&[a, a + b]);
    configuration.radii.fill(1.1);
    let refused = solve(
        &configuration,
        &InstantContacts::None,
        &NearFields::default(),
    );
    let error = refused.unwrap_err();
    assert!(matches!(error, Error::LatticeTooShort { .. }), "{error}");
    let text = error.to_string();
    assert!(
        text.contains("`lattice` is 8.5440, less than 8.8000"),
        "{text}"
    );
}
