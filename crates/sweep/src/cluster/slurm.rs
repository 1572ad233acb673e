//! Slurm: one array job, submitted with `sbatch`, without queries to an accounting database.

use super::{ActiveTask, ClusterError, Job, Requeue, quoted_path};
use crate::store::TaskName;
use crate::text::format::{counted, parse_duration};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::time::Duration;

/// Maximum size of an array where the site does not report it: the default of Slurm.
pub(crate) const DEFAULT_ARRAY: usize = 1001;
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

/// A Slurm cluster with the resources that a job requests.
#[derive(Debug, Clone, Default)]
pub(crate) struct Slurm {
    /// Time limit of a task.
    pub time: Option<TimeLimit>,
    /// Partition.
    pub partition: Option<String>,
    /// Account.
    pub account: Option<String>,
    /// Further arguments of `sbatch`.
    pub arguments: Vec<String>,
}

/// A time limit as Slurm writes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TimeLimit {
    /// As written.
    pub text: String,
    /// Its value.
    pub time: Duration,
}

impl std::str::FromStr for TimeLimit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            "write a time such as 90m or 12h, or as for sbatch: minutes, HH:MM:SS, D-HH or D-HH:MM:SS".to_owned()
        };
        if text.ends_with(|c: char| c.is_ascii_alphabetic()) {
            let time = parse_duration(text).map_err(|_| wrong())?;
            let seconds = time.as_secs();
            let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
            return format!("{hours}:{minutes:02}:{:02}", seconds % 60).parse();
        }
        let (days, rest) = match text.split_once('-') {
            Some((days, rest)) => (Some(days.parse::<u32>().map_err(|_| wrong())?), rest),
            None => (None, text),
        };
        let parts: Vec<u32> = rest
            .split(':')
            .map(|part| part.parse().map_err(|_| wrong()))
            .collect::<Result<_, _>>()?;
        let [hours, minutes, seconds] = match (days, parts.as_slice()) {
            (Some(_), [h]) => [*h, 0, 0],
            (Some(_), [h, m]) => [*h, *m, 0],
            (None, [m]) => [0, *m, 0],
            (None, [m, s]) => [0, *m, *s],
            (_, [h, m, s]) => [*h, *m, *s],
            _ => return Err(wrong()),
        };
        let sum = [
            (days.unwrap_or(0), 86400),
            (hours, 3600),
            (minutes, 60),
            (seconds, 1),
        ]
        .iter()
        .map(|(n, unit)| u64::from(*n) * unit)
        .sum();
        if sum == 0 {
            return Err(wrong());
        }
        Ok(Self {
            text: text.to_owned(),
            time: Duration::from_secs(sum),
        })
    }
}

impl Slurm {
    /// Seconds before the time limit at which a task is signalled. Slurm checks once a minute: the
    /// signal may come a minute early, and with less than a minute of warning it may never come.
    fn warning_s(&self) -> u64 {
        let limit = self
            .time
            .as_ref()
            .map_or(1200, |limit| limit.time.as_secs());
        (limit / 10).clamp(60, 300)
    }

    /// The script of an array job.
    pub(super) fn script(&self, job: &Job) -> Result<String, ClusterError> {
        let mut script = String::from("#!/bin/sh\n");
        let throttle = job
            .throttle
            .map_or_else(String::new, |most| format!("%{most}"));
        let mut option = |text: &str| {
            // Writing to a string cannot fail.
            let _ = writeln!(script, "#SBATCH {text}");
        };
        option(&format!("--job-name=sweep-{}", job.campaign));
        option(&format!("--array=0-{}{throttle}", job.tasks.max(1) - 1));
        option("--nodes=1 --ntasks=1");
        option(&format!("--cpus-per-task={}", job.workers));
        for (name, value) in [
            ("time", self.time.as_ref().map(|limit| &limit.text)),
            ("partition", self.partition.as_ref()),
            ("account", self.account.as_ref()),
        ] {
            if let Some(value) = value {
                option(&format!("--{name}={value}"));
            }
        }
        option(&format!("--signal=B:USR1@{}", self.warning_s()));
        option("--requeue --open-mode=append --output=log-%A_%a");
        let command = job.task_command("$SLURM_ARRAY_TASK_ID")?;
        // sweep replaces the shell, so that signals reach it. The environment of the submitting
        // user is not exported, so Slurm's programs are searched for in the folder where they were
        // found at submission.
        let _ = write!(
            script,
            "# Campaign {}: {}, one slice of the open cases each. Made by sweep submit.
unset SLURM_JWT
PATH=${{PATH:-/usr/bin:/bin}}:{}
export PATH
exec {command}
",
            job.campaign,
            counted(job.tasks, "task"),
            quoted_path(&folder_of_slurm())?,
        );
        Ok(script)
    }

