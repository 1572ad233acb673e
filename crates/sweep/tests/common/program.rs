//! The program as tests start it: in a folder of its own, with its cache there, so that no test knows of another.
#![allow(dead_code, reason = "no file of tests needs all of it")]

use assert_cmd::cargo::cargo_bin;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The program in a folder, without arguments yet.
pub(crate) fn program(at: &Path) -> Command {
    let mut command = Command::new(cargo_bin("sweep"));
    command.current_dir(at).env("XDG_CACHE_HOME", at);
    command
}

/// Runs it, however it ends.
pub(crate) fn run(at: &Path, arguments: &[&str]) -> Output {
    program(at).args(arguments).output().unwrap()
}

/// What it prints when all goes well.
pub(crate) fn sweep(at: &Path, arguments: &[&str]) -> String {
    let output = run(at, arguments);
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The object it prints.
pub(crate) fn json(at: &Path, arguments: &[&str]) -> serde_json::Value {
    let text = sweep(at, &[arguments, &["--json"]].concat());
    serde_json::from_str(&text).unwrap()
}

/// What it says of bad input, which leaves nothing on standard output.
pub(crate) fn refused(at: &Path, arguments: &[&str]) -> String {
    let output = run(at, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
    assert!(output.stdout.is_empty());
    // Lines are broken to fit a terminal.
    let said = String::from_utf8(output.stderr).unwrap();
    let words: Vec<&str> = said
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect();
    words.join(" ")
}

/// A folder with a campaign file in it.
pub(crate) fn folder(name: &str, campaign: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), campaign).unwrap();
    folder
}

/// A campaign that is computed once, for all tests that look at its store.
pub(crate) struct Computed {
    campaign: &'static str,
    /// Arguments of `sweep run`.
    more: &'static [&'static str],
    store: OnceLock<Vec<u8>>,
}

impl Computed {
    pub(crate) const fn new(campaign: &'static str, more: &'static [&'static str]) -> Self {
        Self {
            campaign,
            more,
            store: OnceLock::new(),
        }
    }

    /// A folder with a copy of its store, `s.sqlite`, and its file, `c.toml`.
    pub(crate) fn folder(&self) -> tempfile::TempDir {
        let folder = folder("c.toml", self.campaign);
        let at = folder.path();
        let bytes = self.store.get_or_init(|| {
            let run = ["run", "c.toml", "--store", "s.sqlite", "-q"];
            sweep(at, &[&run[..], self.more].concat());
            std::fs::read(at.join("s.sqlite")).unwrap()
        });
        std::fs::write(at.join("s.sqlite"), bytes).unwrap();
        folder
    }
}

/// Changes the store of a folder, as a bad night might.
pub(crate) fn spoil(at: &Path, statements: &str) {
    let path = at.join("s.sqlite");
    let store = rusqlite::Connection::open(&path).unwrap();
    store.execute_batch(statements).unwrap();
    drop(store);
    sweep::store::accept_changes(&path).unwrap();
}

/// Makes runs of a store fail: those that a condition of SQL is true of.
pub(crate) fn fail(at: &Path, which: &str) {
    spoil(
        at,
        &format!(
            "CREATE TEMP TABLE chosen AS SELECT c.id FROM cases c JOIN points p ON p.id = c.point WHERE {which};
             UPDATE cases SET state = 'failed' WHERE id IN chosen;
             DELETE FROM results WHERE case_id IN chosen;
             DELETE FROM ends WHERE case_id IN chosen;
             INSERT INTO failures (case_id, attempt, error, step, strain, process, failed_at)
                 SELECT id, 1, 'made up', 3, 0.015, 1, 0 FROM chosen;"
        ),
    );
}
