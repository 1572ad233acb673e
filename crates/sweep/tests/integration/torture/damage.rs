//! Damage at random places of a store, of its log and of a shard.

use super::{complete, random, report};
use crate::harness::{dump, printed, run, without_times};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use std::collections::HashSet;
use std::path::Path;

/// Damages a file in one of six ways.
fn spoil(path: &Path, random: &mut ChaCha8Rng) {
    let mut bytes = std::fs::read(path).unwrap();
    if bytes.is_empty() {
        return;
    }
    let size = bytes.len();
    let mut at = random.random_range(0..size);
    // Every other time at a byte that is not zero: most are.
    if random.random() {
        for _ in 0..10 {
            if bytes[at] == 0 {
                at = random.random_range(0..size);
            }
        }
    }
    match random.random_range(0..6) {
        0 => bytes[at] = random.random(),
        1 => {
            for byte in bytes.iter_mut().skip(at).take(8) {
                *byte = random.random();
            }
        }
        2 => bytes
            .iter_mut()
            .skip(at / 4096 * 4096)
            .take(4096)
            .for_each(|byte| *byte = 0),
        3 => bytes.truncate(at),
        4 => {
            let page: Vec<u8> = bytes[at / 4096 * 4096..]
                .iter()
                .take(4096)
                .copied()
                .collect();
            let to = random.random_range(0..size / 4096 + 1) * 4096;
            for (place, byte) in bytes.iter_mut().skip(to).zip(page) {
                *place = byte;
            }
        }
        // A digit in the middle of a number of eight bytes.
        _ => {
            if let Some(byte) = bytes.get_mut(at / 8 * 8 + 5) {
                *byte = random.random();
            }
        }
    }
    std::fs::write(path, bytes).unwrap();
}

/// What the program says about a store, or its message and exit code.
fn says(at: &Path, store: &str) -> Result<Vec<String>, String> {
    let mut all = Vec::new();
    let reads: [&[&str]; 3] = [
        &[
            "report",
            store,
            "--json",
            "--csv",
            "points.csv",
            "--samples",
            "samples.csv",
        ],
        &["show", store, "1", "--json"],
        &["status", store, "--json"],
    ];
    for read in reads {
        let output = run(at, &[read, &["-q"]].concat());
        if output.status.code() != Some(0) {
            return Err(printed(&output));
        }
        // Warnings count as messages.
        if !output.stderr.is_empty() {
            return Err(String::from_utf8_lossy(&output.stderr).into_owned());
        }
        let mut said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        without_times(&mut said);
        all.push(said.to_string());
    }
    for file in ["points.csv", "samples.csv"] {
        all.push(std::fs::read_to_string(at.join(file)).unwrap());
    }
    Ok(all)
}

/// Removes a store and its log.
fn remove(at: &Path, store: &str) {
    for end in ["", "-wal", "-shm"] {
        let _ = std::fs::remove_file(at.join(format!("{store}{end}")));
    }
}

/// The lines of a store about what was computed.
fn computed(store: &Path) -> HashSet<String> {
    let is_open = |line: &String| {
        let is_about_a_run = line.starts_with("case") || line.starts_with("run");
        is_about_a_run && (line.contains("\"pending\"") || line.contains("\"running\""))
    };
    dump(store)
        .into_iter()
        .filter(|line| !is_open(line))
        .collect()
}

/// Damages the undisturbed store of a folder, logs of killed processes, and a shard, so many times
/// in all.
pub(super) fn check(at: &Path, corruptions: usize) {
    let mut random = random();
    let hurt = at.join("hurt.sqlite");
    std::fs::copy(at.join("calm.sqlite"), &hurt).unwrap();
    let good = says(at, "hurt.sqlite").unwrap();
    let table = report(at, "calm.sqlite");
    let right = computed(&at.join("calm.sqlite"));
    let (mut same, mut told, mut repaired) = (0, 0, 0);
    for corruption in 0..corruptions {
        remove(at, "hurt.sqlite");
        remove(at, "merged.sqlite");
        let killed = format!("killed{}.sqlite", random.random_range(0..3));
        if corruption % 4 == 2 && at.join(format!("{killed}-wal")).exists() {
            // A log with a missing end leaves the store as it was some changes before: then all
            // that is shown was computed.
            for end in ["", "-wal"] {
                let from = at.join(format!("{killed}{end}"));
                std::fs::copy(from, at.join(format!("hurt.sqlite{end}"))).unwrap();
            }
            spoil(&at.join("hurt.sqlite-wal"), &mut random);
            if says(at, "hurt.sqlite").is_ok() {
                let shown = computed(&hurt);
                let mut samples = shown.iter().filter(|line| line.starts_with("sample"));
                let wrong = samples.find(|line| !right.contains(*line));
                assert_eq!(wrong, None, "corruption {corruption}");
                same += 1;
            } else {
                told += 1;
            }
            continue;
        }
        std::fs::copy(at.join("calm.sqlite"), &hurt).unwrap();
        spoil(&hurt, &mut random);
        if corruption % 4 == 3 {
            // What a merge copies from a damaged shard was computed.
            let output = run(at, &["merge", "merged.sqlite", "hurt.sqlite"]);
            let code = output.status.code();
            assert!(matches!(code, Some(0..=3)), "{output:?}");
            let merged = at.join("merged.sqlite");
            if merged.exists() && code <= Some(1) {
                let wrong = computed(&merged)
                    .into_iter()
                    .find(|line| !right.contains(line));
                assert_eq!(wrong, None, "corruption {corruption}");
            }
            told += usize::from(code != Some(0));
            continue;
        }
        match says(at, "hurt.sqlite") {
            Ok(seen) => {
                assert!(
                    seen == good,
                    "corruption {corruption}: other output without a message"
                );
                same += 1;
            }
            Err(message) => {
                assert!(!message.trim().is_empty(), "no message");
                assert!(!message.contains("panic"), "{message}");
                told += 1;
            }
        }
        if corruption % 20 == 0 {
            // Intact parts are merged and the others computed: the table ends as it was.
            let merge = ["merge", "c.toml", "hurt.sqlite", "--store", "merged.sqlite"];
            if matches!(run(at, &merge).status.code(), Some(0 | 1)) {
                complete(at, "merged.sqlite");
                assert_eq!(
                    report(at, "merged.sqlite"),
                    table,
                    "corruption {corruption}"
                );
            }
            let again = run(at, &["run", "c.toml", "--store", "hurt.sqlite", "-q"]);
            if matches!(again.status.code(), Some(0 | 1)) {
                assert_eq!(report(at, "hurt.sqlite"), table, "corruption {corruption}");
                repaired += 1;
            }
        }
    }
    eprintln!(
        "{corruptions} corruptions: {same} without effect, {told} named, {repaired} repaired"
    );
}
