//! The files that options name: checked before anything is computed, replaced only as a whole, and
//! never written over a store, a campaign file or the input of the command.

use super::Output;
use crate::data::{self, DataColumn, write_parquet};
use crate::error::Error;
use crate::report::ReportError;
use crate::system::files::{reason_to_stay, write_whole};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Checks the files of a command that reads `inputs`, each with the option that names it.
///
/// # Errors
/// [`Error::Argument`] on standard output beside `--json`, on a file that must stay, and on one
/// that an earlier option writes.
pub(crate) fn check_outputs(
    files: &[(&'static str, &Option<PathBuf>)],
    inputs: &[&Path],
    output: &Output<'_>,
) -> Result<(), Error> {
    for (at, (argument, path)) in files.iter().enumerate() {
        let Some(path) = path else { continue };
        let message = if path.as_os_str() != "-" {
            let is_input = inputs.iter().any(|input| is_same_file(input, path));
            let input = is_input.then(|| "it is what this command reads".to_owned());
            let earlier = files[..at].iter().find(|(_, other)| {
                let other = other.as_ref();
                other.is_some_and(|other| {
                    other == path || other.with_extension("units.csv") == *path
                })
            });
            let twice = earlier.map(|(other, _)| format!("{other} writes it"));
            match input.or(twice).or_else(|| reason_to_stay(path)) {
                Some(reason) => {
                    format!(
                        "{} is not written: {reason}; name another file",
                        path.display()
                    )
                }
                None => continue,
            }
        } else if output.json {
            "--json writes its object to standard output: name a file here".into()
        } else {
            continue;
        };
        return Err(Error::Argument { argument, message });
    }
    Ok(())
}

/// Checks the name of a picture.
///
/// # Errors
/// [`Error::Argument`] on another ending than that of SVG.
pub(crate) fn check_picture(argument: &'static str, path: Option<&PathBuf>) -> Result<(), Error> {
    let is_svg = |path: &PathBuf| {
        let ending = path.extension();
        path.as_os_str() == "-" || ending.is_some_and(|ending| ending.eq_ignore_ascii_case("svg"))
    };
    match path.filter(|path| !is_svg(path)) {
        None => Ok(()),
        Some(path) => Err(Error::Argument {
            argument,
            message: format!(
                "a name that ends with .svg, not {}; rsvg-convert, Inkscape or `Store.plot` of Python make PDF and PNG",
                path.display()
            ),
        }),
    }
}

/// Whether two paths lead to one file.
fn is_same_file(a: &Path, b: &Path) -> bool {
    let identity = |path| std::fs::metadata(path).map(|file| (file.dev(), file.ino()));
    identity(a).is_ok_and(|a| identity(b).is_ok_and(|b| a == b))
}

/// Writes a file by a function, under a temporary name until it is complete.
pub(crate) fn write_file(
    path: &Path,
    output: &Output<'_>,
    write: impl FnOnce(&mut (dyn Write + Send)) -> Result<(), Error>,
) -> Result<(), Error> {
    let refused = |source| Error::Write {
        path: path.to_owned(),
        source,
    };
    // The files that accompany one named by an option, such as units, come here without a check.
    if let Some(reason) = reason_to_stay(path) {
        return Err(refused(io::Error::other(reason)));
    }
    let mut failed = None;
    let written = write_whole(path, |file| {
        let mut out = BufWriter::new(file);
        match write(&mut out) {
            Ok(()) => out.flush(),
            Err(error) => {
                failed = Some(error);
                Err(io::ErrorKind::Other.into())
            }
        }
    });
    match (failed, written) {
        (Some(Error::Output(source) | Error::Report(ReportError::Output(source))), _)
        | (None, Err(source)) => Err(refused(source)),
        (Some(error), _) => Err(error),
        (None, Ok(())) => {
            output.note(&format!("wrote {}", path.display()));
            Ok(())
        }
    }
}

/// Writes a file, or to standard output for `-`.
pub(crate) fn save(path: &Path, bytes: &[u8], output: &mut Output<'_>) -> Result<(), Error> {
    if path.as_os_str() == "-" {
        return Ok(output.out.raw().write_all(bytes)?);
    }
    write_file(path, output, |out| Ok(out.write_all(bytes)?))
}

/// Writes a table into its file, as CSV with its units beside it or as Parquet; `names`: of the
/// table and of its campaign.
pub(crate) fn save_table(
    table: &[DataColumn],
    names: [&str; 2],
    path: &Path,
    is_parquet: bool,
    output: &mut Output<'_>,
) -> Result<(), Error> {
    let mut bytes = Vec::new();
    if is_parquet {
        write_parquet(table, names[0], names[1], &mut bytes)?;
    } else {
        data::write_csv(table, &mut bytes)?;
    }
    save(path, &bytes, output)?;
    if !is_parquet && path.as_os_str() != "-" {
        bytes.clear();
        data::write_units(table, &mut bytes)?;
        save(&path.with_extension("units.csv"), &bytes, output)?;
    }
    Ok(())
}
