mod flows;
mod hostile;
mod pressure;
mod segments;
mod sizes;
mod start;
mod suspensions;
mod time_unit;

use super::*;
use crate::model::axes::Axis;
use std::fmt::Write as _;

const GOOD: &str = r#"name = "friction"
[protocol]
strain = 1.0
discard = 0.5
[[grid]]
area_fraction = [0.693]
friction = [0.0, 0.3]
roughness = 0.01
shear_rate = [0, 0.1, inf]
seeds = 4
spheres = 90
hydrodynamics = "ball-melrose"
"#;

fn parse_text(text: &str) -> Result<Campaign, CampaignError> {
    crate::campaign::parse("friction.toml", text.into())
}

#[test]
fn product_of_the_axes_in_the_order_of_the_file() {
    // With friction only: without it all rates are the same case.
    let campaign = parse_text(&GOOD.replace("[0.0, 0.3]", "[0.2, 0.3]")).unwrap();
    assert_eq!(campaign.name, "friction");
    // Two frictions at two rates, and one case for both at the rate 0.
    assert_eq!(campaign.cases.len(), (2 * 2 + 1) * 4);
    let seeds: Vec<u64> = campaign.cases[..5].iter().map(|(_, c)| c.seed).collect();
    assert_eq!(seeds, [1, 2, 3, 4, 1]);
    let rates: Vec<f64> = campaign.cases[..12]
        .iter()
        .step_by(4)
        .map(|(_, case)| case.params.shear_rate)
        .collect();
    assert_eq!(rates, [0.0, 0.1, f64::INFINITY]);
    assert_eq!(campaign.cases[0].1.steps, 100);
    assert_eq!(campaign.cases[0].1.sample_stride, 2);
    assert_eq!(
        campaign.cases[0].1.params.contact,
        sd_core::ContactScheme::Rigid
    );
}

#[test]
fn values_without_meaning_under_a_law_make_no_cases_of_their_own() {
    let laws = |text: &str| {
        let text = GOOD
            .replace("[0, 0.1, inf]", "0.1")
            .replace("seeds = 4", &format!("seeds = [1]\n{text}"));
        let campaign = parse_text(&text).unwrap();
        let all: Vec<_> = campaign.cases.iter().map(|(_, c)| &c.params).collect();
        all.iter()
            .map(|p| {
                let laws = p.contact.laws();
                assert!(p.validate().is_ok());
                let word = |key| Axis::of_key(key).unwrap().value(p);
                let (words, friction) = (word("contact"), word("tangential"));
                format!("{words} {friction} {} {}", laws.stiffness, p.friction)
            })
            .collect::<Vec<_>>()
            .join(", ")
    };
    let plain = "rigid roll-slip inf 0, rigid roll-slip inf 0.3";
    assert_eq!(laws(""), plain);
    // The defaults written out: the same cases with the same keys.
    let written = "contact = \"rigid\"\ntangential = \"roll-slip\"\nfriction_onset = \"critical-load\"\nrepulsion = 0";
    assert_eq!(laws(written), plain);
    let key = |text: &str| {
        let text = GOOD.replace("seeds = 4", &format!("seeds = 4\n{text}"));
        parse_text(&text).unwrap().cases[0].0
    };
    assert_eq!(key(written), key(""));
    assert_eq!(
        laws(
            "contact = [\"rigid\", \"linear-spring\"]\nstiffness = [1e3, inf]\ntangential = [\"stick-slide\", \"none\"]"
        ),
        "rigid roll-slip inf 0, rigid coulomb inf 0.3, linear-spring roll-slip 1000 0, linear-spring stick-slide 1000 0.3"
    );
    // A stiffness of their own makes tangential springs of rigid contacts a law.
    let springs = "contact = \"rigid\"\ntangential = [\"stick-slide\", \"coulomb\"]\ntangential_stiffness = [1e4, 1e5]";
    assert_eq!(
        laws(springs),
        "rigid roll-slip inf 0, rigid stick-slide inf 0.3, rigid stick-slide inf 0.3, rigid coulomb inf 0.3"
    );
    // Rolling friction with laws that leave pairs free to roll, and with friction.
    let rolling = GOOD.replace(
        "seeds = 4",
        "seeds = [1]\ntangential = [\"roll-slip\", \"coulomb\"]\nrolling_friction = [0.0, 0.1]",
    );
    let cases = parse_text(&rolling).unwrap().cases;
    // At the rates 0.1 and inf: rolling pairs, and slipping ones with and without rolling friction.
    // Without friction and at the rate 0, where no load is above the critical one, no law of
    // friction makes a case of its own, nor does a rate.
    assert_eq!(cases.len(), 2 * 3 + 1);
    let rolls = |case: &Case| case.params.contact.laws().rolling_friction > 0.0;
    assert_eq!(cases.iter().filter(|(_, case)| rolls(case)).count(), 2);
    let sizes = GOOD.replace(
        "seeds = 4",
        "seeds = [1]\nsize_ratio = [1, 2]\nlarge_fraction = [0.2, 0.5]",
    );
    assert_eq!(parse_text(&sizes).unwrap().cases.len(), 3 * 3);
    assert_eq!(
        laws("contact = \"exponential-repulsion\"\ntangential = [\"coulomb\", \"stick-rotate\"]"),
        "exponential-repulsion roll-slip inf 0"
    );
}

