//! What is made of a store: tables, figures, the story of a run, trajectories, the page.
#![expect(
    clippy::unwrap_used,
    reason = "tests: a panic is the failure, and names state the fact"
)]

use assert_cmd::Command;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

const CAMPAIGN: &str = r#"name = "small"
[protocol]
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

/// A store with results and frames, made once; tests copy it.
fn original() -> &'static Path {
    static DIRECTORY: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    &DIRECTORY
        .get_or_init(|| {
            let directory = tempfile::tempdir().unwrap();
            std::fs::write(directory.path().join("small.toml"), CAMPAIGN).unwrap();
            sweep(
                directory.path(),
                &["run", "small.toml", "--trajectory", "--quiet"],
            )
            .code(0);
            let store = directory.path().join("results/small.sqlite");
            (directory, store)
        })
        .1
}

/// A directory with a copy of that store in it.
fn directory() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    std::fs::copy(original(), directory.path().join("s.sqlite")).unwrap();
    directory
}

fn sweep(directory: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("sweep")
        .unwrap()
        .current_dir(directory)
        .args(arguments)
        .assert()
}

fn stdout(directory: &Path, arguments: &[&str]) -> String {
    let assert = sweep(directory, arguments).code(0);
    String::from_utf8(assert.get_output().stdout.clone()).unwrap()
}

/// The store as it might be after a bad night.
fn spoilt(directory: &Path, statements: &str) {
    let path = directory.join("s.sqlite");
    let store = rusqlite::Connection::open(&path).unwrap();
    store.execute_batch(statements).unwrap();
    drop(store);
    sweep::store::accept_changes(&path).unwrap();
}

/// Gives every case the key of the parameters it has now.
fn named_anew(directory: &Path) {
    let path = directory.join("s.sqlite");
    let store = rusqlite::Connection::open(&path).unwrap();
    let cases: Vec<(i64, String, i64, i64)> = store
        .prepare("SELECT id, params, seed, sample_stride FROM cases")
        .unwrap()
        .query_map([], |row| {
            Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
        })
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap();
    for (id, params, seed, sample_stride) in cases {
        let case = sweep::case::Case {
            params: serde_json::from_str(&params).unwrap(),
            seed: seed.unsigned_abs(),
            steps: 1,
            sample_stride: sample_stride.unsigned_abs(),
        };
        store
            .execute(
                "UPDATE cases SET key = ?2, params = ?3 WHERE id = ?1",
                (
                    id,
                    case.key().to_string(),
                    serde_json::to_string(&case.params).unwrap(),
                ),
            )
            .unwrap();
    }
    drop(store);
    sweep::store::accept_changes(&path).unwrap();
}

#[test]
fn csv_has_the_numbers_of_the_report_and_its_units_beside_it() {
    let directory = directory();
    let at = directory.path();
    sweep(at, &["report", "s.sqlite", "--csv", "t.csv"])
        .code(0)
        .stdout("");
    let json: serde_json::Value =
        serde_json::from_str(&stdout(at, &["report", "s.sqlite", "--json"])).unwrap();
    let mut reader = csv::Reader::from_path(at.join("t.csv")).unwrap();
    let header = reader.headers().unwrap().clone();
    let place = |name: &str| header.iter().position(|head| head == name).unwrap();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 6);
    for (row, point) in rows.iter().zip(json["points"].as_array().unwrap()) {
        for name in [
            "viscosity",
            "viscosity_ci95",
            "contacts_per_sphere",
            "friction",
        ] {
            let number: f64 = row[place(name)].parse().unwrap();
            assert_eq!(Some(number), point[name].as_f64(), "{name}");
        }
    }
    assert_eq!(&rows[2][place("shear_rate")], "inf");
    let mut units = csv::Reader::from_path(at.join("t.units.csv")).unwrap();
    let described: Vec<String> = units
        .records()
        .map(|row| row.unwrap()[0].to_owned())
        .collect();
    assert_eq!(described, header.iter().collect::<Vec<_>>());
}

#[test]
fn json_is_printed_beside_files_and_never_with_them_on_standard_output() {
    let directory = directory();
    let at = directory.path();
    let alone = stdout(at, &["report", "s.sqlite", "--json"]);
    for file in [
        ["--csv", "t.csv"],
        ["--figure", "f.svg"],
        ["--page", "p.html"],
        ["--parquet", "t.parquet"],
        ["--markdown", "t.md"],
    ] {
        let both = stdout(at, &["report", "s.sqlite", "--json", file[0], file[1]]);
        assert_eq!(both, alone, "{file:?}");
        assert!(at.join(file[1]).exists());
    }
    for argument in ["--csv", "--markdown"] {
        sweep(at, &["report", "s.sqlite", "--json", argument, "-"])
            .code(2)
            .stdout("");
    }
}

