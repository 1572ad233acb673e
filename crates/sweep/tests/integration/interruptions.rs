//! External events: signals, full disks, damage, killed processes.

use crate::harness::{command, ended, folder, run, send, spawn, until, words};
use assert_cmd::cargo::cargo_bin;
use rustix::process::Signal;
use std::io::Read as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// The size of the published runs, with a checkpoint every fourth step.
const PUBLISHED: &str = r#"name = "small"
[protocol]
time_step = 0.005
strain = 4.0
discard = 0.0
checkpoint_every = 0.02
[[grid]]
area_fraction = 0.693
friction = 0.3
roughness = 0.01
shear_rate = inf
seeds = 2
spheres = 90
"#;
/// A few seconds of work.
const QUICK: &str = r#"name = "small"
[protocol]
time_step = 0.005
strain = 1.0
discard = 0.0
checkpoint_every = 0.02
[[grid]]
area_fraction = 0.6
friction = 0.3
roughness = 0.01
shear_rate = [1.0, inf]
seeds = 3
spheres = 40
hydrodynamics = "ball-melrose"
"#;

fn directory_with(campaign: &str) -> tempfile::TempDir {
    folder("small.toml", campaign)
}

/// Starts the campaign of a folder.
fn start(directory: &Path) -> Child {
    spawn(directory, &["run", "small.toml", "--quiet"])
}

fn query(directory: &Path, query: &str) -> i64 {
    // A file that this made could come in the way of the store that a run is about to make.
    let existing = rusqlite::OpenFlags::SQLITE_OPEN_READ_WRITE;
    rusqlite::Connection::open_with_flags(directory.join("results/small.sqlite"), existing)
        .and_then(|store| {
            store.busy_timeout(Duration::from_secs(10))?;
            store.query_row(query, [], |row| row.get(0))
        })
        .unwrap_or(0)
}

/// Waits until the cases of a store have a number of steps in their checkpoints.
fn wait_for_steps(directory: &Path, steps: i64) -> i64 {
    until("checkpoints", || {
        let found = query(directory, "SELECT coalesce(sum(steps_done), 0) FROM cases");
        (found >= steps).then_some(found)
    })
}

#[test]
fn signals_checkpoint_and_stop() {
    let directory = directory_with(PUBLISHED);
    let mut before = 0;
    for (signal, code) in [
        (Signal::INT, 130),
        (Signal::TERM, 143),
        (Signal::USR1, 138),
        (Signal::HUP, 129),
    ] {
        let mut child = start(directory.path());
        before = wait_for_steps(directory.path(), before + 4);
        send(&child, signal);
        assert_eq!(ended(&mut child).code(), Some(code));
        let after = query(directory.path(), "SELECT sum(steps_done) FROM cases");
        assert!(after >= before, "{after} {before}");
        assert_eq!(
            query(
                directory.path(),
                "SELECT count(*) FROM cases WHERE state = 'running'"
            ),
            0
        );
        before = after;
    }
}

/// A step takes about a second.
const SLOW: &str = r#"name = "small"
[protocol]
time_step = 0.005
strain = 4.0
discard = 0.0
checkpoint_every = 0.005
[[grid]]
area_fraction = 0.6
friction = 0.3
roughness = 0.01
shear_rate = inf
seeds = 1
spheres = 500
hydrodynamics = "stokesian-dynamics"
"#;

#[test]
fn second_signal_aborts_and_loses_at_most_one_interval() {
    let directory = directory_with(SLOW);
    let mut child = start(directory.path());
    let before = wait_for_steps(directory.path(), 1);
    send(&child, Signal::TERM);
    std::thread::sleep(Duration::from_millis(1100));
    // On a fast machine it may have ended before.
    let waited = child.try_wait().unwrap().is_none();
    if waited {
        send(&child, Signal::INT);
    }
    let code = ended(&mut child).code();
    assert_eq!(code, Some(if waited { 130 } else { 143 }));
    // Earlier data is still in the store: the loss is less than an interval of each run.
    assert!(query(directory.path(), "SELECT sum(steps_done) FROM cases") >= before);
}

