//! Single instants.

use super::{LUBRICATION, laws, params, rigid, sheared, springs, surface};
use nalgebra::{Matrix3, Rotation3, Vector3};
use sd_core::cell::Cell;
use sd_core::contact::{ContactState, Laws, PairForces};
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::internals::{SolvePass, Span, StageContacts};
use sd_core::model::{SolverSettings, Surface};
use sd_core::modes::Vec2;
use sd_core::{
    Bulk, ContactLaws, Hydrodynamics, Layer, Method, NearFields, Space, TangentialLaw,
    VelocityGradient,
};

fn request<S: Space>(
    laws: &ContactLaws,
    friction: f64,
    springs: PairForces<S>,
) -> InstantContacts<S> {
    InstantContacts::Laws {
        laws: Laws::new(laws, surface(friction)),
        lubrication_gap: 1e-3,
        time_span: 0.005,
        springs,
        rolling_springs: PairForces::default(),
    }
}

/// Spheres in a plane: most of them touch, and they are pushed so that some slide and some stick.
const PLACES: [[f64; 2]; 7] = [
    [0.0, 0.0],
    [2.005, 0.1],
    [1.1, 1.68],
    [3.1, 1.78],
    [-0.9, 1.79],
    [4.0, -0.02],
    [2.1, 3.415],
];
const FORCES: [[f64; 2]; 7] = [
    [30.0, 12.0],
    [3.0, 20.0],
    [-2.0, 1.0],
    [-36.0, -25.0],
    [16.0, -5.0],
    [-40.0, 8.0],
    [2.0, -30.0],
];
const TORQUES: [f64; 7] = [10.0, -7.0, 4.0, 9.0, -12.0, 3.0, -5.0];

#[test]
fn spheres_in_a_plane_touch_as_in_the_layer() {
    let (mut compared, mut inexact) = (0, 0);
    for (name, choice) in laws() {
        // In units of a critical load of 0 there are neither.
        if choice.repulsion > 0.0 || choice.adhesion > 0.0 {
            continue;
        }
        for hydrodynamics in [Hydrodynamics::BallMelrose, LUBRICATION] {
            let stretched = choice.tangential == TangentialLaw::StickSlide;
            let spring = |x: f64| if stretched { x } else { 0.0 };
            let layer = solve(
                &Configuration::<Layer> {
                    centres: PLACES.map(Vec2::from).to_vec(),
                    radii: vec![1.0; 7],
                    cell: Cell::Unbounded,
                    hydrodynamics,
                    background: VelocityGradient::simple_shear(1.0).into(),
                    forces: FORCES.map(Vec2::from).to_vec(),
                    torques: TORQUES.to_vec(),
                },
                &request(&choice, 0.3, PairForces(vec![(0, 1, spring(0.7))])),
                &NearFields::default(),
            )
            .unwrap();
            // Friction without a load: no solution was found, and what was depends on the way
            // there.
            if layer
                .contacts
                .iter()
                .any(|c| c.normal_force == 0.0 && c.tangential_force != 0.0)
            {
                inexact += 1;
                continue;
            }
            compared += 1;
            let flat = |x: [f64; 2]| Vector3::new(x[0], x[1], 0.0);
            let across = flat(PLACES[1]).normalize();
            let tangent = Vector3::new(-across.y, across.x, 0.0);
            let springs = PairForces(vec![(0, 1, tangent * spring(0.7))]);
            let suspension = solve(
                &Configuration::<Bulk> {
                    centres: PLACES.map(flat).to_vec(),
                    radii: vec![1.0; 7],
                    cell: Cell::Unbounded,
                    hydrodynamics,
                    background: VelocityGradient::simple_shear(1.0).into(),
                    forces: FORCES.map(flat).to_vec(),
                    torques: TORQUES.map(|t| Vector3::new(0.0, 0.0, t)).to_vec(),
                },
                &request(&choice, 0.3, springs),
                &NearFields::default(),
            )
            .unwrap();
            let what = format!("{name}, {hydrodynamics:?}");
            let states = |state| layer.contacts.iter().filter(|c| c.state == state).count();
            assert!(
                states(ContactState::Slipping) + states(ContactState::Sticking) > 3,
                "{what} is no test"
            );
            let close = |a: f64, b: f64, scale: f64| {
                assert!((a - b).abs() < 1e-8 * scale, "{what}: {a} {b}");
            };
            for (v, w) in layer.disturbances.iter().zip(&suspension.disturbances) {
                for (a, b) in [v[0], v[1], 0.0, 0.0, 0.0, v[2]].iter().zip(w) {
                    close(*a, *b, 1.0);
                }
            }
            assert_eq!(layer.contacts.len(), suspension.contacts.len());
            for (c, d) in layer.contacts.iter().zip(&suspension.contacts) {
                close(c.normal_force, d.normal_force, 30.0);
                let n = c.pair.normal;
                for (of_layer, found) in [
                    (c.tangential_force, d.tangential_force),
                    (c.rolling_force, d.rolling_force),
                ] {
                    let expected = Vector3::new(-n.y, n.x, 0.0) * of_layer;
                    close((found - expected).amax(), 0.0, 30.0);
                }
                assert_eq!(c.state, d.state, "{what}");
            }
        }
    }
    assert!(
        inexact <= 2 && compared >= 12,
        "{compared} compared, {inexact} left out"
    );
}

