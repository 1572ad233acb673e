//! This machine as a scheduler: a script in the background that runs the tasks one after another. A
//! job is named by the number and the start of its process.

use super::{ActiveTask, ClusterError, Job};
use std::os::unix::process::CommandExt as _;
use std::process::{Command, Stdio};

/// Maximum number of tasks of a job: a shell counts through these in negligible time.
pub(super) const TASK_LIMIT: usize = 100_000;

/// The script: parallel lanes, each with its share of the tasks.
pub(super) fn script(job: &Job) -> Result<String, ClusterError> {
    let command = job.task_command("$task")?;
    let (tasks, lanes) = (job.tasks, job.throttle.unwrap_or(1).min(job.tasks));
    Ok(format!(
        "#!/bin/sh
# Campaign {name}: {tasks} tasks, {lanes} at a time. Made by sweep submit.
# On TERM the tasks checkpoint, lanes end with their task, and this script waits for them.
trap : TERM
lane=0
while [ \"$lane\" -lt {lanes} ]; do
(
    trap exit TERM
    task=$lane
    while [ \"$task\" -lt {tasks} ]; do
        {command}
        task=$((task + {lanes}))
    done
) &
lane=$((lane + 1))
done
until wait; do :; done
",
        name = job.campaign,
    ))
}

/// The command that starts the script.
pub(super) fn command(job: &Job) -> Vec<String> {
    vec!["sh".into(), job.script_path().display().to_string()]
}

/// Starts the script in the background; returns the name of the job.
pub(super) fn submit(job: &Job) -> Result<String, ClusterError> {
    let command = command(job);
    let refused = |error: std::io::Error| ClusterError::Refused {
        command: command.join(" "),
        said: error.to_string(),
    };
    let log = std::fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(job.plan_folder.join("log"))
        .map_err(refused)?;
    let child = Command::new(&command[0])
        .args(&command[1..])
        .stdin(Stdio::null())
        .stdout(log.try_clone().map_err(refused)?)
        .stderr(log)
        // A separate process group, so that it receives no Ctrl-C for others and all its tasks can
        // be ended together.
        .process_group(0)
        .spawn()
        .map_err(refused)?;
    let start = crate::system::process::start_of(child.id()).unwrap_or_default();
    Ok(format!("{}-{start}", child.id()))
}

/// The job as a whole, as long as its script runs.
pub(super) fn active(job: &str) -> Vec<ActiveTask> {
    let task = ActiveTask {
        task: None,
        state: "RUNNING".into(),
        node: "this machine".into(),
    };
    crate::system::process::alive(job)
        .then_some(task)
        .into_iter()
        .collect()
}

/// Signals all processes of a job to stop.
pub(super) fn cancel(job: &str) -> Result<(), ClusterError> {
    if !crate::system::process::alive(job) {
        return Ok(());
    }
    let group = job
        .split('-')
        .next()
        .and_then(|pid| pid.parse().ok())
        .and_then(rustix::process::Pid::from_raw);
    match group
        .map(|group| rustix::process::kill_process_group(group, rustix::process::Signal::TERM))
    {
        None | Some(Ok(()) | Err(rustix::io::Errno::SRCH)) => Ok(()),
        Some(Err(error)) => Err(ClusterError::Refused {
            command: format!("kill -TERM -{job}"),
            said: format!(
                "{error}; cancel it on the machine and with the account that submitted it"
            ),
        }),
    }
}
