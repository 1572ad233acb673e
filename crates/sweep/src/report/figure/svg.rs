//! The only writer of pictures: shapes and lines of text as SVG.

use super::font::{self, FAMILY, SUBSCRIPT};
use super::origin::Origin;
use super::palette::{Colour, Marker};
use std::fmt::Write as _;

/// A position on a page, in points from its upper left corner, x to the right and y down.
pub(super) type Position = [f64; 2];

/// Points per millimetre.
pub(super) const PER_MM: f64 = 72.0 / 25.4;

/// A line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    pub(super) colour: Colour,
    pub(super) width: f64,
    /// Lengths of a dash and of the gap after it; `None` for a solid line.
    pub(super) dashes: Option<[f64; 2]>,
    /// Whether its ends are round instead of straight.
    pub(super) is_round: bool,
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

    pub(super) fn dashed(self, dash: f64, gap: f64) -> Self {
        Self {
            dashes: Some([dash, gap]),
            ..self
        }
    }
}

/// The part of a text that is anchored at its position.
#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A picture in the making, from back to front.
#[derive(Debug, Default)]
pub(super) struct SvgWriter {
    body: String,
    clips: usize,
}

/// All corners of a box, of which two opposite ones are given.
pub(super) fn corners([[left, top], [right, bottom]]: [Position; 2]) -> [Position; 4] {
    [[left, top], [right, top], [right, bottom], [left, bottom]]
}

impl SvgWriter {
    /// A line through points; nothing for fewer than two.
    pub(super) fn line(&mut self, points: impl IntoIterator<Item = Position>, stroke: Stroke) {
        let data = path(points, false);
        if data.contains('L') {
            self.path(&data, None, Some(stroke));
        }
    }

    /// A filled polygon.
    pub(super) fn area(
        &mut self,
        corners: impl IntoIterator<Item = Position>,
        colour: Colour,
        opacity: f64,
    ) {
        self.path(&path(corners, true), Some((colour, opacity)), None);
    }

    /// A polygon with an edge, filled or not.
    pub(super) fn edged(
        &mut self,
        corners: impl IntoIterator<Item = Position>,
        fill: Option<Colour>,
        stroke: Stroke,
    ) {
        let fill = fill.map(|colour| (colour, 1.0));
        self.path(&path(corners, true), fill, Some(stroke));
    }

