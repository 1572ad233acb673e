//! Structure of a campaign's layers, from the frames it keeps.

use crate::harness::{Computed, folder, json, refused, run, sweep, words};
use std::path::Path;

const CAMPAIGN: &str = r#"name = "structure"
[protocol]
time_step = 0.02
strain = 0.6
discard = 0.2
sample_every = 0.1
[[grid]]
area_fraction = 0.7
friction = 0.5
roughness = 0.01
shear_rate = [0.0, inf]
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

static COMPUTED: Computed = Computed::new(CAMPAIGN, &["--trajectory"]);

#[test]
fn numbers_and_curves_agree_with_the_frames_and_with_each_other() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let structure = json(at, &["structure", "s.sqlite"]);
    let report = json(at, &["report", "s.sqlite"]);
    let points = structure["points"].as_array().unwrap();
    assert_eq!(points.len(), 2);
    for (point, averaged) in points.iter().zip(report["points"].as_array().unwrap()) {
        let of = |name: &str| point[name].as_f64().unwrap();
        assert_eq!(point["shear_rate"], averaged["shear_rate"]);
        // Samples at 0.2, 0.3, 0.4, 0.5 of two runs.
        assert_eq!((&point["runs"], &point["frames"]), (&2.into(), &8.into()));
        // The report averages the contacts of the same instants.
        let contacts = averaged["contacts_per_sphere"].as_f64().unwrap();
        assert!((of("coordination") - 2.0 * contacts).abs() < 1e-12);
        let activated = averaged["activated_fraction"].as_f64().unwrap();
        let frictional = of("frictional_coordination") / of("coordination");
        assert!(
            (frictional - activated).abs() < 1e-9,
            "{frictional} {activated}"
        );
        for name in [
            "layering",
            "psi_6",
            "localisation",
            "concentration_y",
            "hyperstaticity",
        ] {
            let sampled = averaged[name].as_f64().unwrap();
            // Frames hold numbers of single precision.
            let error = (of(name) - sampled).abs();
            assert!(error < 1e-5, "{name}: {sampled}, and an error of {error:e}");
        }
        assert!(point["q_6"].is_null() && averaged["q_6"].is_null());
        // Too short for a diffusivity, and no profile along the vorticity of a layer.
        assert!(point["diffusivity_yy"].is_null() && averaged["diffusivity_yy"].is_null());
        assert_eq!(point["profile_z"]["z"], serde_json::json!([]));
        let of_rows = |name: &str| {
            let rows = point["profile"][name].as_array().unwrap().iter();
            rows.map(serde_json::Value::as_f64).collect::<Vec<_>>()
        };
        let fractions: Vec<f64> = of_rows("fraction").into_iter().flatten().collect();
        let mean = fractions.iter().sum::<f64>() / fractions.len() as f64;
        assert!(
            fractions.len() == 20 && (mean - 0.7).abs() < 1e-6,
            "{fractions:?}"
        );
        // The velocity profile is that of the shear, but for fluctuations; rows may be empty.
        let rows = of_rows("velocity").into_iter().zip(of_rows("y"));
        let deviations: Vec<f64> = rows.filter_map(|(u, y)| Some((u? - y?).abs())).collect();
        let mean = deviations.iter().sum::<f64>() / deviations.len() as f64;
        assert!(deviations.len() > 10 && mean < 0.5, "{deviations:?}");
        for (name, weight) in [("probability", 1.0), ("force_weighted", 1.0)] {
            let shares = point["contact_angle"][name].as_array().unwrap();
            let sum: f64 = shares.iter().map(|share| share.as_f64().unwrap()).sum();
            assert!((sum - weight).abs() < 1e-9);
        }
        let trace =
            point["fabric"][0][0].as_f64().unwrap() + point["fabric"][1][1].as_f64().unwrap();
        assert!((trace - 1.0).abs() < 1e-6);
        assert!(point["percolating_z"].is_null());
        assert!(point["coordination_ci95"].as_f64().unwrap() > 0.0);
    }
    // At the lower plateau friction never acts.
    for name in [
        "frictional_coordination",
        "largest_cluster",
        "core_fraction",
        "percolating_x",
    ] {
        assert_eq!(points[0][name], 0.0, "{name}");
    }
    assert!(points[1]["largest_cluster"].as_f64().unwrap() > 0.1);
    // Contacts lie along the axis of compression: n_x n_y is negative.
    assert!(points[1]["fabric"][0][1].as_f64().unwrap() < 0.0);
}

