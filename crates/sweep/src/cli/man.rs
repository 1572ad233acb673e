//! `sweep man`.

use super::{Cli, Output};
use crate::error::Error;
use crate::system::exit;
use crate::system::files::write_whole;
use clap::CommandFactory;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Write the manual pages into a folder: one for the program and one for each command
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: sweep man ~/.local/share/man/man1 && man sweep-run")]
pub(crate) struct Arguments {
    /// The folder; created if missing
    folder: PathBuf,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let folder = &arguments.folder;
    let refused = |path: &Path| {
        let path = path.to_owned();
        move |source| Error::Write { path, source }
    };
    std::fs::create_dir_all(folder).map_err(refused(folder))?;
    let mut program = Cli::command().disable_help_subcommand(true);
    program.build();
    let commands = program.get_subcommands().cloned();
    let mut written = Vec::new();
    for command in std::iter::once(program.clone()).chain(commands) {
        let man = clap_mangen::Man::new(command);
        let path = folder.join(man.get_filename());
        let mut page = Vec::new();
        man.render(&mut page)?;
        write_whole(&path, |file| file.write_all(&page)).map_err(refused(&path))?;
        written.push(path);
    }
    if output.json {
        output.json(&serde_json::json!({ "pages": written }))?;
    } else {
        let shown = folder.display();
        writeln!(output.out, "{shown}: {} pages", written.len())?;
    }
    Ok(exit::DONE)
}
