//! The Wyart-Cates model fitted to a campaign.

use crate::harness::{Computed, campaign, edit, json, refused, sweep};
use std::sync::LazyLock;

static COMPUTED: LazyLock<Computed> = LazyLock::new(|| {
    Computed::new(
        campaign(
            "fit",
            [0.6, 0.2],
            r#"[[grid]]
area_fraction = [0.45, 0.6, 0.68]
friction = 1.0
roughness = 0.01
shear_rate = [0.0, 0.1, 0.3, 1.0, inf]
seeds = 3
spheres = 24
hydrodynamics = "ball-melrose"
"#,
        ),
        &[],
    )
});

#[test]
fn parameters_have_intervals_and_residuals_are_those_of_the_points() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let fit = json(at, &["fit", "s.sqlite", "--replicates", "40"]);
    // The interval of an onset of unknown steepness has no upper end.
    let of = |name: &str, key: &str| match &fit["parameters"][name][key] {
        serde_json::Value::String(word) => word.parse::<f64>().unwrap(),
        number => number.as_f64().unwrap(),
    };
    for name in ["c_0", "c_m", "sigma_c", "beta", "prefactor"] {
        let [low, value, high] = ["low", "value", "high"].map(|key| of(name, key));
        assert!(
            low <= value && value <= high && low < high,
            "{name}: {low} {value} {high}"
        );
    }
    // Friction lowers the fraction at which layers jam, and both are above those that flow.
    assert!(of("c_m", "value") < of("c_0", "value"));
    assert!(of("c_m", "value") > 0.68);
    let report = json(at, &["report", "s.sqlite"]);
    let points = fit["points"].as_array().unwrap();
    assert_eq!(points.len(), 15);
    let mut marked = 0;
    for (point, averaged) in points.iter().zip(report["points"].as_array().unwrap()) {
        let number = |key: &str| point[key].as_f64().unwrap();
        assert_eq!(point["shear_rate"], averaged["shear_rate"]);
        let viscosity = averaged["viscosity"].as_f64().unwrap();
        assert!((number("viscosity") / viscosity - 1.0).abs() < 1e-12);
        let residual = (number("viscosity") / number("fitted")).ln();
        assert!((number("residual") - residual).abs() < 1e-9);
        let is = |name: &str| averaged[name] == 1.0;
        let trend = match [is("ordering"), is("not_steady")] {
            [true, _] => Some("ordering"),
            [_, true] => Some("not steady"),
            _ => None,
        };
        assert_eq!(point["trend"].as_str(), trend);
        // The mean trace of the point says so too.
        let at_point = |key: &str| format!("{key}={}", averaged[key].to_string().replace('"', ""));
        let [c, rate] = ["area_fraction", "shear_rate"].map(at_point);
        let draw = ["report", "s.sqlite", "--figure", "t.svg", "--kind", "trace"];
        sweep(
            at,
            &[&draw[..], &["--where", &c, "--where", &rate]].concat(),
        );
        let figure = std::fs::read_to_string(at.join("t.svg")).unwrap();
        for name in ["ordering", "not steady"] {
            assert_eq!(figure.contains(name), trend == Some(name), "{averaged}");
        }
        marked += usize::from(trend.is_some());
    }
    sweep(
        at,
        &["fit", "s.sqlite", "--replicates", "0", "--figure", "f.svg"],
    );
    let figure = std::fs::read_to_string(at.join("f.svg")).unwrap();
    assert_eq!(
        figure.contains("steady") || figure.contains("ordering"),
        marked > 0
    );
    let text = sweep(at, &["fit", "s.sqlite", "--replicates", "40"]);
    for part in [
        "c_0",
        "sigma_c",
        "95 % interval",
        "15 points of 45 runs",
        "root mean square",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // What the points do not determine has no number in the table.
    let undetermined = fit["undetermined"].as_array().unwrap().len();
    assert_eq!(
        text.matches("not determined").count(),
        undetermined,
        "{text}"
    );
    sweep(
        at,
        &[
            "fit",
            "s.sqlite",
            "--figure",
            "f.svg",
            "--csv",
            "r.csv",
            "--replicates",
            "0",
        ],
    );
    let figure = std::fs::read_to_string(at.join("f.svg")).unwrap();
    assert_eq!(figure.matches("c = 0.").count(), 3);
    assert!(figure.contains("<title>fit</title>"), "{figure}");
    assert!(figure.contains("campaign fit"), "{figure}");
    let rows = std::fs::read_to_string(at.join("r.csv")).unwrap();
    assert_eq!(rows.lines().count(), 16);
}

