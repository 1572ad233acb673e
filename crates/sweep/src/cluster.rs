//! Schedulers, which start the tasks of a campaign on other machines or on this one. Each is one
//! file that writes a script, submits it, lists the remaining tasks, and cancels them. Schedulers
//! do not decide which task computes which case.

mod error;
pub(crate) mod jobs;
mod local;
pub(crate) mod merge;
mod publish;
pub(crate) mod shard;
mod slices;
pub(crate) mod slurm;
pub(crate) mod status;
pub(crate) mod submit;
pub(crate) mod task;

pub(crate) use error::{ClusterError, no_room};

use crate::store::TaskName;
use slurm::Slurm;
use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A job for a scheduler: an array of tasks, each computing one slice of a campaign.
#[derive(Debug, Clone)]
pub(crate) struct Job {
    /// Name of the campaign.
    pub campaign: String,
    /// Absolute path of the program.
    pub program: PathBuf,
    /// Absolute path of the folder of shards.
    pub folder: PathBuf,
    /// Folder of the plan in it: the campaign file, the slices, the script, the logs.
    pub plan_folder: PathBuf,
    /// Number of tasks.
    pub tasks: usize,
    /// Cases that each task computes in parallel.
    pub workers: usize,
    /// Maximum number of tasks that run at the same time.
    pub throttle: Option<usize>,
    /// Further arguments of `sweep run`.
    pub run_arguments: Vec<String>,
}

/// A task known to the scheduler: pending, running, or ending.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub(crate) struct ActiveTask {
    /// Its number; `None` for all tasks of the job.
    pub task: Option<usize>,
    /// Its state, as named by the scheduler.
    pub state: String,
    /// The node it runs on, if any.
    pub node: String,
}

/// A scheduler.
#[derive(Debug, Clone)]
pub(crate) enum Scheduler {
    /// A cluster with Slurm.
    Slurm(Slurm),
    /// The background of this machine.
    Local,
}

impl Scheduler {
    /// Its name in the store and on the command line.
    pub(crate) const fn name(&self) -> &'static str {
        match self {
            Self::Slurm(_) => "slurm",
            Self::Local => "local",
        }
    }

    /// The scheduler of a job recorded in a store.
    pub(crate) fn by_name(name: &str) -> Option<Self> {
        [Self::Slurm(Slurm::default()), Self::Local]
            .into_iter()
            .find(|scheduler| scheduler.name() == name)
    }

    /// The scheduler that started this process as task number `task` and can restart it, and its
    /// name of the task.
    pub(crate) fn of_this_task(task: usize) -> Option<(Self, TaskName)> {
        slurm::this_task(task).map(|name| (Self::Slurm(Slurm::default()), name))
    }

    /// The maximum number of tasks of a job.
    ///
    /// # Errors
    /// The scheduler is missing.
    pub(crate) fn task_limit(&self) -> Result<usize, ClusterError> {
        match self {
            Self::Slurm(_) => slurm::task_limit(),
            Self::Local => Ok(local::TASK_LIMIT),
        }
    }

    /// The script of the tasks of a job.
    ///
    /// # Errors
    /// [`ClusterError::Path`] on a path that a script cannot name.
    pub(crate) fn script(&self, job: &Job) -> Result<String, ClusterError> {
        match self {
            Self::Slurm(slurm) => slurm.script(job),
            Self::Local => local::script(job),
        }
    }

    /// The command that submits the script: a program and its arguments.
    pub(crate) fn command(&self, job: &Job) -> Vec<String> {
        match self {
            Self::Slurm(slurm) => slurm.command(job),
            Self::Local => local::command(job),
        }
    }

    /// Submits the script of a job by [`Scheduler::command`]; returns the name of the job.
    ///
    /// # Errors
    /// The scheduler is missing, refuses, or gives an answer that cannot be parsed.
    pub(crate) fn submit(&self, job: &Job) -> Result<String, ClusterError> {
        match self {
            Self::Slurm(slurm) => slurm.submit(job),
            Self::Local => local::submit(job),
        }
    }

    /// The tasks of a job that have not ended.
    ///
    /// # Errors
    /// The scheduler is missing or does not answer.
    pub(crate) fn active(&self, job: &str) -> Result<Vec<ActiveTask>, ClusterError> {
        match self {
            Self::Slurm(_) => slurm::active(job),
            Self::Local => Ok(local::active(job)),
        }
    }

    /// Ends all tasks of a job; they checkpoint first.
    ///
    /// # Errors
    /// The scheduler is missing or refuses.
    pub(crate) fn cancel(&self, job: &str) -> Result<(), ClusterError> {
        match self {
            Self::Slurm(_) => slurm::cancel(job),
            Self::Local => local::cancel(job),
        }
    }

    /// Requests a restart of a task, after a signal with work left. `in_advance`: the signal was
    /// the one requested ahead of the time limit, which has no other sender.
    pub(crate) fn start_again(&self, task: &TaskName, in_advance: bool) -> Requeue {
        match self {
            Self::Slurm(_) => slurm::start_again(task, in_advance),
            Self::Local => Requeue::No("the local scheduler does not restart tasks".into()),
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

/// A word quoted for the shell.
///
/// # Errors
/// [`ClusterError::Word`] on a word with a NUL byte, which no command line can hold.
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
    /// The script of its tasks.
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
            "two words",
            "it's",
            "$HOME `x` \"y\" \\z",
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
