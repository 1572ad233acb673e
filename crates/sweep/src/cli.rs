//! The command line: its arguments, and the dispatch to one file per command.

mod check;
mod cluster;
mod completions;
mod convert;
mod draw;
mod export;
mod fit;
mod man;
mod output_file;
mod pair;
mod place;
mod plan;
mod prune;
mod replay;
mod report;
mod run;
mod scalars;
mod segments;
mod serve;
mod show;
mod solve;
mod status;
mod structure;
mod tables;
mod transport;
mod verify;
mod words;

use crate::error::Error;
use crate::model::case::PHYSICS_VERSION;
use crate::report::ReportError;
use crate::system::files;
use crate::text::visible::{TextOutput, Visible};
use clap::{Parser, Subcommand};
use serde::Serialize;
use std::fmt::Write as _;
use std::io::{IsTerminal, Write};
use std::sync::{Arc, LazyLock};

/// Text of `--version`. Only then is the whole program file read, to hash its build.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let version = env!("CARGO_PKG_VERSION");
    if std::env::args_os().any(|argument| argument == "--version" || argument == "-V") {
        let build = crate::system::process::build();
        format!("{version} (physics {PHYSICS_VERSION}, build {build})")
    } else {
        version.to_owned()
    }
});

/// The commands in the order of the help, by subject.
const GROUPS: [(&str, &[&str]); 4] = [
    (
        "Daily commands",
        &["plan", "run", "status", "report", "show", "serve"],
    ),
    (
        "Results",
        &[
            "segments",
            "structure",
            "fit",
            "convert",
            "export",
            "draw",
            "replay",
            "prune",
            "check",
        ],
    ),
    ("Cluster", &["submit", "merge", "cancel"]),
    (
        "Tools",
        &[
            "solve",
            "transport",
            "scalars",
            "verify",
            "pair",
            "completions",
            "man",
        ],
    ),
];

/// Template of the help of the program. Clap has no groups of subcommands.
static HELP: LazyLock<String> = LazyLock::new(|| {
    let commands = Command::augment_subcommands(clap::Command::new("sweep"));
    let mut help = "{about-with-newline}\n{usage-heading} {usage}\n".to_owned();
    for (heading, names) in GROUPS {
        let _ = writeln!(help, "\n{heading}:");
        for name in names {
            let command = commands.find_subcommand(name);
            let about = command.and_then(clap::Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(help, "  {name:<12} {about}");
        }
    }
    help + "\nOptions:\n{options}{after-help}"
});

/// Campaigns of Stokesian Dynamics: sheared layers and suspensions of rough, frictional spheres.
#[derive(Debug, Parser)]
#[command(
    version = VERSION.as_str(),
    propagate_version = true,
    max_term_width = 110,
    help_template = HELP.as_str(),
    after_help = "Exit codes: 0 done, 1 some cases failed, 2 bad input and nothing written, \
                  3 the store or the output failed (disk full, lock, file gone),\n\
                  4 the time limit was reached with work left: repeat the same command to continue,\n\
                  128 + signal (INT 130, TERM 143) stopped after a checkpoint: repeat the same \
                  command to continue.\n\n\
                  Examples:\n  \
                  sweep plan sweeps/quickstart.toml && sweep run sweeps/quickstart.toml\n  \
                  sweep report sweeps/quickstart.toml --figure curves.svg\n  \
                  sweep submit sweeps/figure-11.toml --tasks 200 --time 4h\n  \
                  sweep scalars --size-ratio 1 --separation 2.01"
)]
pub struct Cli {
    /// Print one JSON object on standard output, and nothing else
    #[arg(long, global = true, help_heading = "Global options")]
    json: bool,
    /// Print no progress and no notes on standard error
    #[arg(long, short, global = true, help_heading = "Global options")]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

/// The subcommands. Each is documented at its arguments: text here would replace it.
#[derive(Debug, Subcommand)]
enum Command {
    Plan(plan::Arguments),
    Run(run::Arguments),
    Submit(cluster::SubmitArguments),
    Merge(cluster::MergeArguments),
    Cancel(cluster::CancelArguments),
    Status(status::Arguments),
    Report(Box<report::Arguments>),
    Segments(segments::Arguments),
    Structure(structure::Arguments),
    Fit(fit::Arguments),
    Convert(convert::Arguments),
    Show(show::Arguments),
    Export(export::Arguments),
    Draw(draw::Arguments),
    Serve(serve::Arguments),
    Replay(replay::Arguments),
    Prune(prune::Arguments),
    Check(check::Arguments),
    Solve(solve::Arguments),
    Scalars(scalars::Arguments),
    Verify(verify::Arguments),
    Pair(pair::Arguments),
    Transport(transport::Arguments),
    Completions(completions::Arguments),
    Man(man::Arguments),
}

/// Destination and form of the output.
pub(crate) struct Output<'o> {
    pub(crate) out: &'o mut dyn TextOutput,
    pub(crate) json: bool,
    pub(crate) quiet: bool,
    /// Columns of the terminal; `None` for other output.
    pub(crate) width: Option<u16>,
}

