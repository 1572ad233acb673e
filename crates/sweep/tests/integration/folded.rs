//! Points that share their runs: friction has no effect at Γ = 0, nor has the shear rate without
//! friction.

use crate::harness::{folder, json, refused, run, sweep, words};

const CAMPAIGN: &str = r#"name = "folded"
[protocol]
time_step = 0.02
strain = 0.4
discard = 0.1
[[grid]]
area_fraction = 0.7
friction = [0.0, 0.3]
roughness = 0.01
shear_rate = [0.0, 0.1, inf]
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

#[test]
fn points_that_share_their_runs_are_computed_once_and_reported_as_written() {
    check_folding(CAMPAIGN);
}

#[test]
fn points_of_suspensions_do_so_too() {
    let suspension = CAMPAIGN
        .replace("area_fraction = 0.7", "volume_fraction = 0.5")
        .replace("spheres = 30", "spheres = 62");
    check_folding(&suspension);
}

fn check_folding(campaign: &str) {
    let folder = folder("folded.toml", campaign);
    let at = folder.path();
    let plan = json(at, &["plan", "folded.toml"]);
    assert_eq!((&plan["cases"], &plan["folded"]), (&6.into(), &6.into()));
    let text = sweep(at, &["plan", "folded.toml"]);
    assert!(
        text.contains("6 more runs of the grids are identical"),
        "{text}"
    );
    sweep(at, &["run", "folded.toml", "--quiet"]);
    let report = json(at, &["report", "folded.toml"]);
    assert_eq!(report["cases"]["done"], 6);
    let points = report["points"].as_array().unwrap();
    let shown: Vec<String> = points
        .iter()
        .map(|point| format!("{} {}", point["friction"], point["shear_rate"]))
        .collect();
    let written = [
        "0.0 0.0",
        "0.0 0.1",
        "0.0 \"inf\"",
        "0.3 0.0",
        "0.3 0.1",
        "0.3 \"inf\"",
    ];
    assert_eq!(shown, written);
    let viscosity = |place: usize| points[place]["viscosity"].as_f64().unwrap();
    for alike in 1..4 {
        assert_eq!(viscosity(alike).to_bits(), viscosity(0).to_bits());
    }
    assert!(viscosity(5) > 1.01 * viscosity(0));
    assert!(points.iter().all(|point| point["seeds"] == 2));
    // A folded point can be selected by its values in the file.
    let some = json(
        at,
        &[
            "report",
            "folded.toml",
            "--where",
            "friction=0",
            "--where",
            "shear_rate=inf",
        ],
    );
    assert_eq!(some["points"].as_array().unwrap().len(), 1);
    assert_eq!(some["cases"]["done"], 2);
    // Every run once, in tables of runs and of samples.
    let runs = sweep(at, &["report", "folded.toml", "--runs", "runs.csv"]);
    assert!(runs.is_empty(), "{runs}");
    let rows = std::fs::read_to_string(at.join("runs.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + 6, "{rows}");
    let text = sweep(at, &["report", "folded.toml"]);
    assert!(text.contains("rows with the same runs"), "{text}");
}

#[test]
fn the_same_layers_without_folding_have_the_same_numbers() {
    // With springs in units of the flow the shear rate has no effect without friction; with springs
    // in units of F_crit it has.
    let spring = |unit: &str| {
        CAMPAIGN
            .replace("friction = [0.0, 0.3]", "friction = 0.0")
            .replace("[0.0, 0.1, inf]", "[0.1, 1.0]")
            .replace(
                "seeds = 2",
                &format!("seeds = 1\ncontact = \"linear-spring\"\nstiffness = 1e4\nstiffness_unit = \"{unit}\""),
            )
    };
    for (unit, cases) in [("flow", 1), ("critical-load", 2)] {
        let folder = folder("folded.toml", &spring(unit));
        assert_eq!(
            json(folder.path(), &["plan", "folded.toml"])["cases"],
            cases,
            "{unit}"
        );
    }
}

#[test]
fn without_friction_the_laws_of_the_file_are_shown_and_selected() {
    let laws = CAMPAIGN
        .replace("shear_rate = [0.0, 0.1, inf]", "shear_rate = 10")
        .replace(
            "seeds = 2",
            "seeds = 1\ntangential = \"stick-slide\"\nfriction_onset = \"reduced\"\n\
             contact = \"linear-spring\"\nstiffness = 1e4\nstiffness_unit = \"flow\"",
        );
    let folder = folder("folded.toml", &laws);
    let at = folder.path();
    let axes = &json(at, &["plan", "folded.toml"])["axes"];
    assert_eq!(axes["tangential"], serde_json::json!(["stick-slide"]));
    assert_eq!(axes["friction_onset"], serde_json::json!(["reduced"]));
    assert_eq!(axes["tangential_stiffness"], serde_json::json!([0.5]));
    assert_eq!(axes["shear_rate"], serde_json::json!([10.0]));
    assert_eq!(axes["friction"], serde_json::json!([0.0, 0.3]));
    sweep(at, &["run", "folded.toml", "--quiet"]);
    let chosen = ["report", "folded.toml", "--where", "tangential=stick-slide"];
    let points = json(at, &chosen)["points"].take();
    assert_eq!(points.as_array().unwrap().len(), 2, "{points}");
    for point in points.as_array().unwrap() {
        assert_eq!(point["tangential"], "stick-slide");
        assert_eq!(point["shear_rate"], 10.0);
    }
    let figure = at.join("eta.svg");
    let figure = figure.to_str().unwrap();
    let along = ["report", "folded.toml", "--along", "friction"];
    sweep(at, &[&along[..], &["--figure", figure]].concat());
    let svg = std::fs::read_to_string(figure).unwrap();
    let words = words(svg.as_bytes());
    // Both points are on one curve, so no law is named in a legend.
    for law in ["roll-slip", "stick-slide", "onset", "critical-load"] {
        assert!(!words.contains(law), "{law}: {words}");
    }
    // A start from the runs without friction is found by the laws of the file too.
    let next = laws.replace("\"folded\"", "\"next\"").replace(
        "seeds = 1",
        "start = { store = \"results/folded.sqlite\", point = { friction = 0, tangential = \"stick-slide\" } }\nseeds = 1",
    );
    std::fs::write(at.join("next.toml"), next).unwrap();
    assert_eq!(json(at, &["plan", "next.toml"])["cases"], 2);
}

#[test]
fn a_plan_warns_of_layers_too_dense_to_start() {
    let dense = CAMPAIGN
        .replace("area_fraction = 0.7", "area_fraction = [0.7, 0.84]")
        .replace("roughness = 0.01", "roughness = 0.07")
        .replace("spheres = 30", "spheres = 20");
    let folder = folder("folded.toml", &dense);
    let at = folder.path();
    let plan = json(at, &["plan", "folded.toml"]);
    let warnings = plan["warnings"].as_array().unwrap();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0]
            .as_str()
            .unwrap()
            .contains("20 spheres at area fraction 0.84")
    );
    let text = sweep(at, &["plan", "folded.toml"]);
    assert!(
        text.contains("warning: no start could be made of 20 spheres"),
        "{text}"
    );
}

