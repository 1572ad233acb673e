//! The `sweep` program: parses the command line, dispatches, sets the exit code.

use clap::Parser;
use std::io::{BufWriter, Write};
use std::process::ExitCode;
use sweep::system::exit;
use sweep::{ErrorRenderer, cli};

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    let mut out = BufWriter::new(std::io::stdout());
    match cli::execute(cli, &mut out) {
        Ok(code) => ExitCode::from(code),
        Err(error) if error.is_closed_pipe() => ExitCode::from(exit::DONE),
        Err(error) => {
            // Standard error may be closed; the exit code still reports the error.
            let _ = write!(
                std::io::stderr(),
                "{}",
                ErrorRenderer::default().explain(&error)
            );
            ExitCode::from(error.exit_code())
        }
    }
}
