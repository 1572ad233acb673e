//! Taking a campaign file into its store.

use super::asked::{self, Adoption, Asks};
use super::checksum::{self, Kind};
use super::{Store, StoreError, axis_columns, ends, integer, process, results};
use crate::axes::AXES;
use crate::campaign::{Campaign, Protocol};
use crate::case::{Case, CaseKey};
use rusqlite::{Connection, OptionalExtension, params, params_from_iter, types};
use std::cmp::Reverse;
use std::path::PathBuf;

impl Store {
    /// Makes the cases of the store those of the campaign, and says what that means. Cases already there keep all they have;
    /// cases that left the grid stay stored, without a position. Runs that were computed farther than is asked now are cut,
    /// and those that were not computed as far go on.
    ///
    /// # Errors
    /// [`StoreError::OtherCampaign`], [`StoreError::AtWork`] while another process computes what another version of the
    /// campaign asks for, and trouble with the file. Nothing is changed then.
    pub fn adopt(&mut self, campaign: &Campaign) -> Result<Adoption, StoreError> {
        let entry = Entry::of(self, campaign)?;
        let me = self.me();
        if entry.differs {
            let refused = self.write(|transaction| {
                let opponent = entry.asks.opponent(transaction, me)?;
                if opponent.is_none() {
                    entry.enter(transaction)?;
                }
                Ok(opponent)
            })?;
            if let Some(opponent) = refused {
                return Err(self.at_work(&entry.asks, opponent));
            }
        }
        let adoption = Adoption {
            changed: entry.other_version.is_some(),
            inventory: self.read(asked::inventory(&self.connection))?,
        };
        self.asks = Some(entry.asks);
        Ok(adoption)
    }

    /// Lets a store that is only read be seen as this version of its campaign asks for it.
    pub(super) fn show_as_asked(&mut self, campaign: &Campaign) -> Result<(), StoreError> {
        let entry = Entry::of(self, campaign)?;
        if !entry.differs {
            return Ok(());
        }
        let shown = super::schema::put_before(
            &self.connection,
            &["campaign", "cases", "results", "checksums"],
        )
        .and_then(|()| entry.enter(&self.connection));
        self.read(shown)?;
        self.last_run_with = entry.other_version;
        Ok(())
    }

    /// The protocol last run.
    ///
    /// # Errors
    /// Trouble with the file, or an entry that cannot be read.
    pub fn protocol(&self) -> Result<Protocol, StoreError> {
        let text = self.of_campaign("SELECT protocol FROM campaign")?;
        self.json("campaign", serde_json::from_str(&text))
    }

    /// The name of the campaign.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn campaign_name(&self) -> Result<String, StoreError> {
        self.of_campaign("SELECT name FROM campaign")
    }

    /// Turns an error of JSON into one of the store.
    pub(super) fn json<T>(
        &self,
        table: &'static str,
        result: Result<T, serde_json::Error>,
    ) -> Result<T, StoreError> {
        result.map_err(|error| StoreError::Entry {
            path: self.path.clone(),
            table,
            reason: error.to_string(),
        })
    }
}

/// A version of a campaign that is taken into a store.
struct Entry<'c> {
    campaign: &'c Campaign,
    asks: Asks,
    protocol: String,
    rows: Vec<Row<'c>>,
    /// Whether there is anything to write: the store holds another text, or none.
    differs: bool,
    /// The file last run, if that asked for something else.
    other_version: Option<PathBuf>,
}

/// The campaign as a store was last run with it.
struct LastRun {
    name: String,
    text: String,
    protocol: String,
    /// What it asked for, as [`Asks::hash`] has it; empty in a store of schema 4 or before.
    asks: String,
    file: String,
}

impl<'c> Entry<'c> {
    /// Of a campaign into its own store.
    fn of(store: &Store, campaign: &'c Campaign) -> Result<Self, StoreError> {
        let last = store.read(
            store
                .connection
                .query_row(
                    "SELECT name, text, protocol, asks, file FROM campaign",
                    [],
                    |row| {
                        Ok(LastRun {
                            name: row.get(0)?,
                            text: row.get(1)?,
                            protocol: row.get(2)?,
                            asks: row.get(3)?,
                            file: row.get(4)?,
                        })
                    },
                )
                .optional(),
        )?;
        let protocol = store.json("campaign", serde_json::to_string(&campaign.protocol))?;
        let asks = Asks::of(campaign);
        let (mut differs, mut other_version) = (true, None);
        if let Some(last) = last {
            if last.name != campaign.name {
                return Err(StoreError::OtherCampaign {
                    path: store.path.clone(),
                    found: last.name,
                    wanted: campaign.name.clone(),
                });
            }
            let same_text = last.text == campaign.text && last.protocol == protocol;
            differs = !same_text || last.asks != asks.hash;
            // A store of schema 4 or before does not say what was asked for.
            let same_wishes = last.asks == asks.hash || (last.asks.is_empty() && same_text);
            other_version = (!same_wishes).then(|| last.file.into());
        }
        let rows = if differs {
            rows(campaign)
                .map(|row| store.json("cases", row))
                .collect::<Result<_, _>>()?
        } else {
            Vec::new()
        };
        Ok(Self {
            campaign,
            asks,
            protocol,
            rows,
            differs,
            other_version,
        })
    }

