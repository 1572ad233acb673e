//! The neutral form of a figure: colours, markers, ends and ticks of its axes.
//!
//! The SVG files of this program and the figures of Python are drawn from it.

use super::data::{FigureData, PanelData, PlottedValue, Series, SeriesKind};
use super::palette::{COLOURS, Colour, MARKERS, Marker};
use super::scale::{Scale, extent};
use super::svg::PER_MM;
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

/// One curve.
#[derive(Debug, Default, Serialize)]
pub(super) struct Curve {
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
    /// Position, value, and extent of its interval down and up.
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
    /// Strain discarded, where curves differ in it.
    pub(super) discard: Option<f64>,
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
            panels,
        }
    }

    /// The outline of the data of a figure.
    pub(super) fn of(data: &FigureData) -> Self {
        let (x, y) = (horizontal(data), vertical(data));
        let discards = || data.series.iter().filter_map(|series| series.discard);
        let shaded = discards()
            .next()
            .filter(|first| discards().all(|d| (d - first).abs() < 1e-9) && *first > 0.0);
        let labelled = data.panels.iter().position(|p| !p.dilute.is_empty());
        let formula = labelled.map_or("", |index| data.panels[index].formula);
        let panel = |(index, panel): (usize, &PanelData)| {
            let series = data.series.iter().filter(|s| s.panel == index);
            let curves = series.map(|series| Curve {
                discard: series.discard.filter(|d| shaded.is_none() && *d > 0.0),
                ..Curve::of(series, [&x, &y], data.ordered)
            });
            Panel {
                title: panel.title.clone(),
                curves: curves.collect(),
                dashed: panel.dilute.clone(),
                dashed_label: (labelled == Some(index)).then_some(formula),
                shaded,
                x: x.clone(),
                y: y.clone(),
            }
        };
        let mut outline = Self::of_panels(data.panels.iter().enumerate().map(panel).collect());
        let has = |is_there: fn(&Curve) -> bool| {
            let mut curves = outline.panels.iter().flat_map(|panel| &panel.curves);
            curves.any(is_there)
        };
        let missing = has(|curve| !curve.missing.is_empty());
        let discards = has(|curve| curve.discard.is_some());
        let notes = [
            (labelled.is_some(), formula, None),
            (missing, "no result", Some(Marker::Cross)),
            (discards, "end of the strain discarded", Some(Marker::Bar)),
        ];
        let size = outline.tick_size;
        let notes = notes.into_iter().filter(|note| note.0);
        let notes = notes.map(|(_, label, marker)| Curve {
            label: label.into(),
            colour: Colour::GREY,
            marker,
            marker_size: 0.25 * size,
            width: if marker.is_some() { 0.8 } else { 0.4 },
            dashes: marker.is_none().then_some([4.5, 3.0]),
            ..Curve::default()
        });
        outline.notes = band_note(&data.series, size)
            .into_iter()
            .chain(notes)
            .collect();
        outline
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

/// Meaning of bands in time, if there are any.
fn band_note(series: &[Series], size: f64) -> Option<Curve> {
    let has_band = |series: &&Series| {
        let mut values = series.points.iter().filter_map(|point| point.y);
        series.kind == SeriesKind::Trace && values.any(|value| value.interval.is_some())
    };
    let mut banded = series.iter().filter(has_band).map(|series| series.runs);
    let first = banded.next()?;
    let number = if banded.all(|runs| runs == first) {
        format!("{first} ")
    } else {
        String::new()
    };
    Some(Curve {
        label: format!("mean of {number}runs, 95 % interval"),
        colour: Colour::PALE,
        width: 0.35 * size,
        ..Curve::default()
    })
}

/// The vertical axis of all panels.
fn vertical(data: &FigureData) -> Scale {
    let label = data.y.clone();
    let ends_of = |value: PlottedValue| {
        let [down, up] = value.interval.unwrap_or_default();
        [value.number - down, value.number + up]
    };
    let points = || data.series.iter().flat_map(|series| &series.points);
    let values = || points().filter_map(|point| point.y);
    let limits = || data.panels.iter().flat_map(|p| p.dilute.iter().copied());
    let [low, high] = extent(values().map(|value| value.number));
    let [down, up] = extent(values().flat_map(ends_of).chain(limits()));
    // All positive, and more than a decade.
    if !data.is_linear && low > 0.0 && high > 10.0 * low {
        // An interval that reaches far below its mean does not stretch the axis.
        let least = values().map(|value| ends_of(value)[0].max(0.5 * value.number));
        let [least, _] = extent(least.chain(limits()));
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
fn horizontal(data: &FigureData) -> Scale {
    let label = data.x.clone();
    if let Some(log) = data.log {
        return Scale::of_decades(label, log);
    }
    let points = data.series.iter().flat_map(|series| &series.points);
    let [low, high] = extent(points.map(|point| point.x));
    let mut series = data.series.iter();
    // Distances of spheres begin at contact.
    let is_near_zero = low >= 0.0 && low < 0.2 * high;
    if is_near_zero && series.all(|series| series.kind == SeriesKind::Trace) {
        return Scale::linear(label, 0.0, high);
    }
    let span = if high > low {
        high - low
    } else {
        high.abs().max(1.0)
    };
    Scale::linear(label, low - 0.05 * span, high + 0.05 * span)
}

impl Curve {
    fn of(series: &Series, [x, y]: [&Scale; 2], ordered: usize) -> Self {
        let mut points: Vec<(f64, f64, f64, f64)> = Vec::new();
        let mut pieces: Vec<(usize, usize)> = Vec::new();
        let mut missing = Vec::new();
        let mut across = Vec::new();
        let mut before: Option<f64> = None;
        for point in &series.points {
            let Some(value) = point.y.filter(|value| !y.logarithmic || value.number > 0.0) else {
                if series.kind == SeriesKind::Curve {
                    missing.push(point.x);
                }
                before = None;
                continue;
            };
            let [mut down, up] = value.interval.unwrap_or_default();
            if y.logarithmic {
                // An interval that reaches below zero has no lower end there.
                down = down.min(0.999 * value.number);
            }
            if let Some([from, to]) = point.across {
                across.push([from, to, value.number]);
            }
            let index = points.len();
            points.push((point.x, value.number, down, up));
            match (before, pieces.last_mut()) {
                (Some(last), Some(piece)) if !x.breaks_between(last, point.x) => piece.1 = index,
                _ => pieces.push((index, index)),
            }
            before = Some(point.x);
        }
        let is_joined = matches!(series.kind, SeriesKind::Curve | SeriesKind::Trace);
        pieces.retain(|(first, last)| first < last && is_joined);
        let has_intervals = is_joined && points.iter().any(|p| p.2 > 0.0 || p.3 > 0.0);
        let is_in_time = series.kind == SeriesKind::Trace;
        Self {
            label: series.label.words.clone(),
            colour: match (series.kind, ordered) {
                (SeriesKind::Crosses, _) => Colour::INK,
                (_, 0) => COLOURS[series.index % COLOURS.len()],
                (_, number) => Colour::ordered(series.index, number),
            },
            marker: match series.kind {
                SeriesKind::Curve | SeriesKind::Points => {
                    Some(MARKERS[series.index % MARKERS.len()])
                }
                SeriesKind::Crosses => Some(Marker::Cross),
                SeriesKind::Trace => None,
            },
            marker_size: MARKER_SIZE,
            width: if is_in_time {
                0.7 * LINE_WIDTH
            } else {
                LINE_WIDTH
            },
            dashes: DASHES[series.index % DASHES.len()].filter(|_| is_in_time),
            points,
            pieces,
            across,
            has_intervals,
            // In time there are too many points for bars.
            has_band: has_intervals && is_in_time,
            missing,
            discard: None,
        }
    }
}
