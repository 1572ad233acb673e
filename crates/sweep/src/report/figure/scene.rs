//! Content of a page: paths and lines of text, the common source of all formats.

use super::font;
use super::palette::{Colour, Marker};
use super::scale::count;
use tiny_skia::{Path, PathBuilder, PathSegment, Transform};

/// A position on a page, in points from its upper left corner, x to the right and y down.
pub(super) type Place = [f64; 2];

/// A length in single precision.
#[expect(clippy::cast_possible_truncation, reason = "a length on paper")]
pub(super) fn single(length: f64) -> f32 {
    length as f32
}

/// A page: its size in points, and its shapes from back to front.
#[derive(Debug, Default)]
pub(super) struct Page {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) shapes: Vec<Shape>,
}

/// One shape.
#[derive(Debug)]
pub(super) enum Shape {
    /// A path, filled with a colour and opacity, then stroked.
    Path {
        path: Path,
        fill: Option<(Colour, f32)>,
        stroke: Option<Stroke>,
    },
    Text(Text),
    /// Shapes clipped to the box between these corners.
    Within([Place; 2], Vec<Shape>),
}

/// Style of a line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    pub(super) colour: Colour,
    pub(super) width: f64,
    /// Lengths of a dash and of the gap after it; `None` for a solid line.
    pub(super) dashes: Option<[f64; 2]>,
    /// Whether its ends are round instead of straight.
    pub(super) is_round: bool,
}

/// A line of text.
#[derive(Debug, Clone)]
pub(super) struct Text {
    /// The anchored point of its baseline.
    pub(super) place: Place,
    pub(super) words: String,
    pub(super) size: f64,
    pub(super) anchor: Anchor,
    /// Whether it runs from below to above.
    pub(super) upright: bool,
}

/// The part of a text that is anchored at its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Stroke {
    pub(super) fn solid(colour: Colour, width: f64) -> Self {
        Self {
            colour,
            width,
            dashes: None,
            is_round: false,
        }
    }

    pub(super) fn rounded(self) -> Self {
        Self {
            is_round: true,
            ..self
        }
    }

    pub(super) fn dashed(self, dash: f64, gap: f64) -> Self {
        Self {
            dashes: Some([dash, gap]),
            ..self
        }
    }
}

impl Shape {
    /// A line through points; `None` for fewer than two.
    pub(super) fn line(places: impl IntoIterator<Item = Place>, stroke: Stroke) -> Option<Self> {
        Some(Self::Path {
            path: through(places).finish()?,
            fill: None,
            stroke: Some(stroke),
        })
    }

    /// A filled polygon.
    pub(super) fn filled(
        corners: impl IntoIterator<Item = Place>,
        colour: Colour,
        opacity: f32,
    ) -> Option<Self> {
        Some(Self::Path {
            path: polygon(corners)?,
            fill: Some((colour, opacity)),
            stroke: None,
        })
    }

    /// A polygon with an edge, filled or not.
    pub(super) fn edged(
        corners: impl IntoIterator<Item = Place>,
        fill: Option<Colour>,
        stroke: Stroke,
    ) -> Option<Self> {
        Some(Self::Path {
            path: polygon(corners)?,
            fill: fill.map(|colour| (colour, 1.0)),
            stroke: Some(stroke),
        })
    }

    /// A disc.
    pub(super) fn disc(
        place: Place,
        radius: f64,
        fill: Colour,
        stroke: Option<Stroke>,
    ) -> Option<Self> {
        Some(Self::Path {
            path: placed(circle()?, place, radius)?,
            fill: Some((fill, 1.0)),
            stroke,
        })
    }

    /// Points along it, at most `step` apart on straight lines.
    pub(super) fn places(&self, step: f64) -> Vec<Place> {
        let Self::Path { path, .. } = self else {
            return Vec::new();
        };
        let mut places: Vec<Place> = Vec::new();
        for segment in path.segments() {
            let (PathSegment::MoveTo(to)
            | PathSegment::LineTo(to)
            | PathSegment::QuadTo(_, to)
            | PathSegment::CubicTo(_, _, to)) = segment
            else {
                continue;
            };
            let to = [to.x, to.y].map(f64::from);
            if let (PathSegment::LineTo(_), Some(&from)) = (segment, places.last()) {
                let length = (to[0] - from[0]).hypot(to[1] - from[1]);
                let number = count((length / step).ceil().min(1e4));
                let place = |n: usize| {
                    [0, 1].map(|k| from[k] + n as f64 / number as f64 * (to[k] - from[k]))
                };
                places.extend((1..number).map(place));
            }
            places.push(to);
        }
        places
    }
}

/// A line through points.
fn through(places: impl IntoIterator<Item = Place>) -> PathBuilder {
    let mut path = PathBuilder::new();
    for [x, y] in places.into_iter().map(|place| place.map(single)) {
        if path.is_empty() {
            path.move_to(x, y);
        } else {
            path.line_to(x, y);
        }
    }
    path
}

