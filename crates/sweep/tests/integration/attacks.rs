//! Malicious or unfortunate input: pipes, hostile names, slow clients, unwritable disks.

mod server;

use crate::harness::{Computed, Served, command, edit, ended, printed, program, run, send, words};
use rustix::process::Signal;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

const CAMPAIGN: &str = r#"name = "small"
[protocol]
strain = 0.1
discard = 0.0
checkpoint_every = 0.02
[[grid]]
area_fraction = 0.5
friction = 0.3
roughness = 0.01
shear_rate = [1.0, inf]
seeds = 2
spheres = 20
hydrodynamics = "ball-melrose"
"#;

/// A store with all results.
static STORE: Computed = Computed::new(CAMPAIGN, &[]);

/// A directory with the campaign and its finished store.
fn directory() -> tempfile::TempDir {
    let directory = STORE.folder();
    let at = directory.path();
    std::fs::create_dir(at.join("results")).unwrap();
    std::fs::rename(at.join("c.toml"), at.join("small.toml")).unwrap();
    std::fs::rename(at.join("s.sqlite"), at.join("results/small.sqlite")).unwrap();
    directory
}

/// The output of a command that must end by itself.
fn ends(directory: &Path, arguments: &[&str]) -> Output {
    let mut child = command(directory, arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    ended(&mut child);
    child.wait_with_output().unwrap()
}

#[test]
fn pipes_and_devices_are_no_stores() {
    let directory = directory();
    let at = directory.path();
    let pipe = at.join("pipe.sqlite");
    assert!(
        Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .unwrap()
            .success()
    );
    for arguments in [
        &["status", "pipe.sqlite"][..],
        &["report", "pipe.sqlite"],
        &["show", "pipe.sqlite", "1"],
        &["serve", "pipe.sqlite", "--listen", "127.0.0.1:0"],
        &["check", "pipe.sqlite"],
        &["run", "small.toml", "--store", "pipe.sqlite"],
        &["status", "/dev/zero"],
    ] {
        let output = ends(at, arguments);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(printed(&output).contains("is not a file"), "{output:?}");
    }
    let merged = ends(at, &["merge", "results/small.sqlite", "pipe.sqlite"]);
    assert_eq!(merged.status.code(), Some(1), "{merged:?}");
    assert!(!at.join("new.sqlite").exists());
}

/// The message of a command that must refuse its input immediately, without a panic and without
/// filling the screen.
fn refused_immediately(directory: &Path, arguments: &[&str]) -> String {
    let output = ends(directory, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
    let length = output.stderr.len();
    assert!(length < 4096, "{arguments:?}: {length} bytes");
    words(&output.stderr)
}

#[test]
fn every_input_is_a_regular_file_of_limited_size_and_nothing_is_shown_of_another() {
    let directory = directory();
    let at = directory.path();
    let pipe = Command::new("mkfifo").arg(at.join("pipe")).status();
    assert!(pipe.unwrap().success());
    // A file with a secret, which is never read.
    std::fs::write(at.join("secret"), "root:$6$secret:20228\n").unwrap();
    std::fs::write(at.join("secret.json"), r#"{"centres": "hushed"}"#).unwrap();
    for (input, why) in [
        ("/dev/zero", "and not a file"),
        ("pipe", "and not a file"),
        (".", "directory"),
        ("secret", ""),
        ("secret.json", ""),
    ] {
        let start = CAMPAIGN.replace("spheres = 20", &format!("start = \"{input}\""));
        std::fs::write(at.join("start.toml"), start).unwrap();
        for arguments in [
            &["plan", "start.toml"][..],
            &["plan", input],
            &["run", "small.toml", "--shard", "0/2", "--slices", input],
            &["solve", input],
        ] {
            let message = refused_immediately(at, arguments);
            assert!(message.contains(why), "{arguments:?}: {message}");
            // Files that the user gives as a campaign or an instant are shown where they are wrong.
            if arguments.contains(&"start.toml") || arguments.contains(&"--slices") {
                assert!(!message.contains("$6$"), "{arguments:?}: {message}");
                assert!(!message.contains("hushed"), "{arguments:?}: {message}");
            }
        }
    }
    std::fs::write(at.join("large.toml"), vec![b'#'; (1 << 20) + 1]).unwrap();
    let message = refused_immediately(at, &["plan", "large.toml"]);
    assert!(message.contains("larger than 1048576 bytes"), "{message}");
}

#[test]
fn errors_in_lines_of_any_length_are_short() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let seeds: Vec<String> = (1..12_000).map(|seed| seed.to_string()).collect();
    let seeds = format!("seeds = [{}, 1]", seeds.join(", "));
    let long = "z".repeat(450_000);
    for changed in [
        CAMPAIGN.replace("seeds = 2", &seeds),
        CAMPAIGN
            .replace("seeds = 2", &seeds)
            .replace("friction = 0.3", "friction = 20"),
        CAMPAIGN.replace("friction = 0.3", &format!("friction = \"{long}\"")),
        CAMPAIGN.replace("friction = 0.3", &format!("{long} = 0.3")),
        CAMPAIGN.replace("[[grid]]", &format!("[{long}]\n[[grid]]")),
        CAMPAIGN.replace("\"small\"", &format!("\"{long}\"")),
        CAMPAIGN.replace(
            "friction = 0.3",
            &format!("friction = {}", "[".repeat(9000)),
        ),
        CAMPAIGN.replace(
            "friction = 0.3",
            &format!("friction = 0.3 # {long}\nfriction = 0.4"),
        ),
        CAMPAIGN.replace("friction = 0.3", &format!("friction = 0.3{long}")),
        CAMPAIGN.replace("\"ball-melrose\"", &format!("[\"{long}\", \"{long}\"]")),
    ] {
        std::fs::write(at.join("c.toml"), changed).unwrap();
        let message = refused_immediately(at, &["plan", "c.toml"]);
        assert!(message.contains("c.toml:"), "{message}");
    }
}

#[test]
fn limit_on_the_size_of_files_is_a_full_disk() {
    for kilobytes in [16, 64, 160] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::write(at.join("small.toml"), CAMPAIGN).unwrap();
        let limit = format!("ulimit -f {kilobytes}; exec \"$0\" \"$@\"");
        let output = Command::new("bash")
            .args(["-c", &limit])
            .arg(program(at).get_program())
            .args(["run", "small.toml"])
            .current_dir(at)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(3), "{kilobytes}: {output:?}");
        let done = run(at, &["run", "small.toml"]);
        assert_eq!(done.status.code(), Some(0), "{kilobytes}: {done:?}");
    }
}