#[test]
fn markdown_has_a_row_per_point() {
    let directory = directory();
    let text = stdout(directory.path(), &["report", "s.sqlite", "--markdown", "-"]);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 8);
    assert!(lines[0].contains("viscosity (mu)"));
    let bars = |line: &str| line.matches('|').count();
    assert!(lines.iter().all(|line| bars(line) == bars(lines[0])));
}

#[test]
fn figures_of_every_kind_are_drawn() {
    let directory = directory();
    let at = directory.path();
    for kind in ["viscosity", "contacts", "trace", "normal-stress"] {
        for file in ["f.svg", "f.png", "f.pdf"] {
            let along = if kind == "contacts" {
                "shear_rate"
            } else {
                "friction"
            };
            sweep(
                at,
                &[
                    "report", "s.sqlite", "--figure", file, "--kind", kind, "--along", along,
                ],
            )
            .code(0);
            let bytes = std::fs::read(at.join(file)).unwrap();
            if file == "f.png" {
                assert!(bytes.starts_with(b"\x89PNG\r\n"), "{kind}");
                let width = u32::from_be_bytes(bytes[16..20].try_into().unwrap());
                assert_eq!(width, 2008, "85 mm at 600 dots per inch");
            } else if file == "f.pdf" {
                assert!(bytes.starts_with(b"%PDF-"), "{kind}");
            } else {
                let text = String::from_utf8(bytes).unwrap();
                assert!(
                    text.contains("<svg") && text.to_lowercase().contains("#0072b2"),
                    "{kind}"
                );
            }
        }
    }
    sweep(at, &["report", "s.sqlite", "--figure", "f.svg"]).code(0);
    let text = std::fs::read_to_string(at.join("f.svg")).unwrap();
    for part in ["∞", "ν = 0.3", "shear rate Γ", "stroke-dasharray"] {
        assert!(text.contains(part), "{part}");
    }
    sweep(at, &["report", "s.sqlite", "--figure", "f.gif"]).code(2);
}

#[test]
fn show_tells_the_story_of_a_run_by_number_and_by_key() {
    let directory = directory();
    let at = directory.path();
    let text = stdout(at, &["show", "s.sqlite", "5"]);
    for part in [
        "case 5",
        "ν 0",
        "Γ inf",
        "seed 1",
        "strain 0.400 of 0.400",
        "┼",
        "build",
    ] {
        assert!(text.contains(part), "{part} not in {text}");
    }
    assert!(!text.contains('\u{1b}'), "no escape sequences");
    let story: serde_json::Value =
        serde_json::from_str(&stdout(at, &["show", "s.sqlite", "5", "--json"])).unwrap();
    assert_eq!(story["samples"].as_array().unwrap().len(), 20);
    let key = story["key"].as_str().unwrap();
    assert_eq!(stdout(at, &["show", "s.sqlite", &key[..12]]), text);
    sweep(at, &["show", "s.sqlite", "zz"]).code(2).stdout("");
    sweep(at, &["show", "s.sqlite", ""]).code(2).stdout("");
}

#[test]
fn frames_are_exported_with_the_sheared_cell_and_contacts() {
    let directory = directory();
    let at = directory.path();
    sweep(at, &["export", "s.sqlite", "6", "--out", "l.xyz"]).code(0);
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
    let table = stdout(
        at,
        &[
            "export", "s.sqlite", "6", "--format", "csv", "--every", "10",
        ],
    );
    assert_eq!(table.lines().count(), 2 * 30 + 1);
}

#[test]
fn frames_change_no_bit_of_a_run() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    std::fs::write(at.join("small.toml"), CAMPAIGN).unwrap();
    sweep(at, &["run", "small.toml", "--quiet"]).code(0);
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
    assert_eq!(plain.len(), 12 * 20);
    assert_eq!(plain, samples(original()));
    sweep(at, &["export", "results/small.sqlite", "1"]).code(2);
}

#[test]
fn page_is_whole_and_names_no_other_place() {
    let directory = directory();
    let at = directory.path();
    sweep(at, &["report", "s.sqlite", "--page", "p.html"]).code(0);
    let page = std::fs::read_to_string(at.join("p.html")).unwrap();
    assert!(page.contains("connect-src 'none'"));
    for placeholder in ["@DATA@", "@CSS@", "@JS@", "@CONNECT@"] {
        assert!(!page.contains(placeholder));
    }
    let without_names = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!without_names.contains("http://") && !without_names.contains("https://"));
}

