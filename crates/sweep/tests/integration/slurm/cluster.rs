//! A cluster of substitutes for Slurm's programs, with helpers.

use crate::harness::{command, send, until, words};
use rusqlite::types::Value;
use rustix::process::Signal;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// Cases of a fraction of a second.
pub(crate) const QUICK: &str = r#"name = "small"
[protocol]
strain = 0.3
discard = 0.0
checkpoint_every = 0.02
[[grid]]
area_fraction = 0.6
friction = 0.3
roughness = 0.01
shear_rate = [1.0, inf]
seeds = 3
spheres = 30
hydrodynamics = "ball-melrose"
"#;

/// A cluster of substitutes in a folder with an odd name.
pub(crate) struct Cluster {
    pub(crate) directory: tempfile::TempDir,
}

/// What Slurm sets for a task.
#[derive(Clone, Copy)]
pub(crate) struct Task {
    pub(crate) job: u32,
    pub(crate) number: usize,
    pub(crate) restart: u32,
    pub(crate) node: &'static str,
}

impl Task {
    /// The first task of the first job.
    pub(crate) const FIRST: Self = Self {
        job: 4711,
        number: 0,
        restart: 0,
        node: "n1",
    };
}

impl Cluster {
    pub(crate) fn new(campaign: &str) -> Self {
        let cluster = Self {
            directory: tempfile::tempdir().unwrap(),
        };
        for folder in [cluster.home(), cluster.said(), cluster.bin()] {
            std::fs::create_dir_all(folder).unwrap();
        }
        std::fs::write(cluster.home().join("small.toml"), campaign).unwrap();
        let said = cluster.said();
        let said = said.display();
        // Each prints the content of a file, and records its arguments.
        cluster.program(
            "sbatch",
            &format!(
                "printf '%s\\n' \"$@\" > '{said}/sbatch.arguments'; env > '{said}/sbatch.environment'\n\
                 if [ -e '{said}/rejected' ]; then cat '{said}/rejected' >&2; exit 1; fi\n\
                 cat '{said}/job'"
            ),
        );
        cluster.program(
            "squeue",
            &format!(
                "if [ -e '{said}/squeue.error' ]; then cat '{said}/squeue.error' >&2; exit 1; fi\n\
                 cat '{said}/squeue' 2>/dev/null; exit 0"
            ),
        );
        cluster.program(
            "scancel",
            &format!("echo \"$@\" >> '{said}/scancel'; rm -f '{said}/squeue'"),
        );
        cluster.program(
            "scontrol",
            &format!(
                "case $1 in\n\
                 show) printf 'Configuration data\\nMaxArraySize            = '; cat '{said}/limit';;\n\
                 requeue) echo \"$2\" >> '{said}/requeue';;\nesac"
            ),
        );
        cluster.set_reply("job", "4711\n");
        cluster.set_reply("limit", "1001\n");
        cluster
    }

    pub(crate) fn program(&self, name: &str, text: &str) {
        use std::os::unix::fs::PermissionsExt as _;
        let path = self.bin().join(name);
        std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    pub(crate) fn home(&self) -> PathBuf {
        self.directory.path().join("it's a $HOME; really")
    }

    pub(crate) fn said(&self) -> PathBuf {
        self.directory.path().join("said")
    }

    pub(crate) fn bin(&self) -> PathBuf {
        self.directory.path().join("bin")
    }

    pub(crate) fn shards(&self) -> PathBuf {
        self.home().join("results/small.shards")
    }

    pub(crate) fn store(&self) -> PathBuf {
        self.home().join("results/small.sqlite")
    }

    pub(crate) fn set_reply(&self, name: &str, text: &str) {
        std::fs::write(self.said().join(name), text).unwrap();
    }

    pub(crate) fn input_of(&self, name: &str) -> String {
        std::fs::read_to_string(self.said().join(name)).unwrap_or_default()
    }

    pub(crate) fn path(&self) -> String {
        format!("{}:/usr/bin:/bin", self.bin().display())
    }

    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = command(&self.home(), arguments);
        command.env("PATH", self.path());
        command
    }

