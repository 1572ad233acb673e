//! An outline as shapes on a page.

mod picture;
mod words;

pub(super) use picture::page as picture;
pub(in crate::report) use picture::{Key, Mark, Picture};

use super::font;
use super::legend::Legend;
use super::look::LegendPlace;
use super::outline::{Curve, Outline, Panel};
use super::palette::{Colour, Marker};
use super::scene::{Page, Place, Shape, Stroke, corners, marker};

/// Length of a tick.
const TICK: f64 = 3.0;
/// Width of axes.
const AXIS: f64 = 0.6;
/// Half the length of the cap of a bar.
const CAP: f64 = 1.8;
/// Dashed lines that are closer than this merge.
const MERGING: f64 = 4.0;
/// Dashed lines within this distance are drawn as one.
const ALIKE: f64 = 1.0;
/// Opacity of a band.
const BAND: f32 = 0.22;

/// The page of a figure.
pub(super) fn page(outline: &Outline) -> Page {
    let legend = Legend::of(outline);
    let place = if legend.is_empty() {
        LegendPlace::None
    } else {
        outline.legend
    };
    let gap = 0.6 * outline.label_size;
    let right = match place {
        LegendPlace::Right => legend.width_beside(outline),
        _ => 0.0,
    };
    let grid = Grid::of(outline, outline.width - right);
    let mut page = Page {
        width: outline.width,
        height: grid.height,
        shapes: Vec::new(),
    };
    for (number, panel) in outline.panels.iter().enumerate() {
        let frame = Frame {
            outline,
            panel,
            corners: grid.corners(number),
        };
        page.shapes.extend(frame.draw());
        let is_left = number.is_multiple_of(grid.columns);
        let is_lowest = number + grid.columns >= outline.panels.len();
        page.shapes.extend(frame.words(is_left, is_lowest));
        if number == 0 && place == LegendPlace::Inside {
            let [from, to] = legend.corner(frame.corners, &frame.obstacles());
            page.shapes
                .extend(Shape::filled(corners([from, to]), Colour::WHITE, 0.8));
            page.shapes.extend(legend.draw(from, legend.width()));
        }
    }
    match place {
        LegendPlace::Below => {
            let left = grid.first_left;
            let width = page.width - left - 2.0;
            page.shapes
                .extend(legend.draw([left, page.height + 0.5 * gap], width));
            page.height += legend.height(width) + gap;
        }
        LegendPlace::Right => {
            let [from, _] = grid.corners(0);
            let at = [outline.width - legend.width(), from[1]];
            page.shapes.extend(legend.draw(at, legend.width()));
            page.height = page
                .height
                .max(from[1] + legend.height(legend.width()) + gap);
        }
        LegendPlace::Inside | LegendPlace::None => {}
    }
    page
}

/// Positions of the panels.
struct Grid {
    columns: usize,
    /// Left edge of the axes in the first column.
    first_left: f64,
    /// Space for the numbers before the axes of other columns.
    left: f64,
    /// Space above axes.
    top: f64,
    /// Size of the axes.
    size: [f64; 2],
    /// Space below the axes of all rows but the last.
    below: f64,
    height: f64,
}

impl Grid {
    fn of(outline: &Outline, width: f64) -> Self {
        let columns = outline.columns;
        let (label, tick) = (outline.label_size, outline.tick_size);
        let ticks = outline.panels.iter().flat_map(|panel| &panel.y.ticks);
        let widest = ticks
            .map(|(_, words)| font::width(words, tick))
            .fold(0.0, f64::max);
        let left = widest + 0.9 * tick;
        let first_left = left + 1.5 * label;
        let has_titles = outline.panels.iter().any(|panel| !panel.title.is_empty());
        let top = if has_titles { 1.7 * label } else { 0.8 * tick };
        let right = 1.3 * tick;
        let each = (width - first_left - (columns - 1) as f64 * left) / columns as f64 - right;
        let below = 1.7 * tick;
        let lowest = below + 1.6 * label;
        let rows = outline.panels.len().div_ceil(columns);
        let axes = (outline.panel_height - top - lowest).max(30.0);
        Self {
            columns,
            first_left,
            left: left + right,
            top,
            size: [each.max(30.0), axes],
            below,
            height: rows as f64 * (top + axes + below) + lowest - below,
        }
    }

    /// The corners of the axes of a panel, the upper left one first.
    fn corners(&self, panel: usize) -> [Place; 2] {
        let (row, column) = (panel / self.columns, panel % self.columns);
        let [width, height] = self.size;
        let x = self.first_left + column as f64 * (width + self.left);
        let y = self.top + row as f64 * (self.top + height + self.below);
        [[x, y], [x + width, y + height]]
    }
}

