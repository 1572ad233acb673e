//! Layout of bars on a terminal.

use crate::model::case::Case;

/// Widths of a bar, and width of the terminal from which the long one is used.
const BARS: [(u16, usize); 2] = [(110, 30), (0, 12)];

/// Columns of standard error, if it is a terminal.
pub(super) fn terminal_width() -> Option<u16> {
    let size = rustix::termios::tcgetwinsize(std::io::stderr()).ok()?;
    (size.ws_col > 0).then_some(size.ws_col)
}

/// Columns of a bar.
pub(super) fn bar_width() -> usize {
    let width = terminal_width().unwrap_or(80);
    let fitting = BARS.iter().find(|(least, _)| width >= *least);
    fitting.map_or(0, |(_, bar)| *bar)
}

/// Columns beside a bar and its percentage.
pub(super) fn room() -> usize {
    let width = usize::from(terminal_width().unwrap_or(80));
    width.saturating_sub(bar_width() + " 100 %  ".len())
}

/// Text beside the bar of a case: the case and its progress.
pub(super) fn line(case: &Case, strain: f64, viscosity: f64, room: usize) -> String {
    let mut so_far = format!("strain {strain:.2}");
    if viscosity.is_finite() {
        so_far = format!(
            "{so_far}  η {}",
            crate::text::format::significant(viscosity, 4)
        );
    }
    let label = case.label_within(room.saturating_sub(so_far.chars().count() + 2));
    format!("{label}  {so_far}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::protocol::Protocol;

    #[test]
    fn a_line_fits_beside_its_bar_and_no_word_is_cut() {
        let case = Case::new(crate::test_support::params(), 12, &Protocol::default());
        for room in [120, 80, 59, 40] {
            let line = line(&case, 12.34, 123.4, room);
            assert!(line.chars().count() <= room, "{line}");
            assert!(line.contains("seed 12  strain 12.34  η 123.4"), "{line}");
        }
    }
}
