//! `sweep serve`.

use super::Output;
use super::place::{StoreArguments, print_last_run};
use crate::error::Error;
use crate::system::exit;
use std::net::{SocketAddr, ToSocketAddrs as _};

/// Show the report as a live page in the browser
///
/// Reads only; the page follows a running campaign. Ctrl-C ends the server.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep serve results/quickstart.sqlite\n  sweep serve sweeps/quickstart.toml --listen 127.0.0.1:0"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Address and port; port 0 selects a free one. Any address but loopback lets others on the
    /// network read the results
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8420", value_parser = address)]
    listen: SocketAddr,
}

/// Reads an address and a port; the address may be a name, such as `localhost`.
fn address(text: &str) -> Result<SocketAddr, String> {
    let found: Vec<SocketAddr> = text
        .to_socket_addrs()
        .map_err(|error| format!("{error}; write ADDRESS:PORT, as in localhost:8420"))?
        .collect();
    found
        .iter()
        .find(|address| address.is_ipv4())
        .or(found.first())
        .copied()
        .ok_or_else(|| "no such address".to_owned())
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    // An invalid store is an error here, not at each request.
    let store = source.open()?;
    let name = store.campaign_name()?;
    print_last_run(&store, &arguments.place.file, output);
    drop(store);
    crate::serve::serve(source, arguments.listen, |address| {
        if !address.ip().is_loopback() {
            output.note(&format!(
                "warning: {address} is not loopback: everyone who can reach it can read the results of {name}"
            ));
        }
        if output.json {
            output.json(&serde_json::json!({"address": address.to_string()}))?;
        } else {
            writeln!(output.out, "{name}: http://{address}/ (Ctrl-C ends it)")?;
        }
        output.out.flush()
    })?;
    Ok(exit::DONE)
}
