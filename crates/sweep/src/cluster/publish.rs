//! Publishing a shard: copied, synced and renamed, so that readers never see a partial one.

use super::{ClusterError, no_room};
use crate::store::{self, StoreError};
use crate::system::files::{folder_of, temporary_file, with_suffix, write_whole};
use crate::system::lock;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Minimum interval between copies, as a multiple of the duration of the last one.
const SHARE: u32 = 50;

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
        std::fs::create_dir_all(folder_of(&self.target))?;
        // Under a unique name: a task that was started twice by mistake publishes from the same
        // store.
        let snapshot = temporary_file(folder_of(&self.work))?;
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
