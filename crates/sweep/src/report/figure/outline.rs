//! The neutral form of a figure: colours, markers, ends and ticks of its axes.
//!
//! The SVG files of this program and the figures of Python are drawn from it.

use super::palette::{COLOURS, Colour, MARKERS, Marker};
use super::scale::{LogAxis, Scale, extent};
use super::svg::PER_MM;
use crate::measure::{Estimate, Trend};
use crate::report::labels::Label;
use serde::Serialize;

/// Width of a figure of one panel and of several: a column of a journal, and the full page.
const WIDTHS: [f64; 2] = [85.0 * PER_MM, 180.0 * PER_MM];
/// Height of a panel over its width.
const PANEL_ASPECT: f64 = 0.74;
/// Size of the labels of axes; numbers and legend are a tenth smaller.
const LABEL_SIZE: f64 = 8.0;
/// Width of curves, and radius of their markers.
const LINE_WIDTH: f64 = 0.9;
const MARKER_SIZE: f64 = 2.3;
/// Dashes of lines without markers, which distinguish them in grey print.
const DASHES: [Option<[f64; 2]>; 4] = [None, Some([4.0, 1.2]), Some([1.4, 1.0]), Some([8.0, 1.6])];
/// Margin of a logarithmic axis beyond its numbers, over its length.
const MARGIN: f64 = 0.05;

/// A figure. Numbers of points are in the units of their axes; lengths in points, 72 to an inch.
#[derive(Debug, Serialize)]
pub struct Outline {
    /// Total width.
    pub(super) width: f64,
    /// Height of one panel, its labels included, the legend not.
    pub(super) panel_height: f64,
    /// Panels beside each other.
    pub(super) columns: usize,
    /// Size of the labels of the axes.
    pub(super) label_size: f64,
    /// Size of the numbers and of the legend.
    pub(super) tick_size: f64,
    /// Further entries of the legend, as curves without points.
    #[serde(skip)]
    notes: Vec<Curve>,
    /// A line below the legend.
    pub(super) note: Option<String>,
    pub(super) panels: Vec<Panel>,
}

/// One pair of axes.
#[derive(Debug, Default, Serialize)]
pub(super) struct Panel {
    /// Common values of its points; empty if it is the only panel.
    pub(super) title: String,
    pub(super) x: Scale,
    pub(super) y: Scale,
    pub(super) curves: Vec<Curve>,
    /// Heights of dashed lines.
    pub(super) dashed: Vec<f64>,
    /// Label of these, given once in a figure.
    pub(super) dashed_label: Option<&'static str>,
    /// Discarded strain: end of a shaded range that starts at 0.
    pub(super) shaded: Option<f64>,
}

/// Curves and panels before they have their style and axes.
#[derive(Debug, Default)]
pub(super) struct Figure {
    pub(super) curves: Vec<Curve>,
    pub(super) panels: Vec<Panel>,
    /// Number of curves with ordered colours; 0 for unordered colours.
    pub(super) ordered: usize,
    /// Labels of the axes.
    pub(super) x: String,
    pub(super) y: String,
    /// The horizontal axis, if that is logarithmic.
    pub(super) log: Option<LogAxis>,
    /// A line below the legend.
    pub(super) note: Option<String>,
    /// Whether the vertical axis is linear whatever its values.
    pub(super) is_linear: bool,
}

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(in crate::report) enum CurveKind {
    /// Markers joined by a line.
    #[default]
    Markers,
    /// A thin line without markers.
    Line,
    /// A thin line without markers, of a publication.
    Reference,
    /// Unconnected markers.
    Points,
    /// Unconnected crosses.
    Crosses,
    /// Marks around points of other curves that have this trend.
    Trend(Trend),
}

