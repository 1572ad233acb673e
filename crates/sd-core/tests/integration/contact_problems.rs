//! Recorded steps of every contact law, flowing and near jamming, each solved from the state before
//! it.
//!
//! Their origin is described in `tests/data/README.md`.

mod convex;

use sd_core::contact::Quality;
use sd_core::{NearFields, Params, Simulation, Snapshot, TangentialLaw};
use serde::Deserialize;
use std::path::Path;

/// The state before a step.
#[derive(Deserialize)]
struct Recorded {
    name: String,
    params: Params,
    snapshot: Snapshot,
}

impl Recorded {
    /// Whether the layer flows at any friction.
    fn flows(&self) -> bool {
        let welds = self.params.contact.laws().tangential == TangentialLaw::StickRotate;
        self.params.area_fraction <= 0.693 && !welds
    }

    /// Whether rigid contacts jam the layer: their problems take seconds each.
    fn is_hard(&self) -> bool {
        let (c, nu) = (self.params.area_fraction, self.params.friction);
        let coulomb = self.params.contact.laws().tangential == TangentialLaw::Coulomb;
        coulomb && !self.params.contact.laws().is_soft() && (c >= 0.76 && nu >= 1.0 || c >= 0.8)
    }
}

/// The states of a law.
fn recorded(law: &str) -> Vec<Recorded> {
    let path = format!("tests/data/contact_problems/{law}.json");
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Solves the problems of a law that are chosen.
fn solve(law: &str, chosen: impl Fn(&Recorded) -> bool) {
    let all = recorded(law);
    let tables = NearFields::default();
    let mut solved = 0;
    for recorded in all.into_iter().filter(|recorded| chosen(recorded)) {
        let (name, flows) = (recorded.name.clone(), recorded.flows());
        let before = recorded.snapshot.counters;
        let mut layer =
            Simulation::from_snapshot(&recorded.params, recorded.snapshot, &tables).unwrap();
        let sample = layer.step().unwrap();
        let counters = layer.counters();
        assert!(sample.viscosity.is_finite(), "{name}");
        // Conditions hold if an admissible motion exists.
        assert!(
            counters.worst_residual <= before.worst_residual.max(Quality::RESIDUAL_LIMIT),
            "{name}: {counters:?}"
        );
        if flows {
            assert_eq!(
                counters.jammed_stages, before.jammed_stages,
                "{name}: {counters:?}"
            );
            assert_eq!(
                counters.inexact_stages, before.inexact_stages,
                "{name}: {counters:?}"
            );
        }
        solved += 1;
    }
    assert!(solved > 0, "{law}: nothing was chosen");
}

#[test]
fn problems_of_every_law_are_solved() {
    for law in [
        "rigid-roll-slip",
        "rigid-coulomb",
        "rigid-coulomb-reduced",
        "rigid-stick-rotate",
        "spring-roll-slip",
        "spring-coulomb",
        "spring-stick-slide",
        "hertz-stick-slide",
        "rigid-coulomb-rolling",
        "spring-stick-slide-rolling",
    ] {
        solve(law, |recorded| !recorded.is_hard());
    }
}

#[test]
#[ignore = "minutes: layers that jam"]
fn problems_of_layers_that_jam_end() {
    for law in ["rigid-coulomb", "rigid-coulomb-reduced"] {
        solve(law, Recorded::is_hard);
    }
}

#[test]
fn gaps_hold_in_layers_that_rolling_friction_jams() {
    solve("rigid-coulomb-rolling-jamming", |_| true);
}