#[test]
fn a_signal_that_comes_twice_within_a_moment_counts_once() {
    let directory = directory_with(SLOW);
    let mut child = start(directory.path());
    wait_for_steps(directory.path(), 1);
    // As GNU timeout does: to the process, and to its group.
    for _ in 0..2 {
        send(&child, Signal::TERM);
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(child.wait().unwrap().code(), Some(143));
    let left = "SELECT count(*) FROM processes WHERE ended_at IS NULL";
    assert_eq!(
        query(directory.path(), left),
        0,
        "it left its store in order"
    );
}

#[test]
fn failures_that_are_the_same_for_every_shear_rate_are_reported_once() {
    let dense = QUICK
        .replace("area_fraction = 0.6", "area_fraction = 0.838")
        .replace("roughness = 0.01", "roughness = 0.02")
        .replace("shear_rate = [1.0, inf]", "shear_rate = [0.1, 1.0, inf]")
        .replace("seeds = 3", "seeds = [1]");
    let directory = directory_with(&dense);
    let ran = run(directory.path(), &["run", "small.toml"]);
    assert_eq!(ran.status.code(), Some(1), "{ran:?}");
    let lines = |bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes).into_owned();
        let reports: Vec<String> = text
            .lines()
            .filter(|line| line.contains("no start could be made"))
            .map(String::from)
            .collect();
        (reports, text)
    };
    let (reports, text) = lines(&ran.stderr);
    assert_eq!(reports.len(), 1, "{text}");
    assert!(text.contains("2 more runs failed as did"), "{text}");
    let status = run(directory.path(), &["status", "small.toml"]);
    for bytes in [&ran.stdout, &status.stdout] {
        let (reports, text) = lines(bytes);
        assert_eq!(reports.len(), 1, "{text}");
        assert!(reports[0].contains("3 runs at Γ = 0.1, 1, inf"), "{text}");
    }
}

#[test]
fn status_works_while_a_run_writes_and_without_write_access() {
    let directory = directory_with(QUICK);
    let mut child = start(directory.path());
    wait_for_steps(directory.path(), 4);
    let mut looks = 0;
    while child.try_wait().unwrap().is_none() {
        let status = run(directory.path(), &["status", "small.toml", "--json"]);
        assert_eq!(status.status.code(), Some(0), "{status:?}");
        looks += 1;
    }
    assert!(looks > 2, "{looks}");
    // A user who may only read: needs a user to be, so root only.
    if rustix::process::geteuid().is_root() && Path::new("/usr/bin/setpriv").exists() {
        use std::os::unix::fs::PermissionsExt as _;
        // A reader at the end of the run prevented the log from being moved into the file that is
        // copied.
        let again = run(directory.path(), &["run", "small.toml", "--quiet"]);
        assert_eq!(again.status.code(), Some(0));
        let readable = tempfile::tempdir_in("/tmp").unwrap();
        let (program, store) = (
            readable.path().join("sweep"),
            readable.path().join("s.sqlite"),
        );
        // By another process: a program still open for writing in a test forked meanwhile would be
        // busy.
        let copied = Command::new("cp")
            .arg(cargo_bin("sweep"))
            .arg(&program)
            .status();
        assert!(copied.unwrap().success());
        std::fs::copy(directory.path().join("results/small.sqlite"), &store).unwrap();
        for (path, mode) in [(readable.path(), 0o755), (&program, 0o755), (&store, 0o444)] {
            std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
        }
        let unprivileged = |arguments: &[&str]| {
            Command::new("setpriv")
                .args(["--reuid=65534", "--regid=65534", "--clear-groups"])
                .arg(&program)
                .args(arguments)
                .current_dir(directory.path().parent().unwrap())
                .output()
                .unwrap()
        };
        let status = unprivileged(&["status", &store.display().to_string()]);
        assert_eq!(status.status.code(), Some(0), "{status:?}");
    }
}

#[test]
fn a_process_that_died_after_its_last_case_is_forgotten_by_the_next_run() {
    let directory = directory_with(&QUICK.replace("strain = 1.0", "strain = 0.1"));
    let at = directory.path();
    let open = || {
        let store = rusqlite::Connection::open(at.join("results/small.sqlite")).unwrap();
        let open = "SELECT count(*) FROM processes WHERE ended_at IS NULL";
        store
            .query_row(open, [], |row| row.get::<_, u32>(0))
            .unwrap()
    };
    assert_eq!(
        run(at, &["run", "small.toml", "--quiet"]).status.code(),
        Some(0)
    );
    rusqlite::Connection::open(at.join("results/small.sqlite"))
        .and_then(|store| store.execute("UPDATE processes SET ended_at = NULL", []))
        .unwrap();
    assert_eq!(open(), 1);
    assert_eq!(
        run(at, &["run", "small.toml", "--quiet"]).status.code(),
        Some(0)
    );
    assert_eq!(open(), 0);
}