#[test]
fn same_case_in_two_files_has_the_same_key() {
    let other = GOOD
        .replace("\"friction\"", "\"other\"")
        .replace("seeds = 4", "seeds = [4, 2]")
        .replace("[0.0, 0.3]", "3e-1");
    let (one, two) = (parse_text(GOOD).unwrap(), parse_text(&other).unwrap());
    let key = |campaign: &Campaign| {
        let found = campaign.cases.iter().find(|(_, case)| {
            let p = &case.params;
            (
                p.friction > 0.2,
                p.shear_rate > 0.0,
                p.shear_rate < 1.0,
                case.seed,
            ) == (true, true, true, 2)
        });
        found.unwrap().0
    };
    assert_eq!(key(&one), key(&two));
}

#[test]
fn points_that_share_their_runs_stand_where_the_file_has_them() {
    let text = "name = \"n\"\n[[grid]]\narea_fraction = 0.5\nfriction = [0, 0.3]\nroughness = 0.01\n\
                shear_rate = [0, 1.0, inf]\nspheres = 20\nseeds = 2\n";
    let shared = |text: String| {
        let campaign = crate::campaign::parse("n.toml", text).unwrap();
        let shared = campaign.written.shared.iter();
        let shared: Vec<_> = shared
            .map(|(follows, point)| (*follows, point.friction, point.shear_rate))
            .collect();
        (campaign.cases.len(), campaign.folded, shared)
    };
    let inf = f64::INFINITY;
    // Without friction one case for three rates, and with it at the rate 0 the same.
    let all = vec![(0, 0.0, 0.0), (2, 0.0, 1.0), (2, 0.0, inf), (2, 0.3, 0.0)];
    assert_eq!(shared(text.into()), (3 * 2, 3 * 2, all));
    let (_, _, last) = shared(
        text.replace("[0, 0.3]", "0")
            .replace("[0, 1.0, inf]", "[1.0, 0]"),
    );
    assert_eq!(last, [(0, 0.0, 1.0), (2, 0.0, 0.0)]);
    let plain = text.replace("[0, 0.3]", "0.3").replace("[0, 1.0", "[1.0");
    assert!(shared(plain).2.is_empty());
    // As many in any order of the values.
    let (cases, folded, _) = shared(text.replace("[0, 1.0, inf]", "[inf, 1.0, 0]"));
    assert_eq!((cases, folded), (3 * 2, 3 * 2));
    // Which grid has the point as it stands in the file does not depend on the order either.
    let again =
        "[[grid]]\narea_fraction = 0.5\nfriction = 0\nroughness = 0.01\nspheres = 20\nseeds = 2\n";
    for rates in ["[0, 1.0]", "[1.0, 0]"] {
        let twice = format!("{text}{again}shear_rate = {rates}\n");
        let error = crate::campaign::parse("n.toml", twice).unwrap_err();
        assert!(
            error.to_string().contains("is in two grids"),
            "{rates}: {error}"
        );
    }
}

