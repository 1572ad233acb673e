//! `sweep report`.

use super::Output;
use super::place::StoreArguments;
use crate::axes::{AXES, Axis};
use crate::cli::Error;
use crate::exit;
use crate::files::write_whole;
use crate::report::{
    Columns, Drawing, Format, Kind, PageHost, Quantity, Report, Selection, draw, page, parquet,
    traces, write_csv, write_json, write_markdown, write_text, write_units,
};
use crate::store::Store;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Print the results of a campaign, averaged over seeds
///
/// Reads only, and may be used while the campaign runs. Without one of the files below, a table is printed.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep report results/quickstart.sqlite\n  sweep report sweeps/quickstart.toml --json\n  \
                  sweep report sweeps/quickstart.toml --csv curves.csv --figure curves.svg --page curves.html\n  \
                  sweep report sweeps/quickstart.toml --where shear_rate=0.1,inf --markdown -\n  \
                  sweep report sweeps/quickstart.toml --columns viscosity,n1,n2,particle_pressure,shear_tangential_contact\n  \
                  sweep report results/figure-11.sqlite --figure contacts.png --kind contacts --where shear_rate=inf\n  \
                  sweep report results/figure-15.sqlite --figure dense.svg --quantity viscosity_median --where area_fraction=0.8\n\n\
                  The store is a SQLite file with two views for other programs, `viscosity_vs_shear_rate` (a row per point) and\n\
                  `runs` (a row per run): sqlite3 -header results/quickstart.sqlite 'SELECT * FROM viscosity_vs_shear_rate'"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Only points with one of these values on an axis, by its key in the campaign file; of every output; may be repeated
    #[arg(long = "where", value_name = "KEY=VALUE[,VALUE..]")]
    selection: Vec<String>,
    /// Only these columns besides the axes, in tables of every kind; names are those of the CSV file
    #[arg(long, value_name = "NAME[,NAME..]", value_delimiter = ',')]
    columns: Vec<String>,
    /// Average runs with doubtful numbers too; they are counted in any case
    #[arg(long)]
    with_doubtful: bool,
    /// Write a tidy table, one row per point, `-` for standard output; units go to FILE.units.csv beside it
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the same table as Parquet, with units in its metadata
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// Write a Markdown table, `-` for standard output
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Draw a figure of column width, as FILE.svg or FILE.png
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    /// Write one self-contained page with interactive curves, traces and movies
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
    /// What the figure shows
    #[arg(long, value_enum, default_value_t, requires = "figure")]
    kind: Kind,
    /// Which viscosity the figure shows [default: viscosity]
    #[arg(long, value_enum, requires = "figure")]
    quantity: Option<Quantity>,
    /// The figure's horizontal axis [default: the shear rate where it varies; for contacts the friction]
    #[arg(long, value_name = "AXIS", value_parser = numeric_axis(), requires = "figure")]
    along: Option<&'static Axis>,
    /// Runs of a trace, by the beginning of their key [default: the first run of each point]
    #[arg(long, value_name = "KEY", requires = "figure")]
    case: Vec<String>,
}

/// Reads the name of an axis that a figure can run along, as the campaign file has it.
fn numeric_axis() -> impl TypedValueParser<Value = &'static Axis> {
    let names = AXES
        .iter()
        .filter(|axis| axis.is_numeric())
        .map(|axis| PossibleValue::new(axis.key));
    PossibleValuesParser::new(names)
        .try_map(|name| Axis::of_key(&name).ok_or("no axis of a campaign"))
}

