//! Selected points, kinds of figures, and stores with few results.

use super::{CAMPAIGN, PAPER, SMALL, figure, with_new_keys, words};
use crate::harness::{json, refused, run, spoil, sweep};

#[test]
fn figures_of_every_kind_are_drawn() {
    let folder = SMALL.folder();
    let at = folder.path();
    for kind in ["curve", "contacts", "trace"] {
        let along = if kind == "contacts" {
            "shear_rate"
        } else {
            "friction"
        };
        let text = figure(at, &["--kind", kind, "--along", along]);
        assert!(text.contains("<svg") && text.contains("#0072b2"), "{kind}");
    }
    sweep(at, &["report", "s.sqlite", "--figure", "f.svg"]);
    let text = std::fs::read_to_string(at.join("f.svg")).unwrap();
    for part in ["∞", "ν = 0.3", "shear rate Γ", "stroke-dasharray"] {
        assert!(text.contains(part), "{part}");
    }
    refused(at, &["report", "s.sqlite", "--figure", "f.gif"]);
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
    let no_grid = "UPDATE cases SET position = NULL, counts = 0";
    for (statements, code) in [(failed.as_str(), 0), (pending, 0), (no_grid, 0)] {
        let folder = SMALL.folder();
        let at = folder.path();
        spoil(at, statements);
        let output = run(at, &["report", "s.sqlite", "--csv", "-"]);
        assert_eq!(output.status.code(), Some(code), "{output:?}");
        let output = run(at, &["report", "s.sqlite", "--page", "p.html"]);
        assert_eq!(output.status.code(), Some(code), "{output:?}");
        if let Ok(page) = std::fs::read_to_string(at.join("p.html")) {
            assert!(!page.contains("<img src"), "markup is escaped");
            assert_eq!(page.matches("</script>").count(), 2);
        }
        for kind in ["curve", "trace"] {
            refused(
                at,
                &["report", "s.sqlite", "--figure", "f.svg", "--kind", kind],
            );
        }
    }
    let folder = SMALL.folder();
    spoil(folder.path(), &failed);
    let text = sweep(folder.path(), &["show", "s.sqlite", "1"]);
    assert!(text.contains("no samples yet") && text.contains("attempt 1 failed at step 3"));
}

