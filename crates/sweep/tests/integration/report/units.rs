//! Physical units.

use super::{ONE, PAPER, figure, words};
use crate::harness::{json, refused, sweep};
use std::collections::HashMap;
use std::path::Path;

#[test]
fn physical_units_are_those_of_the_laboratory() {
    let folder = PAPER.folder();
    let at = folder.path();
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
}

/// Rows of a CSV on standard output by the names of its columns.
fn rows(at: &Path, arguments: &[&str]) -> Vec<HashMap<String, String>> {
    let text = sweep(at, arguments);
    let mut table = csv::Reader::from_reader(text.as_bytes());
    table.deserialize().map(Result::unwrap).collect()
}

fn near(a: f64, b: f64) {
    assert!((a / b - 1.0).abs() < 1e-12, "{a} and {b}");
}

const UNITS: [&str; 2] = ["--units", "a=2um,mu=1.5mPas,f_crit=3pN"];

#[test]
fn runs_and_samples_have_them_too() {
    let folder = PAPER.folder();
    let at = folder.path();
    let second = 3e-12 / (6.0 * std::f64::consts::PI * 1.5e-3 * 4e-12);
    for (option, stress) in [("--runs", "n1"), ("--samples", "n1_hydrodynamic")] {
        let asked = [&["report", "s.sqlite", option, "-"], &ONE[..]].concat();
        let (own, physical) = (rows(at, &asked), rows(at, &[&asked[..], &UNITS].concat()));
        assert_eq!(own.len(), physical.len());
        let mut plateaus = 0;
        for (a, b) in own.iter().zip(&physical) {
            let number = |row: &HashMap<String, String>, name: &str| row[name].parse::<f64>();
            let both = |name: &str| (number(a, name).unwrap(), number(b, name).unwrap());
            let (relative, viscosity) = both("viscosity");
            near(viscosity, 1.5e-3 * relative);
            let (gap, metres) = both("minimum_gap");
            near(metres, 2e-6 * gap);
            assert_eq!(a["seed"], b["seed"]);
            let (rate, per_second) = both("shear_rate");
            if rate > 0.0 && rate.is_finite() {
                near(per_second, rate * second);
                let (relative, pascal) = both(stress);
                assert!((pascal - 1.5e-3 * per_second * relative).abs() <= 1e-12 * pascal.abs());
            } else {
                plateaus += 1;
                assert_eq!(rate.to_bits(), per_second.to_bits());
                assert_eq!(b[stress], "", "{stress} at a plateau");
            }
        }
        assert!(plateaus > 0 && plateaus < own.len());
        let file = [&["report", "s.sqlite", option, "t.csv"], &UNITS[..]].concat();
        sweep(at, &file);
        let units = std::fs::read_to_string(at.join("t.units.csv")).unwrap();
        for line in [
            "viscosity,Pa s,",
            "minimum_gap,m,",
            "shear_rate,1/s,",
            "seed,1,",
        ] {
            assert!(units.contains(line), "{line}: {units}");
        }
        assert!(units.contains(&format!("{stress},Pa,")), "{units}");
    }
}

#[test]
fn json_has_them_beside_its_own() {
    let folder = PAPER.folder();
    let at = folder.path();
    let own = json(at, &["report", "s.sqlite"]);
    assert_eq!(own["physical"], serde_json::Value::Null);
    let both = json(at, &[&["report", "s.sqlite"], &UNITS[..]].concat());
    assert_eq!(own["points"], both["points"], "what programs read stays");
    let physical = &both["physical"];
    assert_eq!(physical["units"]["viscosity"], "Pa s");
    assert_eq!(physical["units"]["shear_rate"], "1/s");
    let pairs = own["points"].as_array().unwrap().iter();
    for (a, b) in pairs.zip(physical["points"].as_array().unwrap()) {
        near(
            b["viscosity"].as_f64().unwrap(),
            1.5e-3 * a["viscosity"].as_f64().unwrap(),
        );
    }
}

#[test]
fn figures_have_them_on_both_axes_and_in_their_words() {
    let folder = PAPER.folder();
    let at = folder.path();
    let asked = |more: &[&str]| figure(at, &[&UNITS[..], more].concat());
    let has = |svg: &str, word: &str| {
        assert!(words(svg).contains(&word), "{word:?}: {:?}", words(svg));
    };
    let svg = asked(&ONE);
    has(&svg, "shear rate (1/s)");
    has(&svg, "viscosity η (Pa s)");
    // Γ = 0.1, 1, 10 are 2.65, 26.5 and 265 per second; the plateaus stay.
    for tick in ["0", "1", "10", "100", "1000", "∞"] {
        has(&svg, tick);
    }
    has(
        &asked(&[&ONE[..], &["--kind", "trace"]].concat()),
        "viscosity η (Pa s)",
    );
    let svg = asked(&[&ONE[..], &["--kind", "contacts", "--along", "shear_rate"]].concat());
    has(&svg, "shear rate (1/s)");
    has(&svg, "pairs per sphere");
    let svg = asked(&[&ONE[..], &["--kind", "flow-curve"]].concat());
    has(&svg, "shear stress (Pa)");
    assert!(
        !words(&svg).contains(&"no result"),
        "at Γ = ∞ the stress is infinite: {:?}",
        words(&svg)
    );
    // Labels of curves and panels.
    let svg = asked(&["--where", "friction=0.3", "--along", "area_fraction"]);
    has(&svg, "Γ = 2.653 1/s");
    has(&svg, "Γ = ∞");
    let by_rate = [
        "--where",
        "area_fraction=0.65",
        "--along",
        "friction",
        "--panels",
        "shear_rate",
    ];
    has(&asked(&by_rate), "Γ = 26.53 1/s");
    // Plateaus have a result but no stress in pascal: they are left out and not marked as missing.
    let svg = asked(&[&ONE[..], &["--quantity", "normal_stress_difference"]].concat());
    has(&svg, "stress difference N₁ (Pa)");
    for word in ["no result", "∞"] {
        assert!(!words(&svg).contains(&word), "{word}: {:?}", words(&svg));
    }
    // A range is in the units of the axis.
}

#[test]
fn what_cannot_be_converted_is_refused() {
    let folder = PAPER.folder();
    let at = folder.path();
    let asked = |more: &[&str]| {
        let figure = ["report", "s.sqlite", "--figure", "f.svg"];
        refused(at, &[&figure[..], more].concat())
    };
    let error = refused(at, &["report", "s.sqlite", "--units", "a=2um"]);
    assert!(error.contains("mu"), "{error}");
    for asked_for in [
        ["--quantity", "n1"],
        ["--kind", "flow-curve"],
        ["--quantity", "mean_approach_velocity"],
    ] {
        let error = asked(&[&["--units", "a=2um,mu=1mPas"], &asked_for[..]].concat());
        assert!(error.contains("add f_crit"), "{error}");
    }
    let plateau = [&["--where", "shear_rate=inf"], &UNITS[..]].concat();
    let error = asked(&[&plateau[..], &["--quantity", "n1", "--along", "friction"]].concat());
    assert!(error.contains("plateaus"), "{error}");
    let error = asked(&[&plateau[..], &["--kind", "contacts", "--along", "friction"]].concat());
    assert!(error.contains("pairs per sphere"), "{error}");
    assert!(!at.join("f.svg").exists());
}