/// A polygon; `None` of fewer than two corners.
pub(super) fn polygon(corners: impl IntoIterator<Item = Place>) -> Option<Path> {
    let mut path = through(corners);
    path.close();
    path.finish()
}

/// All corners of a box, of which two opposite ones are given.
pub(super) fn corners([[left, top], [right, bottom]]: [Place; 2]) -> [Place; 4] {
    [[left, top], [right, top], [right, bottom], [left, bottom]]
}

impl Text {
    pub(super) fn new(place: Place, words: &str, size: f64, anchor: Anchor) -> Self {
        Self {
            place,
            words: words.to_owned(),
            size,
            anchor,
            upright: false,
        }
    }

    pub(super) fn upright(self) -> Self {
        Self {
            upright: true,
            ..self
        }
    }

    /// The point at a distance along the line from its anchor, and a distance below it.
    fn shifted(&self, along: f64, down: f64) -> Place {
        let [x, y] = self.place;
        if self.upright {
            [x + down, y - along]
        } else {
            [x + along, y + down]
        }
    }

    /// Position of its first letter.
    pub(super) fn start(&self) -> Place {
        let part = match self.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => 0.5,
            Anchor::End => 1.0,
        };
        self.shifted(-part * font::width(&self.words, self.size), 0.0)
    }

    /// Its shapes: one, or with subscripts one for each piece.
    pub(super) fn shapes(self) -> Vec<Shape> {
        let pieces = font::pieces(&self.words);
        if pieces.len() == 1 {
            return vec![Shape::Text(self)];
        }
        let mut rest = Self {
            place: self.start(),
            anchor: Anchor::Start,
            ..self.clone()
        };
        let piece = |(words, is_subscript): (&str, bool)| {
            let part = if is_subscript { font::SUBSCRIPT } else { 1.0 };
            let down = if is_subscript { 0.16 * rest.size } else { 0.0 };
            let piece = Self {
                place: rest.shifted(0.0, down),
                words: words.to_owned(),
                size: part * rest.size,
                ..rest
            };
            rest.place = rest.shifted(font::width(words, piece.size), 0.0);
            Shape::Text(piece)
        };
        pieces.into_iter().map(piece).collect()
    }
}

/// A path around the origin, scaled and moved to a point.
fn placed(path: Path, [x, y]: Place, size: f64) -> Option<Path> {
    let [x, y, size] = [x, y, size].map(single);
    path.transform(Transform::from_translate(x, y).pre_scale(size, size))
}

/// A marker of a radius at a point.
pub(super) fn marker(
    kind: Marker,
    place: Place,
    radius: f64,
    colour: Colour,
    width: f64,
) -> Option<Shape> {
    let triangle = [[0.0, -1.2], [1.1, 0.8], [-1.1, 0.8]];
    let lines = |[a, b]: [Place; 2], [c, d]: [Place; 2]| {
        let mut path = through([a, b]);
        path.push_path(&through([c, d]).finish()?);
        path.finish()
    };
    let (path, fill) = match kind {
        Marker::Circle => (circle(), Some(colour)),
        Marker::HollowCircle => (circle(), Some(Colour::WHITE)),
        Marker::Square => (polygon(SQUARE), Some(colour)),
        Marker::HollowSquare => (polygon(SQUARE), Some(Colour::WHITE)),
        Marker::Triangle => (polygon(triangle), Some(colour)),
        Marker::HollowTriangle => (polygon(triangle), Some(Colour::WHITE)),
        Marker::TriangleDown => (polygon(triangle.map(|[x, y]| [x, -y])), Some(colour)),
        Marker::Diamond => (polygon(DIAMOND), Some(colour)),
        Marker::HollowDiamond => (polygon(DIAMOND), Some(Colour::WHITE)),
        Marker::Cross => (
            lines([[-1.0, -1.0], [1.0, 1.0]], [[-1.0, 1.0], [1.0, -1.0]]),
            None,
        ),
        Marker::Plus => (
            lines([[-1.2, 0.0], [1.2, 0.0]], [[0.0, -1.2], [0.0, 1.2]]),
            None,
        ),
        Marker::Bar => (through([[0.0, -2.0], [0.0, 2.0]]).finish(), None),
    };
    Some(Shape::Path {
        path: placed(path?, place, radius)?,
        fill: fill.map(|colour| (colour, 1.0)),
        stroke: Some(Stroke::solid(colour, width)),
    })
}

const SQUARE: [Place; 4] = [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]];
const DIAMOND: [Place; 4] = [[0.0, -1.3], [1.3, 0.0], [0.0, 1.3], [-1.3, 0.0]];

/// A circle of radius 1 of four Bézier curves.
fn circle() -> Option<Path> {
    /// Distance of the ends of a quarter circle from its control points, over its radius.
    const ARC: f32 = 0.552_284_8;
    let mut path = PathBuilder::new();
    path.move_to(1.0, 0.0);
    for [x, y] in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]] {
        // From (x, y) to (-y, x).
        path.cubic_to(x - ARC * y, y + ARC * x, ARC * x - y, ARC * y + x, -y, x);
    }
    path.close();
    path.finish()
}
