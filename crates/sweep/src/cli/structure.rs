//! `sweep structure`.

use super::Output;
use super::output_file::{check_outputs, check_picture, save, save_table};
use super::place::StoreArguments;
use super::words::choice_beside;
use crate::error::Error;
use crate::report::{Kind, Selection, Shape, StructureKind, StructureReport};
use crate::system::exit;
use crate::text::format::wrapped;
use std::path::PathBuf;

/// Print structure: contacts, clusters, percolation, rigid clusters, fabric
///
/// Averages over the frames that `sweep run --trajectory` keeps after the discarded strain, and
/// over runs, with 95 % intervals. docs/structure.md defines the numbers. Reads only.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep run sweeps/quickstart.toml --trajectory\n  sweep structure sweeps/quickstart.toml\n  sweep structure results/quickstart.sqlite 3\n  \
                  sweep structure sweeps/quickstart.toml --where shear_rate=inf --curves curves.csv --csv numbers.csv\n  \
                  sweep structure sweeps/quickstart.toml --figure angles.svg --kind contact-angle\n  \
                  sweep structure sweeps/quickstart.toml --json"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// A single run: the beginning of its key, or its number in the campaign file, from 1 [default:
    /// all finished runs]
    case: Option<String>,
    /// Only points with one of these values on an axis, or in a range; repeatable
    #[arg(long = "where", value_name = "KEY=VALUE[,VALUE..]")]
    selection: Vec<String>,
    /// Print all default columns, not only as many as fit
    #[arg(long)]
    wide: bool,
    /// Write all numbers, one row per point: FILE.csv
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write these numbers as Parquet
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// Write all curves, one row per bin: FILE.csv or FILE.parquet
    #[arg(long, value_name = "FILE")]
    curves: Option<PathBuf>,
    /// Draw one of the curves of every point: FILE.svg
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    /// Curve of the figure
    #[arg(long, value_parser = choice_beside::<StructureKind, Kind>("report"), default_value = "pair-distribution", requires = "figure")]
    kind: StructureKind,
}

/// Writes the structure.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let selection = Selection::parse(&arguments.selection)?;
    let files = [
        ("--csv", &arguments.csv),
        ("--parquet", &arguments.parquet),
        ("--curves", &arguments.curves),
        ("--figure", &arguments.figure),
    ];
    let inputs: Vec<_> = arguments.place.files().collect();
    check_outputs(&files, &inputs, output)?;
    check_picture("--figure", arguments.figure.as_ref())?;
    let store = arguments.place.open(output)?;
    let report = StructureReport::of(&store, &selection, arguments.case.as_deref())?;
    if let Some(note) = report.note() {
        output.note(&note);
    }
    let name = store.campaign_name()?;
    let names = ["structure", &name];
    if let Some(path) = &arguments.csv {
        save_table(&report.table(), names, path, false, output)?;
    }
    if let Some(path) = &arguments.parquet {
        save_table(&report.table(), names, path, true, output)?;
    }
    if let Some(path) = &arguments.curves {
        let is_parquet = path.extension().is_some_and(|ending| ending == "parquet");
        save_table(&report.curves(), names, path, is_parquet, output)?;
    }
    if let Some(path) = &arguments.figure {
        save(path, report.draw(arguments.kind)?.as_bytes(), output)?;
    }
    if output.json {
        output.json(&report.json())?;
    } else if files.iter().all(|(_, path)| path.is_none()) {
        let shape = Shape {
            wide: arguments.wide,
            ..Shape::default()
        };
        let sheet = report.sheet(shape, output.width);
        let mut lines = vec![report.summary(), sheet.text(output.width)];
        if sheet.is_cut {
            lines.push("more columns: --wide; all of them: --csv FILE".into());
        }
        lines.push(
            "fractions of spheres, of percolating instants, of contacts; mean over runs ± half the 95 % Student interval"
                .into(),
        );
        let text = wrapped(&lines.join("\n"), output.width);
        writeln!(output.out, "{}", text.trim_end())?;
    }
    Ok(exit::DONE)
}