/// One panel on the page.
struct Frame<'o> {
    outline: &'o Outline,
    panel: &'o Panel,
    /// Upper left and lower right corner of the axes.
    corners: [Place; 2],
}

impl Frame<'_> {
    fn x(&self, number: f64) -> f64 {
        let [[left, _], [right, _]] = self.corners;
        left + self.panel.x.part(number) * (right - left)
    }

    fn y(&self, number: f64) -> f64 {
        let [[_, top], [_, bottom]] = self.corners;
        bottom + self.panel.y.part(number) * (top - bottom)
    }

    /// Content of the axes, and the axes.
    fn draw(&self) -> Vec<Shape> {
        let [[left, top], [right, bottom]] = self.corners;
        let mut inside = Vec::new();
        if let Some(strain) = self.panel.shaded {
            let end = self.x(strain).clamp(left, right);
            let shade = corners([[left, top], [end, bottom]]);
            inside.extend(Shape::filled(shade, Colour::SHADE, 1.0));
        }
        inside.extend(self.dashed());
        for place in &self.panel.x.breaks {
            let x = self.x(*place);
            let stroke = Stroke::solid(Colour::PALE, 0.6).dashed(1.0, 2.0);
            inside.extend(Shape::line([[x, top], [x, bottom]], stroke));
        }
        let curves = || self.panel.curves.iter();
        inside.extend(curves().flat_map(|curve| self.bands(curve)));
        inside.extend(curves().flat_map(|curve| self.lines(curve)));
        inside.extend(curves().flat_map(|curve| self.bars(curve)));
        let mut shapes = vec![Shape::Within(self.corners, inside)];
        shapes.extend(self.axes());
        shapes.extend(curves().flat_map(|curve| self.markers(curve)));
        shapes.extend(self.marks());
        shapes
    }

    /// Dashed lines; those that would merge become the edges of a shaded band.
    fn dashed(&self) -> Vec<Shape> {
        let [[left, _], [right, _]] = self.corners;
        let mut heights: Vec<f64> = self.panel.dashed.iter().map(|h| self.y(*h)).collect();
        heights.sort_by(f64::total_cmp);
        let mut shapes = Vec::new();
        for group in heights.chunk_by(|a, b| b - a < MERGING) {
            let (Some(from), Some(to)) = (group.first(), group.last()) else {
                continue;
            };
            let line = |y: f64, width: f64| {
                let stroke = Stroke::solid(Colour::GREY, width).dashed(4.5, 3.0);
                Shape::line([[left, y], [right, y]], stroke)
            };
            if to - from < ALIKE {
                shapes.extend(line(0.5 * (from + to), 0.7));
                continue;
            }
            let band = corners([[left, *from], [right, *to]]);
            shapes.extend(Shape::filled(band, Colour::GREY, BAND));
            shapes.extend([*from, *to].into_iter().filter_map(|y| line(y, 0.4)));
        }
        shapes
    }

    fn lines(&self, curve: &Curve) -> Vec<Shape> {
        let stroke = Stroke {
            dashes: curve.dashes,
            ..Stroke::solid(curve.colour, curve.width)
        };
        let piece = |&(first, last): &(usize, usize)| {
            let points = curve.points[first..=last].iter();
            Shape::line(points.map(|p| [self.x(p.0), self.y(p.1)]), stroke)
        };
        curve.pieces.iter().filter_map(piece).collect()
    }

    fn bands(&self, curve: &Curve) -> Vec<Shape> {
        if !curve.has_band {
            return Vec::new();
        }
        let alone = |place: usize| {
            let within = |&(first, last): &(usize, usize)| (first..=last).contains(&place);
            !curve.pieces.iter().any(within)
        };
        let half = 1.2 * curve.marker_size;
        let edge = |point: &(f64, f64, f64, f64), sign: f64| {
            let reach = if sign > 0.0 { point.3 } else { point.2 };
            [self.x(point.0), self.y(point.1 + sign * reach)]
        };
        let pieces = curve.pieces.iter().map(|&(first, last)| {
            let points = &curve.points[first..=last];
            let upper = points.iter().map(|point| edge(point, 1.0));
            let lower = points.iter().rev().map(|point| edge(point, -1.0));
            Shape::filled(upper.chain(lower), curve.colour, BAND)
        });
        // An isolated point, such as one of a plateau, has a box.
        let single = (0..curve.points.len())
            .filter(|place| alone(*place))
            .map(|place| {
                let point = &curve.points[place];
                let [[x, up], [_, down]] = [edge(point, 1.0), edge(point, -1.0)];
                let ends = [[x - half, up], [x + half, down]];
                Shape::filled(corners(ends), curve.colour, BAND)
            });
        pieces.chain(single).flatten().collect()
    }

    fn bars(&self, curve: &Curve) -> Vec<Shape> {
        let stroke = Stroke::solid(curve.colour, 0.8 * curve.width);
        let across = curve.across.iter().map(|&[from, to, y]| {
            let (from, to, y) = (self.x(from), self.x(to), self.y(y));
            let cap = |x: f64| [[x, y - CAP], [x, y + CAP]];
            [[[from, y], [to, y]], cap(from), cap(to)]
        });
        let reaching = curve.points.iter().filter(|p| p.2 > 0.0 || p.3 > 0.0);
        reaching
            .filter(|_| curve.has_intervals && !curve.has_band)
            .map(|point| {
                let x = self.x(point.0);
                let [up, down] = [self.y(point.1 + point.3), self.y(point.1 - point.2)];
                let cap = |y: f64| [[x - CAP, y], [x + CAP, y]];
                [[[x, up], [x, down]], cap(up), cap(down)]
            })
            .chain(across)
            .flatten()
            .filter_map(|ends| Shape::line(ends, stroke))
            .collect()
    }

    /// Markers, not clipped at the axes.
    fn markers(&self, curve: &Curve) -> Vec<Shape> {
        let Some(kind) = curve.marker else {
            return Vec::new();
        };
        let [[left, top], [right, bottom]] = self.corners;
        let places = curve
            .points
            .iter()
            .map(|point| [self.x(point.0), self.y(point.1)]);
        places
            .filter(|[x, y]| {
                (left - 0.1..=right + 0.1).contains(x) && (top - 0.1..=bottom + 0.1).contains(y)
            })
            .filter_map(|place| {
                let width = 0.8 * curve.width;
                marker(kind, place, curve.marker_size, curve.colour, width)
            })
            .collect()
    }

    /// The box of the axes with its ticks and breaks.
    fn axes(&self) -> Vec<Shape> {
        let ink = Stroke::solid(Colour::INK, AXIS);
        let [[left, top], [_, bottom]] = self.corners;
        let mut shapes = Vec::from_iter(Shape::edged(corners(self.corners), None, ink));
        let (x, y) = (&self.panel.x, &self.panel.y);
        let all = |ticks: &[(f64, String)], minor: &[f64]| -> Vec<(f64, f64)> {
            let long = ticks.iter().map(|tick| (tick.0, TICK));
            long.chain(minor.iter().map(|place| (*place, 0.55 * TICK)))
                .collect()
        };
        for (place, length) in all(&x.ticks, &x.minor) {
            let at = self.x(place);
            shapes.extend(Shape::line([[at, bottom], [at, bottom - length]], ink));
        }
        for (place, length) in all(&y.ticks, &y.minor) {
            let at = self.y(place);
            shapes.extend(Shape::line([[left, at], [left + length, at]], ink));
        }
        for place in &x.breaks {
            let at = self.x(*place);
            for edge in [top, bottom] {
                let [low, high] = [edge + 2.2, edge - 2.2];
                let slash = |at: f64| [[at - 0.9, low], [at + 0.9, high]];
                let [[a, b], [c, d]] = [at - 1.0, at + 1.0].map(slash);
                shapes.extend(Shape::filled([a, b, d, c], Colour::WHITE, 1.0));
                shapes.extend(
                    [[a, b], [c, d]]
                        .into_iter()
                        .filter_map(|ends| Shape::line(ends, ink)),
                );
            }
        }
        shapes
    }

    /// Marks for points without a result and for strains discarded, on the lower axis.
    fn marks(&self) -> Vec<Shape> {
        let [[left, _], [right, bottom]] = self.corners;
        let mut shapes = Vec::new();
        let is_inside = |x: &f64| (left..=right).contains(x);
        for curve in &self.panel.curves {
            let size = 0.8 * curve.marker_size;
            let places = curve.missing.iter().map(|place| self.x(*place));
            for x in places.filter(is_inside) {
                let place = [x, bottom - 2.0 * size];
                shapes.extend(marker(Marker::Cross, place, size, curve.colour, 0.8));
            }
            if let Some(x) = curve.discard.map(|strain| self.x(strain)).filter(is_inside) {
                let place = [x, bottom - 1.5 * TICK];
                shapes.extend(marker(Marker::Bar, place, 0.75 * TICK, curve.colour, 1.2));
            }
        }
        shapes
    }
}
