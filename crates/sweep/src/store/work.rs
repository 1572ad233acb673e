//! Progress of a campaign and estimate of its remaining time.

use super::schema::{params, state};
use super::statements::Statements;
use super::{Store, StoreError};
use crate::model::case::State;
use crate::system::process;
use rusqlite::Row;
use sd_core::Params;
use serde::Serialize;
use std::collections::HashSet;

/// Cases of the grid by state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Finished.
    pub done: u64,
    /// Ended as jammed layers.
    pub jammed: u64,
    /// Ended with an error.
    pub failed: u64,
    /// Owned by a process.
    pub running: u64,
    /// Not started, or stopped.
    pub pending: u64,
}

impl Counts {
    /// All cases of the grid.
    pub fn total(&self) -> u64 {
        self.done + self.jammed + self.failed + self.running + self.pending
    }

    /// Number of cases in a state.
    pub(crate) fn of(&mut self, state: State) -> &mut u64 {
        match state {
            State::Done => &mut self.done,
            State::Jammed => &mut self.jammed,
            State::Failed => &mut self.failed,
            State::Running => &mut self.running,
            State::Pending => &mut self.pending,
        }
    }

    /// Counts a case that ended in this state since the last count.
    pub(crate) fn end(&mut self, state: State) {
        if matches!(state, State::Pending | State::Running) {
            return;
        }
        // It may have been claimed after that count.
        let open = if self.running > 0 {
            &mut self.running
        } else {
            &mut self.pending
        };
        if *open > 0 {
            *open -= 1;
            *self.of(state) += 1;
        }
    }
}

/// Progress of the grid, in estimated CPU seconds.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Its cases by state.
    pub counts: Counts,
    /// Total work.
    pub total: f64,
    /// Work done: finished cases, and others up to their last checkpoint, except those running in
    /// this process.
    pub done: f64,
    /// Failed cases, which are not retried automatically.
    pub given_up: f64,
    /// Remaining work of pending and running cases.
    pub left: f64,
    /// Running cases with a recent heartbeat of their process.
    alive: u64,
}

/// Progress of the runs of one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PointWork {
    /// Position of the first of them in the campaign.
    pub(crate) position: usize,
    /// All that count.
    pub(crate) runs: f64,
    /// Those that have not ended.
    pub(crate) open: f64,
    /// The done part of these, in runs.
    pub(crate) done: f64,
}

/// Number of finished runs used to estimate the speed of a machine.
const SAMPLED: i64 = 1000;

/// One process in a list.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProcessLine {
    /// Its host.
    pub host: String,
    /// Its process id.
    pub pid: u32,
    /// Seconds since its last heartbeat.
    pub silent_s: f64,
    /// Cases it owns.
    pub running: u64,
}

