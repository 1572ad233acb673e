//! A campaign from its file to its report, interrupted and resumed.

use crate::harness::{command, folder, send, spawn};
use assert_cmd::Command;
use rustix::process::Signal;
use std::path::Path;
use std::time::Duration;

const CAMPAIGN: &str = r#"name = "small"
[protocol]
strain = 0.4
discard = 0.1
checkpoint_every = 0.02
[[grid]]
area_fraction = 0.6
friction = 0.3
roughness = 0.01
shear_rate = [0.1, inf]
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

/// A directory with the campaign in it.
fn directory() -> tempfile::TempDir {
    directory_with(CAMPAIGN)
}

/// A directory with this campaign in it.
fn directory_with(campaign: &str) -> tempfile::TempDir {
    folder("small.toml", campaign)
}

fn sweep(directory: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::from_std(command(directory, arguments)).assert()
}

/// All that was computed, in the order of the keys.
fn results(directory: &Path) -> Vec<Vec<rusqlite::types::Value>> {
    let store = rusqlite::Connection::open(directory.join("results/small.sqlite")).unwrap();
    let mut all = Vec::new();
    for query in [
        "SELECT c.key, s.* FROM samples s JOIN cases c ON c.id = s.case_id ORDER BY c.key, s.step",
        "SELECT c.key, r.viscosity, r.viscosity_median, r.viscosity_stresslet, r.contacts, r.stages,
             r.unconverged_stages, r.worst_residual, r.minimum_gap, r.jam_events, r.final_strain
         FROM results r JOIN cases c ON c.id = r.case_id ORDER BY c.key",
    ] {
        let mut statement = store.prepare(query).unwrap();
        let names: Vec<String> = statement.column_names().map(String::from).collect();
        // Numbers of cases follow the order of work, which depends on how fast the machine is.
        let columns: Vec<usize> = (0..names.len()).filter(|n| names[*n] != "case_id").collect();
        let rows = statement
            .query_map([], |row| columns.iter().map(|n| row.get(*n)).collect())
            .unwrap();
        all.extend(rows.map(Result::unwrap));
    }
    all
}

#[test]
fn campaign_runs_reports_and_has_nothing_left_to_do() {
    let directory = directory();
    let text = sweep(directory.path(), &["run", "small.toml", "--quiet"]).code(0);
    let text = String::from_utf8_lossy(&text.get_output().stdout).into_owned();
    assert!(text.contains("4 of 4 cases done"), "{text}");
    let first = results(directory.path());
    assert_eq!(first.len(), 4 * 20 + 4);
    let again = sweep(directory.path(), &["run", "small.toml", "--quiet"]).code(0);
    assert_eq!(String::from_utf8_lossy(&again.get_output().stdout), text);
    assert_eq!(results(directory.path()), first);
    let json = sweep(
        directory.path(),
        &["report", "results/small.sqlite", "--json"],
    )
    .code(0);
    let report: serde_json::Value = serde_json::from_slice(&json.get_output().stdout).unwrap();
    assert_eq!(report["campaign"], "small");
    assert_eq!(report["cases"]["done"], 4);
    assert_eq!(report["points"][1]["shear_rate"], "inf");
    assert_eq!(report["points"][0]["seeds"], 2);
    assert!(report["points"][0]["viscosity_ci95"].is_number());
    let status = sweep(directory.path(), &["status", "small.toml", "--json"]).code(0);
    let status: serde_json::Value = serde_json::from_slice(&status.get_output().stdout).unwrap();
    assert_eq!(status["work_done"], 1.0);
}

#[test]
fn killed_and_stopped_processes_lose_nothing() {
    let all_solvers = CAMPAIGN.replace("seeds = 2", "seeds = 1").replace(
        "hydrodynamics = \"ball-melrose\"",
        "hydrodynamics = [\"ball-melrose\", \"stokesian-dynamics\"]\ncontact = [\"rigid\", \"procedure\"]",
    );
    let undisturbed = directory_with(&all_solvers);
    sweep(undisturbed.path(), &["run", "small.toml", "--quiet"]).code(0);
    let disturbed = directory_with(&all_solvers);
    for (number, pause) in [30_u64, 90, 150, 60, 210].into_iter().enumerate() {
        let start = || {
            spawn(
                disturbed.path(),
                &["run", "small.toml", "--quiet", "--workers", "1"],
            )
        };
        let (mut one, mut two) = (start(), start());
        std::thread::sleep(Duration::from_millis(pause));
        one.kill().unwrap();
        if number % 2 == 0 {
            two.kill().unwrap();
        } else {
            send(&two, Signal::INT);
        }
        one.wait().unwrap();
        let code = two.wait().unwrap().code();
        assert!([None, Some(0), Some(130)].contains(&code), "{code:?}");
    }
    sweep(disturbed.path(), &["run", "small.toml", "--quiet"]).code(0);
    assert_eq!(results(disturbed.path()), results(undisturbed.path()));
}