#[test]
fn seeds_in_several_grids_are_one_campaign() {
    let text = format!(
        "{GOOD}{}",
        GOOD[GOOD.find("[[grid]]").unwrap()..].replace("seeds = 4", "seeds = [9]")
    );
    assert_eq!(parse_text(&text).unwrap().cases.len(), 3 * 5);
}

/// The error about a changed file, as shown to a user.
fn complaint(from: &str, to: &str) -> String {
    assert!(GOOD.contains(from), "{from}");
    let error = parse_text(&GOOD.replacen(from, to, 1)).unwrap_err();
    let mut text = String::new();
    miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor())
        .with_width(100)
        .render_report(&mut text, &error)
        .unwrap();
    text
}

#[test]
fn every_error_shows_the_place_and_says_what_is_allowed() {
    let mut all = String::new();
    for (from, to) in [
        ("name = \"friction\"", "name = \"Friction/../x\""),
        ("name = \"friction\"\n", ""),
        ("name = \"friction\"", "nam = \"friction\""),
        ("friction = [0.0, 0.3]", "frictoin = [0.0, 0.3]"),
        ("friction = [0.0, 0.3]", "friction = []"),
        ("friction = [0.0, 0.3]", "friction = [0.0, -0.3]"),
        ("friction = [0.0, 0.3]", "friction = [0.0, nan]"),
        ("friction = [0.0, 0.3]", "friction = [0.3, 0.30]"),
        ("friction = [0.0, 0.3]", "friction = \"0.3\""),
        ("friction = [0.0, 0.3]\n", ""),
        ("[0, 0.1, inf]", "[0, 0.1, \"inf\"]"),
        ("[0, 0.1, inf]", "[0, 1e999]"),
        ("[0.693]", "[0.5, 0.85]"),
        ("roughness = 0.01", "roughness = 0.5"),
        ("spheres = 90", "spheres = [90, 12]"),
        ("spheres = 90", "spheres = 90.5"),
        ("spheres = 90", "spheres = 1000000000000000000000"),
        ("seeds = 4", "seeds = 0"),
        ("seeds = 4", "seeds = [1, -1]"),
        ("seeds = 4", "seeds = 900000"),
        ("\"ball-melrose\"", "\"ball-melroze\""),
        ("discard = 0.5", "discard = 1"),
        ("strain = 1.0", "strain = 0.3"),
        ("strain = 1.0", "strain = 1e9"),
        ("discard = 0.5", "sample_every = 0.012"),
        ("discard = 0.5", "time_step = 0.2"),
        ("seeds = 4", "contact = \"soft\"\nseeds = 4"),
        ("seeds = 4", "contact = \"hertz\"\nseeds = 4"),
        (
            "seeds = 4",
            "contact = \"linear-spring\"\nstiffness = [1e4, 0]\nseeds = 4",
        ),
        (
            "seeds = 4",
            "contact = \"linear-spring\"\nstiffness = 1e4\nseeds = 4",
        ),
        ("seeds = 4", "stiffness = 1e4\nseeds = 4"),
        ("seeds = 4", "tangential = \"sticky\"\nseeds = 4"),
        (
            "seeds = 4",
            "contact = [\"rigid\", \"procedure\"]\ntangential = \"coulomb\"\nseeds = 4",
        ),
        (
            "shear_rate = [0, 0.1, inf]",
            "shear_rate = 1\ncontact = \"linear-spring\"\nstiffness = 1e4\nlubrication_gap = 0.02",
        ),
        (
            "shear_rate = [0, 0.1, inf]",
            "shear_rate = 1\ncontact = \"exponential-repulsion\"\nrepulsion = 0",
        ),
        ("seeds = 4", "rolling_friction = 0.1\nseeds = 4"),
        (
            "seeds = 4",
            "tangential = \"coulomb\"\nrolling_friction = [0, 11]\nseeds = 4",
        ),
        (
            "seeds = 4",
            "contact = [\"rigid\", \"procedure\"]\ntangential = \"none\"\nadhesion = 1\nseeds = 4",
        ),
        ("seeds = 4", "adhesion = [0, 1]\nseeds = 4"),
        (
            "shear_rate = [0, 0.1, inf]",
            "shear_rate = 1\ncontact = \"exponential-repulsion\"\nadhesion = 1",
        ),
        ("roughness = 0.01", "roughness = 0"),
        (
            "shear_rate = [0, 0.1, inf]",
            "shear_rate = [0, 1]\ncontact = \"linear-spring\"\nstiffness = 1e4\nstiffness_unit = \"flow\"\nrepulsion = 1",
        ),
        ("seeds = 4", "stiffness_unit = \"flow\"\nseeds = 4"),
        ("seeds = 4", "lubrication_cutoff = 0.5\nseeds = 4"),
        (
            "hydrodynamics = \"ball-melrose\"",
            "hydrodynamics = \"lubrication\"\nlubrication_cutoff = 20",
        ),
        (
            "hydrodynamics = \"ball-melrose\"",
            "hydrodynamics = \"lubrication\"\nlubrication_cutoff = 1\nlubrication_regularisation = 0.01",
        ),
        (
            "hydrodynamics = \"ball-melrose\"",
            "hydrodynamics = \"lubrication\"\nlubrication_regularisation = [0.001, 0]",
        ),
        (
            "hydrodynamics = \"ball-melrose\"",
            "hydrodynamics = \"lubrication\"\ncontact = \"linear-spring\"\nstiffness = 1e4\nstiffness_unit = \"flow\"\nlubrication_gap = 0.001",
        ),
        ("seeds = 4", "seeds = 4\nseeds = 5"),
        ("[[grid]]", "[[grid"),
        (
            "[[grid]]",
            "[[grid]]\narea_fraction = 0.693\nfriction = 0.3\nroughness = 0.01\nshear_rate = inf\nseeds = [3]\nspheres = 90\nhydrodynamics = \"ball-melrose\"\n[[grid]]",
        ),
    ] {
        writeln!(all, "{from:?} → {to:?}\n{}", complaint(from, to)).unwrap();
    }
    insta::assert_snapshot!(all);
}

