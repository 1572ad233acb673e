//! `sweep replay`.

use super::{Output, store_path};
use crate::error::Error;
use crate::exit;
use crate::store::Store;
use std::path::PathBuf;

/// Failures named in an error.
const NAMED: u32 = 8;

/// Print the state before a failure as input of `sweep solve`
///
/// The configuration before the step that failed, with its cell, offset, radii and contact settings. Of a case whose
/// process died again and again: that of its last checkpoint.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  sweep status results/friction.sqlite\n  sweep replay results/friction.sqlite 326e0e48 | sweep solve -"
)]
pub(crate) struct Arguments {
    /// The store, or a campaign file whose default store is meant
    store: PathBuf,
    /// Key of the failed case, or its first characters; not needed if only one failed
    #[arg(default_value = "", hide_default_value = true)]
    key: String,
}

/// Writes the state.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let store = Store::open_read_only(&store_path(&arguments.store)?)?;
    let refuse = |message| {
        Err(Error::Argument {
            argument: "KEY",
            message,
        })
    };
    let mut found = store.replays(&arguments.key, NAMED)?;
    match (found.pop(), found.as_slice()) {
        (None, _) if arguments.key.is_empty() => refuse("no case of this store has failed".into()),
        (None, _) => refuse(format!(
            "no failed case has a key that begins with {:?}; `sweep status` lists them",
            arguments.key.chars().take(40).collect::<String>()
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
        (Some(only), []) => match only.snapshot {
            Some(snapshot) => {
                writeln!(output.out, "{snapshot}")?;
                Ok(exit::DONE)
            }
            None => refuse(format!(
                "{} failed before there was a layer to print: {}",
                only.key, only.error
            )),
        },
    }
}
