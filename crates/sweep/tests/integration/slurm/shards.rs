//! Shards that are missing, half-written, of another build, or on a full disk.

use super::cluster::{Cluster, QUICK, Task, contains, long};
use crate::harness::{until, words};
use std::path::PathBuf;
use std::process::Command;
use std::process::Stdio;
use std::time::Duration;

#[test]
fn vanished_folder_is_named_and_submitting_again_recovers() {
    let cluster = Cluster::new(&long());
    let script = cluster.submit(&["--tasks", "1"]);
    let text = std::fs::read_to_string(&script).unwrap();
    let task = Task::FIRST;
    // While running, it is recreated, and the results count. The private store is on another disk.
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
    until("a store at work", || {
        let files = std::fs::read_dir(&scratch).map_or(0, Iterator::count);
        (files > 0).then_some(())
    });
    std::thread::sleep(Duration::from_millis(300));
    // The task may be writing into it.
    until("the folder to be gone", || {
        std::fs::remove_dir_all(cluster.shards()).ok()
    });
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
    contains(&error, &["no slices", "was deleted", "sweep submit"]);
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
    // As an interrupted copy leaves it; it is not read as a shard.
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
fn other_builds_are_named_and_other_campaigns_refused() {
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
    sweep::store::accept_changes(&shard).unwrap();
    let named = ["2 builds of sweep, whose bits may differ", "older"];
    contains(&cluster.ok(&["merge", "small.toml"]), &["6 of 6"]);
    contains(&cluster.ok(&["merge", "small.toml"]), &named);
    contains(&cluster.ok(&["status", "small.toml"]), &named);
    std::fs::write(
        cluster.home().join("else.toml"),
        QUICK.replace("small", "else"),
    )
    .unwrap();
    cluster.ok(&["run", "else.toml", "--quiet"]);
    contains(
        &cluster.not_ok(2, &["merge", "small.toml", "results/else.sqlite"]),
        &["is the store of campaign \"else\", not of \"small\""],
    );
    // No store is made before all shards are known to belong together.
    let (right, wrong) = ("results/small.sqlite", "results/else.sqlite");
    cluster.not_ok(2, &["merge", "new.sqlite", right, wrong]);
    cluster.not_ok(2, &["merge", "new.sqlite", wrong, right]);
    std::fs::create_dir(cluster.home().join("empty")).unwrap();
    contains(
        &cluster.not_ok(2, &["merge", "new.sqlite", "empty"]),
        &["no shards were found to merge into ", "new.sqlite"],
    );
    assert!(!cluster.home().join("new.sqlite").exists());
    contains(&cluster.ok(&["merge", "new.sqlite", right]), &["6 of 6"]);
}

#[test]
fn full_disk_of_the_shards_is_named_and_the_same_command_continues() {
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
    until("a shard", || {
        let files = std::fs::read_dir(&shards).map_or(0, Iterator::count);
        (files > 0).then_some(())
    });
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
