//! Runs in segments: output of `sweep segments`, and of `sweep report` for one.

use crate::harness::{Computed, folder, json, refused, run, sweep, words};

const CAMPAIGN: &str = r#"name = "segments"
[protocol]
time_step = 0.02
sample_every = 0.02
[[protocol.segment]]
strain = 1.0
discard = 0.4
[[protocol.segment]]
strain = 0.6
direction = -1
[[protocol.segment]]
oscillation = { amplitude = 0.2, cycles = 3, average_last = 2 }
[[protocol.segment]]
oscillation = { amplitude = 0.4, cycles = 2 }
[[grid]]
area_fraction = 0.7
friction = [0.0, 0.5]
roughness = 0.01
shear_rate = inf
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

static COMPUTED: Computed = Computed::new(CAMPAIGN, &[]);

#[test]
fn averages_of_segments_are_those_of_their_samples() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let found = json(at, &["segments", "s.sqlite"]);
    let points = found["points"].as_array().unwrap();
    assert_eq!(points.len(), 2);
    for (point, friction) in points.iter().zip([0.0, 0.5]) {
        assert_eq!(point["friction"], friction);
        let segments = point["segments"].as_array().unwrap();
        assert_eq!(segments.len(), 4);
        for (number, kept) in [[0.4, 1.0], [1.0, 1.6], [2.4, 4.0], [5.6, 7.2]]
            .iter()
            .enumerate()
        {
            let segment = &segments[number];
            assert_eq!(segment["runs"], 2);
            let strain = |key: &str| segment[key].as_f64().unwrap();
            assert!((strain("kept_from") - kept[0]).abs() < 1e-9);
            assert!((strain("end") - kept[1]).abs() < 1e-9);
            // The report of the segment has the same averages.
            let number = (number + 1).to_string();
            let report = json(at, &["report", "s.sqlite", "--segment", &number]);
            let averaged = report["points"].as_array().unwrap();
            let same = averaged
                .iter()
                .find(|of| of["friction"] == friction)
                .unwrap();
            let difference = strain("viscosity") - same["viscosity"].as_f64().unwrap();
            assert!(difference.abs() < 1e-12);
        }
        let ratio = segments[1]["reversal_ratio"].as_f64().unwrap();
        assert!((0.1..1.0).contains(&ratio), "{ratio}");
        assert!(segments[0]["reversal_ratio"].is_null());
        assert!(segments[1]["eta_prime"].is_null());
        assert_eq!(segments[2]["cycles"].as_array().unwrap().len(), 3);
        let mean: f64 = segments[2]["cycles"].as_array().unwrap()[1..]
            .iter()
            .map(|cycle| 0.5 * cycle["eta_prime"].as_f64().unwrap())
            .sum();
        assert!((segments[2]["eta_prime"].as_f64().unwrap() - mean).abs() < 1e-12);
        assert!(mean > 1.0);
        let strains = segments[1]["trace"]["strain"].as_array().unwrap();
        assert_eq!(strains.len(), 30);
        assert_eq!(strains[0], 0.0);
    }
}

