//! Entering a campaign file into its store.

use super::check::OF_CASES;
use super::database::Statements;
use super::digest::{DigestMismatch, Sealed};
use super::workers::ActiveProcess;
use super::{Store, StoreError, database, rules, runs, schema, settle, workers};
use crate::model::campaign::{Campaign, PointRule, Written};
use crate::model::case::Case;
use crate::model::order;
use crate::model::precision::Precision;
use crate::model::protocol::{Discard, Protocol};
use crate::system::files::{folder_of, temporary_file};
use crate::system::process;
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params};
use sd_core::Params;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The campaign.
pub(super) const SEALED: Sealed = Sealed {
    table: "campaign",
    columns: "name, text, entered, written",
    with_key: false,
    words: "the campaign",
};
/// The parameters of points.
pub(super) const POINTS: Sealed = Sealed {
    table: "points",
    columns: "params, axes",
    with_key: false,
    words: "the parameters of a point",
};

/// What a version of a campaign file requests of its runs, as a store keeps it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Entered {
    pub(super) protocol: Protocol,
    /// The precisions requested at points, by the numbers that their cases have.
    pub(super) rules: Vec<Precision>,
    /// Equal exactly for versions that request the same, in any order and wording.
    pub(super) request: String,
    /// Number and sum of the keys of the runs.
    pub(super) grid: String,
    pub(super) file: String,
}

impl Entered {
    pub(super) fn of(campaign: &Campaign) -> Self {
        let grid = grid(campaign.cases.iter().map(|(key, _)| key.number()));
        let mut hasher = blake3::Hasher::new();
        hasher.update(&campaign.protocol.strain.to_bits().to_le_bytes());
        match campaign.protocol.discard {
            Discard::Strain(strain) => hasher.update(&strain.to_bits().to_le_bytes()),
            Discard::Auto => hasher.update(b"auto"),
        };
        hasher.update(grid.as_bytes());
        for rule in &campaign.rules {
            let first = campaign.cases[rule.cases.start].0;
            hasher.update(format!("{first} {:?}", rule.precision).as_bytes());
        }
        Self {
            protocol: campaign.protocol.clone(),
            rules: campaign.rules.iter().map(|rule| rule.precision).collect(),
            request: hasher.finalize().to_hex()[..32].to_owned(),
            grid,
            file: campaign.file.to_string_lossy().into_owned(),
        }
    }

    /// That of a store.
    ///
    /// # Errors
    /// [`DigestMismatch`] where the campaign was changed, or there is none.
    pub(super) fn read(connection: &Connection) -> rusqlite::Result<Self> {
        let found = SEALED.all(connection, "true", [], |row| document(row, 2))?;
        found.into_iter().next().ok_or_else(no_campaign)
    }

    /// Replaces that of a store.
    pub(super) fn write(&self, connection: &Connection) -> rusqlite::Result<()> {
        connection.execute("UPDATE campaign SET entered = ?1", [json(self)?])?;
        SEALED.seal(connection, "true", [])
    }

    /// The file whose version of the campaign a store now holds, if its request differs.
    fn displaced_by(&self, connection: &Connection) -> rusqlite::Result<Option<PathBuf>> {
        let found = connection.find("SELECT entered FROM campaign", [], |row| document(row, 0))?;
        Ok(found
            .filter(|found: &Self| found.request != self.request)
            .map(|found| found.file.into()))
    }
}

/// Number and sum of some keys, independent of their order.
pub(super) fn grid(keys: impl Iterator<Item = u128>) -> String {
    let (number, sum) = keys.fold((0_u64, 0_u128), |(number, sum), key| {
        (number + 1, sum.wrapping_add(key))
    });
    format!("{number} {sum:032x}")
}

/// The JSON of a column of the campaign.
fn document<T: DeserializeOwned>(row: &Row<'_>, column: usize) -> rusqlite::Result<T> {
    let text = row.get_ref(column)?.as_str()?;
    serde_json::from_str(text).map_err(|error| DigestMismatch::error(error.to_string()))
}

/// As JSON.
fn json(value: &impl Serialize) -> rusqlite::Result<Value> {
    let text = serde_json::to_string(value);
    text.map(Value::Text)
        .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))
}

fn no_campaign() -> rusqlite::Error {
    DigestMismatch::error("it holds no campaign")
}

