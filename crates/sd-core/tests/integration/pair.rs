//! The paper's Fig. 8: two spheres moving past each other.

use sd_core::pair::{PairScenario, PairTrajectory, pass};
use sd_core::{Error, NearFields};

fn case(size_ratio: f64, contact: Option<(f64, f64)>) -> PairTrajectory {
    let scenario = PairScenario {
        size_ratio,
        contact,
        offset: 0.25 * size_ratio,
        start: 5.0 + size_ratio,
        time_step: 0.2,
    };
    pass(&scenario, &NearFields::default()).unwrap()
}

#[test]
fn figure_8_for_equal_spheres() {
    let free = case(1.0, None);
    // Fore-aft symmetric, each sphere rotated by almost a quarter turn.
    assert!(
        (free.final_offset - 0.25).abs() < 1e-4,
        "{}",
        free.final_offset
    );
    for turn in free.rotation_degrees {
        assert!((75.0..100.0).contains(&turn.abs()), "{turn}");
    }
    assert!((free.rotation_degrees[0] - free.rotation_degrees[1]).abs() < 1e-6);
    let touching = case(1.0, Some((0.05, 0.0)));
    assert!(touching.minimum_gap > 0.98 * 0.05);
    assert!(touching.final_offset > free.final_offset + 0.05);
    assert!(touching.time < free.time);
    let turn = |p: &PairTrajectory| p.rotation_degrees[0].abs();
    assert!(turn(&touching) < turn(&free) - 3.0);
    let little = case(1.0, Some((0.05, 0.1)));
    let much = case(1.0, Some((0.05, 0.5)));
    assert!((turn(&little) - turn(&touching)) < 0.5 * (turn(&free) - turn(&touching)));
    assert!((turn(&much) - turn(&touching)) > 0.5 * (turn(&free) - turn(&touching)));
}

#[test]
fn the_small_sphere_of_an_unequal_pair_turns_most() {
    // An offset as in the figure: a quarter of the large sphere's radius.
    for (ratio, times) in [(2.0, 1.2), (10.0, 4.0)] {
        let free = case(ratio, None);
        assert!(
            (free.final_offset - 0.25 * ratio).abs() < 2e-3,
            "{ratio}: {}",
            free.final_offset
        );
        assert!(free.rotation_degrees[0].abs() > times * free.rotation_degrees[1].abs());
    }
}

#[test]
fn head_on_spheres_are_refused() {
    let scenario = PairScenario {
        size_ratio: 1.0,
        contact: None,
        offset: 0.0,
        start: 5.0,
        time_step: 0.2,
    };
    let refused = pass(&scenario, &NearFields::default());
    assert!(matches!(
        refused,
        Err(Error::OutOfRange {
            field: "offset",
            ..
        })
    ));
}
