//! The arguments of figures.

use super::save;
use crate::api::Error;
use crate::axes::{AXES, Axis};
use crate::cli::Output;
use crate::cli::place::StoreArguments;
use crate::report::{
    Columns, Drawing, Format, Intervals, Kind, LegendPlace, Length, Look, Quantity, Range, Report,
    Selection, Style, Units, draw, traces,
};
use crate::store::Store;
use clap::ValueEnum as _;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::path::{Path, PathBuf};

/// What figure is drawn, and how.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Figures")]
pub(crate) struct FigureArguments {
    /// Draw a figure: FILE.svg, FILE.pdf or FILE.png
    #[arg(long, value_name = "FILE")]
    pub(super) figure: Option<PathBuf>,
    /// What the figure shows
    #[arg(long, value_enum, default_value_t, requires = "figure")]
    kind: Kind,
    /// Which viscosity the figure shows [default: viscosity]
    #[arg(long, value_enum, requires = "figure")]
    quantity: Option<Quantity>,
    /// The figure's horizontal axis [default: the shear rate where it varies; for contacts the friction]
    #[arg(long, value_name = "AXIS", value_parser = axis_among(Axis::is_numeric), requires = "figure")]
    along: Option<&'static Axis>,
    /// A panel for every value of this axis
    #[arg(long, value_name = "AXIS", value_parser = axis_among(|_| true), requires = "figure")]
    panels: Option<&'static Axis>,
    /// Runs of a trace, each by its number in the campaign file or the beginning of its key [default: the first run of each point]
    #[arg(long, value_name = "KEY", requires = "figure")]
    case: Vec<String>,
    /// Width of the figure, such as 85mm, 180mm or 3.35in [default: 85mm, and 180mm with panels]
    #[arg(long, value_name = "LENGTH", requires = "figure")]
    width: Option<Length>,
    /// Size of the labels in points; numbers and legend are a tenth smaller [default: 8]
    #[arg(long, value_name = "POINTS", requires = "figure")]
    font_size: Option<f64>,
    /// A logarithmic vertical axis [default: where the numbers are positive and span more than a decade]
    #[arg(long, requires = "figure")]
    log_y: bool,
    /// Ends of the horizontal axis, such as 0.01..100; plateaus stay beside them
    #[arg(long, value_name = "LOW..HIGH", requires = "figure")]
    x_range: Option<Range>,
    /// Ends of the vertical axis
    #[arg(
        long,
        value_name = "LOW..HIGH",
        allow_hyphen_values = true,
        requires = "figure"
    )]
    y_range: Option<Range>,
    /// What the horizontal axis is called
    #[arg(long, value_name = "TEXT", requires = "figure")]
    x_label: Option<String>,
    /// What the vertical axis is called
    #[arg(long, value_name = "TEXT", requires = "figure")]
    y_label: Option<String>,
    /// An entry of the legend; given once for every curve, in their order
    #[arg(long, value_name = "TEXT", requires = "figure")]
    label: Vec<String>,
    /// Where the legend stands [default: below]
    #[arg(long, value_enum, value_name = "PLACE", requires = "figure")]
    legend: Option<LegendPlace>,
    /// How intervals are drawn [default: bars]
    #[arg(long, value_enum, value_name = "FORM", requires = "figure")]
    intervals: Option<Intervals>,
    /// A TOML file with width, height, font_size, line_width, marker_size, colours, markers, legend, intervals, dpi
    #[arg(long, value_name = "FILE", requires = "figure")]
    style: Option<PathBuf>,
}

/// Reads the name of one of some axes, as the campaign file has it, or its symbol.
fn axis_among(is_meant: fn(&Axis) -> bool) -> impl TypedValueParser<Value = &'static Axis> {
    let names = AXES
        .iter()
        .filter(|axis| is_meant(axis))
        .map(|axis| PossibleValue::new(axis.key).aliases(axis.other_names()));
    PossibleValuesParser::new(names)
        .try_map(|name| Axis::named(&name).ok_or("no axis of a campaign"))
}

/// A figure that is to be drawn into a file.
pub(super) struct Asked<'a> {
    path: &'a Path,
    drawing: Drawing,
    format: Format,
    cases: &'a [String],
}

impl FigureArguments {
    /// The figure asked for, if one is.
    pub(super) fn asked(&self) -> Result<Option<Asked<'_>>, Error> {
        let Some(path) = &self.figure else {
            return Ok(None);
        };
        let refuse = |argument, message: &str| {
            Err(Error::Argument {
                argument,
                message: message.into(),
            })
        };
        if self.quantity.is_some() && self.kind != Kind::Viscosity {
            return refuse(
                "--quantity",
                "it chooses a viscosity, so only --kind viscosity has it",
            );
        }
        if !self.case.is_empty() && self.kind != Kind::Trace {
            return refuse(
                "--case",
                "it names runs in time, so only --kind trace has it",
            );
        }
        Ok(Some(Asked {
            path,
            format: format_of(path)?,
            cases: &self.case,
            drawing: Drawing {
                kind: self.kind,
                quantity: self.quantity.unwrap_or_default(),
                along: self.along,
                look: self.look()?,
            },
        }))
    }

    /// How it is to look.
    fn look(&self) -> Result<Look, Error> {
        let mut style = match &self.style {
            None => Style::default(),
            Some(path) => {
                let text = std::fs::read_to_string(path).map_err(|source| Error::Read {
                    path: path.clone(),
                    source,
                })?;
                Style::read(&text)?
            }
        };
        style.legend = self.legend.unwrap_or(style.legend);
        style.intervals = self.intervals.unwrap_or(style.intervals);
        let look = Look {
            style,
            log_y: self.log_y,
            x_range: self.x_range,
            y_range: self.y_range,
            x_label: self.x_label.clone(),
            y_label: self.y_label.clone(),
            labels: self.label.clone(),
            panels: self.panels,
        };
        Ok(look.with_sizes(self.width, self.font_size)?)
    }
}

/// Several stores in one figure, the first of which is open already.
pub(super) struct Sources<'a> {
    pub(super) first: (&'a Store, &'a Report),
    pub(super) more: &'a [PathBuf],
    pub(super) selection: &'a Selection,
    pub(super) units: Units,
}

/// Draws a figure into its file.
pub(super) fn write(
    asked: &Asked<'_>,
    sources: &Sources<'_>,
    output: &mut Output<'_>,
) -> Result<(), Error> {
    let drawing = &asked.drawing;
    let in_time = |store: &Store| match drawing.kind {
        Kind::Trace => traces(store, sources.selection, asked.cases),
        _ => Ok(Vec::new()),
    };
    let (store, report) = sources.first;
    let mut reports = vec![report.clone()];
    let mut runs = in_time(store)?;
    for path in sources.more {
        let place = StoreArguments::of(path.clone());
        let store = place.open(output)?;
        reports.push(Report {
            units: sources.units,
            columns: Columns::default(),
            ..Report::of(&store, sources.selection)?
        });
        runs.extend(in_time(&store)?);
    }
    save(
        asked.path,
        &draw(&reports, &runs, drawing, asked.format)?,
        output,
    )
}

/// The format a figure's file name asks for.
pub(crate) fn format_of(path: &Path) -> Result<Format, Error> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending
        .and_then(|ending| Format::from_str(ending, true).ok())
        .ok_or_else(|| Error::Argument {
            argument: "--figure",
            message: format!(
                "a name that ends with .svg, .pdf or .png, not {}",
                path.display()
            ),
        })
}