    /// Makes the cases of a store those of the campaign.
    fn enter(&self, connection: &Connection) -> Result<(), rusqlite::Error> {
        connection.execute(
            "INSERT INTO campaign (id, name, text, protocol, file, asks) VALUES (1, ?1, ?2, ?3, ?4, ?5)
             ON CONFLICT (id) DO UPDATE SET text = excluded.text, protocol = excluded.protocol, file = excluded.file,
                 asks = excluded.asks",
            params![
                self.campaign.name,
                self.campaign.text,
                self.protocol,
                self.asks.file.to_string_lossy(),
                self.asks.hash
            ],
        )?;
        connection.execute("UPDATE cases SET position = NULL", [])?;
        for row in &self.rows {
            row.insert(connection)?;
        }
        checksum::seal(connection, Kind::Campaign, 1)?;
        // What failed beyond the strain that is asked for now may well get as far as that.
        results::reopen_failed(
            connection,
            "position IS NOT NULL AND steps <=
                 (SELECT step FROM failures f WHERE f.case_id = cases.id ORDER BY f.id DESC LIMIT 1)",
        )?;
        ends::settle_all(connection, &self.campaign.protocol)
    }
}

/// A case as it is written to the store.
struct Row<'c> {
    key: CaseKey,
    case: &'c Case,
    position: usize,
    /// Place in the order of work.
    rank: usize,
    params: String,
}

/// All cases of a campaign with their order of work: dear runs first, so that no core idles at the end, then the first
/// seed of every point before the second of any, so that curves fill in early.
fn rows(campaign: &Campaign) -> impl Iterator<Item = Result<Row<'_>, serde_json::Error>> {
    let mut order: Vec<(Reverse<u64>, u64, usize)> = Vec::with_capacity(campaign.cases.len());
    let mut seed_number = 0;
    for (position, (_, case)) in campaign.cases.iter().enumerate() {
        let same_point = position
            .checked_sub(1)
            .is_some_and(|before| campaign.cases[before].1.params == case.params);
        seed_number = if same_point { seed_number + 1 } else { 0 };
        // Bits of a positive float are in the order of its value.
        order.push((Reverse(case.cost().to_bits()), seed_number, position));
    }
    order.sort_unstable();
    let mut ranks = vec![0; order.len()];
    for (rank, (.., position)) in order.into_iter().enumerate() {
        ranks[position] = rank;
    }
    campaign
        .cases
        .iter()
        .zip(ranks)
        .enumerate()
        .map(|(position, ((key, case), rank))| {
            Ok(Row {
                key: *key,
                case,
                position,
                rank,
                params: serde_json::to_string(&case.params)?,
            })
        })
}

impl Row<'_> {
    /// Writes a new case, or gives a known one its place in the file.
    fn insert(&self, connection: &Connection) -> Result<(), rusqlite::Error> {
        let text = |text: String| types::Value::Text(text);
        let whole = |count: u64| types::Value::Integer(integer(count));
        let own = [
            ("key", text(self.key.to_string())),
            ("position", whole(self.position as u64)),
            ("rank", whole(self.rank as u64)),
            ("params", text(self.params.clone())),
            ("seed", whole(self.case.seed)),
            ("steps", whole(self.case.steps)),
            ("sample_stride", whole(self.case.sample_stride)),
            ("cost", types::Value::Real(self.case.cost())),
            ("changed_at", types::Value::Integer(process::now())),
        ];
        let names: Vec<&str> = own.iter().map(|(name, _)| *name).collect();
        let places = vec!["?"; names.len() + AXES.len()].join(", ");
        connection
            .prepare_cached(&format!(
                "INSERT INTO cases ({}, {}) VALUES ({places})
                 ON CONFLICT (key) DO UPDATE SET position = excluded.position, rank = excluded.rank,
                     cost = excluded.cost, steps = excluded.steps",
                names.join(", "),
                axis_columns::names("")
            ))?
            .execute(params_from_iter(
                own.into_iter()
                    .map(|(_, value)| value)
                    .chain(axis_columns::cells(&self.case.params)),
            ))?;
        Ok(())
    }
}
