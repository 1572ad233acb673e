//! The details of a run, its frames, and pages and figures that name no other place.

use super::{CAMPAIGN, SMALL};
use crate::harness::{folder, json, refused, sweep};
use std::path::Path;

#[test]
fn show_prints_a_run_by_number_and_by_key() {
    let folder = SMALL.folder();
    let at = folder.path();
    let text = sweep(at, &["show", "s.sqlite", "5"]);
    for part in [
        "case 5",
        "ν 0",
        "Γ inf",
        "seed 1",
        "strain 0.400 of 0.400",
        "20 samples, the last at strain 0.380",
        "viscosity over tenths of this strain: ",
        "build",
    ] {
        assert!(text.contains(part), "{part} not in {text}");
    }
    assert!(!text.contains('\u{1b}'), "no escape sequences");
    let details = json(at, &["show", "s.sqlite", "5"]);
    assert_eq!(details["samples"].as_array().unwrap().len(), 20);
    let key = details["key"].as_str().unwrap();
    assert_eq!(sweep(at, &["show", "s.sqlite", &key[..12]]), text);
    refused(at, &["show", "s.sqlite", "zz"]);
    refused(at, &["show", "s.sqlite", ""]);
}

#[test]
fn frames_are_exported_with_the_sheared_cell_and_contacts() {
    let folder = SMALL.folder();
    let at = folder.path();
    sweep(at, &["export", "s.sqlite", "6", "--out", "l.xyz"]);
    let text = std::fs::read_to_string(at.join("l.xyz")).unwrap();
    assert_eq!(text.lines().count(), 20 * 32);
    assert!(
        text.lines()
            .filter(|line| line.starts_with("Lattice="))
            .count()
            == 20
    );
    let contacts = std::fs::read_to_string(at.join("l.contacts.csv")).unwrap();
    let store = rusqlite::Connection::open(at.join("s.sqlite")).unwrap();
    let counted: u32 = store
        .query_row(
            "SELECT sum(contacts) FROM samples WHERE case_id = (SELECT id FROM cases WHERE position = 5)",
            [],
            |row| row.get(0),
        )
        .unwrap();
    assert_eq!(contacts.lines().count(), counted as usize + 1);
    let table = sweep(
        at,
        &[
            "export", "s.sqlite", "6", "--format", "csv", "--every", "10",
        ],
    );
    assert_eq!(table.lines().count(), 2 * 30 + 1);
}

#[test]
fn frames_change_no_bit_of_a_run() {
    let folder = folder("small.toml", CAMPAIGN);
    let at = folder.path();
    sweep(at, &["run", "small.toml", "--quiet"]);
    let samples = |path: &Path| -> Vec<(String, f64, f64)> {
        rusqlite::Connection::open(path)
            .unwrap()
            .prepare(
                "SELECT c.key || s.step, s.viscosity, s.normal_velocity FROM samples s JOIN cases c ON c.id = s.case_id
                 ORDER BY 1",
            )
            .unwrap()
            .query_map([], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))
            .unwrap()
            .map(Result::unwrap)
            .collect()
    };
    let plain = samples(&at.join("results/small.sqlite"));
    // Two runs each without friction, and with it at two rates.
    assert_eq!(plain.len(), 6 * 20);
    let filmed = SMALL.folder();
    assert_eq!(plain, samples(&filmed.path().join("s.sqlite")));
    refused(at, &["export", "results/small.sqlite", "1"]);
}

#[test]
fn page_is_whole_and_names_no_other_place() {
    let folder = SMALL.folder();
    let at = folder.path();
    sweep(at, &["report", "s.sqlite", "--page", "p.html"]);
    let page = std::fs::read_to_string(at.join("p.html")).unwrap();
    assert!(page.contains("connect-src 'none'"));
    for placeholder in ["@DATA@", "@CSS@", "@JS@", "@CONNECT@"] {
        assert!(!page.contains(placeholder));
    }
    let without_names = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!without_names.contains("http://") && !without_names.contains("https://"));
}

#[test]
fn paths_of_a_passing_pair_are_drawn() {
    let folder = SMALL.folder();
    let at = folder.path();
    let pair = ["pair", "--no-contact", "--time-step", "0.5", "--figure"];
    sweep(at, &[&pair[..], &["paths.svg"]].concat());
    let svg = std::fs::read_to_string(at.join("paths.svg")).unwrap();
    for word in ["first sphere", "second sphere", "x / a", "y / a"] {
        assert!(svg.contains(word), "{word}");
    }
    let said = refused(at, &[&pair[..], &["paths.gif"]].concat());
    assert!(said.contains(".svg") && said.contains("PNG"), "{said}");
    assert!(!at.join("paths.gif").exists());
}