    /// The command that submits it.
    pub(super) fn command(&self, job: &Job) -> Vec<String> {
        let mut command: Vec<String> = ["sbatch", "--parsable", "--export=NONE", "--chdir"]
            .map(String::from)
            .into();
        command.push(job.plan_folder.display().to_string());
        command.extend(self.arguments.iter().cloned());
        command.push(job.script_path().display().to_string());
        command
    }

    /// Submits it; returns the number of the job.
    pub(super) fn submit(&self, job: &Job) -> Result<String, ClusterError> {
        let command = self.command(job);
        let arguments: Vec<&str> = command[1..].iter().map(String::as_str).collect();
        let answer = ask(&command[0], &arguments)?;
        let number = answer.lines().last().unwrap_or_default().trim();
        // `12`, or `12;cluster` where there are several clusters.
        let digits = number.split(';').next().unwrap_or_default();
        if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(ClusterError::Answer {
                command: command.join(" "),
                said: answer.trim().to_owned(),
            });
        }
        Ok(number.to_owned())
    }
}

/// Maximum number of tasks of an array: MaxArraySize of the site.
pub(super) fn task_limit() -> Result<usize, ClusterError> {
    if which::which("sbatch").is_err() {
        return Err(missing("sbatch"));
    }
    Ok(ask("scontrol", &["show", "config"])
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("MaxArraySize"))?;
            line.split('=').nth(1)?.trim().parse().ok()
        })
        .unwrap_or(DEFAULT_ARRAY))
}

/// Tasks of a job that `squeue` lists.
pub(super) fn active(job: &str) -> Result<Vec<ActiveTask>, ClusterError> {
    let (number, cluster) = parts(job);
    let mut arguments = vec!["-h", "-r", "-j", number, "-o", "%K|%T|%N"];
    arguments.extend(cluster.iter().flat_map(|cluster| ["-M", cluster]));
    let lines = match ask("squeue", &arguments) {
        Ok(lines) => lines,
        // The answer of squeue for a job that ended some minutes ago.
        Err(ClusterError::Refused { said, .. }) if said.contains("Invalid job id") => String::new(),
        Err(error) => return Err(error),
    };
    Ok(lines
        .lines()
        .filter_map(|line| {
            let mut parts = line.trim().split('|');
            Some(ActiveTask {
                task: Some(parts.next()?.parse().ok()?),
                state: parts.next()?.to_owned(),
                node: parts.next().unwrap_or_default().to_owned(),
            })
        })
        .collect())
}

