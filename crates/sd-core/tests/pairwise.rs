//! Layers whose resistance is held pair by pair against the same layers with all of `R_FU` factored.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use sd_core::cell::Cell;
use sd_core::contact::{Contact, ContactState, Surface};
use sd_core::modes::{Background, Vec2};
use sd_core::simulation::{LEAST_ITERATED, LEAST_PAIRWISE};
use sd_core::{
    ContactLaw, ContactLaws, ContactScheme, Error, Hydrodynamics, Motion, NearFields, Params,
    Resistance, Simulation, Snapshot, TangentialLaw,
};

fn params(spheres: usize, area_fraction: f64, friction: f64) -> Params {
    Params {
        spheres,
        area_fraction,
        roughness: 0.01,
        friction,
        shear_rate: 100.0,
        size_ratio: 1.0,
        large_fraction: 0.5,
        hydrodynamics: Hydrodynamics::BallMelrose,
        contact: ContactScheme::Rigid,
        time_step: 0.01,
    }
}

/// A layer after some steps, with cell and centres.
fn sheared(params: &Params, steps: u64) -> (Snapshot, Cell, Vec<Vec2>) {
    let mut simulation = Simulation::new(params, 5, &NearFields::default()).unwrap();
    while simulation.steps() < steps {
        simulation.step().unwrap();
    }
    let snapshot = simulation.snapshot();
    let offset = simulation.strain() * snapshot.side;
    let cell = Cell::periodic(snapshot.side, snapshot.side, offset).unwrap();
    let centres = snapshot.centres.iter().map(|&[x, y]| Vec2::new(x, y));
    (snapshot.clone(), cell, centres.collect())
}

/// One stage of a layer, held pair by pair or factored: velocities, contacts, and the matrix for more.
fn stage(
    (snapshot, cell, centres): &(Snapshot, Cell, Vec<Vec2>),
    surface: Surface,
    pairwise: bool,
) -> (Vec<f64>, Vec<Contact>, Motion) {
    let (radii, tables) = (&snapshot.radii, NearFields::default());
    let resistance = if pairwise {
        Resistance::new_pairwise(cell, radii, &tables, &[]).unwrap()
    } else {
        Resistance::new(Hydrodynamics::BallMelrose, cell, radii, &tables).unwrap()
    };
    let mut motion = Motion::new(resistance);
    let mut memory = snapshot.memory.clone();
    let law = ContactLaw::Rigid {
        surface,
        time_span: 0.01,
        memory: &mut memory,
    };
    let solved = motion.solve(cell, centres, &Background::SHEAR, &[], law);
    let quality = solved.unwrap();
    assert!(quality.converged(), "{quality:?}");
    let velocities = motion.velocities().to_vec();
    (velocities, motion.contacts.list.clone(), motion)
}

#[test]
fn velocities_forces_and_states_are_those_of_the_factored_layer() {
    for (area_fraction, friction, steps, load, limit) in [
        (0.75, 0.3, 40, 0.2, 1e-6),
        (0.75, 0.3, 40, 40.0, 1e-6),
        (0.75, 0.0, 40, 0.2, 1e-6),
        // Near jamming forces of 10³ meet the compliance that only the factored layer has: 1e-7 of the velocities, amplified.
        (0.8, 1.0, 60, 0.2, 1e-5),
    ] {
        let layer = sheared(&params(100, area_fraction, friction), steps);
        let surface = Surface {
            roughness: 0.01,
            friction,
            critical_load: load,
        };
        let (expected, contacts, _) = stage(&layer, surface, false);
        let (found, others, _) = stage(&layer, surface, true);
        let fastest = expected.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        for (a, b) in found.iter().zip(&expected) {
            assert!(
                (a - b).abs() < limit * fastest,
                "{a} {b} of {fastest}: {area_fraction} {friction} {load}"
            );
        }
        let largest = contacts.iter().fold(0.0, |m: f64, c| m.max(c.normal_force));
        assert!(largest > 10.0);
        let mut frictional = 0;
        for c in &contacts {
            let same = |o: &&Contact| (o.pair.i, o.pair.j) == (c.pair.i, c.pair.j);
            let other = others.iter().find(same).unwrap();
            let limit = 10.0 * limit * largest;
            assert!((other.normal_force - c.normal_force).abs() < limit);
            assert!((other.tangential_force - c.tangential_force).abs() < limit);
            if c.normal_force > limit {
                assert_eq!(other.state, c.state);
            }
            frictional += usize::from(c.state != ContactState::Frictionless);
        }
        assert_eq!(frictional > 0, friction > 0.0);
    }
}

