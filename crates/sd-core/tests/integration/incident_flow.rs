//! Flows that are not linear, given at each sphere.

use crate::common::spheres::{Spheres, dot, spheres, vector};
use nalgebra::{Matrix3, Vector2, Vector3};
use sd_core::cell::Cell;
use sd_core::contact::{Contact, Laws};
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::model::{SolverSettings, Surface};
use sd_core::products::Resistance;
use sd_core::{
    Bulk, ContactLaws, Error, Hydrodynamics, IncidentFlow, Layer, LeadingOrder, LocalFlow,
    NearFields, RunSpace, Space, StiffnessUnit, TangentialLaw, VelocityGradient,
};
use std::f64::consts::PI;

const FULL: Hydrodynamics = Hydrodynamics::StokesianDynamics;

/// Few spheres and many, whose methods differ, under all hydrodynamics, and the accuracy of their
/// motion. No pair touches across the faces of the cell.
fn cases<S: RunSpace>() -> Vec<(Hydrodynamics, Spheres<S>, f64)> {
    let [few, many] = if S::DIMENSIONS == 2 { [6, 11] } else { [4, 5] };
    let apart = |count| {
        let spheres = spheres::<S>(count, 2.2, 0.0);
        let side = 2.2 * f64::from(count) + 1.0;
        Spheres {
            cell: Cell::equal_sides(side, 0.2 * side).unwrap(),
            ..spheres
        }
    };
    let lubrication = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
    vec![
        (FULL, apart(few), 1e-9),
        (FULL, apart(many), 1e-5),
        (Hydrodynamics::BallMelrose, apart(few), 1e-9),
        (Hydrodynamics::BallMelrose, apart(many), 1e-7),
        (lubrication, apart(many), 1e-7),
    ]
}

/// Without contacts, and under laws that read each of their velocities.
fn requests<S: Space>(roughness: f64, time_span: f64) -> Vec<InstantContacts<S>> {
    let surface = Surface {
        roughness,
        friction: 0.3,
        critical_load: 0.0,
    };
    let law = |choice: &ContactLaws| InstantContacts::under(Laws::new(choice, surface), time_span);
    let rigid = |tangential, rolling_friction| ContactLaws {
        tangential,
        rolling_friction,
        ..ContactLaws::PAPER
    };
    let springs = ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        ..ContactLaws::linear_spring(3e3, TangentialLaw::StickSlide, 0.2)
    };
    vec![
        InstantContacts::None,
        law(&springs),
        law(&rigid(TangentialLaw::Coulomb, 0.1)),
        law(&rigid(TangentialLaw::StickRotate, 0.0)),
    ]
}

fn configuration<S: Space>(
    hydrodynamics: Hydrodynamics,
    spheres: &Spheres<S>,
    background: IncidentFlow<S>,
) -> Configuration<S> {
    let n = spheres.radii.len();
    Configuration {
        centres: spheres.centres.clone(),
        radii: spheres.radii.clone(),
        cell: spheres.cell,
        hydrodynamics,
        background,
        forces: vec![S::Vector::default(); n],
        torques: vec![S::Spin::default(); n],
    }
}

/// A velocity gradient of these numbers, `D²` of them, without trace.
fn gradient<S: Space>(numbers: &[f64]) -> VelocityGradient<S> {
    let d = S::DIMENSIONS;
    let mut rows = vec![S::Vector::default(); d];
    for (k, number) in numbers.iter().enumerate() {
        rows[k / d][k % d] = *number;
    }
    rows[d - 1][d - 1] = -(0..d - 1).map(|k| rows[k][k]).sum::<f64>();
    VelocityGradient::new(&rows).unwrap()
}

/// A flow without order, and sphere by sphere.
fn disordered<S: Space>(n: usize, seed: f64) -> IncidentFlow<S> {
    let d = S::DIMENSIONS;
    let numbers: Vec<f64> = (0..n * (d + d * d))
        .map(|k| (seed + 1.3 * k as f64 + 0.01 * (k * k) as f64).sin())
        .collect();
    let departures: Vec<_> = numbers
        .chunks_exact(d + d * d)
        .map(|numbers| {
            let mut velocity = S::Vector::default();
            for k in 0..d {
                velocity[k] = numbers[k];
            }
            LocalFlow {
                velocity,
                gradient: gradient(&numbers[d..]),
            }
        })
        .collect();
    IncidentFlow::per_sphere(VelocityGradient::simple_shear(0.7), &departures).unwrap()
}