#[test]
fn stores_without_results_give_sensible_output() {
    let hostile = "</script><img src=x onerror=alert(1)>";
    let failed = format!(
        "DELETE FROM results; DELETE FROM samples; DELETE FROM frames; UPDATE cases SET state = 'failed';
         INSERT INTO failures (case_id, attempt, error, step, strain, process, failed_at)
             SELECT id, 1, '{hostile}', 3, 0.015, 1, 0 FROM cases;
         UPDATE campaign SET name = '{hostile}', text = '{hostile}@DATA@@JS@'"
    );
    let pending = "DELETE FROM results; DELETE FROM samples; DELETE FROM frames;
                   UPDATE cases SET state = 'pending', steps_done = 0";
    let no_grid = "UPDATE cases SET position = NULL";
    for (statements, code) in [
        (failed.as_str(), 0),
        (pending, 0),
        (no_grid, 0),
        (
            "DELETE FROM campaign; DELETE FROM results; UPDATE cases SET state = 'pending'",
            2,
        ),
    ] {
        let directory = directory();
        let at = directory.path();
        spoilt(at, statements);
        for output in ["--csv", "--markdown"] {
            sweep(at, &["report", "s.sqlite", output, "-"]).code(code);
        }
        sweep(at, &["report", "s.sqlite", "--page", "p.html"]).code(code);
        if let Ok(page) = std::fs::read_to_string(at.join("p.html")) {
            assert!(!page.contains("<img"), "markup is escaped");
            assert_eq!(page.matches("</script>").count(), 2);
        }
        for kind in ["viscosity", "trace"] {
            sweep(
                at,
                &["report", "s.sqlite", "--figure", "f.svg", "--kind", kind],
            )
            .code(2);
        }
    }
    let directory = directory();
    spoilt(directory.path(), &failed);
    let text = stdout(directory.path(), &["show", "s.sqlite", "1"]);
    assert!(text.contains("no trace yet") && text.contains("attempt 1 failed at step 3"));
}

#[test]
fn views_are_for_any_client() {
    let directory = directory();
    let store = rusqlite::Connection::open(directory.path().join("s.sqlite")).unwrap();
    let runs: i64 = store
        .query_row("SELECT count(*) FROM runs WHERE viscosity > 1", [], |row| {
            row.get(0)
        })
        .unwrap();
    assert_eq!(runs, 12);
    let report: serde_json::Value =
        serde_json::from_str(&stdout(directory.path(), &["report", "s.sqlite", "--json"])).unwrap();
    let rows: Vec<(f64, f64)> = store
        .prepare("SELECT viscosity, standard_error FROM viscosity_vs_shear_rate")
        .unwrap()
        .query_map([], |row| Ok((row.get(0)?, row.get(1)?)))
        .unwrap()
        .map(Result::unwrap)
        .collect();
    assert_eq!(rows.len(), 6);
    for ((mean, error), point) in rows.iter().zip(report["points"].as_array().unwrap()) {
        assert!((mean / point["viscosity"].as_f64().unwrap() - 1.0).abs() < 1e-12);
        // Student's quantile of one degree of freedom.
        let half = point["viscosity_ci95"].as_f64().unwrap();
        assert!((error * 12.706_204_7 - half).abs() < 1e-5 * half.max(1e-3));
    }
}

#[test]
fn parquet_is_the_csv_with_types_and_units() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    let directory = directory();
    let at = directory.path();
    let arguments = [
        "report",
        "s.sqlite",
        "--csv",
        "t.csv",
        "--parquet",
        "t.parquet",
    ];
    sweep(at, &arguments).code(0).stdout("");
    let file = std::fs::File::open(at.join("t.parquet")).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let metadata = reader.metadata().file_metadata();
    let about = |key: &str| {
        let all = metadata.key_value_metadata().unwrap();
        let found = all.iter().find(|entry| entry.key == key).unwrap();
        found.value.clone().unwrap()
    };
    assert_eq!(about("campaign"), "small");
    assert_eq!(about("viscosity.unit"), "mu");
    assert!(about("shear_rate.meaning").contains("plateau"));
    let mut table = csv::Reader::from_path(at.join("t.csv")).unwrap();
    let header = table.headers().unwrap().clone();
    let mut lines = table.records().map(Result::unwrap);
    for row in reader.get_row_iter(None).unwrap() {
        let (row, line) = (row.unwrap(), lines.next().unwrap());
        let mut names = header.iter().zip(&line);
        for (name, field) in row.get_column_iter() {
            let (head, cell) = names.next().unwrap();
            assert_eq!(name, head);
            match field {
                parquet::record::Field::Str(word) => assert_eq!(word, cell),
                parquet::record::Field::Long(count) => assert_eq!(count.to_string(), cell),
                parquet::record::Field::Double(number) => {
                    assert_eq!(number.to_bits(), cell.parse::<f64>().unwrap().to_bits());
                }
                parquet::record::Field::Null => assert_eq!(cell, "", "{name}"),
                other => panic!("{name} is {other}"),
            }
        }
        assert!(names.next().is_none());
    }
    assert!(lines.next().is_none());
}

