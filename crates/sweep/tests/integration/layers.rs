//! The layers of the crate: a room imports only rooms below it, a file of the store only files
//! below it, and no files import each other in a circle.

use std::collections::{BTreeMap, BTreeSet, HashMap};
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

/// The names in lists of imports from a module, as in `super::{a, B}` and `super::a::C`.
fn imported<'t>(text: &'t str, module: &str) -> Vec<&'t str> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let after = text.split(module).skip(1);
    after
        .flat_map(|rest| match rest.strip_prefix('{') {
            Some(list) => list[..list.find('}').unwrap()].split(',').collect(),
            None => vec![rest],
        })
        .map(str::trim_start)
        .map(|name| &name[..name.find(|c| !is_name(c)).unwrap_or(name.len())])
        .filter(|name| !name.is_empty())
        .collect()
}

/// Names that a module hands on, with the files in its folder that they come from.
fn handed_on(module: &str) -> HashMap<&str, &str> {
    let mut of_name = HashMap::new();
    let uses = module.split("use ").skip(1);
    for (file, rest) in uses.filter_map(|part| part.split_once("::")) {
        let Some(end) = rest.find(';') else { continue };
        let names = rest[..end].trim_matches(['{', '}']);
        of_name.extend(names.split(',').map(|name| (name.trim(), file)));
    }
    of_name
}

/// What each file of a folder imports from other files of it, a file with the folder beside it.
fn imports_within(root: &Path, folder: &Path) -> BTreeMap<String, BTreeSet<String>> {
    let inside = folder.strip_prefix(root).unwrap();
    let parts: Vec<&str> = inside.iter().map(|part| part.to_str().unwrap()).collect();
    let module = if parts.is_empty() {
        root.join("lib.rs")
    } else {
        folder.with_extension("rs")
    };
    let module = std::fs::read_to_string(module).unwrap_or_default();
    let of_name = handed_on(&module);
    let path = format!("{}::", [&["crate"], parts.as_slice()].concat().join("::"));
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for source in sources(folder) {
        let place = source.strip_prefix(folder).unwrap().with_extension("");
        let names: Vec<&str> = place.iter().map(|part| part.to_str().unwrap()).collect();
        if names.contains(&"tests") || ["lib", "main"].contains(&names[0]) {
            continue;
        }
        let text = std::fs::read_to_string(&source).unwrap();
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        let code = text
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"));
        let code: String = code.flat_map(|line| [line, "\n"]).collect();
        let imports = found.entry(names[0].to_owned()).or_default();
        for from in [&path, &"super::".repeat(names.len())] {
            let names = imported(&code, from).into_iter();
            imports.extend(names.map(|name| of_name.get(name).unwrap_or(&name).to_string()));
        }
    }
    found
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut circles = Vec::new();
    let mut checked = 0;
    // From a package the other crate is not there.
    for root in ["sweep", "sd-core"].map(|name| crates.join(name).join("src")) {
        let mut folders: BTreeSet<PathBuf> = BTreeSet::new();
        if root.is_dir() {
            folders.extend(sources(&root).iter().flat_map(|path| {
                let inside = path.ancestors().skip(1);
                let inside = inside.take_while(|folder| folder.starts_with(&root));
                inside.map(Path::to_path_buf).collect::<Vec<_>>()
            }));
        }
        for folder in folders {
            let mut left = imports_within(&root, &folder);
            checked += left.len();
            // Files that import none of the others are in no circle.
            loop {
                let names: BTreeSet<String> = left.keys().cloned().collect();
                left.retain(|own, imports| {
                    imports
                        .iter()
                        .any(|other| other != own && names.contains(other))
                });
                if left.len() == names.len() {
                    break;
                }
            }
            if !left.is_empty() {
                circles.push(format!("{}: {:?}", folder.display(), left.keys()));
            }
        }
    }
    assert!(circles.is_empty(), "{}", circles.join("\n"));
    assert!(checked > 50, "only {checked} files");
}

#[test]
fn files_of_the_store_read_only_files_below_them() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/store");
    let map = std::fs::read_to_string(folder.with_extension("rs")).unwrap();
    let list = map.split("```").nth(1).unwrap();
    let lines = list.lines().filter_map(|line| line.strip_prefix("//! "));
    let files: Vec<&str> = lines
        .flat_map(|line| line.split("  ").next().unwrap().split(", "))
        .collect();
    let rank = |file: &str| files.iter().position(|other| *other == file);
    let of_type = handed_on(&map);
    let mut wrong = Vec::new();
    for path in sources(&folder) {
        let place = path.strip_prefix(&folder).unwrap().with_extension("");
        let file = place.iter().next().unwrap().to_str().unwrap();
        if file == "tests" {
            continue;
        }
        let own = rank(file).unwrap_or_else(|| panic!("{file} is not in the list of store.rs"));
        let text = std::fs::read_to_string(&path).unwrap();
        let text = text.split("#[cfg(test)]").next().unwrap();
        let module = if place.iter().count() > 1 {
            "crate::store::"
        } else {
            "super::"
        };
        for name in imported(text, module) {
            let other = of_type.get(name).copied().unwrap_or(name);
            if rank(other).is_some_and(|other| other > own) {
                wrong.push(format!("{} imports {name} of {other}", place.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
