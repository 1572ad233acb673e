//! Forces and torques of the user in runs, in fluid at rest and in shear.

use crate::common::data::data;
use nalgebra::Vector3;
use sd_core::cell::Cell;
use sd_core::model::{Segment, SolverSettings};
use sd_core::products::Resistance;
use sd_core::{
    Bulk, Error, Hydrodynamics, Layer, LeadingOrder, NearFields, Params, RunSpace, Sample,
    Simulation, Snapshot,
};
use std::f64::consts::PI;

const FULL: Hydrodynamics = Hydrodynamics::StokesianDynamics;
const NEAR: Hydrodynamics = Hydrodynamics::BallMelrose;
const LUBRICATION: Hydrodynamics = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);

/// A suspension in fluid at rest.
fn at_rest(spheres: usize, volume_fraction: f64, hydrodynamics: Hydrodynamics) -> Params {
    Params::builder()
        .spheres(spheres)
        .volume_fraction(volume_fraction)
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(hydrodynamics)
        .at_rest()
        .build()
        .unwrap()
}

fn run<S: RunSpace>(params: &Params) -> Simulation<S> {
    Simulation::new(params, 1, &NearFields::default()).unwrap()
}

/// A run from given places.
fn run_from(params: &Params, place: impl Fn(usize, f64) -> [f64; 3]) -> Simulation<Bulk> {
    let mut snapshot = Snapshot::<Bulk>::start(params, 1).unwrap();
    let side = snapshot.side;
    for (k, centre) in snapshot.centres.iter_mut().enumerate() {
        *centre = place(k, side);
    }
    let settings = SolverSettings::precise();
    Simulation::with_settings(params, snapshot, &NearFields::default(), &settings).unwrap()
}

fn steps<S: RunSpace>(run: &mut Simulation<S>, count: usize) -> Vec<Sample> {
    (0..count).map(|_| run.step().unwrap()).collect()
}

#[test]
fn separate_spheres_move_and_turn_against_the_drag_of_stokes() {
    let mut params = at_rest(8, 0.01, LUBRICATION);
    (params.size_ratio, params.large_fraction) = (2.0, 0.5);
    let mut run = run::<Bulk>(&params);
    let before: Vec<_> = run.unwrapped().collect();
    run.use_constant_forces(&[[0.3, 0.0, -1.0, 0.0, 5.0, 0.0]; 8])
        .unwrap();
    let samples = steps(&mut run, 20);
    assert!(samples.iter().all(|sample| sample.minimum_gap > 0.5));
    let (time, mut radii) = (run.time(), run.radii().to_vec());
    assert!((time - 0.2).abs() < 1e-15);
    for (k, (x, old)) in run.unwrapped().zip(before).enumerate() {
        let a = run.radii()[k];
        let expected = Vector3::new(0.3, 0.0, -1.0) * (time / (6.0 * PI * a));
        assert!((x - old - expected).norm() < 1e-13);
        let half = 0.5 * 5.0 * time / (8.0 * PI * a.powi(3));
        let [w, x, y, z] = run.orientations()[k];
        assert!((w - half.cos()).abs() + (y - half.sin()).abs() < 1e-13);
        assert_eq!((x, z), (0.0, 0.0));
    }
    radii.dedup();
    assert_eq!(radii.len(), 2, "two sizes");
}

/// A simple cubic lattice of `count` spheres along each side, falling with weights of one in units
/// of 6π: its velocity, the same for all spheres, is 1/K.
fn velocity_of_a_falling_lattice(count: usize, volume_fraction: f64) -> f64 {
    let n = count.pow(3);
    let mut run = run_from(&at_rest(n, volume_fraction, FULL), |k, side| {
        [k % count, k / count % count, k / count.pow(2)]
            .map(|column| (column as f64 + 0.5) * side / count as f64)
    });
    run.use_constant_forces(&vec![[0.0, 0.0, -6.0 * PI, 0.0, 0.0, 0.0]; n])
        .unwrap();
    let before: Vec<_> = run.unwrapped().collect();
    let sample = steps(&mut run, 5)[4];
    let velocity = run.velocities()[0][2];
    for (x, old) in run.unwrapped().zip(before) {
        let expected = Vector3::new(0.0, 0.0, velocity * run.time());
        assert!((x - old - expected).norm() < 1e-6);
    }
    let volume = run.side().powi(3);
    let power = -velocity * 6.0 * PI * n as f64 / volume;
    assert!((sample.applied_power / power - 1.0).abs() < 1e-6);
    assert!((sample.dissipation / power - 1.0).abs() < 1e-5);
    -velocity
}