/// Clusters of a sheared suspension in unbounded fluid.
fn cluster(laws: ContactLaws) -> (Configuration<Bulk>, PairForces<Bulk>) {
    let suspension = sheared(&params(laws, LUBRICATION), 60);
    let snapshot = suspension.snapshot();
    let sd_core::simulation::SchemeMemory::Laws(memory) = &snapshot.memory else {
        unreachable!()
    };
    let n = snapshot.radii.len();
    let configuration = Configuration {
        centres: suspension.centres().to_vec(),
        radii: snapshot.radii.clone(),
        cell: Cell::Unbounded,
        hydrodynamics: LUBRICATION,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vector3::zeros(); n],
        torques: vec![Vector3::zeros(); n],
    };
    (configuration, memory.springs.forces.clone())
}

#[test]
fn motion_and_contact_forces_turn_with_the_configuration() {
    let turn = Rotation3::from_euler_angles(0.7, -1.1, 2.3);
    for choice in [
        springs(TangentialLaw::StickSlide),
        rigid(TangentialLaw::Coulomb),
        rigid(TangentialLaw::RollSlip),
    ] {
        let (configuration, stretched) = cluster(springs(TangentialLaw::StickSlide));
        let stretched = if choice.tangential == TangentialLaw::StickSlide {
            stretched
        } else {
            PairForces::default()
        };
        let mut turned = configuration.clone();
        for x in &mut turned.centres {
            *x = turn * *x;
        }
        let rows = [0, 1, 2].map(|k| configuration.background.linear().rows()[k].transpose());
        let gradient = turn.matrix() * Matrix3::from_rows(&rows) * turn.matrix().transpose();
        let rows = [0, 1, 2].map(|k| gradient.row(k).transpose());
        turned.background = VelocityGradient::new(&rows).unwrap().into();
        let along = stretched.0.iter().map(|&(i, j, t)| (i, j, turn * t));
        let along = PairForces(along.collect());
        let tables = NearFields::default();
        let a = solve(&configuration, &request(&choice, 0.2, stretched), &tables).unwrap();
        let b = solve(&turned, &request(&choice, 0.2, along), &tables).unwrap();
        let slipping = a
            .contacts
            .iter()
            .filter(|c| c.state == ContactState::Slipping);
        assert!(slipping.count() > 2);
        for (v, w) in a.disturbances.iter().zip(&b.disturbances) {
            for first in [0, 3] {
                let [v, w] = [v, w].map(|x| Vector3::from_column_slice(&x[first..first + 3]));
                let error = (turn * v - w).amax();
                assert!(error < 1e-8, "{choice:?}: {error:e}");
            }
        }
        for (c, d) in a.contacts.iter().zip(&b.contacts) {
            let error = (turn * c.tangential_force - d.tangential_force).amax();
            assert!(error < 1e-6, "{choice:?}: {error:e}");
        }
    }
}

/// A suspension in its sheared cell, where spheres touch.
fn periodic(hydrodynamics: Hydrodynamics) -> (Configuration<Bulk>, PairForces<Bulk>) {
    let laws = springs(TangentialLaw::StickSlide);
    let (configuration, stretched) = cluster(laws);
    let suspension = sheared(&params(laws, LUBRICATION), 60);
    let offset = suspension.offset_at(suspension.strain());
    let configuration = Configuration {
        cell: Cell::equal_sides(suspension.side(), offset).unwrap(),
        hydrodynamics,
        ..configuration
    };
    (configuration, stretched)
}

