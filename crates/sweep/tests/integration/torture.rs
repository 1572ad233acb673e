//! Kills of processes, damage to files, and disturbed clocks at random moments: what comes out is
//! what an undisturbed run computes, or there is a message.
//!
//! The short versions run with all tests. The long ones are for changes of the store:
//! ```sh
//! KILLS=300 CORRUPTIONS=300 cargo test --release -p sweep --test integration torture -- --ignored
//! ```
//! SEED chooses other moments.

mod damage;

use crate::harness::{
    PATIENCE, chosen, dump, folder, json, program, run, send, spawn, sweep, until,
};
use crate::harness::{without_times, words};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rustix::process::Signal;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

/// A campaign of runs of a second, in which some runs may fail.
fn campaign(seeds: usize) -> String {
    let grid = |hydrodynamics: &str, fraction: f64, rate: &str, spheres: usize| {
        format!(
            "[[grid]]\narea_fraction = {fraction}\nfriction = 0.3\nroughness = 0.01\nshear_rate = {rate}\n\
             seeds = {seeds}\nspheres = {spheres}\nhydrodynamics = \"{hydrodynamics}\"\n\
             contact = [\"rigid\", \"procedure\"]\n"
        )
    };
    format!(
        "name = \"torture\"\n[protocol]\nstrain = 2.0\ndiscard = 0.2\ncheckpoint_every = 0.01\n{}{}",
        grid("ball-melrose", 0.65, "[1.0, inf]", 60),
        grid("stokesian-dynamics", 0.6, "1.0", 30)
    )
}

fn random() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(chosen("SEED", 1) as u64)
}

/// Waits between 0.1 and 0.9 s.
fn moment(random: &mut ChaCha8Rng) {
    std::thread::sleep(Duration::from_millis(random.random_range(100..900)));
}

/// Starts a process that computes the campaign of a folder with one thread.
fn worker(at: &Path) -> Child {
    program(at)
        .args(["run", "c.toml", "--store", "s.sqlite", "-q", "-w1"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Computes the rest of a campaign. Runs may have failed.
fn complete(at: &Path, store: &str) {
    let output = run(at, &["run", "c.toml", "--store", store, "--quiet"]);
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 1)), "{output:?}");
}

fn number(store: &Path, query: &str) -> i64 {
    let store = rusqlite::Connection::open(store).unwrap();
    store.busy_timeout(PATIENCE).unwrap();
    store.query_row(query, [], |row| row.get(0)).unwrap()
}

/// Cases that are not computed.
fn left(store: &Path) -> i64 {
    let open = "SELECT count(*) FROM cases WHERE state IN ('pending', 'running')";
    number(store, open)
}

/// The report and the table of runs, without times.
fn report(at: &Path, store: &str) -> String {
    let mut report = json(at, &["report", store]);
    without_times(&mut report);
    report.to_string()
}

/// Asserts that a store is what an undisturbed run of its campaign computes.
fn same_as_undisturbed(at: &Path) {
    let store = at.join("s.sqlite");
    complete(at, "calm.sqlite");
    let (calm, disturbed) = (dump(&at.join("calm.sqlite")), dump(&store));
    let different = calm.iter().zip(&disturbed).find(|(a, b)| a != b);
    assert_eq!(different, None);
    assert_eq!(calm.len(), disturbed.len());
    assert_eq!(report(at, "s.sqlite"), report(at, "calm.sqlite"));
    assert_eq!(left(&store), 0);
    let twice = "SELECT count(*) FROM (SELECT key FROM cases GROUP BY key HAVING count(*) > 1)";
    assert_eq!(number(&store, twice), 0);
    let check = "SELECT count(*) FROM pragma_integrity_check WHERE integrity_check <> 'ok'";
    assert_eq!(number(&store, check), 0);
}

/// One to four processes share a store and are killed with KILL until so many have been killed; the
/// grid grows whenever the work runs out. Returns the folder.
fn killed(kills_wanted: usize) -> tempfile::TempDir {
    let mut random = random();
    let mut seeds = 1;
    let folder = folder("c.toml", &campaign(seeds));
    let at = folder.path();
    let store = at.join("s.sqlite");
    let (mut kills, mut kept) = (0, 0);
    while kills < kills_wanted {
        let mut workers: Vec<Child> = (0..random.random_range(1..=4))
            .map(|_| worker(at))
            .collect();
        for worker in &mut workers {
            moment(&mut random);
            // It may have ended.
            kills += usize::from(worker.try_wait().unwrap().is_none());
            let _ = worker.kill();
        }
        for worker in workers {
            let output = worker.wait_with_output().unwrap();
            // Killed, done, or done with failed runs.
            let code = output.status.code();
            assert!(matches!(code, None | Some(0 | 1)), "{output:?}");
        }
        // Stores as a kill leaves them, with their logs, for tests of damage.
        if kept < 3 && at.join("s.sqlite-wal").exists() {
            for end in ["", "-wal", "-shm"] {
                let to = at.join(format!("killed{kept}.sqlite{end}"));
                let _ = std::fs::copy(at.join(format!("s.sqlite{end}")), to);
            }
            kept += 1;
        }
        if store.exists() && left(&store) < 4 {
            seeds += 1 + seeds / 2;
            std::fs::write(at.join("c.toml"), campaign(seeds)).unwrap();
        }
    }
    complete(at, "s.sqlite");
    same_as_undisturbed(at);
    folder
}