#[test]
fn failed_run_leaves_a_state_that_solve_reads() {
    let directory = directory_with(PUBLISHED);
    let ran = run(
        directory.path(),
        &["run", "small.toml", "--quiet", "--max-wall-time", "0.5s"],
    );
    assert_eq!(ran.status.code(), Some(1));
    let status = run(directory.path(), &["status", "small.toml", "--json"]);
    let status: serde_json::Value = serde_json::from_slice(&status.stdout).unwrap();
    assert_eq!(status["cases"]["failed"], 2);
    let key = status["failures"][0]["key"].as_str().unwrap();
    assert_eq!(
        run(directory.path(), &["replay", "small.toml"])
            .status
            .code(),
        Some(2),
        "which one?"
    );
    let state = run(directory.path(), &["replay", "small.toml", &key[..8]]);
    assert_eq!(state.status.code(), Some(0));
    // A number means the same run wherever a run is named.
    for number in ["1", "2"] {
        let shown = run(directory.path(), &["show", "small.toml", number, "--json"]);
        let shown: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap();
        let by_key = run(
            directory.path(),
            &["replay", "small.toml", shown["key"].as_str().unwrap()],
        );
        let by_number = run(directory.path(), &["replay", "small.toml", number]);
        assert_eq!(by_number.status.code(), Some(0));
        assert_eq!(by_number.stdout, by_key.stdout);
    }
    let text = run(directory.path(), &["status", "small.toml"]);
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(
        text.contains("all 2 runs have ended, and 2 of 2 runs failed"),
        "{text}"
    );
    std::fs::write(directory.path().join("state.json"), &state.stdout).unwrap();
    let solved = run(directory.path(), &["solve", "state.json", "--json"]);
    assert_eq!(solved.status.code(), Some(0), "{solved:?}");
    let solved: serde_json::Value = serde_json::from_slice(&solved.stdout).unwrap();
    assert!(solved["viscosity"].as_f64().unwrap() > 1.0);
    assert_eq!(solved["velocity_disturbance"].as_array().unwrap().len(), 90);
}

