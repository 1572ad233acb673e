//! Submitting: arguments, refusals, cases left to running tasks.

use super::cluster::{Cluster, QUICK, contains};
use crate::harness::words;
use assert_cmd::cargo::cargo_bin;
use std::process::Command;
use std::time::Duration;

#[test]
fn dry_run_prints_what_is_submitted_and_writes_nothing() {
    let cluster = Cluster::new(QUICK);
    let arguments = [
        "submit",
        "small.toml",
        "--tasks",
        "4",
        "--time",
        "1h",
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
    assert!(cluster.input_of("sbatch.arguments").is_empty());
    for line in [
        "#SBATCH --array=0-3%2",
        "#SBATCH --cpus-per-task=2",
        "#SBATCH --time=60:00",
        "#SBATCH --signal=B:USR1@300",
    ] {
        assert!(printed.contains(&format!("{line}\n")), "{line}: {printed}");
    }
    contains(&printed, &["--scratch '/tmp/a b'", "--requeue"]);
    cluster.ok(&arguments);
    let (command, script) = printed.split_once("\n\n").unwrap();
    let given = cluster.input_of("sbatch.arguments");
    let submitted = given.lines().last().unwrap();
    assert_eq!(std::fs::read_to_string(submitted).unwrap(), script);
    let shell = Command::new("sh")
        .args(["-c", &format!("printf '%s\\n' {command}")])
        .output()
        .unwrap();
    assert_eq!(
        String::from_utf8(shell.stdout).unwrap(),
        format!("sbatch\n{given}")
    );
}

#[test]
fn tasks_find_the_start_layers_that_the_campaign_names_from_its_folder() {
    let cluster = Cluster::new(&QUICK.replace("seeds = 3", "seeds = 1"));
    cluster.ok(&["run", "small.toml", "--trajectory", "--quiet"]);
    cluster.ok(&[
        "export",
        "results/small.sqlite",
        "1",
        "--out",
        "layer.xyz",
        "--quiet",
    ]);
    std::fs::rename(cluster.store(), cluster.home().join("first.sqlite")).unwrap();
    let on = r#"seeds = 1
start = { store = "first.sqlite", point = { shear_rate = 1.0 } }"#;
    let again = format!(
        "{}\n[[grid]]\n{}",
        QUICK.replace("seeds = 3", on),
        QUICK.split_once("[[grid]]").unwrap().1.replace(
            "seeds = 3",
            "seeds = 1\ndirection = -1\nstart = 'layer.xyz'"
        )
    );
    std::fs::write(cluster.home().join("small.toml"), again).unwrap();
    // Tasks read a copy of the campaign in another folder, and begin elsewhere.
    let script = cluster.submit(&["--tasks", "2"]);
    cluster.run_all(&script, 4711, 2);
    cluster.ok(&["merge", "small.toml"]);
    let status = cluster.json(&["status", "small.toml", "--json"]);
    assert_eq!(status["cases"]["done"], 4);
    cluster.equals_local_run();
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
    let arguments = cluster.input_of("sbatch.arguments");
    assert!(arguments.lines().any(|line| line == "--export=NONE"));
    let script = std::fs::read_to_string(arguments.lines().last().unwrap()).unwrap();
    assert!(!script.contains("hunter2"));
    let environment = cluster.input_of("sbatch.environment");
    assert!(!environment.contains("SBATCH_EXPORT") && !environment.contains("SLURM_ARRAY"));
    assert!(environment.contains("SBATCH_ACCOUNT=mine"));
    for argument in [
        "--sbatch-arg=--export=ALL",
        "--sbatch-arg=--array=0-9",
        "--sbatch-arg=job.sh",
    ] {
        cluster.not_ok(2, &["submit", "small.toml", argument]);
    }
    for bad in [["--time", "soon"], ["--tasks", "0"]] {
        cluster.not_ok(2, &["submit", "small.toml", bad[0], bad[1]]);
    }
}

#[test]
fn errors_of_slurm_are_named_and_the_same_command_recovers() {
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
        &["no `sbatch`", "login node", "`sweep run`"],
    );
    assert!(!cluster.store().exists(), "nothing was written");
    cluster.set_reply("limit", "4\n");
    contains(
        &cluster.not_ok(2, &submit),
        &["5 tasks", "4 a job may have", "--tasks 4"],
    );
    cluster.set_reply("limit", "1001\n");
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
        cluster.set_reply("rejected", said);
        let error = cluster.not_ok(2, &submit);
        contains(
            &error,
            &[
                "was refused",
                said.rsplit(": ").next().unwrap(),
                advice,
                "repeat the command",
            ],
        );
    }
    std::fs::remove_file(cluster.said().join("rejected")).unwrap();
    cluster.set_reply("job", "Submitted, I think\n");
    contains(
        &cluster.not_ok(2, &submit),
        &["no job number", "squeue --me"],
    );
    cluster.set_reply("job", "4711;north\n");
    contains(
        &cluster.ok(&submit),
        &["job 4711;north: 6 open cases in 5 tasks"],
    );
    // The state of the job is unknown, so nothing is submitted.
    cluster.set_reply(
        "squeue.error",
        "slurm_load_jobs error: Unable to contact slurm controller",
    );
    contains(&cluster.not_ok(2, &submit), &["4711", "--again"]);
    contains(
        &cluster.ok(&["status", "small.toml"]),
        &["tasks are unknown"],
    );
    // The answer of Slurm for a job that ended some minutes ago.
    cluster.set_reply(
        "squeue.error",
        "slurm_load_jobs error: Invalid job id specified",
    );
    cluster.ok(&submit);
}