#[test]
fn killed_campaigns_and_damaged_stores_lose_nothing() {
    damage::check(killed(8).path(), 16);
}

#[test]
#[ignore = "minutes: hundreds of kills and of damaged stores"]
fn hundreds_of_kills_and_of_damages_lose_nothing() {
    let folder = killed(chosen("KILLS", 200));
    damage::check(folder.path(), chosen("CORRUPTIONS", 200));
}

#[test]
#[ignore = "a minute: waits until a process can be stopped while it holds the lock"]
fn a_process_that_waits_for_the_lock_of_another_says_so() {
    let text = campaign(60).replace(
        "strain = 2.0\ndiscard = 0.2",
        "strain = 0.02\ndiscard = 0.0",
    );
    let folder = folder("c.toml", &text);
    let at = folder.path();
    let store = at.join("s.sqlite");
    let mut holder = worker(at);
    let is_locked = || {
        rusqlite::Connection::open(&store)
            .and_then(|store| store.execute_batch("BEGIN IMMEDIATE; ROLLBACK"))
            .is_err()
    };
    until("a process stopped with the lock", || {
        assert_eq!(holder.try_wait().unwrap(), None, "it ended before");
        if !store.exists() {
            return None;
        }
        send(&holder, Signal::STOP);
        if is_locked() {
            return Some(());
        }
        send(&holder, Signal::CONT);
        None
    });
    let said = at.join("said");
    let mut other = program(at)
        .args(["run", "c.toml", "--store", "s.sqlite", "-w1"])
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&said).unwrap())
        .spawn()
        .unwrap();
    let wanted = format!("held by process {} on", holder.id());
    until("a note about the lock", || {
        words(&std::fs::read(&said).unwrap())
            .contains(&wanted)
            .then_some(())
    });
    send(&holder, Signal::CONT);
    holder.wait().unwrap();
    other.wait().unwrap();
    assert_eq!(left(&store), 0);
}

#[test]
#[ignore = "minutes: processes are stopped while the clock of their heartbeats jumps by days"]
fn stopped_processes_and_jumps_of_the_clock_change_nothing() {
    let mut random = random();
    let folder = folder("c.toml", &campaign(2));
    let at = folder.path();
    let store = at.join("s.sqlite");
    let mut stops = 0;
    while stops < chosen("KILLS", 200) / 20 + 4 {
        for end in ["", "-wal", "-shm"] {
            let _ = std::fs::remove_file(at.join(format!("s.sqlite{end}")));
        }
        let mut workers = [worker(at), worker(at)];
        until("its store", || store.exists().then_some(()));
        while workers
            .iter_mut()
            .any(|worker| worker.try_wait().unwrap().is_none())
        {
            let stopped = &mut workers[random.random_range(0..2)];
            if stopped.try_wait().unwrap().is_none() {
                send(stopped, Signal::STOP);
                stops += 1;
                moment(&mut random);
                send(stopped, Signal::CONT);
            }
            // What a process with another clock has written.
            let shift = random.random_range(-5 * 86_400_000..5 * 86_400_000_i64);
            let connection = rusqlite::Connection::open(&store).unwrap();
            connection.busy_timeout(PATIENCE).unwrap();
            let _ = connection.execute("UPDATE processes SET heartbeat = heartbeat + ?1", [shift]);
        }
        for worker in workers {
            let output = worker.wait_with_output().unwrap();
            assert!(matches!(output.status.code(), Some(0 | 1)), "{output:?}");
        }
        same_as_undisturbed(at);
    }
}

#[test]
fn files_of_killed_commands_are_whole() {
    outputs_are_whole(5);
}

#[test]
#[ignore = "a minute: a hundred kills of commands that write files"]
fn files_of_a_hundred_killed_commands_are_whole() {
    outputs_are_whole(chosen("KILLS", 100));
}

fn outputs_are_whole(kills: usize) {
    let mut random = random();
    let folder = folder("c.toml", &campaign(1));
    let at = folder.path();
    complete(at, "s.sqlite");
    let write = [
        "report",
        "s.sqlite",
        "--figure",
        "t.svg",
        "--csv",
        "t.csv",
        "--parquet",
        "t.parquet",
        "--page",
        "t.html",
    ];
    let names = ["t.svg", "t.csv", "t.parquet", "t.html"];
    sweep(at, &write);
    let whole = names.map(|name| std::fs::read(at.join(name)).unwrap());
    for _ in 0..kills {
        for name in names {
            let _ = std::fs::remove_file(at.join(name));
        }
        let mut writer = spawn(at, &write);
        std::thread::sleep(Duration::from_millis(random.random_range(0..100)));
        let _ = writer.kill();
        writer.wait().unwrap();
        for (name, whole) in names.iter().zip(&whole) {
            if let Ok(written) = std::fs::read(at.join(name)) {
                assert!(written == *whole, "{name} is not whole");
            }
        }
    }
}