/// Ends a job.
pub(super) fn cancel(job: &str) -> Result<(), ClusterError> {
    let (number, cluster) = parts(job);
    let mut arguments = vec![number];
    arguments.extend(cluster.iter().flat_map(|cluster| ["-M", cluster]));
    match ask("scancel", &arguments) {
        Ok(_) => Ok(()),
        Err(ClusterError::Refused { said, .. }) if said.contains("Invalid job id") => Ok(()),
        Err(error) => Err(error),
    }
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

/// Requeues a task, unless it was cancelled.
pub(super) fn start_again(task: &TaskName, in_advance: bool) -> Requeue {
    let name = format!("{}_{}", task.job, task.task);
    // The signal before the time limit is only sent for that; TERM may mean the limit, a preemption
    // or a cancellation.
    if !in_advance && let Ok(answer) = ask("squeue", &["-h", "-j", &name, "-o", "%T|%r"]) {
        let (state, reason) = answer.trim().split_once('|').unwrap_or_default();
        let ending = matches!(state, "COMPLETING" | "CANCELLED");
        if ending && reason != "TimeLimit" {
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

/// A job and its cluster, if named.
fn parts(job: &str) -> (&str, Option<&str>) {
    match job.split_once(';') {
        Some((number, cluster)) => (number, Some(cluster)),
        None => (job, None),
    }
}

/// Runs one of Slurm's programs; returns its output.
fn ask(program: &str, arguments: &[&str]) -> Result<String, ClusterError> {
    let mut command = Command::new(program);
    command.args(arguments);
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        // This includes variables that a job sets for jobs that it submits.
        let stray = text.starts_with("SBATCH_") && !CHOICES.contains(&text.as_ref())
            || text.starts_with("SLURM_JOB")
            || text.starts_with("SLURM_ARRAY")
            || text.starts_with("SLURM_RESTART");
        if stray {
            command.env_remove(&name);
        }
    }
    let Output {
        status,
        stdout,
        stderr,
    } = command.output().map_err(|_| missing(program))?;
    if status.success() {
        return Ok(String::from_utf8_lossy(&stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&stderr);
    let said = said
        .lines()
        .filter(|line| !line.trim().is_empty())
        .map(|line| line.trim_start_matches("sbatch: error: "))
        .collect::<Vec<_>>()
        .join("; ");
    Err(ClusterError::Refused {
        command: format!("{program} {}", arguments.join(" ")),
        advice: advice(&said),
        said: if said.is_empty() {
            status.to_string()
        } else {
            said
        },
    })
}

/// Advice for an error of Slurm.
fn advice(said: &str) -> String {
    let said = said.to_lowercase();
    let about = |words: &[&str]| words.iter().any(|word| said.contains(word));
    let what = if about(&["job array"]) {
        "the site allows smaller arrays only: give fewer --tasks"
    } else if about(&["account", "association"]) {
        "choose an account and a partition that you may use, with --account and --partition"
    } else if about(&["partition"]) {
        "choose a partition with --partition; `sinfo -s` lists them"
    } else if about(&["time limit", "timelimit"]) {
        "choose a shorter --time: unfinished tasks are restarted automatically"
    } else if about(&["limit", "qos", "max"]) {
        "the site limits submitted jobs: give fewer --tasks, or wait until other jobs have ended"
    } else if about(&["contact", "connect", "timed out"]) {
        "Slurm's controller does not answer: check with `squeue --me` whether the job exists; if not, try again \
         in a while"
    } else if about(&["node configuration", "cpu", "memory"]) {
        "no node has so many cores or so much memory: give fewer --workers-per-task"
    } else {
        "correct what it names"
    };
    format!("{what}; then repeat the command")
}

/// The error about a missing program of Slurm.
fn missing(program: &str) -> ClusterError {
    ClusterError::Missing {
        program: program.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_limits_are_read_as_slurm_reads_them() {
        for (text, seconds) in [
            ("90", 5400),
            ("1:30", 90),
            ("12:00:00", 43200),
            ("2-12", 216_000),
            ("1-0:30", 88200),
            ("0-00:00:10", 10),
            ("90m", 5400),
            ("1day 2h 5s", 93605),
        ] {
            let limit: TimeLimit = text.parse().unwrap();
            assert_eq!(limit.time.as_secs(), seconds, "{text}");
            assert!(!limit.text.contains(char::is_alphabetic), "{text}");
        }
        for text in [
            "",
            "0",
            "soon",
            "1:2:3:4",
            "-1",
            "1-",
            "0s",
            "1 fortnight",
            "90\n#SBATCH",
        ] {
            assert!(text.parse::<TimeLimit>().is_err(), "{text:?}");
        }
    }

    #[test]
    fn warning_comes_at_least_a_minute_ahead() {
        let slurm = |text: &str| Slurm {
            time: Some(text.parse().unwrap()),
            ..Slurm::default()
        };
        assert_eq!(slurm("2").warning_s(), 60);
        assert_eq!(slurm("30").warning_s(), 180);
        assert_eq!(slurm("2-0").warning_s(), 300);
        assert_eq!(Slurm::default().warning_s(), 120);
    }
}