/// A linear flow as what a sphere meets of it.
fn at_spheres<S: Space>(flow: VelocityGradient<S>, spheres: &Spheres<S>) -> Vec<LocalFlow<S>> {
    let centres = spheres.centres.iter();
    let local = centres.map(|x| LocalFlow {
        velocity: flow.velocity(x),
        gradient: flow,
    });
    local.collect()
}

/// Largest number of all motion, and of all relative velocities and forces of contacts.
fn largest_difference<S: Space>(
    a: &SolvedConfiguration<S>,
    b: &SolvedConfiguration<S>,
) -> [f64; 3] {
    let differ = |a: &[f64], b: &[f64]| {
        let pairs = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        pairs.fold(0.0, f64::max)
    };
    let motion = a.disturbances.iter().zip(&b.disturbances);
    let motion = motion.map(|(a, b)| differ(a.as_ref(), b.as_ref()));
    let stresslets = a.stresslets.iter().zip(&b.stresslets).map(|(a, b)| {
        let numbers = |s: &S::Strain| (0..S::STRAINS).map(|k| s[k]).collect::<Vec<_>>();
        differ(&numbers(a), &numbers(b))
    });
    assert_eq!(a.contacts.len(), b.contacts.len());
    let length = |x: S::Tangent| S::tangent_dot(&x, &x).sqrt();
    let contacts = a.contacts.iter().zip(&b.contacts).map(|(a, b)| {
        [
            (a.normal_velocity - b.normal_velocity).abs(),
            length(a.slip_velocity - b.slip_velocity),
            length(a.rolling_velocity - b.rolling_velocity),
            1e-3 * (a.normal_force - b.normal_force).abs(),
            1e-3 * length(a.tangential_force - b.tangential_force),
            1e-3 * length(a.rolling_force - b.rolling_force),
        ]
        .into_iter()
        .fold(0.0, f64::max)
    });
    [
        motion.fold(0.0, f64::max),
        stresslets.fold(0.0, f64::max),
        contacts.fold(0.0, f64::max),
    ]
}

fn linear_flow_sphere_by_sphere_is_the_linear_flow<S: RunSpace>() {
    for (hydrodynamics, spheres, tolerance) in cases::<S>() {
        let shear = VelocityGradient::<S>::simple_shear(1.0);
        let [third, rest] = [0.3, 0.7].map(VelocityGradient::simple_shear);
        let departures = at_spheres(rest, &spheres);
        let flow = IncidentFlow::per_sphere(third, &departures).unwrap();
        // All laws where they take little time: two for many spheres.
        let laws = requests(0.2, 0.01);
        let few = if spheres.radii.len() < 100 { 4 } else { 2 };
        for (number, request) in laws[..few].iter().enumerate() {
            let [linear, per_sphere] = [shear.into(), flow.clone()].map(|flow| {
                let configuration = configuration(hydrodynamics, &spheres, flow);
                solve(&configuration, request, &NearFields::default()).unwrap()
            });
            let what = format!("{hydrodynamics:?}, {} spheres", spheres.radii.len());
            let loaded = linear.contacts.iter().filter(|c| c.normal_force > 0.0);
            assert!(number == 0 || loaded.count() > 5, "{what} is no test");
            let [motion, stresslets, contacts] = largest_difference(&linear, &per_sphere);
            assert!(
                motion < tolerance && stresslets < 20.0 * tolerance && contacts < tolerance,
                "{what}, law {number}: {motion:e} {stresslets:e} {contacts:e}"
            );
            if let (Some(a), Some(b)) = (linear.stress, per_sphere.stress) {
                // Resistance to the linear flow, which is that of a rate of 0.3.
                let error = 0.3 * (b.viscosity - 1.0) / (a.viscosity - 1.0) - 1.0;
                let error = error.abs().max((a.dissipation / b.dissipation - 1.0).abs());
                assert!(error < 10.0 * tolerance, "{what}, law {number}: {error:e}");
            }
        }
    }
}

