//! How a sketch is to look: for print, 85 mm wide, the colours of Okabe and Ito, a marker of its own for each curve.
//!
//! Whoever draws it goes by this: the figures of the program itself, and those of other programs with the same look.

use super::{Line, Sketch};
use serde::Serialize;

/// Curves of one figure at most: as many as there are colours and markers that can be told apart.
pub(super) const CURVES: usize = 8;
/// Okabe and Ito's colours, dark ones first, their yellow last: it is hard to see on white.
const COLOURS: [&str; CURVES] = [
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9", "#F0E442",
];
/// A marker for each colour.
const MARKERS: [Marker; CURVES] = [
    Marker::Circle,
    Marker::Square,
    Marker::Triangle,
    Marker::Diamond,
    Marker::TriangleDown,
    Marker::Plus,
    Marker::Cross,
    Marker::Star,
];
/// Width of a column, 85 mm.
const WIDTH: f64 = 321.0;
/// Height of a figure without its legend.
const HEIGHT: f64 = 255.0;
/// Height of an entry of the legend.
const LEGEND_LINE: f64 = 18.0;

/// What marks a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
    TriangleDown,
    Plus,
    Cross,
    Star,
}

/// A figure, in the units of its axes; lengths in pixels of 1/96 inch.
#[derive(Debug, Serialize)]
pub struct Outline {
    /// Width of all.
    pub(super) width: f64,
    /// Height of all.
    pub(super) height: f64,
    /// Of this, height of the legend below the axis.
    pub(super) legend_height: f64,
    /// Size of the labels of the axes.
    pub(super) label_size: u32,
    /// Size of the numbers and of the legend.
    pub(super) tick_size: u32,
    /// The horizontal axis.
    pub(super) x: Horizontal,
    /// The vertical axis.
    pub(super) y: Vertical,
    /// Its lines.
    pub(super) lines: Vec<Curve>,
    /// Heights of dashed lines.
    pub(super) dashed: Straight,
}

/// A horizontal axis.
#[derive(Debug, Serialize)]
pub(super) struct Horizontal {
    pub(super) label: String,
    /// Its ends and ticks where they are not for the drawing program to choose.
    pub(super) decades: Option<Decades>,
}

/// A logarithmic axis by its decades, with 0 and infinity beyond its ends.
#[derive(Debug, Serialize)]
pub(super) struct Decades {
    pub(super) left: f64,
    pub(super) right: f64,
    /// From one tick to the next.
    pub(super) step: f64,
    /// Places of ticks, and what stands there.
    pub(super) ticks: Vec<(f64, String)>,
    /// Where 0 and infinity are set apart.
    pub(super) breaks: Straight,
}

/// A vertical axis.
#[derive(Debug, Serialize)]
pub(super) struct Vertical {
    pub(super) label: &'static str,
    pub(super) logarithmic: bool,
    /// Whether it begins at 0.
    pub(super) from_zero: bool,
}

/// Straight lines across the figure.
#[derive(Debug, Serialize)]
pub(super) struct Straight {
    pub(super) places: Vec<f64>,
    pub(super) colour: &'static str,
    pub(super) width: f64,
    /// Lengths of a dash and of the gap after it.
    pub(super) dashes: [f64; 2],
}

/// One curve.
#[derive(Debug, Serialize)]
pub(super) struct Curve {
    /// Its entry in the legend; empty for none.
    pub(super) label: String,
    pub(super) colour: &'static str,
    /// `None` for a line without markers.
    pub(super) marker: Option<Marker>,
    /// Radius of its markers.
    pub(super) marker_size: f64,
    /// Width of the line that joins them; 0 for none.
    pub(super) width: f64,
    /// Place, height, and how far its interval reaches down and up.
    pub(super) points: Vec<(f64, f64, f64, f64)>,
    /// Whether any point has an interval.
    pub(super) has_intervals: bool,
}

impl Outline {
    /// The look of a sketch.
    pub(super) fn of(sketch: &Sketch) -> Self {
        let heights = || {
            let lines = sketch.lines.iter();
            lines.flat_map(|line| line.points.iter().map(|p| p.1))
        };
        let low = heights().fold(f64::INFINITY, f64::min);
        let high = heights().fold(f64::NEG_INFINITY, f64::max);
        // All positive, and more than a decade.
        let logarithmic = low > 0.0 && high > 10.0 * low;
        let lines: Vec<Curve> = sketch
            .lines
            .iter()
            .filter(|line| !line.points.is_empty())
            .map(|line| Curve::of(line, logarithmic))
            .collect();
        let labelled = lines.iter().filter(|line| !line.label.is_empty()).count();
        // A column of entries below the axis, with room of its own.
        let legend_height = match labelled {
            0 => 0.0,
            entries => LEGEND_LINE * entries as f64 + 10.0,
        };
        Self {
            width: WIDTH,
            height: HEIGHT + legend_height,
            legend_height,
            label_size: 11,
            tick_size: 10,
            x: Horizontal {
                label: sketch.x.clone(),
                decades: sketch.log.map(Decades::of),
            },
            y: Vertical {
                label: sketch.y,
                logarithmic,
                from_zero: !logarithmic && heights().all(|height| height >= 0.0),
            },
            lines,
            dashed: Straight {
                places: sketch.dashed.clone(),
                colour: "#555555",
                width: 0.9,
                dashes: [6.0, 4.0],
            },
        }
    }
}

impl Decades {
    fn of(log: super::LogAxis) -> Self {
        let left = log.low - if log.zero { 1.4 } else { 0.4 };
        let right = log.high + if log.infinite { 1.4 } else { 0.4 };
        let crowded = right - left > 8.5;
        let step = if crowded { 2.0 } else { 1.0 };
        let first = (left / step).ceil() * step;
        let places = std::iter::successors(Some(first), |place| Some(place + step));
        let sides = [(log.zero, log.low - 0.5), (log.infinite, log.high + 0.5)];
        Self {
            left,
            right,
            step,
            ticks: places
                .take_while(|place| *place <= right)
                .map(|place| (place, log.tick(place)))
                .collect(),
            breaks: Straight {
                places: sides
                    .into_iter()
                    .filter_map(|(drawn, place)| drawn.then_some(place))
                    .collect(),
                colour: "#bbbbbb",
                width: 0.8,
                dashes: [1.0, 3.0],
            },
        }
    }
}

impl Curve {
    fn of(line: &Line, logarithmic: bool) -> Self {
        let interval = |mean: f64, half: Option<f64>| {
            let half = half.unwrap_or(0.0);
            // An interval that reaches below zero has no lower end on a logarithmic axis.
            let lower = if logarithmic {
                half.min(0.99 * mean)
            } else {
                half
            };
            (lower, half)
        };
        Self {
            label: line.label.clone(),
            colour: COLOURS[line.style % CURVES],
            marker: (!line.plain).then_some(MARKERS[line.style % CURVES]),
            marker_size: 3.0,
            width: match (line.joined, line.plain) {
                (false, _) => 0.0,
                (true, true) => 0.8,
                (true, false) => 1.2,
            },
            points: line
                .points
                .iter()
                .map(|&(place, mean, half)| {
                    let (lower, upper) = interval(mean, half);
                    (place, mean, lower, upper)
                })
                .collect(),
            has_intervals: !line.plain && line.points.iter().any(|point| point.2.is_some()),
        }
    }
}
