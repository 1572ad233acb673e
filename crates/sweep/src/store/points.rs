//! The points of a store: parameters of runs that differ only in their seed, as the program reads
//! them and axis by axis.

use super::digest::Sealed;
use super::statements::{Statements, as_json, json};
use crate::data::Value as AxisValue;
use crate::model::axes::AXES;
use crate::model::case::Case;
use rusqlite::types::{Type, Value};
use rusqlite::{Connection, Row};
use sd_core::Params;
use serde::Deserialize;
use std::collections::HashMap;

/// The parameters of points.
pub(super) const SEALED: Sealed = Sealed {
    table: "points",
    columns: "params, axes",
    with_key: false,
    words: "the parameters of a point",
};

/// The points whose ratio of stress and pressure is imposed.
pub(super) const AT_RATIO: &str =
    "SELECT id FROM points WHERE json_extract(axes, '$.imposed_macroscopic_friction') > 0";

/// A case in a row: the parameters of its point, its seed, steps and sample stride.
#[derive(Clone, Deserialize)]
pub(super) struct CaseRow {
    #[serde(deserialize_with = "json")]
    params: Params,
    seed: u64,
    steps: u64,
    sample_stride: u64,
}

impl CaseRow {
    /// The key of the case.
    pub(super) fn key(&self) -> String {
        self.clone().into_case().key().to_string()
    }

    pub(super) fn into_case(self) -> Case {
        Case {
            params: self.params,
            seed: self.seed,
            steps: self.steps,
            sample_stride: self.sample_stride,
        }
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
    pub(super) fn id(&mut self, connection: &Connection, params: &Params) -> rusqlite::Result<i64> {
        if let Some((_, id)) = self.last.as_ref().filter(|(last, _)| last == params) {
            return Ok(*id);
        }
        let point = [as_json(params)?, Value::Text(axes_of(params))];
        let digest = SEALED.digest_of(&point);
        let id = match self.known.get(&digest) {
            Some(id) => *id,
            None => match connection.value("SELECT id FROM points WHERE digest = ?1", [digest])? {
                Some(id) => id,
                None => SEALED.put(connection, None, &point, &[])?,
            },
        };
        self.known.insert(digest, id);
        self.last = Some((params.clone(), id));
        Ok(id)
    }
}

/// All points, with their numbers.
pub(super) fn all(connection: &Connection) -> rusqlite::Result<Vec<(i64, Params)>> {
    connection.all("SELECT id, params FROM points", [], |row| {
        Ok((row.get("id")?, params(row, "params")?))
    })
}

/// Writes the axes of all points as this program knows them.
pub(super) fn renew_axes(connection: &Connection) -> rusqlite::Result<()> {
    for (id, params) in all(connection)? {
        let update = "UPDATE points SET axes = ?2 WHERE id = ?1";
        connection.run(update, (id, axes_of(&params)))?;
    }
    SEALED.seal(connection, "true", [])
}

/// The values of some parameters on all axes as JSON, for the views. Infinity is a number too large
/// for `SQLite`.
fn axes_of(params: &Params) -> String {
    let fragments = AXES.iter().map(|axis| {
        let value = match axis.value(params) {
            // Rate and stress are alternatives, and so are area fraction and volume fraction.
            _ if axis.is_alternative() && !axis.means_something(params) => "null".into(),
            AxisValue::Word(word) => format!("\"{word}\""),
            AxisValue::Count(count) => count.to_string(),
            AxisValue::Number(number) if number == f64::INFINITY => "9e999".into(),
            AxisValue::Number(number) if number == f64::NEG_INFINITY => "-9e999".into(),
            AxisValue::Number(number) => format!("{number:?}"),
        };
        format!("\"{}\":{value}", axis.key)
    });
    format!("{{{}}}", fragments.collect::<Vec<_>>().join(","))
}

/// The parameters in a column of JSON.
pub(super) fn params(row: &Row<'_>, column: &str) -> rusqlite::Result<Params> {
    serde_json::from_str(row.get_ref(column)?.as_str()?)
        .map_err(|error| rusqlite::Error::FromSqlConversionFailure(0, Type::Text, Box::new(error)))
}
