//! Output from a store: tables, figures, exports, details of a run.

mod case_details;
mod chosen;
mod diagram;
mod figures;
mod laws;
mod one_by_one;
mod plan;
mod tables;
mod units;

use crate::harness::{Computed, sweep};
use std::path::Path;

/// A small campaign with plateaus; its store has frames.
const CAMPAIGN: &str = r#"name = "small"
[protocol]
time_step = 0.005
strain = 0.4
discard = 0.1
[[grid]]
area_fraction = 0.65
friction = [0.0, 0.3]
roughness = 0.01
shear_rate = [0, 1.0, inf]
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

/// Its store.
static SMALL: Computed = Computed::new(CAMPAIGN, &["--trajectory"]);

/// A campaign of more points, as a paper might have.
const PAPER_CAMPAIGN: &str = r#"name = "paper"
[protocol]
time_step = 0.005
strain = 0.2
discard = 0.1
[[grid]]
area_fraction = [0.5, 0.65]
friction = [0.0, 0.3]
roughness = 0.01
shear_rate = [0, 0.1, 1.0, 10.0, inf]
seeds = 2
spheres = 20
hydrodynamics = "ball-melrose"
"#;

/// Its store.
static PAPER: Computed = Computed::new(PAPER_CAMPAIGN, &[]);

/// One curve of it.
const ONE: [&str; 4] = ["--where", "friction=0.3", "--where", "area_fraction=0.65"];

/// The figure as SVG.
fn figure(at: &Path, more: &[&str]) -> String {
    sweep(
        at,
        &[&["report", "s.sqlite", "--figure", "f.svg"], more].concat(),
    );
    std::fs::read_to_string(at.join("f.svg")).unwrap()
}

/// All texts of a figure, without its title and metadata.
fn words(svg: &str) -> Vec<&str> {
    svg.split("<text ")
        .skip(1)
        .map(|part| {
            let (_, rest) = part.split_once('>').unwrap();
            rest.split_once('<').unwrap().0
        })
        .collect()
}

/// Gives every case the key of the parameters it has now.
fn with_new_keys(directory: &Path) {
    let path = directory.join("s.sqlite");
    let store = rusqlite::Connection::open(&path).unwrap();
    let cases: Vec<(i64, String, i64, i64)> = store
        .prepare("SELECT c.id, p.params, c.seed, c.sample_stride FROM cases c JOIN points p ON p.id = c.point")
        .unwrap()
        .query_map([], |row| {
            Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
        })
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap();
    for (id, params, seed, sample_stride) in cases {
        let case = sweep::model::case::Case {
            params: serde_json::from_str(&params).unwrap(),
            seed: seed.unsigned_abs(),
            steps: 1,
            sample_stride: sample_stride.unsigned_abs(),
        };
        store
            .execute(
                "UPDATE points SET params = ?2 WHERE id = (SELECT point FROM cases WHERE id = ?1)",
                (id, serde_json::to_string(&case.params).unwrap()),
            )
            .unwrap();
        store
            .execute(
                "UPDATE cases SET key = ?2 WHERE id = ?1",
                (id, case.key().to_string()),
            )
            .unwrap();
    }
    drop(store);
    sweep::store::accept_changes(&path).unwrap();
}