#[test]
fn reflections_and_rotations_that_keep_the_shear_keep_the_motion_and_the_contact_forces() {
    let across = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let half_turn = Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
    for (hydrodynamics, tolerance) in [
        (LUBRICATION, 1e-9),
        (Hydrodynamics::BallMelrose, 1e-9),
        // The far field is iterated.
        (Hydrodynamics::StokesianDynamics, 1e-6),
    ] {
        let (configuration, stretched) = periodic(hydrodynamics);
        for (name, choice) in laws() {
            // Spheres under stick-rotate are jammed at this density.
            if choice.tangential == TangentialLaw::StickRotate {
                continue;
            }
            // Contacts with three constraints have non-unique forces, and an iteration converges to
            // some of them.
            let constrains_all = !choice.is_soft() && choice.rolling_friction > 0.0;
            if constrains_all && hydrodynamics == Hydrodynamics::StokesianDynamics {
                continue;
            }
            // Stretched springs belong to the law under which the suspension was sheared.
            let has_spring = choice.tangential == TangentialLaw::StickSlide;
            let springs = |image: &Matrix3<f64>| {
                let list = stretched.0.iter().filter(|_| has_spring);
                PairForces(list.map(|&(i, j, t)| (i, j, image * t)).collect())
            };
            let solved = |image: &Matrix3<f64>| {
                let mut configuration = configuration.clone();
                for x in &mut configuration.centres {
                    *x = image * *x;
                }
                let surface = Surface {
                    critical_load: 1.0,
                    ..surface(0.3)
                };
                let request = InstantContacts::Laws {
                    laws: Laws::new(&choice, surface),
                    lubrication_gap: 1e-3,
                    time_span: 0.005,
                    springs: springs(image),
                    rolling_springs: PairForces::default(),
                };
                solve(&configuration, &request, &NearFields::default()).unwrap()
            };
            let expected = solved(&Matrix3::identity());
            let frictional = expected.contacts.iter();
            let frictional = frictional.filter(|c| c.state != ContactState::Frictionless);
            assert!(frictional.count() > 10, "{name} is no test");
            for image in [across, half_turn] {
                let found = solved(&image);
                let what = format!("{name}, {hydrodynamics:?}, {:?}", image.diagonal());
                compare(&expected, &found, &image, tolerance, &what);
            }
        }
    }
}

/// Checks that the second solution is the image of the first.
fn compare(
    expected: &SolvedConfiguration<Bulk>,
    found: &SolvedConfiguration<Bulk>,
    image: &Matrix3<f64>,
    tolerance: f64,
    what: &str,
) {
    // Spins and torques turn with the other sign where the image is a reflection.
    let axial = image * image.determinant();
    for (v, w) in expected.disturbances.iter().zip(&found.disturbances) {
        for (first, image) in [(0, image), (3, &axial)] {
            let [v, w] = [v, w].map(|x| Vector3::from_column_slice(&x[first..first + 3]));
            let error = (image * v - w).amax();
            assert!(error < tolerance, "{what}: velocity {error:e}");
        }
    }
    let largest = |list: &[f64]| list.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    for (s, t) in expected.stresslets.iter().zip(&found.stresslets) {
        let ([xx, yy, xy, xz, yz], t) = (Bulk::tensor(s), Bulk::tensor(t));
        // Both images turn z against x and y.
        let error = [xx - t[0], yy - t[1], xy - t[2], xz + t[3], yz + t[4]];
        let error = largest(&error) / (1.0 + largest(&t));
        assert!(error < 10.0 * tolerance, "{what}: stresslet {error:e}");
    }
    assert_eq!(expected.contacts.len(), found.contacts.len(), "{what}");
    let strongest = expected.contacts.iter().map(|c| c.normal_force);
    let strongest = strongest.fold(0.0, f64::max);
    for (c, d) in expected.contacts.iter().zip(&found.contacts) {
        let error = (c.normal_force - d.normal_force)
            .abs()
            .max((image * c.tangential_force - d.tangential_force).amax())
            .max((image * c.rolling_force - d.rolling_force).amax());
        let error = error / strongest;
        assert!(error < 10.0 * tolerance, "{what}: force {error:e}");
        assert_eq!(c.state, d.state, "{what}");
    }
    let [a, b] = [expected, found].map(|solved| solved.stress.unwrap());
    let (a, b) = (a.components, b.components);
    // Both images turn z against x and y.
    for (a, b, sign) in [
        (a.shear, b.shear, 1.0),
        (a.n1, b.n1, 1.0),
        (a.n2, b.n2, 1.0),
        (a.particle_pressure, b.particle_pressure, 1.0),
        (a.xy, b.xy, 1.0),
        (a.xz, b.xz, -1.0),
        (a.yz, b.yz, -1.0),
    ] {
        for (a, b) in [
            (a.hydrodynamic, b.hydrodynamic),
            (a.normal_contact, b.normal_contact),
            (a.tangential_contact, b.tangential_contact),
            (a.repulsion, b.repulsion),
        ] {
            let error = (a - sign * b).abs() / expected.stress.unwrap().viscosity;
            assert!(error < 10.0 * tolerance, "{what}: stress {error:e}");
        }
    }
}