#[test]
fn stiffness_and_friction_of_rigid_contacts_have_messages_at_their_lines() {
    for (to, line, said) in [
        (
            "tangential = \"stick-slide\"\ntangential_stiffness = [0, 1e4]",
            "friction.toml:11:25: `tangential_stiffness` = 0",
            "none is `friction` = 0",
        ),
        (
            "tangential = \"stick-slide\"\ntangential_stiffness = inf",
            "friction.toml:11:24: `tangential_stiffness` = inf",
            "`tangential` = \"coulomb\" on rigid contacts",
        ),
        (
            "contact = [\"rigid\", \"linear-spring\"]\nstiffness = 1e4\nstiffness_unit = \"flow\"\ntangential = \"stick-slide\"\ntangential_stiffness = 0.5",
            "friction.toml:14:24: `tangential_stiffness` has two units",
            "a grid for springs and one for rigid contacts",
        ),
        (
            "contact = \"procedure\"\nhydrodynamic_friction = 0.1",
            "friction.toml:11:25: `hydrodynamic_friction` has no meaning",
            "another `contact` than \"procedure\"",
        ),
        (
            "van_der_waals = 2\ncolloid_unit = \"thermal\"",
            "friction.toml:11:16: `colloid_unit` = \"thermal\" is kT/a, and there is no Brownian",
            "a `peclet` or `thermal_load`",
        ),
        (
            "colloid_unit = \"thermal\"",
            "friction.toml:10:16: `colloid_unit` has no meaning",
            "or `van_der_waals` above 0",
        ),
    ] {
        let found = complaint("seeds = 4", &format!("{to}\nseeds = 4"));
        assert!(found.contains(line) && found.contains(said), "{found}");
    }
}

