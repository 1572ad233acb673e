//! An outline as SVG: positions of the panels, their axes and curves, and the legend below them.

use super::font;
use super::origin::Origin;
use super::outline::{Curve, Outline, Panel};
use super::palette::{Colour, Marker};
use super::scale::count;
use super::svg::{Anchor, Position, Stroke, SvgWriter, corners};

/// Length of a tick.
pub(super) const TICK: f64 = 3.0;
/// Width of axes.
pub(super) const AXIS: f64 = 0.6;
/// Half the length of the cap of a bar.
const CAP: f64 = 1.8;
/// Dashed lines that are closer than this merge into a band.
const MERGING: f64 = 4.0;
/// Dashed lines within this distance are drawn as one.
const ALIKE: f64 = 1.0;
/// Opacity of a band.
const BAND: f64 = 0.22;
/// Length of the line in an entry of the legend, over the font size.
const SAMPLE: f64 = 2.2;
/// Height of an entry of the legend, over the font size.
const ROW: f64 = 1.35;

/// A figure as a file.
pub(super) fn draw(outline: &Outline, origin: &Origin) -> String {
    let layout = Layout::of(outline, outline.width);
    let mut svg = SvgWriter::default();
    for (number, panel) in outline.panels.iter().enumerate() {
        let view = PanelView {
            outline,
            panel,
            corners: layout.corners(number),
        };
        view.draw(&mut svg);
        let is_left = number.is_multiple_of(layout.columns);
        let is_lowest = number + layout.columns >= outline.panels.len();
        view.write(&mut svg, is_left, is_lowest);
    }
    let mut height = layout.height;
    let entries = outline.entries();
    if !entries.is_empty() {
        let gap = 0.6 * outline.label_size;
        let left = layout.first_left;
        let at = [left, height + 0.5 * gap];
        let width = outline.width - left - 2.0;
        height += gap + legend(&mut svg, &entries, outline.tick_size, at, width);
    }
    if let Some(note) = &outline.note {
        let size = outline.tick_size;
        height += ROW * size;
        let at = [layout.first_left, height - 0.3 * size];
        svg.text(at, note, size, Anchor::Start, false);
    }
    svg.file([outline.width, height], origin)
}

/// Draws the legend below and to the right of a point, in columns that fill a width; returns its
/// height.
fn legend(
    svg: &mut SvgWriter,
    entries: &[&Curve],
    size: f64,
    [left, top]: Position,
    width: f64,
) -> f64 {
    let widths = entries.iter().map(|curve| font::width(&curve.label, size));
    let widest = widths.fold(0.0, f64::max) + (SAMPLE + 1.4) * size;
    let columns = count((width / widest).floor()).clamp(1, entries.len().max(1));
    let rows = entries.len().div_ceil(columns);
    // Entries too long for the page are set smaller.
    let small = size * (width / widest).min(1.0);
    for (number, curve) in entries.iter().enumerate() {
        let x = left + widest.min(width) * (number / rows) as f64;
        let y = top + ROW * size * ((number % rows) as f64 + 0.5);
        let end = x + SAMPLE * small;
        if !curve.pieces.is_empty() || curve.marker.is_none() {
            let part = if curve.marker.is_none() { 1.8 } else { 1.0 };
            let stroke = Stroke {
                dashes: curve.dashes,
                ..Stroke::solid(curve.colour, part * curve.width)
            };
            svg.line([[x, y], [end, y]], stroke);
        }
        if let Some(kind) = curve.marker {
            let middle = [0.5 * (x + end), y];
            svg.marker(kind, middle, curve.marker_size, curve.colour, curve.width);
        }
        let at = [end + 0.5 * small, y + 0.36 * small];
        svg.text(at, &curve.label, small, Anchor::Start, false);
    }
    ROW * size * rows as f64
}

/// Positions of the panels.
pub(super) struct Layout {
    columns: usize,
    /// Left edge of the axes in the first column.
    first_left: f64,
    /// Space between the axes of neighbours.
    between: f64,
    /// Space above axes.
    top: f64,
    /// Size of the axes.
    size: [f64; 2],
    /// Space below the axes of all rows but the last.
    below: f64,
    height: f64,
}