#[test]
fn cubic_lattices_fall_as_hasimoto_and_an_independent_program_say() {
    for (count, volume_fraction) in [(2, 0.01), (2, 0.027)] {
        let found = velocity_of_a_falling_lattice(count, volume_fraction);
        // The next term, and moments beyond the stresslet, are of that order.
        let phi = volume_fraction;
        let hasimoto = 1.0 - 1.7601 * phi.cbrt() + phi - 1.5593 * phi * phi;
        assert!(
            (found - hasimoto).abs() < 2.0 * phi * phi,
            "{found} {hasimoto}"
        );
    }
    let mut checked = 0;
    for row in data("bulk_lattices.json").as_array().unwrap() {
        let number = |key: &str| row[key].as_f64().unwrap();
        let count = match (row["lattice"].as_str().unwrap(), number("volume_fraction")) {
            ("SC", 0.027) => 2,
            ("SC", 0.125) => 3,
            ("SC", 0.216) => 4,
            _ => continue,
        };
        let found = velocity_of_a_falling_lattice(count, number("volume_fraction"));
        assert!((found * number("drag") - 1.0).abs() < 1e-5, "{found}");
        checked += 1;
    }
    assert_eq!(checked, 3);
}

/// Spheres of radius 1 placed at random one by one where there is space, in a cubic cell: to second
/// order in the volume fraction as in equilibrium.
fn placed_at_random(spheres: usize, cell: &Cell<Bulk>, side: f64, seed: u64) -> Vec<Vector3<f64>> {
    let mut state = seed;
    let mut uniform = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut centres: Vec<Vector3<f64>> = Vec::new();
    while centres.len() < spheres {
        let x = Vector3::new(uniform(), uniform(), uniform()) * side;
        if centres.iter().all(|y| cell.nearest(x - y).0.norm() > 2.001) {
            centres.push(x);
        }
    }
    centres
}

#[test]
fn spheres_in_equilibrium_sink_as_in_simulations_by_multipoles() {
    let (spheres, volume_fraction) = (27, 0.1);
    let side = (spheres as f64 * 4.0 / 3.0 * PI / volume_fraction).cbrt();
    let cell = Cell::<Bulk>::equal_sides(side, 0.0).unwrap();
    let (mut mean, count) = (0.0, 64);
    for seed in 0..count {
        let centres = placed_at_random(spheres, &cell, side, 7 + 1000 * seed);
        let mut resistance = Resistance::<Bulk>::new(
            FULL,
            &cell,
            &vec![1.0; spheres],
            &centres,
            &NearFields::default(),
            &SolverSettings::precise(),
        )
        .unwrap();
        let weights = [0.0, 0.0, -6.0 * PI, 0.0, 0.0, 0.0].repeat(spheres);
        let mut velocities = vec![0.0; 6 * spheres];
        resistance.solve(&weights, &mut velocities).unwrap();
        let sum: f64 = velocities.iter().skip(2).step_by(6).sum();
        mean -= sum / (spheres as f64 * count as f64);
    }
    // Ladd, J. Chem. Phys. 93, 3484 (1990): 0.522 of many spheres, and in a cell of N spheres
    // 1.76 (φ/N)^(1/3) S(0)/η less, with S(0) = (1 − φ)^4/((1 + 2φ)^2 − 4φ^3 + φ^4) = 0.456 and
    // η = 1.311. The 64 places scatter by 0.01.
    let structure = 0.9_f64.powi(4) / (1.2_f64.powi(2) - 4e-3 + 1e-4);
    let expected = 0.522 - 1.7601 * (volume_fraction / 27.0).cbrt() * structure / 1.311;
    assert!((mean - expected).abs() < 0.02, "{mean} {expected}");
}

