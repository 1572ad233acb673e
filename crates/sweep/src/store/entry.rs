//! Entering a campaign file into its store, and showing a store by a campaign file.

use super::digest::whole;
use super::entered::{self, Entered, LastRun};
use super::points::{self, Points};
use super::processes::{self, ActiveProcess};
use super::runs::OF_CASES;
use super::statements::Statements;
use super::{Store, StoreError, files, rules, runs, schema, settle};
use crate::model::campaign::{AsWritten, Campaign};
use crate::model::order;
use crate::model::protocol::Protocol;
use crate::system::files::{folder_of, temporary_file};
use crate::system::process;
use rusqlite::{Connection, params};
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

impl Store {
    /// Opens the store of a campaign, creates it if missing, and enters the campaign: see
    /// [`Store::adopt`]. A new store appears at its path with all its cases, or not at all.
    ///
    /// # Errors
    /// Those of [`Store::open`] and [`Store::adopt`].
    pub fn enter(path: &Path, campaign: &Campaign) -> Result<(Self, Adoption), StoreError> {
        if files::is_free(path)
            && let Some(made) = Self::create(path, campaign)?
        {
            return Ok(made);
        }
        let mut store = Self::open(path)?;
        let adoption = store.adopt(campaign)?;
        Ok((store, adoption))
    }

    /// Creates a store of a campaign; `None` if another process was faster.
    fn create(path: &Path, campaign: &Campaign) -> Result<Option<(Self, Adoption)>, StoreError> {
        // The log of a deleted store belongs to no other one. In this order: that of another
        // process is younger than its store.
        if files::has_log(path) && files::is_free(path) {
            let _ = std::fs::remove_file(files::log_of(path));
        }
        let unwritable = |source| StoreError::Unwritable {
            path: path.to_owned(),
            source,
        };
        let folder = folder_of(path);
        std::fs::create_dir_all(folder).map_err(unwritable)?;
        let draft = temporary_file(folder).map_err(|error| {
            unwritable(crate::system::disk::reason_against(path).unwrap_or(error))
        })?;
        let failed = |error| StoreError::sqlite(path, error, false);
        // No other process knows the file, and an incomplete one is discarded.
        let connection = Connection::open(draft.path()).map_err(failed)?;
        connection
            .execute_batch("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN")
            .and_then(|()| schema::create(&connection))
            .and_then(|()| connection.execute_batch("COMMIT"))
            .map_err(failed)?;
        let mut store = Self::on(connection, path)?;
        let adoption = store.adopt(campaign)?;
        store.use_write_ahead_log()?;
        let (registered, entered) = (store.process.take(), store.entered.take());
        drop(store);
        draft.as_file().sync_all().map_err(unwritable)?;
        if std::fs::metadata(path).is_ok_and(|file| file.len() == 0) {
            std::fs::remove_file(path).map_err(unwritable)?;
        }
        match draft.persist_noclobber(path) {
            Ok(_) => {}
            Err(error) if error.error.kind() == ErrorKind::AlreadyExists => return Ok(None),
            Err(error) => return Err(unwritable(error.error)),
        }
        let _ = std::fs::File::open(folder).and_then(|folder| folder.sync_all());
        let mut store = Self::open(path).map_err(|error| {
            if path.exists() {
                return error;
            }
            StoreError::Gone {
                path: path.to_owned(),
                what: "deleted",
            }
        })?;
        (store.process, store.entered) = (registered, entered);
        Ok(Some((store, adoption)))
    }

    /// Sets the cases of the store to those of the campaign, and registers this process, which
    /// computes them. Existing cases keep their data; cases that left the grid stay stored, without
    /// a position. Runs longer than now requested are cut, and shorter ones are continued. While
    /// this process lives, no other version of the campaign is accepted.
    ///
    /// # Errors
    /// [`StoreError::OtherCampaign`], [`StoreError::ActiveProcess`] while another process computes
    /// another version of the campaign, and I/O or SQLite errors. Nothing is changed then.
    pub fn adopt(&mut self, campaign: &Campaign) -> Result<Adoption, StoreError> {
        let entered = Entered::of(campaign);
        let (me, id) = (self.process.clone(), self.me());
        let mut last = self.read(LastRun::find(&self.connection))?;
        self.refuse_other_campaign(last.as_ref(), campaign)?;
        let conflicting =
            |connection: &Connection| ActiveProcess::conflicting(connection, id, &entered.request);
        if let Some(other) = self.read(conflicting(&self.connection))? {
            return Err(self.at_work(&entered, other));
        }
        let registered = self.write(|connection| {
            // Another process may have been faster.
            last = LastRun::find(connection)?;
            if let Some(other) = conflicting(connection)? {
                return Ok(Err(other));
            }
            if last
                .as_ref()
                .is_none_or(|last| last.differs(campaign, &entered))
            {
                enter(connection, campaign, &entered, last.is_none())?;
                settle::continue_shorter_runs(connection, campaign, &entered)?;
            }
            match me {
                Some(me) => Ok(Ok(me)),
                None => processes::enter(connection, &entered).map(Ok),
            }
        })?;
        match registered {
            Ok(registered) => self.process = Some(registered),
            Err(other) => return Err(self.at_work(&entered, other)),
        }
        let adoption = Adoption {
            changed: last.is_some_and(|last| last.entered.request != entered.request),
            inventory: self.inventory()?,
        };
        self.entered = Some(entered);
        Ok(adoption)
    }

