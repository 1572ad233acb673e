//! Types of flow in a campaign file, in grids and in segments.

use super::{Campaign, CampaignError, GOOD, parse_text};
use sd_core::model::FlowType;

/// Suspensions in flows written so.
fn suspension(flow: &str) -> String {
    GOOD.replace("area_fraction = [0.693]", "volume_fraction = 0.45")
        .replace("[0.0, 0.3]", "0.3")
        .replace("[0, 0.1, inf]", "inf")
        .replace("spheres = 90", &format!("spheres = 140\nflow = {flow}"))
}

fn flows(campaign: &Campaign) -> Vec<FlowType> {
    let firsts = campaign.cases.iter().step_by(4);
    firsts.map(|(_, case)| case.params.flow).collect()
}

/// The line of the fault, the fault and what is allowed.
fn complaint(text: &str) -> String {
    match parse_text(text) {
        Err(CampaignError::Faulty(fault)) => format!("{fault}\n{}", fault.allowed()),
        other => panic!("{text}: {other:?}"),
    }
}

#[test]
fn an_axis_has_words_and_mixtures() {
    let all = r#"["shear", "planar-extension", "uniaxial", "biaxial", { shear = 2.0, extension = 1.0 }, "mixture 0.25"]"#;
    let campaign = parse_text(&suspension(all)).unwrap();
    assert_eq!(
        flows(&campaign),
        [
            FlowType::Shear,
            FlowType::PlanarExtension,
            FlowType::Uniaxial,
            FlowType::Biaxial,
            FlowType::Mixture(0.5),
            FlowType::Mixture(0.25),
        ]
    );
    // Shear written or not is the same case, and so is a mixture without extension.
    let plain = parse_text(&suspension("\"shear\"").replace("flow = \"shear\"", "")).unwrap();
    let written = parse_text(&suspension("{ shear = 1.0 }")).unwrap();
    let keys = |campaign: &Campaign| {
        campaign
            .cases
            .iter()
            .map(|(key, _)| *key)
            .collect::<Vec<_>>()
    };
    assert_eq!(keys(&plain), keys(&written));
    let label = parse_text(&suspension("\"uniaxial\"")).unwrap().cases[0]
        .1
        .label();
    assert!(label.contains(" uniaxial "), "{label}");
}

#[test]
fn segments_may_have_flows() {
    let segments = "[[protocol.segment]]\nstrain = 0.5\n[[protocol.segment]]\nstrain = 0.5\nflow = \"planar-extension\"\n";
    let text = suspension("\"shear\"").replace("strain = 1.0\ndiscard = 0.5\n", segments);
    let campaign = parse_text(&text).unwrap();
    let segments = &campaign.cases[0].1.params.segments;
    assert_eq!(segments[1].flow, Some(FlowType::PlanarExtension));
    let cross = text.replace(
        "flow = \"planar-extension\"\n",
        "flow = \"planar-extension\"\ncross_shear = { amplitude = 0.05, ratio = 20 }\n",
    );
    let complaint = complaint(&cross);
    assert!(
        complaint.contains("is imposed across a flow that is no shear"),
        "{complaint}"
    );
}

#[test]
fn bad_flows_are_refused_with_a_remedy() {
    for (flow, fault, remedy) in [
        ("\"extension\"", "is not known", "planar-extension"),
        (
            "{ shear = 0.0, extension = 0.0 }",
            "neither shear nor extension",
            "one is above 0",
        ),
        ("{ }", "neither shear nor extension", "one is above 0"),
        (
            "{ shear = 1.0, extension = -0.5 }",
            "negative",
            "`direction` = -1",
        ),
        ("{ shear = 1.0, strain = 0.5 }", "`strain`", "extension"),
        ("1.0", "`flow`", "planar-extension"),
    ] {
        let text = complaint(&suspension(flow));
        assert!(
            text.contains(fault) && text.contains(remedy),
            "{flow}: {text}"
        );
    }
    let flat = GOOD.replace("spheres = 90", "spheres = 90\nflow = \"biaxial\"");
    let text = complaint(&flat);
    assert!(
        text.contains("a layer lies in a plane") && text.contains("volume_fraction"),
        "{text}"
    );
    // Shear has room for these spheres, and uniaxial extension has not.
    let few = |flow: &str| parse_text(&suspension(flow).replace("spheres = 140", "spheres = 64"));
    few("\"shear\"").unwrap();
    let error = few("\"uniaxial\"").unwrap_err().to_string();
    assert!(error.contains("shortest vector"), "{error}");
    // A square cell does not last in a long shear of a stretched suspension.
    let segments = "[[protocol.segment]]\nstrain = 5.0\nflow = \"uniaxial\"\n[[protocol.segment]]\nstrain = 3.0\n\
                    [[protocol.segment]]\nstrain = 1.0\nflow = \"biaxial\"\n";
    let text = suspension("\"shear\"").replace("strain = 1.0\ndiscard = 0.5\n", segments);
    let error = parse_text(&text).unwrap_err().to_string();
    assert!(error.contains("at times in this `flow`"), "{error}");
}