#[test]
fn numbers_of_workers_new_folders_and_changes_are_said_in_plain_words() {
    let folder = folder("folded.toml", CAMPAIGN);
    let at = folder.path();
    for command in ["run", "plan"] {
        let error = refused(at, &[command, "folded.toml", "--workers", "0"]);
        assert!(error.contains("write a number from 1 to 4096"), "{error}");
    }
    let first = run(at, &["run", "folded.toml", "--store", "new/place/x.sqlite"]);
    assert_eq!(first.status.code(), Some(0));
    let message = words(&first.stderr);
    assert!(message.contains("new/place is a new folder"), "{message}");
    assert!(message.contains("6 of 6 cases"), "{message}");
    let status = sweep(at, &["status", "new/place/x.sqlite"]);
    assert!(status.contains("folded: all 6 runs have ended"), "{status}");
    let more = CAMPAIGN
        .replace("seeds = 2", "seeds = 3")
        .replace("strain = 0.4", "strain = 0.6");
    std::fs::write(at.join("folded.toml"), more).unwrap();
    let again = run(at, &["run", "folded.toml", "--store", "new/place/x.sqlite"]);
    let message = words(&again.stderr);
    let change =
        "folded.toml differs from the last campaign in x.sqlite: 3 new runs, 0 reused, 6 extended";
    assert!(message.contains(change), "{message}");
    assert!(!message.contains("is a new folder"), "{message}");
}

