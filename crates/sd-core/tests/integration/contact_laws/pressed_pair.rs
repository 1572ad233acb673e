//! One instant of two spheres pressed together.

use super::{HERTZ, RIGID, SPRING, laws, overlap, pair, solved};
use sd_core::contact::{ContactState, Laws, NormalForce, Surface};
use sd_core::law::repulsion::ExponentialRepulsion;
use sd_core::modes::Vec2;
use sd_core::{ContactLaws, FrictionOnset, NormalLaw, TangentialLaw};

#[test]
fn pressed_pair_is_in_exact_balance() {
    for (normal, overlap) in [(SPRING, 5.0 / 2000.0), (HERTZ, overlap(HERTZ, 5.0))] {
        for time_span in [1e-4, 0.01] {
            let at_rest = pair(0.01 - overlap, 5.0, 0.0);
            let instant = solved(
                &at_rest,
                &laws(normal, TangentialLaw::Coulomb, 0.5),
                time_span,
            );
            let c = instant.contacts[0];
            assert!((c.normal_force - 5.0).abs() < 1e-8, "{normal:?}: {c:?}");
            assert!(c.normal_velocity.abs() < 1e-8);
            // Opposite forces of equal size move a touching pair nowhere.
            assert!(
                instant
                    .disturbances
                    .iter()
                    .flatten()
                    .all(|v| v.abs() < 1e-8)
            );
        }
    }
    // A repulsion alone: F0 a_ij exp(-g/l) = 5 at g = l ln(F0 a_ij/5), a_ij = 7/6.
    let repulsion = ExponentialRepulsion {
        force: 20.0,
        length: 0.02,
    };
    let alone = Laws {
        repulsion: Some(repulsion),
        ..laws(
            NormalForce {
                law: NormalLaw::ExponentialRepulsion.into(),
                ..RIGID
            },
            TangentialLaw::Coulomb,
            0.0,
        )
    };
    let instant = solved(
        &pair(0.02 * (4.0_f64 * 7.0 / 6.0).ln(), 5.0, 0.0),
        &alone,
        0.01,
    );
    assert!(instant.contacts.is_empty());
    assert!(
        instant
            .disturbances
            .iter()
            .flatten()
            .all(|v| v.abs() < 1e-10)
    );
}

#[test]
fn dashpot_adds_its_share_and_never_pulls() {
    let damped = |dashpot| {
        let normal = NormalForce { dashpot, ..SPRING };
        laws(normal, TangentialLaw::Coulomb, 0.0)
    };
    let approaching = solved(&pair(0.009, 10.0, 0.0), &damped(300.0), 1e-9).contacts[0];
    let expected = 2000.0 * 0.001 - 300.0 * approaching.normal_velocity;
    assert!(approaching.normal_velocity < 0.0);
    assert!((approaching.normal_force - expected).abs() < 1e-5);
    // Pulled apart faster than the spring follows.
    let parting = solved(&pair(0.009, -1e4, 0.0), &damped(300.0), 1e-9).contacts[0];
    assert_eq!(parting.normal_force, 0.0);
}

#[test]
fn coulomb_sticks_without_slip_inside_the_cone_and_slides_on_it() {
    for normal in [RIGID, SPRING, HERTZ] {
        let gap = if normal.is_rigid() { 0.01 } else { 0.008 };
        let at = |friction, shear| {
            solved(
                &pair(gap, 5.0, shear),
                &laws(normal, TangentialLaw::Coulomb, friction),
                0.001,
            )
            .contacts[0]
        };
        let stuck = at(1.0, 1.0);
        assert_eq!(stuck.state, ContactState::Sticking);
        assert!(stuck.slip_velocity.abs() < 1e-8, "{stuck:?}");
        assert!(stuck.tangential_force.abs() < stuck.normal_force);
        let sliding = at(0.1, 4.0);
        assert_eq!(sliding.state, ContactState::Slipping);
        assert!((sliding.tangential_force.abs() - 0.1 * sliding.normal_force).abs() < 1e-12);
        assert!(sliding.tangential_force * sliding.slip_velocity > 0.0);
    }
}

#[test]
fn stick_rotate_turns_a_pressed_pair_as_one_body() {
    for normal in [RIGID, SPRING] {
        let gap = if normal.is_rigid() { 0.01 } else { 0.0075 };
        let instant = solved(
            &pair(gap, 5.0, 3.0),
            &laws(normal, TangentialLaw::StickRotate, 1.0),
            0.001,
        );
        let c = instant.contacts[0];
        assert!(c.normal_force > 1.0 && c.slip_velocity.abs() < 1e-8);
        let [first, second] = [instant.disturbances[0], instant.disturbances[1]];
        assert!(first[2].abs() > 0.01 && (first[2] - second[2]).abs() < 1e-8);
        // Rigid: the centres turn about each other at the rate at which the spheres do.
        let across = Vec2::new(second[0] - first[0], second[1] - first[1])
            .dot(&Vec2::new(-c.pair.normal.y, c.pair.normal.x));
        assert!((across - first[2] * c.pair.distance).abs() < 1e-7);
        // Under tension they separate and rotate freely.
        let parting = solved(
            &pair(gap, -5.0, 3.0),
            &laws(normal, TangentialLaw::StickRotate, 1.0),
            1e-6,
        );
        if normal.is_rigid() {
            assert_eq!(parting.contacts[0].tangential_force, 0.0);
        }
    }
}

#[test]
fn onset_takes_the_load_off_or_jumps() {
    let at = |onset, critical_load| {
        let mut laws = laws(RIGID, TangentialLaw::Coulomb, 0.2);
        laws.onset = onset;
        laws.surface.critical_load = critical_load;
        solved(&pair(0.01, 5.0, 4.0), &laws, 0.001).contacts[0]
    };
    let jumped = at(FrictionOnset::CriticalLoad, 3.0);
    assert!((jumped.tangential_force.abs() - 0.2 * jumped.normal_force).abs() < 1e-12);
    let reduced = at(FrictionOnset::Reduced, 3.0);
    let limit = 0.2 * (reduced.normal_force - 3.0);
    assert!((reduced.tangential_force.abs() - limit).abs() < 1e-12);
    for onset in [FrictionOnset::CriticalLoad, FrictionOnset::Reduced] {
        let none = at(onset, 6.0);
        assert_eq!(none.tangential_force, 0.0);
        assert_eq!(none.state, ContactState::Frictionless);
    }
}

#[test]
fn friction_at_every_contact_needs_no_load() {
    // A contact below the critical load has friction only under laws without an onset.
    let light = |onset| {
        let choice = ContactLaws {
            onset,
            ..ContactLaws::linear_spring(1e4, TangentialLaw::Coulomb, 0.01)
        };
        let surface = Surface {
            roughness: 0.01,
            friction: 0.5,
            critical_load: 100.0,
        };
        let c = solved(&pair(0.00999, 5.0, 1.0), &Laws::new(&choice, surface), 0.01).contacts[0];
        assert!(c.normal_force > 0.0 && c.normal_force < 100.0, "{c:?}");
        c.state == ContactState::Frictionless
    };
    assert!(light(FrictionOnset::CriticalLoad) && light(FrictionOnset::Reduced));
    assert!(!light(FrictionOnset::Contact));
}
