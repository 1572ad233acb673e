//! Malicious and nonsensical files.

use super::{GOOD, parse_text};
use proptest::prelude::*;

#[test]
fn hostile_files_are_cheap() {
    // A short file that would take much memory is refused at the second grid.
    let grid = &GOOD[GOOD.find("[[grid]]").unwrap()..];
    let many = grid.replace("seeds = 4", "seeds = 166000");
    let text = format!(
        "{}{}",
        GOOD.replace("seeds = 4", "seeds = 166000"),
        many.repeat(500)
    );
    assert!(parse_text(&text).unwrap_err().to_string().contains("cases"));
    // Deep nesting, one endless line.
    for text in [
        format!("name = {}", "[".repeat(100_000)),
        format!("name = \"{}\"", "x".repeat(500_000)),
        format!("{} = 1", "k".repeat(500_000)),
        "a.".repeat(200_000),
    ] {
        let error = parse_text(&text).unwrap_err();
        let mut shown = String::new();
        miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor())
            .render_report(&mut shown, &error)
            .unwrap();
        assert!(shown.len() < 4000, "{} bytes", shown.len());
    }
}

proptest! {
    #[test]
    fn no_text_crashes_the_reader(text in "\\PC{0,200}") {
        let _ = parse_text(&text);
    }

    #[test]
    fn no_damage_to_a_good_file_crashes_the_reader(
        at in 0usize..250, length in 0usize..12, put in "[\\[\\]={}\"0-9a-z.\n_+-]{0,8}"
    ) {
        let start = at.min(GOOD.len());
        let end = (start + length).min(GOOD.len());
        let text = format!("{}{put}{}", &GOOD[..start], &GOOD[end..]);
        if let Err(error) = parse_text(&text) {
            let mut shown = String::new();
            miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor())
                .render_report(&mut shown, &error)
                .unwrap();
        }
    }

    #[test]
    fn no_bytes_crash_the_reader(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = parse_text(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn no_values_crash_the_reader(
        values in proptest::collection::vec(
            "(-?[0-9]{1,20}(\\.[0-9]{1,5})?(e-?[0-9]{1,4})?|inf|nan|\"[a-z-]{0,20}\"|\\[[0-9., inf]{0,30}\\]|true|\\{\\}|1979-05-27)",
            10
        )
    ) {
        let keys = [
            "area_fraction", "friction", "roughness", "shear_rate", "seeds", "spheres", "hydrodynamics", "contact",
            "size_ratio", "large_fraction",
        ];
        // Each key is reached whatever the faults of the others.
        for (key, value) in keys.iter().zip(&values) {
            let mut text = String::new();
            for line in GOOD.lines() {
                let same = line.split('=').next().is_some_and(|name| name.trim() == *key);
                if !same {
                    text.push_str(line);
                    text.push('\n');
                }
            }
            let _ = parse_text(&format!("{text}{key} = {value}\n"));
        }
    }
}
