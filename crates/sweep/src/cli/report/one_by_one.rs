//! Tables with a row for every run, or for every sample.

use crate::cli::Output;
use crate::cli::output_file::{save, write_file};
use crate::data::write_units;
use crate::error::Error;
use crate::report::{Excerpt, TableFormat};
use std::io::Write;
use std::path::Path;

/// The kind of a row.
#[derive(Debug, Clone, Copy)]
pub(super) enum Rows {
    Runs,
    Samples,
}

/// A requested table.
type TableRequest<'a> = (Rows, &'a Path, TableFormat);

/// The requested tables, each with the format of its file name.
pub(super) fn asked<'a>(
    runs: Option<&'a Path>,
    samples: Option<&'a Path>,
) -> Result<Vec<TableRequest<'a>>, Error> {
    let asked = [
        ("--runs", Rows::Runs, runs),
        ("--samples", Rows::Samples, samples),
    ];
    let asked = asked
        .into_iter()
        .filter_map(|(argument, rows, path)| Some((argument, rows, path?)));
    asked
        .map(|(argument, rows, path)| {
            if path.as_os_str() == "-" {
                return Ok((rows, path, TableFormat::Csv));
            }
            let ending = path.extension().and_then(|ending| ending.to_str());
            let format = match ending {
                Some("csv") => Some(TableFormat::Csv),
                Some("parquet") => Some(TableFormat::Parquet),
                _ => None,
            };
            let format = format.ok_or_else(|| Error::Argument {
                argument,
                message: format!(
                    "a name that ends with .csv or .parquet, not {}",
                    path.display()
                ),
            })?;
            Ok((rows, path, format))
        })
        .collect()
}

/// Writes one of them, and the units of a CSV beside it.
pub(super) fn write(
    rows: Rows,
    path: &Path,
    format: TableFormat,
    excerpt: Excerpt<'_>,
    output: &mut Output<'_>,
) -> Result<(), Error> {
    let table = |out: &mut (dyn Write + Send)| match rows {
        Rows::Runs => excerpt.write_runs(format, out),
        Rows::Samples => excerpt.write_samples(format, out),
    };
    if path.as_os_str() == "-" {
        let mut bytes = Vec::new();
        table(&mut bytes)?;
        return save(path, &bytes, output);
    }
    let mut columns = Vec::new();
    write_file(path, output, |out| {
        columns = table(out)?;
        Ok(())
    })?;
    if format == TableFormat::Csv {
        let mut units = Vec::new();
        write_units(&columns, &mut units)?;
        save(&path.with_extension("units.csv"), &units, output)?;
    }
    Ok(())
}
