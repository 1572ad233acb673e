//! `sweep prune`.

use super::Output;
use super::place::StoreArguments;
use crate::error::Error;
use crate::store::Store;
use crate::system::exit;
use crate::text::format::bytes;
use std::io::{IsTerminal as _, Write as _};

/// Remove the runs of a store that are not in its campaign file
///
/// Editing a campaign file keeps the runs that are no longer in it: they are used again if they
/// return. This removes them, after a prompt with their number. For a store, the campaign file is
/// the one it was last run with.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep prune sweeps/quickstart.toml\n  sweep prune sweeps/quickstart.toml --yes --json"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Do not prompt
    #[arg(long, short)]
    yes: bool,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    let reader = source.open()?;
    let inventory = reader.inventory()?;
    // Readers prevent the file from shrinking.
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
            store.adopt(campaign)?;
        }
        removed = store.prune()?;
    }
    if output.json {
        let bytes = inventory.orphan_bytes;
        output.json(&serde_json::json!({"store": path, "removed": removed, "bytes": bytes}))?;
    } else if removed > 0 {
        writeln!(
            output.out,
            "{removed} runs removed from {}, about {size}",
            path.display()
        )?;
    } else {
        writeln!(
            output.out,
            "nothing to remove: all runs in {} are in the campaign",
            path.display()
        )?;
    }
    Ok(exit::DONE)
}

/// Prompts whether to remove the runs.
fn confirmed(runs: u64, size: &str, path: &std::path::Path) -> Result<bool, Error> {
    if !std::io::stdin().is_terminal() {
        return Err(Error::Argument {
            argument: "--yes",
            message: format!(
                "{runs} runs in {} (about {size}) are not in the campaign; there is no terminal for a prompt, so give \
                 --yes; nothing was removed",
                path.display()
            ),
        });
    }
    let mut to = crate::text::visible::stderr();
    write!(
        to,
        "Remove {runs} runs, about {size}, from {}? They belong to other versions of the campaign and would have to be recomputed. [y/N] ",
        path.display()
    )?;
    to.flush()?;
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer)?;
    Ok(matches!(answer.trim().to_lowercase().as_str(), "y" | "yes"))
}
