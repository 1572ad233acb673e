//! A figure ready to be drawn: colours, markers, ends and ticks of its axes.
//!
//! The figures of this program and those of other programs with the same style are drawn from it.

use super::legend::Legend;
use super::look::{Intervals, LegendPlace, Look, Range};
use super::palette::{Colour, Marker};
use super::scale::{Scale, extent};
use super::sketch::{Field, Form, Height, Line, Sketch, Spot};
use crate::report::error::ReportError;
use serde::Serialize;

/// Height of a panel over its width.
const PANEL_ASPECT: f64 = 0.74;
/// Dashes of lines without markers, which distinguish them in grey print.
const DASHES: [Option<[f64; 2]>; 4] = [None, Some([4.0, 1.2]), Some([1.4, 1.0]), Some([8.0, 1.6])];
/// Label of dashed lines, and margin of a logarithmic axis beyond its numbers, over its length.
const MARGIN: f64 = 0.05;
/// Distance of bars of several curves at the same point, over the width of the axis.
const DODGE: f64 = 0.013;
/// Maximum distance between the first and the last of them.
const DODGE_IN_ALL: f64 = 0.055;

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
    #[serde(skip)]
    pub(super) legend: LegendPlace,
    /// Further entries of the legend, as curves without points.
    #[serde(skip)]
    notes: Vec<Curve>,
    /// Its panels.
    pub(super) panels: Vec<Panel>,
}

