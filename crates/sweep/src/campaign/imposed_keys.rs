//! Keys of imposed values: a file has `pressure` where the column is `imposed_pressure`.

/// The keys in files of axes that are columns of their own beside the measured ones.
pub(super) const IMPOSED: [&str; 3] = ["viscous_number", "macroscopic_friction", "pressure"];

/// A message about axes, with their keys in files.
pub(super) fn with_written_keys(message: String) -> String {
    IMPOSED.iter().fold(message, |message, short| {
        message.replace(&format!("`imposed_{short}`"), &format!("`{short}`"))
    })
}
