//! Slurm: one array job, submitted with `sbatch`, without queries to an accounting database.

use super::{ClusterError, Job, quoted_path};
use crate::store::TaskName;
use crate::text::format::counted;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::time::Duration;

/// Maximum size of an array where the site does not report it: the default of Slurm.
pub(crate) const DEFAULT_ARRAY: usize = 1001;
/// Options of sbatch that the script sets.
pub(crate) const SCRIPT_OPTIONS: [&str; 7] = [
    "-a",
    "--array",
    "--export",
    "--wrap",
    "--parsable",
    "--signal",
    "--open-mode",
];
/// Environment variables by which a user selects a destination for jobs. All others that `sbatch`
/// reads could override the script.
const CHOICES: [&str; 7] = [
    "SBATCH_ACCOUNT",
    "SBATCH_PARTITION",
    "SBATCH_QOS",
    "SBATCH_RESERVATION",
    "SBATCH_CONSTRAINT",
    "SBATCH_CLUSTERS",
    "SBATCH_TIMELIMIT",
];

/// A task that has not ended: pending, running, or ending.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ActiveTask {
    pub task: usize,
    /// Its state, as named by the scheduler.
    pub state: String,
    /// The node it runs on, if any.
    pub node: String,
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

/// Seconds before the time limit at which a task is signalled. Slurm checks once a minute: the
/// signal may come a minute early, and with less than a minute of warning it may never come.
fn warning_s(time: Option<Duration>) -> u64 {
    let limit = time.map_or(1200, |limit| limit.as_secs());
    (limit / 10).clamp(60, 300)
}

/// The script of an array job.
pub(super) fn script(job: &Job) -> Result<String, ClusterError> {
    let throttle = job.throttle.map(|most| format!("%{most}"));
    let mut script = format!(
        "#!/bin/sh
#SBATCH --job-name=sweep-{}
#SBATCH --array=0-{}{}
#SBATCH --nodes=1 --ntasks=1
#SBATCH --cpus-per-task={}
",
        job.campaign,
        job.tasks.max(1) - 1,
        throttle.unwrap_or_default(),
        job.workers
    );
    // Writing to a string cannot fail.
    if let Some(limit) = job.time {
        let (minutes, seconds) = (limit.as_secs() / 60, limit.as_secs() % 60);
        let _ = writeln!(script, "#SBATCH --time={minutes}:{seconds:02}");
    }
    // sweep replaces the shell, so that signals reach it. The environment of the submitting user is
    // not exported, so Slurm's programs are searched for in the folder where they were found at
    // submission.
    let _ = write!(
        script,
        "#SBATCH --signal=B:USR1@{}
#SBATCH --requeue --open-mode=append --output=log-%A_%a
# Campaign {}: {}, one slice of the open cases each. Made by sweep submit.
unset SLURM_JWT
PATH=${{PATH:-/usr/bin:/bin}}:{}
export PATH
exec {}
",
        warning_s(job.time),
        job.campaign,
        counted(job.tasks, "task"),
        quoted_path(&folder_of_slurm())?,
        job.task_command("$SLURM_ARRAY_TASK_ID")?
    );
    Ok(script)
}

/// The command that submits it.
pub(super) fn command(job: &Job) -> Vec<String> {
    let mut command: Vec<String> = ["sbatch", "--parsable", "--export=NONE", "--chdir"]
        .map(String::from)
        .into();
    command.push(job.plan_folder.display().to_string());
    command.extend(job.submit_arguments.iter().cloned());
    command.push(job.script_path().display().to_string());
    command
}

/// Submits it; returns the number of the job.
pub(super) fn submit(job: &Job) -> Result<String, ClusterError> {
    let command = command(job);
    let arguments: Vec<&str> = command[1..].iter().map(String::as_str).collect();
    let answer = ask(&command[0], &arguments)?;
    // With several clusters the name of one follows.
    let number = answer.lines().last().unwrap_or_default().trim();
    let digits = number.split(';').next().unwrap_or_default();
    if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err(ClusterError::Answer {
            command: command.join(" "),
            said: answer.trim().to_owned(),
        });
    }
    Ok(number.to_owned())
}

/// Maximum number of tasks of an array: MaxArraySize of the site.
pub(super) fn task_limit() -> Result<usize, ClusterError> {
    if which::which("sbatch").is_err() {
        return Err(ClusterError::Missing {
            program: "sbatch".into(),
        });
    }
    let settings = ask("scontrol", &["show", "config"]).unwrap_or_default();
    let line = settings
        .lines()
        .find(|line| line.starts_with("MaxArraySize"));
    Ok(line
        .and_then(|line| line.split('=').nth(1)?.trim().parse().ok())
        .unwrap_or(DEFAULT_ARRAY))
}

