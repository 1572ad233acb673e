//! Imposed pressure in a campaign file.

use sd_core::model::PressureKind;

use super::{CampaignError, GOOD, parse_text};

fn suspension(more: &str) -> String {
    GOOD.replace("area_fraction = [0.693]", "volume_fraction = 0.5")
        .replace("[0.0, 0.3]", "0.3")
        .replace("[0, 0.1, inf]", "inf")
        .replace("spheres = 90", &format!("spheres = 90\n{more}"))
}

fn complaint(text: &str) -> String {
    match parse_text(text) {
        Err(CampaignError::Faulty(fault)) => format!("{fault}\n{}", fault.allowed()),
        other => panic!("{text}: {other:?}"),
    }
}

#[test]
fn a_viscous_number_imposes_the_pressure() {
    let campaign = parse_text(&suspension("viscous_number = [0.1, 0.01]")).unwrap();
    let cases = campaign.cases.iter().step_by(4);
    let numbers: Vec<_> = cases.map(|(_, case)| case.params.viscous_number).collect();
    assert_eq!(numbers, [Some(0.1), Some(0.01)]);
    let label = campaign.cases[0].1.label();
    assert!(label.contains(" J=0.1 "), "{label}");
}

#[test]
fn a_ratio_of_stress_and_pressure_imposes_the_pressure_too() {
    let keys = "macroscopic_friction = [0.5, 0.4]\npressure = \"gradient\"";
    let wide = suspension(keys).replace("spheres = 90", "spheres = 130");
    let campaign = parse_text(&wide).unwrap();
    let params = &campaign.cases[0].1.params;
    assert_eq!(params.macroscopic_friction, Some(0.5));
    assert_eq!(params.pressure, PressureKind::Gradient);
    let label = campaign.cases[0].1.label();
    assert!(label.contains(" σ/P=0.5 "), "{label}");
}

#[test]
fn pressures_that_cannot_be_imposed_are_refused_with_a_remedy() {
    for (more, fault, remedy) in [
        ("viscous_number = 0", "out of range", "above 0"),
        ("viscous_number = -0.1", "out of range", "above 0"),
        (
            "viscous_number = 0.1\nflow = \"uniaxial\"\npressure = \"gradient\"",
            "no shear",
            "`flow` = \"shear\"",
        ),
        (
            "viscous_number = 0.1\nmacroscopic_friction = 0.5",
            "it follows",
            "one of the two",
        ),
        (
            "pressure = \"gradient\"",
            "no meaning",
            "an imposed pressure",
        ),
    ] {
        let text = complaint(&suspension(more));
        assert!(
            text.contains(fault) && text.contains(remedy) && text.contains("friction.toml:"),
            "{more}: {text}"
        );
        // Keys are those of the file.
        assert!(!text.contains("imposed_"), "{text}");
    }
    let full =
        suspension("viscous_number = 0.1").replace("\"ball-melrose\"", "\"stokesian-dynamics\"");
    let text = complaint(&full);
    assert!(
        text.contains("far field") && text.contains("lubrication"),
        "{text}"
    );
    let stress =
        suspension("viscous_number = 0.1").replace("shear_rate = inf", "shear_stress = 1.0");
    let text = complaint(&stress);
    assert!(
        text.contains("without a rate") && text.contains("shear_rate"),
        "{text}"
    );
    let few = suspension("viscous_number = 0.1").replace("spheres = 90", "spheres = 62");
    let text = complaint(&few);
    assert!(
        text.contains("may shrink") && text.contains("at least"),
        "{text}"
    );
}

#[test]
fn the_precision_of_a_fraction_is_requested_where_the_fraction_is_free() {
    let until = "seeds = { precision = 0.01, quantity = \"fraction\" }";
    let free = suspension("viscous_number = 0.1").replace("seeds = 4", until);
    let rule = parse_text(&free).unwrap().rules[0].precision;
    assert_eq!(rule.quantity.name(), "fraction");
    let shown = complaint(&suspension("").replace("seeds = 4", until));
    for part in ["every run has it exactly", "`viscous_number`"] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
}
