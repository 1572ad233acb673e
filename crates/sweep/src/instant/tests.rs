mod suspensions;

use super::*;
use crate::model::replay::replay;
use crate::model::spaces::AnySnapshot;
use proptest::prelude::*;
use sd_core::modes::Vec2;
use sd_core::{Params, Simulation, VelocityGradient};

fn message(text: &str) -> String {
    read_in::<Layer>(text.as_bytes()).unwrap_err().to_string()
}

#[test]
fn example_of_the_interface_is_read() {
    let text = r#"{"centres": [[0.0, 0.0], [2.1, 0.0]], "radii": [1.0, 1.0], "cell": [12.5, 12.5],
        "offset": 3.1, "hydrodynamics": "stokesian-dynamics",
        "background": {"rate_of_strain": {"xx": 0, "yy": 0, "xy": 0.5}, "angular_velocity": -0.5},
        "forces": [[0, 0], [0, 0]], "torques": [0, 0], "contact": {"scheme": "none"}}"#;
    let (configuration, _) = read_in::<Layer>(text.as_bytes()).unwrap();
    assert_eq!(configuration.centres[1], Vec2::new(2.1, 0.0));
    assert_eq!(
        configuration.background,
        VelocityGradient::simple_shear(1.0).into()
    );
}

#[test]
fn lattices_are_read_and_bad_ones_refused() {
    let of = |more: &str| {
        format!(r#"{{"centres": [[0, 0, 0], [4, 0, 0]], "hydrodynamics": "ball-melrose", {more}}}"#)
    };
    let read = |more: &str| read_in::<Bulk>(of(more).as_bytes());
    let given = r#""lattice": [[9, 0, 0], [0, 9, 0], [1, 2, 9]]"#;
    let (configuration, _) = read(given).unwrap();
    assert!((configuration.cell.content().unwrap() - 729.0).abs() < 1e-9);
    for (more, said) in [
        (r#""lattice": [[9, 0, 0], [0, 9, 0]]"#, "has 2 vectors"),
        (
            r#""lattice": [[9, 0, 0], [0, 9, 0], [9, 9, 0]]"#,
            "lattice = [[9.0, 0.0, 0.0], [0.0, 9.0, 0.0], [9.0, 9.0, 0.0]] has dependent vectors",
        ),
        (
            r#""lattice": [[0, 9, 0], [9, 0, 0], [0, 0, 9]]"#,
            "is left-handed, with volume -729",
        ),
        (
            r#""cell": [9, 9, 9], "lattice": [[9, 0, 0], [0, 9, 0], [0, 0, 9]]"#,
            "cell: has no meaning beside `lattice`",
        ),
        (
            r#""background": {"rate_of_strain": {"xx": 0.5, "yy": -0.25, "zz": 0.125, "xy": 0}, "angular_velocity": [0, 0, 0]}"#,
            "background.rate_of_strain: its trace xx + yy + zz is 0.375, must be 0",
        ),
    ] {
        let error = read(more).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    let (configuration, contact) =
        read(r#""lattice": [[8, 0, 0], [7.5, 1, 0], [0, 0, 8]]"#).unwrap();
    let error = solve(&configuration, &contact, &NearFields::default()).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("shortest vector of the `lattice` is 1.1180, less than 8.0000"),
        "{error}"
    );
}

#[test]
fn forces_that_are_not_finite_or_move_a_layer_without_end_are_refused() {
    let solve_under = |forces: &str, hydrodynamics: &str| {
        let text = format!(
            r#"{{"centres": [[0.0, 0.0], [2.1, 0.0]], "cell": [12.5, 12.5], "forces": {forces},
            "hydrodynamics": "{hydrodynamics}"}}"#
        );
        let (configuration, contact) = read_in::<Layer>(text.as_bytes())?;
        Ok::<_, InputError>(solve(&configuration, &contact, &NearFields::default())?)
    };
    for (forces, hydrodynamics, said) in [
        (
            "[[1e400, 0], [0, 0]]",
            "ball-melrose",
            "1:77: number out of range",
        ),
        (
            "[[1, 2], [1, -2]]",
            "stokesian-dynamics",
            "forces must sum to 0 along x in a periodic layer under full Stokesian Dynamics, got 2e0",
        ),
        (
            "[[1e308, 0], [1e308, 0]]",
            "stokesian-dynamics",
            "forces must sum to 0 along x in a periodic layer under full Stokesian Dynamics, got inf",
        ),
    ] {
        let error = solve_under(forces, hydrodynamics).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    solve_under("[[1, 2], [1, -2]]", "ball-melrose").unwrap();
    // No number of JSON: its place is said, not that a layer has no third coordinate.
    let text = r#"{"centres": [[0, 0, 0], [4, 0, 0]], "forces": [[NaN, 0, 0], [0, 0, 0]]}"#;
    let Err(error) = read(text.as_bytes()) else {
        panic!("NaN was read")
    };
    assert_eq!(error.to_string(), "1:49: expected value");
}

#[test]
fn overlapping_spheres_are_solved_under_lubrication() {
    let with = |more: &str| {
        let text = format!(
            r#"{{"centres": [[0.0, 0.0], [1.99, 0.0], [4.0, 0.3]], "cell": [12.5, 12.5], "offset": 3.1{more}}}"#
        );
        let (configuration, contact) = read_in::<Layer>(text.as_bytes())?;
        Ok::<_, InputError>(solve(&configuration, &contact, &NearFields::default())?)
    };
    let word = r#", "hydrodynamics": "lubrication""#;
    let usual = with(word).unwrap();
    let numbers = |n: &str| with(&format!("{word}, \"lubrication\": {n}"));
    assert_eq!(numbers("{}").unwrap(), usual);
    assert_eq!(
        numbers(r#"{"cutoff": 0.5, "regularisation": 1e-3}"#).unwrap(),
        usual
    );
    // The third sphere is near the second only: a cutoff below their gap leaves it alone.
    let alone = numbers(r#"{"cutoff": 0.02}"#).unwrap();
    assert_ne!(alone, usual);
    assert!(alone.disturbances[2].iter().all(|v| v.abs() < 1e-12));
    assert_ne!(numbers(r#"{"regularisation": 0.01}"#).unwrap(), usual);
    for (more, said) in [
        (r#", "hydrodynamics": "ball-melrose""#.to_owned(), "overlap"),
        (
            r#", "hydrodynamics": "lubrification""#.to_owned(),
            "lubrication",
        ),
        (
            r#", "hydrodynamics": "ball-melrose", "lubrication": {}"#.to_owned(),
            "has no meaning under ball-melrose",
        ),
        (
            format!(r#"{word}, "lubrication": {{"cutoff": 20}}"#),
            "lubrication_cutoff = 20",
        ),
        (
            format!(r#"{word}, "lubrication": {{"cut": 0.5}}"#),
            "unknown field",
        ),
    ] {
        let error = with(&more).unwrap_err().to_string();
        assert!(error.contains(said), "{more}: {error}");
    }
    // Two spheres in one place have no line of centres.
    let text = r#"{"centres": [[1, 2], [1, 2]], "hydrodynamics": "lubrication"}"#;
    let (configuration, contact) = read_in::<Layer>(text.as_bytes()).unwrap();
    let error = solve(&configuration, &contact, &NearFields::default()).unwrap_err();
    assert!(
        error.to_string().contains("spheres 0 and 1 overlap"),
        "{error}"
    );
}

#[test]
fn springs_between_smooth_spheres_are_solved_and_rigid_ones_refused() {
    let with = |roughness: &str, laws: &str| {
        let text = format!(
            r#"{{"centres": [[0.0, 0.0], [1.999, 0.0]], "hydrodynamics": "lubrication", "forces": [[5, 0], [-5, 0]],
            "contact": {{"roughness": {roughness}, "friction": 0.3, "critical_load": 0, {laws}}}}}"#
        );
        let (configuration, contact) = read_in::<Layer>(text.as_bytes())?;
        Ok::<_, InputError>(solve(&configuration, &contact, &NearFields::default())?)
    };
    let spring = r#""scheme": "laws", "laws": {"normal": "linear-spring", "tangential": "stick-slide", "onset": "critical-load",
        "stiffness_unit": "flow", "stiffness": 1000, "tangential_stiffness": 0.5, "dashpot": 0, "lubrication_gap": 0,
        "repulsion": 0, "repulsion_length": 0}"#;
    let solved = with("0", spring).unwrap();
    let c = solved.contacts[0];
    let ahead = 0.001 - 0.005 * c.normal_velocity;
    let expected = 1000.0 * 6.0 * std::f64::consts::PI * ahead;
    assert!((c.normal_force - expected).abs() < 1e-8, "{c:?} {expected}");
    let error = with("0", r#""scheme": "rigid""#).unwrap_err().to_string();
    assert!(error.contains("roughness"), "{error}");
}

#[test]
fn strange_input_is_refused_with_its_place() {
    let start = r#"{"centres": [[0, 0]], "hydrodynamics": "ball-melrose""#;
    let all: Vec<String> = [
        format!("{start}, \"radius\": 1}}"),
        format!("{start}, \"radii\": [1, 2]}}"),
        format!("{start}, \"offset\": 1}}"),
        format!("{start}, \"contact\": {{\"scheme\": \"none\", \"friction\": 1}}}}"),
        format!("{start}, \"contact\": {{\"scheme\": \"none\", \"rough\": 1}}}}"),
        format!("{start}, \"contact\": {{\"scheme\": \"rigid\"}}}}"),
        "{\"centres\": [[1e999, 0]]}".into(),
        "{\"centres\": [[0, 0]]}".into(),
        "[[".into(),
    ]
    .iter()
    .map(|text| message(text))
    .collect();
    insta::assert_snapshot!(all.join("\n"));
}

/// Any JSON value, with the names and words of the format among its strings.
fn json() -> impl Strategy<Value = serde_json::Value> {
    let word = proptest::sample::select(vec![
        "centres",
        "radii",
        "cell",
        "offset",
        "hydrodynamics",
        "stokesian-dynamics",
        "ball-melrose",
        "background",
        "rate_of_strain",
        "angular_velocity",
        "xx",
        "yy",
        "xy",
        "forces",
        "torques",
        "contact",
        "scheme",
        "none",
        "listed",
        "rigid",
        "procedure",
        "pairs",
        "roughness",
        "friction",
        "critical_load",
        "time_span",
    ]);
    let leaf = prop_oneof![
        Just(serde_json::Value::Null),
        any::<bool>().prop_map(Into::into),
        any::<i64>().prop_map(Into::into),
        any::<f64>().prop_map(Into::into),
        (-3.0..30.0f64).prop_map(Into::into),
        word.clone().prop_map(Into::into),
    ];
    leaf.prop_recursive(4, 40, 8, move |inner| {
        prop_oneof![
            proptest::collection::vec(inner.clone(), 0..6).prop_map(Into::into),
            proptest::collection::vec((word.clone(), inner), 0..8).prop_map(|entries| {
                serde_json::Value::Object(
                    entries
                        .into_iter()
                        .map(|(k, v)| (k.to_owned(), v))
                        .collect(),
                )
            }),
        ]
    })
}

/// A configuration near a valid one: each value is either valid or arbitrary.
fn configuration() -> impl Strategy<Value = serde_json::Value> {
    let good = |value: serde_json::Value| prop_oneof![6 => Just(value), 1 => json()];
    let coordinate = || prop_oneof![8 => -6.0..6.0f64, 1 => any::<f64>()];
    let centres = proptest::collection::vec([coordinate(), coordinate()], 0..4);
    (
        centres,
        good(serde_json::json!([1.0, 1.0])),
        good(serde_json::json!([12.0, 13.0])),
        good(serde_json::json!(2.0)),
        good(serde_json::json!("ball-melrose")),
        good(serde_json::json!({"scheme": "rigid", "roughness": 0.3, "friction": 0.2, "critical_load": 0})),
        good(serde_json::json!({"scheme": "listed", "pairs": [[0, 1], [1, 9]]})),
        0u8..64,
    )
        .prop_map(|(centres, radii, cell, offset, hydrodynamics, one, two, which)| {
            let mut all = serde_json::json!({"centres": centres, "hydrodynamics": hydrodynamics});
            let chosen = [
                ("radii", radii),
                ("cell", cell),
                ("offset", offset),
                ("contact", one),
                ("contact", two),
            ];
            for (bit, (name, value)) in chosen.into_iter().enumerate() {
                if which >> bit & 1 == 1 {
                    all[name] = value;
                }
            }
            all
        })
}

/// A pair under springs; `springs` describes the tangential one.
fn spring_pair(springs: &str) -> String {
    format!(
        r#"{{"centres": [[0.0, 0.0], [2.008, 0.0]], "hydrodynamics": "ball-melrose", "forces": [[1, 0.2], [-1, -0.2]],
        "contact": {{"scheme": "laws", "roughness": 0.01, "friction": 10, "critical_load": 0.1, "laws": {{
        "normal": "linear-spring", "tangential": "stick-slide", "onset": "critical-load", "stiffness": 5000,
        "tangential_stiffness": 0.5, "dashpot": 0, "lubrication_gap": 0.001, "repulsion": 0, "repulsion_length": 0}},
        "springs": {springs}}}}}"#
    )
}

#[test]
fn springs_are_pairs_and_forces() {
    let friction = |springs: &str| {
        let text = spring_pair(springs);
        let (configuration, contact) = read_in::<Layer>(text.as_bytes()).unwrap();
        let solved = solve(&configuration, &contact, &NearFields::default()).unwrap();
        solved.contacts[0].tangential_force
    };
    let given = friction("[[0, 1, 0.1]]");
    assert!((given - friction("[]")).abs() > 1e-3, "{given}");
    for (springs, part) in [
        (
            "[[0, 2, 0.1]]",
            "pair [0, 2] names a sphere that is not there",
        ),
        (
            "[[0, 1, 0.1], [0, 1, 0.2]]",
            "pair [0, 1] is out of order, or there twice",
        ),
    ] {
        let text = spring_pair(springs);
        let (configuration, contact) = read_in::<Layer>(text.as_bytes()).unwrap();
        let error = solve(&configuration, &contact, &NearFields::default()).unwrap_err();
        assert_eq!(error.to_string(), part);
    }
    assert!(message(&spring_pair("[[0, 1]]")).contains("a spring is [i, j, force]"));
    assert!(message(&spring_pair("[[1, 0, 0.1]]")).contains("i < j"));
    let longer = spring_pair("[[0, 1, 1.0, 0.1]]");
    assert!(read_in::<Layer>(longer.as_bytes()).is_err());
}

#[test]
fn hostile_sizes_are_refused_before_they_cost_anything() {
    let many = |n: usize, hydrodynamics: &str, radius: fn(usize) -> f64| {
        let centres: Vec<[f64; 2]> = (0..n).map(|i| [3.0 * i as f64, 0.0]).collect();
        let radii: Vec<f64> = (0..n).map(radius).collect();
        serde_json::json!({"centres": centres, "radii": radii, "hydrodynamics": hydrodynamics})
            .to_string()
    };
    let full = "stokesian-dynamics";
    assert!(message(&many(2_001, full, |_| 1.0)).contains("at most 2000"));
    assert!(message(&many(10_001, "ball-melrose", |_| 1.0)).contains("at most 10000"));
    let mut periodic: serde_json::Value =
        serde_json::from_str(&many(2_001, full, |_| 1.0)).unwrap();
    periodic["cell"] = serde_json::json!([7000.0, 20.0]);
    assert!(read_in::<Layer>(periodic.to_string().as_bytes()).is_ok());
    assert!(message(&many(1_000, full, |i| 1.0 + i as f64 * 1e-4)).contains("different"));
}

proptest! {
    #[test]
    fn no_text_crashes_the_reader(text in "[\\[\\]{}:,\"a-z0-9.e-]{0,200}") {
        let _ = read_in::<Layer>(text.as_bytes());
    }

    #[test]
    fn no_bytes_crash_the_reader(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let _ = read_in::<Layer>(&bytes);
    }

    #[test]
    fn no_json_crashes_the_reader(value in json()) {
        let _ = read_in::<Layer>(value.to_string().as_bytes());
    }

    #[test]
    fn no_configuration_crashes_the_solver(value in configuration()) {
        if let Ok((configuration, contact)) = read_in::<Layer>(value.to_string().as_bytes()) {
            let _ = solve(&configuration, &contact, &NearFields::default());
        }
    }
}

#[test]
fn replays_are_read_and_have_the_cell_of_their_state() {
    let lubrication = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
    let some = || {
        let spheres = Params::builder().spheres(60).area_fraction(0.4);
        let spheres = spheres.roughness(0.05).friction(0.5).time_step(1e-3);
        spheres.hydrodynamics(lubrication)
    };
    let thermal = some().shear_stress(2.0).thermal_load(1.0);
    for builder in [some().shear_rate(1.0), thermal] {
        let params = builder.build().unwrap();
        let mut run = Simulation::<Layer>::new(&params, 1, &NearFields::default()).unwrap();
        for _ in 0..50 {
            run.step().unwrap();
        }
        let snapshot = run.snapshot();
        let cell = snapshot.cell(&params).unwrap();
        let text = replay(&params, &AnySnapshot::Layer(snapshot));
        let (configuration, contact) = read_in::<Layer>(text.as_bytes()).unwrap();
        assert_eq!(configuration.hydrodynamics, lubrication);
        let vectors = [&configuration.cell, &cell].map(|cell| cell.lattice().unwrap().vectors());
        for (given, own) in vectors[0].iter().zip(vectors[1]) {
            assert!((given - own).norm() < 1e-9, "{vectors:?}");
        }
        solve(&configuration, &contact, &NearFields::default()).unwrap();
    }
}
