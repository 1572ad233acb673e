//! `sweep prune`.

use super::Output;
use super::place::StoreArguments;
use crate::api::Error;
use crate::campaign::Order;
use crate::exit;
use crate::format::bytes;
use crate::store::Store;
use serde::Serialize;
use std::io::{IsTerminal as _, Write as _};
use std::path::PathBuf;

/// Remove the runs of a store that its campaign file does not ask for
///
/// Editing a campaign file keeps the runs that it no longer asks for: they are used again if it asks for them later. This removes
/// them, after saying how many there are and asking. With a store in place of a campaign file, the file it was last run with
/// is meant.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep prune sweeps/quickstart.toml\n  sweep prune sweeps/quickstart.toml --yes --json"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Do not ask
    #[arg(long, short)]
    yes: bool,
}

#[derive(Serialize)]
struct Answer {
    store: PathBuf,
    removed: u64,
    /// What they took, in bytes, about.
    bytes: f64,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    let reader = source.open()?;
    let inventory = reader.inventory()?;
    // A reader keeps the file from getting smaller.
    drop(reader);
    let (runs, size) = (inventory.orphans, bytes(inventory.orphan_bytes));
    let path = source.path().to_owned();
    let mut removed = 0;
    if runs > 0 {
        if !arguments.yes && !confirmed(runs, &size, &path)? {
            writeln!(output.out, "nothing was removed")?;
            return Ok(exit::DONE);
        }
        let mut store = Store::open(&path)?;
        if let Some(campaign) = source.campaign() {
            store.adopt(campaign, Order::default())?;
        }
        removed = store.prune()?;
    }
    if output.json {
        output.json(&Answer {
            store: path,
            removed,
            bytes: inventory.orphan_bytes,
        })?;
    } else if removed > 0 {
        writeln!(
            output.out,
            "{removed} runs removed from {}, about {size}",
            path.display()
        )?;
    } else {
        writeln!(
            output.out,
            "nothing to remove: all runs in {} are asked for",
            path.display()
        )?;
    }
    Ok(exit::DONE)
}

/// Asks whether to remove so many runs.
fn confirmed(runs: u64, size: &str, path: &std::path::Path) -> Result<bool, Error> {
    if !std::io::stdin().is_terminal() {
        return Err(Error::Argument {
            argument: "--yes",
            message: format!(
                "{runs} runs in {} (about {size}) are not asked for; nobody can be asked here whether to remove them, so say \
                 --yes; nothing was removed",
                path.display()
            ),
        });
    }
    let mut to = crate::text::visible::stderr();
    write!(
        to,
        "Remove {runs} runs, about {size}, from {}? They are not asked for any more, and would have to be computed again. [y/N] ",
        path.display()
    )?;
    to.flush()?;
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer)?;
    Ok(matches!(answer.trim().to_lowercase().as_str(), "y" | "yes"))
}
