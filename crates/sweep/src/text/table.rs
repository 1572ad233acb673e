//! Tables for people.

use comfy_table::{ColumnConstraint, ContentArrangement, LineStyle, Row, Table, Width, presets};

/// An empty table in the style of the program; `width` is that of the terminal.
pub(crate) fn styled(width: Option<u16>) -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none()))
        .set_content_arrangement(ContentArrangement::Dynamic);
    // Not a terminal: unlimited width, for files and pipes.
    table.set_width(width.unwrap_or(u16::MAX));
    table
}

/// A table for a terminal of this width as text. Words and numbers are not split over lines, even
/// if it gets wider than the terminal.
pub(crate) fn table<R: Into<Row>>(
    width: Option<u16>,
    heads: impl Into<Row>,
    rows: impl IntoIterator<Item = R>,
) -> String {
    let mut table = styled(width);
    table.set_header(heads);
    table.add_rows(rows);
    let mut longest: Vec<usize> = Vec::new();
    for row in table.header().into_iter().chain(table.row_iter()) {
        for (place, cell) in row.cell_iter().enumerate() {
            let words = cell.content();
            let words = words.split_whitespace().map(|word| word.chars().count());
            longest.resize(longest.len().max(place + 1), 0);
            longest[place] = longest[place].max(words.max().unwrap_or(0));
        }
    }
    for (column, length) in table.column_iter_mut().zip(longest) {
        // One space on either side.
        let width = u16::try_from(length + 2).unwrap_or(u16::MAX);
        column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(width)));
    }
    table.to_string()
}