    /// The error about a process that computes another version of the campaign.
    fn at_work(&self, entered: &Entered, other: ActiveProcess) -> StoreError {
        StoreError::ActiveProcess {
            path: self.path.clone(),
            ours: entered.file.clone().into(),
            theirs: other.file.unwrap_or_default().into(),
            pid: other.identity.pid,
            host: other.identity.host,
        }
    }

    fn refuse_other_campaign(
        &self,
        last: Option<&LastRun>,
        campaign: &Campaign,
    ) -> Result<(), StoreError> {
        match last.filter(|last| last.name != campaign.name) {
            None => Ok(()),
            Some(last) => Err(StoreError::OtherCampaign {
                path: self.path.clone(),
                found: last.name.clone(),
                wanted: campaign.name.clone(),
            }),
        }
    }

    /// Checks that the store still holds the version of the campaign entered here, which holds
    /// while this process counts as alive.
    ///
    /// # Errors
    /// [`StoreError::Displaced`] if another version was entered since, and I/O or SQLite errors.
    pub fn check_campaign(&self) -> Result<(), StoreError> {
        let Some(entered) = &self.entered else {
            return Ok(());
        };
        match self.read(entered.displaced_by(&self.connection))? {
            None => Ok(()),
            Some(theirs) => Err(StoreError::Displaced {
                path: self.path.clone(),
                ours: entered.file.clone().into(),
                theirs,
            }),
        }
    }

    /// Shows a read-only store as this version of its campaign requests it.
    fn show_as_requested(&mut self, campaign: &Campaign) -> Result<(), StoreError> {
        let last = self.last_run()?;
        self.refuse_other_campaign(Some(&last), campaign)?;
        let entered = Entered::of(campaign);
        let is_another = last.entered.request != entered.request;
        if !is_another && last.text == campaign.text {
            return Ok(());
        }
        // Copies must be complete: readers compare digests with the data shown.
        self.point_runs()?;
        let shown = schema::shadow(&self.connection)
            .and_then(|()| enter(&self.connection, campaign, &entered, false))
            .and_then(|()| settle::count_shorter_runs(&self.connection, campaign));
        self.read(shown)?;
        if is_another {
            self.last_run_with = Some(last.entered.file.into());
        }
        Ok(())
    }

    fn last_run(&self) -> Result<LastRun, StoreError> {
        self.read(LastRun::read(&self.connection))
    }

    /// What was requested of the store last: of this process, that which it entered.
    pub(super) fn entered(&self) -> Result<Entered, StoreError> {
        match &self.entered {
            Some(entered) => Ok(entered.clone()),
            None => Ok(self.last_run()?.entered),
        }
    }

    /// The protocol last run.
    ///
    /// # Errors
    /// An I/O or SQLite error, or an unreadable entry.
    pub fn protocol(&self) -> Result<Protocol, StoreError> {
        Ok(self.entered()?.protocol)
    }

    /// The name of the campaign.
    pub(crate) fn campaign_name(&self) -> Result<String, StoreError> {
        Ok(self.last_run()?.name)
    }

    /// The text of the campaign file last run.
    pub(crate) fn campaign_text(&self) -> Result<String, StoreError> {
        Ok(self.last_run()?.text)
    }

    /// What the campaign file says and its cases do not show.
    pub(crate) fn written(&self) -> Result<AsWritten, StoreError> {
        Ok(self.last_run()?.written)
    }

    /// Shows a read-only store up to one of the segments of its runs, by its number from 1, whose
    /// kept strain is averaged. The inner error is a message about a missing segment.
    fn show_segment(&mut self, number: usize) -> Result<Result<(), String>, StoreError> {
        let entered = self.last_run()?.entered;
        let protocol = match entered.protocol.clone().of_segment(number) {
            Ok(protocol) => protocol,
            Err(message) => return Ok(Err(message)),
        };
        self.point_runs()?;
        let shown = || {
            schema::shadow(&self.connection)?;
            let cut = Entered {
                protocol,
                ..entered
            };
            cut.write(&self.connection)?;
            for (point, params) in points::all(&self.connection)? {
                let steps = "UPDATE cases SET steps = ?2 WHERE point = ?1 AND position IS NOT NULL";
                let there = cut.protocol.with_time_step(params.time_step);
                self.connection.run(steps, (point, whole(there.steps())))?;
            }
            settle_request(&self.connection, &cut)
        };
        self.read(shown()).map(Ok)
    }
}