#[test]
fn motion_without_contacts_and_products_are_those_of_the_factored_layer() {
    let layer = sheared(&params(100, 0.75, 0.3), 40);
    let (_, cell, centres) = &layer;
    let surface = Surface {
        roughness: 0.0,
        friction: 0.0,
        critical_load: f64::INFINITY,
    };
    let [dense, pairwise] = [false, true].map(|pairwise| {
        let mut motion = stage(&layer, surface, pairwise).2;
        let shear = &Background::SHEAR;
        let torques: Vec<f64> = (0..300).map(|k| f64::from(k).sin()).collect();
        let solved = motion.solve(cell, centres, shear, &torques, ContactLaw::None);
        solved.unwrap();
        motion
    });
    for (a, b) in pairwise.velocities().iter().zip(dense.velocities()) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    let (mut forces, mut stresslets, mut work) = (Vec::new(), Vec::new(), Vec::new());
    let (v, strain) = (dense.velocities(), nalgebra::Vector3::zeros());
    dense
        .resistance
        .apply(v, &strain, &mut work, &mut forces, &mut stresslets);
    let mut product = vec![0.0; 300];
    let pairwise = pairwise.resistance.pairwise().unwrap();
    pairwise.apply(v, &mut product);
    for (a, b) in product.iter().zip(&forces) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn a_resistance_held_pair_by_pair_knows_rigid_contacts_only() {
    let layer = sheared(&params(40, 0.6, 0.3), 1);
    let (snapshot, cell, centres) = &layer;
    let tables = NearFields::default();
    let resistance = Resistance::new_pairwise(cell, &snapshot.radii, &tables, &[]).unwrap();
    let mut motion = Motion::new(resistance);
    let mut listed = sd_core::contact::procedure::ContactList::default();
    let law = ContactLaw::Procedure {
        surface: params(40, 0.6, 0.3).surface(),
        listed: &mut listed,
    };
    let solved = motion.solve(cell, centres, &Background::SHEAR, &[], law);
    assert_eq!(solved.unwrap_err(), Error::OnlyRigidContacts);
}

#[test]
fn a_run_resumed_has_the_same_bits() {
    let params = params(LEAST_PAIRWISE, 0.75, 0.3);
    let tables = NearFields::default();
    let mut whole = Simulation::new(&params, 2, &tables).unwrap();
    let mut patterns = Vec::new();
    let mut parts = Simulation::new(&params, 2, &tables).unwrap();
    for step in 0..24 {
        if step % 5 == 3 {
            let stored = serde_json::to_string(&parts.snapshot()).unwrap();
            let snapshot: Snapshot = serde_json::from_str(&stored).unwrap();
            assert!(!snapshot.near_pairs.is_empty());
            patterns.push(snapshot.near_pairs.clone());
            parts = Simulation::from_snapshot(&params, snapshot, &tables).unwrap();
        }
        let (a, b) = (whole.step().unwrap(), parts.step().unwrap());
        assert_eq!(a.viscosity.to_bits(), b.viscosity.to_bits(), "step {step}");
    }
    assert_eq!(whole.snapshot(), parts.snapshot());
    patterns.dedup();
    assert!(patterns.len() > 1, "the pattern never changed");
}

#[test]
fn a_run_with_an_iterated_far_field_resumed_has_the_same_bits() {
    let params = Params {
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        ..params(LEAST_ITERATED, 0.78, 0.3)
    };
    let tables = NearFields::default();
    let mut whole = Simulation::new(&params, 2, &tables).unwrap();
    let first = whole.step().unwrap();
    let mut rest = Simulation::from_snapshot(&params, whole.snapshot(), &tables).unwrap();
    let (a, b) = (whole.step().unwrap(), rest.step().unwrap());
    assert_eq!(a, b);
    assert_eq!(whole.snapshot(), rest.snapshot());
    assert!(
        a.contacts > 0 && a.counters.unconverged_stages == 0,
        "{a:?}"
    );
    assert!(first.viscosity > 1.0 + 5.0 / 3.0 * 0.78);
}

#[test]
fn laws_chosen_one_by_one_stay_factored() {
    let params = Params {
        contact: ContactScheme::Laws(ContactLaws {
            tangential: TangentialLaw::Coulomb,
            ..ContactLaws::PAPER
        }),
        ..params(LEAST_PAIRWISE, 0.4, 0.3)
    };
    let mut simulation = Simulation::new(&params, 1, &NearFields::default()).unwrap();
    simulation.step().unwrap();
    assert!(simulation.snapshot().near_pairs.is_empty());
}

#[test]
fn a_large_layer_satisfies_its_conditions_near_jamming() {
    let params = params(LEAST_PAIRWISE, 0.8, 1.0);
    let layer = sheared(&params, 25);
    let counters = layer.0.counters;
    assert_eq!(counters.unconverged_stages, 0, "{counters:?}");
    assert!(counters.minimum_gap > 0.0085);
    let (velocities, contacts, motion) = stage(&layer, params.surface(), true);
    let carrying = contacts.iter().filter(|c| c.normal_force > 0.0).count();
    assert!(carrying > LEAST_PAIRWISE, "{carrying}");
    let largest = contacts.iter().fold(0.0, |m: f64, c| m.max(c.normal_force));
    let (mut forces, mut stresslets, mut work) = (Vec::new(), Vec::new(), Vec::new());
    let strain = Background::SHEAR.strain();
    motion.resistance.apply(
        &velocities,
        &strain,
        &mut work,
        &mut forces,
        &mut stresslets,
    );
    for c in &contacts {
        let excess = c.pair.gap - 0.01;
        let share = if excess < 0.0 { 0.2 } else { 1.0 };
        let w = c.normal_velocity + share * excess / 0.01;
        assert!(w > -1e-6 && c.normal_force >= 0.0, "{c:?}");
        assert!(w < 1e-8 || c.normal_force == 0.0, "{c:?}");
        assert!(c.tangential_force.abs() <= c.normal_force + 1e-7 * largest);
        // What contacts exert on the spheres must be what the fluid resists with.
        let (n, t) = (c.pair.normal, sd_core::contact::tangent(c.pair.normal));
        let on_j = n * c.normal_force - t * c.tangential_force;
        for (sphere, lever, sign) in [(c.pair.i, c.levers[0], -1.0), (c.pair.j, c.levers[1], 1.0)] {
            forces[3 * sphere] -= sign * on_j.x;
            forces[3 * sphere + 1] -= sign * on_j.y;
            forces[3 * sphere + 2] -= lever * c.tangential_force;
        }
    }
    let left = forces.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
    assert!(left < 1e-6 * largest, "{left} of {largest}");
}
