//! Names of start layers.

use crate::data::Value;
use crate::model::axes::Axis;
use crate::store::{Store, StoreError};
use sd_core::Params;

/// Names of start layers, by their numbers on the axis. Without a name a layer keeps its number.
#[derive(Debug, Clone, Default)]
pub(crate) struct Starts(pub(super) Vec<(u64, String)>);

impl Starts {
    /// The names in a store.
    pub(crate) fn of_store(store: &Store) -> Result<Self, StoreError> {
        Ok(Self(store.written()?.starts))
    }

    /// The name of the value of some parameters on an axis, if it is a start layer with a name.
    pub(crate) fn name_on(&self, axis: &Axis, params: &Params) -> Option<&str> {
        let Value::Count(start) = axis.value(params) else {
            return None;
        };
        let mut known = self.0.iter().filter(|_| axis.key == "start");
        let found = known.find(|(number, _)| *number == start);
        found.map(|(_, name)| name.as_str())
    }
}
