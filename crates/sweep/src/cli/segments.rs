//! `sweep segments`.

use super::Output;
use super::output_file::{check_outputs, check_picture, save, save_table};
use super::place::StoreArguments;
use crate::error::Error;
use crate::report::{SegmentReport, Selection, Shape, Units};
use crate::system::exit;
use crate::text::format::wrapped;
use std::path::PathBuf;

/// Print results of each segment: averages, stress after a reversal, harmonics of an oscillation
///
/// For campaigns with [[protocol.segment]] tables. Means over runs with 95 % intervals;
/// docs/protocols.md defines the numbers. `sweep report` shows the last segment, or another with
/// `--segment`. Reads only.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep segments reversal.toml\n  sweep segments reversal.toml --where shear_rate=10 --json\n  \
                  sweep segments amplitudes.toml --csv moduli.csv --figure moduli.svg\n  \
                  sweep report reversal.toml --segment 2 --figure recovery.svg --kind trace"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Only points with one of these values on an axis, or in a range; repeatable
    #[arg(long = "where", value_name = "KEY=VALUE[,VALUE..]")]
    selection: Vec<String>,
    /// Print all columns, not only as many as fit
    #[arg(long)]
    wide: bool,
    /// Write all numbers, one row per segment of a point: FILE.csv
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write these numbers as Parquet
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// Physical units of tables, as for `sweep report`: a=1um,mu=1mPas,f_crit=10pN
    #[arg(long, value_name = "A,MU,F_CRIT", conflicts_with = "figure")]
    units: Option<String>,
    /// Draw η′ and η″ against the amplitude of the oscillations: FILE.svg
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
}

/// Writes the segments.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let selection = Selection::parse(&arguments.selection)?;
    let files = [
        ("--csv", &arguments.csv),
        ("--parquet", &arguments.parquet),
        ("--figure", &arguments.figure),
    ];
    let inputs: Vec<_> = arguments.place.files().collect();
    check_outputs(&files, &inputs, output)?;
    check_picture("--figure", arguments.figure.as_ref())?;
    let store = arguments.place.open(output)?;
    let units = match &arguments.units {
        Some(text) => Units::parse(text)?,
        None => Units::default(),
    };
    let report = SegmentReport::of(&store, &selection)?.with_units(units);
    if let Some(path) = &arguments.figure {
        save(path, report.draw()?.as_bytes(), output)?;
    }
    for (path, is_parquet) in [(&arguments.csv, false), (&arguments.parquet, true)] {
        if let Some(path) = path {
            let name = store.campaign_name()?;
            save_table(
                &report.table(),
                ["segments", &name],
                path,
                is_parquet,
                output,
            )?;
        }
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
        lines.push("mean over runs ± half the 95 % Student interval, over the strain given".into());
        let text = wrapped(&lines.join("\n"), output.width);
        writeln!(output.out, "{}", text.trim_end())?;
    }
    Ok(exit::DONE)
}
