//! Names of start layers in tables and legends.

use crate::model::axes::Axis;
use crate::store::{Store, StoreError};
use sd_core::Params;
use std::collections::BTreeMap;

/// Start layers by their numbers on the axis. Without a name a layer keeps its number.
#[derive(Debug, Clone, Default)]
pub(crate) struct Starts(pub(super) Vec<(u64, String)>);

impl Starts {
    /// The names in a store.
    pub(crate) fn of_store(store: &Store) -> Result<Self, StoreError> {
        Ok(Self(store.written()?.starts))
    }

    /// The name of the start layer of some parameters, if the axis is that of start layers and
    /// there is a name.
    pub(crate) fn name_on(&self, axis: &Axis, params: &Params) -> Option<String> {
        let start = params.start.as_ref().filter(|_| axis.key == "start")?;
        self.name(start.number()).map(str::to_owned)
    }

    /// The names of several campaigns together.
    pub(super) fn together<'s>(all: impl Iterator<Item = &'s Self>) -> Self {
        Self(all.flat_map(|starts| starts.0.iter().cloned()).collect())
    }

    /// Names of the values on an axis, by the values as text.
    pub(super) fn of_axis(&self, axis: &Axis) -> BTreeMap<String, &str> {
        let named = self.0.iter().filter(|_| axis.key == "start");
        named
            .map(|(number, name)| (number.to_string(), name.as_str()))
            .collect()
    }

    /// The name of a layer.
    pub(super) fn name(&self, number: u64) -> Option<&str> {
        let found = self.0.iter().find(|(known, _)| *known == number);
        found.map(|(_, name)| name.as_str())
    }
}