impl Layout {
    /// The panels of an outline within a width.
    pub(super) fn of(outline: &Outline, width: f64) -> Self {
        let columns = outline.columns;
        let (label, tick) = (outline.label_size, outline.tick_size);
        let ticks = outline.panels.iter().flat_map(|panel| &panel.y.ticks);
        let widest = ticks
            .map(|(_, text)| font::width(text, tick))
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
            between: left + right,
            top,
            size: [each.max(30.0), axes],
            below,
            height: rows as f64 * (top + axes + below) + lowest - below,
        }
    }

    /// The corners of the axes of a panel, the upper left one first.
    pub(super) fn corners(&self, panel: usize) -> [Position; 2] {
        let (row, column) = (panel / self.columns, panel % self.columns);
        let [width, height] = self.size;
        let x = self.first_left + column as f64 * (width + self.between);
        let y = self.top + row as f64 * (self.top + height + self.below);
        [[x, y], [x + width, y + height]]
    }
}

/// One panel on the page.
pub(super) struct PanelView<'o> {
    pub(super) outline: &'o Outline,
    pub(super) panel: &'o Panel,
    /// Upper left and lower right corner of the axes.
    pub(super) corners: [Position; 2],
}

impl PanelView<'_> {
    pub(super) fn x(&self, number: f64) -> f64 {
        let [[left, _], [right, _]] = self.corners;
        left + self.panel.x.part(number) * (right - left)
    }

    pub(super) fn y(&self, number: f64) -> f64 {
        let [[_, top], [_, bottom]] = self.corners;
        bottom + self.panel.y.part(number) * (top - bottom)
    }

    /// Draws the content of the axes, and the axes.
    fn draw(&self, svg: &mut SvgWriter) {
        let [[left, top], [right, bottom]] = self.corners;
        let curves = &self.panel.curves;
        svg.clipped(self.corners, |svg| {
            if let Some(strain) = self.panel.shaded {
                let end = self.x(strain).clamp(left, right);
                svg.area(corners([[left, top], [end, bottom]]), Colour::SHADE, 1.0);
            }
            self.dashed(svg);
            for at in &self.panel.x.breaks {
                let x = self.x(*at);
                let stroke = Stroke::solid(Colour::PALE, 0.6).dashed(1.0, 2.0);
                svg.line([[x, top], [x, bottom]], stroke);
            }
            for draw in [Self::bands, Self::lines, Self::bars] {
                for curve in curves {
                    draw(self, svg, curve);
                }
            }
        });
        self.axes(svg);
        for curve in curves {
            self.markers(svg, curve);
        }
        self.marks(svg);
    }

    /// Dashed lines; those that would merge become the edges of a shaded band.
    fn dashed(&self, svg: &mut SvgWriter) {
        let [[left, _], [right, _]] = self.corners;
        let mut heights: Vec<f64> = self.panel.dashed.iter().map(|h| self.y(*h)).collect();
        heights.sort_by(f64::total_cmp);
        for group in heights.chunk_by(|a, b| b - a < MERGING) {
            let (from, to) = (group[0], group[group.len() - 1]);
            let mut line = |y: f64, width: f64| {
                let stroke = Stroke::solid(Colour::GREY, width).dashed(4.5, 3.0);
                svg.line([[left, y], [right, y]], stroke);
            };
            if to - from < ALIKE {
                line(0.5 * (from + to), 0.7);
                continue;
            }
            line(from, 0.4);
            line(to, 0.4);
            svg.area(corners([[left, from], [right, to]]), Colour::GREY, BAND);
        }
    }

    fn lines(&self, svg: &mut SvgWriter, curve: &Curve) {
        let stroke = Stroke {
            dashes: curve.dashes,
            ..Stroke::solid(curve.colour, curve.width)
        };
        for &(first, last) in &curve.pieces {
            let points = curve.points[first..=last].iter();
            svg.line(points.map(|p| [self.x(p.0), self.y(p.1)]), stroke);
        }
    }

    fn bands(&self, svg: &mut SvgWriter, curve: &Curve) {
        if !curve.has_band {
            return;
        }
        let edge = |point: &(f64, f64, f64, f64), sign: f64| {
            let reach = if sign > 0.0 { point.3 } else { point.2 };
            [self.x(point.0), self.y(point.1 + sign * reach)]
        };
        for &(first, last) in &curve.pieces {
            let points = &curve.points[first..=last];
            let upper = points.iter().map(|point| edge(point, 1.0));
            let lower = points.iter().rev().map(|point| edge(point, -1.0));
            svg.area(upper.chain(lower), curve.colour, BAND);
        }
    }

    fn bars(&self, svg: &mut SvgWriter, curve: &Curve) {
        let stroke = Stroke::solid(curve.colour, 0.8 * curve.width);
        if curve.has_intervals && !curve.has_band {
            for point in curve.points.iter().filter(|p| p.2 > 0.0 || p.3 > 0.0) {
                let x = self.x(point.0);
                let [up, down] = [self.y(point.1 + point.3), self.y(point.1 - point.2)];
                svg.line([[x, up], [x, down]], stroke);
                for y in [up, down] {
                    svg.line([[x - CAP, y], [x + CAP, y]], stroke);
                }
            }
        }
        for &[from, to, y] in &curve.across {
            let (from, to, y) = (self.x(from), self.x(to), self.y(y));
            svg.line([[from, y], [to, y]], stroke);
            for x in [from, to] {
                svg.line([[x, y - CAP], [x, y + CAP]], stroke);
            }
        }
    }

    /// Markers, not clipped at the axes.
    fn markers(&self, svg: &mut SvgWriter, curve: &Curve) {
        let Some(kind) = curve.marker else { return };
        let [[left, top], [right, bottom]] = self.corners;
        for point in &curve.points {
            let (x, y) = (self.x(point.0), self.y(point.1));
            if (left - 0.1..=right + 0.1).contains(&x) && (top - 0.1..=bottom + 0.1).contains(&y) {
                svg.marker(
                    kind,
                    [x, y],
                    curve.marker_size,
                    curve.colour,
                    0.8 * curve.width,
                );
            }
        }
    }

    /// The box of the axes with its ticks and breaks.
    pub(super) fn axes(&self, svg: &mut SvgWriter) {
        let ink = Stroke::solid(Colour::INK, AXIS);
        let [[left, top], [_, bottom]] = self.corners;
        svg.edged(corners(self.corners), None, ink);
        let (x, y) = (&self.panel.x, &self.panel.y);
        let all = |ticks: &[(f64, String)], minor: &[f64]| -> Vec<(f64, f64)> {
            let long = ticks.iter().map(|tick| (tick.0, TICK));
            long.chain(minor.iter().map(|at| (*at, 0.55 * TICK)))
                .collect()
        };
        for (at, length) in all(&x.ticks, &x.minor) {
            let at = self.x(at);
            svg.line([[at, bottom], [at, bottom - length]], ink);
        }
        for (at, length) in all(&y.ticks, &y.minor) {
            let at = self.y(at);
            svg.line([[left, at], [left + length, at]], ink);
        }
        for at in &x.breaks {
            let at = self.x(*at);
            for edge in [top, bottom] {
                let [low, high] = [edge + 2.2, edge - 2.2];
                let slash = |at: f64| [[at - 0.9, low], [at + 0.9, high]];
                let [[a, b], [c, d]] = [at - 1.0, at + 1.0].map(slash);
                svg.area([a, b, d, c], Colour::WHITE, 1.0);
                svg.line([a, b], ink);
                svg.line([c, d], ink);
            }
        }
    }

    /// Marks for points without a result and for strains discarded, on the lower axis, and for
    /// jammed runs.
    fn marks(&self, svg: &mut SvgWriter) {
        let [[left, top], [right, bottom]] = self.corners;
        let is_inside = |x: &f64| (left..=right).contains(x);
        let mut crosses: Vec<[f64; 2]> = Vec::new();
        for curve in &self.panel.curves {
            let size = 0.8 * curve.marker_size;
            let missing = curve.missing.iter().map(|at| self.x(*at));
            for x in missing.filter(is_inside) {
                svg.marker(
                    Marker::Cross,
                    [x, bottom - 2.0 * size],
                    size,
                    curve.colour,
                    0.8,
                );
            }
            for [at, height] in &curve.jammed {
                let (x, size) = (self.x(*at), 1.2 * size);
                let y = if height.is_finite() {
                    self.y(*height)
                } else {
                    top + 2.0 * size
                };
                // Crosses of several curves at one place stand side by side, below each other at
                // the edge.
                let is_there = |other: &&[f64; 2]| (other[0] - x).hypot(other[1] - y) < 0.1;
                let others = crosses.iter().filter(is_there).count();
                crosses.push([x, y]);
                let moved = 2.4 * size * others as f64;
                let place = if height.is_finite() {
                    [x + moved, y]
                } else {
                    [x, y + moved]
                };
                if is_inside(&x) {
                    svg.marker(Marker::Cross, place, size, curve.colour, 0.8);
                }
            }
            if let Some(x) = curve.discard.map(|strain| self.x(strain)).filter(is_inside) {
                let at = [x, bottom - 1.5 * TICK];
                svg.marker(Marker::Bar, at, 0.75 * TICK, curve.colour, 1.2);
            }
        }
    }

    /// Writes the numbers, labels and texts within the axes.
    pub(super) fn write(&self, svg: &mut SvgWriter, is_left: bool, is_lowest: bool) {
        let [[left, top], [right, bottom]] = self.corners;
        let (label, size) = (self.outline.label_size, self.outline.tick_size);
        for (at, text) in self.labelled_ticks(size) {
            svg.text([at, bottom + 1.3 * size], text, size, Anchor::Middle, false);
        }
        for (at, text) in &self.panel.y.ticks {
            let at = [left - 0.5 * size, self.y(*at) + 0.36 * size];
            svg.text(at, text, size, Anchor::End, false);
        }
        // A label longer than its axis is set smaller.
        let fitting = |text: &str, room: f64| label * (room / font::width(text, label)).min(1.0);
        let (middle, centre) = (0.5 * (left + right), 0.5 * (top + bottom));
        if is_lowest {
            let text = &self.panel.x.label;
            let size_of_label = fitting(text, right - left + 2.0 * label);
            let at = [middle, bottom + 1.4 * size + 1.35 * label];
            svg.text(at, text, size_of_label, Anchor::Middle, false);
        }
        if is_left {
            let text = &self.panel.y.label;
            let size = fitting(text, bottom - top + label);
            svg.text([1.1 * label, centre], text, size, Anchor::Middle, true);
        }
        if !self.panel.title.is_empty() {
            let at = [middle, top - 0.5 * label];
            svg.text(at, &self.panel.title, label, Anchor::Middle, false);
        }
        if let Some(strain) = self.panel.shaded {
            let end = self.x(strain).clamp(left, right);
            let (text, middle) = ("discarded", 0.5 * (left + end));
            if end - left > font::width(text, size) + size {
                svg.text(
                    [middle, top + 1.4 * size],
                    text,
                    size,
                    Anchor::Middle,
                    false,
                );
            } else {
                let is_wide = end - left > 1.4 * size;
                let x = if is_wide {
                    middle + 0.36 * size
                } else {
                    end + 1.2 * size
                };
                svg.text([x, top + 0.6 * size], text, size, Anchor::End, true);
            }
        }
    }

    /// Labelled ticks of the lower axis: all, or every nth where labels would overlap. Plateaus
    /// beyond breaks are always labelled.
    fn labelled_ticks(&self, size: f64) -> Vec<(f64, &str)> {
        let scale = &self.panel.x;
        let last = scale.ticks.len().saturating_sub(1);
        let is_beyond = |index: usize| {
            let other = if index == 0 { 1 } else { index - 1 };
            let ticks = (scale.ticks.get(other), scale.ticks.get(index));
            (index == 0 || index == last)
                && matches!(ticks, (Some(a), Some(b)) if scale.breaks_between(a.0, b.0))
        };
        let kept = |step: usize| -> Vec<(f64, &str)> {
            let all = scale.ticks.iter().enumerate();
            all.filter(|(index, _)| index % step == 0 || is_beyond(*index))
                .map(|(_, (at, text))| (self.x(*at), text.as_str()))
                .collect()
        };
        let is_clear = |ticks: &[(f64, &str)]| {
            ticks.windows(2).all(|pair| {
                let halves = pair.iter().map(|tick| 0.5 * font::width(tick.1, size));
                pair[1].0 - pair[0].0 > halves.sum::<f64>() + 0.35 * size
            })
        };
        let mut steps = 1..=last.max(1);
        let found = steps.find_map(|step| Some(kept(step)).filter(|ticks| is_clear(ticks)));
        found.unwrap_or_else(|| kept(last + 1))
    }
}
