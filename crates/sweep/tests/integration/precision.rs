//! A campaign with a requested precision: it ends by itself, and gives the same bits however often
//! it is interrupted.

use crate::harness::{folder, json, spawn, sweep};
use std::path::Path;
use std::time::Duration;

const CAMPAIGN: &str = r#"name = "precise"
[protocol]
strain = 0.6
discard = 0.2
checkpoint_every = 0.02
[[grid]]
area_fraction = [0.3, 0.6]
friction = 0.3
roughness = 0.01
shear_rate = inf
seeds = { precision = 0.1, at_least = 3, at_most = 12 }
spheres = 20
hydrodynamics = "ball-melrose"
"#;

fn directory() -> tempfile::TempDir {
    folder("precise.toml", CAMPAIGN)
}

/// The points of the report without what depends on the clock.
fn table(directory: &Path) -> Vec<serde_json::Value> {
    let mut report = json(directory, &["report", "precise.toml"]);
    let mut points = report["points"].take();
    let points = points.as_array_mut().unwrap();
    for point in points.iter_mut() {
        let point = point.as_object_mut().unwrap();
        point.remove("wall_time_s");
        point.remove("cpu_time_s");
    }
    std::mem::take(points)
}

#[test]
fn interrupted_campaign_ends_with_the_table_of_the_undisturbed_one() {
    let undisturbed = directory();
    sweep(
        undisturbed.path(),
        &["run", "precise.toml", "--quiet", "--workers", "1"],
    );
    let expected = table(undisturbed.path());
    assert_eq!(expected.len(), 2);
    for point in &expected {
        let seeds = point["seeds_wanted"].as_u64().unwrap();
        assert_eq!(point["seeds"].as_u64(), Some(seeds));
        assert!((5..=12).contains(&seeds), "{point}");
        let reached = point["precision"].as_f64().unwrap();
        assert!(reached <= 0.1 || seeds == 12, "{point}");
    }
    let disturbed = directory();
    for wait in [300, 700] {
        let mut child = spawn(
            disturbed.path(),
            &["run", "precise.toml", "--quiet", "--workers", "2"],
        );
        std::thread::sleep(Duration::from_millis(wait));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    sweep(
        disturbed.path(),
        &["run", "precise.toml", "--quiet", "--workers", "2"],
    );
    assert_eq!(table(disturbed.path()), expected);
}

#[test]
fn store_with_pruned_runs_continues() {
    let directory = directory();
    let at = directory.path();
    let (file, quiet) = (at.join("precise.toml"), ["run", "precise.toml", "--quiet"]);
    sweep(at, &quiet);
    let expected = table(at);
    std::fs::write(&file, CAMPAIGN.replace("[0.3, 0.6]", "[0.6]")).unwrap();
    let pruned = json(at, &["prune", "precise.toml", "--yes"]);
    assert!(pruned["removed"].as_u64() >= Some(3), "{pruned}");
    // Seeds that were not needed keep their position.
    sweep(at, &quiet);
    assert_eq!(table(at)[..], expected[1..]);
    std::fs::write(&file, CAMPAIGN).unwrap();
    sweep(at, &quiet);
    assert_eq!(table(at), expected);
}