#[test]
fn text_that_is_no_utf_8_is_damage_of_the_store() {
    let directory = directory();
    let at = directory.path();
    // Unfinished, so that a run has something to do.
    edit(
        &at.join("results/small.sqlite"),
        "DELETE FROM results WHERE case_id = 1; DELETE FROM samples WHERE case_id = 1;
         UPDATE cases SET state = 'pending', steps_done = 0, samples_digest = NULL WHERE id = 1",
    );
    let whole = std::fs::read(at.join("results/small.sqlite")).unwrap();
    for (table, column) in [
        ("campaign", "text"),
        ("campaign", "entered"),
        ("processes", "host"),
        ("points", "params"),
        ("cases", "key"),
        ("cases", "state"),
        ("results", "doubts"),
    ] {
        let store = at.join("hurt.sqlite");
        std::fs::write(&store, &whole).unwrap();
        let connection = rusqlite::Connection::open(&store).unwrap();
        connection
            .execute_batch(&format!(
                "PRAGMA ignore_check_constraints = ON; PRAGMA foreign_keys = OFF;
                 UPDATE {table} SET {column} = CAST(x'ff41' AS TEXT) WHERE rowid = (SELECT max(rowid) FROM {table})"
            ))
            .unwrap();
        drop(connection);
        for arguments in [
            &["report", "hurt.sqlite"][..],
            &["status", "hurt.sqlite"],
            &["show", "hurt.sqlite", "2"],
        ] {
            let code = ends(at, arguments).status.code();
            assert!(
                matches!(code, Some(0 | 3)),
                "{table}.{column}: {arguments:?}: {code:?}"
            );
        }
        let ran = ends(at, &["run", "small.toml", "--store", "hurt.sqlite"]);
        assert_eq!(ran.status.code(), Some(0), "{table}.{column}: {ran:?}");
        let checked = ends(at, &["check", "hurt.sqlite"]);
        assert_eq!(
            checked.status.code(),
            Some(0),
            "{table}.{column}: {checked:?}"
        );
    }
}

