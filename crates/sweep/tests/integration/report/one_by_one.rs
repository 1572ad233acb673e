//! Runs and samples, one by one.

use super::PAPER;
use crate::harness::{json, refused, sweep};
use parquet::file::reader::{FileReader, SerializedFileReader};

#[test]
fn runs_and_samples_are_typed_tables_with_units() {
    let folder = PAPER.folder();
    let at = folder.path();
    let one = ["report", "s.sqlite", "--where", "friction=0.3"];
    let json = json(at, &["report", "s.sqlite"]);
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
