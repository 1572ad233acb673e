//! Starts from given layers, and from equilibrium.

use super::{GOOD, assert_fault, parse_text, shown_or};
use sd_core::model::StartFrom;
use std::path::Path;

#[test]
fn faults_of_start_layers_have_their_line() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    let layer = |centres: &str, radii: &str, side: f64| {
        format!("{{\"centres\": {centres}, \"radii\": {radii}, \"cell\": [{side}, {side}]}}")
    };
    let one = "spheres = 1\narea_fraction = 0.01\nfriction = 0.3\nroughness = 0.01\nshear_rate = 1\nseeds = 1";
    let two = one
        .replace("spheres = 1", "spheres = 2")
        .replace("0.01\nf", "0.05\nf");
    let side = (2.0 * std::f64::consts::PI / 0.05).sqrt();
    write(
        "one.json",
        &layer("[[1, 2]]", "[1]", (std::f64::consts::PI / 0.01).sqrt()),
    );
    write("wide.json", &layer("[[1, 2]]", "[1]", 20.0));
    write("sizes.json", &layer("[[0, 0], [5, 0]]", "[1.2, 0.8]", side));
    write("radii.json", &layer("[[0, 0], [5, 0]]", "[1]", side));
    write("overlap.json", &layer("[[0, 0], [1.9, 0]]", "[1, 1]", side));
    write("good.json", &layer("[[0, 0], [5, 0]]", "[1, 1]", side));
    let grid = |lines: &str, start: &str| {
        format!(
            "name = \"x\"\n[[grid]]\nhydrodynamics = \"ball-melrose\"\nstart = {start}\n{lines}\n"
        )
    };
    let parse = |text: &str| shown_or(directory.path(), text);
    let good = parse(&grid(&two, "\"good.json\"")).unwrap();
    let start = good.cases[0].1.params.start.as_ref().unwrap();
    assert_eq!(start.layer().unwrap().centres.len(), 2);
    write("moved.json", &layer("[[0, 0], [5.5, 0]]", "[1, 1]", side));
    let moved = parse(&grid(&two, "\"moved.json\"")).unwrap();
    assert_ne!(moved.cases[0].0, good.cases[0].0, "the layer is in the key");
    for (text, line, part) in [
        (
            grid(&two, "\"one.json\""),
            4,
            "a layer of 1 spheres conflicts with `spheres` = 2",
        ),
        (
            grid(one, "\"wide.json\""),
            4,
            "conflicts with `area_fraction` = 0.01",
        ),
        (
            grid(&two, "\"sizes.json\""),
            4,
            "radius 1.2 conflicts with `size_ratio` = 1",
        ),
        (
            grid(&two, "\"overlap.json\""),
            4,
            "spheres 0 and 1, counted from 0, overlap: their gap is -0.1",
        ),
        (
            grid(&two, "\"radii.json\""),
            4,
            "a layer of 2 spheres has 1 radii",
        ),
        (grid(&two, "\"nowhere.json\""), 4, "cannot be read"),
        (grid(&two, "3"), 4, "`start` cannot be of type integer"),
        (grid(&two, "{ point = {} }"), 4, "has no `store`"),
        (
            grid(&two, "{ store = \"nowhere.sqlite\" }"),
            4,
            "there is no such file",
        ),
        (
            grid(&two.replace("seeds = 1", "seeds = 2"), "\"good.json\""),
            4,
            "every seed would give the same run",
        ),
        (
            // Of other sizes, and therefore in another cell too.
            grid(
                &two.replace("seeds", "size_ratio = 1.4\nseeds"),
                "\"good.json\"",
            ),
            4,
            "conflicts with `size_ratio` = 1.4",
        ),
    ] {
        assert_fault(directory.path(), &text, line, part);
    }
}

#[test]
fn a_copy_of_a_campaign_names_its_start_layers_in_full_and_all_else_stays() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path().join("odd \" folder");
    std::fs::create_dir(&folder).unwrap();
    for (name, x) in [("one.json", 5.0), ("two.json", 5.5)] {
        let side = (2.0 * std::f64::consts::PI / 0.05).sqrt();
        let layer = format!("{{\"centres\": [[0, 0], [{x}, 0]], \"cell\": [{side}, {side}]}}");
        std::fs::write(folder.join(name), layer).unwrap();
    }
    let grid = "hydrodynamics = \"ball-melrose\"\nspheres = 2\narea_fraction = 0.05\nfriction = 0.3\n\
                roughness = 0.01\nshear_rate = 1\nseeds = 1\n";
    let path = |name: &str| folder.join(name).display().to_string();
    let quoted = |name: &str| format!("\"{}\"", path(name).replace('"', "\\\""));
    let text = |one: &str, two: &str| {
        format!(
            "name = \"x\" # start = \"no.xyz\"\n[[grid]]\nstart = {one} # the first\n{grid}[[grid]]\n{grid}start = {two}\n"
        )
    };
    let given = text("'one.json'", &quoted("two.json"));
    let full = text(&quoted("one.json"), &quoted("two.json"));
    let campaign = crate::campaign::parse(&path("x.toml"), given).unwrap();
    let names = campaign
        .written
        .starts
        .iter()
        .map(|(_, name)| name.as_str());
    assert_eq!(
        names.collect::<Vec<_>>(),
        ["packing", "one.json", "two.json"]
    );
    assert_eq!(campaign.text_elsewhere(), full);
    // Copying the copy changes nothing.
    let copy = crate::campaign::parse("/plan/x.toml", full.clone()).unwrap();
    assert_eq!(copy.text_elsewhere(), full);
    assert_eq!(parse_text(GOOD).unwrap().text_elsewhere(), GOOD);
}

#[test]
fn starts_in_equilibrium_need_no_file_and_are_warned_of_above_freezing() {
    let text = |fraction: f64| {
        format!(
            "name = \"x\"\n[[grid]]\nhydrodynamics = \"ball-melrose\"\nstart = \"equilibrium\"\nvolume_fraction = {fraction}\n\
             friction = 0\nroughness = 0.01\nshear_rate = 1\nseeds = 2\nspheres = 150\n"
        )
    };
    let parse = |text: &str| shown_or(Path::new(""), text).unwrap();
    let campaign = parse(&text(0.4));
    let (key, case) = &campaign.cases[0];
    assert_eq!(case.params.start, Some(StartFrom::Equilibrium));
    assert!(campaign.start_files.is_empty() && campaign.warning().is_none());
    assert!(campaign.written.starts.contains(&(1, "equilibrium".into())));
    let packed = parse(&text(0.4).replace("start = \"equilibrium\"\n", ""));
    assert_ne!(packed.cases[0].0, *key);
    let warning = parse(&text(0.5)).warning().unwrap();
    assert!(warning.contains("0.487"), "{warning}");
}
