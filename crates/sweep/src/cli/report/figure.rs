//! The arguments of figures.

use crate::cli::Output;
use crate::cli::output_file::{check_picture, save};
use crate::cli::words::{axis_among, choice_beside};
use crate::error::Error;
use crate::model::axes::Axis;
use crate::report::{
    Against, Drawing, Kind, Reference, Report, StructureKind, draw, number, traces,
};
use crate::store::Store;
use std::path::{Path, PathBuf};

/// The figure.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Figures")]
pub(crate) struct FigureArguments {
    /// Draw a figure: FILE.svg
    #[arg(long, value_name = "FILE")]
    pub(super) figure: Option<PathBuf>,
    /// Kind of the figure
    #[arg(long, value_parser = choice_beside::<Kind, StructureKind>("structure"), default_value = "curve", requires = "figure")]
    kind: Kind,
    /// Number of the curve: any column of points [default: viscosity]
    #[arg(long, value_name = "NAME", requires = "figure")]
    quantity: Option<String>,
    /// Horizontal axis, by its key in the campaign file or its symbol [default: the shear rate
    /// where it varies; for contacts the friction]
    #[arg(long, value_name = "AXIS", value_parser = axis_among(Axis::is_numeric), requires = "figure", hide_possible_values = true)]
    along: Option<&'static Axis>,
    /// Column of points on the horizontal axis, in place of that along which curves run
    #[arg(long, value_name = "NAME", requires = "figure", hide_short_help = true)]
    against: Option<String>,
    /// Fraction from which the horizontal axis shows the distance
    #[arg(
        long,
        value_name = "FRACTION",
        requires = "figure",
        value_parser = fraction,
        conflicts_with = "against",
        hide_short_help = true
    )]
    jamming: Option<f64>,
    /// Draw a published curve too, such as boyer2011, zarraga2000, mari2014; repeatable
    #[arg(long, value_name = "NAME", requires = "figure", hide_short_help = true)]
    reference: Vec<String>,
    /// Horizontal axis of a state diagram [default: area_fraction, or volume_fraction of
    /// suspensions]
    #[arg(long, value_name = "AXIS", value_parser = axis_among(Axis::is_numeric), requires = "figure", hide_possible_values = true, hide_short_help = true)]
    x: Option<&'static Axis>,
    /// Vertical axis of a state diagram: shear_stress or shear_rate [default: what is imposed]
    #[arg(long, value_name = "AXIS", value_parser = axis_among(Axis::is_of_shear), requires = "figure", hide_possible_values = true, hide_short_help = true)]
    y: Option<&'static Axis>,
    /// One panel for every value of this axis
    #[arg(long, value_name = "AXIS", value_parser = axis_among(|_| true), requires = "figure", hide_possible_values = true)]
    panels: Option<&'static Axis>,
    /// Runs of a trace, by number in the campaign file or beginning of the key [default: the mean
    /// over the finished runs of each point]
    #[arg(long, value_name = "KEY", requires = "figure", hide_short_help = true)]
    case: Vec<String>,
}

/// A figure and its file.
pub(super) struct FigureRequest<'a> {
    path: &'a Path,
    drawing: Drawing,
    cases: &'a [String],
}

/// An area or volume fraction.
fn fraction(text: &str) -> Result<f64, String> {
    let fraction = text.parse().ok().filter(|x: &f64| *x > 0.0 && *x < 1.0);
    fraction.ok_or_else(|| "write a fraction above 0 and below 1".into())
}

impl FigureArguments {
    /// The requested figure, if any.
    pub(super) fn request(&self) -> Result<Option<FigureRequest<'_>>, Error> {
        check_picture("--figure", self.figure.as_ref())?;
        let Some(path) = &self.figure else {
            return Ok(None);
        };
        let (kind, is_diagram) = (self.kind, self.kind == Kind::StateDiagram);
        for (argument, is_wrong, message) in [
            (
                "--quantity",
                self.quantity.is_some() && kind != Kind::Curve,
                "it names a column of points, so only --kind curve has it",
            ),
            (
                "--x",
                self.x.is_some() && !is_diagram,
                "only --kind state-diagram has it; others have --along",
            ),
            (
                "--y",
                self.y.is_some() && !is_diagram,
                "only --kind state-diagram has it; others have --along",
            ),
            (
                "--along",
                self.along.is_some() && is_diagram,
                "a state diagram has --x and --y",
            ),
            (
                "--against",
                self.against.is_some() && kind != Kind::Curve,
                "only --kind curve has it",
            ),
            (
                "--jamming",
                self.jamming.is_some() && !matches!(kind, Kind::Curve | Kind::Divergence),
                "only the kinds curve and divergence have it",
            ),
            (
                "--kind",
                self.jamming.is_none() && kind == Kind::Divergence,
                "the distance from jamming needs the fraction of jamming (--jamming)",
            ),
            (
                "--case",
                !self.case.is_empty() && !kind.is_in_time(),
                "it names runs in time, so only figures of these have it",
            ),
        ] {
            if is_wrong {
                let message = message.into();
                return Err(Error::Argument { argument, message });
            }
        }
        Ok(Some(FigureRequest {
            path,
            cases: &self.case,
            drawing: Drawing {
                kind,
                number: self
                    .quantity
                    .as_deref()
                    .map(|name| number("quantity", name))
                    .transpose()?,
                along: self.along,
                against: match (&self.against, self.jamming) {
                    (Some(name), _) => Some(Against::Number(number("against", name)?)),
                    (None, jamming) => jamming.map(Against::Below),
                },
                references: self
                    .reference
                    .iter()
                    .map(|name| Reference::named(name))
                    .collect::<Result<_, _>>()?,
                x: self.x,
                y: self.y,
                panels: self.panels,
            },
        }))
    }
}

/// Draws a figure into its file.
pub(super) fn write(
    request: &FigureRequest<'_>,
    store: &Store,
    report: &Report,
    output: &mut Output<'_>,
) -> Result<(), Error> {
    let drawing = &request.drawing;
    let traces = traces(store, &report.selection, request.cases, drawing.kind)?;
    let figure = draw(report, &traces, drawing)?;
    save(request.path, figure.as_bytes(), output)
}
