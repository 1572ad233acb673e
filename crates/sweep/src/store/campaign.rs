//! Entering a campaign file into its store.

use super::digest::{self, DigestMismatch, Sealed};
use super::inventory::Adoption;
use super::place;
use super::processes::{self, ActiveProcess};
use super::request::Request;
use super::schema;
use super::statements::Statements;
use super::{Store, StoreError, rules, settle, states};
use crate::model::campaign::{Campaign, PointRule, Written};
use crate::model::case::Case;
use crate::model::order;
use crate::model::protocol::Protocol;
use crate::system::files::{folder_of, temporary_file};
use crate::system::process;
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params};
use sd_core::Params;
use std::collections::HashMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The campaign.
pub(super) const SEALED: Sealed = Sealed {
    table: "campaign",
    columns: "name, text, protocol, file, request, grid, written",
    with_key: false,
    words: "the campaign",
};

impl Store {
    /// Opens the store of a campaign, creates it if missing, and enters the campaign: see
    /// [`Store::adopt`]. A new store appears at its path with all its cases, or not at all.
    ///
    /// # Errors
    /// Those of [`Store::open`] and [`Store::adopt`].
    pub fn enter(path: &Path, campaign: &Campaign) -> Result<(Self, Adoption), StoreError> {
        if place::is_free(path)
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
        if place::has_log(path) && place::is_free(path) {
            let _ = std::fs::remove_file(place::log_of(path));
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
        let (registered, request) = (store.process.take(), store.request.take());
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
        let mut store = Self::open(path).map_err(|error| match error {
            StoreError::Missing { path } => StoreError::Gone {
                path,
                what: "deleted",
            },
            other => other,
        })?;
        (store.process, store.request) = (registered, request);
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
        let entry = Entry::of(campaign, &self.path)?;
        let me = self.process.clone();
        let id = self.me();
        let mut last = self.read(LastRun::of(&self.connection))?;
        if last.as_ref().is_some_and(|last| last.name != campaign.name) {
            return Err(self.other_campaign(last, campaign));
        }
        let conflicting = |connection: &Connection| {
            ActiveProcess::conflicting(connection, id, &entry.request.hash)
        };
        if let Some(other) = self.read(conflicting(&self.connection))? {
            return Err(self.at_work(&entry.request, other));
        }
        let entered = self.write(|connection| {
            // Another process may have been faster.
            last = LastRun::of(connection)?;
            if let Some(other) = conflicting(connection)? {
                return Ok(Err(other));
            }
            if last.as_ref().is_none_or(|last| entry.differs(last)) {
                entry.enter(connection, last.is_none())?;
                settle::continue_shorter_runs(connection, campaign)?;
            }
            match me {
                Some(me) => Ok(Ok(me)),
                None => processes::enter(connection, &entry.request).map(Ok),
            }
        })?;
        match entered {
            Ok(registered) => self.process = Some(registered),
            Err(other) => return Err(self.at_work(&entry.request, other)),
        }
        let adoption = Adoption {
            changed: last.is_some_and(|last| last.request != entry.request.hash),
            inventory: self.inventory()?,
        };
        self.request = Some(entry.request);
        Ok(adoption)
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
        let request = Request::of(campaign);
        if last.request == request.hash && last.text == campaign.text {
            return Ok(());
        }
        let entry = Entry::of(campaign, &self.path)?;
        // Copies must be complete: readers compare digests with the data shown.
        self.point_runs()?;
        let shown = schema::shadow(&self.connection)
            .and_then(|()| entry.enter(&self.connection, false))
            .and_then(|()| settle::count_shorter_runs(&self.connection, campaign));
        self.read(shown)?;
        if last.request != request.hash {
            self.last_run_with = Some(last.file.into());
        }
        Ok(())
    }

    /// The protocol last run.
    ///
    /// # Errors
    /// An I/O or SQLite error, or an unreadable entry.
    pub fn protocol(&self) -> Result<Protocol, StoreError> {
        let text = self.of_campaign(2)?;
        self.json(serde_json::from_str(&text))
    }

    /// The name of the campaign.
    pub(crate) fn campaign_name(&self) -> Result<String, StoreError> {
        self.of_campaign(0)
    }

    /// What the campaign file says and its cases do not show.
    pub(crate) fn written(&self) -> Result<Written, StoreError> {
        let text = self.of_campaign(6)?;
        self.json(serde_json::from_str(&text))
    }

    /// The campaign last run.
    pub(super) fn campaign(&self) -> Result<Campaign, StoreError> {
        self.point_runs()?;
        let cases: Vec<(Option<i64>, Case)> = self.rows(
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
        let rules = self.read(rules::all(&self.connection))?;
        let rules = rules.into_iter().filter_map(|(number, precision)| {
            let is_ruled = |case: &(Option<i64>, Case)| case.0 == Some(number);
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
            file: PathBuf::from(self.of_campaign(3)?),
            text: self.campaign_text()?,
            protocol: self.protocol()?,
            cases: cases.collect(),
            rules,
            folded: 0,
            written: self.written()?,
        })
    }

    /// The text of the campaign file last run.
    pub(crate) fn campaign_text(&self) -> Result<String, StoreError> {
        self.of_campaign(1)
    }

    /// One text of the campaign.
    fn of_campaign(&self, column: usize) -> Result<String, StoreError> {
        let texts = SEALED.all(&self.connection, "true", [], |row| row.get(column));
        let text = self.read(texts)?.pop();
        text.map_or_else(|| self.read(Err(no_campaign())), Ok)
    }
}

fn no_campaign() -> rusqlite::Error {
    DigestMismatch::error("it holds no campaign")
}

/// The version of the campaign last run with a store.
struct LastRun {
    name: String,
    text: String,
    protocol: String,
    file: String,
    request: String,
}

impl LastRun {
    /// `None` in a new store; a damaged entry is rewritten.
    fn of(connection: &Connection) -> rusqlite::Result<Option<Self>> {
        let read = |row: &Row<'_>| {
            Ok(Self {
                name: row.get(0)?,
                text: row.get(1)?,
                protocol: row.get(2)?,
                file: row.get(3)?,
                request: row.get(4)?,
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
    request: Request,
    protocol: String,
    written: String,
}

impl<'c> Entry<'c> {
    fn of(campaign: &'c Campaign, path: &Path) -> Result<Self, StoreError> {
        let protocol = serde_json::to_string(&campaign.protocol)
            .map_err(|error| StoreError::unreadable(path, &error))?;
        let written = serde_json::to_string(&campaign.written)
            .map_err(|error| StoreError::unreadable(path, &error))?;
        Ok(Self {
            written,
            campaign,
            request: Request::of(campaign),
            protocol,
        })
    }

    /// Whether anything must be written.
    fn differs(&self, last: &LastRun) -> bool {
        last.text != self.campaign.text
            || last.protocol != self.protocol
            || last.request != self.request.hash
    }

    /// Sets the cases of a store to those of the campaign.
    fn enter(&self, connection: &Connection, is_new: bool) -> rusqlite::Result<()> {
        let text = |text: &str| Value::Text(text.to_owned());
        let row = [
            text(&self.campaign.name),
            text(&self.campaign.text),
            text(&self.protocol),
            text(&self.request.file.to_string_lossy()),
            text(&self.request.hash),
            text(&self.request.grid),
            text(&self.written),
        ];
        let more = [
            ("id", Value::Integer(1)),
            ("priority", Value::Text(String::new())),
        ];
        SEALED.put(connection, None, &row, &more)?;
        self.enter_cases(connection)?;
        if is_new {
            schema::index(connection)?;
        }
        rules::enter(connection, self.campaign)?;
        // Runs that failed beyond the strain requested now can reach that strain.
        states::reopen(
            connection,
            "state = 'failed' AND counts AND steps <= (SELECT step FROM failures f WHERE f.case_id = cases.id ORDER BY f.id DESC LIMIT 1)",
            &[],
        )?;
        settle::settle_all(connection, &self.campaign.protocol)?;
        rules::apply_all(connection)
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
        let turn = states::turn("steps_done").replace("turn", "excluded.turn");
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
                states::plain_turn(ranks[position]),
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
        let digest = digest::of(&[Value::Text(text.clone())]);
        let place = match self.known.get(&digest) {
            Some(place) => *place,
            None => number_of(connection, (text, digest), params)?,
        };
        self.known.insert(digest, place);
        self.last = Some((params.clone(), place));
        Ok(place)
    }
}

/// The number of a point by its text and digest, which is entered if missing.
fn number_of(
    connection: &Connection,
    (text, digest): (String, i64),
    params: &Params,
) -> rusqlite::Result<i64> {
    let known = "SELECT id FROM points WHERE digest = ?1";
    let axes = schema::axes_of(params);
    if let Some(place) = connection.value(known, [digest])? {
        let update = "UPDATE points SET axes = ?2 WHERE id = ?1 AND axes != ?2";
        connection.run(update, (place, axes))?;
        return Ok(place);
    }
    connection.run(
        "INSERT INTO points (params, axes, digest) VALUES (?1, ?2, ?3)",
        (text, axes, digest),
    )?;
    Ok(connection.last_insert_rowid())
}
