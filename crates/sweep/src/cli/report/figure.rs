//! The arguments of figures.

use crate::cli::Output;
use crate::cli::output_file::{format_of, save};
use crate::cli::place::StoreArguments;
use crate::error::Error;
use crate::report::{
    Columns, Drawing, Format, Intervals, Kind, LegendPlace, Length, Look, Report, Selection, Style,
    Units, draw, traces,
};
use crate::store::Store;
use crate::system::files;
use std::path::{Path, PathBuf};

/// Largest file of a style, in bytes.
const STYLE_LIMIT: u64 = 1 << 20;

/// Kind and style of the figure.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Figures")]
pub(crate) struct FigureArguments {
    /// Draw a figure: FILE.svg, FILE.pdf or FILE.png
    #[arg(long, value_name = "FILE")]
    pub(super) figure: Option<PathBuf>,
    #[command(flatten)]
    drawing: Drawing,
    #[command(flatten)]
    choices: FigureChoices,
}

/// Further options.
#[derive(Debug, clap::Args)]
#[group(requires = "figure")]
struct FigureChoices {
    /// Runs of a trace, by number in the campaign file or beginning of the key [default: the mean
    /// over the finished runs of each point]
    #[arg(long, value_name = "KEY", hide_short_help = true)]
    case: Vec<String>,
    /// Width of the figure, such as 85mm, 180mm or 3.35in [default: 85mm, and 180mm with panels]
    #[arg(long, value_name = "LENGTH", hide_short_help = true)]
    width: Option<Length>,
    /// Size of labels in points; numbers and legend are 10 % smaller [default: 8]
    #[arg(long, value_name = "POINTS", hide_short_help = true)]
    font_size: Option<f64>,
    /// Position of the legend [default: below]
    #[arg(long, value_enum, value_name = "PLACE", hide_short_help = true)]
    legend: Option<LegendPlace>,
    /// Style of intervals [default: bars]
    #[arg(long, value_enum, value_name = "FORM", hide_short_help = true)]
    intervals: Option<Intervals>,
    /// TOML file with width, height, font_size, line_width, marker_size, colours, markers, legend,
    /// intervals, dpi
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    style: Option<PathBuf>,
}

/// A figure and its file.
pub(super) struct FigureRequest<'a> {
    path: &'a Path,
    drawing: Drawing,
    format: Format,
    cases: &'a [String],
}

impl FigureArguments {
    /// The requested figure, if any.
    pub(super) fn asked(&self) -> Result<Option<FigureRequest<'_>>, Error> {
        let Some(path) = &self.figure else {
            return Ok(None);
        };
        let refuse = |argument, message: &str| {
            Err(Error::Argument {
                argument,
                message: message.into(),
            })
        };
        if self.drawing.quantity.is_some() && self.drawing.kind != Kind::Viscosity {
            return refuse(
                "--quantity",
                "it selects a viscosity, so only --kind viscosity has it",
            );
        }
        for (argument, axis) in [("--x", self.drawing.x), ("--y", self.drawing.y)] {
            if axis.is_some() && self.drawing.kind != Kind::StateDiagram {
                return refuse(
                    argument,
                    "only --kind state-diagram has it; others have --along",
                );
            }
        }
        if self.drawing.along.is_some() && self.drawing.kind == Kind::StateDiagram {
            return refuse("--along", "a state diagram has --x and --y");
        }
        if !self.choices.case.is_empty() && self.drawing.kind != Kind::Trace {
            return refuse(
                "--case",
                "it names runs in time, so only --kind trace has it",
            );
        }
        Ok(Some(FigureRequest {
            path,
            format: format_of("--figure", path)?,
            cases: &self.choices.case,
            drawing: Drawing {
                look: self.look()?,
                ..self.drawing.clone()
            },
        }))
    }

    /// Its style.
    fn look(&self) -> Result<Look, Error> {
        let mut style = match &self.choices.style {
            None => Style::default(),
            Some(path) => {
                let text = files::read_text(path, STYLE_LIMIT).map_err(|source| Error::Read {
                    path: path.clone(),
                    source,
                })?;
                Style::read(&text)?
            }
        };
        style.legend = self.choices.legend.unwrap_or(style.legend);
        style.intervals = self.choices.intervals.unwrap_or(style.intervals);
        let look = Look {
            style,
            ..self.drawing.look.clone()
        };
        Ok(look.with_sizes(self.choices.width, self.choices.font_size)?)
    }
}

/// Several stores in one figure; the first is open already.
pub(super) struct Sources<'a> {
    pub(super) first: (&'a Store, &'a Report),
    pub(super) more: &'a [PathBuf],
    pub(super) selection: &'a Selection,
    pub(super) units: Units,
}

/// Draws a figure into its file.
pub(super) fn write(
    asked: &FigureRequest<'_>,
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
