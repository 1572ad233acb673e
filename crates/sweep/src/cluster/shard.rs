//! Shards: stores of a part of a campaign that one task computes and publishes.
//!
//! A task works in a private store on a local disk and copies it, whole and synced, into the shared
//! folder under a unique name. A published shard is only ever replaced by a newer one: readers need
//! no locks.

use super::{ClusterError, no_room};
use crate::store::{self, StoreError, TaskName};
use crate::system::files::{self, temporary_file, with_suffix, write_whole};
use crate::system::lock;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant, SystemTime};

/// Minimum interval between copies, as a multiple of the duration of the last one.
const SHARE: u32 = 50;
/// Ending of a shard's name.
const ENDING: &str = ".sqlite";
/// File with the runs that were begun when a plan was made, in its folder, so that its tasks
/// continue them.
pub(crate) const BEGUN: &str = "begun.sqlite";

/// The folder of shards that belongs to a store: `results/NAME.shards` for `results/NAME.sqlite`.
pub(crate) fn folder_of(store: &Path) -> PathBuf {
    store.with_extension("shards")
}

/// The folder of a plan among the shards.
pub(crate) fn plan_folder(folder: &Path, plan: &str) -> PathBuf {
    folder.join("plans").join(plan)
}

/// File that marks a job as cancelled: its tasks do not request a restart.
pub(crate) fn cancel_mark(folder: &Path, plan: &str, job: &str) -> PathBuf {
    let job = sanitize(job.split(';').next().unwrap_or(job));
    plan_folder(folder, plan).join(format!("cancelled-{job}"))
}

/// The name of a shard: plan, job, task, restart, node.
pub(crate) fn name(plan: &str, task: &TaskName) -> String {
    format!(
        "{plan}.{}.{}.{}.{}{ENDING}",
        sanitize(&task.job),
        task.task,
        task.restart,
        sanitize(&task.node)
    )
}

/// A word as part of a name of a file.
pub(crate) fn sanitize(word: &str) -> String {
    let sanitize = |c: char| {
        if c.is_ascii_alphanumeric() || "_-".contains(c) {
            c
        } else {
            '-'
        }
    };
    word.chars().map(sanitize).collect()
}

/// A published shard, parsed from its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Published {
    pub path: PathBuf,
    /// Hash of the slices it belongs to.
    pub plan: String,
    pub task: TaskName,
    pub at: Option<SystemTime>,
}

/// All shards in a folder, in the order of their names. A folder that is not there holds none.
pub(crate) fn published(folder: &Path) -> Vec<Published> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<Published> = entries
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            let (plan, task) = parse(&name)?;
            Some(Published {
                path: entry.path(),
                plan,
                task,
                at: entry.metadata().and_then(|file| file.modified()).ok(),
            })
        })
        .collect();
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

/// Parses the name of a shard.
fn parse(name: &str) -> Option<(String, TaskName)> {
    let parts: Vec<&str> = name.strip_suffix(ENDING)?.split('.').collect();
    let [plan, job, task, restart, node] = parts.as_slice() else {
        return None;
    };
    Some((
        (*plan).to_owned(),
        TaskName {
            job: (*job).to_owned(),
            task: task.parse().ok()?,
            restart: restart.parse().ok()?,
            node: (*node).to_owned(),
        },
    ))
}

/// Publishes the store of a task at intervals.
#[derive(Debug)]
pub(crate) struct Publisher {
    work: PathBuf,
    target: PathBuf,
    every: Duration,
    /// The last copy: its end and its duration.
    last: Mutex<(Instant, Duration)>,
}

impl Publisher {
    /// Of the store `work`, as the shard `target`.
    pub(crate) fn new(work: PathBuf, target: PathBuf, every: Duration) -> Self {
        Self {
            work,
            target,
            every,
            last: Mutex::new((Instant::now(), Duration::ZERO)),
        }
    }

    pub(crate) fn target(&self) -> &Path {
        &self.target
    }

