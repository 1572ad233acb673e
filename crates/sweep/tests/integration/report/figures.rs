//! Figures for papers.

use super::{ONE, PAPER, PAPER_CAMPAIGN, figure, words};
use crate::harness::{fail, folder, json, refused, sweep};

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
        &["--kind", "trace", "--where", "ν=0.3"],
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
    let svg = figure(at, &["--legend", "none"]);
    assert!(!svg.contains("dilute"));
}

#[test]
fn several_stores_share_a_figure() {
    let folder = PAPER.folder();
    let at = folder.path();
    let other = PAPER_CAMPAIGN
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
    let folder = PAPER.folder();
    let at = folder.path();
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
    assert!(asked(&["--font-size", "11"]).contains("font-size=\"11\""));
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
    let units = ["--units", "a=1um,mu=1mPas,f_crit=10pN"];
    let drawn = |width| {
        figure(
            at,
            &[&units[..], &["--legend", "none", "--width", width]].concat(),
        )
    };
    let (wide, narrow) = (drawn("180mm"), drawn("40mm"));
    let (wide, narrow) = (words(&wide), words(&narrow));
    for word in ["10", "100", "1000", "10000"] {
        assert!(wide.contains(&word), "{wide:?}");
    }
    assert!(
        !narrow.contains(&"100") || !narrow.contains(&"1000"),
        "{narrow:?}"
    );
    for word in ["0", "∞"] {
        assert!(
            narrow.contains(&word),
            "plateaus are always named: {narrow:?}"
        );
    }
}