#[test]
fn linear_flow_sphere_by_sphere_is_the_linear_flow_past_a_layer() {
    linear_flow_sphere_by_sphere_is_the_linear_flow::<Layer>();
}

#[test]
fn linear_flow_sphere_by_sphere_is_the_linear_flow_through_a_suspension() {
    linear_flow_sphere_by_sphere_is_the_linear_flow::<Bulk>();
}

fn a_rigid_motion_of_the_fluid_takes_the_spheres_along<S: RunSpace>() {
    let d = S::DIMENSIONS;
    let mut rows = vec![S::Vector::default(); d];
    for (row, column, spin) in [(0, 1, 0.07), (0, 2, -0.04), (1, 2, 0.11)] {
        if column < d {
            (rows[row][column], rows[column][row]) = (-spin, spin);
        }
    }
    let turning = VelocityGradient::<S>::new(&rows).unwrap();
    for (hydrodynamics, spheres, _) in cases::<S>() {
        let mut departures = at_spheres(turning, &spheres);
        for local in &mut departures {
            local.velocity[0] += 2.0;
            local.velocity[1] -= 3.0;
        }
        let flow = IncidentFlow::per_sphere(VelocityGradient::at_rest(), &departures).unwrap();
        // No surfaces touch, and all that are close are candidates; those across the faces of the
        // cell, where the flow jumps, are too far apart to close.
        for (number, request) in requests(0.01, 0.15).iter().enumerate() {
            let configuration = configuration(hydrodynamics, &spheres, flow.clone());
            let solved = solve(&configuration, request, &NearFields::default()).unwrap();
            let what = format!("{hydrodynamics:?}, law {number}");
            assert!(number == 0 || solved.contacts.len() > 10, "{what}");
            let mut none = solved.clone();
            none.disturbances.fill(S::each(0.0));
            none.stresslets.fill(S::Strain::default());
            let still = VelocityGradient::at_rest().into();
            for contact in &mut none.contacts {
                *contact = Contact::new(contact.pair, &spheres.radii, &still);
            }
            let errors = largest_difference(&solved, &none);
            assert!(errors.iter().all(|e| *e < 1e-12), "{what}: {errors:?}");
        }
    }
}

#[test]
fn a_rigid_motion_of_the_fluid_takes_the_spheres_of_a_layer_along() {
    a_rigid_motion_of_the_fluid_takes_the_spheres_along::<Layer>();
}

#[test]
fn a_rigid_motion_of_the_fluid_takes_the_spheres_of_a_suspension_along() {
    a_rigid_motion_of_the_fluid_takes_the_spheres_along::<Bulk>();
}

/// `Σ S:E`.
fn power<S: Space>(stresslets: &[S::Strain], flow: &IncidentFlow<S>) -> f64 {
    let strains = flow.strains();
    let spheres = stresslets.iter().enumerate();
    spheres
        .map(|(sphere, s)| S::strain_dot(s, strains.at(sphere)))
        .sum()
}