#[test]
fn names_that_are_used_elsewhere_lead_to_those_of_the_file() {
    for (from, to, said) in [
        (
            "friction = [0.0, 0.3]",
            "mu = 0.3",
            "did you mean `friction`?",
        ),
        (
            "area_fraction = [0.693]",
            "phi = 0.6",
            "did you mean `volume_fraction`?",
        ),
        (
            "shear_rate = [0, 0.1, inf]",
            "gamma = 1",
            "did you mean `shear_rate`?",
        ),
        (
            "roughness = 0.01",
            "roughness = 0,01",
            "a decimal fraction has a point: `0.01`",
        ),
        (
            "shear_rate = [0, 0.1, inf]",
            "shear_rate = [1, infinity]",
            "write `inf`",
        ),
        ("spheres = 90", "n = 90", "did you mean `spheres`?"),
        (
            "spheres = 90",
            "spheres = 90\ndt = 0.01",
            "did you mean `time_step`?",
        ),
        (
            "spheres = 90",
            "spheres = 90\ndimension = 3",
            "a layer is chosen by its `area_fraction`",
        ),
        (
            "spheres = 90",
            "spheres = 90\ntemperature = 1",
            "Brownian motion has a `peclet` or a `thermal_load`",
        ),
        (
            "spheres = 90",
            "spheres = 90\npeclet = 0",
            "`time_unit = \"diffusion\"` in [protocol]",
        ),
        (
            "[protocol]",
            "[protocol]\ntime_unit = \"diffusion\"",
            "the same finite `peclet` in every grid",
        ),
        (
            "[protocol]",
            "[protocol]\nfriction = 0.2",
            "write it below a line [[grid]]",
        ),
        (
            "spheres = 90",
            "spheres = 90\nlognormal = 0.2",
            "as in sizes = { lognormal = 0.2 }",
        ),
        (
            "shear_rate = [0, 0.1, inf]",
            "stress = 1",
            "did you mean `shear_stress`?",
        ),
        (
            "\"ball-melrose\"",
            "\"ball-melrose\"\ncontact = \"spring\"",
            "did you mean \"linear-spring\"?",
        ),
        (
            "[[grid]]",
            "[protocol]\n[[grid]]",
            "tables that may be repeated have two brackets",
        ),
        (
            "\"ball-melrose\"",
            "\"Ball-Melrose\"",
            "did you mean \"ball-melrose\"?",
        ),
        (
            "\"ball-melrose\"",
            "ball-melrose",
            "words need quotes: `\"ball-melrose\"`",
        ),
    ] {
        let error = complaint(from, to);
        let error = error.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(error.contains(said), "{to}: {error}");
    }
}

#[test]
fn lubrication_and_units_of_stiffness_are_read_and_equal_physics_is_one_case() {
    let grid = "hydrodynamics = [\"ball-melrose\", \"lubrication\"]\nlubrication_cutoff = [0.3, 0.5]\n\
                contact = [\"rigid\", \"linear-spring\"]\nstiffness = 1e4\nstiffness_unit = \"flow\"\ntangential = \"coulomb\"";
    let text = GOOD
        .replace("hydrodynamics = \"ball-melrose\"", grid)
        .replace("seeds = 4", "seeds = 1")
        .replace("friction = [0.0, 0.3]", "friction = 0.3")
        .replace("[0, 0.1, inf]", "[0.1, inf]");
    let campaign = parse_text(&text).unwrap();
    // Of two shear rates: Ball-Melrose rigid and soft, lubrication with two cutoffs, each rigid and
    // soft.
    assert_eq!(campaign.cases.len(), 2 * (2 + 4));
    for (_, case) in &campaign.cases {
        let p = &case.params;
        let lubrication = p.hydrodynamics.leading_order();
        assert!(lubrication.is_none_or(|n| n.regularisation == 1e-3));
        let soft = p.contact.laws().normal.is_spring();
        let gap = if soft && lubrication.is_none() {
            0.1 * p.roughness
        } else {
            0.0
        };
        assert_eq!(p.contact.laws().lubrication_gap, gap);
        let text = serde_json::to_string(p).unwrap();
        assert_eq!(text.contains("flow"), soft, "{text}");
        assert_eq!(serde_json::from_str::<sd_core::Params>(&text).unwrap(), *p);
    }
}

