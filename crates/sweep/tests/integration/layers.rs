//! The layers of the crate: a room imports only rooms below it.

use std::path::{Path, PathBuf};

/// All source files in a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let deeper = folders.iter().flat_map(|folder| sources(folder));
    let is_source = |path: &PathBuf| path.extension().is_some_and(|end| end == "rs");
    files.into_iter().filter(is_source).chain(deeper).collect()
}

#[test]
fn rooms_import_only_rooms_below_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let map = std::fs::read_to_string(root.join("lib.rs")).unwrap();
    let list = map
        .split("```text\n")
        .nth(1)
        .unwrap()
        .split("//! ```")
        .next()
        .unwrap();
    let rooms: Vec<&str> = list
        .lines()
        .map(|line| line.split_whitespace().nth(1).unwrap())
        .collect();
    let mut declared: Vec<&str> = map
        .lines()
        .filter_map(|line| {
            line.trim_start_matches("pub ")
                .strip_prefix("mod ")?
                .strip_suffix(';')
        })
        .filter(|room| *room != "test_support")
        .collect();
    declared.sort_unstable();
    let mut listed = rooms.clone();
    listed.sort_unstable();
    assert_eq!(listed, declared, "the list in lib.rs has every room");
    let mut wrong = Vec::new();
    for path in sources(&root) {
        let place = path.strip_prefix(&root).unwrap().with_extension("");
        let room = place.iter().next().unwrap().to_str().unwrap();
        let is_test = place.iter().any(|part| part == "tests");
        let Some(rank) = rooms
            .iter()
            .position(|other| *other == room)
            .filter(|_| !is_test)
        else {
            continue;
        };
        let text = std::fs::read_to_string(&path).unwrap();
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        let lines = text
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"));
        for import in lines.flat_map(|line| line.split("crate::").skip(1)) {
            let end = import.find(|c: char| !c.is_alphanumeric() && c != '_');
            let name = &import[..end.unwrap_or(import.len())];
            if rooms
                .iter()
                .position(|other| *other == name)
                .is_none_or(|other| other > rank)
            {
                wrong.push(format!("{} imports crate::{name}", place.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
