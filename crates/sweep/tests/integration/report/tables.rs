//! Tables of points.

use super::{PAPER, SMALL, figure, with_new_keys, words};
use crate::harness::{json, refused, spoil, sweep};
use parquet::file::reader::{FileReader, SerializedFileReader};

#[test]
fn the_table_fits_eighty_columns_and_splits_no_number() {
    let folder = PAPER.folder();
    let at = folder.path();
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
    // That of runs that find their own.
    assert!(!wide.iter().any(|line| line.contains(" fraction ")));
    let si = lines(&["--format", "si"]);
    assert!(rows(&si) == 0 && si.iter().any(|line| line.contains(')')));
}

#[test]
fn csv_has_the_numbers_of_the_report_and_its_units_beside_it() {
    let folder = SMALL.folder();
    let at = folder.path();
    assert_eq!(sweep(at, &["report", "s.sqlite", "--csv", "t.csv"]), "");
    let json = json(at, &["report", "s.sqlite"]);
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
    let folder = SMALL.folder();
    let at = folder.path();
    let alone = sweep(at, &["report", "s.sqlite", "--json"]);
    for file in [
        ["--csv", "t.csv"],
        ["--figure", "f.svg"],
        ["--page", "p.html"],
        ["--parquet", "t.parquet"],
    ] {
        let both = sweep(at, &["report", "s.sqlite", "--json", file[0], file[1]]);
        assert_eq!(both, alone, "{file:?}");
        assert!(at.join(file[1]).exists());
    }
    refused(at, &["report", "s.sqlite", "--json", "--csv", "-"]);
}

#[test]
fn parquet_is_the_csv_with_types_and_units() {
    let folder = SMALL.folder();
    let at = folder.path();
    let arguments = [
        "report",
        "s.sqlite",
        "--csv",
        "t.csv",
        "--parquet",
        "t.parquet",
    ];
    assert_eq!(sweep(at, &arguments), "");
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
fn view_of_runs_is_for_any_client() {
    let folder = SMALL.folder();
    let store = rusqlite::Connection::open(folder.path().join("s.sqlite")).unwrap();
    let runs: i64 = store
        .query_row("SELECT count(*) FROM runs WHERE viscosity > 1", [], |row| {
            row.get(0)
        })
        .unwrap();
    // Those of points that share them once.
    assert_eq!(runs, 6);
}

#[test]
fn columns_are_explained_and_axes_have_few_digits() {
    let folder = SMALL.folder();
    let at = folder.path();
    let report = |more: &[&str]| sweep(at, &[&["report", "s.sqlite"], more].concat());
    let chosen = ["--columns", "viscosity,n1,smallest_gap"];
    let error = refused(at, &[&["report", "s.sqlite"], &chosen[..]].concat());
    assert!(error.contains("minimum_gap"), "{error}");
    let misspelt = refused(at, &["report", "s.sqlite", "--columns", "viscosty"]);
    assert!(misspelt.contains("did you mean viscosity?"), "{misspelt}");
    let chosen = [
        "--columns",
        "viscosity,n1,n1_ci95,minimum_gap,rolling_fraction",
    ];
    assert!(report(&chosen).contains("n1: first normal stress difference N₁"));
    spoil(
        at,
        r#"UPDATE points SET axes = replace(axes, '"shear_rate":1.0', '"shear_rate":18.84955592153876'), params = json_set(params, '$.shear_rate', 18.84955592153876) WHERE axes ->> 'shear_rate' = 1"#,
    );
    with_new_keys(at);
    let text = report(&[]);
    assert!(
        text.contains(" 18.85 ") && !text.contains("18.849"),
        "{text}"
    );
    let csv = report(&["--csv", "-"]);
    assert!(csv.contains("18.84955592153876"), "machines get all digits");
    let svg = figure(at, &["--along", "friction"]);
    assert!(words(&svg).contains(&"Γ = 18.85"), "{:?}", words(&svg));
}
