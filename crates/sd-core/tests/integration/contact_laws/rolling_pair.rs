//! Two spheres pressed together in relative rotation.

use super::pushed_pair::{across, pushed_by, stretched};
use super::{HERTZ, RIGID, SPRING, laws, overlap, pair, solved, stick_slide};
use sd_core::contact::{Laws, NormalForce};
use sd_core::instant::SolvedConfiguration;
use sd_core::{FrictionOnset, TangentialLaw};

/// Radius of rolling of spheres of radii 1 and 1.4.
const RADIUS: f64 = 2.0 * 1.4 / 2.4;

fn rolling(normal: NormalForce, rolling_friction: f64) -> Laws {
    Laws {
        rolling_friction,
        ..laws(normal, TangentialLaw::Coulomb, 1.0)
    }
}

/// The pair pressed by 5, under a torque on the first sphere and its opposite on the second.
fn turned(laws: &Laws, torque: f64) -> SolvedConfiguration {
    let gap = match laws.normal {
        normal if normal.is_rigid() => 0.01,
        normal => 0.01 - overlap(normal, 5.0),
    };
    let mut configuration = pair(gap, 5.0, 0.0);
    configuration.torques = vec![torque, -torque];
    solved(&configuration, laws, 0.001)
}

#[test]
fn pair_rolls_once_the_torque_is_the_bound_and_exactly_by_the_excess() {
    for normal in [RIGID, SPRING, HERTZ] {
        let bound = 0.1 * RADIUS * 5.0;
        for sign in [1.0, -1.0] {
            let held = turned(&rolling(normal, 0.1), sign * 0.999 * bound);
            let c = held.contacts[0];
            // The compliance of rigid contacts, 1e-10, costs 1e-7 of a force. Opposite torques on a
            // rigid pair do not move it, and the couple balances them.
            assert!((c.normal_force - 5.0).abs() < 1e-6, "{normal:?}: {c:?}");
            assert!((c.rolling_force * RADIUS + sign * 0.999 * bound).abs() < 1e-6);
            assert!(c.rolling_velocity.abs() < 1e-8 && c.tangential_force.abs() < 1e-6);
            assert!(held.disturbances.iter().flatten().all(|v| v.abs() < 1e-8));

            let excess = sign * 0.7;
            let rolls = turned(&rolling(normal, 0.1), sign * bound + excess);
            let free = turned(&rolling(normal, 0.0), excess);
            let c = rolls.contacts[0];
            assert!((c.rolling_force.abs() - 0.1 * c.normal_force).abs() < 1e-12);
            assert!(c.rolling_force * c.rolling_velocity > 0.0, "{c:?}");
            assert!(c.rolling_velocity.abs() > 1e-3);
            let motions = rolls.disturbances.iter().zip(&free.disturbances);
            for (a, b) in motions.flat_map(|(a, b)| a.iter().zip(b)) {
                assert!((a - b).abs() < 1e-7, "{normal:?}: {a} {b}");
            }
        }
    }
}

#[test]
fn couple_turns_no_pair_and_moves_none() {
    // A pair rotated rigidly by a torque on one sphere: the interactions of the spheres sum to
    // zero.
    let mut configuration = pair(0.01, 5.0, 0.0);
    configuration.torques = vec![3.0, 0.0];
    let instant = solved(&configuration, &rolling(RIGID, 10.0), 0.001);
    let welded = solved(
        &configuration,
        &laws(RIGID, TangentialLaw::StickRotate, 1.0),
        0.001,
    );
    let c = instant.contacts[0];
    assert!(c.rolling_velocity.abs() < 1e-8 && c.rolling_force.abs() > 0.1);
    let motions = instant.disturbances.iter().zip(&welded.disturbances);
    for (a, b) in motions.flat_map(|(a, b)| a.iter().zip(b)) {
        assert!((a - b).abs() < 1e-7, "{a} {b}");
    }
}

#[test]
fn rolling_friction_begins_as_friction_does() {
    let at = |onset, critical_load| {
        let mut laws = rolling(RIGID, 0.1);
        laws.onset = onset;
        laws.surface.critical_load = critical_load;
        turned(&laws, 20.0).contacts[0]
    };
    let jumped = at(FrictionOnset::CriticalLoad, 3.0);
    assert!((jumped.rolling_force + 0.1 * jumped.normal_force).abs() < 1e-12);
    let reduced = at(FrictionOnset::Reduced, 3.0);
    assert!((reduced.rolling_force + 0.1 * (reduced.normal_force - 3.0)).abs() < 1e-12);
    for onset in [FrictionOnset::CriticalLoad, FrictionOnset::Reduced] {
        assert_eq!(at(onset, 6.0).rolling_force, 0.0);
    }
}

#[test]
fn spring_of_rolling_follows_to_second_order_and_stores_what_work_leaves_over() {
    let springs = |rolling_friction| Laws {
        rolling_friction,
        ..stick_slide(SPRING, 1000.0, 2.0)
    };
    let start = 0.01 - 5.0 / 2000.0;
    let at = |steps| pushed_by(&springs(1.0), start, [5.0, 1.0, 2.0], 0.5, steps, 0.0);
    let force = |steps| at(steps).memory.rolling_springs.forces.0[0].2;
    let exact = force(1600);
    let order = ((force(50) - exact) / (force(100) - exact)).abs().log2();
    assert!((order - 2.0).abs() < 0.3, "order {order}");
    // Finally the spring balances the torque.
    let rest = pushed_by(&springs(1.0), start, [5.0, 0.0, 2.0], 5.0, 500, 0.0);
    let end = rest.memory.rolling_springs.forces.0[0].2;
    assert!((end * RADIUS + 2.0).abs() < 1e-3, "{end}");
    let mismatch = |steps| {
        let p = at(steps);
        p.work - p.dissipated - stretched(&p, 1000.0) + 0.5 * 2000.0 * (5.0_f64 / 2000.0).powi(2)
    };
    let (coarse, fine) = (mismatch(200), mismatch(400));
    let order = (coarse / fine).abs().log2();
    assert!(
        fine.abs() < 1e-4 && order > 1.7,
        "{fine:.1e}, order {order}"
    );
    // Beside a rigid contact it does so too.
    let rigid = |steps| {
        let laws = Laws {
            rolling_friction: 1.0,
            ..stick_slide(RIGID, 1000.0, 2.0)
        };
        let p = pushed_by(&laws, 0.01, [5.0, 1.0, 2.0], 0.5, steps, 0.0);
        let stored = across(&p, 1000.0);
        assert!(stored > 1e-4);
        (
            p.work - p.dissipated - stored,
            p.memory.rolling_springs.forces.0[0].2,
        )
    };
    let [(coarse, a), (fine, b), (_, exact)] = [100, 200, 1600].map(rigid);
    let (balance, order) = (
        (coarse / fine).abs().log2(),
        ((a - exact) / (b - exact)).log2(),
    );
    assert!(
        fine.abs() < 1e-4 && balance > 1.7,
        "{fine:.1e}, order {balance}"
    );
    assert!((order - 2.0).abs() < 0.3, "order {order}");
    // Beyond its bound it slides and stays at it.
    let slides = pushed_by(&springs(0.1), start, [5.0, 0.0, 2.0], 0.5, 200, 0.0);
    let end = slides.memory.rolling_springs.forces.0[0].2;
    assert!((end + 0.1 * slides.last.normal_force).abs() < 1e-6, "{end}");
    assert!(slides.last.rolling_velocity < -1e-3);
}
