//! The scripts, as far as they can be tested without their work.

use crate::harness::root;
use std::path::PathBuf;
use std::process::Command;

/// The folder of the scripts.
fn scripts() -> PathBuf {
    root().join("scripts")
}

#[test]
fn every_script_can_be_read() {
    for entry in std::fs::read_dir(scripts()).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            continue; // A package of Python, with tests of its own.
        }
        let is_python = std::fs::read_to_string(&path)
            .unwrap()
            .starts_with("#!/usr/bin/env python3");
        let mut reader = if is_python {
            let mut python = Command::new("python3");
            python.args(["-c", "import ast, sys; ast.parse(open(sys.argv[1]).read())"]);
            python
        } else {
            let mut bash = Command::new("bash");
            bash.arg("-n");
            bash
        };
        let status = reader.arg(&path).status();
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
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("no part speed"), "{message}");
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
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(
        message.contains("needs libraries where it runs"),
        "{message}"
    );
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
}

/// The workspace has the version; what cannot read it there repeats it.
#[test]
fn every_file_names_the_version_of_the_workspace() {
    let version = env!("CARGO_PKG_VERSION");
    for (file, line) in [
        ("CITATION.cff", format!("version: {version}\n")),
        ("CHANGELOG.md", format!("\n## {version}")),
        (
            "docs/install.md",
            format!("sweep-{version}-x86_64-linux.tar.gz"),
        ),
        ("docs/install.md", format!("# sweep {version} (")),
    ] {
        let text = std::fs::read_to_string(root().join(file)).unwrap();
        assert!(text.contains(&line), "{file} lacks {line:?}");
    }
}

#[test]
fn every_campaign_can_be_read_and_has_its_published_results() {
    let sweeps = scripts().join("../sweeps");
    let published =
        std::fs::read_to_string(scripts().join("published_results/campaigns.py")).unwrap();
    for entry in std::fs::read_dir(sweeps).unwrap() {
        let entry = entry.unwrap();
        let read = sweep::campaign::read(&entry.path());
        assert!(read.is_ok(), "{:?}", read.err());
        let name = entry.file_name().into_string().unwrap();
        let name = name.strip_suffix(".toml").unwrap_or_default();
        assert!(published.contains(&format!("\"{name}\"")), "{name}");
    }
}
