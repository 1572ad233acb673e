//! `sweep completions`.

use super::{Cli, Output};
use crate::error::Error;
use crate::system::exit;
use clap::CommandFactory;

/// Print a completion script for a shell
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: sweep completions bash > ~/.local/share/bash-completion/completions/sweep"
)]
pub(crate) struct Arguments {
    /// The shell
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    // Written to memory first: the generator panics on a closed pipe.
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command(), "sweep", &mut script);
    output.out.write_all(&script)?;
    Ok(exit::DONE)
}
