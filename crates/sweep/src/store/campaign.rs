//! Taking a campaign file into its store.

use super::{Store, StoreError, axis_columns, integer, process, results};
use crate::axes::AXES;
use crate::campaign::{Campaign, Protocol};
use crate::case::{Case, CaseKey};
use crate::statistics::Averages;
use rusqlite::{OptionalExtension, Transaction, params, params_from_iter, types};
use std::cmp::Reverse;

impl Store {
    /// Makes the cases of the store those of the campaign. Cases already there keep all they have; cases that left the
    /// grid stay stored, without a position.
    ///
    /// # Errors
    /// [`StoreError::OtherCampaign`], and trouble with the file.
    pub fn adopt(&mut self, campaign: &Campaign) -> Result<(), StoreError> {
        let before = self.read(
            self.connection
                .query_row("SELECT name, text, protocol FROM campaign", [], |row| {
                    Ok((
                        row.get::<_, String>(0)?,
                        row.get::<_, String>(1)?,
                        row.get::<_, String>(2)?,
                    ))
                })
                .optional(),
        )?;
        let protocol = self.json("campaign", serde_json::to_string(&campaign.protocol))?;
        if let Some((name, text, old)) = before {
            if name != campaign.name {
                return Err(StoreError::OtherCampaign {
                    path: self.path.clone(),
                    found: name,
                    wanted: campaign.name.clone(),
                });
            }
            if text == campaign.text && old == protocol {
                return Ok(());
            }
        }
        let rows = rows(campaign)
            .map(|row| self.json("cases", row))
            .collect::<Result<Vec<_>, _>>()?;
        self.write(|transaction| {
            transaction.execute(
                "INSERT INTO campaign (id, name, text, protocol) VALUES (1, ?1, ?2, ?3)
                 ON CONFLICT (id) DO UPDATE SET text = excluded.text, protocol = excluded.protocol",
                params![campaign.name, campaign.text, protocol],
            )?;
            transaction.execute("UPDATE cases SET position = NULL", [])?;
            for row in &rows {
                row.insert(transaction)?;
            }
            average_again(transaction, &campaign.protocol)
        })
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

/// A case as it is written to the store.
struct Row<'c> {
    /// Its key.
    key: CaseKey,
    /// The case.
    case: &'c Case,
    /// Place in the file.
    position: usize,
    /// Place in the order of work.
    rank: usize,
    /// Its parameters as JSON.
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
    fn insert(&self, transaction: &Transaction<'_>) -> Result<(), rusqlite::Error> {
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
        transaction
            .prepare_cached(&format!(
                "INSERT INTO cases ({}, {}) VALUES ({places})
                 ON CONFLICT (key) DO UPDATE SET position = excluded.position, rank = excluded.rank,
                     cost = excluded.cost",
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

/// Averages finished runs again whose discarded strain is no longer that of the protocol.
pub(super) fn average_again(
    transaction: &Transaction<'_>,
    protocol: &Protocol,
) -> Result<(), rusqlite::Error> {
    let finished: Vec<(i64, i64, f64, i64)> = transaction
        .prepare(
            "SELECT r.case_id, c.spheres, c.time_step, r.discard_step FROM results r JOIN cases c ON c.id = r.case_id
             WHERE c.position IS NOT NULL",
        )?
        .query_map([], |row| {
            Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
        })?
        .collect::<Result<_, _>>()?;
    for (case, spheres, time_step, discarded) in finished {
        let discard = protocol.with_time_step(time_step).discard_steps();
        if integer(discard) == discarded {
            continue;
        }
        let samples = results::samples(transaction, case)?;
        let averages = Averages::of(&samples, discard);
        let spheres = usize::try_from(spheres).unwrap_or(1);
        results::write_averages(transaction, case, discard, &averages, spheres)?;
    }
    Ok(())
}