#[test]
fn a_selection_holds_for_every_output() {
    let folder = SMALL.folder();
    let at = folder.path();
    let some = ["--where", "friction=0.3", "--where", "shear_rate=0,inf"];
    let report = |more: &[&str]| sweep(at, &[&["report", "s.sqlite"], &some[..], more].concat());
    let json = json(at, &[&["report", "s.sqlite"], &some[..]].concat());
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
    report(&["--figure", "f.svg", "--kind", "trace"]);
    let svg = std::fs::read_to_string(at.join("f.svg")).unwrap();
    assert!(svg.contains("Γ = 0") && svg.contains("Γ = ∞") && !svg.contains("ν ="));
    report(&["--page", "p.html"]);
    let page = std::fs::read_to_string(at.join("p.html")).unwrap();
    assert!(page.contains("only where friction = 0.3, shear_rate = 0 or inf"));
    assert_eq!(page.matches(r#""trace":"#).count(), 2, "two points");

    for (condition, part) in [
        ("friction=0.25", "available: 0, 0.3"),
        ("fricton=0.3", "area_fraction"),
        ("seed=1", "not an axis"),
        ("friction", "KEY=VALUE"),
    ] {
        let error = refused(at, &["report", "s.sqlite", "--where", condition]);
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn time_steps_and_sizes_set_curves_apart() {
    let folder = SMALL.folder();
    let at = folder.path();
    spoil(
        at,
        "UPDATE points SET axes = json_set(axes, '$.time_step', 0.01), params = json_set(params, '$.time_step', 0.01) WHERE axes ->> 'friction' > 0.2;
         UPDATE cases SET steps = steps / 2 WHERE point IN (SELECT id FROM axes WHERE friction > 0.2)",
    );
    with_new_keys(at);
    let text = sweep(at, &["report", "s.sqlite"]);
    assert!(text.contains("Δt"), "a column of its own: {text}");
    let draw = |more: &[&str]| {
        sweep(
            at,
            &[&["report", "s.sqlite", "--figure", "f.svg"], more].concat(),
        );
        std::fs::read_to_string(at.join("f.svg")).unwrap()
    };
    let apart = draw(&["--where", "shear_rate=1,inf"]);
    assert!(apart.contains("ν = 0.3, Δt = 0.01"));
    assert!(draw(&["--along", "time_step", "--where", "shear_rate=inf"]).contains("<svg"));
    for (quantity, label) in [
        ("viscosity_stresslet", "stresslet viscosity"),
        ("viscosity_median", "median viscosity"),
    ] {
        assert!(draw(&["--quantity", quantity]).contains(label));
    }
    let approach = draw(&["--quantity", "mean_approach_velocity"]);
    assert!(approach.contains("mean approach velocity (a × rate)"));
    // Any column of points.
    assert!(draw(&["--quantity", "cpu_time_s"]).contains("cpu_time_s"));
    for wrong in [
        &["--kind", "trace", "--quantity", "viscosity"][..],
        &["--quantity", "viscosty"],
        &["--quantity", "viscosity_ci95"],
        &["--case", "3f"],
        &["--kind", "trace", "--case", "zz"],
        &["--along", "contact"],
    ] {
        refused(
            at,
            &[&["report", "s.sqlite", "--figure", "f.svg"], wrong].concat(),
        );
    }
}

#[test]
fn a_time_step_that_follows_the_rate_divides_no_curve() {
    let folder = SMALL.folder();
    let at = folder.path();
    let finer = |which: &str| {
        spoil(
            at,
            &format!(
                "UPDATE points SET axes = json_set(axes, '$.time_step', 0.01), params = json_set(params, '$.time_step', 0.01) WHERE {which};
                 UPDATE cases SET steps = steps / 2 WHERE point IN (SELECT id FROM points WHERE {which})"
            ),
        );
        with_new_keys(at);
        sweep(at, &["report", "s.sqlite", "--figure", "f.svg"]);
        std::fs::read_to_string(at.join("f.svg")).unwrap()
    };
    let drawn = finer("axes ->> 'shear_rate' = 1.0");
    assert!(
        drawn.contains("ν = 0.3") && !drawn.contains("Δt"),
        "{drawn}"
    );
}

#[test]
fn too_many_curves_are_an_error_that_knows_a_way_out() {
    let folder = PAPER.folder();
    let at = folder.path();
    let report = ["report", "s.sqlite", "--figure", "f.svg"];
    let asked = ["--kind", "contacts", "--along", "friction", "--panels", "c"];
    let error = refused(at, &[&report[..], &asked].concat());
    for part in ["20 curves", "(where)", "(panels)"] {
        assert!(error.contains(part), "{error}");
    }
    assert!(!at.join("f.svg").exists());
}

#[test]
fn runs_of_a_trace_are_named_by_number_or_key() {
    let folder = SMALL.folder();
    let at = folder.path();
    let key = json(at, &["show", "s.sqlite", "3"])["key"].clone();
    let by_number = figure(at, &["--kind", "trace", "--case", "3"]);
    let by_key = figure(
        at,
        &["--kind", "trace", "--case", &key.as_str().unwrap()[..12]],
    );
    assert_eq!(by_number, by_key);
    let report = ["report", "s.sqlite", "--figure", "f.svg", "--kind", "trace"];
    for wrong in [&["--case", "13"][..], &["--case", "3", "--where", "ν=0"]] {
        let error = refused(at, &[&report[..], wrong].concat());
        assert!(error.contains("no case"), "{error}");
    }
}

#[test]
fn traces_are_means_over_seeds_with_their_intervals() {
    let folder = SMALL.folder();
    let at = folder.path();
    let trace = |more: &[&str]| figure(at, &[&["--kind", "trace"], more].concat());
    let band = "fill-opacity=\"0.22\"";
    let one = trace(&["--where", "ν=0.3", "--where", "shear_rate=inf"]);
    assert!(
        words(&one).contains(&"mean of 2 runs, 95 % interval"),
        "{:?}",
        words(&one)
    );
    assert_eq!(one.matches(band).count(), 1);
    let several = trace(&["--where", "ν=0.3"]);
    assert_eq!(several.matches(band).count(), 3);
    for word in ["Γ = 0", "Γ = 1", "Γ = ∞"] {
        assert_eq!(words(&several).iter().filter(|w| **w == word).count(), 1);
    }
    // One run has no interval, and is named by its seed.
    let run = trace(&["--case", "3"]);
    assert!(
        !run.contains(band) && run.contains("seed 1"),
        "{:?}",
        words(&run)
    );
    let none = ["report", "s.sqlite", "--figure", "f.svg", "--kind", "trace"];
    let error = refused(at, &[&none[..], &["--where", "ν=0.9"]].concat());
    assert!(error.contains("--where"), "{error}");
}

#[test]
fn symbols_of_tables_name_axes_and_columns() {
    let folder = SMALL.folder();
    let at = folder.path();
    let tables = |more: &[&str]| sweep(at, &[&["report", "s.sqlite", "--csv", "-"], more].concat());
    assert_eq!(
        tables(&["--where", "nu=0.2..0.4", "--columns", "η,c"]),
        tables(&[
            "--where",
            "friction=0.3",
            "--columns",
            "viscosity,area_fraction"
        ])
    );
    let drawn = |along| figure(at, &["--along", along, "--where", "Γ=∞"]);
    assert_eq!(drawn("nu"), drawn("friction"));
}

#[test]
fn start_layers_are_named_by_where_they_come_from() {
    let folder = SMALL.folder();
    let at = folder.path();
    let grid = CAMPAIGN.split_once("[[grid]]").unwrap().1;
    let grid = grid
        .replace("friction = [0.0, 0.3]", "friction = 0.3")
        .replace("[0, 1.0, inf]", "[1.0, inf]");
    let protocol = "name = \"on\"\n[protocol]\ntime_step = 0.005\nstrain = 0.1\ndiscard = 0.05\n";
    let start = "start = { store = \"s.sqlite\", point = { friction = 0.3, shear_rate = 1.0 } }";
    let campaign = format!("{protocol}[[grid]]\n{start}{grid}\n[[grid]]{grid}");
    std::fs::write(at.join("on.toml"), campaign).unwrap();
    sweep(at, &["run", "on.toml", "--store", "on.sqlite", "-q"]);
    let text = sweep(at, &["report", "on.sqlite"]);
    for name in [" end of s ", " packing "] {
        assert!(text.contains(name), "{text}");
    }
    sweep(at, &["report", "on.sqlite", "--figure", "f.svg"]);
    let svg = std::fs::read_to_string(at.join("f.svg")).unwrap();
    for name in ["end of s", "packing"] {
        assert!(words(&svg).contains(&name), "{:?}", words(&svg));
    }
    let page = sweep(at, &["report", "on.sqlite", "--page", "-"]);
    assert!(page.contains("end of s"));
}
