//! `sweep draw`.

use super::Output;
use super::output_file::{check_outputs, format_of, save};
use super::place::StoreArguments;
use crate::error::Error;
use crate::report::{Format, Range, SphereColour, SphereView, draw_spheres};
use crate::system::exit;
use crate::text::format::significant;
use std::path::{Path, PathBuf};

/// Draw the spheres of one run at a kept strain, with the forces of their contacts
///
/// `sweep run --trajectory` keeps the frames. Lines between centres are contacts, with a width
/// proportional to the normal force. A suspension is viewed along the vorticity, the nearest
/// spheres in front. Reads only.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep draw sweeps/quickstart.toml 1 --strain 3.2 --out layer.svg\n  \
                  sweep draw results/quickstart.sqlite 3f9a --colour cluster --out layer.png\n  \
                  sweep draw suspension.sqlite 1 --slab 0..4 --out slab.pdf"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// The run: the beginning of its key, or its number in the campaign file, from 1
    case: String,
    /// Draw the kept frame nearest to this strain [default: the last frame]
    #[arg(long, value_name = "STRAIN")]
    strain: Option<f64>,
    /// Quantity that colours the spheres
    #[arg(long, value_enum, default_value_t)]
    colour: SphereColour,
    /// In a suspension, draw only spheres with centres at z in this range, in a
    #[arg(long, value_name = "FROM..TO")]
    slab: Option<Range>,
    /// Output file: FILE.svg, FILE.pdf or FILE.png [default: SVG on standard output]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Writes the picture.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let path = arguments.out.as_deref().unwrap_or(Path::new("-"));
    let inputs: Vec<_> = arguments.place.files().collect();
    check_outputs(&[("--out", &Some(path.to_owned()))], &inputs, output)?;
    let to_file = path.as_os_str() != "-";
    let format = if to_file {
        format_of("--out", path)?
    } else {
        Format::Svg
    };
    let store = arguments.place.open(output)?;
    let view = SphereView {
        strain: arguments.strain,
        colour: arguments.colour,
        slab: arguments.slab,
    };
    let picture = draw_spheres(&store, &arguments.case, view, format)?;
    save(path, &picture.file, output)?;
    if output.json {
        output.json(&serde_json::json!({
            "key": picture.key, "strain": picture.strain, "spheres": picture.spheres, "contacts": picture.contacts
        }))?;
    } else if to_file {
        writeln!(
            output.out,
            "{} spheres and {} contacts of case {} at strain {}",
            picture.spheres,
            picture.contacts,
            picture.key,
            significant(picture.strain, 4)
        )?;
    }
    Ok(exit::DONE)
}
