//! The legend of a figure: its entries, their size, and where it hides least.

use super::font;
use super::outline::{Curve, Outline};
use super::palette::{Colour, Marker};
use super::shape::{Anchor, Place, Shape, Stroke, marker};

/// Length of the piece of line in an entry, over the size of the letters.
const SAMPLE: f64 = 2.2;
/// Height of an entry, over the size of the letters.
const ROW: f64 = 1.35;
/// What stands for a point without a result.
const MISSING: &str = "no result";
/// What stands for the end of the strain discarded, where runs differ in it.
const DISCARDED: &str = "end of the strain discarded";

/// The entries of a figure's legend.
#[derive(Debug)]
pub(super) struct Legend<'o> {
    entries: Vec<Entry<'o>>,
    /// Size of its letters.
    size: f64,
}

/// What an entry shows.
#[derive(Debug)]
enum Entry<'o> {
    Curve(&'o Curve),
    Missing,
    Discarded,
}

impl Entry<'_> {
    fn words(&self) -> &str {
        match self {
            Self::Curve(curve) => &curve.label,
            Self::Missing => MISSING,
            Self::Discarded => DISCARDED,
        }
    }
}

impl<'o> Legend<'o> {
    pub(super) fn of(outline: &'o Outline) -> Self {
        let curves = outline.entries().into_iter().map(Entry::Curve);
        let mut all = outline.panels.iter().flat_map(|panel| &panel.curves);
        let differ = all.any(|curve| curve.discard.is_some());
        let notes = [
            (outline.has_missing(), Entry::Missing),
            (differ, Entry::Discarded),
        ];
        let notes = notes
            .into_iter()
            .filter_map(|(there, note)| there.then_some(note));
        Self {
            entries: curves.chain(notes).collect(),
            size: outline.tick_size,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Width of the widest entry.
    fn entry_width(&self) -> f64 {
        let width = |entry: &Entry<'_>| font::width(entry.words(), self.size);
        let widest = self.entries.iter().map(width).fold(0.0, f64::max);
        widest + (SAMPLE + 1.4) * self.size
    }

    /// Columns that fit into a width, and the size of what they make.
    fn columns(&self, width: f64) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few at most"
        )]
        let fit = (width / self.entry_width()).floor() as usize;
        fit.clamp(1, self.entries.len().max(1))
    }

    /// Its height in a width.
    pub(super) fn height(&self, width: f64) -> f64 {
        let rows = self.entries.len().div_ceil(self.columns(width));
        ROW * self.size * rows as f64
    }

    /// Its width in one column.
    pub(super) fn width(&self) -> f64 {
        self.entry_width()
    }

    /// The width it takes beside the axes.
    pub(super) fn width_beside(&self, outline: &Outline) -> f64 {
        self.width() + 0.6 * outline.label_size
    }

    /// Draws it below and to the right of a place, in columns that fill a width.
    pub(super) fn draw(&self, [left, top]: Place, width: f64) -> Vec<Shape> {
        let columns = self.columns(width);
        let rows = self.entries.len().div_ceil(columns);
        let each = self.entry_width().min(width);
        // Words that are too long for the page are written smaller.
        let size = self.size * (width / self.entry_width()).min(1.0);
        let mut shapes = Vec::new();
        for (number, entry) in self.entries.iter().enumerate() {
            let x = left + each * (number / rows) as f64;
            let y = top + ROW * self.size * ((number % rows) as f64 + 0.5);
            let end = x + SAMPLE * size;
            let middle = [0.5 * (x + end), y];
            match entry {
                Entry::Curve(curve) => shapes.extend(sample(curve, x, end, y)),
                Entry::Missing => {
                    shapes.extend(marker(
                        Marker::Cross,
                        middle,
                        0.25 * size,
                        Colour::GREY,
                        0.7,
                    ));
                }
                Entry::Discarded => shapes.push(Shape::Line {
                    places: vec![[middle[0], y - 0.5 * size], [middle[0], y + 0.5 * size]],
                    stroke: Stroke::solid(Colour::GREY, 0.9),
                }),
            }
            shapes.push(Shape::Text {
                place: [end + 0.5 * size, y + 0.36 * size],
                words: entry.words().to_owned(),
                size,
                anchor: Anchor::Start,
                upright: false,
            });
        }
        shapes
    }

    /// The corner of a box in which it hides least of these places, and what it takes there.
    pub(super) fn corner(&self, [from, to]: [Place; 2], obstacles: &[Place]) -> [Place; 2] {
        let size = [
            self.entry_width(),
            ROW * self.size * self.entries.len() as f64,
        ];
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

/// How many places a box hides.
pub(super) fn hidden([from, to]: [Place; 2], obstacles: &[Place]) -> usize {
    let is_hidden =
        |[x, y]: &&Place| (from[0]..=to[0]).contains(x) && (from[1]..=to[1]).contains(y);
    obstacles.iter().filter(is_hidden).count()
}

/// A piece of a curve.
fn sample(curve: &Curve, from: f64, to: f64, y: f64) -> Vec<Shape> {
    let mut shapes = Vec::new();
    if !curve.pieces.is_empty() || curve.marker.is_none() {
        let width = if curve.marker.is_none() {
            1.8 * curve.width
        } else {
            curve.width
        };
        shapes.push(Shape::Line {
            places: vec![[from, y], [to, y]],
            stroke: Stroke {
                dashes: curve.dashes,
                ..Stroke::solid(curve.colour, width)
            },
        });
    }
    if let Some(kind) = curve.marker {
        let middle = [0.5 * (from + to), y];
        let drawn = marker(kind, middle, curve.marker_size, curve.colour, curve.width);
        shapes.extend(drawn);
    }
    shapes
}