    pub(super) fn disc(
        &mut self,
        [x, y]: Position,
        radius: f64,
        fill: Colour,
        stroke: Option<Stroke>,
    ) {
        let [x, y, radius] = [x, y, radius].map(rounded);
        let shape = format!("circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"");
        self.element(&shape, Some((fill, 1.0)), stroke);
    }

    /// A marker of a radius at a point.
    pub(super) fn marker(
        &mut self,
        kind: Marker,
        [x, y]: Position,
        radius: f64,
        colour: Colour,
        width: f64,
    ) {
        let stroke = Stroke::solid(colour, width);
        let fill = if kind.is_hollow() {
            Colour::WHITE
        } else {
            colour
        };
        let places = |unit: &[Position]| -> Vec<Position> {
            let place = |[a, b]: &Position| [x + radius * a, y + radius * b];
            unit.iter().map(place).collect()
        };
        let triangle = [[0.0, -1.2], [1.1, 0.8], [-1.1, 0.8]];
        let polygon = match kind {
            Marker::Circle | Marker::HollowCircle => {
                return self.disc([x, y], radius, fill, Some(stroke));
            }
            Marker::Ring => {
                let [x, y, radius] = [x, y, radius].map(rounded);
                let shape = format!("circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"");
                return self.element(&shape, None, Some(stroke));
            }
            Marker::Frame => {
                let ends = [[x - radius, y - radius], [x + radius, y + radius]];
                return self.path(&path(corners(ends), true), None, Some(stroke));
            }
            Marker::Cross => {
                let ends = [[-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [1.0, -1.0]];
                let [a, b] = [&ends[..2], &ends[2..]].map(|ends| path(places(ends), false));
                return self.path(&(a + &b), None, Some(stroke));
            }
            Marker::Bar => return self.line(places(&[[0.0, -2.0], [0.0, 2.0]]), stroke),
            Marker::Square | Marker::HollowSquare => corners([[-0.9, -0.9], [0.9, 0.9]]).to_vec(),
            Marker::HollowDiamond => vec![[0.0, -1.3], [1.3, 0.0], [0.0, 1.3], [-1.3, 0.0]],
            Marker::Triangle | Marker::HollowTriangle => triangle.to_vec(),
            Marker::TriangleDown => triangle.map(|[x, y]| [x, -y]).to_vec(),
        };
        self.edged(places(&polygon), Some(fill), stroke);
    }

    /// A line of text; `is_upright`: from below to above.
    pub(super) fn text(
        &mut self,
        [x, y]: Position,
        text: &str,
        size: f64,
        anchor: Anchor,
        is_upright: bool,
    ) {
        let [x, y] = [x, y].map(rounded);
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let turn = if is_upright {
            format!(" transform=\"rotate(-90 {x} {y})\"")
        } else {
            String::new()
        };
        let _ = write!(
            self.body,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{anchor}\"{turn}>",
            rounded(size)
        );
        let down = rounded(0.16 * size);
        let mut is_below = false;
        for (piece, is_subscript) in font::pieces(text) {
            let piece = escaped(piece);
            let _ = match (is_subscript, is_below) {
                (true, _) => {
                    let small = rounded(SUBSCRIPT * size);
                    write!(
                        self.body,
                        "<tspan dy=\"{down}\" font-size=\"{small}\">{piece}</tspan>"
                    )
                }
                (false, true) => write!(self.body, "<tspan dy=\"-{down}\">{piece}</tspan>"),
                (false, false) => write!(self.body, "{piece}"),
            };
            is_below = is_subscript;
        }
        self.body.push_str("</text>\n");
    }

    /// Shapes clipped to the box between these corners.
    pub(super) fn clipped(&mut self, ends: [Position; 2], draw: impl FnOnce(&mut Self)) {
        let (clip, data) = (self.clips, path(corners(ends), true));
        self.clips += 1;
        let _ = writeln!(
            self.body,
            "<clipPath id=\"clip{clip}\"><path d=\"{data}\"/></clipPath><g clip-path=\"url(#clip{clip})\">"
        );
        draw(self);
        self.body.push_str("</g>\n");
    }

    fn path(&mut self, data: &str, fill: Option<(Colour, f64)>, stroke: Option<Stroke>) {
        self.element(&format!("path d=\"{data}\""), fill, stroke);
    }

    fn element(&mut self, shape: &str, fill: Option<(Colour, f64)>, stroke: Option<Stroke>) {
        let _ = write!(self.body, "<{shape}");
        let _ = match fill {
            None => write!(self.body, " fill=\"none\""),
            Some((colour, 1.0)) => write!(self.body, " fill=\"{colour}\""),
            Some((colour, opacity)) => {
                write!(self.body, " fill=\"{colour}\" fill-opacity=\"{opacity}\"")
            }
        };
        if let Some(stroke) = stroke {
            let (colour, width) = (stroke.colour, rounded(stroke.width));
            let _ = write!(self.body, " stroke=\"{colour}\" stroke-width=\"{width}\"");
            if stroke.is_round {
                self.body.push_str(" stroke-linecap=\"round\"");
            }
            if let Some([dash, gap]) = stroke.dashes {
                let _ = write!(self.body, " stroke-dasharray=\"{dash} {gap}\"");
            }
        }
        self.body.push_str("/>\n");
    }

    /// The file of a page of this size: in millimetres, with a view box in points and its origin.
    pub(super) fn file(self, [width, height]: [f64; 2], origin: &Origin) -> String {
        let [w, h] = [width, height].map(rounded);
        let [mm_wide, mm_high] = [width, height].map(|points| points / PER_MM);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{mm_wide:.3}mm\" height=\"{mm_high:.3}mm\" \
             viewBox=\"0 0 {w} {h}\" font-family=\"{FAMILY}\" fill=\"{ink}\" stroke-linejoin=\"round\">\n\
             <title>{title}</title>\n<metadata>{origin}</metadata>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"{white}\"/>\n{body}</svg>\n",
            ink = Colour::INK,
            white = Colour::WHITE,
            title = escaped(&origin.title),
            origin = escaped(&origin.text),
            body = self.body,
        )
    }
}

/// The data of a path through points.
fn path(points: impl IntoIterator<Item = Position>, is_closed: bool) -> String {
    let mut data = String::new();
    for [x, y] in points {
        let letter = if data.is_empty() { 'M' } else { 'L' };
        let _ = write!(data, "{letter}{} {}", rounded(x), rounded(y));
    }
    if is_closed {
        data.push('Z');
    }
    data
}

/// A length to a hundredth of a point.
fn rounded(points: f64) -> f64 {
    (100.0 * points).round() / 100.0
}

/// Text for an element.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped_and_subscripts_return_to_the_line() {
        let mut svg = SvgWriter::default();
        svg.text(
            [1.0, 2.0],
            "F_crit/a² < 1 & <b>",
            10.0,
            Anchor::Start,
            false,
        );
        let whole = svg.file([10.0, 20.0], &Origin::of_lines("<t>", &[]));
        let line = ">F<tspan dy=\"1.6\" font-size=\"7.2\">crit</tspan><tspan dy=\"-1.6\">/a² &lt; 1 &amp; &lt;b&gt;</tspan></text>";
        assert!(
            whole.contains(line) && whole.contains("<title>&lt;t&gt;"),
            "{whole}"
        );
    }
}