#[test]
fn a_grid_may_have_its_own_time_steps() {
    let text = |steps: &str| {
        format!(
            "name = \"steps\"\n[[grid]]\narea_fraction = 0.6\nfriction = 0.3\nroughness = 0.01\nshear_rate = 1\nseeds = 1\n\
             spheres = 90\ntime_step = {steps}\n"
        )
    };
    let campaign = crate::campaign::parse("steps.toml", text("[0.02, 0.01]")).unwrap();
    let seen: Vec<(f64, u64, u64)> = campaign
        .cases
        .iter()
        .map(|(_, case)| (case.params.time_step, case.steps, case.sample_stride))
        .collect();
    assert_eq!(seen, [(0.02, 250, 1), (0.01, 500, 2)]);
    // The strain between samples, 0.02, is no whole number of steps of 0.008.
    let error = crate::campaign::parse("steps.toml", text("0.008")).unwrap_err();
    assert!(error.to_string().contains("sample_every"), "{error}");
}

#[test]
fn all_faults_of_a_file_are_shown_together() {
    let text = GOOD
        .replace("strain = 1.0", "strain = \"long\"")
        .replace("friction = [0.0, 0.3]", "friction = [0.0, -1, 11]")
        .replace("seeds = 4\n", "")
        .replace("roughness", "rougness")
        + "[[grid]]\narea_fraction = 0.693\nfriction = 0.3\nroughness = 0.01\nshear_rate = 0\ncontact = \"hertz\"\nstiffness = 1e4\n\
           spheres = 12\nseeds = 1\n[[grid]]\nfriction = 0.3\nseeds = 1\nspheres = 90\n";
    let error = parse_text(&text).unwrap_err();
    let mut shown = String::new();
    miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor())
        .with_width(200)
        .render_report(&mut shown, &error)
        .unwrap();
    let faults = [
        "friction.toml:3:10: `strain` cannot be of type string",
        "`friction` = -1 is out of range",
        "`friction` = 11 is out of range",
        "[[grid]] has no `seeds`",
        "unknown key `rougness` in [[grid]]",
        "`shear_rate` = 0 has no meaning under laws in units of F_crit",
        "[[grid]] has no `area_fraction`",
        "[[grid]] has no `roughness`",
        "[[grid]] has no `shear_rate`",
    ];
    for fault in faults {
        assert!(shown.contains(fault), "{fault}\n{shown}");
    }
    // A misspelt key is not reported as missing as well.
    assert_eq!(shown.matches("has no `roughness`").count(), 1, "{shown}");
    assert_eq!(shown.matches("  × ").count(), faults.len(), "{shown}");
}

/// The table "What works together" of the documentation.
#[test]
fn flows_controls_and_thermal_motion_work_together_or_say_why_not() {
    const NO_PRESSURE: &str = "whose own pressure it leaves out";
    const NO_STRESS: &str = "of shear, whose cell can follow any strain";
    // What is imposed, and why not on Brownian spheres in shear and in extension.
    let controls = [
        ("shear_rate = 1.0", [None, None]),
        ("shear_stress = 1.0", [None, Some(NO_STRESS)]),
        (
            "shear_rate = 1.0\nviscous_number = 0.05",
            [Some(NO_PRESSURE); 2],
        ),
    ];
    let contacts = [
        "contact = \"rigid\"\ntangential = \"coulomb\"",
        "contact = \"linear-spring\"\nstiffness = 1e4\ntangential = \"stick-slide\"",
    ];
    let check = |grid: String, reason: Option<&str>| {
        let text = format!(
            "name = \"corner\"\n[protocol]\ntime_step = 0.001\nstrain = 1.0\ndiscard = 0.5\n[[grid]]\n\
             hydrodynamics = \"ball-melrose\"\nfriction = 0.5\nroughness = 0.02\nspheres = 200\n\
             seeds = 1\n{grid}\n"
        );
        match (parse_text(&text), reason) {
            (Ok(_), None) => {}
            (Err(error), Some(reason)) => {
                assert!(format!("{error:?}").contains(reason), "{text}\n{error:?}");
            }
            (found, _) => panic!("{text}\n{found:?}"),
        }
    };
    for space in ["area_fraction = 0.6", "volume_fraction = 0.4"] {
        for contact in contacts {
            for (control, reasons) in controls {
                for (flow, reason) in ["shear", "planar-extension"].into_iter().zip(reasons) {
                    let grid = format!("{space}\n{contact}\n{control}\nflow = \"{flow}\"");
                    check(grid.clone(), None);
                    check(format!("{grid}\nthermal_load = 10"), reason);
                }
            }
        }
    }
}

