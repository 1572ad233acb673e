//! Keys of imposed values: a file has `pressure` where the column is `imposed_pressure`.

use crate::model::axes::Axis;

/// The keys in files of axes that are columns of their own beside the measured ones.
pub(super) const IMPOSED: [&str; 3] = ["viscous_number", "macroscopic_friction", "pressure"];

/// A message about axes, with their keys in files.
pub(super) fn with_written_keys(message: String) -> String {
    IMPOSED.iter().fold(message, |message, short| {
        message.replace(&format!("`imposed_{short}`"), &format!("`{short}`"))
    })
}

/// The keys that an axis may have in a file.
pub(super) fn keys_of(axis: &Axis) -> impl Iterator<Item = &'static str> {
    let is_of_axis = |short: &&str| axis.key.strip_prefix("imposed_") == Some(*short);
    [axis.key]
        .into_iter()
        .chain(IMPOSED.into_iter().find(is_of_axis))
}
