//! Paths that are no results of a campaign, in the look of its figures.

use super::look::Look;
use super::origin::Origin;
use super::sketch::{Field, Form, Height, Line, Sketch, Spot};
use super::{Format, Outline, file};
use crate::report::curves::Label;
use crate::report::error::ReportError;

/// A path: its entry in the legend and its places.
pub type Graph<'a> = (&'a str, Vec<[f64; 2]>);

/// Draws paths between axes of these names.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw.
pub fn draw_graphs(
    graphs: &[Graph<'_>],
    [x, y]: [&str; 2],
    format: Format,
) -> Result<Vec<u8>, ReportError> {
    let spot = |&[x, y]: &[f64; 2]| Spot {
        x,
        y: Some(Height::bare(y)),
    };
    let line = |(place, (label, places)): (usize, &Graph<'_>)| Line {
        place,
        ..Line::new(
            Label::of_words(label),
            places.iter().map(spot).collect(),
            Form::Trace,
            0,
        )
    };
    let sketch = Sketch {
        lines: graphs.iter().enumerate().map(line).collect(),
        panels: vec![Field::default()],
        x: x.into(),
        y: y.into(),
        ..Sketch::default()
    };
    let look = Look::default();
    let outline = Outline::of(&sketch, &look)?;
    file(&outline, &look.style, format, &Origin::of(&[]))
}
