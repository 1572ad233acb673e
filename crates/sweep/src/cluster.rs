//! Engines: what starts the tasks of a campaign on other machines, or on this one. Each is one file that makes a script,
//! hands it over, says which tasks are still there, and cancels. Which task computes which case is not theirs to decide.

pub mod local;
pub mod slurm;

use crate::store::TaskName;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A job to be handed to an engine: so many tasks, each computing one slice of a campaign.
#[derive(Debug, Clone)]
pub struct Job {
    /// Name of the campaign.
    pub campaign: String,
    /// The program, by its whole path.
    pub program: PathBuf,
    /// Folder the shards are published in, by its whole path.
    pub folder: PathBuf,
    /// Folder of the plan in it: the campaign file, the slices, the script, the logs.
    pub plan_folder: PathBuf,
    /// Number of tasks.
    pub tasks: usize,
    /// Cases each task computes at a time.
    pub workers: usize,
    /// Tasks at work at a time, at most.
    pub throttle: Option<usize>,
    /// Further arguments of `sweep run`.
    pub run_arguments: Vec<String>,
}

/// A task the engine still knows: waiting, at work, or about to end.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct ActiveTask {
    /// Its number; `None` speaks for all tasks of the job.
    pub task: Option<usize>,
    /// Its state in the words of the engine.
    pub state: String,
    /// The node it runs on, if it does.
    pub node: String,
}

/// What runs the tasks of a job.
pub trait Engine: Sync {
    /// Its name in the store and on the command line.
    fn name(&self) -> &'static str;

    /// The most tasks a job may have.
    ///
    /// # Errors
    /// An engine that is not there.
    fn task_limit(&self) -> Result<usize, EngineError>;

    /// The script that runs every task of a job.
    ///
    /// # Errors
    /// What the engine could not express.
    fn script(&self, job: &Job) -> Result<String, EngineError>;

    /// The command that hands the script over: a program and its arguments.
    fn command(&self, job: &Job) -> Vec<String>;

    /// Hands the script of a job over, as [`Engine::command`] says; gives the job's name back.
    ///
    /// # Errors
    /// An engine that is not there, that refuses, or whose answer cannot be understood.
    fn submit(&self, job: &Job) -> Result<String, EngineError>;

    /// The tasks of a job that have not ended.
    ///
    /// # Errors
    /// An engine that is not there or does not answer.
    fn active(&self, job: &str) -> Result<Vec<ActiveTask>, EngineError>;

    /// Ends all tasks of a job; they checkpoint first.
    ///
    /// # Errors
    /// An engine that is not there or refuses.
    fn cancel(&self, job: &str) -> Result<(), EngineError>;

    /// The name of this process as task number `task`, if this engine started it as that and can start it again.
    fn this_task(&self, _task: usize) -> Option<TaskName> {
        None
    }

    /// Asks for this task to be started again, after a signal with work left. `in_advance`: the signal was the one asked for
    /// ahead of the time limit, which nobody else sends.
    fn start_again(&self, _task: &TaskName, _in_advance: bool) -> Again {
        Again::No(format!("{} does not start tasks again", self.name()))
    }
}

/// What becomes of a task that was told to stop with work left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Again {
    /// It will be started again.
    Yes,
    /// It was cancelled, and stays so.
    Cancelled,
    /// The engine would not start it again, and said why.
    No(String),
}

/// All engines.
fn all() -> [Box<dyn Engine>; 2] {
    [Box::new(slurm::Slurm::default()), Box::new(local::Local)]
}

/// The engine of a job that is in a store.
pub fn by_name(name: &str) -> Option<Box<dyn Engine>> {
    all().into_iter().find(|engine| engine.name() == name)
}

/// The engine that started this process as task number `task`, and what it calls the task.
pub fn of_this_task(task: usize) -> Option<(Box<dyn Engine>, TaskName)> {
    all()
        .into_iter()
        .find_map(|engine| engine.this_task(task).map(|name| (engine, name)))
}

/// Why an engine could not do what was asked for.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum EngineError {
    /// A program of the engine is not there.
    #[error("there is no `{program}` on this machine")]
    #[diagnostic(help("{advice}"))]
    Missing {
        /// The program.
        program: String,
        /// What can be done.
        advice: &'static str,
    },
    /// The engine refused.
    #[error("`{command}` was refused: {said}")]
    #[diagnostic(help("{advice}"))]
    Refused {
        /// What was asked.
        command: String,
        /// What it said.
        said: String,
        /// What can be done.
        advice: String,
    },
    /// An answer that cannot be understood.
    #[error("`{command}` gave no job number but {said:?}")]
    #[diagnostic(help(
        "the job may be there all the same: look with `squeue --me` before the same command is given again; computing twice \
         does no harm"
    ))]
    Answer {
        /// What was asked.
        command: String,
        /// What it said.
        said: String,
    },
    /// More tasks than a job may have.
    #[error("{asked} tasks are more than the {limit} a job may have here")]
    #[diagnostic(help(
        "nothing was submitted; give --tasks {limit} or fewer: each then computes more cases. Several workers per task \
         (--workers-per-task) make them faster"
    ))]
    TooManyTasks {
        /// Tasks asked for.
        asked: usize,
        /// Most allowed: MaxArraySize of the site.
        limit: usize,
    },
    /// A path that a script cannot name.
    #[error("{} is not valid UTF-8, and cannot be named in a script", path.display())]
    #[diagnostic(help("nothing was submitted; put the store elsewhere with --store FILE"))]
    Path {
        /// The path.
        path: PathBuf,
    },
}

/// A word as the shell reads it back unchanged.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./=:,%+@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// A path in a script.
fn quoted_path(path: &Path) -> Result<String, EngineError> {
    path.to_str().map(quoted).ok_or_else(|| EngineError::Path {
        path: path.to_owned(),
    })
}

impl Job {
    /// The script of its tasks.
    pub fn script_path(&self) -> PathBuf {
        self.plan_folder.join("job.sh")
    }

    /// The command line of one task, whose number the shell puts in place of `task`.
    fn task_command(&self, task: &str) -> Result<String, EngineError> {
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
            "two words",
            "it's",
            "$HOME `x` \"y\" \\z",
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
