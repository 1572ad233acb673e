//! `sweep replay`.

use super::Output;
use super::place::StoreArguments;
use crate::error::Error;
use crate::system::exit;

/// Maximum number of failures named in an error.
const NAMED: u32 = 8;

/// Print the state before a failure as input for `sweep solve`
///
/// Prints the configuration before the failed step, with its cell, offset, radii and contact
/// settings. For a case whose process died repeatedly, that of its last checkpoint.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  sweep status results/figure-11.sqlite\n  sweep replay results/figure-11.sqlite 326e0e48 | sweep solve -"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// The run: the beginning of its key, or its number in the campaign file, from 1; optional if
    /// only one failed
    case: Option<String>,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let store = arguments.place.open(output)?;
    let refuse = |message| {
        Err(Error::Argument {
            argument: "CASE",
            message,
        })
    };
    let key = match &arguments.case {
        Some(given) => Some(store.key_of(given)?),
        None => None,
    };
    let mut found = store.replays(key.as_deref(), NAMED)?;
    match (found.pop(), found.as_slice()) {
        (None, _) => refuse(key.map_or_else(
            || "no case of this campaign has failed".into(),
            |key| format!("case {key} has not failed; `sweep status` lists those that have"),
        )),
        (Some(last), [_, ..]) => {
            let keys: Vec<_> = found
                .iter()
                .chain([&last])
                .map(|f| f.key.as_str())
                .collect();
            refuse(format!(
                "several cases failed, name one: {}",
                keys.join(", ")
            ))
        }
        (Some(only), []) => match only.failed.snapshot {
            Some(snapshot) => {
                writeln!(output.out, "{snapshot}")?;
                Ok(exit::DONE)
            }
            None => refuse(format!(
                "{} failed before there was a layer to print: {}",
                only.key, only.failed.error
            )),
        },
    }
}
