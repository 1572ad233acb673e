//! Interfaces of a run for programs: lines of JSON, a command at the end, a time limit.

use crate::harness::{folder, run};

const CAMPAIGN: &str = r#"name = "small"
[protocol]
time_step = 0.005
strain = 1.0
discard = 0.1
checkpoint_every = 0.02
[[grid]]
area_fraction = [0.5, 0.6]
friction = 0.3
roughness = 0.01
shear_rate = inf
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

fn directory() -> tempfile::TempDir {
    folder("small.toml", CAMPAIGN)
}

fn json(bytes: &[u8]) -> serde_json::Value {
    serde_json::from_slice(bytes).unwrap()
}

#[test]
fn every_line_of_progress_is_json_and_the_end_of_every_case_is_reported() {
    let directory = directory();
    let output = run(
        directory.path(),
        &["run", "small.toml", "--progress", "json", "--workers", "2"],
    );
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let lines: Vec<serde_json::Value> = String::from_utf8(output.stderr)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let ended: Vec<_> = lines
        .iter()
        .filter(|line| line["event"] == "ended")
        .collect();
    assert_eq!(ended.len(), 4);
    for line in ended {
        assert_eq!(line["state"], "done");
        assert!(line["cpu_time_s"].as_f64().unwrap() > 0.0);
        assert!((line["strain"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    }
    // What has ended before a line about the campaign is counted in it.
    let (mut so_far, mut done) = (0, 0);
    for line in &lines {
        match line["event"].as_str().unwrap() {
            "ended" => so_far += 1,
            "campaign" => {
                done = line["cases"]["done"].as_u64().unwrap();
                assert!(done >= so_far, "{line} after {so_far} ended");
            }
            _ => {}
        }
    }
    assert_eq!((done, so_far), (4, 4), "the last line is about the end");
    let last = lines.last().unwrap();
    assert_eq!(last["event"], "campaign");
    assert_eq!(last["cases"]["running"], 0);
    assert!(last["work_done"].as_f64().unwrap() > 0.999, "{last}");
}

#[test]
fn time_limit_checkpoints_and_the_same_command_continues() {
    let directory = directory();
    let limited = run(
        directory.path(),
        &[
            "run",
            "small.toml",
            "--quiet",
            "--workers",
            "1",
            "--time-limit",
            "50ms",
        ],
    );
    assert_eq!(limited.status.code(), Some(4), "{limited:?}");
    let status = json(&run(directory.path(), &["status", "small.toml", "--json"]).stdout);
    assert!(status["cases"]["pending"].as_u64().unwrap() > 0);
    assert!(status["remaining_cpu_s"].as_f64().unwrap() > 0.0);
    let rest = run(
        directory.path(),
        &["run", "small.toml", "--quiet", "--time-limit", "1h"],
    );
    assert_eq!(rest.status.code(), Some(0), "{rest:?}");
    let status = json(&run(directory.path(), &["status", "small.toml", "--json"]).stdout);
    assert_eq!(status["remaining_cpu_s"], 0.0);
    let wrong = run(
        directory.path(),
        &["run", "small.toml", "--time-limit", "soon"],
    );
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("90s, 15m or 2h"));
}

#[test]
fn plan_leaves_out_what_is_done_and_knows_of_trajectories() {
    let directory = directory();
    let plan = |arguments: &[&str]| {
        let mut all = vec!["plan", "small.toml", "--json"];
        all.extend(arguments);
        json(&run(directory.path(), &all).stdout)
    };
    let before = plan(&[]);
    assert_eq!((&before["cases"], &before["ended"]), (&4.into(), &0.into()));
    assert!(before["computing_time_s"].as_f64().unwrap() > 0.0);
    let disk = |plan: &serde_json::Value| plan["disk_bytes"].as_f64().unwrap();
    let memory = before["memory_bytes"].as_f64().unwrap();
    assert!((8e6..40e6).contains(&memory), "{memory}");
    assert!(disk(&plan(&["--trajectory"])) > 2.0 * disk(&before));
    let run = run(directory.path(), &["run", "small.toml", "--quiet"]);
    assert_eq!(run.status.code(), Some(0), "{run:?}");
    let after = plan(&[]);
    assert_eq!((&after["cases"], &after["ended"]), (&4.into(), &4.into()));
    assert_eq!(after["computing_time_s"], 0.0);
}
