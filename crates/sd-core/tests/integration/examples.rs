//! The examples run.

#[path = "../../examples/cone.rs"]
mod cone;
#[path = "../../examples/hard.rs"]
#[expect(dead_code, reason = "its `main` reads the command line")]
mod hard;
#[path = "../../examples/layer.rs"]
mod layer;
#[path = "../../examples/pair.rs"]
mod pair;
#[path = "../../examples/sedimentation.rs"]
#[expect(dead_code, reason = "its `main` reads the command line")]
mod sedimentation;
#[path = "../../examples/suspension.rs"]
#[expect(dead_code, reason = "its `main` reads the command line")]
mod suspension;

use clap::Parser as _;

#[test]
fn cones_are_sheared() {
    cone::main().expect("the example of a law");
}

#[test]
fn layer_is_sheared() {
    layer::main().expect("the example of a layer");
}

#[test]
fn spheres_pass() {
    pair::main().expect("the example of a pair");
}

#[test]
fn suspension_sinks_slower_than_a_sphere_alone() {
    // Not as slow as a cubic lattice, 1 − 1.76 φ^(1/3) + φ.
    let rows = sedimentation::sink(27, 0.1, 0.2, 1).expect("the example of forces");
    assert_eq!(rows.len(), 4);
    for [_, velocity, fluctuation] in rows {
        assert!(velocity > 0.283 && velocity < 1.0, "{velocity}");
        assert!(fluctuation > 0.01 && fluctuation < 0.4, "{fluctuation}");
    }
}

/// The tables of the hard runs with these options.
fn hard_runs(options: &str) -> String {
    let options = ["hard"].into_iter().chain(options.split(' '));
    let part = hard::Part::try_parse_from(options).expect("options of the example");
    hard::tables(&part).expect("two threads")
}

#[test]
fn easy_runs_of_every_law_are_done() {
    let tables =
        hard_runs("--area-fraction 0.5 --friction 0.3 --roughness 0.01 --spheres 30 --seeds 1");
    assert_eq!(
        tables.matches("| all | 1 | 1 | 0 | 0 | 0 | 0 |").count(),
        8,
        "{tables}"
    );
    assert!(tables.contains("None failed"), "{tables}");
}

/// The most expensive problems: none fails, none takes a minute, and nearly all are solved in runs
/// that do not jam.
#[test]
fn hardest_problems_end() {
    for options in [
        "--law rigid+roll-slip --area-fraction 0.84 --friction 1 --roughness 0.001 --spheres 110 --seeds 1",
        "--law rigid+roll-slip --area-fraction 0.84 --friction 1 --roughness 0.01 --spheres 100 --seeds 1 --first-seed 2",
        "--law rigid+stick-rotate --area-fraction 0.76 --friction 1 --roughness 0.001 --spheres 50 --seeds 1",
        "--law rigid+coulomb --area-fraction 0.76 --friction 0.3 --roughness 0.01 --spheres 100 --seeds 1",
    ] {
        let tables = hard_runs(options);
        let row = tables.lines().find(|line| line.starts_with("| all |"));
        let cells: Vec<&str> = row.expect("a last row").split('|').map(str::trim).collect();
        // Runs that failed or were stopped.
        assert_eq!((cells[6], cells[7]), ("0", "0"), "{tables}");
        let stages: f64 = cells[8].parse().expect("a count");
        let unconverged: f64 = cells[9]
            .split(' ')
            .next()
            .expect("a word")
            .parse()
            .expect("a count");
        assert!(unconverged <= 0.02 * stages, "{tables}");
    }
}

#[test]
fn hard_run_that_is_refused_is_reported_with_its_options() {
    // Ten spheres have no room for the lubrication cut-off; roughness 0.4 leaves discs larger than
    // the plane.
    let options = "--law rigid+coulomb --area-fraction 0.84 --friction 1 --roughness 0.01 --spheres 10 --seeds 1 --first-seed 2";
    let tables = hard_runs(options);
    assert!(
        tables.contains("| all | 1 | 0 | 0 | 0 | 1 refused | 0 | 0 |"),
        "{tables}"
    );
    assert!(
        tables.contains(&format!("| `{options}` | the cell is")),
        "{tables}"
    );
    let tables = hard_runs(
        &options
            .replace("10 --seeds", "30 --seeds")
            .replace("0.01", "0.4"),
    );
    assert!(
        tables.contains("| all | 1 | 0 | 0 | 0 | 1 refused | 0 | 0 |"),
        "{tables}"
    );
    assert!(
        tables.contains("area_fraction = 0.84 is denser than any layer"),
        "{tables}"
    );
}

#[test]
fn hard_run_over_its_time_is_stopped() {
    let tables = hard_runs(
        "--law rigid+coulomb --area-fraction 0.5 --friction 1 --roughness 0.01 --spheres 30 --seeds 1 --limit 0",
    );
    assert!(
        tables.contains("| all | 1 | 0 | 0 | 0 | 0 | 1 |"),
        "{tables}"
    );
}

#[test]
fn unknown_hard_law_is_refused_with_the_names_of_all() {
    let refused = hard::Part::try_parse_from(["hard", "--law", "rigid+glue"]);
    let message = refused.expect_err("there is no such law").to_string();
    assert!(
        message.contains("rigid+stick-rotate") && message.contains("hertz+stick-slide"),
        "{message}"
    );
}

#[test]
fn suspensions_are_sheared_under_springs_and_rigid_contacts() {
    // At least that of the dilute limit, 1 + 5φ/2, with the spheres' pairs; far below that of a
    // dense suspension.
    for law in ["springs", "coulomb"] {
        let viscosity =
            suspension::shear(100, 0.4, law, 0.05).expect("the example of a suspension");
        assert!(viscosity > 2.0 && viscosity < 50.0, "{law}: {viscosity}");
    }
    assert!(suspension::shear(100, 0.4, "plastic", 0.05).is_err());
}
