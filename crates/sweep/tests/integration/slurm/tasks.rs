//! Tasks: computing, stopping, continuing, cancelling.

use super::cluster::{Cluster, LONG, QUICK, Task, contains, long, run_for_a_moment};
use crate::harness::{send, until, words};
use rustix::process::Signal;
use std::time::Duration;

#[test]
fn tasks_compute_what_a_local_run_does() {
    let cluster = Cluster::new(QUICK);
    let script = cluster.submit(&["--tasks", "4"]);
    cluster.run_all(&script, 4711, 4);
    let text = cluster.ok(&["merge", "small.toml"]);
    contains(
        &text,
        &["4 shards read: 6 new results", "6 of 6 cases are done"],
    );
    contains(
        &cluster.ok(&["merge", "small.toml"]),
        &["4 shards read: 0 new results", "6 results known"],
    );
    cluster.equals_local_run();
    // Only shards, plans and the program remain.
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
    assert_eq!(
        cluster.json(&["submit", "small.toml", "--json"])["cases"],
        0
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
fn tasks_compute_suspensions_as_a_local_run_does() {
    let suspensions = QUICK
        .replace("area_fraction = 0.6", "volume_fraction = 0.45")
        .replace("seeds = 3", "seeds = 2")
        .replace("spheres = 30", "spheres = 60");
    let cluster = Cluster::new(&suspensions);
    let script = cluster.submit(&["--tasks", "3"]);
    cluster.run_all(&script, 4711, 3);
    let text = cluster.ok(&["merge", "small.toml"]);
    contains(&text, &["4 new results", "4 of 4 cases are done"]);
    cluster.equals_local_run();
}

#[test]
fn signalled_task_is_restarted_and_continues_elsewhere() {
    let cluster = Cluster::new(&long().replace(LONG, "strain = 4.0"));
    let script = cluster.submit(&["--tasks", "1"]);
    let mut task = Task::FIRST;
    for (signal, code, node) in [(Signal::USR1, 138, "n2"), (Signal::TERM, 143, "n1")] {
        cluster.set_reply("squeue", "COMPLETING|TimeLimit\n");
        let child = cluster.start(&script, task);
        cluster.hold_at_steps(&child, task, 8 + 200 * i64::from(task.restart));
        send(&child, signal);
        send(&child, Signal::CONT);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{output:?}");
        contains(&words(&output.stderr), &["restarts the task"]);
        task.restart += 1;
        task.node = node;
    }
    assert_eq!(cluster.input_of("requeue"), "4711_0\n4711_0\n");
    // A plain scancel is no request for a restart.
    cluster.set_reply("squeue", "COMPLETING|None\n");
    let child = cluster.start(&script, task);
    cluster.hold_at_steps(&child, task, 400);
    send(&child, Signal::TERM);
    send(&child, Signal::CONT);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{output:?}");
    contains(&words(&output.stderr), &["cancelled"]);
    assert_eq!(cluster.input_of("requeue").lines().count(), 2);
    std::fs::remove_file(cluster.said().join("squeue")).unwrap();
    // A new job continues from published shards, merged or not.
    let script = cluster.submit(&["--tasks", "1"]);
    cluster.run_all(&script, 4712, 1);
    cluster.ok(&["merge", "small.toml"]);
    let store = rusqlite::Connection::open(cluster.store()).unwrap();
    let resumed: i64 = store
        .query_row("SELECT sum(resumed) FROM results", [], |row| row.get(0))
        .unwrap();
    // On a busy machine the task may be between two cases at the signal.
    assert!(resumed >= 1, "{resumed}");
    cluster.equals_local_run();
}

#[test]
fn killed_task_loses_no_more_than_since_it_published() {
    let cluster = Cluster::new(&long().replace(LONG, "strain = 24.0"));
    let script = cluster.submit(&["--tasks", "1", "--publish-every", "0"]);
    let mut task = Task::FIRST;
    let mut child = cluster.start(&script, task);
    // Until a shard with a running case is published. Copies are made at intervals of real time,
    // which pass while the task is stopped within a case.
    cluster.hold_at_steps(&child, task, 8);
    until("a published shard", || {
        std::thread::sleep(Duration::from_secs(1));
        (0..20).find_map(|_| {
            run_for_a_moment(&child);
            (cluster.published_halves() > 0).then_some(())
        })
    });
    child.kill().unwrap();
    child.wait().unwrap();
    let halves = cluster.published_halves();
    // The disk of that node is gone with it.
    std::fs::remove_dir_all(cluster.shards().join("work")).unwrap();
    task.restart = 1;
    task.node = "n2";
    let output = cluster.start(&script, task).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    cluster.ok(&["merge", "small.toml"]);
    let store = rusqlite::Connection::open(cluster.store()).unwrap();
    let resumed: i64 = store
        .query_row("SELECT sum(resumed) FROM results", [], |row| row.get(0))
        .unwrap();
    assert_eq!(resumed, halves);
    cluster.equals_local_run();
}

#[test]
fn task_that_runs_twice_simultaneously_is_harmless() {
    let cluster = Cluster::new(&QUICK.replace("strain = 0.3", "strain = 1.0"));
    let script = cluster.submit(&["--tasks", "1", "--publish-every", "0"]);
    let task = Task::FIRST;
    let twin = Task {
        restart: 1,
        node: "n2",
        ..task
    };
    // Stopped within its first case until the others are done, so that it computes that case a
    // second time on any machine.
    let held = cluster.start(&script, twin);
    cluster.hold_at_steps(&held, twin, 8);
    // Even under one name.
    let others = [task, task].map(|task| cluster.start(&script, task));
    for child in others {
        let output = child.wait_with_output().unwrap();
        assert!(output.status.code().is_some(), "{output:?}");
    }
    send(&held, Signal::CONT);
    let output = held.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let merged = cluster.json(&["merge", "small.toml", "--json"]);
    assert_eq!(merged["results"], 6);
    assert!(merged["duplicates"].as_i64().unwrap() >= 1, "{merged}");
    assert_eq!(merged["disagreements"].as_array().unwrap().len(), 0);
    cluster.equals_local_run();
}

#[test]
fn status_shows_tasks_and_slices_and_cancel_ends_them() {
    let cluster = Cluster::new(&long());
    let script = cluster.submit(&["--tasks", "2"]);
    cluster.set_reply("squeue", "0|RUNNING|n1\n1|PENDING|\n");
    let task = Task::FIRST;
    let child = cluster.start(&script, task);
    // Stopped during the check, or it would finish on a busy machine.
    cluster.hold_at_steps(&child, task, 40);
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
    contains(&text, &["job 4711: 2 tasks", "pending"]);
    contains(
        &cluster.ok(&["cancel", "small.toml"]),
        &["cancelled: 4711", "sweep submit"],
    );
    assert_eq!(cluster.input_of("scancel"), "4711\n");
    // Even without an answer of squeue: the mark exists.
    cluster.set_reply("squeue", "RUNNING|None\n");
    send(&child, Signal::TERM);
    send(&child, Signal::CONT);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{output:?}");
    assert!(cluster.input_of("requeue").is_empty());
    std::fs::remove_file(cluster.said().join("squeue")).unwrap();
    contains(&cluster.ok(&["cancel", "small.toml"]), &["no tasks"]);
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
fn failed_cases_are_retried_only_on_request() {
    let cluster = Cluster::new(QUICK);
    let script = cluster.submit(&["--tasks", "1", "--max-wall-time", "0.000001s"]);
    let output = cluster.start(&script, Task::FIRST).wait_with_output();
    assert_eq!(output.unwrap().status.code(), Some(1));
    contains(&cluster.ok(&["merge", "small.toml"]), &["6 failed"]);
    contains(
        &cluster.ok(&["submit", "small.toml"]),
        &["nothing to submit"],
    );
    // The same slices, and so the same plan, in which the failures are published.
    let again = cluster.submit(&["--tasks", "1", "--retry-failed"]);
    assert_eq!(again, script);
    cluster.run_all(&again, 4712, 1);
    cluster.ok(&["merge", "small.toml"]);
    cluster.equals_local_run();
}
