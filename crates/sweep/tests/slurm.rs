//! Campaigns on a cluster, with stand-ins for Slurm's programs on PATH. `scripts/slurm-test` does it with a real one.
#![expect(
    clippy::unwrap_used,
    reason = "tests: a panic is the failure, and names state the fact"
)]

use assert_cmd::cargo::cargo_bin;
use rusqlite::types::Value;
use rustix::process::{Pid, Signal, kill_process};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Cases of a fraction of a second.
const QUICK: &str = r#"name = "small"
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

/// A cluster of stand-ins in a folder with an odd name.
struct Cluster {
    directory: tempfile::TempDir,
}

/// What Slurm sets for a task.
#[derive(Clone, Copy)]
struct Task {
    job: u32,
    number: usize,
    restart: u32,
    node: &'static str,
}

impl Cluster {
    fn new(campaign: &str) -> Self {
        let cluster = Self {
            directory: tempfile::tempdir().unwrap(),
        };
        for folder in [cluster.home(), cluster.said(), cluster.bin()] {
            std::fs::create_dir_all(folder).unwrap();
        }
        std::fs::write(cluster.home().join("small.toml"), campaign).unwrap();
        let said = cluster.said();
        let said = said.display();
        // Each says what a file tells it to say, and writes down what it was asked.
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
        cluster.says("job", "4711\n");
        cluster.says("limit", "1001\n");
        cluster
    }

