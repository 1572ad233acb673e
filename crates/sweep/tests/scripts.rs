//! The scripts, as far as they can be tried without doing their work.
#![cfg(unix)]
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests: a panic is the failure, and names state the fact"
)]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the scripts.
fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts")
}

#[test]
fn every_script_can_be_read() {
    for entry in std::fs::read_dir(scripts()).unwrap() {
        let path = entry.unwrap().path();
        let status = Command::new("bash").arg("-n").arg(&path).status();
        assert!(status.unwrap().success(), "{}", path.display());
    }
}

#[test]
fn unknown_parts_of_the_bench_are_refused_before_anything_is_measured() {
    let output = Command::new(scripts().join("bench"))
        .args(["profile", "speed"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("no part speed"), "{told}");
}

#[test]
fn a_program_that_needs_libraries_is_not_released() {
    if Command::new("python3").arg("--version").output().is_err() {
        return; // The script says that it needs it.
    }
    let directory = tempfile::tempdir().unwrap();
    let output = Command::new(scripts().join("release"))
        .arg(directory.path())
        .env("PROGRAM", env!("CARGO_BIN_EXE_sweep"))
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("needs libraries where it runs"), "{told}");
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
}

#[test]
fn the_released_program_is_below_20_megabytes() {
    if cfg!(debug_assertions) {
        return; // Only the release profile is small.
    }
    let size = std::fs::metadata(env!("CARGO_BIN_EXE_sweep"))
        .unwrap()
        .len();
    assert!(size < 20_000_000, "{size} bytes");
}

#[test]
fn the_python_package_is_compiled_as_the_program_is() {
    let levels = |manifest: &str| {
        let text = std::fs::read_to_string(scripts().join(manifest)).unwrap();
        let manifest: toml::Table = toml::from_str(&text).unwrap();
        manifest["profile"]["release"]["package"]
            .as_table()
            .unwrap()
            .clone()
    };
    let of_python = levels("../python/Cargo.toml");
    for (package, level) in levels("../Cargo.toml") {
        for (key, value) in level.as_table().unwrap() {
            assert_eq!(of_python[&package].get(key), Some(value), "{package}");
        }
    }
}

#[test]
fn every_campaign_has_its_published_results() {
    let sweeps = scripts().join("../sweeps");
    let published = std::fs::read_to_string(scripts().join("published")).unwrap();
    for entry in std::fs::read_dir(sweeps).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let name = name.strip_suffix(".toml").unwrap_or_default();
        assert!(name == "quickstart" || published.contains(name), "{name}");
    }
}

/// What the tables of the published results say: name, physics, and whether it is called stale.
fn published(readme: &str) -> Vec<(String, u32, bool)> {
    let rows = readme.lines().filter(|line| line.starts_with("| "));
    rows.filter_map(|line| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [name, .., last] = cells.as_slice() else {
            return None;
        };
        let (physics, stale) = match last.strip_suffix(", stale") {
            Some(physics) => (physics, true),
            None => (*last, false),
        };
        let is_made = cells.len() == 4 && cells[1].starts_with('`');
        is_made.then(|| {
            let physics = physics.parse();
            let physics = physics.unwrap_or_else(|_| panic!("no physics of {name}: {line}"));
            (name.trim_matches('`').to_owned(), physics, stale)
        })
    })
    .collect()
}

/// Versions of the physics that a printed report names.
fn physics_of(report: &str) -> Vec<u32> {
    let after = report.split("(physics ").skip(1);
    let digits = after.map(|text| text.split(',').next().unwrap_or_default());
    digits.map(|number| number.parse().unwrap()).collect()
}

#[test]
fn published_results_of_older_physics_are_called_stale() {
    let folder = scripts().join("../results/published");
    let readme = std::fs::read_to_string(folder.join("README.md")).unwrap();
    let rows = published(&readme);
    for (name, physics, stale) in &rows {
        let is_older = *physics < sweep::case::PHYSICS_VERSION;
        assert_eq!(
            is_older,
            *stale,
            "{name} was made by physics {physics}, and the program has {}: make it again with scripts/published, or say so in the \
             table of results/published/README.md",
            sweep::case::PHYSICS_VERSION
        );
        // What a report says of itself is what counts.
        if let Ok(report) = std::fs::read_to_string(folder.join(format!("{name}.txt"))) {
            let oldest = physics_of(&report).into_iter().min();
            assert_eq!(oldest, Some(*physics), "{name}.txt");
        }
    }
    for entry in std::fs::read_dir(&folder).unwrap() {
        let file = entry.unwrap().file_name().into_string().unwrap();
        let is_listed = rows
            .iter()
            .any(|(name, ..)| file.starts_with(name.as_str()));
        assert!(
            is_listed || file == "README.md",
            "{file} is in no table of results/published/README.md"
        );
    }
    let made = std::fs::read_to_string(scripts().join("published")).unwrap();
    let all = made.lines().find_map(|line| line.strip_prefix("all=("));
    for name in all.unwrap().trim_end_matches(')').split(' ') {
        assert!(rows.iter().any(|row| row.0 == name), "{name}");
    }
}
