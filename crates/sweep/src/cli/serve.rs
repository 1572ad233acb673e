//! `sweep serve`.

use super::{Output, store_path};
use crate::error::Error;
use crate::exit;
use crate::store::Store;
use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Show the report as a live page in the browser
///
/// Reads only, and may be used while the campaign runs: the page follows it. Ctrl-C ends it.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep serve results/quickstart.sqlite\n  sweep serve sweeps/quickstart.toml --listen 127.0.0.1:0"
)]
pub(crate) struct Arguments {
    /// The store, or a campaign file whose default store is meant
    store: PathBuf,
    /// Address and port; port 0 takes a free one. Anything but loopback lets others on the network read the results
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8420")]
    listen: SocketAddr,
}

/// Serves until a signal.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let path = store_path(&arguments.store)?;
    // A file that is no store is an error now, not one of each request.
    let name = Store::open_read_only(&path)?.campaign_name()?;
    crate::serve::serve(&path, arguments.listen, |address| {
        if !address.ip().is_loopback() && !output.quiet {
            // Nobody may read standard error: the page is served all the same.
            let _ = writeln!(
                std::io::stderr(),
                "warning: {address} is not loopback: whoever reaches it can read the results of {name}"
            );
        }
        if output.json {
            output.json(&serde_json::json!({"address": address.to_string()}))?;
        } else {
            writeln!(output.out, "{name}: http://{address}/ (Ctrl-C ends it)")?;
        }
        Ok(output.out.flush()?)
    })?;
    Ok(exit::DONE)
}