/// Tasks of a job that `squeue` lists.
pub(super) fn active(job: &str) -> Result<Vec<ActiveTask>, ClusterError> {
    let lines = ask_about("squeue", &["-h", "-r", "-o", "%K|%T|%N", "-j"], job)?;
    Ok(lines
        .lines()
        .filter_map(|line| {
            let mut parts = line.trim().split('|');
            Some(ActiveTask {
                task: parts.next()?.parse().ok()?,
                state: parts.next()?.to_owned(),
                node: parts.next().unwrap_or_default().to_owned(),
            })
        })
        .collect())
}

/// Ends all tasks of a job; they checkpoint first.
pub(super) fn cancel(job: &str) -> Result<(), ClusterError> {
    ask_about("scancel", &[], job).map(drop)
}

/// Name of this process as task number `task` of an array, if it is that task.
pub(super) fn this_task(task: usize) -> Option<TaskName> {
    let get = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    // Inside a task of some other array this process may be started by hand.
    if get("SLURM_ARRAY_TASK_ID")?.parse() != Ok(task) {
        return None;
    }
    Some(TaskName {
        job: get("SLURM_ARRAY_JOB_ID")?,
        task,
        restart: get("SLURM_RESTART_COUNT")
            .and_then(|count| count.parse().ok())
            .unwrap_or(0),
        node: get("SLURMD_NODENAME")?,
    })
}

/// Requeues a task, unless it was cancelled. `in_advance`: the signal was the one requested ahead
/// of the time limit, which has no other sender; TERM may mean the limit, a preemption or a
/// cancellation.
pub(super) fn start_again(task: &TaskName, in_advance: bool) -> Requeue {
    let name = format!("{}_{}", task.job, task.task);
    if !in_advance && let Ok(answer) = ask("squeue", &["-h", "-j", &name, "-o", "%T|%r"]) {
        let (state, reason) = answer.trim().split_once('|').unwrap_or_default();
        if matches!(state, "COMPLETING" | "CANCELLED") && reason != "TimeLimit" {
            return Requeue::Cancelled;
        }
    }
    match ask("scontrol", &["requeue", &name]) {
        Ok(_) => Requeue::Yes,
        Err(error) => Requeue::No(error.to_string()),
    }
}

/// The folder of Slurm's programs.
fn folder_of_slurm() -> PathBuf {
    let sbatch = which::which("sbatch").ok();
    sbatch
        .and_then(|program| program.parent().map(PathBuf::from))
        .unwrap_or_else(|| PathBuf::from("/usr/bin"))
}

/// Asks about a job, on its cluster if there are several. The answer is empty if it ended some
/// minutes ago, so that Slurm has forgotten it.
fn ask_about(program: &str, options: &[&str], job: &str) -> Result<String, ClusterError> {
    let (number, cluster) = job.split_once(';').unzip();
    let cluster = cluster.map(|cluster| ["-M", cluster]);
    let cluster = cluster.as_ref().map_or(&[][..], |words| words);
    match ask(
        program,
        &[options, &[number.unwrap_or(job)], cluster].concat(),
    ) {
        Err(ClusterError::Refused { said, .. }) if said.contains("Invalid job id") => {
            Ok(String::new())
        }
        answer => answer,
    }
}

/// Runs one of Slurm's programs; returns its output.
fn ask(program: &str, arguments: &[&str]) -> Result<String, ClusterError> {
    let mut command = Command::new(program);
    command.args(arguments);
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        // This includes variables that a job sets for jobs that it submits.
        let is_stray = ["SLURM_JOB", "SLURM_ARRAY", "SLURM_RESTART"]
            .iter()
            .any(|start| text.starts_with(start));
        if is_stray || text.starts_with("SBATCH_") && !CHOICES.contains(&text.as_ref()) {
            command.env_remove(&name);
        }
    }
    let Output {
        status,
        stdout,
        stderr,
    } = command.output().map_err(|_| ClusterError::Missing {
        program: program.to_owned(),
    })?;
    if status.success() {
        return Ok(String::from_utf8_lossy(&stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&stderr);
    let lines = said.lines().filter(|line| !line.trim().is_empty());
    let lines = lines.map(|line| line.trim_start_matches("sbatch: error: "));
    let said = lines.collect::<Vec<_>>().join("; ");
    Err(ClusterError::Refused {
        command: format!("{program} {}", arguments.join(" ")),
        said: if said.is_empty() {
            status.to_string()
        } else {
            said
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warning_comes_at_least_a_minute_ahead() {
        let warning = |minutes| warning_s(Some(Duration::from_mins(minutes)));
        assert_eq!([2, 30, 2880].map(warning), [60, 180, 300]);
        assert_eq!(warning_s(None), 120);
    }
}