#[test]
fn plan_writes_nothing() {
    let directory = directory();
    let output = sweep(directory.path(), &["plan", "small.toml", "--json"]).code(0);
    let plan: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert_eq!(plan["cases"], 4);
    assert_eq!(plan["axes"]["shear_rate"], serde_json::json!([0.1, "inf"]));
    assert!(plan["computing_time_s"].as_f64().unwrap() > 0.0);
    assert!(!directory.path().join("results").exists());
}

/// In published units the rate is that of the mean viscosity too.
fn converted_points_belong_to(points: &[serde_json::Value], at: &Path) {
    let number = |point: &serde_json::Value, name: &str| point[name].as_f64().unwrap();
    let output = sweep(at, &["convert", "small.toml", "--json"]).success();
    let converted: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    for (theirs, point) in converted["points"].as_array().unwrap().iter().zip(points) {
        let (rate, viscosity) = (number(point, "shear_rate"), number(point, "viscosity"));
        assert_eq!(number(theirs, "shear_rate"), rate);
        assert_eq!(number(theirs, "published_shear_rate"), rate);
        // One size: η' = 1 + 2 (η − 1 − 5c/3), and σ' belongs to it.
        let published = 1.0 + 2.0 * (viscosity - 1.0 - number(point, "area_fraction") * 5.0 / 3.0);
        assert!((number(theirs, "published_viscosity") / published - 1.0).abs() < 1e-12);
        let stress = published * rate / (6.0 * std::f64::consts::PI);
        assert!((number(theirs, "published_shear_stress") / stress - 1.0).abs() < 1e-12);
    }
}

#[test]
fn imposed_stress_has_its_rate_in_tables_samples_and_figures() {
    let imposed = CAMPAIGN.replace("shear_rate = [0.1, inf]", "shear_stress = [0.3, 3.0]");
    let directory = directory_with(&imposed);
    let at = directory.path();
    sweep(at, &["run", "small.toml", "--quiet"]).success();
    let output = sweep(at, &["report", "small.toml", "--json"]).success();
    let report: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    let points = report["points"].as_array().unwrap();
    assert_eq!(points.len(), 2);
    let number = |point: &serde_json::Value, name: &str| point[name].as_f64().unwrap();
    for (point, stress) in points.iter().zip([0.3, 3.0]) {
        assert_eq!(number(point, "shear_stress"), stress);
        let rate = 6.0 * std::f64::consts::PI * stress / number(point, "viscosity");
        assert!((number(point, "shear_rate") / rate - 1.0).abs() < 1e-12);
        for name in [
            "n1",
            "n2",
            "particle_pressure",
            "n1_ci95",
            "shear_tangential_contact",
        ] {
            assert!(point[name].is_number(), "{name}");
        }
        let parts = [
            "shear_hydrodynamic",
            "shear_normal_contact",
            "shear_tangential_contact",
            "shear_repulsion",
        ];
        let sum: f64 = parts.iter().map(|part| number(point, part)).sum();
        assert!((1.0 + sum - number(point, "viscosity")).abs() < 1e-12);
        assert_eq!(
            number(point, "n1"),
            number(point, "normal_stress_difference")
        );
    }
    converted_points_belong_to(points, at);
    let store = rusqlite::Connection::open(at.join("results/small.sqlite")).unwrap();
    let worst: f64 = store
        .query_row(
            "SELECT max(abs(s.viscosity * s.shear_rate / (6 * 3.141592653589793 * p.shear_stress) - 1))
             FROM samples s JOIN cases c ON c.id = s.case_id JOIN axes p ON p.id = c.point",
            [],
            |row| row.get(0),
        )
        .unwrap();
    assert!(worst < 1e-9, "{worst}");
    for figure in [
        ["flow.svg", "--kind", "flow-curve"],
        ["eta.svg", "--along", "shear_stress"],
        ["pressure.svg", "--quantity", "particle_pressure"],
    ] {
        let [file, option, value] = figure;
        sweep(
            at,
            &["report", "small.toml", "--figure", file, option, value],
        )
        .success();
        assert!(
            std::fs::read_to_string(at.join(file))
                .unwrap()
                .contains("<svg")
        );
    }
    // The rates that follow from the stresses have intervals.
    let flow = ["--figure", "f.svg", "--kind", "flow-curve"];
    sweep(at, &[&["report", "small.toml"], &flow[..]].concat()).success();
    let drawn = std::fs::read_to_string(at.join("f.svg")).unwrap();
    // A bar and two caps for each of two points.
    assert_eq!(drawn.matches("stroke-width=\"0.72\"").count(), 2 * (3 + 1));
    let output = sweep(
        at,
        &["report", "small.toml", "--columns", "n2,particle_pressure"],
    )
    .success();
    let text = String::from_utf8(output.get_output().stdout.clone()).unwrap();
    assert!(
        text.contains("particle_pressure") && text.contains("σ*") && !text.contains("approach"),
        "{text}"
    );
    // A stress without results has no rate, and no point in a flow curve.
    std::fs::write(
        at.join("small.toml"),
        imposed.replace("[0.3, 3.0]", "[0.3, 3.0, 30.0]"),
    )
    .unwrap();
    let flow = ["--figure", "flow.svg", "--kind", "flow-curve"];
    sweep(at, &[&["report", "small.toml"], &flow[..]].concat()).success();
    let drawn = std::fs::read_to_string(at.join("flow.svg")).unwrap();
    assert!(!drawn.contains("NaN"));
}

