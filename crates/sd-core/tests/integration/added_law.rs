//! The worked example of `docs/add-a-contact-law.md`, added to the laws as the document says.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The law's own file.
const FILE: &str = include_str!("added_law/cone.rs");
/// Path of the file according to the document.
const PLACE: &str = "crates/sd-core/src/law/normal/cone.rs";
/// The line that it adds to the list of laws, and the line before.
const LINE: &str = "    Cone: cone,\n";
const LINE_BEFORE: &str = "    Hertz: hertz,\n";

/// The repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The document.
fn document() -> String {
    std::fs::read_to_string(root().join("docs/add-a-contact-law.md")).unwrap()
}

/// The list of normal laws with the line added.
fn list_with_line() -> String {
    let list = std::fs::read_to_string(root().join("crates/sd-core/src/law/normal.rs")).unwrap();
    assert_eq!(list.matches(LINE_BEFORE).count(), 1, "{list}");
    list.replace(LINE_BEFORE, &format!("{LINE_BEFORE}{LINE}"))
}

#[test]
fn document_shows_the_file_and_the_line_that_are_tried_here() {
    let document = document();
    assert!(document.contains(PLACE));
    assert!(document.contains(&format!("```rust\n{FILE}```\n")));
    let list = list_with_line();
    let from = list.find("normal_laws! {").unwrap();
    let to = from + list[from..].find("\n}\n").unwrap();
    let shown = format!("```rust\n{}\n}}\n```\n", &list[from..to]);
    assert!(document.contains(&shown), "the document has not:\n{shown}");
}

/// Copies a folder and what is in it.
fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let (from, to) = (
            entry.as_ref().unwrap().path(),
            to.join(entry.unwrap().file_name()),
        );
        if from.is_dir() {
            copy(&from, &to);
        } else {
            std::fs::copy(from, to).unwrap();
        }
    }
}

/// The module of the laws depends on no other module, so it can be compiled as a separate crate.
#[test]
fn law_of_the_document_passes_the_tests_of_all_laws() {
    let at = Path::new(env!("CARGO_TARGET_TMPDIR")).join("added-law");
    let source = root().join("crates/sd-core/src");
    if at.join("src").exists() {
        std::fs::remove_dir_all(at.join("src")).unwrap();
    }
    copy(&source.join("law"), &at.join("src/law"));
    std::fs::copy(source.join("law.rs"), at.join("src/law.rs")).unwrap();
    std::fs::write(at.join("src/lib.rs"), "pub mod law;\n").unwrap();
    std::fs::write(at.join("src/law/normal/cone.rs"), FILE).unwrap();
    std::fs::write(at.join("src/law/normal.rs"), list_with_line()).unwrap();
    std::fs::copy(root().join("Cargo.lock"), at.join("Cargo.lock")).unwrap();
    let manifest = "[package]\nname = \"added-law\"\nedition = \"2024\"\n[workspace]\n\
        [dependencies]\nserde = { version = \"1\", features = [\"derive\"] }\n[dev-dependencies]\nserde_json = \"1\"\n";
    std::fs::write(at.join("Cargo.toml"), manifest).unwrap();
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["test", "--offline", "--lib"])
        .current_dir(&at)
        .env("CARGO_TARGET_DIR", at.join("target"))
        .output()
        .unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stdout}{errors}");
    for test in [
        "law::normal::cone::tests::twice_the_overlap_bears_four_times_the_force",
        "law::normal::tests::slope_and_overlap_belong_to_the_force",
        "law::normal::tests::words_are_those_of_serde",
    ] {
        assert!(
            stdout.contains(&format!("test {test} ... ok")),
            "{test} in\n{stdout}"
        );
    }
}