#[test]
fn tables_files_and_figures_have_the_same_numbers() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let table = sweep(at, &["structure", "s.sqlite"]);
    for part in [
        "structure of 16 frames of 4 runs at 2 points",
        "largest",
        "percolates",
        "±",
    ] {
        assert!(table.contains(part), "{part}: {table}");
    }
    let of_table = table
        .lines()
        .filter(|line| line.starts_with([' ', '─', '═']));
    assert!(
        of_table.map(|line| line.chars().count()).max() <= Some(80),
        "{table}"
    );
    let point = &json(at, &["structure", "s.sqlite"])["points"][1];
    let files = [
        "--csv",
        "n.csv",
        "--curves",
        "c.csv",
        "--parquet",
        "n.parquet",
    ];
    assert_eq!(
        sweep(at, &[&["structure", "s.sqlite"][..], &files].concat()),
        ""
    );
    let read = |name: &str| std::fs::read_to_string(at.join(name)).unwrap();
    let numbers = read("n.csv");
    let column = |name: &str| {
        let place = numbers
            .lines()
            .next()
            .unwrap()
            .split(',')
            .position(|head| head == name);
        let cell = numbers
            .lines()
            .nth(2)
            .unwrap()
            .split(',')
            .nth(place.unwrap())
            .unwrap();
        cell.parse::<f64>().unwrap()
    };
    for name in [
        "coordination",
        "coordination_ci95",
        "rigid_fraction",
        "fabric_deviator",
    ] {
        assert_eq!(Some(column(name)), point[name].as_f64(), "{name}");
    }
    assert!(read("c.csv").contains("g_r_theta") && at.join("n.parquet").exists());
    for kind in [
        "pair-distribution",
        "contact-angle",
        "normal-force",
        "cluster-size",
    ] {
        sweep(
            at,
            &["structure", "s.sqlite", "--figure", "f.svg", "--kind", kind],
        );
        assert_eq!(read("f.svg").matches("Γ = ").count(), 2, "{kind}");
        assert!(read("f.svg").contains("<title>structure</title>"), "{kind}");
    }
    let map = [
        "structure",
        "s.sqlite",
        "--figure",
        "f.svg",
        "--kind",
        "pair-map",
    ];
    sweep(at, &[&map[..], &["--where", "shear_rate=inf"]].concat());
    for part in [
        "g(r, θ)",
        "Γ = ∞",
        "8 frames of 2 runs",
        "campaign structure",
    ] {
        assert!(read("f.svg").contains(part), "{part}");
    }
    // Both halves of every bin, and the sphere at the centre of g(r, θ).
    let bins = point["g_r_theta"]["g"].as_array().unwrap().len() * 36;
    let areas = read("f.svg").matches("stroke-width=\"0.2\"").count();
    assert_eq!(areas, 2 * bins);
    let error = refused(at, &map);
    for part in ["--kind", "are 2", "shear_rate", "(where)"] {
        assert!(error.contains(part), "{error}");
    }
    let one = json(
        at,
        &["structure", "s.sqlite", "3", "--where", "shear_rate=inf"],
    );
    assert_eq!(one["points"][0]["runs"], 1);
}

#[test]
fn sizes_of_clusters_are_drawn_on_a_logarithmic_axis_up_to_all_spheres() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let sizes = ["structure", "s.sqlite", "--figure", "f.svg"];
    sweep(at, &[&sizes[..], &["--kind", "cluster-size"]].concat());
    let figure = std::fs::read_to_string(at.join("f.svg")).unwrap();
    let marks = words_of_figure(&figure);
    assert!(marks.contains(&"1") && marks.contains(&"10"), "{marks:?}");
    assert!(
        marks
            .iter()
            .all(|mark| mark.parse::<f64>().unwrap_or(0.0) < 100.0),
        "{marks:?}"
    );
}

/// The texts of a figure.
fn words_of_figure(svg: &str) -> Vec<&str> {
    let texts = svg.split("<text ").skip(1);
    let texts = texts.filter_map(|text| text.split_once('>')?.1.split_once('<'));
    texts.map(|(text, _)| text).collect()
}

#[test]
fn without_frames_the_command_that_keeps_them_is_named() {
    let folder = folder("structure.toml", CAMPAIGN);
    let at = folder.path();
    sweep(at, &["run", "structure.toml", "--quiet"]);
    let error = refused(at, &["structure", "structure.toml"]);
    assert!(
        error.contains("`sweep run CAMPAIGN.toml --trajectory`"),
        "{error}"
    );
    assert!(refused(at, &["structure", "structure.toml", "77"]).contains("no case"));
    let notes = words(&run(at, &["run", "structure.toml", "--trajectory"]).stderr);
    assert!(notes.contains("4 begun or finished runs"), "{notes}");
    let filmed = COMPUTED.folder();
    let wanted = json(filmed.path(), &["structure", "s.sqlite"]);
    assert_eq!(json(at, &["structure", "structure.toml"]), wanted);
}