#[test]
fn interrupted_and_simultaneous_first_merges_succeed() {
    for _ in 0..6 {
        let directory = directory();
        let at = directory.path();
        let arguments = ["merge", "new.sqlite", "results/small.sqlite"];
        let both: Vec<Child> = (0..2)
            .map(|_| {
                command(at, &arguments)
                    .stdout(Stdio::piped())
                    .stderr(Stdio::piped())
                    .spawn()
                    .unwrap()
            })
            .collect();
        for child in both {
            let output = child.wait_with_output().unwrap();
            assert_eq!(output.status.code(), Some(0), "{output:?}");
        }
    }
    // Ended at any moment, the same command does it.
    for wait in 0..12 {
        let directory = directory();
        let at = directory.path();
        let arguments = ["merge", "new.sqlite", "results/small.sqlite"];
        let mut child = command(at, &arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(4 * wait));
        child.kill().unwrap();
        child.wait().unwrap();
        let again = run(at, &arguments);
        assert_eq!(again.status.code(), Some(0), "after {wait}: {again:?}");
        assert!(
            printed(&again).contains("4 of 4 cases are done"),
            "{again:?}"
        );
    }
}

#[test]
fn run_says_whom_it_waits_for() {
    let directory = directory();
    let at = directory.path();
    let store = at.join("results/small.sqlite");
    edit(
        &store,
        "UPDATE processes SET host = 'elsewhere', ended_at = NULL, heartbeat = 1000 * unixepoch() + 100000;
         DELETE FROM results WHERE case_id = 1;
         UPDATE cases SET state = 'running', owner = 1, steps_done = 0 WHERE id = 1",
    );
    let mut child = command(at, &["run", "small.toml"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let message = lines.find(|line| {
        line.as_ref()
            .unwrap()
            .contains("waiting for 1 run of process")
    });
    let message = message.unwrap().unwrap();
    assert!(message.contains("on elsewhere"), "{message}");
    send(&child, Signal::TERM);
    assert_eq!(child.wait().unwrap().code(), Some(143));
}

#[test]
fn unknown_states_are_reported_and_their_runs_computed_again() {
    let directory = directory();
    let at = directory.path();
    let store = at.join("results/small.sqlite");
    edit(
        &store,
        "PRAGMA ignore_check_constraints = ON; UPDATE cases SET state = 'waiting' WHERE id = 2",
    );
    for arguments in [&["report", "small.toml"][..], &["status", "small.toml"]] {
        let output = ends(at, arguments);
        assert_eq!(output.status.code(), Some(3), "{output:?}");
        assert!(
            printed(&output).contains("is damaged") && printed(&output).contains("sweep check"),
            "{output:?}"
        );
    }
    let checked = run(at, &["check", "results/small.sqlite"]);
    assert_eq!(checked.status.code(), Some(1), "{checked:?}");
    let ran = run(at, &["run", "small.toml"]);
    assert_eq!(ran.status.code(), Some(0), "{ran:?}");
    assert!(printed(&ran).contains("computed again"), "{ran:?}");
    let checked = run(at, &["check", "results/small.sqlite"]);
    assert_eq!(checked.status.code(), Some(0), "{checked:?}");
}

/// Bytes of control sequences, except colours.
fn obeyed(output: &Output) -> Vec<u8> {
    let bytes = [output.stdout.as_slice(), &output.stderr].concat();
    let text = String::from_utf8_lossy(&bytes).into_owned();
    text.chars()
        .filter(|c| c.is_control() && *c != '\n' && *c != '\t')
        .flat_map(|c| c.to_string().into_bytes())
        .collect()
}

#[test]
fn control_sequences_are_made_visible() {
    const EVIL: &str = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}31m\r";
    let directory = directory();
    let at = directory.path();
    let store = at.join("results/small.sqlite");
    edit(
        &store,
        &format!(
            "DELETE FROM results WHERE case_id = 1; DELETE FROM samples WHERE case_id = 1;
             UPDATE cases SET state = 'failed' WHERE id = 1;
             INSERT INTO failures (case_id, attempt, error, step, strain, process, failed_at)
                 VALUES (1, 1, 'no {EVIL}', 3, 0.015, 1, 0);
             UPDATE campaign SET name = 'small{EVIL}'; UPDATE processes SET host = '{EVIL}', build = '{EVIL}'"
        ),
    );
    let evil = format!("evil{EVIL}.sqlite");
    std::fs::copy(&store, at.join(&evil)).unwrap();
    std::fs::write(
        at.join("evil.toml"),
        CAMPAIGN.replace("friction = 0.3", &format!("friction = \"{EVIL}\"")),
    )
    .unwrap();
    let evil_toml = format!("{EVIL}.toml");
    std::fs::write(at.join(&evil_toml), "name = 3\n").unwrap();
    let mut shown = 0;
    for arguments in [
        &["status", "results/small.sqlite"][..],
        &["report", "results/small.sqlite"],
        &["report", "results/small.sqlite", "--csv", "-"],
        &["show", "results/small.sqlite", "1"],
        &["status", &evil],
        &["status", &format!("none{EVIL}.sqlite")],
        &["run", "evil.toml"],
        &["plan", &evil_toml],
        &["merge", "results/small.sqlite", &evil],
        &["merge", "results/small.sqlite", &evil_toml],
        &["run", "small.toml"],
        &["check", &evil],
    ] {
        let output = ends(at, arguments);
        assert_eq!(obeyed(&output), b"", "{arguments:?}: {output:?}");
        let text = printed(&output);
        assert!(
            !text.contains(['\u{7}', '\u{9b}', '\r']),
            "{arguments:?}: {text:?}"
        );
        shown += u32::from(text.contains("\\u001b]0;owned\\u0007"));
    }
    assert!(shown >= 6, "{shown}");
    let json = run(at, &["report", "results/small.sqlite", "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(json["campaign"], format!("small{EVIL}"));
}

/// A read-only disk, removed with the test.
struct ReadOnly(PathBuf);

impl Drop for ReadOnly {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

#[test]
fn stores_on_read_only_disks_are_read_with_and_without_a_log() {
    let directory = directory();
    let at = directory.path();
    let disk = at.join("disk");
    std::fs::create_dir(&disk).unwrap();
    let mount = |arguments: &[&str]| {
        let done = Command::new("mount").args(arguments).arg(&disk).output();
        done.is_ok_and(|done| done.status.success())
    };
    if !mount(&["-t", "tmpfs", "-o", "size=16m", "tmpfs"]) {
        return; // Mounting needs root.
    }
    let disk = ReadOnly(disk.clone());
    std::fs::copy(at.join("results/small.sqlite"), disk.0.join("s.sqlite")).unwrap();
    // As a killed process leaves it: changes in a log, and no index of it.
    let kept = rusqlite::Connection::open(at.join("results/small.sqlite")).unwrap();
    kept.execute_batch("UPDATE processes SET heartbeat = heartbeat + 1")
        .unwrap();
    for (from, to) in [
        ("small.sqlite", "logged.sqlite"),
        ("small.sqlite-wal", "logged.sqlite-wal"),
    ] {
        std::fs::copy(at.join("results").join(from), disk.0.join(to)).unwrap();
    }
    assert!(mount(&["-o", "remount,ro"]));
    for store in ["disk/s.sqlite", "disk/logged.sqlite"] {
        for arguments in [
            &["status", store][..],
            &["report", store, "--json"],
            &["show", store, "1"],
        ] {
            let output = ends(at, arguments);
            assert_eq!(output.status.code(), Some(0), "{arguments:?}: {output:?}");
        }
        Served::start(&mut command(
            at,
            &["serve", store, "--listen", "127.0.0.1:0", "--json"],
        ));
    }
    let refused = ends(at, &["run", "small.toml", "--store", "disk/s.sqlite"]);
    assert_ne!(refused.status.code(), Some(0));
}

#[test]
fn no_output_replaces_a_store_a_campaign_or_the_log_of_a_store() {
    let directory = directory();
    let at = directory.path();
    let store = at.join("results/small.sqlite");
    let whole = std::fs::read(&store).unwrap();
    std::os::unix::fs::symlink(&store, at.join("link.csv")).unwrap();
    std::fs::hard_link(&store, at.join("hard.md")).unwrap();
    std::os::unix::fs::symlink(at.join("small.toml"), at.join("campaign.csv")).unwrap();
    std::fs::write(at.join("odd.txt"), CAMPAIGN).unwrap();
    std::os::unix::fs::symlink(at.join("odd.txt"), at.join("odd.toml")).unwrap();
    let file = "results/small.sqlite";
    for arguments in [
        &["report", file, "--csv", file][..],
        &["report", file, "--parquet", file],
        &["report", file, "--page", file],
        &["report", file, "--csv", "link.csv"],
        &["report", file, "--csv", "hard.md"],
        &["report", file, "--csv", "results/small.sqlite-wal"],
        &["report", "small.toml", "--csv", "small.toml"],
        &["report", "small.toml", "--csv", "campaign.csv"],
        &["report", "odd.toml", "--store", file, "--csv", "odd.txt"],
        &["segments", file, "--csv", file],
        &["structure", file, "--csv", file],
        &["structure", file, "--curves", "link.csv"],
        &["structure", file, "--parquet", file],
        &["fit", file, "--csv", file],
        &["export", file, "1", "--out", file],
        &["report", file, "--csv", "new.csv", "--runs", "new.csv"],
        &[
            "report",
            file,
            "--csv",
            "new.csv",
            "--runs",
            "new.units.csv",
        ],
    ] {
        let output = command(at, arguments).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(
            said.contains("is not written") && said.contains("--"),
            "{arguments:?}: {said}"
        );
    }
    assert_eq!(std::fs::read(&store).unwrap(), whole);
    assert_eq!(
        std::fs::read_to_string(at.join("odd.txt")).unwrap(),
        CAMPAIGN
    );
    assert!(!at.join("results/small.sqlite-wal").exists());
    // Units beside a table are no way around.
    std::fs::copy(&store, at.join("beside.units.csv")).unwrap();
    let output = command(at, &["report", file, "--csv", "beside.csv"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(std::fs::read(at.join("beside.units.csv")).unwrap(), whole);
    // Other files are replaced, and what a killed process left is cleared.
    std::fs::write(at.join("old.csv"), "old").unwrap();
    run(at, &["report", file, "--csv", "old.csv"]);
    assert!(
        std::fs::read_to_string(at.join("old.csv"))
            .unwrap()
            .lines()
            .count()
            > 1
    );
    let parts = std::fs::read_dir(at).unwrap().flatten();
    let parts = parts.filter(|entry| entry.file_name().to_string_lossy().starts_with('.'));
    assert_eq!(parts.count(), 0);
}

#[test]
fn endless_passages_overflows_and_thousands_of_faults_are_refused_at_once() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let said = refused_immediately(at, &["pair", "--time-step", "1e-300"]);
    assert!(
        said.contains("time_step") && said.contains("steps"),
        "{said}"
    );
    let far = r#"{"centres": [[0, 0], [2.1, 0]], "hydrodynamics": "ball-melrose", "forces": [[1e300, 0], [-1e300, 0]]}"#;
    let near = far.replace("\"hydro", "\"cell\": [12.5, 12.5], \"hydro");
    for text in [far.to_owned(), near] {
        std::fs::write(at.join("far.json"), text).unwrap();
        let output = ends(at, &["solve", "far.json", "--json"]);
        let said = printed(&output);
        assert!(
            !said.contains("null") || said.contains("\"viscosity\":null"),
            "{said}"
        );
        assert!(
            output.status.code() == Some(1) || !said.contains("[null"),
            "{said}"
        );
    }
    let faults = "[[grid]]\nfoo = 1\nfriction = -1\n".repeat(34_000);
    std::fs::write(at.join("faults.toml"), format!("name = \"f\"\n{faults}")).unwrap();
    let begun = std::time::Instant::now();
    let said = refused_immediately(at, &["plan", "faults.toml"]);
    assert!(
        said.contains("faults.toml") && begun.elapsed() < Duration::from_secs(10),
        "{said}"
    );
}
