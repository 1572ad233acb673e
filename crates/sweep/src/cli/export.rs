//! `sweep export`.

use super::Output;
use super::output_file::{check_outputs, write_file};
use super::place::{StoreArguments, positive};
use crate::data::{write_csv, write_units};
use crate::error::Error;
use crate::model::spaces::AnyFrame;
use crate::store::{Store, StoredFrame};
use crate::system::exit;
use crate::text::format::counted;
use crate::trajectory::{FrameSource, contact_table, sphere_table, write_bonds, write_extxyz};
use std::io::Write;
use std::path::PathBuf;

/// Write the kept frames of one run, for OVITO or as tables
///
/// `sweep run --trajectory` keeps the frames. Extended XYZ has one frame per sampled strain with
/// the sheared cell, the run, species by size (H the smallest radius, He the others), numbers from
/// 0, radii, orientations (quaternions), stresslets, contact counts, velocities, angular velocities
/// and unwrapped positions; contacts go to a table and to a file of bonds that OVITO loads. Units
/// and meanings of tables go to files beside them.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep run sweeps/quickstart.toml --trajectory\n  sweep export results/quickstart.sqlite 1 --out layer.xyz\n  sweep export results/quickstart.sqlite 3f9a --format csv --out layer.csv"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// The run: the beginning of its key, or its number in the campaign file, from 1
    case: String,
    /// Format of the spheres
    #[arg(long, value_enum, default_value_t = Form::Extxyz)]
    format: Form,
    /// File of the spheres; contacts go to NAME.contacts.csv, and with extended XYZ to
    /// NAME.bonds.dump [default: the spheres on standard output]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Export every Nth kept frame
    #[arg(long, value_name = "N", default_value = "1", value_parser = positive)]
    every: std::num::NonZeroUsize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Form {
    /// Extended XYZ, for OVITO and `ASE`.
    Extxyz,
    /// A table with a row per sphere and strain.
    Csv,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let inputs: Vec<_> = arguments.place.files().collect();
    check_outputs(&[("--out", &arguments.out)], &inputs, output)?;
    let store = arguments.place.open(output)?;
    let key = store.key_of(&arguments.case)?;
    let frames = store.frames(&key, arguments.every.get())?;
    let filmed = filmed(&store, &key)?;
    match arguments
        .out
        .as_deref()
        .filter(|path| path.as_os_str() != "-")
    {
        None => spheres(&frames, arguments.format, &filmed, output.out)?,
        Some(path) => {
            write_file(path, output, |out| {
                Ok(spheres(&frames, arguments.format, &filmed, out)?)
            })?;
            if arguments.format == Form::Csv {
                let table = sphere_table(&with_steps(&frames));
                write_file(&path.with_extension("units.csv"), output, |out| {
                    Ok(write_units(&table, out)?)
                })?;
            } else {
                write_file(&path.with_extension("bonds.dump"), output, |out| {
                    Ok(write_bonds(&with_steps(&frames), out)?)
                })?;
            }
            let table = contact_table(&with_steps(&frames));
            write_file(&path.with_extension("contacts.csv"), output, |out| {
                Ok(write_csv(&table, out)?)
            })?;
            write_file(&path.with_extension("contacts.units.csv"), output, |out| {
                Ok(write_units(&table, out)?)
            })?;
            if output.json {
                output.json(&serde_json::json!({"key": key, "frames": frames.len()}))?;
            } else {
                let number = counted(frames.len(), "frame");
                writeln!(output.out, "{number} of case {key}")?;
            }
        }
    }
    Ok(exit::DONE)
}

/// The run with this key.
fn filmed(store: &Store, key: &str) -> Result<FrameSource, Error> {
    let runs = store.point_runs()?;
    let run = runs.into_iter().find(|run| run.key == key);
    let run = run.ok_or_else(|| store.no_case(key, "no case"))?;
    Ok(FrameSource {
        params: (*run.params).clone(),
        seed: run.seed,
        key: run.key,
    })
}

/// Writes the spheres of all frames.
fn spheres(
    frames: &[StoredFrame],
    form: Form,
    filmed: &FrameSource,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    match form {
        Form::Extxyz => write_extxyz(&with_steps(frames), filmed, out),
        Form::Csv => write_csv(&sphere_table(&with_steps(frames)), out),
    }
}

/// The frames as tables.
fn with_steps(frames: &[StoredFrame]) -> Vec<(u64, &AnyFrame)> {
    frames.iter().map(|kept| (kept.step, &kept.frame)).collect()
}