#[test]
fn a_selection_holds_for_every_output() {
    let directory = directory();
    let at = directory.path();
    let some = ["--where", "friction=0.3", "--where", "shear_rate=0,inf"];
    let report = |more: &[&str]| stdout(at, &[&["report", "s.sqlite"], &some[..], more].concat());
    let json: serde_json::Value = serde_json::from_str(&report(&["--json"])).unwrap();
    assert_eq!(json["points"].as_array().unwrap().len(), 2);
    assert_eq!(json["cases"]["done"], 4);
    assert_eq!(json["points"][1]["shear_rate"], "inf");
    assert_eq!(json["points"][1]["time_step"], 0.005);
    let text = report(&[]);
    assert!(
        text.contains("4 of 4 cases")
            && text.contains("only where friction = 0.3, shear_rate = 0 or inf")
    );
    assert_eq!(report(&["--csv", "-"]).lines().count(), 3);
    assert_eq!(report(&["--markdown", "-"]).lines().count(), 4);
    report(&["--figure", "f.svg", "--kind", "trace"]);
    let svg = std::fs::read_to_string(at.join("f.svg")).unwrap();
    assert!(svg.contains("Γ = 0") && svg.contains("Γ = ∞") && !svg.contains("ν ="));
    report(&["--page", "p.html"]);
    let page = std::fs::read_to_string(at.join("p.html")).unwrap();
    assert!(page.contains(r#""selection":"friction = 0.3, shear_rate = 0 or inf""#));
    assert_eq!(page.matches(r#""viscosity_ci95""#).count(), 2);

    for (condition, part) in [
        ("friction=0.25", "there are points with 0, 0.3"),
        ("fricton=0.3", "area_fraction"),
        ("seed=1", "no axis"),
        ("friction", "KEY=VALUE"),
    ] {
        let output = sweep(at, &["report", "s.sqlite", "--where", condition])
            .code(2)
            .stdout("");
        let error = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn time_steps_and_sizes_set_curves_apart() {
    let directory = directory();
    let at = directory.path();
    spoilt(
        at,
        "UPDATE cases SET time_step = 0.01, params = json_set(params, '$.time_step', 0.01) WHERE friction > 0.2",
    );
    named_anew(at);
    let text = stdout(at, &["report", "s.sqlite"]);
    assert!(text.contains("Δt"), "a column of its own: {text}");
    let draw = |more: &[&str]| {
        sweep(
            at,
            &[&["report", "s.sqlite", "--figure", "f.svg"], more].concat(),
        )
        .code(0);
        std::fs::read_to_string(at.join("f.svg")).unwrap()
    };
    assert!(draw(&[]).contains("ν = 0.3, Δt = 0.01"));
    assert!(draw(&["--along", "time_step", "--where", "shear_rate=inf"]).contains("<svg"));
    for (quantity, label) in [
        ("viscosity_stresslet", "stresslet viscosity"),
        ("viscosity_median", "median viscosity"),
    ] {
        assert!(draw(&["--quantity", quantity]).contains(label));
    }
    assert!(draw(&["--kind", "approach-velocity"]).contains("mean approach velocity"));
    for wrong in [
        &["--kind", "trace", "--quantity", "viscosity"][..],
        &["--case", "3f"],
        &["--kind", "trace", "--case", "zz"],
        &["--along", "contact"],
    ] {
        sweep(
            at,
            &[&["report", "s.sqlite", "--figure", "f.svg"], wrong].concat(),
        )
        .code(2);
    }
}

#[test]
fn too_many_curves_are_an_error_that_knows_a_way_out() {
    let directory = directory();
    let at = directory.path();
    let output = sweep(
        at,
        &[
            "report", "s.sqlite", "--figure", "f.svg", "--kind", "contacts", "--along", "friction",
        ],
    )
    .code(2);
    let error = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
    assert!(
        error.contains("12 curves") && error.contains("--where"),
        "{error}"
    );
    assert!(!at.join("f.svg").exists());
}

#[test]
fn paths_of_a_passing_pair_are_drawn() {
    let directory = directory();
    let at = directory.path();
    let pair = ["pair", "--no-contact", "--time-step", "0.5", "--figure"];
    sweep(at, &[&pair[..], &["paths.svg"]].concat()).code(0);
    let svg = std::fs::read_to_string(at.join("paths.svg")).unwrap();
    for word in ["first sphere", "second sphere", "x / a", "y / a"] {
        assert!(svg.contains(word), "{word}");
    }
    let refused = sweep(at, &[&pair[..], &["paths.gif"]].concat()).code(2);
    let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(said.contains("svg") && said.contains("png"), "{said}");
    assert!(!at.join("paths.gif").exists());
}
