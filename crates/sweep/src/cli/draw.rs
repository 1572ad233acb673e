//! `sweep draw`.

use super::Output;
use super::output_file::{check_outputs, check_picture, save};
use super::place::StoreArguments;
use super::words::choice;
use crate::error::Error;
use crate::report::{SphereColour, SphereView, draw_spheres, range};
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
    after_help = "Examples:\n  sweep run sweeps/quickstart.toml --trajectory\n  sweep draw sweeps/quickstart.toml 1 --strain 3.2 --out layer.svg\n  \
                  sweep draw results/quickstart.sqlite 3f9a --colour cluster --out clusters.svg\n  \
                  sweep draw suspension.sqlite 1 --slab 0..4 --out slab.svg"
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
    #[arg(long, value_parser = choice::<SphereColour>(), default_value = "pressure")]
    colour: SphereColour,
    /// In a suspension, draw only spheres with centres at z in this range, in a
    #[arg(long, value_name = "FROM..TO", value_parser = slab)]
    slab: Option<[f64; 2]>,
    /// Output file: FILE.svg [default: standard output]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Reads the ends of a slab.
fn slab(text: &str) -> Result<[f64; 2], String> {
    range(text)
        .filter(|[low, high]| low.is_finite() && high.is_finite() && low < high)
        .ok_or_else(|| {
            format!(
                "{text:?} is not a range: write the lower end, two dots, the upper end, as in 0..4"
            )
        })
}

/// Writes the picture.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let path = arguments.out.as_deref().unwrap_or(Path::new("-"));
    let inputs: Vec<_> = arguments.place.files().collect();
    check_outputs(&[("--out", &Some(path.to_owned()))], &inputs, output)?;
    check_picture("--out", arguments.out.as_ref())?;
    let to_file = path.as_os_str() != "-";
    let store = arguments.place.open(output)?;
    let view = SphereView {
        strain: arguments.strain,
        colour: arguments.colour,
        slab: arguments.slab,
    };
    let picture = draw_spheres(&store, &arguments.case, view)?;
    save(path, picture.file.as_bytes(), output)?;
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
