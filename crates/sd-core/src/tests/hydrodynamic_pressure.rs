//! The isotropic part of the hydrodynamic stress at one instant.

use crate::NearFields;
use crate::hydrodynamics::two_sphere::pressure_moments;
use crate::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use crate::model::{Hydrodynamics, LeadingOrder};
use crate::space::cell::Cell;
use crate::space::{Bulk, Layer, VelocityGradient};
use nalgebra::{Vector2, Vector3};
use std::f64::consts::PI;

/// Spheres in a layer under shear and forces.
fn layer(
    hydrodynamics: Hydrodynamics,
    cell: &Cell<Layer>,
    centres: &[Vector2<f64>],
    radii: &[f64],
) -> SolvedConfiguration<Layer> {
    let n = radii.len();
    let configuration = Configuration {
        centres: centres.to_vec(),
        radii: radii.to_vec(),
        cell: *cell,
        hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: (0..n)
            .map(|k| Vector2::new(20.0, 7.0) * if k % 2 == 0 { 1.0 } else { -1.0 })
            .collect(),
        torques: vec![3.0; n],
    };
    solve(
        &configuration,
        &InstantContacts::None,
        &NearFields::default(),
    )
    .unwrap()
}

/// T of both spheres from the functions of two spheres alone.
fn exact(radii: [f64; 2], x: Vector2<f64>, motion: [Vector2<f64>; 2]) -> f64 {
    let (r, n) = (x.norm(), x.normalize());
    // n·E·n of simple shear.
    let stretch = -n.x * n.y;
    let moments = [0, 1].map(|one: usize| {
        let (a, b) = (radii[one], radii[1 - one]);
        let d = if one == 0 { n } else { -n };
        let [[own, other], [q_own, q_other]] = pressure_moments(b / a, 2.0 * r / (a + b)).unwrap();
        let velocity = own * d.dot(&motion[one]) + other * d.dot(&motion[1 - one]);
        4.0 * PI * a * a * (velocity + a * (q_own + q_other) * stretch)
    });
    moments[0] + moments[1]
}

#[test]
fn two_spheres_alone_have_their_exact_moments() {
    for (radii, x) in [
        ([1.0, 1.0], Vector2::new(1.7, -1.3)),
        ([1.0, 1.4], Vector2::new(1.9, 1.9)),
        ([2.0, 0.8], Vector2::new(-2.0, 4.0)),
    ] {
        let centres = [Vector2::new(0.3, 0.2), Vector2::new(0.3, 0.2) + x];
        let kind = Hydrodynamics::StokesianDynamics;
        let solved = layer(kind, &Cell::Unbounded, &centres, &radii);
        let motion =
            [0, 1].map(|k| Vector2::new(solved.disturbances[k][0], solved.disturbances[k][1]));
        let expected = exact(radii, x, motion) / 3.0;
        let found = solved.pressure_moment;
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        // In three dimensions it is the same.
        let place = |x: &Vector2<f64>| Vector3::new(x.x, x.y, 0.0);
        let configuration = Configuration::<Bulk> {
            centres: centres.iter().map(place).collect(),
            radii: radii.to_vec(),
            cell: Cell::Unbounded,
            hydrodynamics: kind,
            background: VelocityGradient::simple_shear(1.0).into(),
            forces: vec![Vector3::new(20.0, 7.0, 0.0), Vector3::new(-20.0, -7.0, 0.0)],
            torques: vec![Vector3::new(0.0, 0.0, 3.0); 2],
        };
        let solved = solve(
            &configuration,
            &InstantContacts::None,
            &NearFields::default(),
        )
        .unwrap();
        let found = solved.pressure_moment;
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    }
}

#[test]
fn leading_order_lubrication_has_the_virial_of_its_forces() {
    // Two spheres in a cell: each has the force of its drag, and the pair pushes with the rest.
    let (radii, x) = ([1.0, 1.4], Vector2::new(1.75, 1.75));
    let centres = [Vector2::new(3.0, 3.0), Vector2::new(3.0, 3.0) + x];
    let cell = Cell::periodic(Vector2::new(30.0, 30.0), 0.0).unwrap();
    let kind = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
    let solved = layer(kind, &cell, &centres, &radii);
    let n = x.normalize();
    let v = Vector2::new(solved.disturbances[0][0], solved.disturbances[0][1]);
    let push = n.dot(&(Vector2::new(20.0, 7.0) - 6.0 * PI * radii[0] * v));
    let found = 3.0 * solved.pressure_moment;
    assert!((found / (push * 2.4) - 1.0).abs() < 1e-9, "{found} {push}");
}
