//! Versions of a campaign file: two versions on one store, longer and shorter runs, stores of older
//! schemas.

use crate::harness::{command, json, run, spawn, until};
use rusqlite::types::Value;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value as Json;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

const CAMPAIGN: &str = r#"name = "small"
[protocol]
strain = 0.4
discard = 0.1
checkpoint_every = 0.02
[[grid]]
area_fraction = 0.65
friction = 0.3
roughness = 0.01
shear_rate = [0.1, 1.0]
seeds = 2
spheres = 20
hydrodynamics = "ball-melrose"
"#;

/// The output of a command that ended with this code.
fn said(directory: &Path, arguments: &[&str], code: i32) -> (String, String) {
    let output = run(directory, arguments);
    assert_eq!(output.status.code(), Some(code), "{output:?}");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (text(output.stdout), text(output.stderr))
}

fn write(directory: &Path, file: &str, text: &str) {
    let path = directory.join(file);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
}

/// All that was computed of each run, in the order of the keys; averages follow the request.
fn computed(store: &Path) -> Vec<Vec<Value>> {
    let store = rusqlite::Connection::open(store).unwrap();
    let mut all = Vec::new();
    for query in [
        "SELECT c.key, s.* FROM samples s JOIN cases c ON c.id = s.case_id ORDER BY c.key, s.step",
        "SELECT c.key, c.state, c.steps_done, r.discard_step, r.viscosity, r.viscosity_median, r.viscosity_stresslet,
             r.contacts, r.stages, r.unconverged_stages, r.worst_residual, r.worst_friction_error, r.minimum_gap,
             r.jam_events, r.jammed_strain, r.final_strain
         FROM results r JOIN cases c ON c.id = r.case_id ORDER BY c.key",
        "SELECT c.key, r.computed, r.jammed, r.counters
         FROM results r JOIN cases c ON c.id = r.case_id ORDER BY c.key",
    ] {
        let mut statement = store.prepare(query).unwrap();
        let names: Vec<String> = statement.column_names().map(String::from).collect();
        let rows = statement
            .query_map([], |row| {
                (0..names.len())
                    .filter(|column| names[*column] != "case_id")
                    .map(|column| row.get(column))
                    .collect()
            })
            .unwrap();
        all.extend(rows.map(Result::unwrap));
    }
    all
}

