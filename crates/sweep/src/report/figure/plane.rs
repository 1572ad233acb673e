//! A square of the plane of flow and gradient, with a key to its colours beside it and a caption
//! below.

use super::font;
use super::layout::{AXIS, Layout, PanelView, TICK};
use super::origin::Origin;
use super::outline::{Outline, Panel};
use super::palette::Colour;
use super::scale::{Scale, extent};
use super::svg::{Anchor, Position, Stroke, SvgWriter, corners};

/// Width of the colours of a key over its font size.
const BAR: f64 = 1.2;
/// Height of a class of a key, and of a line of the caption.
const ROW: f64 = 1.35;
/// Length of a sample of a line.
const SAMPLE: f64 = 2.6;
/// Stripes of a scale.
const STRIPES: usize = 96;
/// Number of discs that compose a shaded sphere.
const SHADES: usize = 16;
/// Width of the rims of spheres.
const RIM: f64 = 0.3;
/// Minimum width of lines.
const MIN_LINE_WIDTH: f64 = 0.2;

/// An object in the plane: flow to the right, gradient upwards, lengths in a.
#[derive(Debug, Clone)]
pub(in crate::report) enum Mark {
    /// A sphere, as a disc or shaded.
    Sphere {
        centre: [f64; 2],
        radius: f64,
        colour: Colour,
        is_shaded: bool,
    },
    /// A line, with round ends or straight ones.
    Line {
        ends: [[f64; 2]; 2],
        width: f64,
        colour: Colour,
        is_round: bool,
    },
    /// A polygon.
    Area {
        corners: Vec<[f64; 2]>,
        colour: Colour,
    },
}

/// The key of the colours.
#[derive(Debug)]
pub(in crate::report) enum Key {
    /// Numbers between two ends in the colours of [`Colour::heat`]; numbers beyond an open end have
    /// its colour.
    Numbers {
        label: String,
        ends: [f64; 2],
        is_open: [bool; 2],
    },
    /// Classes, the first on top.
    Kinds {
        label: String,
        kinds: Vec<(Colour, String)>,
    },
}

/// A square of the plane.
#[derive(Debug)]
pub(in crate::report) struct PlanePicture {
    /// Ends of both axes, in a.
    pub(in crate::report) ends: [f64; 2],
    /// Objects from back to front.
    pub(in crate::report) marks: Vec<Mark>,
    pub(in crate::report) key: Key,
    /// Samples of lines: colours and widths in a, drawn over each other, and their description.
    pub(in crate::report) lines: Vec<(Vec<(Colour, f64)>, String)>,
    /// The caption, in pieces that are not broken.
    pub(in crate::report) caption: Vec<String>,
}

/// A picture as a file.
pub(in crate::report) fn draw_plane(picture: &PlanePicture, origin: &Origin) -> String {
    let [low, high] = picture.ends;
    let axis = |label: &str| Scale::linear(label.to_owned(), low, high);
    let outline = Outline::of_panels(vec![Panel {
        x: axis("x / a"),
        y: axis("y / a"),
        ..Panel::default()
    }]);
    let (label, size) = (outline.label_size, outline.tick_size);
    let layout = Layout::of(&outline, outline.width - picture.key.width(size));
    let [[left, top], [right, _]] = layout.corners(0);
    let square = [[left, top], [right, top + right - left]];
    let view = PanelView {
        outline: &outline,
        panel: &outline.panels[0],
        corners: square,
    };
    let per_a = (right - left) / (high - low);
    let mut svg = SvgWriter::default();
    svg.clipped(square, |svg| {
        for mark in &picture.marks {
            view.mark(svg, mark, per_a);
        }
    });
    view.axes(&mut svg);
    view.write(&mut svg, true, true);
    picture.key.draw(&mut svg, square, size);
    let mut y = square[1][1] + 1.4 * size + 1.35 * label + 0.4 * size;
    let (start, end) = (0.5 * size, outline.width - 0.5 * size);
    let mut x = start;
    for (strokes, text) in &picture.lines {
        let length = (SAMPLE + 0.5) * size + font::width(text, size);
        if x > start && x + length > end {
            (x, y) = (start, y + ROW * size);
        }
        let middle = y + 0.5 * ROW * size;
        // The widest sample has the standard length, its round ends included.
        let widths = strokes.iter().map(|(_, width)| 0.5 * width * per_a);
        let widest = widths.fold(0.0, f64::max);
        let ends = [[x + widest, middle], [x + SAMPLE * size - widest, middle]];
        for (colour, width) in strokes {
            let stroke = Stroke {
                is_round: true,
                ..Stroke::solid(*colour, width * per_a)
            };
            svg.line(ends, stroke);
        }
        let at = [x + (SAMPLE + 0.5) * size, middle + 0.36 * size];
        svg.text(at, text, size, Anchor::Start, false);
        x += length + 1.2 * size;
    }
    if !picture.lines.is_empty() {
        y += (ROW + 0.3) * size;
    }
    for line in wrapped(&picture.caption, end - start, size) {
        y += ROW * size;
        svg.text([start, y - 0.3 * size], &line, size, Anchor::Start, false);
    }
    svg.file([outline.width, y + 0.5 * size], origin)
}

