//! The files of a store: the database and its log, and whether they are still those that were
//! opened.

use super::StoreError;
use crate::system::files::with_suffix;
use std::cell::Cell;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Identity of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FileIdentity {
    device: u64,
    /// Its inode number.
    number: u64,
}

impl FileIdentity {
    /// The identity of the present file of this name.
    pub(super) fn of(path: &Path) -> Option<Self> {
        let file = std::fs::metadata(path).ok()?;
        Some(Self {
            device: file.dev(),
            number: file.ino(),
        })
    }
}

/// The files of a store as they were when it was opened for writing.
#[derive(Debug)]
pub(super) struct OpenedFiles {
    path: PathBuf,
    database: Option<FileIdentity>,
    log: Cell<Option<FileIdentity>>,
}

impl OpenedFiles {
    /// The files of an open store; its file was this one before.
    pub(super) fn of(path: &Path, database: Option<FileIdentity>) -> Self {
        Self {
            path: path.to_owned(),
            database,
            log: Cell::new(FileIdentity::of(&log_of(path))),
        }
    }

    /// What happened to them, if they have changed. Later writes would be lost.
    pub(super) fn loss(&self) -> Option<&'static str> {
        let database = FileIdentity::of(&self.path);
        if database.is_none() {
            return Some("deleted");
        }
        if database != self.database {
            return Some("replaced by another file");
        }
        let log = FileIdentity::of(&log_of(&self.path));
        match self.log.get() {
            None => {
                self.log.set(log);
                None
            }
            own if own == log => None,
            _ => Some("separated from its log"),
        }
    }

    /// Deletes the log that these files left beside another store, if it is theirs.
    pub(super) fn remove_own_log(&self) {
        let log = log_of(&self.path);
        if self.log.get().is_some() && FileIdentity::of(&log) == self.log.get() {
            let _ = std::fs::remove_file(log);
            let _ = std::fs::remove_file(with_suffix(&self.path, "-shm"));
        }
    }
}

/// The write-ahead log beside a store.
pub(super) fn log_of(path: &Path) -> PathBuf {
    with_suffix(path, "-wal")
}

/// Whether there is a log with changes beside a store.
pub(super) fn has_log(path: &Path) -> bool {
    std::fs::metadata(log_of(path)).is_ok_and(|log| log.len() > 0)
}

/// Whether there is no store yet: no file, or an empty one, which a store replaces.
pub(crate) fn is_free(path: &Path) -> bool {
    std::fs::metadata(path).map_or(!path.exists(), |file| file.is_file() && file.len() == 0)
}

/// Refuses missing files and non-files: a folder, or a pipe, which would block forever.
pub(super) fn refuse_other_than_files(path: &Path) -> Result<(), StoreError> {
    let path = path.to_owned();
    let what = match std::fs::metadata(&path) {
        Ok(there) if there.is_dir() => "a folder, and not a store",
        Ok(there) if !there.is_file() => "not a file, so not a store",
        Err(_) if !path.exists() => return Err(StoreError::Missing { path }),
        _ => return Ok(()),
    };
    Err(StoreError::NotAFile { path, what })
}

/// The URI of a file with options, for `SQLite`.
pub(super) fn address(path: &Path, options: &str) -> String {
    let escaped = path
        .to_string_lossy()
        .replace('%', "%25")
        .replace('?', "%3f")
        .replace('#', "%23");
    format!("file:{escaped}?{options}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_replaced_file_is_another_file() {
        let directory = tempfile::tempdir().unwrap();
        let (one, two) = (directory.path().join("one"), directory.path().join("two"));
        std::fs::write(&one, "1").unwrap();
        std::fs::write(&two, "2").unwrap();
        let before = FileIdentity::of(&one);
        assert_eq!(before, FileIdentity::of(&one));
        std::fs::rename(&two, &one).unwrap();
        assert_ne!(before, FileIdentity::of(&one));
        assert_eq!(FileIdentity::of(&two), None);
    }
}
