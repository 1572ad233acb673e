//! Leading-order lubrication and springs of a suspension against an instant of LF_DEM, a code of the field (`tests/data/README.md`).
//!
//! Its axes are flow x, gradient z, vorticity y; its unit of force is 6π of ours. Two of its choices are not ours and are put in by hand,
//! as its description has them: pairs in contact have the X terms of 1/(ξ + δ) = 40 in place of 1/δ; and they have no terms with E, but
//! their resistance acts on the background's velocities at their centres, with the torques of a force at the surface. All terms of pairs
//! apart, all coefficients, the geometry of the sheared cell and the springs are the program's.

use crate::hydrodynamics::resistance::{BySizes, Fluid, NearTerm as _};
use crate::hydrodynamics::two_sphere::LeadingOrderPair;
use crate::law::NormalLaw;
use crate::model::LeadingOrder;
use crate::space::bulk::Background;
use crate::space::cell::Cell;
use crate::space::neighbours::NeighbourList;
use crate::space::{Bulk, ImposedFlow as _};
use nalgebra::{DMatrix, DVector, Vector3};
use serde_json::Value;
use std::f64::consts::PI;

/// A vector in our axes.
fn vector(value: &Value) -> Vector3<f64> {
    let x = |k: usize| value[k].as_f64().unwrap();
    Vector3::new(x(0), x(2), -x(1))
}

/// ξ at which 1/(ξ + δ) is what it has for pairs in contact.
const CONTACT: f64 = 1.0 / 40.0 - LeadingOrder::USUAL.regularisation;

#[test]
fn springs_and_velocities_are_those_of_a_code_of_the_field() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/data/lf3d_instant.json"
    );
    let data: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let instant = &data["instant"];
    let particles = instant["particles"].as_array().unwrap();
    let centres: Vec<_> = particles.iter().map(|p| vector(&p["position"])).collect();
    let radii: Vec<f64> = particles
        .iter()
        .map(|p| p["radius"].as_f64().unwrap())
        .collect();
    let n = centres.len();
    let offset = instant["shear_disp"][0].as_f64().unwrap();
    let sides = Vector3::repeat(instant["L"][0].as_f64().unwrap());
    let cell = Cell::<Bulk>::periodic(sides, offset).unwrap();
    let numbers = LeadingOrder::USUAL;
    let pairs = BySizes::new(&radii, |radii| Ok(LeadingOrderPair::new(radii, numbers))).unwrap();
    let mut list = NeighbourList::default();
    list.find(&cell, &centres, &radii, 2.0 + numbers.cutoff);
    let expected = instant["pairs"].as_array().unwrap();
    assert_eq!(list.pairs().len(), expected.len());

    let mut matrix = DMatrix::<f64>::zeros(6 * n, 6 * n);
    let mut forces = DVector::<f64>::zeros(6 * n);
    for (i, (p, &a)) in particles.iter().zip(&radii).enumerate() {
        let drag = Bulk::isolated(a).0;
        let (f, t) = (
            vector(&p["force_contact_spring"]),
            vector(&p["torque_contact_spring"]),
        );
        for k in 0..6 {
            matrix[(6 * i + k, 6 * i + k)] = drag[k];
            forces[6 * i + k] = 6.0 * PI * if k < 3 { f[k] } else { t[k - 3] };
        }
    }
    let background = Background::SHEAR;
    let mut touching = 0;
    for pair in list.pairs() {
        let (i, j, normal) = (pair.i, pair.j, pair.normal);
        let same = |p: &&Value| p["i"] == i && p["j"] == j || p["i"] == j && p["j"] == i;
        let record = expected.iter().find(same).unwrap();
        let mean = 0.5 * (radii[i] + radii[j]);
        let gap = record["reduced_gap"].as_f64().unwrap() * mean;
        assert!((pair.gap - gap).abs() < 1e-12, "{} {gap}", pair.gap);
        let mut term = Bulk::term(pairs.of(i, j).evaluate(pair.gap.max(0.0)), [0.0; 3]);
        let driving = if pair.gap > 0.0 {
            term.background_forces(&normal, &background.strain_components())
        } else {
            touching += 1;
            // Springs: normal and tangential, to the digits of the record.
            let stiffness = |name: &str| instant[name].as_f64().unwrap() * mean;
            let force = NormalLaw::LinearSpring.force(-pair.gap, stiffness("kn"));
            let spring = record["spring_normal"].as_f64().unwrap();
            assert!((force / spring - 1.0).abs() < 1e-10, "{force} {spring}");
            let sign = if record["i"] == i { 1.0 } else { -1.0 };
            let tangential = vector(&record["tangential_stretch"]) * stiffness("kt");
            let total = (tangential * sign - normal * force) * sign;
            let error = (total - vector(&record["spring_total_on_i"])).amax();
            assert!(error < 1e-10 * force.max(1.0), "{error:e}");

            let squeezed = Bulk::term(pairs.of(i, j).evaluate(CONTACT * mean), [0.0; 3]);
            term.take_squeeze(&squeezed);
            let flow = background.velocity(&(normal * pair.distance));
            let spin = background.angular_velocity;
            let full = [[Vector3::zeros(), spin], [flow, spin]];
            let mut force = Vector3::zeros();
            for (q, [u, w]) in full.iter().enumerate() {
                let block = term.block(&normal, 0, q);
                for column in 0..6 {
                    let v = if column < 3 { u[column] } else { w[column - 3] };
                    for row in 0..3 {
                        force[row] -= block[6 * column + row] * v;
                    }
                }
            }
            let torques = [radii[i], radii[j]].map(|a| normal.cross(&force) * a);
            let side = |force: Vector3<f64>, torque: Vector3<f64>| {
                std::array::from_fn(|k| if k < 3 { force[k] } else { torque[k - 3] })
            };
            [side(force, torques[0]), side(-force, torques[1])]
        };
        for (p, row) in [i, j].into_iter().enumerate() {
            for k in 0..6 {
                forces[6 * row + k] += driving[p][k];
            }
            for (q, column) in [i, j].into_iter().enumerate() {
                let block = term.block(&normal, p, q);
                for (at, entry) in block.iter().enumerate() {
                    matrix[(6 * row + at % 6, 6 * column + at / 6)] += entry;
                }
            }
        }
    }
    assert_eq!(touching, 70);
    let velocities = matrix.cholesky().unwrap().solve(&forces);
    for (i, p) in particles.iter().enumerate() {
        for (first, name) in [(0, "na_velocity"), (3, "na_angular_velocity")] {
            let found = velocities.fixed_rows::<3>(6 * i + first);
            let error = (found - vector(&p[name])).amax();
            assert!(error < 1e-10, "sphere {i}, {name}: {error:e}");
        }
    }
}
