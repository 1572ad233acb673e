//! Suspensions in a campaign file.

use super::{CampaignError, GOOD, parse_text};

fn suspension() -> String {
    GOOD.replace("area_fraction = [0.693]", "volume_fraction = [0.3, 0.45]")
        .replace("[0.0, 0.3]", "0.3")
        .replace("[0, 0.1, inf]", "inf")
}

/// The fault and what is allowed, on one line.
fn complaint(text: &str) -> String {
    match parse_text(text) {
        Err(CampaignError::Faulty(fault)) => format!("{fault}\n{}", fault.allowed()),
        other => panic!("{text}: {other:?}"),
    }
}

#[test]
fn a_grid_has_a_volume_fraction_in_place_of_an_area_fraction() {
    let campaign = parse_text(&suspension()).unwrap();
    assert_eq!(campaign.cases.len(), 2 * 4);
    let (_, case) = &campaign.cases[4];
    assert_eq!(
        (case.params.volume_fraction, case.params.area_fraction),
        (Some(0.45), 0.0)
    );
    assert!(case.label().starts_with("φ=0.45 "), "{}", case.label());
    assert!(parse_text(&suspension().replace("hydrodynamics = \"ball-melrose\"\n", "")).is_ok());
}

#[test]
fn what_is_no_suspension_is_refused_at_its_line_with_a_remedy() {
    for (from, to, place, said) in [
        (
            "friction = 0.3",
            "friction = 0.3\narea_fraction = 0.6",
            "8:17: `area_fraction` = 0.6 has no meaning in a suspension",
            "either of the two: a layer or a suspension",
        ),
        (
            "[0.3, 0.45]",
            "[0.3, 0.7]",
            "6:25: `volume_fraction` = 0.7 is out of range",
            "from 0.01 to 0.64",
        ),
        (
            "roughness = 0.01",
            "roughness = 0.4",
            "6:25: `volume_fraction` = 0.45 is denser than any suspension",
            "at most 0.373 at this roughness",
        ),
        (
            "[0.3, 0.45]",
            "[0.3, 0.64]",
            "6:25: `volume_fraction` = 0.64 is denser than any suspension",
            "at most 0.635 at this roughness",
        ),
        (
            "spheres = 90",
            "spheres = 20",
            "spheres` = 20 at `volume_fraction` = 0.3 make a cell",
            "spheres at this volume fraction, or a volume fraction of at most",
        ),
        (
            "spheres = 90",
            "spheres = 90\ncontact = \"procedure\"",
            "12:11: `contact` = \"procedure\" is a protocol of layers",
            "\"rigid\" or a law",
        ),
        (
            "volume_fraction = [0.3, 0.45]",
            "",
            "[[grid]] has no `area_fraction`",
            "`volume_fraction = 0.45`",
        ),
    ] {
        let error = complaint(&suspension().replace(from, to));
        assert!(error.contains(place), "{to}: {error}");
        assert!(error.contains(said), "{to}: {error}");
    }
}

#[test]
fn no_suspension_begins_with_a_layer_whatever_else_is_wrong_with_that() {
    // Neither that there is no such file nor the number of seeds matters.
    let text = suspension().replace("seeds = 4", "seeds = 4\nstart = \"nowhere.json\"");
    let error = complaint(&text);
    let said = "11:9: `start` gives a layer, and a suspension cannot begin with one";
    assert!(error.contains(said), "{error}");
}
