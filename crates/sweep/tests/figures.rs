//! Figures, tables and exports as they go into a paper, drawn from a small store.
#![expect(
    clippy::unwrap_used,
    reason = "tests: a panic is the failure, and names state the fact"
)]

use assert_cmd::cargo::cargo_bin;
use parquet::file::reader::{FileReader, SerializedFileReader};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

const CAMPAIGN: &str = r#"name = "paper"
[protocol]
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

fn run(at: &Path, arguments: &[&str]) -> Output {
    Command::new(cargo_bin("sweep"))
        .current_dir(at)
        .args(arguments)
        .output()
        .unwrap()
}

fn sweep(at: &Path, arguments: &[&str]) -> String {
    let output = run(at, arguments);
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// What is said of bad input.
fn refused(at: &Path, arguments: &[&str]) -> String {
    let output = run(at, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
    assert!(output.stdout.is_empty());
    // Lines are broken to fit a terminal.
    let said = String::from_utf8(output.stderr).unwrap();
    let words: Vec<&str> = said
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect();
    words.join(" ")
}

/// A directory with a copy of the store, which is computed once.
fn directory() -> tempfile::TempDir {
    static STORE: OnceLock<Vec<u8>> = OnceLock::new();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("s.sqlite");
    let bytes = STORE.get_or_init(|| {
        std::fs::write(directory.path().join("c.toml"), CAMPAIGN).unwrap();
        sweep(
            directory.path(),
            &["run", "c.toml", "--store", "s.sqlite", "-q"],
        );
        std::fs::read(&path).unwrap()
    });
    std::fs::write(&path, bytes).unwrap();
    directory
}

/// The figure as SVG.
fn figure(at: &Path, more: &[&str]) -> String {
    sweep(
        at,
        &[&["report", "s.sqlite", "--figure", "f.svg"], more].concat(),
    );
    std::fs::read_to_string(at.join("f.svg")).unwrap()
}

/// All texts of a figure, with its title and what it says of itself left out.
fn words(svg: &str) -> Vec<&str> {
    svg.split("<text ")
        .skip(1)
        .map(|part| {
            let (_, rest) = part.split_once('>').unwrap();
            rest.split_once('<').unwrap().0
        })
        .collect()
}

const ONE: [&str; 4] = ["--where", "friction=0.3", "--where", "area_fraction=0.65"];

#[test]
fn figures_carry_their_size_font_and_origin() {
    let directory = directory();
    let at = directory.path();
    let json: serde_json::Value =
        serde_json::from_str(&sweep(at, &["show", "s.sqlite", "1", "--json"])).unwrap();
    let key = &json["key"].as_str().unwrap()[..16];
    let svg = figure(at, &[]);
    for part in [
        "width=\"85.000mm\"",
        "viewBox=\"0 0 24094 ",
        "@font-face",
        "<metadata>",
        "campaign paper",
        key,
        "build ",
    ] {
        assert!(svg.contains(part), "{part}");
    }
    for (file, width) in [("f.png", "85mm"), ("g.png", "180mm")] {
        sweep(
            at,
            &["report", "s.sqlite", "--figure", file, "--width", width],
        );
        let decoder =
            png::Decoder::new(std::io::Cursor::new(std::fs::read(at.join(file)).unwrap()));
        let reader = decoder.read_info().unwrap();
        let info = reader.info();
        let dots = info.pixel_dims.unwrap();
        assert_eq!((dots.xppu, dots.unit), (23622, png::Unit::Meter));
        let millimetres: f64 = width.trim_end_matches("mm").parse().unwrap();
        assert!((f64::from(info.width) - millimetres / 25.4 * 600.0).abs() < 1.0);
        let source = info.utf8_text.iter().find(|text| text.keyword == "Source");
        assert!(source.unwrap().get_text().unwrap().contains(key));
    }
    sweep(at, &["report", "s.sqlite", "--figure", "f.pdf"]);
    let pdf = std::fs::read(at.join("f.pdf")).unwrap();
    assert!(pdf.starts_with(b"%PDF-"));
    let text = String::from_utf8_lossy(&pdf);
    // What is not plain Latin is written as hexadecimal digits of UTF-16.
    let coded: Vec<String> = key
        .encode_utf16()
        .map(|unit| format!("{unit:04X}"))
        .collect();
    let coded = coded.concat();
    for part in ["/FontFile2", "/ToUnicode", "/MediaBox [0 0 240.9", &coded] {
        assert!(text.contains(part), "{part}");
    }
    let error = refused(at, &["report", "s.sqlite", "--figure", "f.gif"]);
    assert!(error.contains(".svg, .pdf or .png"), "{error}");
}

#[test]
fn lines_stop_at_breaks_and_at_points_without_a_result() {
    let directory = directory();
    let at = directory.path();
    let drawn = |svg: &str| {
        // Lines of curves have the width of curves.
        svg.matches("stroke-width=\"90\"").count()
    };
    let whole = figure(at, &ONE);
    assert_eq!(
        words(&whole)
            .iter()
            .filter(|w| w.contains("dilute"))
            .count(),
        1
    );
    assert!(!words(&whole).contains(&"no result"));
    let store = rusqlite::Connection::open(at.join("s.sqlite")).unwrap();
    store
        .execute_batch(
            "UPDATE cases SET state = 'failed' WHERE shear_rate = 1.0 AND friction > 0.2 AND area_fraction > 0.6;
             DELETE FROM results WHERE case_id IN (SELECT id FROM cases WHERE state = 'failed');
             INSERT INTO failures (case_id, attempt, error, step, strain, process, failed_at)
                 SELECT id, 1, 'made up', 3, 0.015, 1, 0 FROM cases WHERE state = 'failed';",
        )
        .unwrap();
    drop(store);
    sweep::store::accept_changes(&at.join("s.sqlite")).unwrap();
    let broken = figure(at, &ONE);
    assert!(words(&broken).contains(&"no result"));
    // From 0.1 over 1 to 10 it was one line; now nothing joins 0.1 and 10.
    assert_eq!((drawn(&whole), drawn(&broken)), (1, 0));
}

#[test]
fn ticks_have_one_style_and_traces_show_what_is_discarded() {
    let directory = directory();
    let at = directory.path();
    let svg = figure(at, &ONE);
    for tick in ["0", "0.1", "1", "10", "∞"] {
        assert!(words(&svg).contains(&tick), "{tick}");
    }
    let svg = figure(at, &[&ONE[..], &["--kind", "trace"]].concat());
    assert!(words(&svg).contains(&"discarded"));
    assert!(!words(&figure(at, &ONE)).contains(&"discarded"));
}

#[test]
fn an_axis_with_one_value_is_refused() {
    let directory = directory();
    let at = directory.path();
    let report = ["report", "s.sqlite", "--figure", "f.svg"];
    for (option, axis) in [("--along", "spheres"), ("--panels", "spheres")] {
        let error = refused(at, &[&report[..], &[option, axis]].concat());
        for part in [option, "same spheres", "friction", "shear_rate"] {
            assert!(error.contains(part), "{error}");
        }
    }
    assert!(!at.join("f.svg").exists());
}

#[test]
fn panels_share_a_legend_and_name_their_value() {
    let directory = directory();
    let at = directory.path();
    let svg = figure(at, &["--panels", "area_fraction"]);
    assert!(svg.contains("width=\"180.000mm\""));
    for word in ["c = 0.5", "c = 0.65", "ν = 0", "ν = 0.3"] {
        assert_eq!(
            words(&svg).iter().filter(|w| **w == word).count(),
            1,
            "{word}"
        );
    }
    let error = refused(
        at,
        &[
            "report",
            "s.sqlite",
            "--figure",
            "f.svg",
            "--panels",
            "shear_rate",
        ],
    );
    assert!(error.contains("run along shear_rate"), "{error}");
}

#[test]
fn several_stores_share_a_figure() {
    let directory = directory();
    let at = directory.path();
    let other = CAMPAIGN
        .replace("\"paper\"", "\"other\"")
        .replace("seeds = 2", "seeds = [7]");
    std::fs::write(at.join("o.toml"), other).unwrap();
    sweep(at, &["run", "o.toml", "--store", "o.sqlite", "-q"]);
    let both = ["report", "s.sqlite", "o.sqlite"];
    sweep(at, &[&both[..], &["--figure", "f.svg"], &ONE].concat());
    let svg = std::fs::read_to_string(at.join("f.svg")).unwrap();
    for word in ["paper", "other"] {
        assert!(words(&svg).contains(&word), "{:?}", words(&svg));
        assert!(svg.contains(&format!("campaign {word}")));
    }
    let error = refused(at, &both);
    assert!(error.contains("--figure"), "{error}");
}

#[test]
fn a_figure_looks_as_it_is_asked_to() {
    let directory = directory();
    let at = directory.path();
    let report = ["report", "s.sqlite", "--figure", "f.svg"];
    let asked = |more: &[&str]| figure(at, &[&ONE[..2], more].concat());
    assert!(words(&asked(&[])).contains(&"c = 0.65"));
    assert!(!words(&asked(&["--legend", "none"])).contains(&"c = 0.65"));
    for place in ["inside", "right"] {
        assert!(words(&asked(&["--legend", place])).contains(&"c = 0.65"));
    }
    let svg = asked(&["--label", "thin", "--label", "thick", "--x-label", "rate"]);
    for word in ["thin", "thick", "rate"] {
        assert!(words(&svg).contains(&word), "{word}");
    }
    let error = refused(at, &[&report[..], &ONE[..2], &["--label", "thin"]].concat());
    assert!(
        error.contains("1 labels for 2 curves") && error.contains("c = 0.65"),
        "{error}"
    );
    // The size of labels, in hundredths of a point.
    assert!(asked(&["--font-size", "11"]).contains("font-size=\"1100\""));
    assert!(asked(&["--intervals", "bands"]).contains("opacity=\"0.22\""));
    let logarithmic = asked(&["--log-y", "--y-range", "1..100", "--x-range", "0.1..1"]);
    for word in ["1", "10", "100"] {
        assert!(words(&logarithmic).contains(&word), "{word}");
    }
    assert!(!words(&logarithmic).contains(&"∞"));
    let error = refused(at, &[&report[..], &["--y-range", "3..1"]].concat());
    assert!(error.contains("two dots"), "{error}");
    std::fs::write(
        at.join("group.toml"),
        "width = \"120mm\"\ncolours = [\"#123456\", \"#654321\"]\nlegend = \"none\"\n",
    )
    .unwrap();
    let svg = asked(&["--style", "group.toml"]);
    assert!(svg.contains("width=\"120.000mm\"") && svg.contains("#123456"));
    let svg = asked(&[
        "--style",
        "group.toml",
        "--width",
        "85mm",
        "--legend",
        "right",
    ]);
    assert!(svg.contains("width=\"85.000mm\"") && words(&svg).contains(&"c = 0.65"));
    std::fs::write(at.join("group.toml"), "colors = []").unwrap();
    let error = refused(at, &[&report[..], &["--style", "group.toml"]].concat());
    assert!(
        error.contains("--style") && error.contains("colors"),
        "{error}"
    );
}

#[test]
fn more_than_eight_curves_of_a_number_go_by_its_order() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let many = CAMPAIGN
        .replace(
            "friction = [0.0, 0.3]",
            "friction = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]",
        )
        .replace("area_fraction = [0.5, 0.65]", "area_fraction = 0.5")
        .replace(
            "shear_rate = [0, 0.1, 1.0, 10.0, inf]",
            "shear_rate = [1.0, inf]",
        )
        .replace("seeds = 2", "seeds = 1");
    std::fs::write(at.join("m.toml"), many).unwrap();
    sweep(at, &["run", "m.toml", "--store", "s.sqlite", "-q"]);
    let svg = figure(at, &[]);
    let labels: Vec<&str> = words(&svg)
        .into_iter()
        .filter(|w| w.starts_with("ν ="))
        .collect();
    assert_eq!(labels.len(), 11);
    assert!(
        svg.contains("#440154") && svg.contains("#6ccd5a"),
        "both ends of the map"
    );
}

#[test]
fn the_table_fits_eighty_columns_and_splits_no_number() {
    let directory = directory();
    let at = directory.path();
    let lines = |more: &[&str]| -> Vec<String> {
        let text = sweep(at, &[&["report", "s.sqlite"], more].concat());
        text.lines().map(str::to_owned).collect()
    };
    let width = |lines: &[String]| {
        let rule = lines.iter().filter(|line| line.starts_with('─'));
        rule.map(|line| line.chars().count()).max().unwrap()
    };
    let usual = lines(&[]);
    assert!(width(&usual) <= 80, "{}", width(&usual));
    assert!(usual.iter().any(|line| line.contains("--wide")));
    let rows = |lines: &[String]| {
        lines
            .iter()
            .filter(|line| line.starts_with(' ') && line.contains(" ± "))
            .count()
    };
    assert_eq!(rows(&usual), 20, "a line for each point");
    let wide = lines(&["--wide"]);
    assert!(width(&wide) > 80 && wide.iter().any(|line| line.contains("unconverged")));
    let si = lines(&["--format", "si"]);
    assert!(rows(&si) == 0 && si.iter().any(|line| line.contains(')')));
    let latex = sweep(
        at,
        &["report", "s.sqlite", "--latex", "-", "--format", "si"],
    );
    assert_eq!(latex.matches("\\\\\n").count(), 21);
    assert!(latex.contains("$\\Gamma$") && latex.contains("$\\infty$"));
    let latex = sweep(at, &["report", "s.sqlite", "--latex", "-"]);
    assert_eq!(latex.matches(" \\pm ").count() % 20, 0);
}

#[test]
fn runs_and_samples_are_typed_tables_with_units() {
    let directory = directory();
    let at = directory.path();
    let one = ["report", "s.sqlite", "--where", "friction=0.3"];
    let json: serde_json::Value =
        serde_json::from_str(&sweep(at, &["report", "s.sqlite", "--json"])).unwrap();
    for (option, name, rows) in [("--runs", "runs", 20), ("--samples", "samples", 200)] {
        let files = [format!("{name}.csv"), format!("{name}.parquet")];
        for file in &files {
            sweep(at, &[&one[..], &[option, file]].concat());
        }
        let mut table = csv::Reader::from_path(at.join(&files[0])).unwrap();
        let heads: Vec<String> = table.headers().unwrap().iter().map(str::to_owned).collect();
        assert_eq!(table.records().count(), rows, "{name}");
        let mut units = csv::Reader::from_path(at.join(format!("{name}.units.csv"))).unwrap();
        for (row, head) in units.records().zip(&heads) {
            let row = row.unwrap();
            assert_eq!(&row[0], head);
            assert!(!row[2].is_empty(), "the meaning of {head}");
        }
        let file = std::fs::File::open(at.join(&files[1])).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        let about = reader.metadata().file_metadata();
        assert_eq!(about.num_rows(), i64::try_from(rows).unwrap());
        let fields = about.schema_descr().columns();
        let typed = |name: &str| {
            let field = fields.iter().find(|field| field.name() == name);
            field.unwrap().physical_type().to_string()
        };
        assert_eq!(typed("key"), "BYTE_ARRAY");
        assert_eq!(
            (typed("seed"), typed("viscosity")),
            ("INT64".into(), "DOUBLE".into())
        );
        let entries = about.key_value_metadata().unwrap();
        let unit = entries.iter().find(|entry| entry.key == "viscosity.unit");
        assert_eq!(unit.unwrap().value.as_deref(), Some("mu"));
    }
    // The mean over the runs of a point is that of the report.
    let mut table = csv::Reader::from_path(at.join("runs.csv")).unwrap();
    let heads = table.headers().unwrap().clone();
    let place = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let (c, rate, viscosity) = (
        place("area_fraction"),
        place("shear_rate"),
        place("viscosity"),
    );
    let of_point: Vec<f64> = table
        .records()
        .map(Result::unwrap)
        .filter(|row| &row[c] == "0.65" && &row[rate] == "1")
        .map(|row| row[viscosity].parse().unwrap())
        .collect();
    let points = json["points"].as_array().unwrap();
    let point = points
        .iter()
        .find(|p| p["friction"] == 0.3 && p["area_fraction"] == 0.65 && p["shear_rate"] == 1.0);
    let mean = of_point.iter().sum::<f64>() / of_point.len() as f64;
    assert!((mean / point.unwrap()["viscosity"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    let error = refused(at, &[&one[..], &["--runs", "runs.xlsx"]].concat());
    assert!(
        error.contains("--runs") && error.contains(".parquet"),
        "{error}"
    );
}

#[test]
fn physical_units_are_those_of_the_laboratory() {
    let directory = directory();
    let at = directory.path();
    let table = |more: &[&str]| -> Vec<Vec<String>> {
        let text = sweep(
            at,
            &[&["report", "s.sqlite", "--csv", "-"], &ONE[..], more].concat(),
        );
        let mut rows = csv::ReaderBuilder::new()
            .has_headers(false)
            .from_reader(text.as_bytes());
        let rows = rows.records();
        rows.map(|row| row.unwrap().iter().map(str::to_owned).collect())
            .collect()
    };
    let (own, physical) = (
        table(&[]),
        table(&["--units", "a=2um,mu=1.5mPas,f_crit=3pN"]),
    );
    let place = |name: &str| own[0].iter().position(|head| head == name).unwrap();
    let number = |row: &[String], name: &str| row[place(name)].parse::<f64>().unwrap();
    let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} and {b}");
    // Rows: a name each, then Γ = 0, 0.1, 1, 10, ∞.
    for (a, b) in own.iter().zip(&physical).skip(2).take(3) {
        near(number(b, "viscosity"), 1.5e-3 * number(a, "viscosity"));
        near(number(b, "roughness"), 2e-6 * number(a, "roughness"));
        let rate = number(a, "shear_rate") * 3e-12 / (6.0 * std::f64::consts::PI * 1.5e-3 * 4e-12);
        near(number(b, "shear_rate"), rate);
        near(number(b, "n1"), 1.5e-3 * rate * number(a, "n1"));
        near(number(b, "friction"), number(a, "friction"));
    }
    assert_eq!(physical[5][place("n1")], "", "a stress at an infinite rate");
    let svg = figure(
        at,
        &["--units", "a=2um,mu=1.5mPas", "--where", "friction=0"],
    );
    assert!(words(&svg).iter().any(|word| word.contains("(Pa s)")));
    let error = refused(at, &["report", "s.sqlite", "--units", "a=2um"]);
    assert!(error.contains("mu"), "{error}");
}