#[test]
fn store_deleted_during_a_run_ends_with_3_and_leaves_nothing_behind() {
    // In its first moments, and with checkpoints.
    for steps in [None, Some(0), Some(8)] {
        let directory = directory_with(QUICK);
        let child = command(directory.path(), &["run", "small.toml", "--quiet"])
            .stdout(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let store = directory.path().join("results/small.sqlite");
        until("a store", || store.exists().then_some(()));
        if let Some(steps) = steps {
            wait_for_steps(directory.path(), steps);
        }
        std::fs::remove_file(&store).unwrap();
        let output = child.wait_with_output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{steps:?}: {error}");
        assert!(error.contains("deleted"), "{error}");
        let left = std::fs::read_dir(directory.path().join("results")).unwrap();
        assert_eq!(left.count(), 0);
        if steps == Some(8) {
            let again = run(directory.path(), &["run", "small.toml", "--quiet"]);
            assert_eq!(again.status.code(), Some(0));
        }
    }
}

#[test]
fn store_is_whole_after_a_kill_with_and_without_its_log_and_raises_no_alarm() {
    for (wait, keeps_log) in [(0, false), (30, false), (150, false), (150, true)] {
        let directory = directory_with(PUBLISHED);
        let store = directory.path().join("results/small.sqlite");
        let mut child = start(directory.path());
        until("a store", || store.exists().then_some(()));
        std::thread::sleep(Duration::from_millis(wait));
        child.kill().unwrap();
        child.wait().unwrap();
        for end in ["-wal", "-shm"].iter().filter(|_| !keeps_log) {
            let _ =
                std::fs::remove_file(directory.path().join(format!("results/small.sqlite{end}")));
        }
        for (arguments, code) in [
            (&["report", "small.toml"][..], 0),
            (&["run", "small.toml", "--quiet", "--time-limit", "1s"], 4),
        ] {
            let said = run(directory.path(), arguments);
            assert_eq!(said.status.code(), Some(code), "{said:?}");
            let error = String::from_utf8_lossy(&said.stderr).into_owned();
            assert!(!error.contains("warning"), "{wait}: {error}");
        }
    }
}

#[test]
fn what_is_whole_of_a_damaged_store_is_merged_and_the_rest_computed_again() {
    let directory = directory_with(QUICK);
    assert_eq!(
        run(directory.path(), &["run", "small.toml", "--quiet"])
            .status
            .code(),
        Some(0)
    );
    let whole = run(directory.path(), &["report", "small.toml", "--json"]).stdout;
    let store = directory.path().join("results/small.sqlite");
    // Which pages come last depends on the order in which runs end; after this it does not.
    rusqlite::Connection::open(&store)
        .and_then(|store| store.execute_batch("VACUUM"))
        .unwrap();
    let mut bytes = std::fs::read(&store).unwrap();
    // The end is lost, as after an interrupted copy: its last two pages hold results of the later
    // runs.
    bytes.truncate(bytes.len() - 2 * 4096);
    std::fs::write(&store, bytes).unwrap();
    let error = run(directory.path(), &["report", "small.toml"]);
    let text = String::from_utf8_lossy(&error.stderr).into_owned();
    if !error.status.success() {
        assert!(
            text.contains("damaged") && text.contains("sweep merge"),
            "{text}"
        );
    }
    let saved = run(
        directory.path(),
        &["merge", "new.sqlite", "results/small.sqlite", "--json"],
    );
    assert_eq!(saved.status.code(), Some(1), "{saved:?}");
    let saved: serde_json::Value = serde_json::from_slice(&saved.stdout).unwrap();
    assert!(saved["results"].as_u64().unwrap() > 0, "{saved}");
    let ran = run(
        directory.path(),
        &["run", "small.toml", "--store", "new.sqlite", "--quiet"],
    );
    assert_eq!(ran.status.code(), Some(0), "{ran:?}");
    let again = run(directory.path(), &["report", "new.sqlite", "--json"]).stdout;
    let without_times = |report: &[u8]| {
        let mut report: serde_json::Value = serde_json::from_slice(report).unwrap();
        for point in report["points"].as_array_mut().unwrap() {
            let point = point.as_object_mut().unwrap();
            point.remove("wall_time_s");
            point.remove("cpu_time_s");
        }
        report
    };
    assert_eq!(without_times(&again), without_times(&whole));
}

/// A run of five spheres with a sample at every step.
fn long(steps: i64) -> String {
    let strain = steps as f64 * 0.01;
    format!(
        r#"name = "small"
[protocol]
time_step = 0.01
sample_every = 0.01
strain = {strain}
discard = 1.0
checkpoint_every = 0.1
[[grid]]
area_fraction = 0.1
friction = 0.3
roughness = 0.01
shear_rate = inf
seeds = 1
spheres = 5
hydrodynamics = "ball-melrose"
"#
    )
}

/// Digest of all samples of the only run of a store, and numbers of its result.
fn result(directory: &Path) -> (i64, i64, f64, i64) {
    rusqlite::Connection::open(directory.join("results/small.sqlite"))
        .unwrap()
        .query_row(
            "SELECT c.samples_digest, r.samples, r.viscosity, r.stages
             FROM cases c JOIN results r ON r.case_id = c.id WHERE c.state = 'done'",
            [],
            |row| row.try_into(),
        )
        .unwrap()
}

/// Largest checkpoint of a store in bytes: it holds the state of five spheres, and no samples.
fn checkpoint_bytes(directory: &Path) -> i64 {
    query(
        directory,
        "SELECT coalesce(max(length(data)), 0) FROM checkpoints",
    )
}

/// Kills a run with a sample at every step up to four times, and compares it with an undisturbed
/// one. How far a run comes before it is killed depends on the machine: checkpoints may be as far
/// apart as the samples held in memory, so each round waits for one after that of the round before.
fn kill_four_times(steps: i64) {
    let undisturbed = directory_with(&long(steps));
    assert_eq!(ended(&mut start(undisturbed.path())).code(), Some(0));
    let directory = directory_with(&long(steps));
    let (mut before, mut largest, mut interrupted) = (0, 0, 0);
    for round in 1..=4 {
        let mut child = command(directory.path(), &["run", "small.toml", "--quiet"])
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let target = (before + 1).max(steps * round / 6);
        let reached = until("checkpoints", || {
            let ended = child.try_wait().unwrap();
            let found = query(
                directory.path(),
                "SELECT coalesce(sum(steps_done), 0) FROM cases",
            );
            let mut said = String::new();
            if ended.is_some() {
                let stderr = child.stderr.as_mut().unwrap();
                stderr.read_to_string(&mut said).unwrap();
            }
            assert!(
                ended.is_none() || found >= target,
                "round {round} ended at {found}: {ended:?}: {said}"
            );
            (found >= target).then_some(found)
        });
        largest = largest.max(checkpoint_bytes(directory.path()));
        let memory = peak_memory(&child);
        child.kill().unwrap();
        child.wait().unwrap();
        let kept = query(directory.path(), "SELECT sum(steps_done) FROM cases");
        assert!(kept >= reached, "round {round}: {reached}, {kept}");
        assert!(memory < 256 << 10, "{memory} KiB in round {round}");
        if kept == steps {
            // It ended before it could be killed.
            break;
        }
        before = kept;
        interrupted += 1;
    }
    assert!(interrupted > 0, "it was never interrupted");
    assert!(largest > 0 && largest < 16 << 10, "{largest} bytes");
    assert_eq!(ended(&mut start(directory.path())).code(), Some(0));
    let resumed = query(directory.path(), "SELECT resumed FROM results");
    assert_eq!(resumed, interrupted, "it continued each time");
    assert_eq!(result(directory.path()), result(undisturbed.path()));
}

/// Peak memory of a process in KiB.
fn peak_memory(child: &Child) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    // A process that has ended has no memory.
    line.map_or(0, |line| {
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    })
}

