//! Campaigns in extension: from the file to reports, pictures and exports, interrupted and resumed.

use crate::harness::{command, folder, send, spawn};
use assert_cmd::Command;
use rustix::process::Signal;
use std::path::Path;
use std::time::Duration;

const CAMPAIGN: &str = r#"name = "flows"
[protocol]
strain = 0.3
discard = 0.1
checkpoint_every = 0.05
observe = ["network"]
[[grid]]
volume_fraction = 0.45
flow = ["planar-extension", "uniaxial", { shear = 1.0, extension = 0.7 }]
friction = 0.5
roughness = 0.01
shear_rate = inf
seeds = 1
spheres = 30
hydrodynamics = "lubrication"
[[grid]]
area_fraction = 0.7
flow = "planar-extension"
friction = 0.5
roughness = 0.01
shear_rate = inf
seeds = 1
spheres = 40
hydrodynamics = "ball-melrose"
"#;

fn sweep(directory: &Path, arguments: &[&str]) -> String {
    let done = Command::from_std(command(directory, arguments))
        .assert()
        .code(0);
    String::from_utf8(done.get_output().stdout.clone()).unwrap()
}

/// The samples of all runs.
fn samples(directory: &Path) -> Vec<Vec<rusqlite::types::Value>> {
    let store = rusqlite::Connection::open(directory.join("results/flows.sqlite")).unwrap();
    let query =
        "SELECT c.key, s.step, s.viscosity, s.normal_stress_difference, s.contacts, s.minimum_gap
         FROM samples s JOIN cases c ON c.id = s.case_id ORDER BY c.key, s.step";
    let mut statement = store.prepare(query).unwrap();
    let rows = statement
        .query_map([], |row| (0..6).map(|n| row.get(n)).collect())
        .unwrap();
    rows.map(Result::unwrap).collect()
}

/// The lattice vectors in the comment of a frame of extended XYZ.
fn lattice_of(comment: &str) -> [[f64; 3]; 3] {
    let lattice = comment.split('"').nth(1).unwrap();
    let numbers: Vec<f64> = lattice.split(' ').map(|x| x.parse().unwrap()).collect();
    assert_eq!(numbers.len(), 9, "{comment}");
    [0, 1, 2].map(|row| [0, 1, 2].map(|k| numbers[3 * row + k]))
}

/// Position and radius in a line of a frame: `species:S:1:pos:R:3:id:I:1:radius:R:1`.
fn sphere(line: &str) -> ([f64; 3], f64) {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [x, y, z, _, radius] = [1, 2, 3, 4, 5].map(|k| words[k].parse().unwrap());
    ([x, y, z], radius)
}

/// The smallest gap between any two of the spheres and of their images.
fn least_gap(spheres: &[([f64; 3], f64)], vectors: &[[f64; 3]; 3]) -> f64 {
    let steps = || -2..=2;
    let images = steps().flat_map(|a| steps().flat_map(move |b| steps().map(move |c| [a, b, c])));
    let images: Vec<[i32; 3]> = images.collect();
    let mut least = f64::INFINITY;
    for (i, (x, a)) in spheres.iter().enumerate() {
        for (j, (y, b)) in spheres.iter().enumerate() {
            for image in images.iter().filter(|image| i != j || **image != [0; 3]) {
                let between = [0, 1, 2].map(|k| {
                    let shift = (0..3).map(|row| f64::from(image[row]) * vectors[row][k]);
                    y[k] - x[k] + shift.sum::<f64>()
                });
                let distance = between.iter().map(|d| d * d).sum::<f64>().sqrt();
                least = least.min(distance - a - b);
            }
        }
    }
    least
}