#[test]
fn plans_of_killed_submissions_are_cleared_by_the_next_one() {
    let cluster = Cluster::new(QUICK);
    let plans = || -> Vec<String> {
        let entries = std::fs::read_dir(cluster.shards().join("plans"));
        let names = entries.into_iter().flatten();
        names
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    };
    let mut left = 0;
    for seeds in 1..=5 {
        // The copy of the program takes a while, in which the submission is killed.
        let _ = std::fs::remove_dir_all(cluster.shards());
        let campaign = QUICK.replace("seeds = 3", &format!("seeds = {seeds}"));
        std::fs::write(cluster.home().join("small.toml"), campaign).unwrap();
        let mut child = cluster
            .command(&["submit", "small.toml", "--tasks", "2", "--quiet"])
            .spawn()
            .unwrap();
        while plans().is_empty() && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_micros(200));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let folder = cluster.shards().join("plans");
        left += plans()
            .iter()
            .filter(|plan| !folder.join(plan).join("job.sh").exists())
            .count();
        // Another plan, so that none replaces the one left behind.
        let campaign = QUICK.replace("seeds = 3", &format!("seeds = {}", seeds + 10));
        std::fs::write(cluster.home().join("small.toml"), campaign).unwrap();
        let script = cluster.submit(&["--tasks", "2", "--again"]);
        let store = rusqlite::Connection::open(cluster.store()).unwrap();
        for plan in plans() {
            let known = "SELECT count(*) FROM submissions WHERE plan = ?1";
            let known: i64 = store.query_row(known, [&plan], |row| row.get(0)).unwrap();
            assert!(known > 0, "{plan} is of no job");
        }
        let names = std::fs::read_dir(script.parent().unwrap()).unwrap();
        let mut names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        assert!(names.all(|name| !name.starts_with('.')));
    }
    assert!(left > 0, "no submission was killed in time");
}

#[test]
fn cases_of_tasks_at_work_are_left_to_them() {
    let cluster = Cluster::new(QUICK);
    cluster.submit(&["--tasks", "3"]);
    cluster.set_reply("squeue", "1|RUNNING|n1\n2|PENDING|\n");
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
    let beside = cluster.sweep(&["run", "small.toml"]);
    contains(
        &words(&beside.stderr),
        &["open cases of submitted tasks", "`sweep cancel"],
    );
}

#[test]
fn commands_of_the_documentation_work() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/cluster.md");
    let page = std::fs::read_to_string(page).unwrap();
    let commands: Vec<&str> = page
        .lines()
        .filter_map(|line| line.strip_prefix("cluster$ "))
        .collect();
    assert_eq!(commands.len(), 3);
    let cluster = Cluster::new(QUICK);
    let file = commands[0].split(' ').nth(2).unwrap();
    std::fs::write(cluster.home().join(file), QUICK).unwrap();
    std::os::unix::fs::symlink(cargo_bin("sweep"), cluster.home().join("sweep")).unwrap();
    let output = Command::new("sh")
        .args(["-eu", "-c", &commands.join("\n")])
        .current_dir(cluster.home())
        .env("PATH", cluster.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    contains(
        &words(&output.stdout),
        &["job 4711", "0 of 6 cases are done"],
    );
}
