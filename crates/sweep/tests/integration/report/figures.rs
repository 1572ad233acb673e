//! Figures for papers.

use super::{ONE, PAPER, PAPER_CAMPAIGN, figure, words};
use crate::harness::{edit, fail, folder, json, refused, sweep};

#[test]
fn figures_carry_their_size_font_and_origin() {
    let folder = PAPER.folder();
    let at = folder.path();
    let json = json(at, &["show", "s.sqlite", "1"]);
    let key = &json["key"].as_str().unwrap()[..16];
    let svg = figure(at, &[]);
    for part in [
        "width=\"85.000mm\"",
        "viewBox=\"0 0 240.94 ",
        "font-family=\"'DejaVu Sans', Verdana, sans-serif\"",
        "<metadata>",
        "campaign paper",
        key,
        "build ",
    ] {
        assert!(svg.contains(part), "{part}");
    }
    for file in ["f.gif", "f.pdf", "f.png"] {
        let error = refused(at, &["report", "s.sqlite", "--figure", file]);
        assert!(
            error.contains(".svg") && error.contains("rsvg-convert"),
            "{error}"
        );
    }
}

#[test]
fn lines_stop_at_breaks_and_at_points_without_a_result() {
    let folder = PAPER.folder();
    let at = folder.path();
    let drawn = |svg: &str| {
        // Lines of curves have the width of curves.
        svg.matches("stroke-width=\"0.9\"").count()
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
    fail(
        at,
        "shear_rate = 1.0 AND friction > 0.2 AND area_fraction > 0.6",
    );
    let broken = figure(at, &ONE);
    assert!(words(&broken).contains(&"no result"));
    // From 0.1 over 1 to 10 it was one line; now nothing joins 0.1 and 10.
    assert_eq!((drawn(&whole), drawn(&broken)), (1, 0));
}

#[test]
fn jammed_points_are_marked_once_in_the_colour_of_their_curve() {
    // Wherever a cross may be, it is two lines: of points without a result on the lower edge, of
    // jammed ones on the upper, and in a flow curve at the stress that they carry at rest.
    let campaign = PAPER_CAMPAIGN
        .replace("area_fraction = [0.5, 0.65]", "area_fraction = 0.65")
        .replace("friction = [0.0, 0.3]", "friction = [0.3, 0.6]")
        .replace(
            "shear_rate = [0, 0.1, 1.0, 10.0, inf]",
            "shear_stress = [0.1, 1.0, 10.0]",
        )
        .replace("seeds = 2", "seeds = 1");
    let folder = folder("j.toml", &campaign);
    let at = folder.path();
    sweep(at, &["run", "j.toml", "--store", "s.sqlite", "-q"]);
    edit(
        &at.join("s.sqlite"),
        "UPDATE cases SET state = 'jammed' WHERE point IN (SELECT id FROM axes WHERE friction > 0.5 AND shear_stress > 5);
         UPDATE results SET jammed_strain = 0.01 WHERE case_id IN (SELECT id FROM cases WHERE state = 'jammed')",
    );
    for more in [&["--along", "shear_stress"][..], &["--kind", "flow-curve"]] {
        let svg = figure(at, more);
        let entries = words(&svg);
        assert!(entries.contains(&"runs jammed"), "{more:?}: {entries:?}");
        assert!(!entries.contains(&"no result"), "{more:?}: {entries:?}");
        // The second curve, and the legend in grey.
        let crosses = |colour: &str| {
            let paths = svg.split("<path").skip(1);
            let paths = paths.map(|rest| rest.split("/>").next().unwrap());
            let is_cross = |path: &&str| path.contains(colour) && path.matches('M').count() == 2;
            paths.filter(is_cross).count()
        };
        assert_eq!((crosses("#d55e00"), crosses("#0072b2")), (1, 0), "{svg}");
    }
}

#[test]
fn ticks_have_one_style_and_traces_show_what_is_discarded() {
    let folder = PAPER.folder();
    let at = folder.path();
    let svg = figure(at, &ONE);
    for tick in ["0", "0.1", "1", "10", "∞"] {
        assert!(words(&svg).contains(&tick), "{tick}");
    }
    let svg = figure(at, &[&ONE[..], &["--kind", "trace"]].concat());
    assert!(words(&svg).contains(&"discarded"));
    assert!(!words(&figure(at, &ONE)).contains(&"discarded"));
}

#[test]
fn a_kind_of_the_other_command_is_pointed_to() {
    let nowhere = tempfile::tempdir().unwrap();
    for (command, kind, other) in [
        (
            "report",
            "g_r",
            "sweep structure --figure FILE.svg --kind pair-distribution",
        ),
        (
            "report",
            "contact_angle",
            "sweep structure --figure FILE.svg --kind contact-angle",
        ),
        (
            "structure",
            "flow_curve",
            "sweep report --figure FILE.svg --kind flow-curve",
        ),
    ] {
        let arguments = [command, "s.sqlite", "--figure", "f.svg", "--kind", kind];
        let error = refused(nowhere.path(), &arguments);
        assert!(error.contains(other), "{error}");
    }
    let wrong = [
        "report", "s.sqlite", "--figure", "f.svg", "--kind", "contact",
    ];
    let error = refused(nowhere.path(), &wrong);
    assert!(
        error.contains("similar value exists: 'contacts'"),
        "{error}"
    );
}

#[test]
fn an_axis_with_one_value_is_refused() {
    let folder = PAPER.folder();
    let at = folder.path();
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
    let folder = PAPER.folder();
    let at = folder.path();
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
fn the_dilute_limit_is_named_in_the_legend_and_not_over_data() {
    let folder = PAPER.folder();
    let at = folder.path();
    for more in [
        &[][..],
        &["--panels", "c"],
        &["--kind", "trace", "--where", "ν=0.3", "--where", "Γ=∞"],
    ] {
        let svg = figure(at, more);
        let height = |word: &str| {
            let (before, _) = svg.rsplit_once(&format!(">{word}</text>")).unwrap();
            let (_, attributes) = before.rsplit_once("<text ").unwrap();
            let (_, rest) = attributes.split_once("y=\"").unwrap();
            rest.split_once('"').unwrap().0.parse::<f64>().unwrap()
        };
        let axis = if more.contains(&"trace") {
            "strain"
        } else {
            "shear rate Γ"
        };
        assert!(height("dilute 1 + 5c/3") > height(axis), "{more:?}");
    }
}

#[test]
fn more_than_eight_curves_of_a_number_go_by_its_order() {
    let many = PAPER_CAMPAIGN
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
    let folder = folder("m.toml", &many);
    let at = folder.path();
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
fn names_of_ticks_do_not_run_into_each_other() {
    let folder = PAPER.folder();
    let at = folder.path();
    let wide = ["--units", "a=1um,mu=1mPas,f_crit=10pN"];
    let narrow = [&wide[..], &["--panels", "area_fraction"]].concat();
    let [wide, narrow] = [&wide[..], &narrow].map(|options| figure(at, options));
    for word in ["10", "100", "1000", "10000"] {
        assert!(words(&wide).contains(&word), "{word}");
    }
    for word in ["0", "∞"] {
        let number = words(&narrow).iter().filter(|w| **w == word).count();
        assert!(
            number >= 2,
            "plateaus are always named: {:?}",
            words(&narrow)
        );
    }
}
