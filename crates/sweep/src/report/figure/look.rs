//! The style of figures: lengths, colours and markers, which a group keeps in a file, and options
//! of a single figure.

use super::palette::{COLOURS, Colour, MARKERS, Marker};
use crate::model::axes::{AXES, Axis};
use crate::report::error::ReportError;
use crate::report::selection::range;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde::Deserialize;
use std::str::FromStr;

/// Points (bp) per inch.
pub(super) const POINTS_PER_INCH: f64 = 72.0;
/// Millimetres per inch.
const MM_PER_INCH: f64 = 25.4;
/// A length on paper, in points (bp).
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Deserialize)]
#[serde(try_from = "String")]
pub struct Length(pub(super) f64);

impl Length {
    /// A length in millimetres.
    const fn mm(number: f64) -> Self {
        Self(number * POINTS_PER_INCH / MM_PER_INCH)
    }

    /// The length in millimetres.
    pub(super) fn in_mm(self) -> f64 {
        self.0 * MM_PER_INCH / POINTS_PER_INCH
    }
}

impl FromStr for Length {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let split = text
            .find(|c: char| c.is_ascii_alphabetic())
            .unwrap_or(text.len());
        let (number, unit) = text.split_at(split);
        let points = match unit {
            "mm" => POINTS_PER_INCH / MM_PER_INCH,
            "cm" => 10.0 * POINTS_PER_INCH / MM_PER_INCH,
            "in" => POINTS_PER_INCH,
            "pt" => 1.0,
            _ => f64::NAN,
        };
        let length = points * number.trim().parse::<f64>().unwrap_or(f64::NAN);
        if length.is_finite() {
            Ok(Self(length))
        } else {
            Err(format!(
                "{text:?} is not a length: write it as 85mm, 8.5cm, 3.35in or 241pt"
            ))
        }
    }
}

impl TryFrom<String> for Length {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

/// Position of the legend.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum LegendPlace {
    /// Under the axes.
    #[default]
    Below,
    /// In the corner of the axes where it hides least.
    Inside,
    /// To the right of the axes.
    Right,
    /// Nowhere.
    None,
}

/// Style of intervals.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Intervals {
    /// As bars; those of several curves are side by side.
    #[default]
    Bars,
    /// As bands behind the curves.
    Bands,
    /// Not at all.
    None,
}

/// A style for all figures of a group. A TOML file may give any of its values.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Style {
    /// Width of a figure.
    pub width: Option<Length>,
    /// Height of one panel; by default proportional to its width.
    pub height: Option<Length>,
    /// Size of the labels of axes in points; numbers and legend are a tenth smaller.
    pub font_size: f64,
    /// Width of curves.
    pub line_width: Length,
    /// Radius of markers.
    pub marker_size: Length,
    /// Colours of curves; more curves than these along a numeric axis use a map of increasing
    /// lightness.
    pub colours: Vec<Colour>,
    /// Markers of curves, repeated cyclically.
    pub markers: Vec<Marker>,
    /// Position of the legend.
    pub legend: LegendPlace,
    /// Style of intervals.
    pub intervals: Intervals,
    /// Dots per inch of a PNG.
    pub dpi: u32,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            width: None,
            height: None,
            font_size: 8.0,
            line_width: Length(0.9),
            marker_size: Length(2.3),
            colours: COLOURS.to_vec(),
            markers: MARKERS.to_vec(),
            legend: LegendPlace::default(),
            intervals: Intervals::default(),
            dpi: 600,
        }
    }
}

impl Style {
    /// Reads a style from the text of a file.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on a key that is none, or a value that cannot be meant.
    pub fn read(text: &str) -> Result<Self, ReportError> {
        let style: Self = toml::from_str(text)
            .map_err(|error| ReportError::argument("--style", error.to_string().trim_end()))?;
        style.check("--style")?;
        Ok(style)
    }

    /// Checks that the figure can be drawn; `argument` gave its values.
    fn check(&self, argument: &'static str) -> Result<(), ReportError> {
        let mm = |length: Length| length.in_mm();
        let dpi = f64::from(self.dpi);
        for (name, value, [low, high], unit) in [
            ("width", self.width.map(mm), [30.0, 600.0], " mm"),
            ("height", self.height.map(mm), [30.0, 600.0], " mm"),
            ("font_size", Some(self.font_size), [3.0, 40.0], " pt"),
            ("line_width", Some(self.line_width.0), [0.05, 20.0], " pt"),
            ("marker_size", Some(self.marker_size.0), [0.05, 20.0], " pt"),
            ("dpi", Some(dpi), [50.0, 2400.0], ""),
        ] {
            // Millimetres are converted from points, which rounds.
            let is_outside = |value: &f64| !(low - 1e-9..=high + 1e-9).contains(value);
            if let Some(value) = value.filter(is_outside) {
                let value = (value * 1e4).round() / 1e4;
                let message = format!(
                    "a {name} of {value}{unit} is out of range: {low}{unit} to {high}{unit}"
                );
                return Err(ReportError::argument(argument, message));
            }
        }
        if self.colours.is_empty() || self.markers.is_empty() {
            let message = "colours and markers need at least one each";
            return Err(ReportError::argument(argument, message));
        }
        Ok(())
    }
}