#[test]
fn a_start_that_is_a_store_or_elsewhere_is_refused_with_advice() {
    let folder = folder("folded.toml", CAMPAIGN);
    let at = folder.path();
    sweep(
        at,
        &[
            "run",
            "folded.toml",
            "--quiet",
            "--store",
            "results/x.sqlite",
        ],
    );
    std::fs::create_dir(at.join("sweeps")).unwrap();
    let with = |start: &str| {
        let text = CAMPAIGN
            .replace("friction = [0.0, 0.3]", "friction = 0.3")
            .replace("seeds = 2", &format!("seeds = 2\nstart = {start}"));
        std::fs::write(
            at.join("sweeps/on.toml"),
            text.replace("\"folded\"", "\"on\""),
        )
        .unwrap();
    };
    with("\"../results/x.sqlite\"");
    let error = refused(at, &["plan", "sweeps/on.toml"]);
    assert!(error.contains("is a store, and no layer"), "{error}");
    assert!(error.contains("start = { store ="), "{error}");
    let point = "point = { friction = 0.3, shear_rate = 0.0 }";
    with(&format!("{{ store = \"results/x.sqlite\", {point} }}"));
    let error = refused(at, &["plan", "sweeps/on.toml"]);
    assert!(
        error.contains("did you mean \"../results/x.sqlite\"?"),
        "{error}"
    );
    // A point that shares its runs with others is found by its values in the file.
    with(&format!("{{ store = \"../results/x.sqlite\", {point} }}"));
    sweep(at, &["run", "sweeps/on.toml", "--quiet"]);
    let shown = sweep(at, &["show", "sweeps/on.toml", "1"]);
    assert!(shown.contains("start end of x"), "{shown}");
    with("{ store = \"../results/x.sqlite\", point = { friction = 0.3, shear_rate = 1.0 } }");
    let error = refused(at, &["plan", "sweeps/on.toml"]);
    assert!(error.contains("no run of that point"), "{error}");
    let error = refused(at, &["submit", "folded.toml", "--dry-run", "--tasks", "0"]);
    assert!(error.contains("write a whole number from 1"), "{error}");
}

#[test]
fn every_onset_has_its_rows_and_its_curve() {
    let campaign = CAMPAIGN
        .replace(
            "friction = [0.0, 0.3]",
            "friction = 0.5\nfriction_onset = [\"critical-load\", \"reduced\", \"contact\"]",
        )
        .replace(
            "[0.0, 0.1, inf]",
            "[0.0, 0.1, inf]\ntangential = \"coulomb\"",
        );
    let folder = folder("folded.toml", &campaign);
    let at = folder.path();
    // Of nine points, the two at Γ = 0 where friction has a threshold are one, and at Γ = ∞ all,
    // with which goes that of contact at Γ = 0.
    let plan = json(at, &["plan", "folded.toml"]);
    assert_eq!((&plan["cases"], &plan["folded"]), (&10.into(), &8.into()));
    sweep(at, &["run", "folded.toml", "--quiet"]);
    let report = json(at, &["report", "folded.toml"]);
    let points = report["points"].as_array().unwrap();
    let shown: Vec<String> = points
        .iter()
        .map(|point| format!("{} {}", point["friction_onset"], point["shear_rate"]))
        .collect();
    let mut wanted = Vec::new();
    for onset in ["critical-load", "reduced", "contact"] {
        wanted.extend(["0.0", "0.1", "\"inf\""].map(|rate| format!("\"{onset}\" {rate}")));
    }
    assert_eq!(shown, wanted);
    let viscosity = |place: usize| points[place]["viscosity"].as_f64().unwrap().to_bits();
    assert_eq!(viscosity(0), viscosity(3));
    assert_eq!(
        [viscosity(5), viscosity(8), viscosity(6)],
        [viscosity(2); 3]
    );
    assert_ne!(viscosity(6), viscosity(0));
    sweep(at, &["report", "folded.toml", "--figure", "f.svg"]);
    let figure = std::fs::read_to_string(at.join("f.svg")).unwrap();
    for onset in ["critical-load", "reduced", "contact"] {
        assert!(figure.contains(&format!(">{onset}<")), "{figure}");
    }
}
