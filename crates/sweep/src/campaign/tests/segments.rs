//! Protocols of several segments.

use super::*;
use sd_core::model::{CrossShear, Segment};

/// The campaign at Γ = 0.1 with segments in place of the length of its runs.
fn with(segments: &str) -> Result<Campaign, CampaignError> {
    let one_rate = GOOD
        .replace("[0, 0.1, inf]", "0.1")
        .replace("seeds = 4", "seeds = 1");
    let (protocol, grid) = one_rate
        .split_once("strain = 1.0\ndiscard = 0.5\n")
        .unwrap();
    parse_text(&format!("{protocol}{segments}{grid}"))
}

/// The refused value, what is allowed, and the text at its place.
#[track_caller]
fn refused(segments: &str) -> String {
    match with(segments) {
        Ok(_) => panic!("{segments} is read"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn grids_need_no_rate_where_each_segment_names_its_own() {
    let read = |segments: &str, imposed: &str| {
        let grid = GOOD
            .replace("strain = 1.0\ndiscard = 0.5\n", segments)
            .replace("shear_rate = [0, 0.1, inf]", imposed);
        parse_text(&grid)
    };
    let keys = |campaign: Result<Campaign, CampaignError>| -> Vec<CaseKey> {
        let cases = campaign.unwrap().cases.into_iter();
        cases.map(|(key, _)| key).collect()
    };
    for (segments, imposed) in [
        (
            "[[protocol.segment]]\nstrain = 1.0\nshear_stress = 0.3\n",
            "shear_stress = 0.3",
        ),
        (
            "[[protocol.segment]]\nstrain = 1.0\nshear_rate = 2.0\n\
             [[protocol.segment]]\nstrain = 1.0\nshear_stress = 0.3\n",
            "shear_rate = 2.0",
        ),
    ] {
        assert_eq!(keys(read(segments, "")), keys(read(segments, imposed)));
    }
    let one_is_open = "[[protocol.segment]]\nstrain = 1.0\nshear_stress = 0.3\n\
                       [[protocol.segment]]\nstrain = 1.0\n";
    let error = read(one_is_open, "").unwrap_err().to_string();
    assert!(error.contains("has no `shear_rate`"), "{error}");
    // Only the error in the segment is reported.
    let wrong = "[[protocol.segment]]\nstrain = 0.0\nshear_stress = 0.3\n";
    let error = read(wrong, "").unwrap_err().to_string();
    assert!(error.contains("`strain` = 0.0 is out of range"), "{error}");
    assert!(!error.contains("shear_rate"), "{error}");
}

const SEGMENTS: &str = r"[[protocol.segment]]
strain = 3.0
[[protocol.segment]]
strain = 2.0
direction = -1
discard = 0.5
[[protocol.segment]]
oscillation = { amplitude = 0.5, cycles = 6 }
[[protocol.segment]]
strain = 1.0
shear_stress = 0.3
discard = 0.2
";

#[test]
fn segments_follow_each_other() {
    let campaign = with(SEGMENTS).unwrap();
    let protocol = &campaign.protocol;
    assert_eq!(protocol.strain, 18.0);
    assert_eq!(protocol.discard, 17.2);
    let kept: Vec<[f64; 3]> = protocol
        .segments
        .iter()
        .map(|segment| [segment.imposed.start, segment.kept_from(), segment.end()])
        .collect();
    assert_eq!(
        kept,
        [
            [0.0, 0.0, 3.0],
            [3.0, 3.5, 5.0],
            // The first of six cycles is left out.
            [5.0, 7.0, 17.0],
            [17.0, 17.2, 18.0]
        ]
    );
    let case = &campaign.cases.last().unwrap().1;
    assert_eq!(case.steps, 1800);
    let at = |start| Segment {
        start,
        ..Segment::default()
    };
    let imposed = [
        at(0.0),
        Segment {
            direction: Some(-1.0),
            ..at(3.0)
        },
        Segment {
            amplitude: Some(0.5),
            ..at(5.0)
        },
        Segment {
            shear_stress: Some(0.3),
            ..at(17.0)
        },
    ];
    assert_eq!(case.params.segments, imposed);
    assert_eq!(case.params.shear_rate, 0.1);
}

/// The campaign of a suspension with one segment.
fn of_a_suspension(segment: &str) -> Result<Campaign, CampaignError> {
    let one_rate = GOOD
        .replace("[0, 0.1, inf]", "0.1")
        .replace("seeds = 4", "seeds = 1")
        .replace("area_fraction = [0.693]", "volume_fraction = 0.4");
    let (protocol, grid) = one_rate
        .split_once("strain = 1.0\ndiscard = 0.5\n")
        .unwrap();
    let segment = format!("[[protocol.segment]]\n{segment}\n");
    parse_text(&format!("{protocol}{segment}{grid}"))
}

#[test]
fn cross_shear_is_read_and_is_part_of_the_key() {
    let crossed = |numbers: &str| {
        let segment = format!("strain = 1.0\ncross_shear = {{ {numbers} }}");
        of_a_suspension(&segment).unwrap()
    };
    let first = crossed("amplitude = 0.1, ratio = 10");
    let imposed = Segment {
        cross_shear: Some(CrossShear {
            amplitude: 0.1,
            ratio: 10.0,
        }),
        ..Segment::default()
    };
    assert_eq!(first.cases[0].1.params.segments, [imposed]);
    let key = |campaign: &Campaign| campaign.cases[0].0;
    let plain = of_a_suspension("strain = 1.0").unwrap();
    assert!(plain.cases[0].1.params.segments.is_empty());
    let others = [
        crossed("amplitude = 0.2, ratio = 10"),
        crossed("amplitude = 0.1, ratio = 5"),
        plain,
    ];
    for other in &others {
        assert_ne!(key(other), key(&first));
    }
    assert_eq!(key(&crossed("amplitude = 0.1, ratio = 10.0")), key(&first));
}

#[test]
fn a_cross_shear_that_cannot_be_is_refused_where_it_is_written() {
    let crossed = |text: &str| format!("strain = 1.0\ncross_shear = {text}");
    let error = refused(&format!(
        "[[protocol.segment]]\n{}\n",
        crossed("{ amplitude = 0.1, ratio = 10 }")
    ));
    assert!(
        error.contains(
            "5:15: `cross_shear` = { amplitude = 0.1, ratio = 10 } has no meaning: a layer has no vorticity direction"
        ),
        "{error}"
    );
    for (text, expected) in [
        (
            crossed("{ amplitude = 0.0, ratio = 10 }"),
            "5:29: `amplitude` = 0.0 is out of range",
        ),
        (
            crossed("{ amplitude = 0.1, ratio = inf }"),
            "5:42: `ratio` = inf is out of range",
        ),
        (
            crossed("{ amplitude = 0.1, ratio = -1 }"),
            "5:42: `ratio` = -1 is out of range",
        ),
        (
            crossed("{ amplitude = 0.1 }"),
            "cross_shear has no `ratio`",
        ),
        (
            crossed("{ amplitude = 0.1, ratio = 10, cycles = 2 }"),
            "unknown key `cycles`",
        ),
        (crossed("0.1"), "`cross_shear` cannot be of type"),
        (
            crossed("{ amplitude = 0.1, ratio = 60 }"),
            "5:42: `cross_shear.ratio` = 60 is not resolved by a time step of 0.01",
        ),
        (
            crossed("{ amplitude = 2.0, ratio = 20 }"),
            "5:29: `cross_shear.amplitude` = 2 is not resolved by a time step of 0.01",
        ),
        (
            "oscillation = { amplitude = 0.5, cycles = 2 }\ncross_shear = { amplitude = 0.1, ratio = 10 }"
                .to_owned(),
            "5:15: `cross_shear` = { amplitude = 0.1, ratio = 10 } is imposed across an oscillation",
        ),
    ] {
        let error = of_a_suspension(&text).unwrap_err().to_string();
        assert!(error.contains(expected), "{text}\n{error}");
    }
}

#[test]
fn one_segment_is_the_run_without_any() {
    let plain = with("strain = 1.0\ndiscard = 0.5\n").unwrap();
    let one = |more: &str| with(&format!("[[protocol.segment]]\nstrain = 1.0\n{more}\n")).unwrap();
    let keys = |campaign: &Campaign| campaign.cases.iter().map(|case| case.0).collect::<Vec<_>>();
    assert_eq!(keys(&one("")), keys(&plain));
    assert_eq!(keys(&one("shear_rate = 0.1")), keys(&plain));
    let backwards = one("direction = -1");
    assert_ne!(keys(&backwards), keys(&plain));
    assert_eq!(backwards.cases[0].1.params.direction, -1.0);
}

#[test]
fn the_key_of_a_run_knows_its_segments_but_not_the_length_of_the_last() {
    let key = |text: &str| with(text).unwrap().cases[0].0;
    assert_eq!(
        key(SEGMENTS),
        key(&SEGMENTS.replace("strain = 1.0", "strain = 9.0"))
    );
    assert_eq!(
        key(SEGMENTS),
        key(&SEGMENTS.replace("discard = 0.5", "discard = 0.1"))
    );
    for (from, to) in [
        ("strain = 2.0", "strain = 2.5"),
        ("direction = -1\n", ""),
        ("amplitude = 0.5", "amplitude = 0.4"),
        ("cycles = 6", "cycles = 7"),
        ("shear_stress = 0.3", "shear_rate = 0.3"),
    ] {
        assert_ne!(key(SEGMENTS), key(&SEGMENTS.replace(from, to)), "{to}");
    }
}

#[test]
fn friction_that_acts_in_one_segment_is_not_folded_away() {
    let text = "[[protocol.segment]]\nstrain = 1.0\nshear_rate = 0\n[[protocol.segment]]\nstrain = 1.0\nshear_rate = inf\n";
    let campaign = with(text).unwrap();
    let frictions: Vec<f64> = campaign
        .cases
        .iter()
        .map(|(_, c)| c.params.friction)
        .collect();
    assert_eq!(frictions, [0.0, 0.3]);
}

#[test]
fn protocols_that_cannot_be_are_refused_where_they_are_written() {
    let one = |text: &str| format!("[[protocol.segment]]\n{text}\n");
    let two =
        |text: &str| format!("[[protocol.segment]]\nstrain = 1.0\n[[protocol.segment]]\n{text}\n");
    for (text, expected) in [
        (
            two("strain = 1.0\nshear_rate = 1.0\nshear_stress = 0.3"),
            "8:16: `shear_rate` and `shear_stress` are both imposed in a segment",
        ),
        (
            one("oscillation = { amplitude = 0.5, cycles = 0 }"),
            "4:43: `cycles` = 0 is out of range",
        ),
        (
            one("oscillation = { amplitude = 0.5, cycles = 2, average_last = 3 }"),
            "4:61: `average_last` = 3 of 2 cycles",
        ),
        (
            one("oscillation = { cycles = 2 }"),
            "oscillation has no `amplitude`",
        ),
        (one("oscillation = 0.5"), "`oscillation` cannot be of type"),
        (
            one("strain = 1.0\ndiscard = 1.5"),
            "5:11: `discard` = 1.5 leaves nothing to average of a segment of strain 1",
        ),
        (
            one("direction = -1"),
            "[[protocol.segment]] has no `strain`",
        ),
        (one("strain = 1.0\ncycles = 2"), "unknown key `cycles`"),
        (
            one("strain = 1.005"),
            "4:10: `strain` = 1.005 is not a whole number of time steps",
        ),
        (
            one("oscillation = { amplitude = 0.505, cycles = 2 }"),
            "`amplitude` = 0.505 is not a whole number of time steps",
        ),
        (
            one("strain = 2.0\noscillation = { amplitude = 0.5, cycles = 2 }"),
            "`strain` has no meaning in an oscillation",
        ),
        (
            two("strain = 1.0\ndirection = 0.5"),
            "7:13: `direction` = 0.5",
        ),
        (
            two("strain = 1.0\nshear_rate = -1.0"),
            "7:14: `shear_rate` = -1.0 is out of range",
        ),
        (
            two("oscillation = { amplitude = 0.5, cycles = 2 }\nshear_stress = 0.3"),
            "`shear_stress` = 0.3 is imposed in an oscillation",
        ),
        ("segment = 3\n".to_owned(), "`segment` cannot be of type"),
        ("segment = []\n".to_owned(), "`segment` is empty"),
        (
            format!("strain = 2.0\n{}", one("strain = 1.0")),
            "3:10: `strain` of the whole run together with segments",
        ),
        (
            one("strain = 1.0\ndiscard = 0.99"),
            "`sample_every` = 0.02 may give a segment no sample",
        ),
    ] {
        let error = refused(&text);
        assert!(error.contains(expected), "{text}\n{error}");
    }
    let springs = |text: &str| {
        let text = two(text);
        let campaign = GOOD
            .replace("[0, 0.1, inf]", "0.1")
            .replace(
                "seeds = 4",
                "seeds = 1\ncontact = \"linear-spring\"\nstiffness = 1e3",
            )
            .replace("strain = 1.0\ndiscard = 0.5\n", &text);
        parse_text(&campaign).unwrap_err().to_string()
    };
    let error = springs("strain = 1.0\nshear_rate = inf");
    assert!(
        error.contains("7:14: `shear_rate` = inf has no meaning under laws"),
        "{error}"
    );
}

#[test]
fn stresses_and_rates_follow_each_other_in_any_order() {
    let imposed = ["shear_rate = 2.0", "shear_stress = 0.3", ""];
    for grid in &imposed[..2] {
        for first in imposed {
            for second in imposed {
                let text = format!(
                    "[[protocol.segment]]\nstrain = 1.0\n{first}\n\
                     [[protocol.segment]]\nstrain = 1.0\n{second}\n"
                );
                let text = GOOD
                    .replace("strain = 1.0\ndiscard = 0.5\n", &text)
                    .replace("shear_rate = [0, 0.1, inf]", grid);
                let params = &parse_text(&text).unwrap().cases[0].1.params;
                // Numbers without JSON would damage the store.
                let json = serde_json::to_string(params).unwrap();
                assert_eq!(
                    serde_json::from_str::<Params>(&json).unwrap(),
                    *params,
                    "{text}"
                );
                let last = [second, *grid].into_iter().find(|shear| !shear.is_empty());
                let wanted = match last {
                    Some("shear_rate = 2.0") => (2.0, None),
                    _ => (0.0, Some(0.3)),
                };
                let named = params.by_last_segment();
                assert_eq!((named.shear_rate, named.shear_stress), wanted, "{text}");
                assert_eq!(named.last_shear(), params.last_shear());
                let flows = |params: &Params| -> Vec<_> {
                    let flows = params.flows().into_iter();
                    flows.map(|of| (of.shear_rate, of.shear_stress)).collect()
                };
                assert_eq!(flows(&named), flows(params));
            }
        }
    }
    let oscillation = "[[protocol.segment]]\nstrain = 1.0\nshear_stress = 0.1\n\
                       [[protocol.segment]]\nshear_rate = 1.0\n\
                       oscillation = { amplitude = 0.1, cycles = 2 }\n";
    let text = GOOD
        .replace("strain = 1.0\ndiscard = 0.5\n", oscillation)
        .replace("shear_rate = [0, 0.1, inf]", "");
    let params = &parse_text(&text).unwrap().cases[0].1.params;
    let json = serde_json::to_string(params).unwrap();
    assert_eq!(serde_json::from_str::<Params>(&json).unwrap(), *params);
}
