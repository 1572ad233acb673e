//! The files of a submission: the store, or a copy of it, and the folder of the plan.

use crate::cluster::shard::BEGUN;
use crate::cluster::{ClusterError, Job};
use crate::model::campaign::Campaign;
use crate::model::order::Order;
use crate::store::{self, OpenCase, Store};
use crate::system::files::write_whole;
use std::collections::HashSet;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The store to plan with: the original, or for a dry run a temporary copy.
pub(super) struct Draft {
    path: PathBuf,
    /// Folder of the copy, kept as long as it is needed.
    _copy: Option<TempDir>,
}

impl Draft {
    /// Of the store at `path`.
    pub(super) fn new(dry_run: bool, path: &Path) -> Result<Self, ClusterError> {
        if !dry_run {
            return Ok(Self {
                path: path.to_owned(),
                _copy: None,
            });
        }
        let folder = tempfile::tempdir()
            .map_err(|source| ClusterError::of_plan(&std::env::temp_dir(), source))?;
        let draft = folder.path().join("store.sqlite");
        if path.exists() {
            drop(Store::open_read_only(path)?);
            store::snapshot(path, &draft)?;
        }
        Ok(Self {
            path: draft,
            _copy: Some(folder),
        })
    }

    /// Opens it, with the campaign as it is now.
    pub(super) fn open(&self, campaign: &Campaign) -> Result<Store, ClusterError> {
        Ok(Store::enter(&self.path, campaign, Order::default())?.0)
    }
}

/// Writes the files of the tasks into the folder of shards; `tasks_read`: names and texts of files.
pub(super) fn write_plan(
    job: &Job,
    store: &Store,
    campaign: &Campaign,
    open: &[OpenCase],
    tasks_read: [(&str, &str); 2],
    script: &str,
) -> Result<(), ClusterError> {
    let folder = &job.plan_folder;
    let written = |path: PathBuf, result: std::io::Result<()>| {
        result.map_err(|source| ClusterError::of_plan(&path, source))
    };
    written(folder.clone(), std::fs::create_dir_all(folder))?;
    // The hash identifies the program.
    if !job.program.exists() {
        let copied = write_whole(&job.program, |copy| {
            let program = std::env::current_exe()?;
            std::io::copy(&mut std::fs::File::open(&program)?, copy)?;
            copy.set_permissions(std::fs::metadata(&program)?.permissions())
        });
        written(job.program.clone(), copied)?;
    }
    for (name, text) in tasks_read {
        let path = folder.join(name);
        written(
            path.clone(),
            write_whole(&path, |file| file.write_all(text.as_bytes())),
        )?;
    }
    written(
        job.script_path(),
        write_whole(&job.script_path(), |file| file.write_all(script.as_bytes())),
    )?;
    let begun: HashSet<&str> = open
        .iter()
        .filter(|case| case.begun)
        .map(|case| case.key.as_str())
        .collect();
    let path = folder.join(BEGUN);
    if begun.is_empty() {
        return Ok(());
    }
    let work =
        tempfile::tempdir_in(folder).map_err(|source| ClusterError::of_plan(folder, source))?;
    let (part, whole) = (work.path().join("part"), work.path().join("whole"));
    store.write_begun(campaign, &begun, &part)?;
    store::snapshot(&part, &whole)?;
    written(path.clone(), std::fs::rename(&whole, &path))?;
    Ok(())
}
