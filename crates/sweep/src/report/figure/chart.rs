//! A trace as a small chart of characters.

use super::scale::{Scale, count, extent};
use std::collections::BTreeMap;

/// Lines of a chart: a title, the curve, the horizontal axis and its numbers.
const ROWS: usize = 16;
/// The line of the horizontal axis.
const AXIS: usize = 14;
/// Minimum width of a chart in columns.
const MIN_WIDTH: u16 = 40;
/// Bits of the dots of a Braille character, by row and column.
const DOTS: [[u8; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];

/// Viscosity against strain as lines of text, `columns` wide, without colours.
pub(crate) fn chart(trace: &[(f64, f64)], columns: u16) -> String {
    let columns = usize::from(columns.max(MIN_WIDTH));
    let [start, end] = extent(trace.iter().map(|point| point.0));
    let [low, high] = extent(trace.iter().map(|point| point.1));
    let strains = Scale::linear(String::new(), start, end);
    let room = if high > low { 0.0 } else { 0.5 };
    let is_logarithmic = low > 0.0 && high > 10.0 * low;
    let viscosities = Scale::of_kind(is_logarithmic, String::new(), low - room, high + room);
    let length = |word: &str| word.chars().count();
    let words = viscosities.ticks.iter().map(|(_, word)| length(word));
    let left = words.max().unwrap_or(0) + 2;
    let right = columns - 4;
    // Position in characters from the upper left corner.
    let across = |strain| left as f64 + strains.part(strain) * (right - left) as f64;
    let down = |viscosity| AXIS as f64 - viscosities.part(viscosity) * (AXIS - 2) as f64;
    let mut lines = vec![vec![' '; columns]; ROWS];
    let mut put = |row: usize, column: usize, words: &str| {
        for (cell, letter) in lines[row].iter_mut().skip(column).zip(words.chars()) {
            *cell = letter;
        }
    };
    let title = "viscosity against strain";
    put(0, (left + right - length(title)) / 2, title);
    for row in 1..AXIS {
        put(row, left, if row == 1 { "╷" } else { "│" });
    }
    put(AXIS, left, &format!("└{}╴", "─".repeat(right - left - 1)));
    for (viscosity, word) in &viscosities.ticks {
        let row = cell(down(*viscosity));
        let corner = if row == AXIS { "╶┴" } else { "╶┤" };
        put(row, left - 1 - length(word), word);
        put(row, left - 1, corner);
    }
    for (strain, word) in &strains.ticks {
        let column = cell(across(*strain));
        let tick = match column {
            column if column == left => "├",
            column if column == right => "┐",
            _ => "┬",
        };
        put(AXIS, column, tick);
        put(AXIS + 1, column.saturating_sub(length(word) / 2), word);
    }
    let places = trace.iter().map(|p| [across(p.0), down(p.1)]);
    for ([row, column], bits) in dots(&places.collect::<Vec<_>>()) {
        let cell = &mut lines[row][column];
        if *cell == ' ' {
            *cell = char::from_u32(0x2800 + u32::from(bits)).unwrap_or(' ');
        }
    }
    let lines = lines.into_iter().map(String::from_iter);
    let lines: Vec<String> = lines.map(|line| line.trim_end().to_owned()).collect();
    lines.join("\n")
}

/// The nearest whole number.
fn cell(place: f64) -> usize {
    count(place.round())
}

/// Dots of a line through points, by row and column of their characters.
fn dots(places: &[[f64; 2]]) -> BTreeMap<[usize; 2], u8> {
    let mut dots = BTreeMap::new();
    // The middle of a character lies between its dots.
    let fine = |[x, y]: [f64; 2]| [2.0 * x + 0.5, 4.0 * y + 1.5];
    for pair in places.windows(2) {
        let [from, to] = [fine(pair[0]), fine(pair[1])];
        let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs()).ceil();
        for step in 0..=cell(steps) {
            let part = step as f64 / steps.max(1.0);
            let [x, y] = [0, 1].map(|k| cell(from[k] + part * (to[k] - from[k])));
            *dots.entry([y / 4, x / 2]).or_insert(0) |= DOTS[y % 4][x % 2];
        }
    }
    dots
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
