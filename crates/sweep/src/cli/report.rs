//! `sweep report`.

pub(crate) mod figure;
mod one_by_one;

use super::Output;
use super::output_file::{check_outputs, save, save_table};
use super::place::StoreArguments;
use super::tables::TableArguments;
use crate::error::Error;
use crate::report::{
    Columns, Excerpt, PageHost, Report, Selection, Shape, Units, page, point_table, write_json,
    write_text,
};
use crate::store::Store;
use crate::system::exit;
use crate::text::format::wrapped;
use figure::FigureArguments;
use std::path::PathBuf;

/// Print the results of a campaign, averaged over seeds
///
/// Reads only; works while the campaign runs. Prints a table unless one of the files below is
/// given.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep report sweeps/quickstart.toml --csv curves.csv --figure curves.svg --page curves.html\n  \
                  sweep report sweeps/quickstart.toml --where shear_rate=0.1,inf --columns viscosity,n1,n2\n\n\
                  All options and more examples: sweep report --help",
    after_long_help = "Examples:\n  sweep report results/quickstart.sqlite\n  sweep report sweeps/quickstart.toml --json\n  \
                  sweep report sweeps/quickstart.toml --csv curves.csv --figure curves.svg --page curves.html\n  \
                  sweep report sweeps/quickstart.toml --where shear_rate=0.1,inf --csv -\n  \
                  sweep report sweeps/quickstart.toml --columns viscosity,n1,n2,particle_pressure,shear_tangential_contact\n  \
                  sweep report results/figure-11.sqlite --figure contacts.svg --kind contacts --where shear_rate=inf\n  \
                  sweep report results/figure-14.sqlite --figure panels.svg --panels area_fraction\n  \
                  sweep report sweeps/quickstart.toml --runs runs.parquet --samples samples.csv\n  \
                  sweep report sweeps/quickstart.toml --units a=1um,mu=1mPas,f_crit=10pN --format si\n  \
                  sweep report results/figure-14.sqlite --figure dense.svg --quantity viscosity_median --where area_fraction=0.8\n\n\
                  The store is a SQLite file with a view for other programs, `runs` (a row per run):\n\
                  sqlite3 -header results/quickstart.sqlite 'SELECT * FROM runs'"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Only points with one of these values on an axis, named by its key in the campaign file;
    /// repeatable
    #[arg(
        long = "where",
        value_name = "KEY=VALUE[,VALUE..]",
        help_heading = "Points"
    )]
    selection: Vec<String>,
    /// Average this segment of the runs, counted from 1 [default: the last]
    #[arg(
        long,
        value_name = "NUMBER",
        help_heading = "Points",
        hide_short_help = true
    )]
    segment: Option<usize>,
    /// Include runs with doubtful numbers in averages; they are counted in any case
    #[arg(long, help_heading = "Points", hide_short_help = true)]
    with_doubtful: bool,
    #[command(flatten)]
    files: Files,
    /// Physical units for tables, figures and the page: radius a, viscosity mu and optionally the
    /// critical load f_crit, as in a=1um,mu=1mPas,f_crit=10pN
    #[arg(
        long,
        value_name = "A,MU,F_CRIT",
        help_heading = "Points",
        hide_short_help = true
    )]
    units: Option<String>,
    #[command(flatten)]
    tables: TableArguments,
    #[command(flatten)]
    drawn: FigureArguments,
}

/// Output files.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Files")]
struct Files {
    /// Write a tidy table, one row per point, `-` for standard output; units go to FILE.units.csv
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the same table as Parquet, with units in its metadata
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    parquet: Option<PathBuf>,
    /// Write one row per run: FILE.csv or FILE.parquet, with units as for points
    #[arg(long, value_name = "FILE")]
    runs: Option<PathBuf>,
    /// Write one row per sample of every run: FILE.csv or FILE.parquet
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    samples: Option<PathBuf>,
    /// Write one self-contained page with figures, runs in time and movies
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
}

/// Writes the report.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let asked = arguments.drawn.request()?;
    let one_by_one = one_by_one::asked(
        arguments.files.runs.as_deref(),
        arguments.files.samples.as_deref(),
    )?;
    let selection = Selection::parse(&arguments.selection)?.with_doubtful(arguments.with_doubtful);
    let columns = Columns::named(&arguments.tables.columns)?;
    let units = match &arguments.units {
        Some(text) => Units::parse(text)?,
        None => Units::default(),
    };
    let files = [
        ("--csv", &arguments.files.csv),
        ("--parquet", &arguments.files.parquet),
        ("--runs", &arguments.files.runs),
        ("--samples", &arguments.files.samples),
        ("--figure", &arguments.drawn.figure),
        ("--page", &arguments.files.page),
    ];
    let inputs: Vec<_> = arguments.place.files().collect();
    check_outputs(&files, &inputs, output)?;
    let store = arguments.place.open_segment(arguments.segment, output)?;
    let report = Report {
        columns,
        units,
        ..Report::of(&store, &selection)?
    };
    let mut files = false;
    if let Some(asked) = &asked {
        figure::write(asked, &store, &report, output)?;
        files = true;
    }
    let shape = arguments.tables.shape();
    let campaign = report.campaign.as_str();
    for (path, is_parquet) in [
        (&arguments.files.csv, false),
        (&arguments.files.parquet, true),
    ] {
        if let Some(path) = path {
            save_table(
                &point_table(&report),
                ["points", campaign],
                path,
                is_parquet,
                output,
            )?;
            files = true;
        }
    }
    let excerpt = Excerpt {
        store: &store,
        selection: &selection,
        units,
    };
    for (rows, path, format) in &one_by_one {
        one_by_one::write(*rows, path, *format, excerpt, output)?;
        files = true;
    }
    if let Some(path) = &arguments.files.page {
        let page = page(excerpt, PageHost::File)?;
        save(path, page.as_bytes(), output)?;
        files = true;
    }
    if !files || output.json {
        print(&report, shape, output)?;
    }
    Ok(exit::DONE)
}

/// Writes the report of an open store.
pub(super) fn write(store: &Store, output: &mut Output<'_>) -> Result<(), Error> {
    print(
        &Report::of(store, &Selection::default())?,
        Shape::default(),
        output,
    )
}

/// Writes a report as a table or as JSON.
fn print(report: &Report, shape: Shape, output: &mut Output<'_>) -> Result<(), Error> {
    if output.json {
        write_json(report, output.out)?;
    } else {
        let mut text = Vec::new();
        write_text(report, shape, output.width, &mut text)?;
        let text = String::from_utf8_lossy(&text);
        output
            .out
            .write_all(wrapped(&text, output.width).as_bytes())?;
    }
    Ok(())
}