/// Sets the cases of a store to those of a campaign.
fn enter(
    connection: &Connection,
    campaign: &Campaign,
    entered: &Entered,
    is_new: bool,
) -> rusqlite::Result<()> {
    entered::put(connection, campaign, entered)?;
    enter_cases(connection, campaign)?;
    if is_new {
        schema::index(connection)?;
    }
    rules::enter(connection, campaign)?;
    settle_request(connection, entered)
}

/// Sets the states and results of all cases to those that a campaign requests.
fn settle_request(connection: &Connection, entered: &Entered) -> rusqlite::Result<()> {
    // Runs that failed beyond the strain requested now can reach that strain.
    runs::reopen(
        connection,
        "state = 'failed' AND counts AND steps <= (SELECT step FROM failures f WHERE f.case_id = cases.id ORDER BY f.id DESC LIMIT 1)",
        [],
    )?;
    settle::settle_all(connection, &entered.protocol)?;
    rules::apply_all(connection, &entered.rules)
}

/// Writes new cases, and updates the position of known ones.
fn enter_cases(connection: &Connection, campaign: &Campaign) -> rusqlite::Result<()> {
    connection.execute(
        "UPDATE cases SET position = NULL, counts = 0 WHERE position IS NOT NULL",
        [],
    )?;
    let cases = campaign.cases.iter();
    let costs: Vec<f64> = cases.map(|(_, case)| case.cost()).collect();
    let ranks = order::ranks(campaign, &costs);
    let mut known = Points::default();
    let cases = campaign.cases.iter();
    let points = cases.map(|(_, case)| known.id(connection, &case.params));
    let points = points.collect::<Result<Vec<i64>, _>>()?;
    let now = process::now();
    let turn = runs::turn("steps_done").replace("turn", "excluded.turn");
    let mut insert = connection.prepare(&format!(
        "INSERT INTO cases (key, point, seed, steps, sample_stride, position, counts, turn,
             cost, changed_at)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, 1, ?7, ?8, ?9)
         ON CONFLICT (key) DO UPDATE SET position = excluded.position, counts = 1,
         cost = excluded.cost,
             steps = excluded.steps, turn = {turn}"
    ))?;
    // In the order of work, so that cases computed in sequence, and their results, are adjacent
    // in the file.
    let mut order: Vec<usize> = (0..ranks.len()).collect();
    order.sort_by_key(|position| ranks[*position]);
    for position in order {
        let (key, case) = &campaign.cases[position];
        insert.execute(params![
            key.to_string(),
            points[position],
            case.seed,
            case.steps,
            case.sample_stride,
            position,
            runs::plain_turn(ranks[position]),
            costs[position],
            now,
        ])?;
    }
    Ok(())
}

/// Approximate bytes of a run in the store without its samples and its last state: those of 42 runs
/// of `sweeps/mu-of-j-loose.toml`.
pub(crate) const CASE_BYTES: u32 = 2400;
/// Approximate bytes of a sample, index included: those of the same runs.
pub(crate) const SAMPLE_BYTES: u32 = 600;

/// Runs of a campaign file in its store.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Inventory {
    /// Runs that the file requests.
    pub runs: u64,
    /// Of these, runs that have ended: done, jammed or failed.
    pub ended: u64,
    /// Runs to be continued: started ones, or ones finished at a shorter strain.
    pub begun: u64,
    /// Runs without any stored data.
    pub new: u64,
    /// Runs in the store that the file does not request.
    pub orphans: u64,
    /// Their approximate size in bytes.
    pub orphan_bytes: f64,
}

impl Inventory {
    /// Summary of the runs of the file.
    pub fn words(&self) -> String {
        format!(
            "{} new runs, {} reused, {} extended",
            self.new, self.ended, self.begun
        )
    }
}

/// Effect of entering a campaign file into a store.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adoption {
    /// Whether the store held another version of the campaign before.
    pub changed: bool,
    /// The present contents.
    pub inventory: Inventory,
}