/// One curve.
#[derive(Debug, Default, Serialize)]
pub(in crate::report) struct Curve {
    /// Its entry in the legend; empty for none.
    pub(super) label: String,
    pub(super) colour: Colour,
    /// `None` for a line without markers.
    pub(super) marker: Option<Marker>,
    /// Radius of its markers.
    pub(super) marker_size: f64,
    /// Width of its line.
    pub(super) width: f64,
    /// Lengths of its dashes and of the gaps between them; `None` for a solid line.
    pub(super) dashes: Option<[f64; 2]>,
    /// Position, value, and extent of its interval down and up. In a [`Figure`] points of the
    /// campaign without a result are among them, with NaN as their value.
    pub(super) points: Vec<(f64, f64, f64, f64)>,
    /// First and last point of each connected piece: lines stop at breaks of the axis and at points
    /// without a result.
    pub(super) pieces: Vec<(usize, usize)>,
    /// Intervals along the horizontal axis: their ends, and the value of the point.
    pub(super) across: Vec<[f64; 3]>,
    /// Whether any point has an interval.
    pub(super) has_intervals: bool,
    /// Whether intervals are drawn as a band.
    pub(super) has_band: bool,
    /// Positions of points of the campaign without a result.
    pub(super) missing: Vec<f64>,
    /// Positions and heights of points with runs that jammed; an infinite height is the upper edge.
    pub(super) jammed: Vec<[f64; 2]>,
    /// Strain discarded; in an outline only where curves differ in it.
    pub(super) discard: Option<f64>,
    #[serde(skip)]
    pub(super) kind: CurveKind,
    #[serde(skip)]
    pub(super) panel: usize,
    /// Its index among the curves of the figure, which selects colour and marker.
    #[serde(skip)]
    pub(super) index: usize,
    /// The number that distinguishes it, if it is only one.
    #[serde(skip)]
    pub(super) number: Option<f64>,
    /// Number of runs averaged by a line in time.
    #[serde(skip)]
    pub(super) runs: usize,
    /// Points whose runs are not in steady state: position and value.
    #[serde(skip)]
    pub(super) trends: Vec<(Trend, [f64; 2])>,
}

impl Outline {
    /// Panels in the common style.
    pub(super) fn of_panels(panels: Vec<Panel>) -> Self {
        let number = panels.len();
        let width = WIDTHS[usize::from(number > 1)];
        let columns = match number {
            0..=2 => number.max(1),
            4 => 2,
            _ => 3,
        };
        Self {
            width,
            panel_height: (PANEL_ASPECT * width / columns as f64).clamp(120.0, 300.0),
            columns,
            label_size: LABEL_SIZE,
            tick_size: 0.9 * LABEL_SIZE,
            notes: Vec::new(),
            note: None,
            panels,
        }
    }

    /// Entries of the legend, each once.
    pub(super) fn entries(&self) -> Vec<&Curve> {
        let mut entries: Vec<&Curve> = Vec::new();
        let curves = self.panels.iter().flat_map(|panel| &panel.curves);
        for curve in curves.filter(|curve| !curve.label.is_empty()) {
            match entries.iter_mut().find(|known| known.label == curve.label) {
                // The curve that shows most of its kind of style.
                Some(known) if known.pieces.len() < curve.pieces.len() => *known = curve,
                Some(_) => {}
                None => entries.push(curve),
            }
        }
        entries.extend(&self.notes);
        entries
    }
}

impl Figure {
    /// Its outline.
    pub(super) fn outline(mut self) -> Outline {
        let (x, y) = (self.horizontal(), self.vertical());
        let trends = trends(&self);
        self.curves.extend(trends);
        let mut discards = self.curves.iter().filter_map(|curve| curve.discard);
        let shaded = discards
            .next()
            .filter(|first| discards.all(|d| (d - first).abs() < 1e-9) && *first > 0.0);
        for curve in &mut self.curves {
            curve.finish([&x, &y], self.ordered);
            curve.discard = curve.discard.filter(|d| shaded.is_none() && *d > 0.0);
        }
        let size = Outline::of_panels(Vec::new()).tick_size;
        let is_dashed = |panel: &Panel| !panel.dashed.is_empty();
        let labelled = self.panels.iter().position(is_dashed);
        let formula = labelled.and_then(|place| self.panels[place].dashed_label);
        let has = |is_there: fn(&Curve) -> bool| self.curves.iter().any(is_there);
        let jams = has(|curve| !curve.jammed.is_empty()).then_some("runs jammed");
        let missing = has(|curve| !curve.missing.is_empty()).then_some("no result");
        let ends = has(|curve| curve.discard.is_some()).then_some("end of the strain discarded");
        let notes = [
            (formula, None),
            (jams, Some(Marker::Cross)),
            (missing, Some(Marker::Cross)),
            (ends, Some(Marker::Bar)),
        ];
        let note = |(label, marker): (Option<&str>, Option<Marker>)| {
            Some(Curve {
                label: label?.into(),
                colour: Colour::GREY,
                marker,
                marker_size: 0.25 * size,
                width: if marker.is_some() { 0.8 } else { 0.4 },
                dashes: marker.is_none().then_some([4.5, 3.0]),
                ..Curve::default()
            })
        };
        let notes = notes.into_iter().filter_map(note);
        let notes = self.band_note(size).into_iter().chain(notes).collect();
        for (place, panel) in self.panels.iter_mut().enumerate() {
            panel.dashed_label = panel.dashed_label.filter(|_| labelled == Some(place));
            (panel.x, panel.y, panel.shaded) = (x.clone(), y.clone(), shaded);
        }
        for curve in self.curves {
            self.panels[curve.panel].curves.push(curve);
        }
        Outline {
            notes,
            note: self.note,
            ..Outline::of_panels(self.panels)
        }
    }

