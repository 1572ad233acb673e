//! What is drawn on a page: paths, lines of text, and clips, from which every kind of file is made.

use super::font;
use super::palette::{Colour, Marker};
use super::scale::count;

/// A place on a page, in points from its upper left corner, x to the right and y down.
pub(super) type Place = [f64; 2];

/// A length in single precision.
#[expect(clippy::cast_possible_truncation, reason = "a length on paper")]
pub(super) fn single(length: f64) -> f32 {
    length as f32
}

/// A page: its size in points, and what is on it, the first behind all others.
#[derive(Debug, Default)]
pub(super) struct Page {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) shapes: Vec<Shape>,
}

/// One shape.
#[derive(Debug)]
pub(super) enum Shape {
    /// A path that is filled, then stroked.
    Path {
        segments: Vec<Segment>,
        fill: Option<Fill>,
        stroke: Option<Stroke>,
    },
    Text(Text),
    /// A closed path outside of which nothing is drawn until [`Shape::EndClip`].
    Clip(Vec<Segment>),
    EndClip,
}

/// A part of a path.
#[derive(Debug, Clone, Copy)]
pub(super) enum Segment {
    Move(Place),
    Line(Place),
    /// A cubic Bézier curve: two control points and the end.
    Curve([Place; 3]),
    Close,
}

/// How an area is filled.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fill {
    pub(super) colour: Colour,
    /// From 0 to 1.
    pub(super) opacity: f64,
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    pub(super) colour: Colour,
    pub(super) width: f64,
    /// Lengths of a dash and of the gap after it; `None` for a solid line.
    pub(super) dashes: Option<[f64; 2]>,
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

/// Which part of a text stands at its place.
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
    /// A line through places.
    pub(super) fn line(places: impl IntoIterator<Item = Place>, stroke: Stroke) -> Self {
        Self::Path {
            segments: through(places),
            fill: None,
            stroke: Some(stroke),
        }
    }

    /// A polygon.
    pub(super) fn area(
        corners: impl IntoIterator<Item = Place>,
        fill: Option<Fill>,
        stroke: Option<Stroke>,
    ) -> Self {
        Self::Path {
            segments: polygon(corners),
            fill,
            stroke,
        }
    }

    /// A filled polygon without an outline.
    pub(super) fn filled(
        corners: impl IntoIterator<Item = Place>,
        colour: Colour,
        opacity: f64,
    ) -> Self {
        Self::area(corners, Some(Fill { colour, opacity }), None)
    }

    /// Places that it passes, along straight lines at most `step` apart.
    pub(super) fn places(&self, step: f64) -> Vec<Place> {
        let Self::Path { segments, .. } = self else {
            return Vec::new();
        };
        let mut places: Vec<Place> = Vec::new();
        for segment in segments {
            let (Segment::Move(to) | Segment::Line(to) | Segment::Curve([_, _, to])) = *segment
            else {
                continue;
            };
            if let (Segment::Line(_), Some(&from)) = (segment, places.last()) {
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

/// The segments of a line through places.
fn through(places: impl IntoIterator<Item = Place>) -> Vec<Segment> {
    let mut segments: Vec<Segment> = places.into_iter().map(Segment::Line).collect();
    if let Some(Segment::Line(first)) = segments.first().copied() {
        segments[0] = Segment::Move(first);
    }
    segments
}

/// The segments of a polygon.
pub(super) fn polygon(corners: impl IntoIterator<Item = Place>) -> Vec<Segment> {
    let mut segments = through(corners);
    segments.push(Segment::Close);
    segments
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

    /// The point so far along the line from its anchored point, and so far below it.
    fn shifted(&self, along: f64, down: f64) -> Place {
        let [x, y] = self.place;
        if self.upright {
            [x + down, y - along]
        } else {
            [x + along, y + down]
        }
    }

    /// Where its first letter begins.
    pub(super) fn start(&self) -> Place {
        let part = match self.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => 0.5,
            Anchor::End => 1.0,
        };
        self.shifted(-part * font::width(&self.words, self.size), 0.0)
    }

    /// Shapes that show it: one, or one for each of its pieces where it has subscripts.
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

/// A marker of a radius at a place.
pub(super) fn marker(
    kind: Marker,
    place: Place,
    radius: f64,
    colour: Colour,
    width: f64,
) -> Vec<Shape> {
    let stroke = Stroke::solid(colour, width);
    let at = |[x, y]: Place| [place[0] + radius * x, place[1] + radius * y];
    let fill = |colour| {
        Some(Fill {
            colour,
            opacity: 1.0,
        })
    };
    let area = |corners: &[Place], colour| {
        let corners = corners.iter().copied().map(at);
        vec![Shape::area(corners, fill(colour), Some(stroke))]
    };
    let disc = |colour| {
        vec![Shape::Path {
            segments: circle(place, radius),
            fill: fill(colour),
            stroke: Some(stroke),
        }]
    };
    let lines = |lines: &[[Place; 2]]| {
        let line = |ends: &[Place; 2]| Shape::line(ends.map(at), stroke);
        lines.iter().map(line).collect()
    };
    let square = corners([[-0.9, -0.9], [0.9, 0.9]]);
    let triangle = [[0.0, -1.2], [1.1, 0.8], [-1.1, 0.8]];
    let diamond = [[0.0, -1.3], [1.3, 0.0], [0.0, 1.3], [-1.3, 0.0]];
    match kind {
        Marker::Circle => disc(colour),
        Marker::HollowCircle => disc(Colour::WHITE),
        Marker::Square => area(&square, colour),
        Marker::HollowSquare => area(&square, Colour::WHITE),
        Marker::Triangle => area(&triangle, colour),
        Marker::HollowTriangle => area(&triangle, Colour::WHITE),
        Marker::Diamond => area(&diamond, colour),
        Marker::HollowDiamond => area(&diamond, Colour::WHITE),
        Marker::TriangleDown => area(&triangle.map(|[x, y]| [x, -y]), colour),
        Marker::Cross => lines(&[[[-1.0, -1.0], [1.0, 1.0]], [[-1.0, 1.0], [1.0, -1.0]]]),
        Marker::Plus => lines(&[[[-1.2, 0.0], [1.2, 0.0]], [[0.0, -1.2], [0.0, 1.2]]]),
        Marker::Bar => lines(&[[[0.0, -2.0], [0.0, 2.0]]]),
    }
}

/// A circle of four Bézier curves.
fn circle(centre: Place, radius: f64) -> Vec<Segment> {
    /// Distance of the ends of a quarter circle from its control points, over its radius.
    const ARC: f64 = 0.552_284_75;
    let at = |[x, y]: Place| [centre[0] + radius * x, centre[1] + radius * y];
    let mut segments = vec![Segment::Move(at([1.0, 0.0]))];
    let ends = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]];
    segments.extend(ends.windows(2).map(|pair| {
        let [a, b] = [pair[0], pair[1]];
        let control = |from: Place, to: Place| at([0, 1].map(|k| from[k] + ARC * to[k]));
        Segment::Curve([control(a, b), control(b, a), at(b)])
    }));
    segments.push(Segment::Close);
    segments
}