impl Store {
    /// Cases of the grid by state.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub fn counts(&self) -> Result<Counts, StoreError> {
        self.work().map(|work| work.counts)
    }

    /// Progress of the grid, from one scan of all cases.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub fn work(&self) -> Result<Work, StoreError> {
        let heard_since = process::now()
            - i64::try_from(process::HEARTBEAT_LIMIT.as_millis()).unwrap_or(i64::MAX);
        let read = || {
            let alive = "SELECT id FROM processes WHERE ended_at IS NULL AND heartbeat >= ?1";
            let alive: HashSet<i64> = self.connection.values(alive, [heard_since])?;
            // Summed here: SQLite would sort all cases by their states first.
            let mut query = self.connection.prepare_cached(
                "SELECT state, cost, cost * min(1.0 * steps_done / steps, 1.0), owner
                     FROM cases NOT INDEXED WHERE counts",
            )?;
            let mut rows = query.query([])?;
            let mut work = Work::default();
            while let Some(row) = rows.next()? {
                let state = state(row.get_ref(0)?)?;
                let (cost, done): (f64, f64) = (row.get(1)?, row.get(2)?);
                let owner: Option<i64> = row.get(3)?;
                work.total += cost;
                match state {
                    State::Done | State::Jammed => work.done += cost,
                    State::Failed => work.given_up += cost,
                    State::Pending | State::Running => {
                        work.left += cost - done;
                        if owner != Some(self.me()) {
                            work.done += done;
                        }
                    }
                }
                work.alive += u64::from(owner.is_some_and(|owner| alive.contains(&owner)));
                *work.counts.of(state) += 1;
            }
            Ok(work)
        };
        self.read(read())
    }

    /// Wall and CPU seconds of finished runs, over their estimates; `None` without finished runs.
    fn pace(&self) -> Result<Option<(f64, f64)>, StoreError> {
        let mut sums = (0.0, 0.0, 0.0);
        self.sampled_runs(
            "SELECT r.case_id, r.wall_time_s, r.cpu_time_s, c.cost * r.computed / c.steps
                 FROM results r
             JOIN cases c ON c.id = r.case_id",
            |row| {
                sums.0 += row.get::<_, f64>(1)?;
                sums.1 += row.get::<_, f64>(2)?;
                sums.2 += row.get::<_, f64>(3)?;
                Ok(())
            },
        )?;
        Ok((sums.2 > 0.0).then(|| (sums.0 / sums.2, sums.1 / sums.2)))
    }

    /// Calls `each` with rows about finished runs, evenly spread over the store.
    fn sampled_runs(
        &self,
        query: &str,
        mut each: impl FnMut(&Row<'_>) -> rusqlite::Result<()>,
    ) -> Result<(), StoreError> {
        let mut read = || {
            let last = "SELECT coalesce(max(case_id), 0) FROM results";
            let last: i64 = self.connection.one(last, [], |row| row.get(0))?;
            let stride = (last / SAMPLED).max(1);
            let query = format!("{query} WHERE r.case_id >= ?1 ORDER BY r.case_id LIMIT 1");
            let mut from = 0;
            let mut next = |row: &Row<'_>| each(row).and_then(|()| row.get::<_, i64>(0));
            while let Some(found) = self.connection.find(&query, [from], &mut next)? {
                from = found + stride;
            }
            Ok(())
        };
        self.read(read())
    }

    /// Estimated remaining CPU seconds of open cases, scaled by finished ones.
    pub(crate) fn remaining_cpu_s(&self, work: &Work) -> Result<f64, StoreError> {
        Ok(work.left * self.pace()?.map_or(1.0, |(_, cpu)| cpu))
    }

    /// Estimated seconds until running and pending cases are done, scaled by finished ones; `None`
    /// without running processes or finished cases.
    pub(crate) fn time_left(&self, work: &Work) -> Result<Option<f64>, StoreError> {
        if work.alive == 0 {
            return Ok(None);
        }
        Ok(self
            .pace()?
            .map(|(wall, _)| work.left * wall / work.alive as f64))
    }

    /// Progress of the runs of each point, in the order of the campaign.
    pub(crate) fn point_work(&self) -> Result<Vec<PointWork>, StoreError> {
        self.rows(
            "SELECT min(position), count(*), total(state IN ('pending', 'running')),
                     total(CASE WHEN state IN ('pending',
                     'running') THEN min(1.0 * steps_done / steps, 1.0) END)
                 FROM cases WHERE counts GROUP BY point ORDER BY 1",
            [],
            |row| {
                Ok(PointWork {
                    position: row.get(0)?,
                    runs: row.get::<_, u64>(1)? as f64,
                    open: row.get(2)?,
                    done: row.get(3)?,
                })
            },
        )
    }

    /// Parameters, steps and CPU seconds of about a thousand runs that this build has computed on
    /// this machine.
    pub(crate) fn measured_runs(&self) -> Result<Vec<(Params, u64, f64)>, StoreError> {
        let here = (process::Identity::of_this_process().host, process::build());
        let mut runs = Vec::new();
        self.sampled_runs(
            "SELECT r.case_id, p.params, r.computed, r.cpu_time_s, o.host, o.build
                 FROM results r JOIN cases c ON c.id = r.case_id
             JOIN points p ON p.id = c.point
             JOIN processes o ON o.id = r.process",
            |row| {
                let cpu_s: f64 = row.get(3)?;
                if cpu_s > 0.0
                    && row.get::<_, String>(4)? == here.0
                    && row.get::<_, String>(5)? == here.1
                {
                    runs.push((params(row, 1)?, row.get(2)?, cpu_s));
                }
                Ok(())
            },
        )?;
        Ok(runs)
    }

    /// Processes that own cases.
    pub(crate) fn processes(&self) -> Result<Vec<ProcessLine>, StoreError> {
        let now = process::now();
        self.rows(
            "SELECT p.host, p.pid, p.heartbeat, count(*) FROM processes p
                     JOIN cases c ON c.owner = p.id
                 WHERE c.state = 'running' GROUP BY p.id ORDER BY p.id",
            [],
            |row| {
                let heartbeat: i64 = row.get(2)?;
                Ok(ProcessLine {
                    host: row.get(0)?,
                    pid: row.get(1)?,
                    silent_s: (now - heartbeat).max(0) as f64 / 1000.0,
                    running: row.get(3)?,
                })
            },
        )
    }
}
