//! Suspensions in a campaign: from the file to the report, interrupted and resumed.

use crate::harness::{command, folder, refused, send, spawn};
use assert_cmd::Command;
use rustix::process::Signal;
use std::path::Path;
use std::time::Duration;

const CAMPAIGN: &str = r#"name = "bulk"
[protocol]
strain = 0.1
discard = 0.0
checkpoint_every = 0.02
[[grid]]
volume_fraction = [0.3, 0.45]
friction = 0.5
roughness = 0.01
shear_rate = inf
seeds = 1
spheres = 60
hydrodynamics = "ball-melrose"
tangential = "coulomb"
contact = "rigid"
[[grid]]
volume_fraction = 0.4
friction = 0.5
roughness = 0.01
shear_rate = 1
seeds = 1
spheres = 60
hydrodynamics = "lubrication"
contact = "linear-spring"
tangential = "stick-slide"
stiffness = 1e4
"#;

fn sweep(directory: &Path, arguments: &[&str]) -> Vec<u8> {
    let done = Command::from_std(command(directory, arguments))
        .assert()
        .code(0);
    done.get_output().stdout.clone()
}

fn json(directory: &Path, arguments: &[&str]) -> serde_json::Value {
    serde_json::from_slice(&sweep(directory, arguments)).unwrap()
}

/// The samples and the last states of all runs.
fn results(directory: &Path) -> Vec<Vec<rusqlite::types::Value>> {
    let store = rusqlite::Connection::open(directory.join("results/bulk.sqlite")).unwrap();
    let query = "SELECT c.key, s.step, s.viscosity, s.viscosity_stresslet, s.normal_stress_difference, s.contacts, s.minimum_gap
         FROM samples s JOIN cases c ON c.id = s.case_id ORDER BY c.key, s.step";
    let mut statement = store.prepare(query).unwrap();
    let rows = statement
        .query_map([], |row| (0..7).map(|n| row.get(n)).collect())
        .unwrap();
    rows.map(Result::unwrap).collect()
}

#[test]
fn interrupted_suspensions_end_with_the_bits_of_undisturbed_ones() {
    let undisturbed = folder("bulk.toml", CAMPAIGN);
    sweep(
        undisturbed.path(),
        &["run", "bulk.toml", "--quiet", "--trajectory"],
    );
    let disturbed = folder("bulk.toml", CAMPAIGN);
    for (number, pause) in [150_u64, 400, 900].into_iter().enumerate() {
        let mut process = spawn(
            disturbed.path(),
            &["run", "bulk.toml", "--quiet", "--workers", "1"],
        );
        std::thread::sleep(Duration::from_millis(pause));
        if number == 1 {
            process.kill().unwrap();
        } else {
            send(&process, Signal::INT);
        }
        process.wait().unwrap();
    }
    sweep(disturbed.path(), &["run", "bulk.toml", "--quiet"]);
    let results = results(disturbed.path());
    assert_eq!(results.len(), 3 * 5);
    assert_eq!(results, self::results(undisturbed.path()));

    let directory = undisturbed.path();
    let report = json(directory, &["report", "results/bulk.sqlite", "--json"]);
    let points = report["points"].as_array().unwrap();
    let fractions: Vec<f64> = points
        .iter()
        .map(|point| point["volume_fraction"].as_f64().unwrap())
        .collect();
    assert_eq!(fractions, [0.3, 0.45, 0.4]);
    for point in points {
        assert!(point["area_fraction"].is_null(), "{point}");
        let dilute = 1.0 + 2.5 * point["volume_fraction"].as_f64().unwrap();
        assert!(point["viscosity"].as_f64().unwrap() > dilute, "{point}");
    }
    let one = json(
        directory,
        &[
            "report",
            "results/bulk.sqlite",
            "--json",
            "--where",
            "phi=0.45",
        ],
    );
    assert_eq!(one["points"].as_array().unwrap().len(), 1);

    let frames =
        String::from_utf8(sweep(directory, &["export", "results/bulk.sqlite", "1"])).unwrap();
    let lines: Vec<&str> = frames.lines().collect();
    assert_eq!(lines[0], "60");
    assert!(lines[1].contains("pbc=\"T T T\""), "{}", lines[1]);
    assert!(lines[1].contains("volume_fraction=0.3"), "{}", lines[1]);
    assert!(!lines[1].contains("area_fraction"), "{}", lines[1]);
    let last: Vec<f64> = lines[lines.len() - 1]
        .split(' ')
        .skip(1)
        .map(|cell| cell.parse().unwrap())
        .collect();
    // Position, number, radius, quaternion, stresslet, contacts, velocity, angular velocity,
    // unwrapped position.
    assert_eq!(last.len(), 3 + 1 + 1 + 4 + 5 + 1 + 3 + 3 + 3);
    let quaternion: f64 = last[5..9].iter().map(|x| x * x).sum();
    assert!((quaternion - 1.0).abs() < 1e-6, "{quaternion}");
}