impl Output<'_> {
    /// Prints a note on standard error, unless `--quiet` is given.
    pub(crate) fn note(&self, text: &str) {
        note(self.quiet, text);
    }

    /// Writes a value as one line of JSON.
    pub(crate) fn json(&mut self, value: &impl Serialize) -> std::io::Result<()> {
        serde_json::to_writer(&mut *self.out, value)?;
        writeln!(self.out)
    }
}

/// Prints a note on standard error, unless `--quiet` is given.
fn note(quiet: bool, text: &str) {
    if !quiet {
        // Standard error may be closed.
        let _ = writeln!(crate::text::visible::stderr(), "{text}");
    }
}

/// Executes the command and returns the exit code.
///
/// # Errors
/// Any error; [`Error::exit_code`] is its exit code.
pub fn execute(cli: Cli, out: &mut dyn Write) -> Result<u8, Error> {
    // Reaching a limit on file sizes is an error like a full disk, instead of a signal that ends
    // the process.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    let mut visible = Visible::new(out);
    let mut output = Output {
        out: &mut visible,
        json: cli.json,
        quiet: cli.quiet,
        width: terminal_width(),
    };
    let code = match cli.command {
        Command::Plan(arguments) => plan::execute(&arguments, &mut output),
        Command::Run(arguments) => run::execute(&arguments, &mut output),
        Command::Submit(arguments) => cluster::submit(&arguments, &mut output),
        Command::Merge(arguments) => cluster::merge(&arguments, &mut output),
        Command::Cancel(arguments) => cluster::cancel(&arguments, &mut output),
        Command::Status(arguments) => status::execute(&arguments, &mut output),
        Command::Report(arguments) => report::execute(&arguments, &mut output),
        Command::Segments(arguments) => segments::execute(&arguments, &mut output),
        Command::Structure(arguments) => structure::execute(&arguments, &mut output),
        Command::Fit(arguments) => fit::execute(&arguments, &mut output),
        Command::Convert(arguments) => convert::execute(&arguments, &mut output),
        Command::Show(arguments) => show::execute(&arguments, &mut output),
        Command::Export(arguments) => export::execute(&arguments, &mut output),
        Command::Draw(arguments) => draw::execute(&arguments, &mut output),
        Command::Serve(arguments) => serve::execute(&arguments, &mut output),
        Command::Replay(arguments) => replay::execute(&arguments, &mut output),
        Command::Prune(arguments) => prune::execute(&arguments, &mut output),
        Command::Check(arguments) => check::execute(&arguments, &mut output),
        Command::Solve(arguments) => solve::execute(&arguments, &mut output),
        Command::Scalars(arguments) => scalars::execute(&arguments, &mut output),
        Command::Verify(arguments) => verify::execute(&arguments, &mut output),
        Command::Pair(arguments) => pair::execute(&arguments, &mut output),
        Command::Transport(arguments) => transport::execute(&arguments, &mut output),
        Command::Completions(arguments) => completions::execute(&arguments, &mut output),
        Command::Man(arguments) => man::execute(&arguments, &mut output),
    }
    .map_err(with_flag)?;
    match output.out.flush() {
        // The reader closed standard output; the exit code stays that of the command.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(code),
        flushed => Ok(flushed.map(|()| code)?),
    }
}

/// An error about an option of a report, with the option as it is written here.
fn with_flag(error: Error) -> Error {
    match error {
        Error::Report(ReportError::Argument { option, message }) => Error::Option {
            flag: format!("--{}", option.replace('_', "-")),
            message,
        },
        other => other,
    }
}

/// Columns of standard output, if it is a terminal.
fn terminal_width() -> Option<u16> {
    std::io::stdout()
        .is_terminal()
        .then(|| rustix::termios::tcgetwinsize(std::io::stdout()).ok())
        .flatten()
        .map(|size| size.ws_col)
        .filter(|width| *width > 0)
}

/// Reads a file, or standard input for `-`, up to a limit.
pub(crate) fn read_input(path: &std::path::Path, limit: u64) -> Result<Vec<u8>, Error> {
    let read = if path.as_os_str() == "-" {
        files::read_limited(std::io::stdin().lock(), limit)
    } else {
        files::read_whole(path, limit)
    };
    read.map_err(|source| Error::Read {
        path: path.to_owned(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::Cli;
    use clap::CommandFactory;

    #[test]
    fn command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