impl Store {
    /// Counts the runs in the store that the campaign requests, and the others.
    pub(crate) fn inventory(&self) -> Result<Inventory, StoreError> {
        let inventory = || {
            let number = |which: &str| format!("count(*) FILTER (WHERE {which})");
            let ended = number("counts AND state IN ('done', 'jammed', 'failed')");
            let begun = number("counts AND state IN ('pending', 'running') AND steps_done > 0");
            let (runs, orphans) = (number("counts"), number(ORPHANED));
            let query = format!(
                "SELECT {runs} AS runs, {ended} AS ended, {begun} AS begun, 0 AS new,
                     {orphans} AS orphans, 0.0 AS orphan_bytes FROM cases c"
            );
            let found: Option<Inventory> = self.connection.first(&query, [])?;
            let mut inventory = found.unwrap_or_default();
            inventory.new = inventory.runs - inventory.ended - inventory.begun;
            if inventory.orphans > 0 {
                let bytes = format!(
                    "SELECT total({CASE_BYTES} + {SAMPLE_BYTES} * (SELECT count(*)
                         FROM samples WHERE case_id = c.id)
                         + coalesce((SELECT sum(length(data)) FROM frames WHERE case_id = c.id), 0)
                         + coalesce((SELECT sum(length(data)) FROM checkpoints
                         WHERE case_id = c.id), 0))
                     FROM cases c WHERE {ORPHANED}"
                );
                inventory.orphan_bytes = self.connection.one(&bytes, [], |row| row.get(0))?;
            }
            Ok(inventory)
        };
        self.read(inventory())
    }

    /// Number of runs in the store that are not requested.
    pub(crate) fn orphans(&self) -> Result<u64, StoreError> {
        let query = format!("SELECT count(*) FROM cases c WHERE {ORPHANED}");
        self.number(&query, [])
    }

    /// The file last run on this store, if it was another version than the one shown.
    pub fn last_run_with(&self) -> Option<&Path> {
        self.last_run_with.as_deref()
    }
}

/// Condition on a case with data that is not in the campaign.
pub(super) const ORPHANED: &str = "(NOT c.counts AND (c.state != 'pending' OR c.steps_done > 0
     OR EXISTS (SELECT 1 FROM results WHERE case_id = c.id)))";

impl Store {
    /// Removes all runs that are not in the grid, with their data, and frees their disk space.
    /// Returns the number of those with data.
    pub(crate) fn prune(&mut self) -> Result<u64, StoreError> {
        let removed = self.write(|connection| {
            let removed = format!("SELECT count(*) FROM cases c WHERE {ORPHANED}");
            let removed = connection.one(&removed, [], |row| row.get(0))?;
            let orphans = "SELECT id FROM cases WHERE NOT counts AND state != 'running'";
            for table in OF_CASES.iter().chain(&["slices"]) {
                connection.execute(
                    &format!("DELETE FROM {table} WHERE case_id IN ({orphans})"),
                    [],
                )?;
            }
            // Seeds that a precision may still need stay.
            connection.execute(
                "UPDATE cases SET state = 'pending', steps_done = 0, attempts = 0, deaths = 0,
                     samples_digest = NULL, frames_from = NULL, frames_until = NULL,
                     digest = NULL
                 WHERE NOT counts AND state != 'running'",
                [],
            )?;
            connection.execute(
                "DELETE FROM cases WHERE position IS NULL AND state != 'running'",
                [],
            )?;
            connection.execute(
                "DELETE FROM points WHERE id NOT IN (SELECT point FROM cases)",
                [],
            )?;
            Ok(removed)
        })?;
        self.read(
            self.connection
                .execute_batch("VACUUM; PRAGMA wal_checkpoint(RESTART)"),
        )?;
        Ok(removed)
    }
}

/// A store, and the campaign file by which it is shown, if any.
#[derive(Debug, Clone)]
pub struct StoreSource {
    path: PathBuf,
    campaign: Option<Campaign>,
}

impl StoreSource {
    /// The store at this path, made absolute; with a campaign file, its present request. Without
    /// one the store is shown as last run.
    pub fn new(path: PathBuf, campaign: Option<Campaign>) -> Self {
        Self { path, campaign }
    }

    /// The store.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The campaign file.
    pub fn campaign(&self) -> Option<&Campaign> {
        self.campaign.as_ref()
    }

    /// Opens it for reading, and shows the runs that the campaign file requests, done or not,
    /// regardless of the version last run.
    ///
    /// # Errors
    /// As [`Store::open_read_only`], and [`StoreError::OtherCampaign`].
    pub fn open(&self) -> Result<Store, StoreError> {
        let mut store = Store::open_read_only(&self.path)?;
        if let Some(campaign) = &self.campaign {
            store.show_as_requested(campaign)?;
        }
        Ok(store)
    }

    /// Opens it for reading, and shows the runs up to one of their segments, by its number from 1,
    /// whose kept strain is averaged.
    ///
    /// # Errors
    /// As [`StoreSource::open`]; the inner error is a message about a missing segment.
    pub fn open_segment(&self, number: usize) -> Result<Result<Store, String>, StoreError> {
        let mut store = self.open()?;
        Ok(store.show_segment(number)?.map(|()| store))
    }
}