    fn program(&self, name: &str, text: &str) {
        use std::os::unix::fs::PermissionsExt as _;
        let path = self.bin().join(name);
        std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn home(&self) -> PathBuf {
        self.directory.path().join("it's a $HOME; really")
    }

    fn said(&self) -> PathBuf {
        self.directory.path().join("said")
    }

    fn bin(&self) -> PathBuf {
        self.directory.path().join("bin")
    }

    fn shards(&self) -> PathBuf {
        self.home().join("results/small.shards")
    }

    fn store(&self) -> PathBuf {
        self.home().join("results/small.sqlite")
    }

    fn says(&self, name: &str, text: &str) {
        std::fs::write(self.said().join(name), text).unwrap();
    }

    fn was_told(&self, name: &str) -> String {
        std::fs::read_to_string(self.said().join(name)).unwrap_or_default()
    }

    fn path(&self) -> String {
        format!("{}:/usr/bin:/bin", self.bin().display())
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(cargo_bin("sweep"));
        command
            .current_dir(self.home())
            .env("PATH", self.path())
            .env("NO_COLOR", "1")
            .args(arguments);
        command
    }

    fn sweep(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// What a command prints that ends with 0.
    fn ok(&self, arguments: &[&str]) -> String {
        let output = self.sweep(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {output:?}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// What a command says that ends with some code, without line breaks.
    fn not_ok(&self, code: i32, arguments: &[&str]) -> String {
        let output = self.sweep(arguments);
        assert_eq!(
            output.status.code(),
            Some(code),
            "{arguments:?}: {output:?}"
        );
        words(&output.stderr)
    }

    fn json(&self, arguments: &[&str]) -> serde_json::Value {
        serde_json::from_str(&self.ok(arguments)).unwrap()
    }

    /// Submits and gives the script.
    fn submit(&self, arguments: &[&str]) -> PathBuf {
        let mut all = vec!["submit", "small.toml", "--quiet", "--json"];
        all.extend(arguments);
        let answer = self.json(&all);
        let plan = answer["plan"].as_str().unwrap();
        self.shards().join("plans").join(plan).join("job.sh")
    }

    /// Starts a task as Slurm would, with nothing in its environment but what Slurm sets.
    fn start(&self, script: &Path, task: Task) -> Child {
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
    fn run_all(&self, script: &Path, job: u32, tasks: usize) {
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

    /// Waits until the store a task works in has so many steps in its checkpoints.
    fn wait_for_steps(&self, task: Task, steps: i64) {
        let begun = Instant::now();
        loop {
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
            let found: i64 = work
                .and_then(|path| rusqlite::Connection::open(path).ok())
                .and_then(|store| {
                    store.busy_timeout(Duration::from_secs(10)).ok()?;
                    let query = "SELECT coalesce(sum(steps_done), 0) FROM cases";
                    store.query_row(query, [], |row| row.get(0)).ok()
                })
                .unwrap_or(0);
            if found >= steps {
                return;
            }
            assert!(begun.elapsed() < Duration::from_mins(2), "no checkpoint");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// All that was computed.
    fn results(&self, store: &str) -> Vec<Vec<Value>> {
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

    /// That the store holds what a local run computes, and nothing else.
    fn equals_local_run(&self) {
        self.ok(&["run", "small.toml", "--store", "local.sqlite", "--quiet"]);
        let (local, merged) = (
            self.results("local.sqlite"),
            self.results("results/small.sqlite"),
        );
        assert!(local.len() > 12);
        assert_eq!(merged, local);
    }
}

/// A text on one line, as errors are broken wherever the screen ends.
fn words(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text).replace(['│', '╰', '─', '▶'], " ");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn contains(text: &str, parts: &[&str]) {
    // Lines are broken at slashes and hyphens too.
    let joined = |text: &str| text.split_whitespace().collect::<String>();
    for part in parts {
        assert!(
            joined(text).contains(&joined(part)),
            "{part:?} not in {text}"
        );
    }
}

fn send(child: &Child, signal: Signal) {
    kill_process(Pid::from_child(child), signal).unwrap();
}

const LONG: &str = "strain = 4.0";

fn long() -> String {
    QUICK
        .replace("strain = 0.3", LONG)
        .replace("seeds = 3", "seeds = 1")
}

#[test]
fn dry_run_prints_what_is_submitted_and_writes_nothing() {
    let cluster = Cluster::new(QUICK);
    let arguments = [
        "submit",
        "small.toml",
        "--tasks",
        "4",
        "--time",
        "1:00:00",
        "--partition",
        "short",
        "--account",
        "it.me",
        "--throttle",
        "2",
        "--workers-per-task",
        "2",
        "--sbatch-arg=--mem=1G",
        "--scratch",
        "/tmp/a b",
    ];
    let dry: Vec<&str> = arguments.iter().copied().chain(["--dry-run"]).collect();
    let printed = cluster.ok(&dry);
    let home: Vec<_> = std::fs::read_dir(cluster.home()).unwrap().collect();
    assert_eq!(home.len(), 1, "{home:?}");
    assert!(cluster.was_told("sbatch.arguments").is_empty());
    for line in [
        "#SBATCH --array=0-3%2",
        "#SBATCH --cpus-per-task=2",
        "#SBATCH --time=1:00:00",
        "#SBATCH --partition=short",
        "#SBATCH --account=it.me",
        "#SBATCH --signal=B:USR1@300",
    ] {
        assert!(printed.contains(&format!("{line}\n")), "{line}: {printed}");
    }
    contains(&printed, &["--scratch '/tmp/a b'", "--requeue"]);
    cluster.ok(&arguments);
    let (command, script) = printed.split_once("\n\n").unwrap();
    let told = cluster.was_told("sbatch.arguments");
    let submitted = told.lines().last().unwrap();
    assert_eq!(std::fs::read_to_string(submitted).unwrap(), script);
    let shell = Command::new("sh")
        .args(["-c", &format!("printf '%s\\n' {command}")])
        .output()
        .unwrap();
    assert_eq!(
        String::from_utf8(shell.stdout).unwrap(),
        format!("sbatch\n{told}")
    );
}

#[test]
fn nothing_of_the_environment_goes_along() {
    let cluster = Cluster::new(QUICK);
    let output = cluster
        .command(&["submit", "small.toml", "--tasks", "2"])
        .env("API_TOKEN", "hunter2")
        .env("SBATCH_EXPORT", "ALL")
        .env("SBATCH_ACCOUNT", "mine")
        .env("SLURM_ARRAY_TASK_ID", "9")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let arguments = cluster.was_told("sbatch.arguments");
    assert!(arguments.lines().any(|line| line == "--export=NONE"));
    let script = std::fs::read_to_string(arguments.lines().last().unwrap()).unwrap();
    assert!(!script.contains("hunter2"));
    let environment = cluster.was_told("sbatch.environment");
    assert!(!environment.contains("SBATCH_EXPORT") && !environment.contains("SLURM_ARRAY"));
    assert!(environment.contains("SBATCH_ACCOUNT=mine"));
    for argument in [
        "--sbatch-arg=--export=ALL",
        "--sbatch-arg=--array=0-9",
        "--sbatch-arg=job.sh",
    ] {
        cluster.not_ok(2, &["submit", "small.toml", argument]);
    }
    for bad in [
        ["--partition", "a b"],
        ["--account", "x\n#SBATCH"],
        ["--time", "soon"],
        ["--tasks", "0"],
    ] {
        cluster.not_ok(2, &["submit", "small.toml", bad[0], bad[1]]);
    }
}

#[test]
fn tasks_compute_what_a_local_run_does() {
    let cluster = Cluster::new(QUICK);
    let script = cluster.submit(&["--tasks", "4"]);
    cluster.run_all(&script, 4711, 4);
    let text = cluster.ok(&["merge", "small.toml"]);
    contains(
        &text,
        &["4 shards read", "6 new results", "6 of 6 cases are done"],
    );
    contains(
        &cluster.ok(&["merge", "small.toml"]),
        &["4 unchanged: 0 new"],
    );
    cluster.equals_local_run();
    // Nothing is left behind but shards, plans and the program.
    assert_eq!(
        std::fs::read_dir(cluster.shards().join("work"))
            .unwrap()
            .count(),
        0
    );
    contains(
        &cluster.ok(&["submit", "small.toml"]),
        &["nothing to submit"],
    );
    // A value more: only what is new is submitted.
    std::fs::write(
        cluster.home().join("small.toml"),
        QUICK.replace("seeds = 3", "seeds = 4"),
    )
    .unwrap();
    let answer = cluster.json(&["submit", "small.toml", "--tasks", "9", "--quiet", "--json"]);
    assert_eq!((&answer["cases"], &answer["tasks"]), (&2.into(), &2.into()));
    // From nothing but shards.
    cluster.ok(&["merge", "again.sqlite", "results/small.shards"]);
    assert_eq!(
        cluster.results("again.sqlite"),
        cluster.results("local.sqlite")
    );
}

#[test]
fn task_told_to_stop_is_started_again_and_goes_on_elsewhere() {
    let cluster = Cluster::new(&long());
    let script = cluster.submit(&["--tasks", "1"]);
    let mut task = Task {
        job: 4711,
        number: 0,
        restart: 0,
        node: "n1",
    };
    for (signal, code, node) in [(Signal::USR1, 138, "n2"), (Signal::TERM, 143, "n1")] {
        cluster.says("squeue", "COMPLETING|TimeLimit\n");
        let child = cluster.start(&script, task);
        cluster.wait_for_steps(task, 8 + 400 * i64::from(task.restart));
        send(&child, signal);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{output:?}");
        contains(&words(&output.stderr), &["starts the task again"]);
        task.restart += 1;
        task.node = node;
    }
    assert_eq!(cluster.was_told("requeue"), "4711_0\n4711_0\n");
    // A plain scancel is not a wish for more.
    cluster.says("squeue", "COMPLETING|None\n");
    let child = cluster.start(&script, task);
    cluster.wait_for_steps(task, 500);
    send(&child, Signal::TERM);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{output:?}");
    contains(&words(&output.stderr), &["cancelled"]);
    assert_eq!(cluster.was_told("requeue").lines().count(), 2);
    std::fs::remove_file(cluster.said().join("squeue")).unwrap();
    // A new job goes on from what was published, merged or not.
    let script = cluster.submit(&["--tasks", "1"]);
    cluster.run_all(&script, 4712, 1);
    cluster.ok(&["merge", "small.toml"]);
    let store = rusqlite::Connection::open(cluster.store()).unwrap();
    let resumed: i64 = store
        .query_row("SELECT max(resumed) FROM results", [], |row| row.get(0))
        .unwrap();
    assert!(resumed >= 2, "{resumed}");
    cluster.equals_local_run();
}

#[test]
fn killed_task_loses_no_more_than_since_it_published() {
    let cluster = Cluster::new(&long());
    let script = cluster.submit(&["--tasks", "1", "--publish-every", "0"]);
    let mut task = Task {
        job: 4711,
        number: 0,
        restart: 0,
        node: "n1",
    };
    let mut child = cluster.start(&script, task);
    let begun = Instant::now();
    // Until a shard with a checkpoint is there for all to read.
    loop {
        let shards = cluster.json(&["status", "small.toml", "--json"]);
        if shards["jobs"][0]["tasks"][0]["work_done"].as_f64().unwrap() > 0.05 {
            break;
        }
        assert!(begun.elapsed() < Duration::from_mins(2), "{shards}");
        std::thread::sleep(Duration::from_millis(50));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    // The disk of that node is gone with it.
    std::fs::remove_dir_all(cluster.shards().join("work")).unwrap();
    task.restart = 1;
    task.node = "n2";
    let output = cluster.start(&script, task).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    cluster.ok(&["merge", "small.toml"]);
    let store = rusqlite::Connection::open(cluster.store()).unwrap();
    let resumed: i64 = store
        .query_row("SELECT max(resumed) FROM results", [], |row| row.get(0))
        .unwrap();
    assert_eq!(resumed, 1);
    cluster.equals_local_run();
}

#[test]
fn task_that_runs_twice_at_once_does_no_harm() {
    let cluster = Cluster::new(QUICK);
    let script = cluster.submit(&["--tasks", "1", "--publish-every", "0"]);
    let task = Task {
        job: 4711,
        number: 0,
        restart: 0,
        node: "n1",
    };
    let twins = [
        task,
        Task {
            restart: 1,
            node: "n2",
            ..task
        },
        // Even under one name.
        task,
    ];
    let children: Vec<Child> = twins
        .iter()
        .map(|task| cluster.start(&script, *task))
        .collect();
    for child in children {
        let output = child.wait_with_output().unwrap();
        assert!(output.status.code().is_some(), "{output:?}");
    }
    let merged = cluster.json(&["merge", "small.toml", "--json"]);
    assert_eq!(merged["results"], 6);
    assert_eq!(merged["duplicates"], 6);
    assert_eq!(merged["disagreements"].as_array().unwrap().len(), 0);
    cluster.equals_local_run();
}

#[test]
fn trouble_with_slurm_is_named_and_the_same_command_recovers() {
    let cluster = Cluster::new(QUICK);
    let submit = ["submit", "small.toml", "--tasks", "5", "--quiet"];
    let empty = tempfile::tempdir().unwrap();
    let output = cluster
        .command(&submit)
        .env("PATH", empty.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    contains(
        &words(&output.stderr),
        &["no `sbatch`", "login node", "--engine local"],
    );
    assert!(!cluster.store().exists(), "nothing was written");
    cluster.says("limit", "4\n");
    contains(
        &cluster.not_ok(2, &submit),
        &["5 tasks", "4 a job may have", "--tasks 4"],
    );
    cluster.says("limit", "1001\n");
    for (said, advice) in [
        (
            "sbatch: error: invalid partition specified: gpu\nsbatch: error: Batch job submission failed: Invalid partition name specified",
            "sinfo -s",
        ),
        (
            "sbatch: error: Batch job submission failed: Invalid account or account/partition combination specified",
            "--partition",
        ),
        (
            "sbatch: error: Batch job submission failed: Invalid job array specification",
            "fewer --tasks",
        ),
        (
            "sbatch: error: QOSMaxSubmitJobPerUserLimit",
            "fewer --tasks",
        ),
        (
            "sbatch: error: Unable to contact slurm controller (connect failure)",
            "try again",
        ),
    ] {
        cluster.says("rejected", said);
        let error = cluster.not_ok(2, &submit);
        contains(
            &error,
            &[
                "was refused",
                said.rsplit(": ").next().unwrap(),
                advice,
                "same command",
            ],
        );
    }
    std::fs::remove_file(cluster.said().join("rejected")).unwrap();
    cluster.says("job", "Submitted, I think\n");
    contains(
        &cluster.not_ok(2, &submit),
        &["no job number", "squeue --me"],
    );
    cluster.says("job", "4711;north\n");
    contains(
        &cluster.ok(&submit),
        &["job 4711;north: 6 open cases in 5 tasks"],
    );
    // Whether the job runs is not known: nothing is submitted blindly.
    cluster.says(
        "squeue.error",
        "slurm_load_jobs error: Unable to contact slurm controller",
    );
    contains(&cluster.not_ok(2, &submit), &["4711", "--again"]);
    contains(
        &cluster.ok(&["status", "small.toml"]),
        &["cannot be asked for", "unknown"],
    );
    // So says Slurm of a job that ended some minutes ago.
    cluster.says(
        "squeue.error",
        "slurm_load_jobs error: Invalid job id specified",
    );
    cluster.ok(&submit);
}

#[test]
fn cases_of_tasks_at_work_are_left_to_them() {
    let cluster = Cluster::new(QUICK);
    cluster.submit(&["--tasks", "3"]);
    cluster.says("squeue", "1|RUNNING|n1\n2|PENDING|\n");
    let answer = cluster.json(&["submit", "small.toml", "--tasks", "3", "--quiet", "--json"]);
    assert_eq!(answer["cases"], 2);
    let answer = cluster.json(&[
        "submit",
        "small.toml",
        "--tasks",
        "3",
        "--quiet",
        "--json",
        "--again",
    ]);
    assert_eq!(answer["cases"], 6);
}

#[test]
fn status_shows_tasks_and_slices_and_cancel_ends_them() {
    let cluster = Cluster::new(&long());
    let script = cluster.submit(&["--tasks", "2"]);
    cluster.says("squeue", "0|RUNNING|n1\n1|PENDING|\n");
    let task = Task {
        job: 4711,
        number: 0,
        restart: 0,
        node: "n1",
    };
    let child = cluster.start(&script, task);
    cluster.wait_for_steps(task, 40);
    let status = cluster.json(&["status", "small.toml", "--json"]);
    let tasks = &status["jobs"][0]["tasks"];
    assert_eq!(status["jobs"][0]["job"], "4711");
    assert_eq!(
        (&tasks[0]["state"], &tasks[0]["node"]),
        (&"running".into(), &"n1".into())
    );
    assert_eq!(
        (&tasks[1]["state"], &tasks[1]["cases"]),
        (&"pending".into(), &1.into())
    );
    let text = cluster.ok(&["status", "small.toml"]);
    contains(
        &text,
        &[
            "job 4711 on slurm: 2 tasks",
            "pending",
            "newer than the store",
        ],
    );
    contains(
        &cluster.ok(&["cancel", "small.toml"]),
        &["cancelled: 4711", "sweep submit"],
    );
    assert_eq!(cluster.was_told("scancel"), "4711\n");
    // Even where squeue could not tell: the mark is there.
    cluster.says("squeue", "RUNNING|None\n");
    send(&child, Signal::TERM);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{output:?}");
    assert!(cluster.was_told("requeue").is_empty());
    std::fs::remove_file(cluster.said().join("squeue")).unwrap();
    contains(&cluster.ok(&["cancel", "small.toml"]), &["no tasks"]);
    contains(
        &cluster.not_ok(2, &["cancel", "small.toml", "--job", "1"]),
        &["no such job"],
    );
    let script = cluster.submit(&["--tasks", "1"]);
    cluster.run_all(&script, 4712, 1);
    cluster.ok(&["merge", "small.toml"]);
    let store = rusqlite::Connection::open(cluster.store()).unwrap();
    let resumed: i64 = store
        .query_row("SELECT sum(resumed) FROM results", [], |row| row.get(0))
        .unwrap();
    assert!(resumed >= 1);
    contains(
        &cluster.ok(&["status", "small.toml"]),
        &["cancelled", "1 of their slices done"],
    );
}

#[test]
fn vanished_folder_is_named_and_submitting_again_recovers() {
    let cluster = Cluster::new(&long());
    let script = cluster.submit(&["--tasks", "1"]);
    let text = std::fs::read_to_string(&script).unwrap();
    let task = Task {
        job: 4711,
        number: 0,
        restart: 0,
        node: "n1",
    };
    // Under way, it is made again: what is computed counts. The store at work is on another disk.
    let scratch = cluster.directory.path().join("scratch");
    let elsewhere = cluster.directory.path().join("job.sh");
    std::fs::write(
        &elsewhere,
        text.replace(
            "--workers 1",
            &format!("--workers 1 --scratch {}", scratch.display()),
        ),
    )
    .unwrap();
    let child = cluster.start(&elsewhere, task);
    let begun = Instant::now();
    while std::fs::read_dir(&scratch).map_or(0, Iterator::count) == 0 {
        assert!(begun.elapsed() < Duration::from_mins(1));
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_millis(300));
    std::fs::remove_dir_all(cluster.shards()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    contains(
        &cluster.ok(&["merge", "small.toml"]),
        &["2 of 2 cases are done"],
    );
    // Before a task starts, and before a merge.
    std::fs::write(cluster.home().join("small.toml"), QUICK).unwrap();
    let script = cluster.submit(&["--tasks", "1"]);
    let text = std::fs::read_to_string(script).unwrap();
    std::fs::remove_dir_all(cluster.shards()).unwrap();
    contains(
        &cluster.not_ok(2, &["merge", "small.toml"]),
        &["no folder of shards at", "small.shards", "sweep submit"],
    );
    std::fs::write(&elsewhere, text.replace("exec", "exec true")).unwrap();
    let error = cluster.not_ok(
        2,
        &[
            "run",
            "small.toml",
            "--shard",
            "0/1",
            "--slices",
            "results/small.shards/plans/x/slices",
        ],
    );
    contains(&error, &["no slices at", "was deleted", "sweep submit"]);
    let script = cluster.submit(&["--tasks", "2"]);
    cluster.run_all(&script, 4712, 2);
    cluster.ok(&["merge", "small.toml"]);
    let status = cluster.json(&["status", "small.toml", "--json"]);
    assert_eq!(status["cases"]["done"], 6);
}

#[test]
fn half_written_shard_is_named_and_the_rest_is_merged_and_submitted_again() {
    let cluster = Cluster::new(QUICK);
    let script = cluster.submit(&["--tasks", "3"]);
    cluster.run_all(&script, 4711, 3);
    let shards = || {
        let entries = std::fs::read_dir(cluster.shards()).unwrap();
        let paths = entries.map(|entry| entry.unwrap().path());
        let mut shards: Vec<PathBuf> = paths
            .filter(|path| path.extension().is_some_and(|ending| ending == "sqlite"))
            .collect();
        shards.sort();
        shards
    };
    let half = shards()[1].clone();
    let bytes = std::fs::read(&half).unwrap();
    std::fs::write(&half, &bytes[..bytes.len() / 2]).unwrap();
    // As a copy that was cut short leaves it; nobody takes it for a shard.
    std::fs::write(cluster.shards().join(".x.1.2.3.n1.sqlite.part-7"), "half").unwrap();
    let output = cluster.sweep(&["merge", "small.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let text = words(&output.stdout);
    contains(
        &text,
        &[
            "cannot be read",
            &half.file_name().unwrap().to_string_lossy(),
            "4 new results",
            "sweep submit",
        ],
    );
    let script = cluster.submit(&["--tasks", "3"]);
    cluster.run_all(&script, 4712, 2);
    std::fs::remove_file(half).unwrap();
    cluster.ok(&["merge", "small.toml"]);
    cluster.equals_local_run();
}

#[test]
fn other_builds_are_refused_unless_allowed_and_then_recorded() {
    let cluster = Cluster::new(QUICK);
    let script = cluster.submit(&["--tasks", "2"]);
    cluster.run_all(&script, 4711, 2);
    let shard = std::fs::read_dir(cluster.shards())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .find(|path| path.extension().is_some_and(|ending| ending == "sqlite"))
        .unwrap();
    let edit = rusqlite::Connection::open(&shard).unwrap();
    edit.execute("UPDATE processes SET build = 'older'", [])
        .unwrap();
    edit.pragma_update(None, "journal_mode", "DELETE").unwrap();
    drop(edit);
    contains(
        &cluster.not_ok(2, &["merge", "small.toml"]),
        &["build older", "--allow-mixed-versions"],
    );
    assert_eq!(
        cluster.json(&["status", "small.toml", "--json"])["cases"]["done"],
        0
    );
    contains(
        &cluster.not_ok(2, &["submit", "small.toml"]),
        &["build older"],
    );
    contains(
        &cluster.ok(&["merge", "small.toml", "--allow-mixed-versions"]),
        &["6 of 6", "1 shards of another build"],
    );
    contains(&cluster.ok(&["status", "small.toml"]), &["another build"]);
    // Another campaign.
    std::fs::write(
        cluster.home().join("else.toml"),
        QUICK.replace("small", "else"),
    )
    .unwrap();
    cluster.ok(&["run", "else.toml", "--quiet"]);
    contains(
        &cluster.not_ok(
            2,
            &[
                "merge",
                "small.toml",
                "results/else.sqlite",
                "--allow-mixed-versions",
            ],
        ),
        &["is the store of campaign \"else\", not of \"small\""],
    );
}

#[test]
fn full_disk_of_the_shards_is_named_and_the_same_command_goes_on() {
    let cluster = Cluster::new(QUICK);
    let disk = cluster.directory.path().join("disk");
    std::fs::create_dir(&disk).unwrap();
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=2m", "tmpfs"])
        .arg(&disk)
        .output();
    if !mounted.is_ok_and(|output| output.status.success()) {
        // Only root may make a small disk.
        return;
    }
    let shards = disk.join("small.shards");
    let shards_text = shards.display().to_string();
    let ballast = disk.join("ballast");
    let run = [
        "run",
        "small.toml",
        "--shard",
        "0/1",
        "--shards",
        &shards_text,
        "--scratch",
        "scratch",
        "--publish-every",
        "0",
    ];
    // Full from the start, and then under way.
    let fill = || drop(std::fs::write(&ballast, vec![0_u8; 4 << 20]));
    fill();
    let error = cluster.not_ok(3, &run);
    contains(
        &error,
        &[
            "cannot publish",
            "disk is full or the quota used up",
            "make room in",
            "small.shards",
        ],
    );
    std::fs::remove_file(&ballast).unwrap();
    let child = cluster
        .command(&run)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while std::fs::read_dir(&shards).map_or(0, Iterator::count) == 0 {
        assert!(begun.elapsed() < Duration::from_mins(1));
        std::thread::sleep(Duration::from_millis(2));
    }
    fill();
    let output = child.wait_with_output().unwrap();
    if output.status.code() != Some(0) {
        assert_eq!(output.status.code(), Some(3), "{output:?}");
        contains(
            &words(&output.stderr),
            &["quota used up", "scratch", "holds the rest"],
        );
    }
    std::fs::remove_file(&ballast).unwrap();
    let answer = cluster.ok(&run);
    contains(&answer, &["6 cases done"]);
    cluster.ok(&["merge", "results/small.sqlite", &shards_text]);
    let unmounted = Command::new("umount").arg("-l").arg(&disk).status();
    assert!(unmounted.unwrap().success());
    cluster.equals_local_run();
}

#[test]
fn slices_by_hand_need_no_engine() {
    let cluster = Cluster::new(QUICK);
    for task in ["0/2", "1/2", "1/2"] {
        cluster.ok(&["run", "small.toml", "--shard", task, "--quiet"]);
    }
    for wrong in ["2/2", "0", "0/0", "-1/2", "a/b"] {
        cluster.not_ok(2, &["run", "small.toml", "--shard", wrong]);
    }
    cluster.ok(&["merge", "small.toml"]);
    cluster.equals_local_run();
}

#[test]
fn background_of_this_machine_is_an_engine_too() {
    let cluster = Cluster::new(QUICK);
    let submit = [
        "submit",
        "small.toml",
        "--engine",
        "local",
        "--tasks",
        "3",
        "--throttle",
        "2",
        "--quiet",
    ];
    cluster.ok(&submit);
    contains(
        &cluster.not_ok(
            2,
            &["submit", "small.toml", "--engine", "local", "--time", "9"],
        ),
        &["--time"],
    );
    let begun = Instant::now();
    loop {
        let status = cluster.json(&["status", "small.toml", "--json"]);
        let tasks = status["jobs"][0]["tasks"].as_array().unwrap();
        if tasks.iter().all(|task| task["state"] == "done") {
            break;
        }
        assert!(begun.elapsed() < Duration::from_mins(2), "{status}");
        std::thread::sleep(Duration::from_millis(50));
    }
    cluster.ok(&["merge", "small.toml"]);
    cluster.equals_local_run();
    // Cancelled, its tasks checkpoint and end.
    let more = long().replace("strain = 4.0", "strain = 40.0");
    std::fs::write(cluster.home().join("small.toml"), more).unwrap();
    cluster.ok(&submit);
    std::thread::sleep(Duration::from_millis(500));
    contains(&cluster.ok(&["cancel", "small.toml"]), &["cancelled: "]);
    contains(&cluster.ok(&["cancel", "small.toml"]), &["no tasks"]);
}