/// The ends of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    pub(in crate::report) low: f64,
    pub(in crate::report) high: f64,
}

impl FromStr for Range {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match range(text) {
            Some([low, high]) if low.is_finite() && high.is_finite() && low < high => {
                Ok(Self { low, high })
            }
            _ => Err(format!(
                "{text:?} is not a range: write the lower end, two dots, the upper end, as in 0.01..100"
            )),
        }
    }
}

/// Options of one figure besides its style.
#[derive(Debug, Clone, Default, clap::Args)]
#[group(requires = "figure")]
pub struct Look {
    /// Its style.
    #[arg(skip)]
    pub style: Style,
    /// One panel for every value of this axis
    #[arg(long, value_name = "AXIS", value_parser = axis_among(|_| true), hide_possible_values = true)]
    pub panels: Option<&'static Axis>,
    /// Logarithmic vertical axis [default: where the numbers are positive and span more than a
    /// decade]
    #[arg(long, hide_short_help = true)]
    pub log_y: bool,
    /// Ends of the horizontal axis, such as 0.01..100; plateaus remain
    #[arg(long, value_name = "LOW..HIGH", hide_short_help = true)]
    pub x_range: Option<Range>,
    /// Ends of the vertical axis
    #[arg(
        long,
        value_name = "LOW..HIGH",
        allow_hyphen_values = true,
        hide_short_help = true
    )]
    pub y_range: Option<Range>,
    /// Label of the horizontal axis
    #[arg(long, value_name = "TEXT", hide_short_help = true)]
    pub x_label: Option<String>,
    /// Label of the vertical axis
    #[arg(long, value_name = "TEXT", hide_short_help = true)]
    pub y_label: Option<String>,
    /// Entry of the legend; one per curve, in order
    #[arg(long = "label", value_name = "TEXT", hide_short_help = true)]
    pub labels: Vec<String>,
}

/// Reads the key of one of some axes, or its symbol.
pub(super) fn axis_among(
    is_meant: fn(&Axis) -> bool,
) -> impl TypedValueParser<Value = &'static Axis> {
    let names = AXES.iter().filter(|axis| is_meant(axis));
    let names = names.map(|axis| PossibleValue::new(axis.key).aliases(axis.other_names()));
    PossibleValuesParser::new(names)
        .try_map(|name| Axis::named(&name).ok_or("not an axis of a campaign"))
}

impl Look {
    /// Overrides the style by the values of the command line.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on a value out of range.
    pub fn with_sizes(
        mut self,
        width: Option<Length>,
        font_size: Option<f64>,
    ) -> Result<Self, ReportError> {
        if width.is_some() {
            self.style.width = width;
            self.style.check("--width")?;
        }
        if let Some(size) = font_size {
            self.style.font_size = size;
            self.style.check("--font-size")?;
        }
        Ok(self)
    }

    /// The width of a figure by its number of panels: one column of a journal, or the full page for
    /// several.
    pub(super) fn width(&self, panels: usize) -> f64 {
        let usual = Length::mm(if panels > 1 { 180.0 } else { 85.0 });
        self.style.width.unwrap_or(usual).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_units() {
        let points = |text: &str| text.parse::<Length>().map(|length| length.0);
        assert!((points("25.4mm").unwrap() - 72.0).abs() < 1e-12);
        assert!((points("2.54 cm").unwrap() - 72.0).abs() < 1e-12);
        assert!((points("1in").unwrap() - points("72pt").unwrap()).abs() < 1e-12);
        for wrong in ["85", "mm", "85 miles", "infmm", ""] {
            let error = points(wrong).unwrap_err();
            assert!(error.contains("85mm"), "{error}");
        }
    }

    #[test]
    fn styles_are_read_and_mistakes_named() {
        let style = Style::read("width = \"180mm\"\ncolours = [\"#000000\"]\nlegend = \"inside\"");
        let style = style.unwrap();
        assert_eq!(style.legend, LegendPlace::Inside);
        assert_eq!(style.colours.len(), 1);
        assert_eq!(style.dpi, 600);
        for (text, part) in [
            ("widht = \"80mm\"", "widht"),
            ("width = \"1m\"", "85mm"),
            ("width = \"1mm\"", "30 mm"),
            ("font_size = 0.5", "font_size"),
            ("colours = [\"blue\"]", "#0072b2"),
            ("colours = []", "at least one"),
            ("dpi = 1", "dpi"),
            ("legend = \"left\"", "inside"),
        ] {
            let error = Style::read(text).unwrap_err().to_string();
            assert!(error.contains(part) && error.contains("--style"), "{error}");
        }
    }

    #[test]
    fn ranges_have_two_ends() {
        assert_eq!(
            "1e-2..3".parse(),
            Ok(Range {
                low: 0.01,
                high: 3.0
            })
        );
        for wrong in ["1", "3..1", "1..1", "0..inf", "a..b"] {
            assert!(wrong.parse::<Range>().is_err(), "{wrong}");
        }
    }
}
