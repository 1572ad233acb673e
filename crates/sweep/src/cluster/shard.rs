//! Shards: stores of a part of a campaign that one task computes and publishes.
//!
//! A task works in a private store on a local disk and copies it, whole and synced, into the shared
//! folder under a unique name. A published shard is only ever replaced by a newer one: readers need
//! no locks.

use crate::store::TaskName;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

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
}
