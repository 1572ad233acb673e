//! What is published of results: its tables are what the CSV files give, and its sentences quote these tables.
//!
//! `scripts/published --tables` writes the tables anew, by the first test here; `scripts/published --check` says what was made by older
//! physics.
#![cfg(unix)]
#![expect(
    clippy::unwrap_used,
    reason = "tests: a panic is the failure, and names state the fact"
)]

mod beside;
mod numbers;
mod pivot;
mod quoted;
mod table;
mod thickening;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn folder() -> PathBuf {
    root().join("results/published")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// The rows of a CSV file.
fn rows<T: for<'row> serde::Deserialize<'row>>(path: &Path) -> Vec<T> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().collect::<Result<_, _>>().unwrap()
}

/// Whether files are to be written anew, rather than compared.
fn is_writing() -> bool {
    std::env::var_os("PUBLISHED_TABLES").is_some_and(|value| value == "write")
}

#[test]
fn every_table_is_what_its_csv_file_gives() {
    let path = folder().join("README.md");
    let page = read(&path);
    let made = table::with_tables(&page, &folder()).unwrap();
    if is_writing() {
        std::fs::write(&path, &made).unwrap();
        return;
    }
    let differing = page
        .lines()
        .zip(made.lines())
        .find(|(there, made)| there != made);
    assert_eq!(
        differing, None,
        "there, and made; `scripts/published --tables` writes it"
    );
    assert_eq!(page, made);
}

/// Writes a file of results where that is asked for, or else compares it.
fn settle(name: &str, made: &[u8]) {
    let path = folder().join(name);
    if is_writing() {
        std::fs::write(&path, made).unwrap();
    } else {
        let there = std::fs::read(&path).unwrap();
        assert!(
            there == made,
            "{name}: `scripts/published --tables` writes it"
        );
    }
}

#[test]
fn what_makes_thickening_is_what_its_runs_give() {
    for (name, made) in thickening::files(&folder()) {
        settle(name, &made);
    }
}

#[test]
fn the_figure_of_the_published_table_is_of_both_files() {
    settle("published-2d-beside.svg", &beside::figure(&folder()));
}

/// Headings of tables that no file gives: what was made, and how.
const BY_HAND: [&str; 1] = ["| File | Made by |"];

#[test]
fn no_table_of_results_is_written_by_hand() {
    let page = read(&folder().join("README.md"));
    let mut before = "";
    for line in page.lines() {
        if line.starts_with('|') && !before.starts_with('|') {
            let is_listed = BY_HAND.iter().any(|heading| line.starts_with(heading));
            assert!(is_listed || before.starts_with("<!-- table: "), "{line}");
        }
        before = line;
    }
}

#[test]
fn every_number_that_a_sentence_quotes_is_in_a_table() {
    let missing = quoted::not_found(&read(&folder().join("README.md")), &folder()).unwrap();
    assert!(
        missing.is_empty(),
        "in no table of their section:\n{}",
        missing.join("\n")
    );
}

#[test]
fn pages_that_link_to_results_quote_their_tables() {
    let page = read(&folder().join("README.md"));
    let mut pages = vec![(root().join("README.md"), "results/published/README.md")];
    for entry in std::fs::read_dir(root().join("docs")).unwrap() {
        pages.push((entry.unwrap().path(), "../results/published/README.md"));
    }
    for (path, place) in pages {
        let missing = quoted::not_found_from(&read(&path), place, &page, &folder());
        assert_eq!(missing, Ok(Vec::new()), "{}", path.display());
    }
}

#[test]
fn the_first_screen_quotes_published_results() {
    let readme = read(&root().join("README.md"));
    let printed = read(&folder().join("quickstart.txt"));
    // The table of the first campaign, as `run` printed it.
    let blocks = readme.split("```text\n").skip(1);
    let block = blocks.map(|block| block.split("```").next().unwrap());
    let block: Vec<&str> = block
        .clone()
        .find(|block| block.contains("viscosity"))
        .unwrap()
        .lines()
        .collect();
    let there: Vec<&str> = printed.lines().map(str::trim_end).collect();
    for line in block {
        let is_rule = line.starts_with(['─', '═']);
        assert!(
            is_rule || there.contains(&line.trim_end()),
            "{line:?} is not in quickstart.txt"
        );
    }
    let images = readme
        .split("<img src=\"results/published/quickstart.svg\" alt=\"")
        .skip(1);
    for image in images {
        let alt = image.split('"').next().unwrap();
        assert_eq!(quoted::not_in(alt, &printed), Vec::<String>::new(), "{alt}");
    }
}