#[test]
fn suspensions_are_fitted_by_their_volume_fraction() {
    let computed = Computed::new(
        campaign(
            "bulk",
            [0.3, 0.1],
            r#"[[grid]]
volume_fraction = [0.35, 0.45, 0.5]
friction = 1.0
roughness = 0.01
shear_rate = [0, 1, inf]
seeds = 1
spheres = 64
hydrodynamics = "lubrication"
tangential = "coulomb"
"#,
        ),
        &[],
    );
    let folder = computed.folder();
    let at = folder.path();
    let fit = json(at, &["fit", "s.sqlite"]);
    assert_eq!(fit["points"][0]["volume_fraction"], 0.35);
    let [c_0, c_m] = ["c_0", "c_m"].map(|name| fit["parameters"][name]["value"].as_f64().unwrap());
    assert!(0.5 < c_m && c_m < c_0 && c_0 < 0.7, "{c_0} {c_m}");
    // One run a point has no intervals.
    assert!(fit["parameters"]["c_0"]["low"].is_null());
    let text = sweep(at, &["fit", "s.sqlite"]);
    assert!(
        text.contains("A (1 − φ/c_J)") && text.contains(" φ "),
        "{text}"
    );
    sweep(
        at,
        &["fit", "s.sqlite", "--figure", "f.svg", "--csv", "r.csv"],
    );
    let read = |file: &str| std::fs::read_to_string(at.join(file)).unwrap();
    assert_eq!(read("f.svg").matches("φ = 0.").count(), 3);
    assert!(read("r.csv").starts_with("volume_fraction,"));
}

#[test]
fn what_cannot_be_fitted_is_named() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let error = refused(at, &["fit", "s.sqlite", "--where", "c=0.6"]);
    assert!(error.contains("needs at least 6 points"), "{error}");
    assert!(error.contains("here are 5 points at 1 and 5"), "{error}");
    let several = Computed::new(
        campaign(
            "several",
            [0.1, 0.0],
            r#"[[grid]]
area_fraction = [0.3, 0.4]
friction = [0.5, 1.0]
roughness = 0.01
shear_rate = [0.1, 1.0, 10.0]
seeds = 1
spheres = 20
hydrodynamics = "ball-melrose"
"#,
        ),
        &[],
    );
    let error = refused(several.folder().path(), &["fit", "s.sqlite"]);
    assert!(error.contains("friction has 0.5, 1"), "{error}");
}

#[test]
fn points_without_friction_are_the_lower_plateau_in_any_order_of_the_file() {
    let grid = |rates: &str| {
        let grid = format!(
            "[[grid]]\narea_fraction = [0.45, 0.6, 0.68]\nfriction = [0, 1.0]\nroughness = 0.01\nshear_rate = {rates}\n\
             seeds = 2\nspheres = 24\nhydrodynamics = \"ball-melrose\"\n"
        );
        let computed = Computed::new(campaign("orders", [0.4, 0.1], &grid), &[]);
        let folder = computed.folder();
        json(folder.path(), &["fit", "s.sqlite", "--replicates", "20"])
    };
    let rising = grid("[0.1, 1.0, 10.0, inf]");
    let falling = grid("[inf, 10.0, 1.0, 0.1]");
    assert_eq!(rising, falling);
    let points = rising["points"].as_array().unwrap();
    let resting = points.iter().filter(|point| point["shear_stress"] == 0.0);
    assert_eq!(resting.count(), 3, "{points:?}");
}

#[test]
fn points_most_of_whose_runs_jammed_are_left_out_and_listed() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let before = json(at, &["fit", "s.sqlite", "--replicates", "0"]);
    // Of three runs two jam at c = 0.68 and Γ = ∞, and one at Γ = 1.
    edit(
        &at.join("s.sqlite"),
        "UPDATE cases SET state = 'jammed' WHERE point IN
             (SELECT id FROM axes WHERE area_fraction > 0.65 AND (shear_rate = 1.0 AND seed = 1 OR shear_rate = 9e999 AND seed < 3));
         UPDATE results SET jammed_strain = 0.01 WHERE case_id IN (SELECT id FROM cases WHERE state = 'jammed')",
    );
    let fit = json(at, &["fit", "s.sqlite", "--replicates", "0"]);
    let [all, left] = [&before, &fit].map(|fit| fit["points"].as_array().unwrap().len());
    assert_eq!((all, left), (15, 14));
    assert_eq!(before["jammed"], serde_json::json!([]));
    let jammed = &fit["jammed"].as_array().unwrap()[..];
    let [jammed] = jammed else {
        panic!("{jammed:?}");
    };
    assert_eq!((&jammed["jammed"], &jammed["runs"]), (&2.into(), &3.into()));
    assert_eq!(jammed["area_fraction"], 0.68);
    assert_eq!(jammed["shear_stress"], "inf");
    let text = sweep(at, &["fit", "s.sqlite", "--replicates", "0"]);
    for part in [
        "14 points of 41 runs; left out 1 point, most of whose runs jammed",
        "2 of 3 jammed",
    ] {
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(part), "{part}: {text}");
    }
}