#[test]
fn a_run_of_many_samples_that_is_killed_four_times_continues_each_time() {
    kill_four_times(30_000);
}

#[test]
#[ignore = "minutes: a million samples, twice"]
fn a_run_of_a_million_samples_that_is_killed_four_times_continues_each_time() {
    kill_four_times(1_000_000);
}

#[test]
fn checkpoints_follow_one_another_to_the_end_of_a_run_and_do_not_grow() {
    // Writing samples takes more than a twentieth of so quick a run, so checkpoints are rarer than
    // requested, but never further apart than the samples that are held in memory.
    const STEPS: i64 = 60_000;
    const IN_MEMORY: i64 = 1 << 14;
    let directory = directory_with(&long(STEPS));
    let mut child = start(directory.path());
    let (mut last, mut largest) = (0, 0);
    while child.try_wait().unwrap().is_none() {
        let steps = query(
            directory.path(),
            "SELECT coalesce(sum(steps_done), 0) FROM cases",
        );
        // A look may miss one of them.
        assert!(steps - last <= 2 * IN_MEMORY, "{steps} after {last}");
        last = steps;
        largest = largest.max(checkpoint_bytes(directory.path()));
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(ended(&mut child).code(), Some(0));
    assert!(last >= STEPS - 2 * IN_MEMORY, "the last was at {last}");
    assert!(largest > 0 && largest < 16 << 10, "{largest} bytes");
}

#[test]
fn a_store_cut_off_while_it_is_used_is_given_up_by_the_advice_of_the_error() {
    for bytes in [0, 40_960] {
        let directory = directory_with(QUICK);
        let at = directory.path();
        let mut child = start(at);
        wait_for_steps(at, 8);
        let store = at.join("results/small.sqlite");
        let file = std::fs::File::options().write(true).open(&store).unwrap();
        file.set_len(bytes).unwrap();
        drop(file);
        assert_eq!(ended(&mut child).code(), Some(3), "{bytes}");
        let report = &["report", "small.toml"][..];
        for arguments in [&["run", "small.toml", "--quiet"][..], report] {
            let refused = run(at, arguments);
            assert_eq!(refused.status.code(), Some(3), "{bytes}: {refused:?}");
            let text = words(&refused.stderr);
            assert!(
                text.contains("where it copies none, move the file away"),
                "{text}"
            );
        }
        let merged = run(at, &["merge", "new.sqlite", "results/small.sqlite"]);
        assert!(!merged.status.success(), "{bytes}: {merged:?}");
        std::fs::rename(&store, at.join("damaged.sqlite")).unwrap();
        let again = run(at, &["run", "small.toml", "--quiet"]);
        assert_eq!(again.status.code(), Some(0), "{bytes}: {again:?}");
        assert_eq!(run(at, report).status.code(), Some(0));
    }
}

#[test]
fn killed_processes_are_not_said_to_run() {
    let directory = directory_with(QUICK);
    let mut child = start(directory.path());
    wait_for_steps(directory.path(), 4);
    child.kill().unwrap();
    child.wait().unwrap();
    let status = run(directory.path(), &["status", "small.toml"]);
    let text = String::from_utf8(status.stdout).unwrap();
    assert!(text.contains("but it has ended"), "{text}");
    let status = run(directory.path(), &["status", "small.toml", "--json"]);
    let status: serde_json::Value = serde_json::from_slice(&status.stdout).unwrap();
    let processes = status["processes"].as_array().unwrap();
    assert!(!processes.is_empty() && processes.iter().all(|process| process["alive"] == false));
}
