//! The request of a version of a campaign file.

use super::statements::Statements;
use crate::model::campaign::Campaign;
use crate::model::precision::Precision;
use crate::model::protocol::Discard;
use rusqlite::Connection;
use std::path::PathBuf;

/// The request of a version of a campaign file: its runs, their length, and the averaged part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Request {
    /// Equal exactly for versions that request the same, in any order and wording.
    pub(super) hash: String,
    /// Number and sum of the keys of the runs.
    pub(super) grid: String,
    pub(super) file: PathBuf,
}

impl Request {
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
            let Precision {
                precision,
                quantity,
                at_least,
                at_most,
            } = rule.precision;
            let words = format!(
                "{first} {precision:?} {} {at_least} {at_most}",
                quantity.name()
            );
            hasher.update(words.as_bytes());
        }
        Self {
            hash: hasher.finalize().to_hex()[..32].to_owned(),
            grid,
            file: campaign.file.clone(),
        }
    }

    /// The file whose version of the campaign a store now holds, if its request differs.
    pub(super) fn displaced_by(
        &self,
        connection: &Connection,
    ) -> rusqlite::Result<Option<PathBuf>> {
        let other = "SELECT file FROM campaign WHERE request != ?1";
        let file: Option<String> = connection.value(other, [&self.hash])?;
        Ok(file.map(PathBuf::from))
    }
}

/// Number and sum of some keys, independent of their order.
pub(super) fn grid(keys: impl Iterator<Item = u128>) -> String {
    let (number, sum) = keys.fold((0_u64, 0_u128), |(number, sum), key| {
        (number + 1, sum.wrapping_add(key))
    });
    format!("{number} {sum:032x}")
}
