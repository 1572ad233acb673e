//! Campaigns on other machines: the open cases are cut into [`slices`], a scheduler starts a task
//! for each, tasks publish what they compute as [`shard`]s, and shards are merged into the store.
//!
//! An [`Engine`] is a scheduler: one file that writes a script, submits it, lists the remaining
//! tasks, and cancels them. It does not decide which task computes which case.

mod error;
mod local;
pub(crate) mod merge;
pub(crate) mod shard;
mod slices;
pub(crate) mod slurm;
pub(crate) mod status;
pub(crate) mod submit;
pub(crate) mod task;

pub(crate) use error::{ClusterError, no_room};

use slurm::TimeLimit;
use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

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
    pub time: Option<TimeLimit>,
    /// Further arguments of the command that submits the script.
    pub submit_arguments: Vec<String>,
    /// Further arguments of `sweep run`.
    pub run_arguments: Vec<String>,
}

/// A task known to the scheduler: pending, running, or ending.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ActiveTask {
    /// Its number; `None` for all tasks of the job.
    pub task: Option<usize>,
    /// Its state, as named by the scheduler.
    pub state: String,
    /// The node it runs on, if any.
    pub node: String,
}

/// A scheduler.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Engine {
    /// A cluster with Slurm.
    Slurm,
    /// The background of this machine.
    Local,
}

impl Engine {
    pub(crate) const ALL: [Self; 2] = [Self::Slurm, Self::Local];

    /// Its name in the store and on the command line.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Slurm => "slurm",
            Self::Local => "local",
        }
    }

    /// The scheduler of a job recorded in a store.
    pub(crate) fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|engine| engine.name() == name)
    }

    /// The maximum number of tasks of a job. Fails where the scheduler is missing.
    pub(crate) fn task_limit(self) -> Result<usize, ClusterError> {
        match self {
            Self::Slurm => slurm::task_limit(),
            Self::Local => Ok(local::TASK_LIMIT),
        }
    }

    /// The script of the tasks of a job.
    pub(crate) fn script(self, job: &Job) -> Result<String, ClusterError> {
        match self {
            Self::Slurm => slurm::script(job),
            Self::Local => local::script(job),
        }
    }

    /// The command that submits the script: a program and its arguments.
    pub(crate) fn command(self, job: &Job) -> Vec<String> {
        match self {
            Self::Slurm => slurm::command(job),
            Self::Local => local::command(job),
        }
    }

    /// Submits the script of a job by [`Engine::command`]; returns the name of the job.
    pub(crate) fn submit(self, job: &Job) -> Result<String, ClusterError> {
        match self {
            Self::Slurm => slurm::submit(job),
            Self::Local => local::submit(job),
        }
    }

    /// The tasks of a job that have not ended.
    pub(crate) fn active(self, job: &str) -> Result<Vec<ActiveTask>, ClusterError> {
        match self {
            Self::Slurm => slurm::active(job),
            Self::Local => Ok(local::active(job)),
        }
    }

    /// Ends all tasks of a job; they checkpoint first.
    pub(crate) fn cancel(self, job: &str) -> Result<(), ClusterError> {
        match self {
            Self::Slurm => slurm::cancel(job),
            Self::Local => local::cancel(job),
        }
    }
}

/// The outcome for a task that was stopped with work left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Requeue {
    /// It will be restarted.
    Yes,
    /// It was cancelled, and stays so.
    Cancelled,
    /// The scheduler refused to restart it, with a reason.
    No(String),
}

/// A word quoted for the shell. Fails for a word with a NUL byte, which no command line can hold.
pub(crate) fn quoted(word: &str) -> Result<String, ClusterError> {
    shlex::try_quote(word)
        .map(Cow::into_owned)
        .map_err(|_| ClusterError::Word {
            word: word.to_owned(),
        })
}

/// A path in a script.
fn quoted_path(path: &Path) -> Result<String, ClusterError> {
    let text = path.to_str().ok_or_else(|| ClusterError::Path {
        path: path.to_owned(),
    })?;
    quoted(text)
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
            let _ = write!(line, " {}", quoted(argument)?);
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
                .args(["-c", &format!("printf %s {}", quoted(word).unwrap())])
                .output()
                .unwrap();
            assert_eq!(String::from_utf8_lossy(&output.stdout), word);
        }
        assert_eq!(quoted("plain/path.sqlite").unwrap(), "plain/path.sqlite");
        assert!(quoted("a\0b").is_err());
    }
}
