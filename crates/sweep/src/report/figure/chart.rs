//! A trace as a small chart of characters.

use super::scale::Scale;
use kuva::backend::terminal::TerminalBackend;
use kuva::render::color::Color;
use kuva::render::render::{Primitive, Scene, TextAnchor};

/// Lines of a chart: a title, the curve, the horizontal axis and its numbers.
const ROWS: u16 = 16;
/// The line of the horizontal axis.
const AXIS: f64 = 14.0;
/// Units of a scene in a character: many, since what is almost level is drawn as level.
const UNITS: f64 = 100.0;
/// Columns of a chart at least.
const NARROWEST: u16 = 40;

/// Viscosity against strain as lines of text, `columns` wide, without colours.
pub(crate) fn chart(trace: &[(f64, f64)], columns: u16) -> String {
    let columns = columns.max(NARROWEST);
    let ends = |of: fn(&(f64, f64)) -> f64| {
        let values = trace.iter().map(of);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    };
    let ([start, end], [low, high]) = (ends(|p| p.0), ends(|p| p.1));
    let strains = Scale::linear(String::new(), start, end);
    let viscosities = if low > 0.0 && high > 10.0 * low {
        Scale::logarithmic(String::new(), low, high)
    } else {
        let room = if high > low { 0.0 } else { 0.5 };
        Scale::linear(String::new(), low - room, high + room)
    };
    // In characters from the upper left corner.
    let mut scene = Scene::new(UNITS * f64::from(columns), UNITS * f64::from(ROWS));
    let words = viscosities.ticks.iter().map(|(_, word)| length(word));
    let left = words.fold(0.0, f64::max) + 2.0;
    let right = f64::from(columns) - 4.0;
    let across = |strain| left + strains.part(strain) * (right - left);
    let down = |viscosity| AXIS - viscosities.part(viscosity) * (AXIS - 2.0);
    let title = "viscosity against strain";
    write(&mut scene, 0.5 * (left + right - length(title)), 0.0, title);
    rule(&mut scene, [left, 1.0], [left, AXIS]);
    rule(&mut scene, [left, AXIS], [right, AXIS]);
    for (viscosity, word) in &viscosities.ticks {
        let row = down(*viscosity).round();
        rule(&mut scene, [left - 1.0, row], [left, row]);
        write(&mut scene, left - 1.0 - length(word), row, word);
    }
    for (strain, word) in &strains.ticks {
        let column = across(*strain).round();
        rule(&mut scene, [column, AXIS], [column, AXIS + 1.0]);
        write(
            &mut scene,
            column - (0.5 * length(word)).floor(),
            AXIS + 1.0,
            word,
        );
    }
    scene.add(Primitive::PolyLine {
        points: trace
            .iter()
            .map(|(strain, viscosity)| (middle(across(*strain)), middle(down(*viscosity))))
            .collect(),
        stroke: ink(),
        stroke_width: 1.0,
        stroke_dasharray: None,
    });
    let drawn = TerminalBackend::new(usize::from(columns), usize::from(ROWS)).render_scene(&scene);
    let plain = without_colours(&drawn);
    let lines: Vec<&str> = plain.lines().map(str::trim_end).collect();
    lines.join("\n").trim_end().to_owned()
}

/// Any colour: none is shown.
fn ink() -> Color {
    Color::from("black")
}

fn length(word: &str) -> f64 {
    word.chars().count() as f64
}

/// The middle of a column or line, in units of the scene.
fn middle(place: f64) -> f64 {
    UNITS * (place + 0.5)
}

/// Words that begin in a column of a line.
fn write(scene: &mut Scene, column: f64, line: f64, words: &str) {
    scene.add(Primitive::Text {
        x: middle(column),
        y: middle(line),
        content: words.to_owned(),
        size: 1,
        anchor: TextAnchor::Start,
        rotate: None,
        bold: false,
        color: None,
    });
}

/// A line through the middles of characters.
fn rule(scene: &mut Scene, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) {
    scene.add(Primitive::Line {
        x1: middle(x1),
        y1: middle(y1),
        x2: middle(x2),
        y2: middle(y2),
        stroke: ink(),
        stroke_width: 1.0,
        stroke_dasharray: None,
    });
}

/// Text without escape sequences.
fn without_colours(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text.chars();
    while let Some(character) = rest.next() {
        if character == '\u{1b}' {
            // ESC [ parameters, ended by a letter.
            let _ = rest.by_ref().find(char::is_ascii_alphabetic);
        } else {
            plain.push(character);
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::chart;

    #[test]
    fn a_chart_has_its_title_axes_and_curve_and_keeps_its_width() {
        let rising: Vec<(f64, f64)> = (0..50)
            .map(|n| (0.1 * f64::from(n), 5.0 + 0.1 * f64::from(n)))
            .collect();
        let decades: Vec<(f64, f64)> = rising
            .iter()
            .map(|(strain, _)| (*strain, 10_f64.powf(*strain)))
            .collect();
        let flat = [(0.0, 7.0), (1.0, 7.0)];
        for (trace, ticks) in [
            (&rising[..], ["6╶┤", "9╶┤"]),
            (&decades, ["100╶┤", "10000╶┤"]),
            (&flat, ["6.6╶┤", "7.4╶┤"]),
        ] {
            for columns in [20, 60, 100] {
                let drawn = chart(trace, columns);
                let lines: Vec<&str> = drawn.lines().collect();
                assert_eq!(lines.len(), 16, "{drawn}");
                assert!(
                    lines[0].trim() == "viscosity against strain"
                        && lines[14].ends_with(['╴', '┐']),
                    "{drawn}"
                );
                assert!(ticks.iter().all(|tick| drawn.contains(tick)), "{drawn}");
                assert!(
                    lines
                        .iter()
                        .all(|line| line.chars().count() <= usize::from(columns).max(40)),
                    "{drawn}"
                );
            }
        }
    }
}
