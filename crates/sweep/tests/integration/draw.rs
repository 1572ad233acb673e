//! Pictures of the spheres of a run.

use crate::harness::{Computed, folder, json, refused, run, sweep};
use std::path::Path;

const CAMPAIGN: &str = r#"name = "pictures"
[protocol]
time_step = 0.02
strain = 0.6
discard = 0.2
sample_every = 0.1
[[grid]]
area_fraction = 0.7
friction = 0.5
roughness = 0.01
shear_rate = inf
seeds = 1
spheres = 30
hydrodynamics = "ball-melrose"
[[grid]]
volume_fraction = 0.4
friction = 0.5
roughness = 0.01
shear_rate = inf
seeds = 1
spheres = 50
hydrodynamics = "ball-melrose"
tangential = "coulomb"
"#;

static COMPUTED: Computed = Computed::new(CAMPAIGN, &["--trajectory"]);

fn drawn(at: &Path, more: &[&str]) -> String {
    sweep(at, &[&["draw", "s.sqlite"], more].concat())
}

#[test]
fn pictures_say_what_they_show_in_all_colours() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    // A layer is sampled in the middle of a step, a suspension where it begins.
    for (case, space, strain) in [
        ("1", "c = 0.7", "strain 0.31"),
        ("2", "φ = 0.4", "strain 0.30"),
    ] {
        for (colour, label) in [
            ("pressure", "pressure of contacts Σf/(4πa²) (μ rate)"),
            ("contacts", "contacts of a sphere"),
            ("spin", "spin along the vorticity (rate)"),
            ("cluster", "spheres of a cluster of frictional contacts"),
        ] {
            let svg = drawn(at, &[case, "--strain", "0.3", "--colour", colour]);
            for part in [
                label,
                space,
                "pictures, case",
                strain,
                "ν = 0.5",
                "Γ = ∞",
                "seed 1",
                "x / a",
                "key ",
            ] {
                assert!(svg.contains(part), "{part} of {case}, {colour}");
            }
        }
    }
    let words = drawn(at, &["1"]);
    assert!(words.contains("frictional contact, normal force ") && words.contains("μa² rate"));
    // A sphere with light on it is made of many discs.
    let discs = |case| drawn(at, &[case]).matches("stroke-width=\"0.3\"").count();
    assert!((30..90).contains(&discs("1")) && (30..90).contains(&discs("2")));
}

#[test]
fn json_says_what_is_on_a_picture() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let said = drawn(at, &["2", "--out", "p.svg", "--slab", "0..3"]);
    assert!(
        said.contains(" spheres and ") && said.contains("strain 0.5"),
        "{said}"
    );
    let file = std::fs::read(at.join("p.svg")).unwrap();
    assert!(file.starts_with(b"<svg"));
    let all = json(
        at,
        &["draw", "s.sqlite", "1", "--out", "p.svg", "--strain", "0.3"],
    );
    assert_eq!(all["spheres"], 30);
    assert!((all["strain"].as_f64().unwrap() - 0.31).abs() < 1e-9);
    sweep(at, &["export", "s.sqlite", "1", "--out", "layer.xyz"]);
    let contacts = std::fs::read_to_string(at.join("layer.contacts.csv")).unwrap();
    let there = contacts.lines().filter(|line| line.starts_with("15,"));
    assert_eq!(all["contacts"], there.count());
    let error = refused(at, &["draw", "s.sqlite", "1", "--json"]);
    assert!(error.contains("--out"), "{error}");
}

#[test]
fn what_cannot_be_drawn_is_refused_with_what_can() {
    let computed = COMPUTED.folder();
    let at = computed.path();
    for (wrong, parts) in [
        (
            &["1", "--strain", "3.2"][..],
            &["--strain", "6 frames", "from 0", "to 0.5"][..],
        ),
        (&["1", "--slab", "0..2"], &["a layer has no depth"]),
        (&["2", "--slab", "90..99"], &["--slab", "z goes from 0 to "]),
        (&["2", "--slab", "3"], &["3"]),
        (
            &["1", "--colour", "force"],
            &["pressure", "contacts", "spin", "cluster"],
        ),
        (&["1", "--out", "p.gif"], &["--out", ".svg"]),
        (&["77"], &["no case"]),
    ] {
        let error = refused(at, &[&["draw", "s.sqlite"], wrong].concat());
        for part in parts {
            assert!(error.contains(part), "{wrong:?}: {error}");
        }
    }
    assert!(!at.join("p.gif").exists());
    let folder = folder("pictures.toml", CAMPAIGN);
    sweep(folder.path(), &["run", "pictures.toml", "--quiet"]);
    let error = refused(folder.path(), &["draw", "pictures.toml", "1"]);
    assert!(
        error.contains("`sweep run CAMPAIGN.toml --trajectory`"),
        "{error}"
    );
    assert!(
        run(folder.path(), &["draw", "none.sqlite", "1"])
            .status
            .code()
            != Some(0)
    );
}