    pub(crate) fn sweep(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// The output of a command that ends with 0.
    pub(crate) fn ok(&self, arguments: &[&str]) -> String {
        let output = self.sweep(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {output:?}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// The messages of a command that ends with some code, without line breaks.
    pub(crate) fn not_ok(&self, code: i32, arguments: &[&str]) -> String {
        let output = self.sweep(arguments);
        assert_eq!(
            output.status.code(),
            Some(code),
            "{arguments:?}: {output:?}"
        );
        words(&output.stderr)
    }

    pub(crate) fn json(&self, arguments: &[&str]) -> serde_json::Value {
        serde_json::from_str(&self.ok(arguments)).unwrap()
    }

    /// Submits and gives the script.
    pub(crate) fn submit(&self, arguments: &[&str]) -> PathBuf {
        let mut all = vec!["submit", "small.toml", "--quiet", "--json"];
        all.extend(arguments);
        let answer = self.json(&all);
        let plan = answer["plan"].as_str().unwrap();
        self.shards().join("plans").join(plan).join("job.sh")
    }

    /// Starts a task as Slurm would, with nothing in its environment but what Slurm sets.
    pub(crate) fn start(&self, script: &Path, task: Task) -> Child {
        Command::new("/bin/sh")
            .arg(script)
            .current_dir("/")
            .env_clear()
            .env("PATH", self.path())
            .env("SLURM_ARRAY_JOB_ID", task.job.to_string())
            .env("SLURM_ARRAY_TASK_ID", task.number.to_string())
            .env("SLURM_RESTART_COUNT", task.restart.to_string())
            .env("SLURMD_NODENAME", task.node)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// Runs the tasks of a job to their end.
    pub(crate) fn run_all(&self, script: &Path, job: u32, tasks: usize) {
        for task in 0..tasks {
            let task = Task {
                job,
                number: task,
                restart: 0,
                node: "n1",
            };
            let output = self.start(script, task).wait_with_output().unwrap();
            assert_eq!(output.status.code(), Some(0), "{output:?}");
        }
    }

    /// Runs a task in short intervals until its checkpoints have a number of steps, and leaves it
    /// stopped: on any machine it is then unfinished.
    pub(crate) fn hold_at_steps(&self, child: &Child, task: Task, steps: i64) {
        until("checkpoints", || {
            run_for_a_moment(child);
            (self.steps_of(task) >= steps).then_some(())
        });
    }

    /// Steps in the checkpoints of a task's own store.
    fn steps_of(&self, task: Task) -> i64 {
        let name = format!(
            ".{}.{}.{}.{}.sqlite",
            task.job, task.number, task.restart, task.node
        );
        let files = std::fs::read_dir(self.shards().join("work"));
        let work = files
            .into_iter()
            .flatten()
            .map(|file| file.unwrap().path())
            .find(|path| path.display().to_string().ends_with(&name));
        work.and_then(|path| rusqlite::Connection::open(path).ok())
            .and_then(|store| {
                // A task that is stopped with the lock releases it when it continues.
                store.busy_timeout(Duration::from_millis(100)).ok()?;
                let query = "SELECT coalesce(sum(steps_done), 0) FROM cases";
                store.query_row(query, [], |row| row.get(0)).ok()
            })
            .unwrap_or(0)
    }

    /// Running cases in published shards.
    pub(crate) fn published_halves(&self) -> i64 {
        let files = std::fs::read_dir(self.shards()).into_iter().flatten();
        files
            .map(|file| file.unwrap().path())
            .filter(|path| path.extension().is_some_and(|ending| ending == "sqlite"))
            .map(|path| -> i64 {
                let shard = rusqlite::Connection::open(path).unwrap();
                let query = "SELECT count(*) FROM cases WHERE state = 'running' AND steps_done > 0";
                shard.query_row(query, [], |row| row.get(0)).unwrap()
            })
            .sum()
    }

    /// All that was computed.
    pub(crate) fn results(&self, store: &str) -> Vec<Vec<Value>> {
        let store = rusqlite::Connection::open(self.home().join(store)).unwrap();
        [
            "SELECT c.key, c.state, c.steps_done, s.* FROM cases c JOIN samples s ON s.case_id = c.id ORDER BY c.key, s.step",
            "SELECT c.key, c.state, r.viscosity, r.minimum_gap, r.worst_residual, r.stages FROM cases c
                 LEFT JOIN results r ON r.case_id = c.id ORDER BY c.key",
        ]
        .iter()
        .flat_map(|query| {
            let mut query = store.prepare(query).unwrap();
            let columns: Vec<usize> = (0..query.column_count())
                .filter(|column| query.column_name(*column).unwrap() != "case_id")
                .collect();
            query
                .query_map([], |row| columns.iter().map(|column| row.get(*column)).collect())
                .unwrap()
                .collect::<Result<Vec<Vec<Value>>, _>>()
                .unwrap()
        })
        .collect()
    }

    /// Checks that the store holds exactly the results of a local run.
    pub(crate) fn equals_local_run(&self) {
        self.ok(&["run", "small.toml", "--store", "local.sqlite", "--quiet"]);
        let (local, merged) = (
            self.results("local.sqlite"),
            self.results("results/small.sqlite"),
        );
        assert!(local.len() > 12);
        assert_eq!(merged, local);
    }
}

/// Continues a stopped process for some milliseconds.
pub(crate) fn run_for_a_moment(child: &Child) {
    send(child, Signal::CONT);
    std::thread::sleep(Duration::from_millis(5));
    send(child, Signal::STOP);
}

pub(crate) fn contains(text: &str, parts: &[&str]) {
    // Lines are broken at slashes and hyphens too.
    let joined = |text: &str| text.split_whitespace().collect::<String>();
    for part in parts {
        assert!(
            joined(text).contains(&joined(part)),
            "{part:?} not in {text}"
        );
    }
}

pub(crate) const LONG: &str = "strain = 40.0";

pub(crate) fn long() -> String {
    QUICK
        .replace("strain = 0.3", LONG)
        .replace("seeds = 3", "seeds = 1")
}