impl Store {
    /// Opens the store of a campaign, creates it if missing, and enters the campaign: see
    /// [`Store::adopt`]. A new store appears at its path with all its cases, or not at all.
    ///
    /// # Errors
    /// Those of [`Store::open`] and [`Store::adopt`].
    pub fn enter(path: &Path, campaign: &Campaign) -> Result<(Self, Adoption), StoreError> {
        if database::is_free(path)
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
        if database::has_log(path) && database::is_free(path) {
            let _ = std::fs::remove_file(database::log_of(path));
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
        let entry = Entry::of(campaign);
        let request = &entry.entered.request;
        let me = self.process.clone();
        let id = self.me();
        let mut last = self.read(LastRun::of(&self.connection))?;
        if last.as_ref().is_some_and(|last| last.name != campaign.name) {
            return Err(self.other_campaign(last, campaign));
        }
        let conflicting =
            |connection: &Connection| ActiveProcess::conflicting(connection, id, request);
        if let Some(other) = self.read(conflicting(&self.connection))? {
            return Err(self.at_work(&entry.entered, other));
        }
        let entered = self.write(|connection| {
            // Another process may have been faster.
            last = LastRun::of(connection)?;
            if let Some(other) = conflicting(connection)? {
                return Ok(Err(other));
            }
            if last.as_ref().is_none_or(|last| entry.differs(last)) {
                entry.enter(connection, last.is_none())?;
                settle::continue_shorter_runs(connection, campaign, &entry.entered)?;
            }
            match me {
                Some(me) => Ok(Ok(me)),
                None => workers::enter(connection, &entry.entered).map(Ok),
            }
        })?;
        match entered {
            Ok(registered) => self.process = Some(registered),
            Err(other) => return Err(self.at_work(&entry.entered, other)),
        }
        let adoption = Adoption {
            changed: last.is_some_and(|last| last.entered.request != *request),
            inventory: self.inventory()?,
        };
        self.entered = Some(entry.entered);
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

    fn other_campaign(&self, found: Option<LastRun>, campaign: &Campaign) -> StoreError {
        StoreError::OtherCampaign {
            path: self.path.clone(),
            found: found.map(|found| found.name).unwrap_or_default(),
            wanted: campaign.name.clone(),
        }
    }

    /// Shows a read-only store as this version of its campaign requests it.
    pub(super) fn show_as_requested(&mut self, campaign: &Campaign) -> Result<(), StoreError> {
        let Some(last) = self.read(LastRun::of(&self.connection))? else {
            return self.read(Err(no_campaign()));
        };
        if last.name != campaign.name {
            return Err(self.other_campaign(Some(last), campaign));
        }
        let entry = Entry::of(campaign);
        let is_another = last.entered.request != entry.entered.request;
        if !is_another && last.text == campaign.text {
            return Ok(());
        }
        // Copies must be complete: readers compare digests with the data shown.
        self.point_runs()?;
        let shown = schema::shadow(&self.connection)
            .and_then(|()| entry.enter(&self.connection, false))
            .and_then(|()| settle::count_shorter_runs(&self.connection, campaign));
        self.read(shown)?;
        if is_another {
            self.last_run_with = Some(last.entered.file.into());
        }
        Ok(())
    }

    /// What was requested of the store last: of this process, that which it entered.
    pub(super) fn entered(&self) -> Result<Entered, StoreError> {
        match &self.entered {
            Some(entered) => Ok(entered.clone()),
            None => self.read(Entered::read(&self.connection)),
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
        self.of_campaign(|row| row.get(0))
    }

    /// What the campaign file says and its cases do not show.
    pub(crate) fn written(&self) -> Result<Written, StoreError> {
        self.of_campaign(|row| document(row, 3))
    }

    /// The campaign last run.
    pub(super) fn campaign(&self) -> Result<Campaign, StoreError> {
        self.point_runs()?;
        let cases: Vec<(Option<usize>, Case)> = self.rows(
            "SELECT c.rule, p.params, c.seed, c.steps, c.sample_stride FROM cases c JOIN points p ON p.id = c.point
             WHERE c.position IS NOT NULL ORDER BY c.position",
            [],
            |row| {
                let case = Case {
                    params: schema::params(row, 1)?,
                    seed: row.get(2)?,
                    steps: row.get(3)?,
                    sample_stride: row.get(4)?,
                };
                Ok((row.get(0)?, case))
            },
        )?;
        let entered = self.entered()?;
        let rules = entered.rules.into_iter().enumerate();
        let rules = rules.filter_map(|(number, precision)| {
            let is_ruled = |case: &(Option<usize>, Case)| case.0 == Some(number);
            let start = cases.iter().position(is_ruled)?;
            let end = cases.iter().rposition(is_ruled)? + 1;
            Some(PointRule {
                precision,
                cases: start..end,
            })
        });
        let rules = rules.collect();
        let cases = cases.into_iter().map(|(_, case)| (case.key(), case));
        Ok(Campaign {
            name: self.campaign_name()?,
            file: entered.file.into(),
            text: self.campaign_text()?,
            protocol: entered.protocol,
            cases: cases.collect(),
            rules,
            folded: 0,
            written: self.written()?,
            start_files: Vec::new(),
        })
    }

    /// The text of the campaign file last run.
    pub(crate) fn campaign_text(&self) -> Result<String, StoreError> {
        self.of_campaign(|row| row.get(1))
    }

    /// Something of the campaign.
    fn of_campaign<T>(
        &self,
        read: impl FnMut(&Row<'_>) -> rusqlite::Result<T>,
    ) -> Result<T, StoreError> {
        let found = self
            .read(SEALED.all(&self.connection, "true", [], read))?
            .pop();
        found.map_or_else(|| self.read(Err(no_campaign())), Ok)
    }
}

/// The version of the campaign last run with a store.
struct LastRun {
    name: String,
    text: String,
    entered: Entered,
}

impl LastRun {
    /// `None` in a new store; a damaged entry is rewritten.
    fn of(connection: &Connection) -> rusqlite::Result<Option<Self>> {
        let read = |row: &Row<'_>| {
            Ok(Self {
                name: row.get(0)?,
                text: row.get(1)?,
                entered: document(row, 2)?,
            })
        };
        match SEALED.all(connection, "true", [], read) {
            Err(error) if DigestMismatch::in_error(&error).is_some() => Ok(None),
            last => Ok(last?.pop()),
        }
    }
}

/// A version of a campaign to enter into a store.
struct Entry<'c> {
    campaign: &'c Campaign,
    entered: Entered,
}

impl<'c> Entry<'c> {
    fn of(campaign: &'c Campaign) -> Self {
        Self {
            entered: Entered::of(campaign),
            campaign,
        }
    }

    /// Whether anything must be written: not for the same text in another place.
    fn differs(&self, last: &LastRun) -> bool {
        let file = last.entered.file.clone();
        let here = Entered {
            file,
            ..self.entered.clone()
        };
        last.text != self.campaign.text || last.entered != here
    }

    /// Sets the cases of a store to those of the campaign.
    fn enter(&self, connection: &Connection, is_new: bool) -> rusqlite::Result<()> {
        let row = [
            self.campaign.name.clone().into(),
            self.campaign.text.clone().into(),
            json(&self.entered)?,
            json(&self.campaign.written)?,
        ];
        SEALED.put(connection, None, &row, &[("id", 1.into())])?;
        self.enter_cases(connection)?;
        if is_new {
            schema::index(connection)?;
        }
        rules::enter(connection, self.campaign)?;
        // Runs that failed beyond the strain requested now can reach that strain.
        runs::reopen(
            connection,
            "state = 'failed' AND counts AND steps <= (SELECT step FROM failures f WHERE f.case_id = cases.id ORDER BY f.id DESC LIMIT 1)",
            [],
        )?;
        settle::settle_all(connection, &self.entered)?;
        rules::apply_all(connection, &self.entered.rules)
    }

    /// Writes new cases, and updates the position of known ones.
    fn enter_cases(&self, connection: &Connection) -> rusqlite::Result<()> {
        connection.execute(
            "UPDATE cases SET position = NULL, counts = 0 WHERE position IS NOT NULL",
            [],
        )?;
        let cases = self.campaign.cases.iter();
        let costs: Vec<f64> = cases.map(|(_, case)| case.cost()).collect();
        let ranks = order::ranks(self.campaign, &costs);
        let mut known = Points::default();
        let points = self
            .campaign
            .cases
            .iter()
            .map(|(_, case)| known.place(connection, &case.params))
            .collect::<Result<Vec<i64>, _>>()?;
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
            let (key, case) = &self.campaign.cases[position];
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
}

/// Numbers of points by their digests.
#[derive(Default)]
pub(super) struct Points {
    known: HashMap<i64, i64>,
    /// The last one seen: cases of a point are consecutive in the file.
    last: Option<(Params, i64)>,
}

impl Points {
    /// The number of the point of some parameters, which is entered if missing.
    pub(super) fn place(
        &mut self,
        connection: &Connection,
        params: &Params,
    ) -> rusqlite::Result<i64> {
        if let Some((_, place)) = self.last.as_ref().filter(|(last, _)| last == params) {
            return Ok(*place);
        }
        let text = serde_json::to_string(params)
            .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))?;
        let point = [text.into(), schema::axes_of(params).into()];
        let digest = POINTS.digest_of(&point);
        let place = match self.known.get(&digest) {
            Some(place) => *place,
            None => match connection.value("SELECT id FROM points WHERE digest = ?1", [digest])? {
                Some(place) => place,
                None => POINTS.put(connection, None, &point, &[])?,
            },
        };
        self.known.insert(digest, place);
        self.last = Some((params.clone(), place));
        Ok(place)
    }
}

/// Approximate bytes of a run in the store without its samples; measured.
pub(crate) const CASE_BYTES: u32 = 1200;
/// Approximate bytes of a sample, index included; measured.
pub(crate) const SAMPLE_BYTES: u32 = 145;

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
            for table in OF_CASES.iter().chain(&["slices", "disagreements"]) {
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
