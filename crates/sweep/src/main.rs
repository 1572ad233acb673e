//! The `sweep` program: parses the command line, dispatches, sets the exit code.

use clap::Parser;
use std::io::{BufWriter, Write};
use std::process::ExitCode;
use sweep::cli;
use sweep::system::exit;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    let error_renderer = cli.error_renderer();
    let mut out = BufWriter::new(std::io::stdout());
    match cli::execute(cli, &mut out) {
        Ok(code) => ExitCode::from(code),
        Err(error) if error.is_closed_pipe() => ExitCode::from(exit::DONE),
        Err(error) => {
            // Standard error may be closed; the exit code still reports the error.
            let _ = write!(std::io::stderr(), "{}", error_renderer.explain(&error));
            ExitCode::from(error.exit_code())
        }
    }
}
