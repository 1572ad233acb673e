//! Submitted jobs, and the cases of their tasks.

use super::statements::Statements;
use super::{MergedCases, Store, StoreError};
use crate::model::campaign::Campaign;
use crate::system::process;
use rusqlite::params;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::PathBuf;

/// A submitted job.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Submission {
    #[serde(skip_serializing)]
    pub(crate) id: i64,
    /// Its name at the scheduler; `None` if the submission was interrupted.
    pub job: Option<String>,
    /// Hash of its slices.
    pub plan: String,
    /// Folder of the shards of its tasks.
    pub folder: PathBuf,
    /// Number of its tasks.
    pub tasks: usize,
    /// Cases that each of them computes in parallel.
    pub workers: usize,
    /// Hash of the executable it runs.
    pub build: String,
    /// Time of submission, in milliseconds since 1970.
    pub submitted_at: i64,
    /// Time of cancellation.
    pub cancelled_at: Option<i64>,
}

/// A case that is neither finished nor failed.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct OpenCase {
    /// Its key.
    pub key: String,
    /// Estimated remaining cost, in seconds of a common core.
    pub cost: f64,
    /// Whether it has a checkpoint.
    pub begun: bool,
}

/// Progress of a slice, according to the store.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct SliceState {
    /// Its cases.
    pub cases: u64,
    /// Those that are finished or failed.
    pub ended: u64,
    /// Share of its estimated work that is done.
    pub work_done: f64,
}

impl Store {
    /// Open cases of the grid in the order of work.
    pub(crate) fn open_cases(&self) -> Result<Vec<OpenCase>, StoreError> {
        self.named(
            "SELECT key, cost * (1.0 - min(1.0 * steps_done / steps, 1.0)) AS cost,
                 steps_done > 0 AS begun
             FROM cases WHERE state IN ('pending', 'running') AND counts
             ORDER BY turn, gain DESC, position",
            [],
        )
    }

    /// Records a job before its submission; [`Store::submitted`] adds its name.
    pub(crate) fn submit(
        &mut self,
        submission: &Submission,
        slices: &[Vec<String>],
    ) -> Result<i64, StoreError> {
        self.write(|connection| {
            connection.execute(
                "INSERT INTO submissions (engine, job, plan, folder, tasks, workers, build,
                     submitted_at)
                 VALUES ('slurm', NULL, ?1, ?2, ?3, ?4, ?5, ?6)",
                params![
                    submission.plan,
                    submission.folder.to_string_lossy(),
                    submission.tasks,
                    submission.workers,
                    submission.build,
                    process::now(),
                ],
            )?;
            let id = connection.last_insert_rowid();
            let mut insert = connection.prepare_cached(
                "INSERT INTO slices (submission, case_id, task) SELECT ?1, id, ?3 FROM cases
                     WHERE key = ?2",
            )?;
            for (task, keys) in slices.iter().enumerate() {
                for key in keys {
                    insert.execute(params![id, key, task])?;
                }
            }
            Ok(id)
        })
    }

    /// Records the name of a job at the scheduler.
    pub(crate) fn submitted(&mut self, id: i64, job: &str) -> Result<(), StoreError> {
        let named = "UPDATE submissions SET job = ?2 WHERE id = ?1";
        self.write(|connection| connection.run(named, params![id, job]))
    }

    /// Deletes a job that the scheduler refused.
    pub(crate) fn not_submitted(&mut self, id: i64) -> Result<(), StoreError> {
        self.write(|connection| {
            connection.run("DELETE FROM slices WHERE submission = ?1", [id])?;
            connection.run("DELETE FROM submissions WHERE id = ?1", [id])
        })
    }

    /// Records that a job was cancelled.
    pub(crate) fn cancelled(&mut self, id: i64) -> Result<(), StoreError> {
        let over = "UPDATE submissions SET cancelled_at = coalesce(cancelled_at, ?2) WHERE id = ?1";
        self.write(|connection| connection.run(over, params![id, process::now()]))
    }

    /// All jobs, the first first.
    pub(crate) fn submissions(&self) -> Result<Vec<Submission>, StoreError> {
        self.named("SELECT * FROM submissions ORDER BY id", [])
    }

    /// Keys of the open cases of a job, with their tasks.
    pub(crate) fn open_of(&self, id: i64) -> Result<HashMap<String, usize>, StoreError> {
        self.rows(
            "SELECT c.key, s.task FROM slices s JOIN cases c ON c.id = s.case_id
                 WHERE s.submission = ?1 AND c.state IN ('pending', 'running')",
            [id],
            |row| row.try_into(),
        )
    }

    /// Progress of the slices of a job, by task.
    pub(crate) fn slice_states(
        &self,
        id: i64,
        tasks: usize,
    ) -> Result<Vec<SliceState>, StoreError> {
        #[derive(Deserialize)]
        struct OfTask {
            task: usize,
            #[serde(flatten)]
            state: SliceState,
        }
        let found: Vec<OfTask> = self.named(
            "SELECT s.task, count(*) AS cases,
                 count(*) FILTER (WHERE c.state IN ('done', 'jammed', 'failed')) AS ended,
                 total(CASE WHEN c.state IN ('done', 'jammed', 'failed') THEN c.cost
                            ELSE c.cost * c.steps_done / c.steps END) / max(total(c.cost), 1e-300)
                     AS work_done
             FROM slices s JOIN cases c ON c.id = s.case_id WHERE s.submission = ?1 GROUP BY s.task",
            [id],
        )?;
        let mut states = vec![SliceState::default(); tasks];
        for found in found {
            if let Some(state) = states.get_mut(found.task) {
                *state = found.state;
            }
        }
        Ok(states)
    }

    /// Progress of a published shard.
    pub(crate) fn slice_of_shard(path: &std::path::Path) -> Result<SliceState, StoreError> {
        let shard = Self::open_shard(path)?;
        let work = shard.work()?;
        let counts = work.counts;
        Ok(SliceState {
            cases: counts.total(),
            ended: counts.done + counts.jammed + counts.failed,
            work_done: if work.total > 0.0 {
                (work.done + work.given_up) / work.total
            } else {
                1.0
            },
        })
    }

    /// Writes the started ones among some cases, with their data, into a new store.
    pub(crate) fn write_begun(
        &self,
        campaign: &Campaign,
        keys: &std::collections::HashSet<&str>,
        to: &std::path::Path,
    ) -> Result<(), StoreError> {
        let mut some = campaign.clone();
        some.rules.clear();
        some.cases
            .retain(|(key, _)| keys.contains(key.to_string().as_str()));
        let (mut new, _) = Store::enter(to, &some)?;
        new.merge(MergedCases::Own, std::slice::from_ref(&self.path))?;
        Ok(())
    }
}
