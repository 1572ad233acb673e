//! `sweep export`.

use super::Output;
use super::place::StoreArguments;
use crate::cli::Error;
use crate::exit;
use crate::files::write_whole;
use crate::store::StoredFrame;
use crate::trajectory::{
    CONTACT_HEADER, SPHERE_HEADER, write_contacts, write_extxyz, write_spheres,
};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Write the kept frames of one run, for OVITO or as tables
///
/// Frames are kept by `sweep run --trajectory`. Extended XYZ has one frame per sampled strain with the sheared cell, radii,
/// orientations (quaternions), stresslets and contact counts; its contacts go to a table beside it.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep export results/quickstart.sqlite 1 --out layer.xyz\n  sweep export results/quickstart.sqlite 3f9a --format csv --out layer.csv"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// The run: the beginning of its key, or its number in the campaign file, from 1
    case: String,
    /// Form of the spheres
    #[arg(long, value_enum, default_value_t = Form::Extxyz)]
    format: Form,
    /// File of the spheres, contacts go to NAME.contacts.csv beside it; without it the spheres go to standard output
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Every so many kept frames
    #[arg(long, value_name = "N", default_value = "1")]
    every: std::num::NonZeroUsize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Form {
    /// Extended XYZ, as OVITO and `ASE` read it.
    Extxyz,
    /// A table with a row per sphere and strain.
    Csv,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let store = arguments.place.open(output)?;
    let key = store.key_of(&arguments.case)?;
    let frames = store.frames(&key, arguments.every.get())?;
    match arguments
        .out
        .as_deref()
        .filter(|path| path.as_os_str() != "-")
    {
        None => spheres(&frames, arguments.format, output.out)?,
        Some(path) => {
            to_file(path, |out| spheres(&frames, arguments.format, out))?;
            to_file(&path.with_extension("contacts.csv"), |out| {
                writeln!(out, "{CONTACT_HEADER}")?;
                frames
                    .iter()
                    .try_for_each(|kept| write_contacts(kept.step, &kept.frame, out))
            })?;
            if output.json {
                output.json(&serde_json::json!({"key": key, "frames": frames.len()}))?;
            } else {
                writeln!(output.out, "{} frames of case {}", frames.len(), key)?;
            }
        }
    }
    Ok(exit::DONE)
}

/// Writes the spheres of all frames.
fn spheres(frames: &[StoredFrame], form: Form, out: &mut dyn Write) -> std::io::Result<()> {
    if form == Form::Csv {
        writeln!(out, "{SPHERE_HEADER}")?;
    }
    frames.iter().try_for_each(|kept| match form {
        Form::Extxyz => write_extxyz(&kept.frame, out),
        Form::Csv => write_spheres(kept.step, &kept.frame, out),
    })
}

fn to_file(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), Error> {
    write_whole(path, |file| {
        let mut out = std::io::BufWriter::new(file);
        write(&mut out)?;
        out.flush()
    })
    .map_err(|source| Error::Write {
        path: path.to_owned(),
        source,
    })
}
