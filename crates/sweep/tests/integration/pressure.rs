//! Campaigns at an imposed pressure, from the file to reports: runs that come to rest under an
//! imposed ratio of stress and pressure are called arrested, with their fraction.

use crate::harness::{folder, json, sweep};

/// Without friction the ratio of a flowing suspension is above 0.1.
const CAMPAIGN: &str = r#"name = "creep"
[protocol]
strain = 1.5
discard = 0.2
[[grid]]
volume_fraction = 0.58
macroscopic_friction = [0.03, 0.8]
friction = 0
roughness = 0.01
shear_rate = inf
seeds = 1
spheres = 40
hydrodynamics = "lubrication"
"#;

#[test]
fn runs_at_rest_under_a_ratio_of_stress_and_pressure_are_called_arrested() {
    let at = folder("creep.toml", CAMPAIGN);
    let at = at.path();
    sweep(at, &["run", "creep.toml", "--quiet"]);
    let report = json(at, &["report", "creep.toml"]);
    let cases = &report["cases"];
    assert_eq!(
        [&cases["done"], &cases["jammed"], &cases["arrested"]],
        [1, 1, 1],
        "{report}"
    );
    let points = report["points"].as_array().unwrap();
    let fraction = points[0]["arrested_fraction"].as_f64().unwrap();
    assert!((0.6..0.7).contains(&fraction), "{fraction}");
    assert!(points[1]["arrested_fraction"].is_null());

    let shown = format!("{fraction:.4}");
    let table = sweep(at, &["report", "creep.toml"]);
    assert!(
        table.contains("1 of 2 cases done, 1 arrested, 0 failed"),
        "{table}"
    );
    assert!(table.contains(&shown), "{table}");
    assert!(table.contains(" fraction "), "{table}");
    let status = sweep(at, &["status", "creep.toml"]);
    let words = format!("1 arrested, at a mean fraction of {shown}");
    assert!(status.contains(&words), "{status}");
    let status = json(at, &["status", "creep.toml"]);
    assert_eq!(status["cases"]["arrested"], 1, "{status}");
    assert_eq!(status["arrested_fraction"], fraction);
    let run = sweep(at, &["show", "creep.toml", "1"]);
    let words = format!("arrested at a fraction of {shown}: strain");
    assert!(run.contains(&words), "{run}");
    let run = json(at, &["show", "creep.toml", "1"]);
    assert_eq!(run["state"], "jammed");
    assert_eq!(run["final_fraction"], fraction);
    sweep(at, &["report", "creep.toml", "--page", "page.html"]);
    let page = std::fs::read_to_string(at.join("page.html")).unwrap();
    assert!(page.contains("1 of 2 runs done, 1 arrested, 0 failed"));
    assert!(page.contains(&format!("\"state\":\"arrested, at {shown}\"")));

    // The words of a run that did not end so are as before.
    let flowing = sweep(
        at,
        &[
            "report",
            "creep.toml",
            "--where",
            "imposed_macroscopic_friction=0.8",
        ],
    );
    assert!(flowing.contains("1 of 1 cases done, 0 jammed"), "{flowing}");
    assert!(!flowing.contains("arrested"), "{flowing}");
}

#[test]
fn a_fraction_that_still_falls_is_named() {
    // A dense start expands for longer than the run lasts.
    let campaign = CAMPAIGN
        .replace("strain = 1.5\ndiscard = 0.2", "strain = 0.4\ndiscard = 0.1")
        .replace("macroscopic_friction = [0.03, 0.8]", "viscous_number = 1.0")
        .replace("volume_fraction = 0.58", "volume_fraction = 0.55")
        .replace("seeds = 1", "seeds = 4");
    let at = folder("creep.toml", &campaign);
    let at = at.path();
    sweep(at, &["run", "creep.toml", "--quiet"]);
    let report = json(at, &["report", "creep.toml"]);
    let point = &report["points"][0];
    assert!(point["fraction_drift"].as_f64().unwrap() < -0.01, "{point}");
    // With so few spheres layering may rise by chance, and the runs be called ordering.
    let marks = ["not_steady", "ordering"].map(|mark| point[mark].as_f64().unwrap());
    assert_eq!(marks[0] + marks[1], 1.0, "{point}");
    let table = sweep(at, &["report", "creep.toml"]);
    let words = "the fraction falls by 0.02";
    assert!(table.contains(words), "{table}");
}

#[test]
fn figures_of_an_imposed_pressure_run_along_it() {
    let campaign = CAMPAIGN
        .replace(
            "macroscopic_friction = [0.03, 0.8]",
            "viscous_number = [1.0, 0.3]",
        )
        .replace("friction = 0\n", "friction = [0.2, 0.5]\n")
        .replace("0.58", "[0.3, 0.35]")
        .replace("strain = 1.5", "strain = 0.3");
    let at = folder("pressed.toml", &campaign);
    let at = at.path();
    sweep(at, &["run", "pressed.toml", "--quiet"]);
    sweep(at, &["report", "pressed.toml", "--figure", "eta.svg"]);
    let figure = std::fs::read_to_string(at.join("eta.svg")).unwrap();
    assert!(figure.contains("viscous number J"), "{figure}");
    for label in ["φ = 0.3, ν = 0.2", "φ = 0.35, ν = 0.5"] {
        assert!(figure.contains(label), "{label}: {figure}");
    }
}