/// `scripts/published --check` of a checkout.
fn check(at: &Path) -> Output {
    let mut command = Command::new("bash");
    command.arg(at.join("scripts/published")).arg("--check");
    command.output().unwrap()
}

#[test]
fn results_of_older_physics_are_called_stale() {
    let told = check(&root());
    let (out, err) = (
        String::from_utf8_lossy(&told.stdout),
        String::from_utf8_lossy(&told.stderr),
    );
    assert!(told.status.success(), "{out}{err}");
    // It knows the version that the program has.
    let version = sweep::case::PHYSICS_VERSION;
    assert!(out.contains(&format!("physics {version}")), "{out}");
}

#[test]
fn results_that_are_not_what_they_are_called_fail() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    for folder in ["scripts", "results/published", "crates/sweep/src"] {
        std::fs::create_dir_all(at.join(folder)).unwrap();
    }
    for file in ["scripts/published", "crates/sweep/src/case.rs"] {
        std::fs::copy(root().join(file), at.join(file)).unwrap();
    }
    let version = sweep::case::PHYSICS_VERSION;
    let names = read(&root().join("scripts/published"));
    let names = names
        .lines()
        .find_map(|line| line.strip_prefix("all=("))
        .unwrap();
    let names: Vec<&str> = names.trim_end_matches(')').split(' ').collect();
    let lay_out = |physics: u32, called: &str, more: &str| {
        let mut readme = format!(
            "| figure | made by | wall time | physics |\n| --- | --- | --- | --- |\n{more}"
        );
        for name in &names {
            let called = if *name == names[0] {
                called.to_owned()
            } else {
                version.to_string()
            };
            writeln!(
                readme,
                "| {name} | `scripts/published {name}` | 2 s | {called} |"
            )
            .unwrap();
            let physics = if *name == names[0] { physics } else { version };
            let last = format!(
                "computed in 2 s, summed over runs, by sweep 0.1.0 (physics {physics}, build 07ca)\n"
            );
            std::fs::write(at.join(format!("results/published/{name}.txt")), last).unwrap();
        }
        std::fs::write(at.join("results/published/README.md"), readme).unwrap();
        let told = check(at);
        (
            told.status.code(),
            String::from_utf8_lossy(&told.stderr).into_owned()
                + &String::from_utf8_lossy(&told.stdout),
        )
    };
    let older = sweep::case::PHYSICS_VERSION - 1;
    // What changed since then may be none of its runs: the list of campaigns knows.
    for made in [version, sweep::case::PHYSICS_VERSION] {
        assert_eq!(lay_out(made, &made.to_string(), "").0, Some(0));
    }
    let (code, told) = lay_out(older, &format!("{older}, stale"), "");
    assert!(
        code == Some(0) && told.contains(names[0]) && told.contains("stale"),
        "{told}"
    );
    for (physics, called) in [
        // Older and not called so, called older than it is, and called by another version than its table says.
        (older, older.to_string()),
        (older, version.to_string()),
        (version, format!("{version}, stale")),
        (version, format!("{older}, stale")),
    ] {
        let (code, told) = lay_out(physics, &called, "");
        assert!(
            code == Some(1) && told.contains(names[0]),
            "{physics} called {called}: {told}"
        );
    }
    // What the list does not name, and what it names and nobody made.
    std::fs::write(at.join("results/published/other.svg"), "").unwrap();
    let (code, told) = lay_out(version, &version.to_string(), "");
    assert!(code == Some(1) && told.contains("other.svg"), "{told}");
    std::fs::remove_file(at.join("results/published/other.svg")).unwrap();
    std::fs::write(at.join("results/published/README.md"), "").unwrap();
    let (code, told) = (check(at).status.code(), check(at).stderr);
    assert!(code == Some(1) && String::from_utf8_lossy(&told).contains(names[0]));
}
