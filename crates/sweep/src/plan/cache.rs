//! Measured runs, kept in the user's cache: a file for every machine and build, a line of JSON for
//! every run.
//!
//! The cache only saves time: a missing, damaged or unwritable file is no error.

use super::costs::Record;
use crate::system::files::{cache_folder, folder_of, read_text, write_whole};
use crate::system::process::{Identity, build};
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Size in bytes at which the older half is dropped.
const LIMIT: u64 = 1 << 20;
/// Minimum steps of a run that is kept: shorter runs consist mostly of their start.
const MIN_STEPS: u64 = 20;

/// The file of this machine and this build; `None` without a home.
fn place() -> Option<PathBuf> {
    static PLACE: LazyLock<Option<PathBuf>> = LazyLock::new(|| {
        let host = Identity::of_this_process().host.replace('/', "-");
        Some(cache_folder()?.join(format!("costs-{host}-{}.jsonl", build())))
    });
    PLACE.clone()
}

/// Stores measured runs, except those that are too short to be representative.
pub(crate) fn record(records: &[Record]) {
    if let Some(place) = place() {
        // Without a cache the next plan measures again.
        let _ = append(&place, records);
    }
}

/// Appends lines, and drops old ones where there are too many.
fn append(place: &Path, records: &[Record]) -> std::io::Result<()> {
    let mut lines = Vec::new();
    for record in records.iter().filter(|run| run.steps >= MIN_STEPS) {
        serde_json::to_writer(&mut lines, record)?;
        lines.push(b'\n');
    }
    if lines.is_empty() {
        return Ok(());
    }
    std::fs::create_dir_all(folder_of(place))?;
    if std::fs::metadata(place).is_ok_and(|file| file.len() > LIMIT) {
        let text = read_text(place, u64::MAX)?;
        let lines: Vec<&str> = text.lines().collect();
        let kept = lines[lines.len() / 2..].join("\n") + "\n";
        write_whole(place, |file| file.write_all(kept.as_bytes()))?;
    }
    // In one write: several processes may append.
    let mut file = File::options().create(true).append(true).open(place)?;
    file.write_all(&lines)
}

/// All runs kept, the oldest first. Lines that cannot be read are left out.
pub(super) fn records() -> Vec<Record> {
    let text = place()
        .and_then(|place| read_text(&place, 2 * LIMIT).ok())
        .unwrap_or_default();
    text.lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinite_shear_rates_and_half_a_line_do_no_harm() {
        let directory = tempfile::tempdir().unwrap();
        let place = directory.path().join("deep/costs.jsonl");
        let run = Record {
            params: crate::test_support::params(),
            steps: 100,
            cpu_s: 1.5,
        };
        append(&place, std::slice::from_ref(&run)).unwrap();
        append(&place, std::slice::from_ref(&run)).unwrap();
        let text = std::fs::read_to_string(&place).unwrap();
        let read = |text: &str| -> Vec<Record> {
            let lines = text.lines();
            lines
                .filter_map(|line| serde_json::from_str(line).ok())
                .collect()
        };
        assert_eq!(read(&text), [run.clone(), run.clone()]);
        assert_eq!(read(&text[..text.len() - 9]), [run]);
    }
}