/// What one flow does against the stresslets of another is what that does against those of the
/// first, of free spheres and of spheres that are held.
fn stresslets_are_reciprocal<S: RunSpace>() {
    for (hydrodynamics, spheres, tolerance) in cases::<S>() {
        let n = spheres.radii.len();
        let what = format!("{hydrodynamics:?}, {n} spheres");
        let mut resistance = spheres.resistance(hydrodynamics);
        let flows = [0.4, 2.9].map(|seed| disordered::<S>(n, seed));
        let none = vec![0.0; S::MODES * n];
        let free = flows.each_ref().map(|flow| {
            let mut motion = none.clone();
            resistance.set_flow(flow.clone()).unwrap();
            resistance.solve(&none, &mut motion).unwrap();
            let stresslets = resistance.stresslets().to_vec();
            let configuration = configuration(hydrodynamics, &spheres, flow.clone());
            let tables = NearFields::default();
            let instant = solve(&configuration, &InstantContacts::None, &tables).unwrap();
            assert_eq!(instant.stresslets, stresslets, "{what}");
            // A product with the motion found leaves no forces, and these stresslets.
            let mut forces = none.clone();
            resistance.apply(&motion, &mut forces).unwrap();
            let scale = 20.0 * tolerance;
            assert!(forces.iter().all(|f| f.abs() < scale), "{what}");
            for (a, b) in resistance.stresslets().iter().zip(&stresslets) {
                for k in 0..S::STRAINS {
                    assert!((a[k] - b[k]).abs() < scale, "{what}: {a:?} {b:?}");
                }
            }
            stresslets
        });
        let size = (power(&free[0], &flows[0]) * power(&free[1], &flows[1])).sqrt();
        let [one, two] = [power(&free[0], &flows[1]), power(&free[1], &flows[0])];
        assert!((one - two).abs() < tolerance * size, "{what}: {one} {two}");
        assert!(one.abs() > 1e-3 * size, "{what} is no test");

        let motions = [0.2, 1.9].map(|seed| vector::<S>(n, S::MODES, seed));
        let held: Vec<_> = (flows.iter().zip(&motions))
            .map(|(flow, motion)| {
                let mut forces = none.clone();
                resistance.set_flow(flow.clone()).unwrap();
                resistance.apply(motion, &mut forces).unwrap();
                (forces, resistance.stresslets().to_vec())
            })
            .collect();
        let form = |a: usize, b: usize| {
            let (forces, stresslets) = &held[a];
            dot(forces, &motions[b]) + power(stresslets, &flows[b])
        };
        let size = (form(0, 0) * form(1, 1)).sqrt();
        let (one, two) = (form(0, 1), form(1, 0));
        assert!((one - two).abs() < tolerance * size, "{what}: {one} {two}");
    }
}

#[test]
fn stresslets_are_reciprocal_in_a_layer() {
    stresslets_are_reciprocal::<Layer>();
}

#[test]
fn stresslets_are_reciprocal_in_a_suspension() {
    stresslets_are_reciprocal::<Bulk>();
}

/// The power of the flow, with its velocities at contacts computed here, is dissipated.
#[test]
fn the_power_of_a_flow_is_dissipated() {
    for (hydrodynamics, spheres, tolerance) in cases::<Bulk>() {
        let n = spheres.radii.len();
        let flow = disordered::<Bulk>(n, 0.4);
        let laws = requests(0.2, 0.01);
        for (number, request) in laws[..3].iter().enumerate() {
            let configuration = configuration(hydrodynamics, &spheres, flow.clone());
            let solved = solve(&configuration, request, &NearFields::default()).unwrap();
            let volume = spheres.cell.content().unwrap();
            let spent = solved.stress.unwrap().dissipation * volume + solved.contact_power();
            let mut given = power(&solved.stresslets, &flow);
            for c in &solved.contacts {
                let [i, j] = [c.pair.i, c.pair.j];
                let [a, b] = [i, j].map(|sphere| flow.at(sphere, &spheres.centres[sphere]));
                let part = |m: &[f64; 6], k: usize| Vector3::from_column_slice(&m[k..k + 3]);
                let (n, shift) = (c.pair.normal, part(&b, 0) - part(&a, 0));
                let turned = part(&a, 3) * c.levers[0] + part(&b, 3) * c.levers[1];
                let slip = shift - n * n.dot(&shift) - turned.cross(&n);
                let radius = {
                    let [r, s] = [spheres.radii[i], spheres.radii[j]];
                    2.0 * r * s / (r + s)
                };
                let rolling = (part(&b, 3) - part(&a, 3)).cross(&n) * radius;
                given += c.tangential_force.dot(&slip) - c.normal_force * n.dot(&shift)
                    + c.rolling_force.dot(&rolling);
            }
            let error = (spent / given - 1.0).abs();
            let what = format!("{hydrodynamics:?}, {n} spheres, law {number}");
            assert!(error < tolerance, "{what}: {spent} {given}");
        }
    }
}