#[test]
fn keys_of_grids_outside_of_them_are_sent_there() {
    let shown = complaint("[protocol]", "contact = \"rigid\"\n[protocol]");
    for part in [
        "unknown key `contact` in the campaign",
        "write it below a line [[grid]]",
    ] {
        assert!(shown.contains(part), "{part}\n{shown}");
    }
}

/// A grid at imposed stress.
fn imposed(more: &str) -> String {
    GOOD.replace(
        "shear_rate = [0, 0.1, inf]",
        &format!("shear_stress = [0.5, 2.0]\n{more}"),
    )
}

/// A campaign of a file in that folder, or the error as it is shown.
fn shown_or(folder: &Path, text: &str) -> Result<Campaign, String> {
    let file = folder.join("x.toml").display().to_string();
    crate::campaign::parse(&file, text.into()).map_err(|error| {
        let mut shown = String::new();
        miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor())
            .render_report(&mut shown, &error)
            .unwrap();
        shown
    })
}

/// The error of a campaign says so, and shows the line.
fn assert_fault(folder: &Path, text: &str, line: u32, part: &str) {
    let error = shown_or(folder, text).unwrap_err();
    assert!(error.contains(part), "{part}: {error}");
    let shown = error
        .lines()
        .any(|shown| shown.trim_start().starts_with(&format!("{line} │")));
    assert!(shown, "line {line}: {error}");
    // Neither the given key nor the one it replaces is reported as missing.
    assert!(!error.contains("[[grid]] has no"), "{error}");
}

#[test]
fn stress_is_imposed_in_place_of_the_rate() {
    let campaign = parse_text(&imposed("")).unwrap();
    assert_eq!(campaign.cases.len(), 2 * 2 * 4);
    let (_, case) = &campaign.cases[4];
    assert_eq!(case.params.shear_stress, Some(2.0));
    let text = serde_json::to_string(&case.params).unwrap();
    assert!(text.contains("\"shear_stress\":2.0"), "{text}");
    let backwards = parse_text(&imposed("direction = -1")).unwrap();
    assert_ne!(backwards.cases[0].0, campaign.cases[0].0);
    assert_eq!(backwards.cases[0].1.params.direction, -1.0);
}

#[test]
fn faults_of_imposed_stress_have_their_line() {
    let both = "`shear_rate` and `shear_stress` are both imposed";
    for (text, line, part) in [
        (imposed("shear_rate = 1"), 10, both),
        // The second of the two places.
        (imposed("shear_rate = 1"), 9, "and here"),
        (
            imposed("").replace("0.5, 2.0", "0, 2.0"),
            9,
            "`shear_stress` = 0 is out of range",
        ),
        (imposed("direction = 0.5"), 10, "is no sense of the flow"),
    ] {
        assert_fault(Path::new("."), &text, line, part);
    }
}

#[test]
fn a_list_that_is_not_closed_is_named_where_it_begins() {
    let text = GOOD.replace("friction = [0.0, 0.3]", "friction = [0, 0.5 # [two");
    let error = parse_text(&text).unwrap_err();
    let CampaignError::Faulty(fault) = &error else {
        panic!("{error}");
    };
    assert_eq!(fault.allowed(), "close the list with `]`");
    let shown = crate::ErrorRenderer::default().explain(&error.into());
    for part in ["this list is not closed", "friction.toml:7:12"] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    // A closed list before a wrong word, and brackets in strings, are not blamed.
    for (from, to) in [
        ("roughness = 0.01", "roughness = small"),
        ("name = \"friction\"", "name = \"[\"\nx = small"),
    ] {
        let error = parse_text(&GOOD.replace(from, to)).unwrap_err();
        let CampaignError::Faulty(fault) = &error else {
            panic!("{error}");
        };
        assert!(
            fault.allowed().contains("words need quotes"),
            "{}",
            fault.allowed()
        );
    }
}