/// What the live page's server wrote on standard error until it said its address.
fn said_by_the_server(directory: &Path, file: &str) -> String {
    let mut server = command(directory, &["serve", file, "--listen", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut address = String::new();
    BufReader::new(server.stdout.take().unwrap())
        .read_line(&mut address)
        .unwrap();
    server.kill().unwrap();
    let output = server.wait_with_output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert!(address.contains("http://127.0.0.1:"), "{address}{err}");
    err
}

#[test]
fn report_and_status_show_the_request_of_the_file_and_name_the_last_run_version() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    write(at, "small.toml", CAMPAIGN);
    said(at, &["run", "small.toml", "--quiet", "--trajectory"], 0);
    let (_, err) = said(at, &["show", "small.toml", "1"], 0);
    assert_eq!(err, "");
    let first = json(at, &["report", "small.toml"]);
    // A copy under the same name, with another grid: one point is common.
    write(
        at,
        "copy.toml",
        &CAMPAIGN.replace("[0.1, 1.0]", "[1.0, inf, 10.0]"),
    );
    let store = "results/small.sqlite";
    let (_, err) = said(at, &["run", "copy.toml", "--store", store], 0);
    for part in [
        "copy.toml",
        "copy.toml differs from the last campaign in small.sqlite: 4 new runs, 2 reused, 0 extended",
        "2 runs in",
        "belong to other versions of the campaign",
        "sweep prune",
    ] {
        assert!(err.contains(part), "{part} not in {err}");
    }
    // What was a result of the first file still is one.
    let (out, err) = said(at, &["report", "small.toml", "--json"], 0);
    let again: Json = serde_json::from_str(&out).unwrap();
    assert_eq!(again["cases"], first["cases"]);
    assert_eq!(again["points"], first["points"]);
    assert!(
        err.contains("another version") && err.contains("copy.toml"),
        "{err}"
    );
    // So do all other readers, without mixing it into their output.
    let (out, _) = said(at, &["show", "small.toml", "1", "--json"], 0);
    assert!(serde_json::from_str::<Json>(&out).is_ok(), "{out}");
    for (arguments, code) in [
        (["show", "small.toml", "1"].as_slice(), 0),
        (&["export", "small.toml", "1"], 0),
        (&["replay", "small.toml"], 2),
    ] {
        let (out, err) = said(at, arguments, code);
        assert!(
            err.contains("another version") && err.contains("copy.toml"),
            "{arguments:?}: {err}"
        );
        assert!(!out.contains("another version"), "{arguments:?}: {out}");
        let quiet = [arguments, &["--quiet"]].concat();
        let (_, err) = said(at, &quiet, code);
        assert!(!err.contains("another version"), "{quiet:?}: {err}");
    }
    let err = said_by_the_server(at, "small.toml");
    assert!(
        err.contains("another version") && err.contains("copy.toml"),
        "{err}"
    );
    let status = json(at, &["status", "small.toml"]);
    assert_eq!(status["cases"]["done"], 4);
    assert_eq!(status["orphans"], 4);
    let last = status["last_run_with"].as_str().unwrap();
    assert_eq!(
        Path::new(last).canonicalize().unwrap(),
        at.join("copy.toml").canonicalize().unwrap()
    );
    let (text, _) = said(at, &["status", "small.toml"], 0);
    assert!(
        text.contains("another version") && text.contains("sweep prune"),
        "{text}"
    );
    // Points that were never computed are present and pending.
    write(
        at,
        "small.toml",
        &CAMPAIGN.replace("[0.1, 1.0]", "[0.1, 3.0]"),
    );
    let wider = json(at, &["report", "small.toml"]);
    assert_eq!(
        (&wider["cases"]["done"], &wider["cases"]["pending"]),
        (&2.into(), &2.into())
    );
    assert_eq!(wider["points"][1]["shear_rate"], 3.0);
    // The store itself is shown as last run.
    assert_eq!(json(at, &["report", store])["cases"]["done"], 6);
}

#[test]
fn second_of_two_simultaneous_campaigns_of_one_name_is_refused_without_loss() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let long = CAMPAIGN.replace("strain = 0.4", "strain = 4.0");
    write(at, "sweeps/one.toml", &long);
    write(at, "sweeps/two.toml", &long.replace("[0.1, 1.0]", "[inf]"));
    let first = command(at, &["run", "sweeps/one.toml", "--workers", "1"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let store = at.join("results/small.sqlite");
    let running = || {
        let running = rusqlite::Connection::open(&store).and_then(|store| {
            store.query_row(
                "SELECT count(*) FROM cases WHERE state = 'running'",
                [],
                |row| row.get::<_, i64>(0),
            )
        });
        running.unwrap_or(0) > 0
    };
    until("a case that runs", || {
        (store.exists() && running()).then_some(())
    });
    let (_, err) = said(at, &["run", "sweeps/two.toml"], 2);
    let err = err.replace(['\n', '│'], " ");
    let words: Vec<&str> = err.split_whitespace().collect();
    let err = words.join("");
    assert!(
        err.contains("one.toml") && err.contains("two.toml"),
        "{err}"
    );
    assert!(err.contains("nothingwaschanged"), "{err}");
    let done = first.wait_with_output().unwrap();
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    assert!(
        String::from_utf8_lossy(&done.stdout).contains("4 of 4 cases done"),
        "{done:?}"
    );
    // One after the other is allowed.
    let (out, _) = said(at, &["run", "sweeps/two.toml"], 0);
    assert!(out.contains("2 of 2 cases done"), "{out}");
    assert_eq!(json(at, &["report", "sweeps/one.toml"])["cases"]["done"], 4);
}

#[test]
fn prune_prompts_and_removes_runs_that_are_not_in_the_file() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    write(at, "small.toml", CAMPAIGN);
    said(at, &["run", "small.toml", "--quiet", "--trajectory"], 0);
    let (out, _) = said(at, &["prune", "small.toml"], 0);
    assert!(out.contains("nothing to remove"), "{out}");
    write(at, "small.toml", &CAMPAIGN.replace("[0.1, 1.0]", "[1.0]"));
    let store = at.join("results/small.sqlite");
    let before = std::fs::metadata(&store).unwrap().len();
    let (_, err) = said(at, &["prune", "small.toml"], 2);
    assert!(
        err.contains("--yes") && err.contains("nothing was"),
        "{err}"
    );
    assert_eq!(std::fs::metadata(&store).unwrap().len(), before);
    let pruned = json(at, &["prune", "small.toml", "--yes"]);
    assert_eq!(pruned["removed"], 2);
    assert!(std::fs::metadata(&store).unwrap().len() < before);
    assert_eq!(json(at, &["report", "small.toml"])["cases"]["done"], 2);
    let (out, _) = said(at, &["run", "small.toml"], 0);
    assert!(out.contains("2 of 2 cases done"), "{out}");
}

/// A campaign of every kind of run, of this length.
fn all_kinds(strain: &str) -> String {
    format!(
        r#"name = "small"
[protocol]
strain = {strain}
discard = 0.5
checkpoint_every = 0.02
[[grid]]
area_fraction = 0.65
friction = 0.3
roughness = 0.01
shear_rate = 10.0
seeds = 1
spheres = 16
hydrodynamics = ["ball-melrose", "stokesian-dynamics"]
contact = ["rigid", "procedure"]
[[grid]]
area_fraction = 0.65
friction = 0.3
roughness = 0.01
shear_rate = 10.0
seeds = 1
spheres = 16
hydrodynamics = ["ball-melrose", "stokesian-dynamics"]
contact = "linear-spring"
tangential = "stick-slide"
stiffness = 1e4
"#
    )
}

#[test]
fn a_run_continued_from_1_to_2_strains_has_the_bits_of_a_run_of_2() {
    let (continued, whole) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let store = |directory: &tempfile::TempDir| directory.path().join("results/small.sqlite");
    write(whole.path(), "small.toml", &all_kinds("2.0"));
    said(whole.path(), &["run", "small.toml", "--quiet"], 0);
    write(continued.path(), "small.toml", &all_kinds("1.0"));
    said(continued.path(), &["run", "small.toml", "--quiet"], 0);
    let short = computed(&store(&continued));
    write(continued.path(), "small.toml", &all_kinds("2.0"));
    // Interrupted, and killed, on the way from 1 to 2.
    for signal in [Signal::INT, Signal::KILL, Signal::INT] {
        let mut child = spawn(
            continued.path(),
            &["run", "small.toml", "--quiet", "--workers", "1"],
        );
        std::thread::sleep(Duration::from_millis(300));
        let _ = kill_process(Pid::from_child(&child), signal);
        child.wait().unwrap();
    }
    said(continued.path(), &["run", "small.toml", "--quiet"], 0);
    assert_eq!(computed(&store(&continued)), computed(&store(&whole)));
    // Only the loss at a signal was computed twice: every run continued from a strain of 1.
    let resumed: i64 = rusqlite::Connection::open(store(&continued))
        .unwrap()
        .query_row("SELECT min(resumed) FROM results", [], |row| row.get(0))
        .unwrap();
    assert!(resumed >= 1, "{resumed}");
    // And back: of a run of 2 strains the first is a run of 1.
    let text = |directory: &tempfile::TempDir| {
        let report = json(directory.path(), &["report", "small.toml"]);
        let points = report["points"].as_array().unwrap().clone();
        let names = [
            "viscosity",
            "viscosity_median",
            "viscosity_stresslet",
            "normal_stress_difference",
            "contacts_per_sphere",
        ];
        points
            .iter()
            .map(|point| {
                let numbers = names.map(|name| point[name].clone());
                assert!(!numbers.contains(&Json::Null), "{names:?}: {point}");
                numbers
            })
            .collect::<Vec<_>>()
    };
    write(whole.path(), "small.toml", &all_kinds("1.0"));
    let cut = text(&whole);
    said(whole.path(), &["run", "small.toml", "--quiet"], 0);
    assert_eq!(text(&whole), cut);
    let fresh = tempfile::tempdir().unwrap();
    write(fresh.path(), "small.toml", &all_kinds("1.0"));
    said(fresh.path(), &["run", "small.toml", "--quiet"], 0);
    assert_eq!(computed(&store(&fresh)), short);
    assert_eq!(text(&fresh), cut);
    // Nothing of the longer run is lost by that.
    write(whole.path(), "small.toml", &all_kinds("2.0"));
    said(whole.path(), &["run", "small.toml", "--quiet"], 0);
    assert_eq!(computed(&store(&continued)), computed(&store(&whole)));
}
