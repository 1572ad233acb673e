//! A trace as a small chart of characters.

use kuva::backend::terminal::TerminalBackend;
use kuva::plot::LinePlot;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;

/// Lines of a chart.
const ROWS: u16 = 16;

/// Viscosity against strain as lines of text, `columns` wide, without colours.
pub(crate) fn chart(trace: &[(f64, f64)], columns: u16) -> String {
    let low = trace.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let high = trace.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
    let plots = vec![Plot::Line(LinePlot::new().with_data(trace.iter().copied()))];
    let mut layout = Layout::auto_from_plots(&plots)
        .with_width(f64::from(columns) * 8.0)
        .with_height(f64::from(ROWS) * 16.0)
        .with_term_rows(u32::from(ROWS))
        .with_show_grid(false)
        .with_title("viscosity against strain");
    if low > 0.0 && high > 10.0 * low {
        layout = layout.with_log_y();
    }
    let drawn = TerminalBackend::new(usize::from(columns), usize::from(ROWS))
        .render_scene(&render_multiple(plots, layout));
    let plain = without_colours(&drawn);
    let lines: Vec<&str> = plain.lines().map(str::trim_end).collect();
    lines.join("\n").trim_end().to_owned()
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