#[test]
fn what_is_no_suspension_is_refused_at_its_line_and_nothing_is_written() {
    for (from, to, place, remedy) in [
        (
            "friction = 0.5",
            "friction = 0.5\narea_fraction = 0.6",
            "bulk.toml:9:17",
            "either of the two: a layer or a suspension",
        ),
        (
            "[0.3, 0.45]",
            "[0.3, 0.7]",
            "bulk.toml:7:25",
            "from 0.01 to 0.64",
        ),
        (
            "[0.3, 0.45]",
            "[0.3, 0.64]",
            "bulk.toml:7:25",
            "at most 0.635 at this roughness",
        ),
        (
            "spheres = 60",
            "spheres = 20",
            "bulk.toml:12:11",
            "at least",
        ),
        (
            "tangential = \"coulomb\"\ncontact = \"rigid\"",
            "contact = \"procedure\"",
            "bulk.toml:14:11",
            "\"rigid\" or a law",
        ),
    ] {
        let folder = folder("bulk.toml", &CAMPAIGN.replacen(from, to, 1));
        let at = folder.path();
        for command in ["plan", "run"] {
            let error = refused(at, &[command, "bulk.toml"]);
            assert!(error.contains(place), "{to}: {error}");
            assert!(error.contains(remedy), "{to}: {error}");
        }
        let written: Vec<_> = std::fs::read_dir(at)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        assert_eq!(written, ["bulk.toml"], "{to}");
    }
}

#[test]
fn centres_and_cell_of_other_spaces_are_refused() {
    for (centres, cell) in [
        ("[[0, 0], [3, 0]]", "[20, 20, 20]"),
        ("[[0, 0, 0], [3, 0, 0]]", "[20, 20]"),
    ] {
        let text = format!(
            "{{\"centres\": {centres},\n\"cell\": {cell},\n\"hydrodynamics\": \"ball-melrose\"}}"
        );
        let folder = folder("in.json", &text);
        let error = refused(folder.path(), &["solve", "in.json"]);
        assert!(error.contains("in.json:2:"), "{error}");
        assert!(error.contains("give all vectors"), "{error}");
    }
}

#[test]
fn published_units_of_suspensions_leave_out_the_isolated_stresslets() {
    let directory = folder("bulk.toml", CONVERTED);
    let at = directory.path();
    sweep(at, &["run", "bulk.toml", "--quiet"]);
    let [ours, theirs] = ["report", "convert"].map(|command| {
        let answer = json(at, &[command, "bulk.toml", "--json"]);
        answer["points"][0].clone()
    });
    let of = |point: &serde_json::Value, name: &str| point[name].as_f64().unwrap();
    let expected = of(&ours, "viscosity") - 2.5 * 0.3;
    assert!((of(&theirs, "published_viscosity") / expected - 1.0).abs() < 1e-12);
    let [ours, theirs] = [
        of(&ours, "viscosity_ci95"),
        of(&theirs, "published_viscosity_ci95"),
    ];
    assert_eq!(ours, theirs);
}

const CONVERTED: &str = r#"name = "bulk"
[protocol]
strain = 0.1
discard = 0.0
[[grid]]
volume_fraction = 0.3
friction = 0.3
roughness = 0.01
shear_rate = 1.0
seeds = 2
spheres = 60
hydrodynamics = "ball-melrose"
"#;