    /// Meaning of bands in time, if there are any.
    fn band_note(&self, size: f64) -> Option<Curve> {
        let mut banded = self.curves.iter().filter(|curve| curve.has_band);
        let first = banded.next()?.runs;
        let number = Some(format!("{first} ")).filter(|_| banded.all(|curve| curve.runs == first));
        let number = number.unwrap_or_default();
        Some(Curve {
            label: format!("mean of {number}runs, 95 % interval"),
            colour: Colour::PALE,
            width: 0.35 * size,
            ..Curve::default()
        })
    }

    /// The points with a value.
    fn points(&self) -> impl Iterator<Item = &(f64, f64, f64, f64)> {
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        points.filter(|point| !point.1.is_nan())
    }

    /// The vertical axis of all panels.
    fn vertical(&self) -> Scale {
        let label = self.y.clone();
        let limits = || self.panels.iter().flat_map(|panel| panel.dashed.clone());
        let jammed = || {
            let all = self.curves.iter().flat_map(|curve| &curve.jammed);
            all.map(|[_, height]| *height)
                .filter(|height| height.is_finite())
        };
        let [low, high] = extent(self.points().map(|point| point.1).chain(jammed()));
        let points = self.points();
        let ends = points.flat_map(|(_, y, down, up)| [y - down, y + up]);
        let [down, up] = extent(ends.chain(limits()).chain(jammed()));
        // All positive, and more than a decade.
        if !self.is_linear && low > 0.0 && high > 10.0 * low {
            // An interval that reaches far below its mean does not stretch the axis.
            let least = self.points().map(|(_, y, down, _)| (y - down).max(0.5 * y));
            let [least, _] = extent(least.chain(limits()).chain(jammed()));
            // Markers at the ends keep a distance from the frame.
            let room = (up / least).powf(MARGIN).max(1.15);
            return Scale::logarithmic(label, least / room, up * room);
        }
        let from_zero = low >= 0.0;
        let down = if from_zero { 0.0 } else { down.min(0.0) };
        let up = if from_zero { up } else { up.max(0.0) };
        let room = 0.06 * if up > down { up - down } else { 1.0 };
        let down = if from_zero { 0.0 } else { down - room };
        Scale::linear(label, down, up + room)
    }

    /// The horizontal axis of all panels.
    fn horizontal(&self) -> Scale {
        let label = self.x.clone();
        if let Some(log) = self.log {
            return Scale::of_decades(label, log);
        }
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        let [low, high] = extent(points.map(|point| point.0));
        let mut curves = self.curves.iter();
        // Distances of spheres begin at contact.
        let is_near_zero = low >= 0.0 && low < 0.2 * high;
        if is_near_zero && curves.all(|curve| curve.kind == CurveKind::Line) {
            return Scale::linear(label, 0.0, high);
        }
        let span = Some(high - low).filter(|span| *span > 0.0);
        let span = span.unwrap_or(high.abs().max(1.0));
        Scale::linear(label, low - 0.05 * span, high + 0.05 * span)
    }
}

impl Curve {
    /// A curve of a [`Figure`]; values that are not finite count as missing.
    pub(super) fn new(
        label: Label,
        mut points: Vec<(f64, f64, f64, f64)>,
        kind: CurveKind,
        panel: usize,
    ) -> Self {
        for point in points.iter_mut().filter(|point| !point.1.is_finite()) {
            point.1 = f64::NAN;
        }
        Self {
            label: label.words,
            number: label.number,
            points,
            kind,
            panel,
            ..Self::default()
        }
    }