#[test]
fn structure_averages_only_runs_with_all_their_frames_however_they_were_computed() {
    let wanted = COMPUTED.folder();
    let wanted = json(wanted.path(), &["structure", "s.sqlite"]);
    // A longer run of a kept one has all frames, though it is not asked for them again.
    let short = CAMPAIGN.replace("strain = 0.6", "strain = 0.4");
    let longer = folder("short.toml", &short);
    let at = longer.path();
    let store = ["--store", "s.sqlite", "--quiet"];
    sweep(
        at,
        &[&["run", "short.toml", "--trajectory"], &store[..]].concat(),
    );
    std::fs::write(at.join("long.toml"), CAMPAIGN).unwrap();
    sweep(at, &[&["run", "long.toml"], &store[..]].concat());
    assert_eq!(json(at, &["structure", "s.sqlite"]), wanted);
    // Runs without the frames of their beginning are computed again for them.
    let later = folder("short.toml", &short);
    let at = later.path();
    sweep(at, &[&["run", "short.toml"], &store[..]].concat());
    std::fs::write(at.join("long.toml"), CAMPAIGN).unwrap();
    sweep(
        at,
        &[&["run", "long.toml", "--trajectory"], &store[..]].concat(),
    );
    assert_eq!(json(at, &["structure", "s.sqlite"]), wanted);
    // Other runs are left out, and named.
    let fewer = CAMPAIGN.replace("seeds = 2", "seeds = 1");
    let more = folder("fewer.toml", &fewer);
    let at = more.path();
    sweep(
        at,
        &[&["run", "fewer.toml", "--trajectory"], &store[..]].concat(),
    );
    std::fs::write(at.join("long.toml"), CAMPAIGN).unwrap();
    sweep(at, &[&["run", "long.toml"], &store[..]].concat());
    let output = run(at, &["structure", "s.sqlite", "--json"]);
    let note = words(&output.stderr);
    assert!(
        note.contains("2 finished runs left out, without frames of the whole averaged strain")
            && note.contains("(no frames)")
            && note.contains("`sweep run CAMPAIGN.toml --trajectory`"),
        "{note}"
    );
    let points: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(points["points"][0]["runs"], 1);
    sweep(
        at,
        &[&["run", "long.toml", "--trajectory"], &store[..]].concat(),
    );
    assert_eq!(json(at, &["structure", "s.sqlite"]), wanted);
}

#[test]
fn observed_networks_are_those_of_the_frames_and_change_nothing_else() {
    let observed = CAMPAIGN.replace("sample_every", "observe = [\"network\"]\nsample_every");
    let folder = folder("structure.toml", &observed);
    let at = folder.path();
    sweep(at, &["run", "structure.toml", "--quiet"]);
    let filmed = COMPUTED.folder();
    let of = |at: &Path, what: &str, store: &str| json(at, &[what, store])["points"].clone();
    let sampled = of(at, "report", "structure.toml");
    let plain = of(filmed.path(), "report", "s.sqlite");
    let framed = of(filmed.path(), "structure", "s.sqlite");
    let networks = [
        "coordination",
        "frictional_coordination",
        "largest_cluster",
        "percolating_x",
        "percolating_y",
        "core_fraction",
    ];
    for place in 0..2 {
        for name in networks {
            let number = |point: &serde_json::Value| point[name].as_f64();
            let (sampled, framed) = (number(&sampled[place]), number(&framed[place]));
            let apart = (sampled.unwrap() - framed.unwrap()).abs();
            assert!(apart < 1e-12, "{name}: {sampled:?} and {framed:?}");
            assert!(plain[place][name].is_null(), "{name}");
        }
        let exact = |points: &serde_json::Value| points[place]["viscosity"].to_string();
        assert_eq!(exact(&sampled), exact(&plain));
    }
    // The same runs: their keys and the bits of their other samples.
    let samples = |at: &Path, store: &str| -> Vec<String> {
        sweep(at, &["report", store, "--samples", "samples.csv"]);
        let text = std::fs::read_to_string(at.join("samples.csv")).unwrap();
        let heads: Vec<&str> = text.lines().next().unwrap().split(',').collect();
        let row = |line: &str| {
            let cells = line.split(',').zip(&heads);
            let others = cells.filter(|(_, head)| !networks.contains(head));
            others
                .map(|(cell, _)| cell.to_owned())
                .collect::<Vec<_>>()
                .join(",")
        };
        text.lines().map(row).collect()
    };
    assert_eq!(
        samples(at, "structure.toml"),
        samples(filmed.path(), "s.sqlite")
    );
    let table = sweep(at, &["report", "structure.toml", "--wide"]);
    assert!(
        table.contains("largest") && table.contains("core"),
        "{table}"
    );
    std::fs::write(
        at.join("bad.toml"),
        observed.replace("[\"network\"]", "[\"networks\"]"),
    )
    .unwrap();
    let error = refused(at, &["plan", "bad.toml"]);
    assert!(error.contains("did you mean \"network\"?"), "{error}");
}