/// Writes the report.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let drawing = drawing(arguments)?;
    let selection = Selection::parse(&arguments.selection)?.with_doubtful(arguments.with_doubtful);
    let columns = Columns::named(&arguments.columns)?;
    refuse_two_answers(arguments, output)?;
    let store = arguments.place.open(output)?;
    let report = Report {
        columns,
        ..Report::of(&store, &selection)?
    };
    let mut files = false;
    if let (Some(path), Some((drawing, format))) = (&arguments.figure, drawing) {
        let traces = match drawing.kind {
            Kind::Trace => traces(&store, &selection, &arguments.case)?,
            _ => Vec::new(),
        };
        save(path, &draw(&report, &traces, drawing, format)?, output)?;
        files = true;
    }
    if let Some(path) = &arguments.csv {
        let mut bytes = Vec::new();
        write_csv(&report, &mut bytes)?;
        save(path, &bytes, output)?;
        if path.as_os_str() != "-" {
            bytes.clear();
            write_units(&report, &mut bytes)?;
            save(&path.with_extension("units.csv"), &bytes, output)?;
        }
        files = true;
    }
    if let Some(path) = &arguments.parquet {
        save(path, &parquet(&report)?, output)?;
        files = true;
    }
    if let Some(path) = &arguments.markdown {
        let mut bytes = Vec::new();
        write_markdown(&report, &mut bytes)?;
        save(path, &bytes, output)?;
        files = true;
    }
    if let Some(path) = &arguments.page {
        let page = page(&store, &selection, PageHost::File)?;
        save(path, page.as_bytes(), output)?;
        files = true;
    }
    if !files || output.json {
        print(&report, output)?;
    }
    Ok(exit::DONE)
}

/// Refuses a file on standard output where the JSON object goes.
fn refuse_two_answers(arguments: &Arguments, output: &Output<'_>) -> Result<(), Error> {
    let files = [
        ("--csv", &arguments.csv),
        ("--parquet", &arguments.parquet),
        ("--markdown", &arguments.markdown),
        ("--figure", &arguments.figure),
        ("--page", &arguments.page),
    ];
    let is_standard_output = |path: &PathBuf| path.as_os_str() == "-";
    match files
        .into_iter()
        .find(|(_, path)| path.as_ref().is_some_and(is_standard_output))
    {
        Some((argument, _)) if output.json => Err(Error::Argument {
            argument,
            message: "--json writes its object to standard output: name a file here".into(),
        }),
        _ => Ok(()),
    }
}

/// The figure asked for, if one is.
fn drawing(arguments: &Arguments) -> Result<Option<(Drawing, Format)>, Error> {
    let Some(path) = &arguments.figure else {
        return Ok(None);
    };
    let refuse = |argument, message: &str| {
        Err(Error::Argument {
            argument,
            message: message.into(),
        })
    };
    if arguments.quantity.is_some() && arguments.kind != Kind::Viscosity {
        return refuse(
            "--quantity",
            "it chooses a viscosity, so only --kind viscosity has it",
        );
    }
    if !arguments.case.is_empty() && arguments.kind != Kind::Trace {
        return refuse(
            "--case",
            "it names runs in time, so only --kind trace has it",
        );
    }
    let drawing = Drawing {
        kind: arguments.kind,
        quantity: arguments.quantity.unwrap_or_default(),
        along: arguments.along,
    };
    Ok(Some((drawing, format_of(path)?)))
}

/// The format a figure's file name asks for.
pub(super) fn format_of(path: &Path) -> Result<Format, Error> {
    let extension = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
    match extension.as_deref().and_then(|e| e.to_str()) {
        Some("svg") => Ok(Format::Svg),
        Some("png") => Ok(Format::Png),
        _ => Err(Error::Argument {
            argument: "--figure",
            message: format!("a name that ends with .svg or .png, not {}", path.display()),
        }),
    }
}

/// Writes a file, or to standard output for `-`.
pub(super) fn save(path: &Path, bytes: &[u8], output: &mut Output<'_>) -> Result<(), Error> {
    if path.as_os_str() == "-" {
        return Ok(output.out.raw().write_all(bytes)?);
    }
    write_whole(path, |file| file.write_all(bytes)).map_err(|source| Error::Write {
        path: path.to_owned(),
        source,
    })
}

/// Writes the report of an open store.
pub(super) fn write(store: &Store, output: &mut Output<'_>) -> Result<(), Error> {
    print(&Report::of(store, &Selection::default())?, output)
}

/// Writes a report as a table or as JSON.
fn print(report: &Report, output: &mut Output<'_>) -> Result<(), Error> {
    if output.json {
        write_json(report, output.out)?;
    } else {
        write_text(report, output.width, output.out)?;
    }
    Ok(())
}
