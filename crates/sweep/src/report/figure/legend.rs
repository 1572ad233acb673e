//! The legend of a figure: its entries, their size, and its best position.

use super::font;
use super::outline::{Curve, Outline};
use super::scale::count;
use super::scene::{Anchor, Place, Shape, Stroke, Text, marker};

/// Length of the line in an entry, over the font size.
const SAMPLE: f64 = 2.2;
/// Height of an entry, over the font size.
const ROW: f64 = 1.35;
/// The entries of a figure's legend.
#[derive(Debug)]
pub(super) struct Legend<'o> {
    entries: Vec<&'o Curve>,
    /// Font size.
    size: f64,
}

impl<'o> Legend<'o> {
    pub(super) fn of(outline: &'o Outline) -> Self {
        Self {
            entries: outline.entries(),
            size: outline.tick_size,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Its width in one column, which is that of its widest entry.
    pub(super) fn width(&self) -> f64 {
        let widths = self
            .entries
            .iter()
            .map(|curve| font::width(&curve.label, self.size));
        widths.fold(0.0, f64::max) + (SAMPLE + 1.4) * self.size
    }

    /// Number of columns that fit into a width, and the resulting size.
    fn columns(&self, width: f64) -> usize {
        let fit = count((width / self.width()).floor());
        fit.clamp(1, self.entries.len().max(1))
    }

    /// Its height at a width.
    pub(super) fn height(&self, width: f64) -> f64 {
        let rows = self.entries.len().div_ceil(self.columns(width));
        ROW * self.size * rows as f64
    }

    /// Its width beside the axes.
    pub(super) fn width_beside(&self, outline: &Outline) -> f64 {
        self.width() + 0.6 * outline.label_size
    }

    /// Draws it below and to the right of a point, in columns that fill a width.
    pub(super) fn draw(&self, [left, top]: Place, width: f64) -> Vec<Shape> {
        let columns = self.columns(width);
        let rows = self.entries.len().div_ceil(columns);
        let each = self.width().min(width);
        // Entries too long for the page are set smaller.
        let size = self.size * (width / self.width()).min(1.0);
        let mut shapes = Vec::new();
        for (number, curve) in self.entries.iter().enumerate() {
            let x = left + each * (number / rows) as f64;
            let y = top + ROW * self.size * ((number % rows) as f64 + 0.5);
            let end = x + SAMPLE * size;
            shapes.extend(sample(curve, x, end, y));
            let place = [end + 0.5 * size, y + 0.36 * size];
            shapes.extend(Text::new(place, &curve.label, size, Anchor::Start).shapes());
        }
        shapes
    }

    /// The corner of a box in which it hides the fewest of these points, and its extent there.
    pub(super) fn corner(&self, [from, to]: [Place; 2], obstacles: &[Place]) -> [Place; 2] {
        let size = [self.width(), ROW * self.size * self.entries.len() as f64];
        let gap = 0.6 * self.size;
        let lefts = [from[0] + gap, to[0] - gap - size[0]];
        let tops = [from[1] + gap, to[1] - gap - size[1]];
        let corners = tops
            .into_iter()
            .flat_map(|top| lefts.map(|left| [[left, top], [left + size[0], top + size[1]]]));
        let best = corners.min_by_key(|corner| hidden(*corner, obstacles));
        best.unwrap_or([from, to])
    }
}

/// Number of points that a box hides.
fn hidden([from, to]: [Place; 2], obstacles: &[Place]) -> usize {
    let is_hidden =
        |[x, y]: &&Place| (from[0]..=to[0]).contains(x) && (from[1]..=to[1]).contains(y);
    obstacles.iter().filter(is_hidden).count()
}

/// A piece of a curve.
fn sample(curve: &Curve, from: f64, to: f64, y: f64) -> Vec<Shape> {
    let mut shapes = Vec::new();
    if !curve.pieces.is_empty() || curve.marker.is_none() {
        let part = if curve.marker.is_none() { 1.8 } else { 1.0 };
        let stroke = Stroke {
            dashes: curve.dashes,
            ..Stroke::solid(curve.colour, part * curve.width)
        };
        shapes.extend(Shape::line([[from, y], [to, y]], stroke));
    }
    if let Some(kind) = curve.marker {
        let middle = [0.5 * (from + to), y];
        shapes.extend(marker(
            kind,
            middle,
            curve.marker_size,
            curve.colour,
            curve.width,
        ));
    }
    shapes
}
