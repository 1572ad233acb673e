//! `sweep report`.

use super::{Output, store_path};
use crate::error::Error;
use crate::exit;
use crate::report::{
    Abscissa, Format, Home, Kind, Report, draw, page, traces, write_csv, write_json,
    write_markdown, write_text, write_units,
};
use crate::store::Store;
use std::path::{Path, PathBuf};

/// Print the results of a campaign, averaged over seeds
///
/// Reads only, and may be used while the campaign runs. Without one of the files below, a table is printed.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep report results/quickstart.sqlite\n  sweep report sweeps/quickstart.toml --json\n  \
                  sweep report sweeps/quickstart.toml --csv curves.csv --figure curves.svg --page curves.html\n  \
                  sweep report results/friction.sqlite --figure contacts.png --kind contacts --along friction\n\n\
                  The store is a SQLite file with two views for other programs, `viscosity_vs_shear_rate` (a row per point) and\n\
                  `runs` (a row per run): sqlite3 -header results/quickstart.sqlite 'SELECT * FROM viscosity_vs_shear_rate'"
)]
pub(crate) struct Arguments {
    /// The store, or a campaign file whose default store is meant
    store: PathBuf,
    /// Write a tidy table, one row per point, `-` for standard output; units go to FILE.units.csv beside it
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
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
    #[arg(long, value_enum, default_value_t = Kind::Viscosity, requires = "figure")]
    kind: Kind,
    /// The figure's horizontal axis [default: the shear rate where it varies; for contacts the friction]
    #[arg(long, value_enum, value_name = "AXIS", requires = "figure")]
    along: Option<Abscissa>,
    /// Runs of a trace, by the beginning of their key [default: the first run of each point]
    #[arg(long, value_name = "KEY", requires = "figure")]
    case: Vec<String>,
}

/// Writes the report.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let format = arguments.figure.as_deref().map(format_of).transpose()?;
    let store = Store::open_read_only(&store_path(&arguments.store)?)?;
    let report = Report::of(&store)?;
    let mut files = false;
    if let (Some(path), Some(format)) = (&arguments.figure, format) {
        let traces = match arguments.kind {
            Kind::Trace => traces(&store, &arguments.case)?,
            _ => Vec::new(),
        };
        let drawn = draw(&report, &traces, arguments.kind, arguments.along, format)?;
        save(path, &drawn, output)?;
        files = true;
    }
    if let Some(path) = &arguments.csv {
        let mut bytes = Vec::new();
        write_csv(&report, &mut bytes)?;
        save(path, &bytes, output)?;
        if path.as_os_str() != "-" {
            bytes.clear();
            write_units(&mut bytes)?;
            save(&path.with_extension("units.csv"), &bytes, output)?;
        }
        files = true;
    }
    if let Some(path) = &arguments.markdown {
        let mut bytes = Vec::new();
        write_markdown(&report, &mut bytes)?;
        save(path, &bytes, output)?;
        files = true;
    }
    if let Some(path) = &arguments.page {
        save(path, page(&store, Home::File)?.as_bytes(), output)?;
        files = true;
    }
    if !files {
        print(&report, output)?;
    }
    Ok(exit::DONE)
}

/// The format a figure's file name asks for.
fn format_of(path: &Path) -> Result<Format, Error> {
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
        return Ok(output.out.write_all(bytes)?);
    }
    std::fs::write(path, bytes).map_err(|source| Error::Write {
        path: path.to_owned(),
        source,
    })
}

/// Writes the report of an open store.
pub(super) fn write(store: &Store, output: &mut Output<'_>) -> Result<(), Error> {
    print(&Report::of(store)?, output)
}

/// Writes a report as a table or as JSON.
fn print(report: &Report, output: &mut Output<'_>) -> Result<(), Error> {
    if output.json {
        write_json(report, output.out)
    } else {
        write_text(report, output.width, output.out)
    }
}
