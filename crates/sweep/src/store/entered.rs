//! The row of the campaign: which version of the campaign file was last run with a store.

use super::digest::{DigestMismatch, Sealed};
use super::statements::{Statements, as_json};
use crate::model::campaign::{AsWritten, Campaign};
use crate::model::precision::Precision;
use crate::model::protocol::Protocol;
use rusqlite::{Connection, Row};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The campaign.
pub(super) const SEALED: Sealed = Sealed {
    table: "campaign",
    columns: "name, text, entered, written",
    with_key: false,
    words: "the campaign",
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
        hasher.update(&campaign.protocol.discard.to_bits().to_le_bytes());
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
        Ok(LastRun::read(connection)?.entered)
    }

    /// Replaces that of a store.
    pub(super) fn write(&self, connection: &Connection) -> rusqlite::Result<()> {
        connection.execute("UPDATE campaign SET entered = ?1", [as_json(self)?])?;
        SEALED.seal(connection, "true", [])
    }

    /// The file whose version of the campaign a store now holds, if its request differs.
    pub(super) fn displaced_by(
        &self,
        connection: &Connection,
    ) -> rusqlite::Result<Option<PathBuf>> {
        let found = connection.find("SELECT entered FROM campaign", [], |row| {
            document::<Self>(row, "entered")
        })?;
        let other = found.filter(|found| found.request != self.request);
        Ok(other.map(|found| found.file.into()))
    }
}

/// The version of the campaign last run with a store.
pub(super) struct LastRun {
    pub(super) name: String,
    pub(super) text: String,
    pub(super) entered: Entered,
    pub(super) written: AsWritten,
}

impl LastRun {
    /// That of a store.
    ///
    /// # Errors
    /// [`DigestMismatch`] where the campaign was changed, or there is none.
    pub(super) fn read(connection: &Connection) -> rusqlite::Result<Self> {
        let found = SEALED.all(connection, "true", [], |row| {
            Ok(Self {
                name: row.get("name")?,
                text: row.get("text")?,
                entered: document(row, "entered")?,
                written: document(row, "written")?,
            })
        })?;
        let missing = || DigestMismatch::error("it holds no campaign");
        found.into_iter().next().ok_or_else(missing)
    }

    /// That of a store that may be new; a damaged one is rewritten.
    pub(super) fn find(connection: &Connection) -> rusqlite::Result<Option<Self>> {
        match Self::read(connection) {
            Err(error) if DigestMismatch::in_error(&error).is_some() => Ok(None),
            last => last.map(Some),
        }
    }

    /// Whether another version must be written in its place: not for the same text in another
    /// folder.
    pub(super) fn differs(&self, campaign: &Campaign, entered: &Entered) -> bool {
        let here = Entered {
            file: self.entered.file.clone(),
            ..entered.clone()
        };
        self.text != campaign.text || self.entered != here
    }
}

/// Writes the row of a campaign.
pub(super) fn put(
    connection: &Connection,
    campaign: &Campaign,
    entered: &Entered,
) -> rusqlite::Result<()> {
    let row = [
        campaign.name.clone().into(),
        campaign.text.clone().into(),
        as_json(entered)?,
        as_json(&campaign.written)?,
    ];
    SEALED
        .put(connection, None, &row, &[("id", 1.into())])
        .map(drop)
}

/// Number and sum of some keys, independent of their order.
pub(super) fn grid(keys: impl Iterator<Item = u128>) -> String {
    let (number, sum) = keys.fold((0_u64, 0_u128), |(number, sum), key| {
        (number + 1, sum.wrapping_add(key))
    });
    format!("{number} {sum:032x}")
}

/// The JSON of a column of the campaign.
fn document<T: DeserializeOwned>(row: &Row<'_>, column: &str) -> rusqlite::Result<T> {
    let text = row.get_ref(column)?.as_str()?;
    serde_json::from_str(text).map_err(|error| DigestMismatch::error(error.to_string()))
}