#[test]
fn tables_and_figures_are_written() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let text = sweep(at, &["segments", "s.sqlite", "--wide"]);
    for words in [
        "2 shear, backwards",
        "3 oscillation γ0 0.2",
        "2.4 to 4",
        "η″",
    ] {
        assert!(text.contains(words), "{text}");
    }
    let files = [
        "segments",
        "s.sqlite",
        "--csv",
        "s.csv",
        "--parquet",
        "s.parquet",
        "--figure",
        "s.svg",
    ];
    let notes = words(&run(at, &files).stderr);
    for file in ["s.csv", "s.units.csv", "s.parquet", "s.svg"] {
        assert!(notes.contains(&format!("wrote {file}")), "{notes}");
    }
    let units = std::fs::read_to_string(at.join("s.units.csv")).unwrap();
    assert!(units.starts_with("column,unit,meaning\n") && units.contains("\nrecovered,1,"));
    let csv = std::fs::read_to_string(at.join("s.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 2 * 4);
    let mut names: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    names.sort_unstable();
    assert!(names.windows(2).all(|two| two[0] != two[1]), "{names:?}");
    let figure = std::fs::read_to_string(at.join("s.svg")).unwrap();
    for words in ["ν = 0.5, η′<", "ν = 0.5, η″<", "η′, η″ (μ)"] {
        assert!(figure.contains(words), "{words}: {figure}");
    }
    // The caps of the intervals of two oscillations of four curves.
    let caps = figure.matches("stroke-width=\"0.72\"").count();
    assert!(caps >= 4 * 2 * 3, "{caps}");
    // Curves with intervals at the same amplitude are drawn at it: two amplitudes, two positions.
    let bars = figure.split("<path d=\"M").skip(1).filter_map(|path| {
        let (path, style) = path.split_once('"')?;
        let (from, to) = path.split_once('L')?;
        let is_bar = style.split_once("/>")?.0.contains("stroke-width=\"0.72\"");
        let (x, along) = (from.split_once(' ')?.0, to.split_once(' ')?.0);
        (is_bar && x == along).then(|| x.to_owned())
    });
    let places: std::collections::BTreeSet<String> = bars.collect();
    assert_eq!(places.len(), 2, "{places:?}");
    let trace = [
        "report",
        "s.sqlite",
        "--segment",
        "2",
        "--figure",
        "t.svg",
        "--kind",
        "trace",
    ];
    sweep(at, &trace);
    assert!(
        at.join("t.svg").exists() && at.join("s.svg").exists() && at.join("s.parquet").exists()
    );
    let plain = sweep(at, &["report", "s.sqlite"]);
    assert!(
        plain.contains("in segment 4 after a strain of 5.6"),
        "{plain}"
    );
}

#[test]
fn what_was_computed_before_a_segment_more_is_not_to_do_again() {
    let computed = COMPUTED.folder();
    let at = computed.path();
    let longer = CAMPAIGN.replace("[[grid]]", "[[protocol.segment]]\nstrain = 2.4\n[[grid]]");
    std::fs::write(at.join("c.toml"), longer).unwrap();
    let status = json(at, &["status", "c.toml", "--store", "s.sqlite"]);
    // A strain of 7.2 of 9.6.
    let done = status["work_done"].as_f64().unwrap();
    assert!((done - 0.75).abs() < 1e-9, "{status}");
    let plan = json(at, &["plan", "c.toml", "--store", "s.sqlite"]);
    assert_eq!(plan["ended"], 0);
    assert!(plan["kinds"][0]["cases"] == 4, "{plan}");
}

#[test]
fn what_there_is_not_is_said() {
    let computed = COMPUTED.folder();
    let at = computed.path();
    let error = refused(at, &["report", "s.sqlite", "--segment", "5"]);
    assert!(
        error.contains("the campaign has segments 1 to 4"),
        "{error}"
    );
    let plain = CAMPAIGN
        .split("[[protocol.segment]]")
        .next()
        .unwrap()
        .to_owned()
        + "strain = 0.2\ndiscard = 0.1\n"
        + &CAMPAIGN[CAMPAIGN.find("[[grid]]").unwrap()..];
    let folder = folder("plain.toml", &plain);
    let at = folder.path();
    sweep(
        at,
        &["run", "plain.toml", "--quiet", "--store", "plain.sqlite"],
    );
    let error = refused(at, &["segments", "plain.sqlite"]);
    assert!(error.starts_with("the campaign has no segments"), "{error}");
    let error = refused(at, &["report", "plain.sqlite", "--segment", "1"]);
    assert!(error.contains("the campaign has no segments"), "{error}");
}

/// A campaign whose segments have these rates or stresses, and the rows of its tables.
fn shear_of_segments(imposed: [&str; 2]) -> [Vec<[f64; 2]>; 2] {
    let [first, second] = imposed;
    let text = format!(
        "name = \"own\"\n[protocol]\ntime_step = 0.02\n\
         [[protocol.segment]]\nstrain = 0.1\n{first}\n\
         [[protocol.segment]]\nstrain = 0.1\n{second}\n\
         [[grid]]\narea_fraction = 0.6\nfriction = 0.5\nroughness = 0.01\nseeds = 1\n\
         spheres = 20\nhydrodynamics = \"ball-melrose\"\ntangential = \"coulomb\"\n"
    );
    let folder = folder("c.toml", &text);
    let at = folder.path();
    sweep(at, &["run", "c.toml", "--store", "s.sqlite", "-q"]);
    let shear = |of: &serde_json::Value| {
        ["shear_rate", "shear_stress"].map(|key| of[key].as_f64().unwrap_or(f64::NAN))
    };
    let segments = json(at, &["segments", "s.sqlite"]);
    let segments = segments["points"][0]["segments"].as_array().unwrap();
    let of_segments: Vec<[f64; 2]> = segments.iter().map(shear).collect();
    let of_reports = ["1", "2"].map(|number| {
        let of = ["report", "s.sqlite", "--segment", number];
        let named = shear(&json(at, &of)["points"][0]);
        // The table for people, the table of runs, and selections name it alike.
        let imposed = usize::from(!named[1].is_nan());
        let (key, value) = (["shear_rate", "shear_stress"][imposed], named[imposed]);
        let asked = format!("{key}={value}");
        let text = sweep(at, &[&of[..], &["--where", &asked]].concat());
        assert!(
            text.contains(&format!("only where {key} = {value}\n")),
            "{text}"
        );
        sweep(
            at,
            &[&of[..], &["--csv", "p.csv", "--runs", "r.csv"]].concat(),
        );
        for file in ["p.csv", "r.csv"] {
            let csv = std::fs::read_to_string(at.join(file)).unwrap();
            let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
            let (names, cells) = (lines.next().unwrap(), lines.next().unwrap());
            let place = names.iter().position(|name| *name == key).unwrap();
            assert_eq!(cells[place].parse(), Ok(value), "{file}: {csv}");
        }
        named
    });
    [of_segments, of_reports.to_vec()]
}

#[test]
fn a_segment_has_its_own_rate_or_stress_everywhere() {
    for (imposed, wanted) in [
        (
            ["shear_rate = 0.1", "shear_rate = 100.0"],
            [(0, 0.1), (0, 100.0)],
        ),
        (
            ["shear_rate = 0.1", "shear_stress = 10.0"],
            [(0, 0.1), (1, 10.0)],
        ),
        (
            ["shear_stress = 0.1", "shear_stress = 10.0"],
            [(1, 0.1), (1, 10.0)],
        ),
        (
            ["shear_stress = 0.1", "shear_rate = 100.0"],
            [(1, 0.1), (0, 100.0)],
        ),
    ] {
        let tables = shear_of_segments(imposed);
        for rows in &tables {
            for (row, (place, value)) in rows.iter().zip(wanted) {
                assert_eq!(row[place], value, "{imposed:?}: {tables:?}");
                // A rate follows from a stress, and a stress is empty where a rate is imposed.
                let rate = row[0] > 0.0;
                assert!(rate && (place == 1 || row[1].is_nan()), "{tables:?}");
            }
        }
    }
}