/// The flow of a sphere of radius a under a force, and that with a further factor
/// `1 + c ∇²`: `(1 + (a²/6 + c) ∇²) G F`, as `∇²∇² G = 0`.
fn flow_of(force: Vector3<f64>, x: Vector3<f64>, square: f64) -> Vector3<f64> {
    let (r, n) = (x.norm(), x.normalize());
    let along = n * n.dot(&force);
    ((force + along) / r + (force - along * 3.0) * 2.0 * square / r.powi(3)) / (8.0 * PI)
}

/// Spheres out of the range of lubrication move in the flow of another that is far away as beside
/// it, with which the far field has all their reflections but those of that sphere, of order R⁻⁶.
/// Within that range they do not: beside it, pair terms do not know the strain of its flow.
#[test]
fn spheres_in_the_flow_of_another_move_as_beside_it() {
    let force = Vector3::new(40.0, -90.0, 25.0);
    let radii = [1.0, 0.8, 0.9, 1.3];
    let centres = [
        Vector3::zeros(),
        Vector3::new(3.0, 2.5, 0.9),
        Vector3::new(-1.0, 3.4, 2.4),
        Vector3::new(12.0, -9.0, 13.0),
    ];
    let [four, three] = [4, 3].map(|n| Spheres::<Bulk> {
        cell: Cell::Unbounded,
        radii: radii[..n].to_vec(),
        centres: centres[..n].to_vec(),
    });
    let mut beside = configuration(FULL, &four, VelocityGradient::at_rest().into());
    beside.forces[3] = force;
    let square = radii[3] * radii[3] / 6.0;
    let local = [0, 1, 2].map(|sphere| {
        let (x, own) = (centres[sphere] - centres[3], radii[sphere] * radii[sphere]);
        // Central differences, exact to 1e-9.
        let h = 1e-3;
        let columns = |square: f64| {
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis: Vector3<f64>| {
                let [a, b] = [h, -h].map(|h| flow_of(force, x + axis * h, square));
                (a - b) / (2.0 * h)
            })
        };
        // The Laplacian of the flow has no rotation beyond that of the flow.
        let gradient = Matrix3::from_columns(&columns(square + own / 10.0));
        let curl = Matrix3::from_columns(&columns(0.0));
        let strain = (gradient + gradient.transpose()) / 2.0;
        let gradient = strain + (curl - curl.transpose()) / 2.0;
        let mut rows = [0, 1, 2].map(|k| gradient.row(k).transpose());
        rows[2].z = -rows[0].x - rows[1].y;
        LocalFlow {
            velocity: flow_of(force, x, square + own / 6.0),
            gradient: VelocityGradient::new(&rows).unwrap(),
        }
    });
    let flow = IncidentFlow::per_sphere(VelocityGradient::at_rest(), &local).unwrap();
    let alone = configuration(FULL, &three, flow.clone());
    let [beside, alone] = [beside, alone].map(|configuration| {
        let tables = NearFields::default();
        solve(&configuration, &InstantContacts::None, &tables).unwrap()
    });
    for (sphere, centre) in centres[..3].iter().enumerate() {
        let incident = flow.at(sphere, centre);
        for (k, incident) in incident.iter().enumerate() {
            let found = alone.disturbances[sphere][k] + incident;
            let expected = beside.disturbances[sphere][k];
            let size = if k < 3 { 0.3 } else { 0.01 };
            let error = (found - expected).abs() / size;
            assert!(error < 2e-5, "{sphere} {k}: {found} {expected}");
        }
        let error = (alone.stresslets[sphere] - beside.stresslets[sphere]).norm();
        let size = beside.stresslets[sphere].norm();
        assert!(error < 2e-5 * size, "{sphere}: {error:e} of {size}");
    }
}

