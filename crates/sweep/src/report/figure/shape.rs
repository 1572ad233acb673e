//! Shapes on a page, from which every kind of file is made.

use super::font;
use super::palette::{Colour, Marker};

/// A place on a page, in points from its upper left corner, x to the right and y down.
pub(super) type Place = [f64; 2];

/// A page: its size in points, and what is on it, the first behind all others.
#[derive(Debug, Default)]
pub(super) struct Page {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) shapes: Vec<Shape>,
}

/// One shape.
#[derive(Debug, Clone)]
pub(super) enum Shape {
    /// A line through places.
    Line { places: Vec<Place>, stroke: Stroke },
    /// A closed line through places, filled.
    Area {
        places: Vec<Place>,
        fill: Option<Colour>,
        /// How much of what is behind it it hides, from 0 to 1.
        opacity: f64,
        stroke: Option<Stroke>,
    },
    /// A circle, filled.
    Disc {
        centre: Place,
        radius: f64,
        fill: Colour,
        stroke: Stroke,
    },
    /// A line of text.
    Text {
        /// Where it is anchored, at its base line.
        place: Place,
        words: String,
        size: f64,
        anchor: Anchor,
        /// Read from below.
        upright: bool,
    },
    /// What follows is drawn only within a box, given by its corners, until [`Shape::EndClip`].
    Clip([Place; 2]),
    /// The end of a box.
    EndClip,
}

impl Shape {
    /// The same, a text with subscripts as one text for each of its pieces.
    pub(super) fn in_pieces(self) -> Vec<Self> {
        let Self::Text {
            place,
            words,
            size,
            anchor,
            upright,
        } = &self
        else {
            return vec![self];
        };
        let pieces = font::pieces(words);
        if pieces.len() == 1 {
            return vec![self];
        }
        // Along the line, and down from it.
        let shifted = |along: f64, down: f64| {
            let [x, y] = *place;
            if *upright {
                [x + down, y - along]
            } else {
                [x + along, y + down]
            }
        };
        let mut along = -anchor.part() * font::width(words, *size);
        let text = |(words, is_subscript): (&str, bool)| {
            let (size, down) = if is_subscript {
                (font::SUBSCRIPT * size, 0.16 * size)
            } else {
                (*size, 0.0)
            };
            let piece = Self::Text {
                place: shifted(along, down),
                words: words.to_owned(),
                size,
                anchor: Anchor::Start,
                upright: *upright,
            };
            along += font::width(words, size);
            piece
        };
        pieces.into_iter().map(text).collect()
    }

    /// The same, a dashed line as one solid line for each dash.
    pub(super) fn without_dashes(&self) -> Vec<Self> {
        let Self::Line { places, stroke } = self else {
            return vec![self.clone()];
        };
        let Some([dash, gap]) = stroke.dashes else {
            return vec![self.clone()];
        };
        let solid = Stroke {
            dashes: None,
            ..*stroke
        };
        let mut lines: Vec<Vec<Place>> = Vec::new();
        // Whether a dash is being drawn, and how much of it or of the gap is left.
        let (mut is_dash, mut left) = (true, dash);
        lines.extend(places.first().map(|first| vec![*first]));
        for pair in places.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let length = (to[0] - from[0]).hypot(to[1] - from[1]);
            let mut done = 0.0;
            while length - done > left {
                done += left;
                let part = done / length;
                let place = [0, 1].map(|k| from[k] + part * (to[k] - from[k]));
                match lines.last_mut() {
                    Some(line) if is_dash => line.push(place),
                    _ => lines.push(vec![place]),
                }
                is_dash = !is_dash;
                left = if is_dash { dash } else { gap };
            }
            left -= length - done;
            if let (true, Some(line)) = (is_dash, lines.last_mut()) {
                line.push(to);
            }
        }
        let lines = lines.into_iter().filter(|places| places.len() > 1);
        lines
            .map(|places| Self::Line {
                places,
                stroke: solid,
            })
            .collect()
    }
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    pub(super) colour: Colour,
    pub(super) width: f64,
    /// Lengths of a dash and of the gap after it.
    pub(super) dashes: Option<[f64; 2]>,
}

/// Which part of a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    /// The part of the width of a text that stands before its place.
    pub(super) fn part(self) -> f64 {
        match self {
            Self::Start => 0.0,
            Self::Middle => 0.5,
            Self::End => 1.0,
        }
    }
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
    let area = |corners: &[Place], fill| {
        vec![Shape::Area {
            places: corners.iter().copied().map(at).collect(),
            fill: Some(fill),
            opacity: 1.0,
            stroke: Some(stroke),
        }]
    };
    let line = |ends: [Place; 2]| Shape::Line {
        places: ends.map(at).to_vec(),
        stroke,
    };
    let disc = |fill| {
        vec![Shape::Disc {
            centre: place,
            radius,
            fill,
            stroke,
        }]
    };
    let square = [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]];
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
        Marker::Cross => vec![
            line([[-1.0, -1.0], [1.0, 1.0]]),
            line([[-1.0, 1.0], [1.0, -1.0]]),
        ],
        Marker::Plus => vec![
            line([[-1.2, 0.0], [1.2, 0.0]]),
            line([[0.0, -1.2], [0.0, 1.2]]),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dashes go on over the corners of a line.
    #[test]
    fn dashes_are_cut_along_the_whole_line() {
        let line = Shape::Line {
            places: vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 5.0]],
            stroke: Stroke::solid(Colour::INK, 1.0).dashed(3.0, 1.0),
        };
        let drawn: Vec<Vec<Place>> = line
            .without_dashes()
            .into_iter()
            .map(|shape| match shape {
                Shape::Line { places, stroke } if stroke.dashes.is_none() => places,
                other => unreachable!("{other:?} is no solid line"),
            })
            .collect();
        let wanted: [&[Place]; 2] = [
            &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0]],
            &[[2.0, 2.0], [2.0, 5.0]],
        ];
        assert_eq!(drawn, wanted);
    }
}
