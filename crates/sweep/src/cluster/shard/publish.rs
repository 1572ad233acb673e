//! Publishing a shard: copied, synced and renamed, so that nobody ever sees half of one.

use super::ShardError;
use crate::disk::is_full;
use crate::store::{self, StoreError};
use crate::system::files::{folder_of, with_suffix, write_whole};
use crate::system::lock;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Time between copies is at least this many times what the last one took.
const SHARE: u32 = 50;

/// Publishes the store of a task now and then.
#[derive(Debug)]
pub(crate) struct Publisher {
    /// The store the task works in.
    work: PathBuf,
    /// The shard all can read.
    target: PathBuf,
    /// Time from one copy to the next.
    every: Duration,
    /// The last copy: when it ended, and how long it took.
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

    /// The shard.
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
    /// [`ShardError::Publish`]. What was published before stays, and so does the store of the task.
    pub(crate) fn publish(&self) -> Result<(), ShardError> {
        let begun = Instant::now();
        let mut last = lock(&self.last);
        let result = self.copy();
        *last = (Instant::now(), begun.elapsed());
        result.map_err(|source| self.explain(source))
    }

    /// Copies the store into the folder.
    fn copy(&self) -> io::Result<()> {
        std::fs::create_dir_all(folder_of(&self.target))?;
        // Under a name of its own: a task that was started twice by mistake publishes from the same store.
        let snapshot = tempfile::Builder::new()
            .prefix(".sweep-snapshot-")
            .tempfile_in(folder_of(&self.work))?;
        store::snapshot(&self.work, snapshot.path()).map_err(of_the_store)?;
        write_whole(&self.target, |shard| {
            io::copy(&mut File::open(snapshot.path())?, shard).map(|_| ())
        })
    }

    /// Takes the store of the task away, which is published whole.
    pub(crate) fn clean_up(&self) {
        for suffix in ["", "-wal", "-shm"] {
            let _ = std::fs::remove_file(with_suffix(&self.work, suffix));
        }
    }

    /// What a failed copy means.
    fn explain(&self, source: io::Error) -> ShardError {
        let folder = self.target.parent().unwrap_or(Path::new("."));
        let full = no_room(&source, &self.target);
        let advice = format!(
            "what was published before stays, and {} holds the rest; {}, then start the task again \
             (scontrol requeue JOB_TASK), or give `sweep submit` again: it goes on from what is published",
            self.work.display(),
            if full {
                format!("make room in {}", folder.display())
            } else {
                format!("make {} writable", folder.display())
            }
        );
        ShardError::Publish {
            path: self.target.clone(),
            source,
            full,
            advice,
        }
    }
}

/// Whether a file could not be written for want of room.
pub(crate) fn no_room(error: &io::Error, path: &Path) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
    ) || is_full(path)
}

/// An error of the store as one of the system, which is what stands behind it here.
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
    fn what_two_of_one_name_publish_at_once_is_whole() {
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
        // Nothing but the store and the shard is left.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn used_up_quota_is_named_with_what_to_do() {
        let publisher = Publisher::new("/scratch/a".into(), "/shared/b".into(), Duration::ZERO);
        for kind in [io::ErrorKind::QuotaExceeded, io::ErrorKind::StorageFull] {
            let error = publisher.explain(io::Error::from(kind));
            assert!(error.to_string().contains("quota"), "{error}");
            let ShardError::Publish { advice, .. } = error else {
                unreachable!("it is about publishing")
            };
            assert!(advice.contains("make room in /shared") && advice.contains("/scratch/a"));
        }
    }
}