    /// Marks the points whose runs are not in steady state, by their trends in the order of points.
    pub(in crate::report) fn marked(mut self, trends: &[Option<Trend>]) -> Self {
        let marks = self.points.iter().zip(trends);
        let marks = marks.filter_map(|(point, trend)| Some(((*trend)?, [point.0, point.1])));
        self.trends = marks.collect();
        self
    }

    /// A curve of values with their intervals.
    pub(in crate::report) fn of_values(
        label: &str,
        points: impl Iterator<Item = (f64, Estimate)>,
        kind: CurveKind,
        index: usize,
    ) -> Self {
        let half = |value: Estimate| value.ci95.unwrap_or(0.0);
        let points = points.map(|(x, value)| (x, value.mean, half(value), half(value)));
        Self {
            index,
            ..Self::new(label.into(), points.collect(), kind, 0)
        }
    }

    /// Gives it its style, and its pieces and missing points on these axes.
    fn finish(&mut self, [x, y]: [&Scale; 2], ordered: usize) {
        let is_drawn = |value: f64| !value.is_nan() && (!y.logarithmic || value > 0.0);
        let mut before: Option<f64> = None;
        for mut point in std::mem::take(&mut self.points) {
            if !is_drawn(point.1) {
                let jams = self.jammed.iter().any(|[x, _]| *x == point.0);
                if self.kind == CurveKind::Markers && !jams {
                    self.missing.push(point.0);
                }
                before = None;
                continue;
            }
            if y.logarithmic {
                // An interval that reaches below zero has no lower end there.
                point.2 = point.2.min(0.999 * point.1);
            }
            let index = self.points.len();
            match (before, self.pieces.last_mut()) {
                (Some(last), Some(piece)) if !x.breaks_between(last, point.0) => piece.1 = index,
                _ => self.pieces.push((index, index)),
            }
            before = Some(point.0);
            self.points.push(point);
        }
        self.across.retain(|[.., value]| is_drawn(*value));
        let is_line = matches!(self.kind, CurveKind::Line | CurveKind::Reference);
        let is_joined = is_line || self.kind == CurveKind::Markers;
        self.pieces
            .retain(|(first, last)| first < last && is_joined);
        self.has_intervals = is_joined && self.points.iter().any(|p| p.2 > 0.0 || p.3 > 0.0);
        // In time there are too many points for bars.
        self.has_band = self.has_intervals && is_line;
        self.colour = match (self.kind, ordered) {
            (CurveKind::Crosses | CurveKind::Reference | CurveKind::Trend(_), _) => Colour::INK,
            (_, 0) => COLOURS[self.index % COLOURS.len()],
            (_, number) => Colour::ordered(self.index, number),
        };
        self.marker = match self.kind {
            CurveKind::Markers | CurveKind::Points => Some(MARKERS[self.index % MARKERS.len()]),
            CurveKind::Crosses => Some(Marker::Cross),
            CurveKind::Trend(Trend::NotSteady) => Some(Marker::Ring),
            CurveKind::Trend(Trend::Ordering) => Some(Marker::Frame),
            CurveKind::Line | CurveKind::Reference => None,
        };
        let is_mark = matches!(self.kind, CurveKind::Trend(_));
        self.marker_size = if is_mark { 1.8 } else { 1.0 } * MARKER_SIZE;
        self.width = if is_line || is_mark { 0.7 } else { 1.0 } * LINE_WIDTH;
        self.dashes = DASHES[self.index % DASHES.len()].filter(|_| is_line);
    }
}

/// Marks around the points whose runs are not in steady state.
fn trends(data: &Figure) -> Vec<Curve> {
    let mut marks: Vec<Curve> = Vec::new();
    for curve in &data.curves {
        for (trend, [x, y]) in &curve.trends {
            let (spot, kind) = ((*x, *y, 0.0, 0.0), CurveKind::Trend(*trend));
            let mut known = marks.iter_mut();
            let known = known.find(|known| known.panel == curve.panel && known.kind == kind);
            if let Some(known) = known {
                known.points.push(spot);
            } else {
                let label = Label::from(trend.name());
                marks.push(Curve::new(label, vec![spot], kind, curve.panel));
            }
        }
    }
    marks.sort_by_key(|curve| (curve.panel, curve.kind == CurveKind::Trend(Trend::Ordering)));
    marks
}