#[test]
fn power_of_the_forces_is_dissipated() {
    for (hydrodynamics, tolerance) in [(NEAR, 1e-9), (FULL, 1e-4)] {
        for shear in [0.0, 1.0, -1.0] {
            let rest = at_rest(40, 0.1, hydrodynamics);
            let mut run = run::<Bulk>(&Params {
                at_rest: shear == 0.0,
                direction: if shear == 0.0 { 1.0 } else { shear },
                ..rest
            });
            run.use_forces(|instant, forces| {
                for (k, force) in forces.iter_mut().enumerate() {
                    let x = instant.centres[k];
                    *force = [x.y.sin(), 3.0, -x.x.cos(), 2.0, 1.0, (k as f64).sin()];
                }
            });
            let sample = run.step().unwrap();
            assert_eq!(sample.contacts, 0);
            let by_flow = if shear == 0.0 {
                assert!(sample.viscosity.is_nan());
                0.0
            } else {
                sample.viscosity - 1.0
            };
            let error = (by_flow + sample.applied_power) / sample.dissipation - 1.0;
            assert!(sample.applied_power.abs() > 0.01 * sample.dissipation);
            assert!(
                error.abs() < tolerance,
                "{hydrodynamics:?}, {shear}: {error:e}"
            );
        }
    }
}

#[test]
fn forces_follow_the_state_and_the_time() {
    let mut params = at_rest(4, 0.01, LUBRICATION);
    params.time_step = 0.05;
    let heights = [3.0, 5.0, 4.0, 7.0];
    let mut run = run_from(&params, |k, side| {
        let along = (k as f64 + 0.5) * side / 4.0;
        [along, heights[k], along]
    });
    let before: Vec<_> = run.unwrapped().collect();
    run.use_forces(|instant, forces| {
        for (force, x) in forces.iter_mut().zip(instant.centres) {
            force[0] = 6.0 * PI * instant.time.cos();
            force[1] = 6.0 * PI * (5.0 - x.y);
        }
    });
    steps(&mut run, 20);
    assert!((run.time() - 1.0).abs() < 1e-14 && run.strain() == 0.0);
    for ((x, old), height) in run.unwrapped().zip(before).zip(heights) {
        assert!((x.y - 5.0 - (height - 5.0) * (-1.0_f64).exp()).abs() < 1e-6);
        assert!((x.x - old.x - 1.0_f64.sin()).abs() < 1e-7 && x.z == old.z);
    }
}

#[test]
fn spheres_pressed_together_bear_the_force_at_their_roughness() {
    let params = Params::builder()
        .spheres(2)
        .area_fraction(0.05)
        .roughness(0.01)
        .friction(0.0)
        .shear_rate(0.0)
        .hydrodynamics(NEAR)
        .at_rest()
        .build()
        .unwrap();
    let mut snapshot = Snapshot::<Layer>::start(&params, 1).unwrap();
    snapshot.centres = vec![[3.0, 4.0], [5.05, 4.0]];
    let mut run = Simulation::from_snapshot(&params, snapshot, &NearFields::default()).unwrap();
    run.use_constant_forces(&[[50.0, 0.0, 0.0], [-50.0, 0.0, 0.0]])
        .unwrap();
    let last = steps(&mut run, 100)[99];
    let contact = run.contacts().next().unwrap();
    assert_eq!(last.contacts, 1);
    assert!((contact.gap - 0.01).abs() < 1e-5, "{}", contact.gap);
    assert!(
        (contact.normal_force - 50.0).abs() < 1e-3,
        "{}",
        contact.normal_force
    );
}

#[test]
fn forces_of_zero_have_the_bits_of_none() {
    let sheared = Params {
        at_rest: false,
        ..at_rest(80, 0.45, NEAR)
    };
    let [mut none, mut zero] = [(); 2].map(|()| run::<Bulk>(&sheared));
    zero.use_forces(|_, _| {});
    for _ in 0..10 {
        assert_eq!(none.step().unwrap(), zero.step().unwrap());
    }
    let text = |run: &Simulation<Bulk>| serde_json::to_string(&run.snapshot()).unwrap();
    assert_eq!(text(&none), text(&zero));
}

#[test]
fn nothing_moves_in_fluid_at_rest_without_forces() {
    let mut run = run::<Bulk>(&at_rest(40, 0.3, FULL));
    let before = run.snapshot();
    let sample = steps(&mut run, 3)[2];
    assert_eq!(run.snapshot().centres, before.centres);
    assert_eq!(run.snapshot().orientations, before.orientations);
    assert_eq!((sample.dissipation, sample.applied_power), (0.0, 0.0));
    assert!(sample.viscosity.is_nan() && sample.stress.shear.total() == 0.0);
    assert_eq!((run.strain(), run.offset_at(run.time())), (0.0, 0.0));
}