/// A free sphere in the flow between plates, `u = 1 − (y/H)²`: it lags behind the fluid at its
/// centre by `a²/(3 H²)`.
#[test]
fn a_sphere_between_plates_has_the_motion_of_faxens_laws() {
    let (height, y, radius) = (10.0_f64, 2.0_f64, 1.3_f64);
    let curvature = -2.0 / (height * height);
    let rows = [Vector2::new(0.0, curvature * y), Vector2::zeros()];
    let local = LocalFlow {
        velocity: Vector2::new(
            1.0 - (y / height).powi(2) + radius * radius / 6.0 * curvature,
            0.0,
        ),
        gradient: VelocityGradient::<Layer>::new(&rows).unwrap(),
    };
    let spheres = Spheres::<Layer> {
        cell: Cell::Unbounded,
        radii: vec![radius],
        centres: vec![Vector2::new(3.0, y)],
    };
    let flow = IncidentFlow::per_sphere(VelocityGradient::at_rest(), &[local]).unwrap();
    for hydrodynamics in [FULL, Hydrodynamics::BallMelrose] {
        let free = configuration(hydrodynamics, &spheres, flow.clone());
        let solved = solve(&free, &InstantContacts::None, &NearFields::default()).unwrap();
        let incident = flow.at(0, &spheres.centres[0]);
        let motion = [0, 1, 2].map(|k| incident[k] + solved.disturbances[0][k]);
        let lag = radius * radius / (3.0 * height * height);
        let expected = [0.96 - lag, 0.0, 0.02];
        for (a, b) in motion.iter().zip(expected) {
            assert!((a - b).abs() < 1e-14, "{motion:?} {expected:?}");
        }
        let (_, _, xy) = solved.stresslet(0);
        let expected = 20.0 / 3.0 * PI * radius.powi(3) * 0.5 * curvature * y;
        assert!((xy / expected - 1.0).abs() < 1e-12, "{xy} {expected}");
        // Held, it takes Stokes' drag from its own velocity, not from that at its centre.
        let mut resistance = spheres.resistance(hydrodynamics);
        resistance.set_flow(flow.clone()).unwrap();
        let (held, mut forces) = (incident.map(|u| -u), [0.0; 3]);
        resistance.apply(&held, &mut forces).unwrap();
        let drag = -6.0 * PI * radius * (0.96 - lag);
        assert!((forces[0] / drag - 1.0).abs() < 1e-12, "{forces:?}");
    }
}

#[test]
fn flows_that_are_not_finite_or_of_other_spheres_are_refused() {
    let still = LocalFlow::<Layer> {
        velocity: Vector2::zeros(),
        gradient: VelocityGradient::at_rest(),
    };
    let bad = [
        LocalFlow {
            velocity: Vector2::new(0.0, f64::NAN),
            ..still
        },
        LocalFlow {
            gradient: VelocityGradient::from_parts(&[0.0, f64::INFINITY, 0.0], &0.0),
            ..still
        },
    ];
    for local in bad {
        let flow = IncidentFlow::per_sphere(VelocityGradient::at_rest(), &[still, local]);
        let error = flow.unwrap_err();
        assert!(
            matches!(
                error,
                Error::OfSphere {
                    field: "background",
                    sphere: 1,
                    ..
                }
            ),
            "{error}"
        );
    }
    let spheres = spheres::<Layer>(2, 4.5, 0.0);
    let mut resistance = Resistance::new(
        FULL,
        &spheres.cell,
        &spheres.radii,
        &spheres.centres,
        &NearFields::default(),
        &SolverSettings::precise(),
    )
    .unwrap();
    for number in [0, 3] {
        let departures = vec![still; number];
        let flow = IncidentFlow::per_sphere(VelocityGradient::at_rest(), &departures).unwrap();
        let instant = configuration(FULL, &spheres, flow.clone());
        let tables = NearFields::default();
        let refused = solve(&instant, &InstantContacts::None, &tables);
        for error in [refused.unwrap_err(), resistance.set_flow(flow).unwrap_err()] {
            let expected = Error::Length {
                field: "background",
                found: number,
                expected: 4,
            };
            assert_eq!(error, expected);
        }
    }
    let endless = VelocityGradient::from_parts(&[f64::NAN, 0.0, 0.0], &0.0);
    let error = resistance.set_flow(endless.into()).unwrap_err();
    assert!(error.to_string().contains("background"), "{error}");
}
