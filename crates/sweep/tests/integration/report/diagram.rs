//! State diagrams.

use super::words;
use crate::harness::{Computed, campaign, edit, refused, sweep};
use std::path::Path;
use std::sync::LazyLock;

static COMPUTED: LazyLock<Computed> = LazyLock::new(|| {
    Computed::new(
        campaign(
            "diagram",
            [0.2, 0.1],
            r#"[[grid]]
area_fraction = [0.5, 0.65, 0.7]
friction = [0.3, 0.6]
roughness = 0.01
shear_rate = [0.1, 1.0, 10.0]
seeds = 1
spheres = 20
hydrodynamics = "ball-melrose"
"#,
        ),
        &[],
    )
});

const DIAGRAM: [&str; 6] = [
    "report",
    "s.sqlite",
    "--figure",
    "f.svg",
    "--kind",
    "state-diagram",
];

fn with(at: &Path, more: &[&str]) -> String {
    sweep(at, &[&DIAGRAM[..], more].concat());
    std::fs::read_to_string(at.join("f.svg")).unwrap()
}

#[test]
fn every_point_stands_in_the_plane_and_no_axis_is_averaged_over() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let error = refused(at, &DIAGRAM);
    for part in ["friction has 0.3, 0.6", "--where", "(panels)"] {
        assert!(error.contains(part), "{part}: {error}");
    }
    let one = with(at, &["--where", "friction=0.6"]);
    let said = words(&one);
    assert!(said.contains(&"continuous"), "{said:?}");
    assert!(
        said.iter().any(|word| word.contains("shear rate Γ")),
        "{said:?}"
    );
    let panels = with(at, &["--panels", "friction", "--y", "shear_stress"]);
    let said = words(&panels);
    assert!(
        said.contains(&"ν = 0.3") && said.contains(&"ν = 0.6"),
        "{said:?}"
    );
    assert!(
        said.iter().any(|word| word.contains("shear stress σ*")),
        "{said:?}"
    );
}

#[test]
fn a_diagram_of_too_few_points_says_how_many_it_needs() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let few = ["--where", "friction=0.6", "--where", "area_fraction=0.5"];
    let error = refused(at, &[&DIAGRAM[..], &few].concat());
    assert!(
        error.contains("at least 2 values of area_fraction with 3 of shear_rate each"),
        "{error}"
    );
    assert!(error.contains("here are 1 with 3 at most"), "{error}");
    for wrong in [
        &["--along", "friction"][..],
        &["--x", "shear_rate"],
        &["--y", "friction"],
    ] {
        refused(at, &[&DIAGRAM[..], wrong].concat());
    }
    let error = refused(
        at,
        &["report", "s.sqlite", "--figure", "f.svg", "--x", "friction"],
    );
    assert!(error.contains("state-diagram"), "{error}");
}

#[test]
fn lines_are_drawn_where_the_slope_passes_a_limit() {
    let folder = COMPUTED.folder();
    let at = folder.path();
    let one = ["--where", "friction=0.6"];
    assert!(!with(at, &one).contains("d ln η"));
    // A thousand times the viscosity from Γ = 1 to 10: ln σ rises by 4 ln 10 and ln η by 3, a slope
    // of 0.75 after one of 0.
    edit(
        &at.join("s.sqlite"),
        "UPDATE results SET viscosity = CASE (SELECT p.shear_rate > 5 FROM cases c JOIN axes p ON p.id = c.point
             WHERE c.id = case_id) WHEN 1 THEN 5000.0 ELSE 5.0 END",
    );
    let steep = with(at, &one);
    let said = words(&steep);
    assert!(said.contains(&"d ln η/d ln σ = 0.5"), "{said:?}");
    assert!(!said.contains(&"d ln η/d ln σ = 1"), "{said:?}");
}
