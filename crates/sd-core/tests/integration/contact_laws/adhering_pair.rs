//! Two spheres that adhere.

use super::pushed_pair::{gap, pushed};
use super::{HERTZ, RIGID, SPRING, laws, overlap, pair, solved};
use sd_core::TangentialLaw;
use sd_core::contact::{Laws, NormalForce};

fn adhesive(normal: NormalForce, adhesion: f64) -> Laws {
    Laws {
        adhesion,
        ..laws(normal, TangentialLaw::Coulomb, 0.5)
    }
}

#[test]
fn pulled_pair_holds_until_the_pull_is_the_adhesion() {
    // Rigid asperities: at rest below the pull-off force, and above it moved by the excess alone.
    // The compliance of rigid contacts, 1e-10, costs 1e-7 of a force.
    for pull in [0.0, 2.0, 3.999] {
        let held = solved(&pair(0.01, -pull, 0.0), &adhesive(RIGID, 4.0), 0.01);
        let (c, adhesive) = (held.contacts[0], held.adhesive[0]);
        assert_eq!(adhesive.normal_force, -4.0);
        assert!((c.normal_force - (4.0 - pull)).abs() < 1e-6, "{c:?}");
        assert!(c.normal_velocity.abs() < 1e-8);
        assert!(held.disturbances.iter().flatten().all(|v| v.abs() < 1e-8));
    }
    let parting = solved(&pair(0.01, -6.0, 0.0), &adhesive(RIGID, 4.0), 0.01);
    let free = solved(&pair(0.01, -2.0, 0.0), &adhesive(RIGID, 0.0), 0.01);
    assert_eq!(parting.contacts[0].normal_force, 0.0);
    assert!(parting.contacts[0].normal_velocity > 1e-4);
    let motions = parting.disturbances.iter().zip(&free.disturbances);
    for (a, b) in motions.flat_map(|(a, b)| a.iter().zip(b)) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
    // After separation there is no attraction.
    let apart = |adhesion| solved(&pair(0.0102, -6.0, 0.0), &adhesive(RIGID, adhesion), 0.01);
    assert!(apart(4.0).adhesive.is_empty());
    assert_eq!(apart(4.0).disturbances, apart(0.0).disturbances);
}

#[test]
fn adhesion_presses_and_friction_knows_it() {
    // Without other forces the load is F_A, and friction is at most ν F_A.
    let at = |shear| solved(&pair(0.01, 0.0, shear), &adhesive(RIGID, 4.0), 0.01).contacts[0];
    let stuck = at(1.0);
    assert!(stuck.slip_velocity.abs() < 1e-8 && stuck.normal_force > 3.0);
    let slides = at(20.0);
    assert!((slides.tangential_force.abs() - 0.5 * slides.normal_force).abs() < 1e-12);
    assert!(slides.normal_force > 3.0);
}

#[test]
fn adhering_springs_come_to_rest_where_pull_and_adhesion_balance_and_part_beyond() {
    for normal in [SPRING, HERTZ] {
        let laws = adhesive(normal, 4.0);
        let start = 0.01 - overlap(normal, 4.0);
        let held = pushed(&laws, start, [-3.0, 0.0], 20.0, 400, 0.3);
        let rest = 0.01 - overlap(normal, 1.0);
        assert!((gap(&held) - rest).abs() < 1e-7, "{} {rest}", gap(&held));
        let parted = pushed(&laws, start, [-6.0, 0.0], 2.0, 400, 0.3);
        assert!(gap(&parted) > 0.012, "{}", gap(&parted));
    }
}