/// One pair of axes.
#[derive(Debug, Serialize)]
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
    /// The outline of a sketch.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on a range in which nothing can be drawn.
    pub(super) fn of(sketch: &Sketch, look: &Look) -> Result<Self, ReportError> {
        let style = &look.style;
        let number = sketch.panels.len().max(1);
        let width = look.width(number);
        // Three panels side by side need the full page of a journal.
        let fit = if width < 340.0 { 1 } else { 3 };
        let columns = match number {
            1 => 1,
            2 | 4 => fit.min(2),
            _ => fit,
        };
        let y = vertical(sketch, look)?;
        let x = horizontal(sketch, look)?;
        let discards = || sketch.lines.iter().filter_map(|line| line.discard);
        let shaded = discards()
            .next()
            .filter(|first| discards().all(|d| (d - first).abs() < 1e-9) && *first > 0.0);
        let labelled = sketch.panels.iter().position(|p| !p.dilute.is_empty());
        let formula = labelled.map_or("", |place| sketch.panels[place].formula);
        let panel = |(place, field): (usize, &Field)| {
            let lines: Vec<&Line> = sketch.lines.iter().filter(|l| l.panel == place).collect();
            let shifts = dodges(&lines, &x, look);
            let curves = lines.iter().zip(shifts).map(|(line, shift)| Curve {
                discard: line.discard.filter(|d| shaded.is_none() && *d > 0.0),
                ..Curve::of(line, shift, [&x, &y], sketch.ordered, look)
            });
            Panel {
                title: field.title.clone(),
                curves: curves.collect(),
                dashed: field.dilute.clone(),
                dashed_label: (labelled == Some(place)).then_some(formula),
                shaded,
                x: x.clone(),
                y: y.clone(),
            }
        };
        let panels: Vec<Panel> = sketch.panels.iter().enumerate().map(panel).collect();
        let has = |is_there: fn(&Curve) -> bool| {
            let mut curves = panels.iter().flat_map(|panel| &panel.curves);
            curves.any(is_there)
        };
        let tick_size = 0.9 * style.font_size;
        let missing = has(|curve| !curve.missing.is_empty());
        let discards = has(|curve| curve.discard.is_some());
        let notes = [
            (labelled.is_some(), formula, None),
            (missing, "no result", Some(Marker::Cross)),
            (discards, "end of the strain discarded", Some(Marker::Bar)),
        ];
        let notes = notes.into_iter().filter(|note| note.0);
        let notes = notes.map(|(_, label, marker)| Curve {
            label: label.into(),
            colour: Colour::GREY,
            marker,
            marker_size: 0.25 * tick_size,
            width: if marker.is_some() { 0.8 } else { 0.4 },
            dashes: marker.is_none().then_some([4.5, 3.0]),
            ..Curve::default()
        });
        let notes = band_note(&sketch.lines, look, tick_size)
            .into_iter()
            .chain(notes);
        let mut outline = Self {
            notes: notes.collect(),
            width,
            panel_height: 0.0,
            columns,
            label_size: style.font_size,
            tick_size,
            legend: style.legend,
            panels,
        };
        let beside = match style.legend {
            LegendPlace::Right => Legend::of(&outline).width_beside(&outline),
            _ => 0.0,
        };
        let usual = (PANEL_ASPECT * (width - beside) / columns as f64).clamp(120.0, 300.0);
        outline.panel_height = style.height.map_or(usual, |height| height.0);
        Ok(outline)
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
fn band_note(lines: &[Line], look: &Look, size: f64) -> Option<Curve> {
    let has_band = |line: &&Line| {
        let mut heights = line.points.iter().filter_map(|spot| spot.y);
        line.form == Form::Trace && heights.any(|height| height.interval.is_some())
    };
    let mut banded = lines.iter().filter(has_band).map(|line| line.runs);
    let first = banded
        .next()
        .filter(|_| look.style.intervals != Intervals::None)?;
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
fn vertical(sketch: &Sketch, look: &Look) -> Result<Scale, ReportError> {
    let label = look.y_label.clone().unwrap_or_else(|| sketch.y.clone());
    let has_intervals = look.style.intervals != Intervals::None;
    let reach = |height: Height| {
        let interval = height.interval.filter(|_| has_intervals);
        let [down, up] = interval.unwrap_or_default();
        [height.value - down, height.value + up]
    };
    let spots = || sketch.lines.iter().flat_map(|line| &line.points);
    let heights = || spots().filter_map(|spot| spot.y);
    let limits = || sketch.panels.iter().flat_map(|p| p.dilute.iter().copied());
    let [low, high] = extent(heights().map(|height| height.value));
    if look.log_y && low <= 0.0 {
        return Err(ReportError::argument(
            "--log-y",
            format!("there is a value of {low:.4}: numbers of 0 or below have no logarithm"),
        ));
    }
    // All positive, and more than a decade.
    let logarithmic = look.log_y || (!sketch.is_linear && low > 0.0 && high > 10.0 * low);
    if let Some(Range { low, high }) = look.y_range {
        if logarithmic && low <= 0.0 {
            return Err(ReportError::argument(
                "--y-range",
                format!("the axis is logarithmic and cannot begin at {low}"),
            ));
        }
        return Ok(Scale::of_kind(logarithmic, label, low, high));
    }
    let [down, up] = extent(heights().flat_map(reach).chain(limits()));
    if logarithmic {
        // An interval that reaches far below its mean does not stretch the axis.
        let least = heights().map(|height| reach(height)[0].max(0.5 * height.value));
        let [least, _] = extent(least.chain(limits()));
        // Markers at the ends keep a distance from the frame.
        let room = (up / least).powf(MARGIN).max(1.15);
        return Ok(Scale::logarithmic(label, least / room, up * room));
    }
    let from_zero = low >= 0.0;
    let down = if from_zero { 0.0 } else { down.min(0.0) };
    let up = if from_zero { up } else { up.max(0.0) };
    let room = 0.06 * if up > down { up - down } else { 1.0 };
    let down = if from_zero { 0.0 } else { down - room };
    Ok(Scale::linear(label, down, up + room))
}

/// The horizontal axis of all panels.
fn horizontal(sketch: &Sketch, look: &Look) -> Result<Scale, ReportError> {
    let label = look.x_label.clone().unwrap_or_else(|| sketch.x.clone());
    if let Some(log) = sketch.log {
        if look.x_range.is_some_and(|range| range.low < 0.0) {
            return Err(ReportError::argument(
                "--x-range",
                "the axis is logarithmic: it can begin at 0, with the plateau, or above",
            ));
        }
        return Ok(Scale::of_decades(label, log, look.x_range));
    }
    if let Some(Range { low, high }) = look.x_range {
        return Ok(Scale::linear(label, low, high));
    }
    let spots = sketch.lines.iter().flat_map(|line| &line.points);
    let [low, high] = extent(spots.map(|spot| spot.x));
    // Distances of spheres begin at contact.
    let is_near_zero = low >= 0.0 && low < 0.2 * high;
    if sketch.lines.iter().all(|line| line.form == Form::Trace) && is_near_zero {
        return Ok(Scale::linear(label, 0.0, high));
    }
    let span = if high > low {
        high - low
    } else {
        high.abs().max(1.0)
    };
    Ok(Scale::linear(label, low - 0.05 * span, high + 0.05 * span))
}

/// Shift of each line along the axis, so that bars at the same point are side by side.
fn dodges(lines: &[&Line], x: &Scale, look: &Look) -> Vec<f64> {
    let has_bars = |line: &Line| {
        let mut spots = line.points.iter().filter_map(|spot| spot.y);
        line.form == Form::Curve
            && look.style.intervals == Intervals::Bars
            && spots.any(|height| height.interval.is_some())
    };
    let barred: Vec<usize> = (0..lines.len()).filter(|n| has_bars(lines[*n])).collect();
    let span = x.high - x.low;
    let meets = |a: usize, b: usize| {
        let is_near = |s: &Spot| {
            let others = &lines[b].points;
            others.iter().any(|t| (s.x - t.x).abs() < 0.02 * span)
        };
        lines[a].points.iter().any(is_near)
    };
    let mut shifts = vec![0.0; lines.len()];
    if (1..barred.len()).any(|n| (0..n).any(|m| meets(barred[n], barred[m]))) {
        let number = barred.len() as f64 - 1.0;
        let each = DODGE.min(DODGE_IN_ALL / number) * span;
        for (n, line) in barred.into_iter().enumerate() {
            shifts[line] = each * (n as f64 - 0.5 * number);
        }
    }
    shifts
}

impl Curve {
    fn of(line: &Line, shift: f64, [x, y]: [&Scale; 2], ordered: usize, look: &Look) -> Self {
        let style = &look.style;
        let mut points: Vec<(f64, f64, f64, f64)> = Vec::new();
        let mut pieces: Vec<(usize, usize)> = Vec::new();
        let mut missing = Vec::new();
        let mut across = Vec::new();
        let mut before: Option<f64> = None;
        for spot in &line.points {
            let Some(height) = spot.y.filter(|h| !y.logarithmic || h.value > 0.0) else {
                if line.form == Form::Curve {
                    missing.push(spot.x + shift);
                }
                before = None;
                continue;
            };
            let interval = height
                .interval
                .filter(|_| style.intervals != Intervals::None);
            let [mut down, up] = interval.unwrap_or_default();
            if y.logarithmic {
                // An interval that reaches below zero has no lower end there.
                down = down.min(0.999 * height.value);
            }
            if let Some([from, to]) = spot.across.filter(|_| style.intervals != Intervals::None) {
                across.push([from + shift, to + shift, height.value]);
            }
            let place = points.len();
            points.push((spot.x + shift, height.value, down, up));
            match (before, pieces.last_mut()) {
                (Some(last), Some(piece)) if !x.breaks_between(last, spot.x) => piece.1 = place,
                _ => pieces.push((place, place)),
            }
            before = Some(spot.x);
        }
        pieces.retain(|(first, last)| {
            first < last && !matches!(line.form, Form::Crosses | Form::Points)
        });
        let interval = |point: &(f64, f64, f64, f64)| point.2 > 0.0 || point.3 > 0.0;
        let has_intervals =
            matches!(line.form, Form::Curve | Form::Trace) && points.iter().any(interval);
        // In time there are too many points for bars.
        let is_band = style.intervals == Intervals::Bands || line.form == Form::Trace;
        Self {
            label: line.label.words.clone(),
            colour: match (line.form, ordered) {
                (Form::Crosses, _) => Colour::INK,
                (_, 0) => style.colours[line.place % style.colours.len()],
                (_, number) => Colour::ordered(line.place, number),
            },
            marker: match line.form {
                Form::Curve | Form::Points => Some(style.markers[line.place % style.markers.len()]),
                Form::Crosses => Some(Marker::Cross),
                Form::Trace => None,
            },
            marker_size: style.marker_size.0,
            width: match line.form {
                Form::Trace => 0.7 * style.line_width.0,
                _ => style.line_width.0,
            },
            dashes: match line.form {
                Form::Trace => DASHES[line.place % DASHES.len()],
                _ => None,
            },
            points,
            pieces,
            across,
            has_intervals,
            has_band: has_intervals && is_band,
            missing,
            discard: None,
        }
    }
}