/// Checks that friction obeys Coulomb's law on a disc; how many contacts slip.
fn check_disc(solved: &SolvedConfiguration<Bulk>, friction: f64) -> usize {
    let mut slipping = 0;
    for c in &solved.contacts {
        let (bound, t) = (friction * c.normal_force, c.tangential_force);
        assert!(t.norm() <= bound * (1.0 + 1e-12) + 1e-300);
        assert!(t.dot(&c.pair.normal).abs() <= 1e-12 * bound.max(1e-300));
        let z = c.slip_velocity;
        match c.state {
            ContactState::Slipping => {
                slipping += 1;
                assert!((t.norm() / bound - 1.0).abs() < 1e-12);
                let against = t.dot(&z) / (t.norm() * z.norm());
                assert!(1.0 - against < 1e-12, "{against}");
            }
            ContactState::Sticking => assert!(z.norm() < 1e-8, "{:e}", z.norm()),
            ContactState::Frictionless => assert_eq!(t.norm(), 0.0),
        }
    }
    slipping
}

#[test]
fn friction_opposes_slip_and_stays_within_its_disc() {
    let (configuration, _) = cluster(springs(TangentialLaw::StickSlide));
    for friction in [0.05, 0.1, 0.2, 0.5] {
        let choice = rigid(TangentialLaw::Coulomb);
        let coulomb = request(&choice, friction, PairForces::default());
        let solved = solve(&configuration, &coulomb, &NearFields::default()).unwrap();
        assert!(check_disc(&solved, friction) > 2, "{friction}");
    }
}

#[test]
fn coulomb_friction_of_dense_suspensions_takes_few_systems() {
    let params = params(rigid(TangentialLaw::Coulomb), Hydrodynamics::BallMelrose);
    let tables = NearFields::default();
    let mut suspension = sheared(&params, 160);
    let (mut systems, mut sliding) = (0, 0);
    for _ in 0..20 {
        let sample = suspension.step().unwrap();
        sliding += sample.slipping;
        let snapshot = suspension.snapshot();
        let sd_core::simulation::SchemeMemory::Laws(mut memory) = snapshot.memory else {
            unreachable!()
        };
        let cell = suspension.cell_at(suspension.strain()).unwrap();
        let mut stage = Method::of(&params)
            .solver::<Bulk>(
                params.hydrodynamics,
                &cell,
                &snapshot.radii,
                &tables,
                &[],
                &SolverSettings::precise(),
            )
            .unwrap();
        stage.assemble(&cell, suspension.centres()).unwrap();
        let contact = StageContacts::Laws {
            laws: &Laws::new(params.contact.laws(), surface(params.friction)),
            span: Span::single(params.time_step),
            memory: &mut memory,
        };
        let quality = stage
            .solve(
                &VelocityGradient::simple_shear(1.0).into(),
                &[],
                contact,
                SolvePass::First,
            )
            .unwrap();
        assert!(quality.converged(), "{quality:?}");
        systems += quality.systems;
    }
    // 584 of them if contacts that close were to stick at once and the steps of Newton's method
    // were whole: many of these stages would need the proximal point method.
    assert!(sliding > 200, "{sliding} slides are no test");
    assert!(systems < 200, "{systems} systems");
}
