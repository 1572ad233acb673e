//! The program as a user meets it: bad input, exit codes, output. Nothing here needs long physics.
#![expect(
    clippy::unwrap_used,
    reason = "tests: a panic is the failure, and names state the fact"
)]

use assert_cmd::Command;
use std::path::Path;

const CAMPAIGN: &str = r#"name = "small"
[protocol]
strain = 0.1
discard = 0.0
[[grid]]
area_fraction = 0.6
friction = 0.3
roughness = 0.01
shear_rate = [0.1, inf]
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

fn sweep(directory: &Path) -> Command {
    let mut command = Command::cargo_bin("sweep").unwrap();
    command.current_dir(directory).env("NO_COLOR", "1");
    command
}

/// Files below a directory.
fn files(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn bad_campaign_ends_with_2_names_its_place_and_writes_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let bad = CAMPAIGN.replace("area_fraction = 0.6", "area_fraction = 0.9");
    std::fs::write(directory.path().join("bad.toml"), bad).unwrap();
    for subcommand in ["run", "plan"] {
        let output = sweep(directory.path())
            .args([subcommand, "bad.toml"])
            .assert()
            .code(2)
            .stdout("");
        let error = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
        for part in [
            "bad.toml:6:17",
            "0.9",
            "at most 0.84",
            "area_fraction = 0.9",
        ] {
            assert!(error.contains(part), "{part} not in {error}");
        }
        assert!(error.lines().count() < 24, "one screen: {error}");
    }
    assert_eq!(files(directory.path()), ["bad.toml"]);
}

#[test]
fn unwritable_store_ends_with_2() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("small.toml"), CAMPAIGN).unwrap();
    for place in [
        "/proc/none/small.sqlite",
        "small.toml/x.sqlite",
        "small.toml",
    ] {
        sweep(directory.path())
            .args(["run", "small.toml", "--store", place])
            .assert()
            .code(2)
            .stdout("");
    }
    assert_eq!(files(directory.path()), ["small.toml"]);
    assert_eq!(
        std::fs::read_to_string(directory.path().join("small.toml")).unwrap(),
        CAMPAIGN
    );
}

#[test]
fn missing_files_and_wrong_arguments_end_with_2() {
    let directory = tempfile::tempdir().unwrap();
    for arguments in [
        &["run", "none.toml"][..],
        &["report", "none.sqlite"],
        &["status", "none.sqlite"],
        &["solve", "none.json"],
        &["scalars", "--size-ratio", "1", "--separation", "2"],
        &["scalars", "--size-ratio", "nan", "--separation", "3"],
        &["pair", "--roughness", "-1"],
        &["pair", "--time-step", "nan"],
        &["walk"],
        &[],
    ] {
        sweep(directory.path())
            .args(arguments)
            .assert()
            .code(2)
            .stdout("");
    }
    assert!(files(directory.path()).is_empty());
}

#[test]
fn solve_refuses_strange_json() {
    let directory = tempfile::tempdir().unwrap();
    for text in [
        r#"{"centres": [[0, 0]], "hydrodynamics": "ball-melrose", "center": 1}"#,
        r#"{"centres": [[0, 0]], "hydrodynamics": "stokes"}"#,
        r#"{"centres": [[0, 0]], "hydrodynamics": "ball-melrose", "radii": [1, 1]}"#,
        r#"{"centres": [], "hydrodynamics": "ball-melrose"}"#,
        r#"{"centres": [[0, 0]], "hydrodynamics": "ball-melrose", "cell": [-1, 3]}"#,
        "",
    ] {
        sweep(directory.path())
            .args(["solve", "-", "--json"])
            .write_stdin(text)
            .assert()
            .code(2)
            .stdout("");
    }
}

#[test]
fn scalars_print_one_object_as_promised() {
    let directory = tempfile::tempdir().unwrap();
    let output = sweep(directory.path())
        .args([
            "scalars",
            "--size-ratio",
            "1",
            "--separation",
            "3",
            "--json",
        ])
        .assert()
        .success();
    let object: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert_eq!(object["s_prime"], 3.0);
    for name in ["XA", "YA", "YB", "YC", "XG", "YG", "YH", "XM", "YM", "ZM"] {
        assert_eq!(object[name].as_array().unwrap().len(), 2, "{name}");
    }
}

#[test]
fn completions_are_written_for_every_shell() {
    let directory = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = sweep(directory.path())
            .args(["completions", shell])
            .assert()
            .success();
        assert!(output.get_output().stdout.len() > 500);
    }
}

#[test]
fn help_is_what_it_was() {
    let directory = tempfile::tempdir().unwrap();
    let mut all = String::new();
    for subcommand in [
        "", "plan", "run", "submit", "merge", "cancel", "status", "report", "show", "export",
        "serve", "replay", "salvage", "verify", "solve", "scalars", "pair",
    ] {
        let mut command = sweep(directory.path());
        command.env("COLUMNS", "100");
        if !subcommand.is_empty() {
            command.arg(subcommand);
        }
        let output = command.arg("--help").assert().success();
        all.push_str(&String::from_utf8_lossy(&output.get_output().stdout));
        all.push_str("\n────────\n");
    }
    insta::assert_snapshot!(all);
}