#[test]
fn extension_goes_from_the_file_to_reports_pictures_and_exports() {
    let whole = folder("flows.toml", CAMPAIGN);
    sweep(
        whole.path(),
        &["run", "flows.toml", "--quiet", "--trajectory"],
    );
    let parts = folder("flows.toml", CAMPAIGN);
    for pause in [150, 400] {
        let mut process = spawn(
            parts.path(),
            &["run", "flows.toml", "--quiet", "--workers", "1"],
        );
        std::thread::sleep(Duration::from_millis(pause));
        send(&process, Signal::INT);
        process.wait().unwrap();
    }
    sweep(parts.path(), &["run", "flows.toml", "--quiet"]);
    let samples = samples(whole.path());
    assert!(samples.len() > 4 * 10);
    assert_eq!(samples, self::samples(parts.path()));

    let report: serde_json::Value =
        serde_json::from_str(&sweep(whole.path(), &["report", "flows.toml", "--json"])).unwrap();
    let points = report["points"].as_array().unwrap();
    let flows: Vec<&str> = points
        .iter()
        .map(|point| point["flow"].as_str().unwrap())
        .collect();
    assert_eq!(
        flows,
        [
            "planar-extension",
            "uniaxial",
            "mixture 0.7",
            "planar-extension"
        ]
    );
    for point in points {
        assert!(point["viscosity"].as_f64().unwrap() > 2.0, "{point}");
        assert!(point["layering"].is_null(), "{point}");
        assert!(point["percolating_x"].is_number(), "{point}");
    }
    let table = sweep(
        whole.path(),
        &["report", "flows.toml", "--where", "flow=mixture 0.7"],
    );
    assert!(table.contains("mixture 0.7"), "{table}");

    let frames = sweep(whole.path(), &["export", "flows.toml", "2"]);
    let comment = frames.lines().nth(1).unwrap();
    let vectors = lattice_of(comment);
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = vectors;
    let determinant =
        ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
    let volume = 30.0 * 4.0 / 3.0 * std::f64::consts::PI / 0.45;
    assert!(
        (determinant / volume - 1.0).abs() < 1e-6,
        "{determinant} {volume}"
    );
    assert!(ay != 0.0 && az != 0.0 && comment.contains("pbc=\"T T T\""));
    let last = frames
        .lines()
        .rev()
        .take(30)
        .map(sphere)
        .collect::<Vec<_>>();
    let comment = frames.lines().rev().nth(30).unwrap();
    let gap = least_gap(&last, &lattice_of(comment));
    // Rough spheres touch at a gap of 0.01, and some are in contact.
    assert!((0.0098..0.0102).contains(&gap), "{gap}");
    for case in ["1", "2", "4"] {
        sweep(
            whole.path(),
            &["draw", "flows.toml", case, "--out", "picture.svg"],
        );
        let picture = std::fs::read_to_string(whole.path().join("picture.svg")).unwrap();
        assert!(picture.matches("<circle").count() >= 30, "{case}");
    }
    sweep(
        whole.path(),
        &["report", "flows.toml", "--page", "page.html"],
    );
    let structure = sweep(whole.path(), &["structure", "flows.toml", "--json"]);
    let structure: serde_json::Value = serde_json::from_str(&structure).unwrap();
    for point in structure["points"].as_array().unwrap() {
        assert!(point["coordination"].as_f64().unwrap() > 0.0);
        assert!(point["g_r"]["r"].as_array().unwrap().len() > 3);
    }
}

/// A campaign of suspensions and layers whose segments have these flows.
fn in_segments(flows: &[&str]) -> String {
    let segment = |flow: &&str| format!("[[protocol.segment]]\nstrain = 0.12\n{flow}\n");
    let segments: String = flows.iter().map(segment).collect();
    let common = "friction = 0.5\nroughness = 0.01\nshear_rate = inf\nseeds = 1\nspheres = 60";
    format!(
        "name = \"flows\"\n[protocol]\n{segments}\
         [[grid]]\nvolume_fraction = 0.4\nhydrodynamics = \"lubrication\"\n{common}\n\
         [[grid]]\narea_fraction = 0.6\nhydrodynamics = \"stokesian-dynamics\"\n{common}\n"
    )
}

/// Runs this version of the campaign. Returns the share of its work that was done before.
fn run_with(at: &Path, flows: &[&str]) -> f64 {
    std::fs::write(at.join("flows.toml"), in_segments(flows)).unwrap();
    let is_new = !at.join("results").exists();
    let done = if is_new {
        0.0
    } else {
        let status = sweep(at, &["status", "flows.toml", "--json"]);
        let status: serde_json::Value = serde_json::from_str(&status).unwrap();
        status["work_done"].as_f64().unwrap()
    };
    sweep(at, &["run", "flows.toml", "--quiet"]);
    done
}

#[test]
fn a_segment_of_another_flow_has_runs_begin_anew_in_their_own_cell() {
    let [shear, planar] = ["flow = \"shear\"", "flow = \"planar-extension\""];
    let mixture = "flow = { shear = 1.0, extension = 0.7 }";
    let back = "flow = \"planar-extension\"\ndirection = -1";
    // The last column is the share of three segments that is done when there are two.
    for (flows, continued) in [
        ([shear, planar, back], 2.0 / 3.0),
        ([planar, mixture, shear], 0.0),
        ([mixture, planar, planar], 2.0 / 3.0),
    ] {
        // Segments are added one by one, and removed one by one.
        let [added, removed] = [folder("flows.toml", ""), folder("flows.toml", "")];
        let done = [1, 2, 3].map(|count| run_with(added.path(), &flows[..count]));
        let first = [3, 2, 1].map(|count| run_with(removed.path(), &flows[..count]));
        assert_eq!(first, [0.0; 3], "{flows:?}");
        assert_eq!(done[..2], [0.0; 2], "{flows:?}");
        assert!((done[2] - continued).abs() < 1e-9, "{flows:?}: {done:?}");
        let samples = samples(added.path());
        assert_eq!(samples.len(), 2 * (6 + 12 + 18), "{flows:?}");
        assert_eq!(samples, self::samples(removed.path()), "{flows:?}");
    }
}