#[test]
fn resumed_run_has_the_same_bits_with_the_same_forces() {
    let params = at_rest(60, 0.2, NEAR);
    let weigh = |run: &mut Simulation<Bulk>| {
        run.use_forces(|instant, forces| {
            for (force, x) in forces.iter_mut().zip(instant.centres) {
                force[2] = -3.0 - x.x.sin() * instant.time.cos();
            }
        });
    };
    let mut whole = run::<Bulk>(&params);
    weigh(&mut whole);
    steps(&mut whole, 4);
    let text = |run: &Simulation<Bulk>| serde_json::to_string(&run.snapshot()).unwrap();
    let [mut with, mut without] = [(); 2].map(|()| {
        let snapshot = serde_json::from_str(&text(&whole)).unwrap();
        Simulation::<Bulk>::from_snapshot(&params, snapshot, &NearFields::default()).unwrap()
    });
    weigh(&mut with);
    for run in [&mut whole, &mut with, &mut without] {
        steps(run, 4);
    }
    assert_eq!(text(&whole), text(&with));
    assert_ne!(text(&whole), text(&without));
}

#[test]
fn bad_forces_are_refused_with_the_sphere_and_the_number() {
    let mut run = run::<Bulk>(&at_rest(40, 0.2, NEAR));
    let mut weights = vec![[0.0, 0.0, -1.0, 0.0, 0.0, 0.0]; 40];
    let error = run.use_constant_forces(&weights[1..]).unwrap_err();
    assert_eq!(error.to_string(), "forces has 39 entries for 40 spheres");
    weights[7][4] = f64::INFINITY;
    let error = run.use_constant_forces(&weights).unwrap_err();
    assert_eq!(
        error.to_string(),
        "forces of sphere 7 must be finite, got inf"
    );

    // A step that fails leaves the run as it was.
    let before = run.snapshot();
    run.use_forces(|instant, forces| {
        if instant.time > 0.015 {
            forces[3][0] = f64::NAN;
        }
    });
    steps(&mut run, 1);
    let kept = run.snapshot();
    let error = run.step().unwrap_err();
    let Error::Step {
        step: 1, source, ..
    } = error
    else {
        panic!("{error}");
    };
    assert!(
        matches!(*source, Error::OfSphere { field: "forces", sphere: 3, value, .. } if value.is_nan())
    );
    assert_eq!(run.snapshot(), kept);
    run.remove_forces();
    steps(&mut run, 1);
    assert_eq!(run.snapshot().centres, before.centres);
}

#[test]
fn net_force_on_a_layer_in_full_stokesian_dynamics_is_refused() {
    let layer = |hydrodynamics| {
        let params = Params::builder()
            .spheres(12)
            .area_fraction(0.2)
            .roughness(0.01)
            .friction(0.0)
            .shear_rate(0.0)
            .hydrodynamics(hydrodynamics)
            .at_rest()
            .build()
            .unwrap();
        run::<Layer>(&params)
    };
    let mut full = layer(FULL);
    let weights = [[0.0, -1.0, 0.0]; 12];
    let error = full.use_constant_forces(&weights).unwrap_err();
    assert!(
        matches!(
            error,
            Error::NetForce {
                direction: 'y',
                net: -12.0
            }
        ),
        "{error}"
    );
    full.use_forces(|_, forces| forces[0] = [2.0, 0.0, 0.0]);
    let error = full.step().unwrap_err().to_string();
    assert!(
        error.contains("must sum to 0 along x") && error.contains("2e0"),
        "{error}"
    );

    // Opposite forces, torques, and net forces without a far field are allowed.
    full.use_forces(|_, forces| {
        forces[0] = [2.0, 0.0, 1.0];
        forces[1] = [-2.0, 0.0, 1.0];
    });
    full.step().unwrap();
    assert!(full.velocities()[0][0] > 0.0 && full.velocities()[1][0] < 0.0);
    let mut near = layer(NEAR);
    near.use_constant_forces(&weights).unwrap();
    near.step().unwrap();
    assert!(near.velocities().iter().all(|[_, u, _]| *u < 0.0));
}

#[test]
fn shear_is_not_imposed_on_fluid_at_rest() {
    let rest = at_rest(40, 0.2, NEAR);
    let stressed = Params {
        shear_stress: Some(2.0),
        shear_rate: 0.0,
        ..rest.clone()
    };
    let error = stressed.validate().unwrap_err().to_string();
    assert!(
        error.contains("shear_stress = 2 is imposed on fluid at rest"),
        "{error}"
    );
    let segmented = Params {
        segments: vec![Segment::default()],
        ..rest
    };
    let error = segmented.validate().unwrap_err().to_string();
    assert!(error.contains("segments"), "{error}");
}