    /// Whether it is time for the next copy.
    pub(crate) fn is_due(&self) -> bool {
        let (ended, took) = *lock(&self.last);
        ended.elapsed() >= self.every.max(took * SHARE)
    }

    /// Publishes what the store holds now. The folder is made again if it has vanished.
    ///
    /// # Errors
    /// [`ClusterError::Publish`]. Earlier publications and the store of the task are kept.
    pub(crate) fn publish(&self) -> Result<(), ClusterError> {
        let begun = Instant::now();
        let mut last = lock(&self.last);
        let result = self.copy();
        *last = (Instant::now(), begun.elapsed());
        result.map_err(|source| self.explain(source))
    }

    fn copy(&self) -> io::Result<()> {
        std::fs::create_dir_all(files::folder_of(&self.target))?;
        // Under a unique name: a task that was started twice by mistake publishes from the same
        // store.
        let snapshot = temporary_file(files::folder_of(&self.work))?;
        store::snapshot(&self.work, snapshot.path()).map_err(of_the_store)?;
        write_whole(&self.target, |shard| {
            io::copy(&mut File::open(snapshot.path())?, shard).map(|_| ())
        })
    }

    /// Deletes the store of the task, which is fully published.
    pub(crate) fn clean_up(&self) {
        for suffix in ["", "-wal", "-shm"] {
            let _ = std::fs::remove_file(with_suffix(&self.work, suffix));
        }
    }

    fn explain(&self, source: io::Error) -> ClusterError {
        ClusterError::Publish {
            full: no_room(&source, &self.target),
            path: self.target.clone(),
            work: self.work.clone(),
            source,
        }
    }
}

/// The system error behind an error of the store.
fn of_the_store(error: StoreError) -> io::Error {
    let full = matches!(&error, StoreError::Sqlite { what, .. } if what.contains("disk is full"));
    let kind = if full {
        io::ErrorKind::StorageFull
    } else {
        io::ErrorKind::Other
    };
    io::Error::new(kind, error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_identify_the_publisher() {
        let task = TaskName {
            job: "12;main".into(),
            task: 3,
            restart: 2,
            node: "n1.site".into(),
        };
        let file = name("abcd", &task);
        assert_eq!(file, "abcd.12-main.3.2.n1-site.sqlite");
        let (plan, found) = parse(&file).unwrap();
        assert_eq!((plan.as_str(), found.task, found.restart), ("abcd", 3, 2));
        assert!(parse("store.sqlite").is_none());
        assert!(parse(".abcd.1.2.3.n1.sqlite.part-7").is_none());
    }

    #[test]
    fn simultaneous_publications_of_one_name_are_complete() {
        let folder = tempfile::tempdir().unwrap();
        let [work, target] = ["work", "shard"].map(|name| folder.path().join(name));
        let store = rusqlite::Connection::open(&work).unwrap();
        store
            .execute_batch("CREATE TABLE t AS SELECT randomblob(1000000) AS x")
            .unwrap();
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    let publisher = Publisher::new(work.clone(), target.clone(), Duration::ZERO);
                    for _ in 0..20 {
                        publisher.publish().unwrap();
                        let shard = rusqlite::Connection::open(&target).unwrap();
                        let length = "SELECT length(x) FROM t";
                        let length = shard.query_row(length, [], |row| row.get(0));
                        assert_eq!(length, Ok(1_000_000));
                    }
                });
            }
        });
        // Only the store and the shard remain.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn used_up_quota_is_named_with_what_to_do() {
        let publisher = Publisher::new("/scratch/a".into(), "/shared/b".into(), Duration::ZERO);
        for kind in [io::ErrorKind::QuotaExceeded, io::ErrorKind::StorageFull] {
            let error = publisher.explain(io::Error::from(kind));
            assert!(error.to_string().contains("quota"), "{error}");
            let advice = miette::Diagnostic::help(&error).unwrap().to_string();
            assert!(advice.contains("make room") && advice.contains("/scratch/a"));
        }
    }
}
