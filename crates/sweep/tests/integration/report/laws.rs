//! Figures of a rheometer: friction law, normal stresses, runs by their causes, published curves.

use crate::harness::{Computed, refused, sweep, words};
use std::path::Path;

const CAMPAIGN: &str = r#"name = "laws"
[protocol]
time_step = 0.02
sample_every = 0.02
[[protocol.segment]]
strain = 0.8
discard = 0.2
[[protocol.segment]]
oscillation = { amplitude = 0.1, cycles = 2, average_last = 1 }
[[grid]]
volume_fraction = [0.3, 0.42, 0.48]
friction = 0.5
roughness = 0.01
shear_rate = inf
seeds = 2
spheres = 64
hydrodynamics = "ball-melrose"
contact = "rigid"
tangential = "coulomb"
"#;

static COMPUTED: Computed = Computed::new(CAMPAIGN, &[]);

/// The texts of a figure of a segment, one after the other.
fn texts(at: &Path, segment: &str, more: &[&str]) -> String {
    let figure = [
        "report",
        "s.sqlite",
        "--figure",
        "f.svg",
        "--segment",
        segment,
    ];
    sweep(at, &[&figure[..], more].concat());
    let svg = std::fs::read_to_string(at.join("f.svg")).unwrap();
    let texts = svg.split("<text").skip(1).filter_map(|text| {
        let text = text.split_once('>')?.1.split_once("</text>")?.0;
        Some(
            text.replace("<tspan", "\0<tspan")
                .split('\0')
                .map(plain)
                .collect::<String>(),
        )
    });
    texts.collect::<Vec<_>>().join("\n")
}

/// A text without its markup.
fn plain(text: &str) -> String {
    let parts = text
        .split('<')
        .map(|part| part.rsplit('>').next().unwrap_or_default());
    parts.collect()
}

#[test]
fn each_kind_says_what_it_shows() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    for (segment, kind, parts) in [
        (
            "1",
            "mu-j",
            &["viscous number J", "macroscopic friction coefficient"][..],
        ),
        ("1", "phi-j", &["viscous number J", "fraction"]),
        ("1", "normal-stress", &["volume fraction φ", "N₁/σ", "N₂/σ"]),
        (
            "1",
            "parts",
            &["in all", "stresslets", "normal contact forces", "friction"],
        ),
        (
            "1",
            "distribution",
            &["probability density", "relative viscosity η"],
        ),
        ("1", "spectrum", &["cycles in a strain of 1", "power of η"]),
        ("2", "lissajous", &["strain / γ", "stress / (μ"]),
    ] {
        let at_one = match kind {
            "parts" => &["--where", "phi=0.48"][..],
            _ => &[],
        };
        let drawn = texts(at, segment, &[&["--kind", kind], at_one].concat());
        for part in parts {
            assert!(drawn.contains(part), "{kind}: {part}: {drawn}");
        }
        // Without repulsion there is no part of it.
        assert!(!drawn.contains("repulsion"));
    }
    let divergence = ["--kind", "divergence", "--jamming", "0.585"];
    let drawn = texts(at, "1", &divergence);
    assert!(drawn.contains("0.585 − fraction"), "{drawn}");
    let against = [
        "--quantity",
        "contacts_per_sphere",
        "--against",
        "viscosity",
    ];
    assert!(texts(at, "1", &against).contains("relative viscosity η"));
}

#[test]
fn published_curves_are_drawn_where_they_are_of_the_same_flow() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let boyer = ["--reference", "boyer2011"];
    for kind in [
        &["--kind", "mu-j"][..],
        &["--kind", "divergence", "--jamming", "0.585"],
        &[],
    ] {
        let drawn = texts(at, "1", &[kind, &boyer[..]].concat());
        assert!(drawn.contains("boyer2011"), "{kind:?}: {drawn}");
    }
    let memory = texts(
        at,
        "1",
        &["--kind", "normal-stress", "--reference", "zarraga2000"],
    );
    assert!(
        memory.contains("N₁/σ, zarraga2000, from memory"),
        "{memory}"
    );
    for (segment, more, said) in [
        (
            "2",
            &boyer[..],
            "of steady shear, and points here are of oscillation",
        ),
        (
            "1",
            &["--where", "phi=0.3..0.44", "--reference", "mari2014"],
            "holds where volume_fraction is between 0.45 and 0.62",
        ),
        (
            "1",
            &["--kind", "mu-j", "--reference", "mari2014"],
            "mari2014 has viscosity against volume_fraction",
        ),
        (
            "1",
            &["--kind", "trace", "--reference", "boyer2011"],
            "this figure shows relative viscosity",
        ),
        (
            "1",
            &["--reference", "boyer2012"],
            "did you mean boyer2011?",
        ),
        ("1", &["--reference", "seto2018"], "has no curve"),
        ("1", &["--kind", "divergence"], "--jamming"),
        ("1", &["--kind", "lissajous"], "only an oscillation"),
        (
            "1",
            &["--kind", "mu-j", "--against", "viscosity"],
            "only --kind curve has it",
        ),
    ] {
        let figure = [
            "report",
            "s.sqlite",
            "--figure",
            "f.svg",
            "--segment",
            segment,
        ];
        let error = refused(at, &[&figure[..], more].concat());
        assert!(words(error.as_bytes()).contains(said), "{said}: {error}");
    }
    // A layer.
    let layers = super::SMALL.folder();
    let figure = [
        "report",
        "s.sqlite",
        "--figure",
        "f.svg",
        "--reference",
        "boyer2011",
    ];
    let error = refused(layers.path(), &figure);
    assert!(
        error.contains("is of a suspension, and points here are of a layer"),
        "{error}"
    );
}
