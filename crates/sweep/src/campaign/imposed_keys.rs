//! Keys of imposed values: a file has `pressure` where the column is `imposed_pressure`.

use crate::model::axes::{AXES, Axis};

/// A message about axes, with their keys in files.
pub(super) fn with_written_keys(message: String) -> String {
    let keys = AXES
        .iter()
        .filter_map(|axis| Some((axis.key, axis.written_key()?)));
    keys.fold(message, |message, (key, written)| {
        message.replace(&format!("`{key}`"), &format!("`{written}`"))
    })
}

/// The keys that an axis may have in a file.
pub(super) fn keys_of(axis: &Axis) -> impl Iterator<Item = &'static str> {
    [axis.key].into_iter().chain(axis.written_key())
}
