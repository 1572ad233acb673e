//! This machine as an engine: a script in the background that runs the tasks one after another.

use super::{ActiveTask, Engine, EngineError, Job};
use crate::store;
use std::os::unix::process::CommandExt as _;
use std::process::{Command, Stdio};

/// Tasks in the background of this machine. A job is named by the number and the start of its process.
#[derive(Debug, Clone, Copy, Default)]
pub struct Local;

impl Engine for Local {
    fn name(&self) -> &'static str {
        "local"
    }

    fn task_limit(&self) -> Result<usize, EngineError> {
        Ok(100_000)
    }

    fn script(&self, job: &Job) -> Result<String, EngineError> {
        let command = job.task_command("$task")?;
        let (tasks, lanes) = (job.tasks, job.throttle.unwrap_or(1).min(job.tasks));
        Ok(format!(
            "#!/bin/sh
# Campaign {name}: {tasks} tasks, {lanes} at a time. Made by sweep submit.
# Told to stop, tasks checkpoint, lanes end with their task, and this waits for them.
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

    fn command(&self, job: &Job) -> Vec<String> {
        vec!["sh".into(), job.script_path().display().to_string()]
    }

    fn submit(&self, job: &Job) -> Result<String, EngineError> {
        let command = self.command(job);
        let refused = |error: std::io::Error| EngineError::Refused {
            command: command.join(" "),
            said: error.to_string(),
            advice: "nothing was started".into(),
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
            // A group of its own: no Ctrl-C meant for others, and all its tasks can be ended at once.
            .process_group(0)
            .spawn()
            .map_err(refused)?;
        let start = store::start_of(child.id()).unwrap_or_default();
        Ok(format!("{}-{start}", child.id()))
    }

    fn active(&self, job: &str) -> Result<Vec<ActiveTask>, EngineError> {
        let task = ActiveTask {
            task: None,
            state: "RUNNING".into(),
            node: "this machine".into(),
        };
        Ok(store::alive(job).then_some(task).into_iter().collect())
    }

    fn cancel(&self, job: &str) -> Result<(), EngineError> {
        if !store::alive(job) {
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
            Some(Err(error)) => Err(EngineError::Refused {
                command: format!("kill -TERM -{job}"),
                said: error.to_string(),
                advice: "cancel it from the machine and the account that submitted it".into(),
            }),
        }
    }
}
