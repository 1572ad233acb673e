//! Campaigns on other machines: the open cases are cut into [`slices`], [`slurm`] starts a task for
//! each, tasks publish what they compute as [`shard`]s, and shards are merged into the store.
//!
//! A scheduler is one file that writes a script, submits it, lists the remaining tasks, and cancels
//! them. It does not decide which task computes which case.

mod error;
pub(crate) mod merge;
pub(crate) mod shard;
mod slices;
pub(crate) mod slurm;
pub(crate) mod status;
pub(crate) mod submit;
pub(crate) mod task;

pub(crate) use error::{ClusterError, no_room};

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A job for a scheduler: an array of tasks, each computing one slice of a campaign.
#[derive(Debug, Clone)]
pub(crate) struct Job {
    pub campaign: String,
    /// Absolute path of the program.
    pub program: PathBuf,
    /// Absolute path of the folder of shards.
    pub folder: PathBuf,
    /// Folder of the plan in it: the campaign file, the slices, the script, the logs.
    pub plan_folder: PathBuf,
    pub tasks: usize,
    pub workers: usize,
    /// Maximum number of tasks that run at the same time.
    pub throttle: Option<usize>,
    pub time: Option<Duration>,
    /// Further arguments of the command that submits the script.
    pub submit_arguments: Vec<String>,
    /// Further arguments of `sweep run`.
    pub run_arguments: Vec<String>,
}

/// A word quoted for the shell.
pub(crate) fn quoted(word: &str) -> String {
    // No argument of a process holds a NUL byte, which alone cannot be quoted.
    let quoter = shlex::Quoter::new().allow_nul(true);
    quoter
        .quote(word)
        .map_or_else(|_| String::new(), Into::into)
}

/// A path in a script.
fn quoted_path(path: &Path) -> Result<String, ClusterError> {
    let text = path.to_str().ok_or_else(|| ClusterError::Path {
        path: path.to_owned(),
    })?;
    Ok(quoted(text))
}

impl Job {
    pub(crate) fn script_path(&self) -> PathBuf {
        self.plan_folder.join("job.sh")
    }

    /// The command line of one task, whose number the shell puts in place of `task`.
    fn task_command(&self, task: &str) -> Result<String, ClusterError> {
        let mut line = format!(
            "{} run {} --shard \"{task}/{}\" --slices {} --shards {} --workers {}",
            quoted_path(&self.program)?,
            quoted_path(&self.plan_folder.join("campaign.toml"))?,
            self.tasks,
            quoted_path(&self.plan_folder.join("slices"))?,
            quoted_path(&self.folder)?,
            self.workers,
        );
        for argument in &self.run_arguments {
            // Writing to a string cannot fail.
            let _ = write!(line, " {}", quoted(argument));
        }
        Ok(line)
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_come_back_from_the_shell_as_they_were() {
        for word in [
            "plain/path.sqlite",
            "it's $HOME `x` \"y\" \\z",
            "a\nb",
            "",
            "*",
            "µ",
        ] {
            let output = std::process::Command::new("sh")
                .args(["-c", &format!("printf %s {}", quoted(word))])
                .output()
                .unwrap();
            assert_eq!(String::from_utf8_lossy(&output.stdout), word);
        }
        assert_eq!(quoted("plain/path.sqlite"), "plain/path.sqlite");
    }
}