#[test]
fn runs_begin_where_those_of_another_store_ended() {
    let imposed = CAMPAIGN.replace("shear_rate = [0.1, inf]", "shear_stress = [0.3, 3.0]");
    let directory = directory_with(&imposed);
    let at = directory.path();
    sweep(at, &["run", "small.toml", "--quiet"]).success();
    // Continued from there, and reversed, seed by seed.
    let second = imposed
        .replace("\"small\"", "\"second\"")
        .replace("[0.3, 3.0]", "1.0\ndirection = [1, -1]\nstart = { store = \"results/small.sqlite\", point = { shear_stress = 3.0 } }");
    std::fs::write(at.join("second.toml"), &second).unwrap();
    sweep(at, &["run", "second.toml", "--quiet"]).success();
    let output = sweep(at, &["report", "second.toml", "--json"]).success();
    let report: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert_eq!(report["cases"]["done"], 4);
    // Each run has its own start layer, but those of one direction form one point.
    let points = report["points"].as_array().unwrap();
    assert_eq!(points.len(), 2);
    for point in points {
        assert_eq!(point["seeds"], 2);
        assert!(point["start"].as_u64().unwrap() > 0);
    }
    let second = second.replace("\"second\"", "\"third\"");
    for (from, to, said) in [
        (
            "stress = 3.0 }",
            "stress = 2.0 }",
            "finished runs there have `shear_stress` = 0.3, 3",
        ),
        (
            "point = { shear_stress = 3.0 }",
            "point = { shear_rate = 3.0 }",
            "finished runs there have no `shear_rate`",
        ),
        (
            ", point = { shear_stress = 3.0 }",
            "",
            "they differ in `shear_stress`",
        ),
        ("seeds = 2", "seeds = 3", "has seed 3"),
        ("spheres = ", "spheres = 1", "conflicts with `spheres`"),
        ("small.sqlite", "none.sqlite", "there is no such file"),
    ] {
        assert!(second.contains(from), "{from}: {second}");
        std::fs::write(at.join("third.toml"), second.replace(from, to)).unwrap();
        let refused = sweep(at, &["run", "third.toml"]).code(2);
        let message = String::from_utf8_lossy(&refused.get_output().stderr).replace("\n  │ ", " ");
        assert!(
            message.contains(said) && message.contains("third.toml:"),
            "{message}"
        );
        assert!(!at.join("results/third.sqlite").exists());
    }
}

#[test]
fn faults_of_a_file_follow_each_other_without_a_heading() {
    let wrong = CAMPAIGN
        .replace("friction = 0.3", "friction = -1")
        .replace("seeds = 2", "seeds = 2.5");
    let directory = directory_with(&wrong);
    let refused = sweep(directory.path(), &["plan", "small.toml"]).code(2);
    let said = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert_eq!(said.matches("× small.toml:").count(), 2, "{said}");
    assert!(!said.contains("Error:"), "{said}");
}

#[test]
fn overlaps_beyond_the_roughness_height_are_reported() {
    let springs = CAMPAIGN
        .replace(
            "shear_rate = [0.1, inf]",
            "shear_stress = 5.0\ncontact = \"linear-spring\"\nstiffness = [50.0, 100.0, 1e6]",
        )
        .replace("seeds = 2", "seeds = 1");
    let directory = directory_with(&springs);
    sweep(directory.path(), &["run", "small.toml", "--quiet"]).code(0);
    let said = sweep(directory.path(), &["report", "small.toml"]).code(0);
    let said = String::from_utf8(said.get_output().stdout.clone()).unwrap();
    let lines: Vec<&str> = said
        .lines()
        .filter(|line| line.contains("overlaps of up to"))
        .collect();
    let begins = "k 50 and 1 more point: overlaps of up to";
    assert!(lines.len() == 1 && lines[0].starts_with(begins), "{said}");
    // The only point has no name.
    let only = ["report", "small.toml", "--where", "stiffness=100"];
    let only = sweep(directory.path(), &only).code(0);
    let only = String::from_utf8(only.get_output().stdout.clone()).unwrap();
    assert!(only.contains("\noverlaps of up to"), "{only}");
    assert!(
        said.contains("largest\n") || said.contains("overlap"),
        "{said}"
    );
    let json = sweep(directory.path(), &["report", "small.toml", "--json"]).code(0);
    let json: serde_json::Value = serde_json::from_slice(&json.get_output().stdout).unwrap();
    for (point, soft) in json["points"]
        .as_array()
        .unwrap()
        .iter()
        .zip([true, true, false])
    {
        let (gap, overlap) = (&point["minimum_gap"], &point["overlap"]);
        let (gap, overlap) = (gap.as_f64().unwrap(), overlap.as_f64().unwrap());
        assert_eq!(overlap, 0.01 - gap);
        assert_eq!(overlap > 0.01, soft);
    }
}