/// Pieces as lines of at most that width, as far as they fit.
fn wrapped(pieces: &[String], width: f64, size: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for (place, piece) in pieces.iter().enumerate() {
        let comma = if place + 1 < pieces.len() { "," } else { "" };
        let piece = format!("{piece}{comma}");
        match lines.last_mut() {
            Some(last) if font::width(&format!("{last} {piece}"), size) <= width => {
                last.push(' ');
                last.push_str(&piece);
            }
            _ => lines.push(piece),
        }
    }
    lines
}

impl PanelView<'_> {
    /// Draws an object on the page, with a of this length.
    fn mark(&self, svg: &mut SvgWriter, mark: &Mark, per_a: f64) {
        let at = |&[x, y]: &[f64; 2]| [self.x(x), self.y(y)];
        match mark {
            Mark::Line {
                ends,
                width,
                colour,
                is_round,
            } => {
                let stroke = Stroke {
                    is_round: *is_round,
                    ..Stroke::solid(*colour, (width * per_a).max(MIN_LINE_WIDTH))
                };
                svg.line(ends.each_ref().map(at), stroke);
            }
            Mark::Area { corners, colour } => {
                // Overlapping edges, so that neighbours meet without a seam.
                let stroke = Stroke::solid(*colour, 0.2);
                svg.edged(corners.iter().map(at), Some(*colour), stroke);
            }
            Mark::Sphere {
                centre,
                radius,
                colour,
                is_shaded,
            } => {
                let ([x, y], radius) = (at(centre), radius * per_a);
                let rim = Some(Stroke::solid(Colour::INK, RIM));
                if !is_shaded {
                    return svg.disc([x, y], radius, *colour, rim);
                }
                for number in 0..SHADES {
                    let part = number as f64 / (SHADES - 1) as f64;
                    let (other, most) = match part {
                        ..0.5 => (Colour::INK, 0.4),
                        _ => (Colour::WHITE, 0.45),
                    };
                    let colour = colour.mixed(other, most * (2.0 * part - 1.0).abs());
                    let (shift, radius) = (0.42 * part * radius, (1.0 - 0.88 * part) * radius);
                    let rim = rim.filter(|_| number == 0);
                    svg.disc([x - shift, y - shift], radius, colour, rim);
                }
            }
        }
    }
}

/// The scale of numbers between these ends.
fn scale([low, high]: [f64; 2]) -> Scale {
    Scale::linear(String::new(), low, high)
}

impl Key {
    /// The width of its labels.
    fn widest(&self, size: f64) -> f64 {
        let width = |words: &String| font::width(words, size);
        let [_, widest] = match self {
            Self::Numbers { ends, .. } => {
                extent(scale(*ends).ticks.iter().map(|(_, words)| width(words)))
            }
            Self::Kinds { kinds, .. } => extent(kinds.iter().map(|(_, words)| width(words))),
        };
        widest.max(0.0)
    }

    /// Its width beside the axes.
    fn width(&self, size: f64) -> f64 {
        (BAR + 2.4) * size + self.widest(size)
    }

    /// Draws it beside the axes, at a font size.
    fn draw(&self, svg: &mut SvgWriter, [[_, top], [right, bottom]]: [Position; 2], size: f64) {
        let from = right + size;
        let to = from + BAR * size;
        let ink = Stroke::solid(Colour::INK, AXIS);
        let write = |svg: &mut SvgWriter, text: &str, y: f64| {
            let at = [to + 0.5 * size, y + 0.36 * size];
            svg.text(at, text, size, Anchor::Start, false);
        };
        let label = match self {
            Self::Numbers {
                label,
                ends,
                is_open,
            } => {
                let scale = scale(*ends);
                let at = |part: f64| bottom + part * (top - bottom);
                // Each stripe overlaps the one before, so that no gap shows between them.
                for stripe in 0..STRIPES {
                    let part = |shift: f64| (stripe as f64 + shift) / STRIPES as f64;
                    let ends = [[from, top], [to, at(part(0.0))]];
                    svg.area(corners(ends), Colour::heat(part(0.5)), 1.0);
                }
                // An open end is drawn as an arrow.
                for (is_open, part, y, tip) in [
                    (is_open[0], 0.0, bottom, bottom + 0.6 * size),
                    (is_open[1], 1.0, top, top - 0.6 * size),
                ] {
                    if is_open {
                        let corners = [[from, y], [0.5 * (from + to), tip], [to, y]];
                        svg.edged(corners, Some(Colour::heat(part)), ink);
                    }
                }
                svg.edged(corners([[from, top], [to, bottom]]), None, ink);
                for (number, text) in &scale.ticks {
                    let y = at(scale.part(*number));
                    svg.line([[to - TICK, y], [to, y]], ink);
                    write(svg, text, y);
                }
                label
            }
            Self::Kinds { label, kinds } => {
                for (number, (colour, text)) in kinds.iter().enumerate() {
                    let y = top + ROW * size * number as f64;
                    svg.edged(corners([[from, y], [to, y + size]]), Some(*colour), ink);
                    write(svg, text, y + 0.5 * size);
                }
                label
            }
        };
        let room = bottom - top;
        let fitting = size * (room / font::width(label, size)).min(1.0);
        let at = [to + self.widest(size) + 1.9 * size, 0.5 * (top + bottom)];
        svg.text(at, label, fitting, Anchor::Middle, true);
    }
}
